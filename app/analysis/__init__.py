"""What an engine thinks of a game: evaluations, mistakes, accuracy, openings by name, an annotated PGN."""
