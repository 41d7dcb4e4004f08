"""What the simulated world is made of, as MuJoCo bodies: arm, board, pieces, a person's hand."""
