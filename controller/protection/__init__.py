"""What keeps the arm within its limits, below the law and independent of it."""
