"""The voice at the board: what is said aloud, and what is understood of what people say."""
