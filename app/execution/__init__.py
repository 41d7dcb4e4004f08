"""What the arm and people do to the board: transfers carried out, looked at and put right."""
