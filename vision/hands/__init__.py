"""Whether a hand is over the board, whether anything moves, and since when it is settled."""
