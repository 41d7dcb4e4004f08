"""The world's process: its server, its settings, and what it does for each kind of client."""
