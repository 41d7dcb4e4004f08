"""Who plays what on which rig: matches, sessions, replays, set-ups, and a game's devices put together."""
