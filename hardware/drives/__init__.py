"""Drivers of real drives: a bus of each kind behind ``ServoBus``. Nothing here knows the simulation.

What all kinds share lies in this folder: settings, scaling between motor and joint, velocity, rating, faults.
"""
