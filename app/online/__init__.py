"""Games on Lichess: a person at the board against people, or our engine against whoever challenges it."""
