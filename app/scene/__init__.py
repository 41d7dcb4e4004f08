"""What a picture of the robot is made of, as plain numbers: the arm's solids in a pose, the board, the pieces."""
