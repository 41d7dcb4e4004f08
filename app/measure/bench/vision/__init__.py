"""Bench ``vision``: its rows, and the scenes that they are measured in."""
