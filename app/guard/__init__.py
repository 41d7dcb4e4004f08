"""Hands over the board slow and stop the arm."""
