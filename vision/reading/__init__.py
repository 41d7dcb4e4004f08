"""What changed on the board, and which move that was."""
