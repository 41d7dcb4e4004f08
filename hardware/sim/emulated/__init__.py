"""Emulated drives: devices that speak a real bus's own language on one side, and move the simulated plant on the other.

They run in one process with the world, in pace real. Drivers of ``hardware.drives`` cannot tell them from real ones.
"""
