"""Benches, figures and games in photographs: what measures the robot. Only the command line imports it."""
