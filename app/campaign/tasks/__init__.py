"""What a seed of a campaign plays: games, sessions with a scripted person, settings up; and what goes wrong in them."""
