"""Benches of robots that nobody knows: identified, and brought up to their first game."""
