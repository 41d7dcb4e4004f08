"""Who chooses the moves: engines, given lines, people."""
