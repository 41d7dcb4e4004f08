"""What is recorded: the game that events tell, openings by name, the list of games, what 3-D draws."""
