"""Pictures of the simulated world, drawn in a process of their own."""
