"""The control laws, and what they know of forces."""
