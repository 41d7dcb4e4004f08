"""A simulation of our own: its settings, its processes, and the devices that it offers."""
