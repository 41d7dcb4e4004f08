"""The chess engine: a UCI process under python-chess, its strength and deadlines, and varied openings.

This room imports nothing of ours.
"""
