"""Devices and the things on the table: seams, parameters, table geometry, simulated world and drivers.

This room imports nothing of ours; every other room may lean on it.
"""
