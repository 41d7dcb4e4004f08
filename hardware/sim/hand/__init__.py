"""A simulated person's hand at work: what it sees, plans and does."""
