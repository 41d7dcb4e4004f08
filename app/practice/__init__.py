"""Learning at the board: a coach, puzzles, a repertoire, games at odds."""
