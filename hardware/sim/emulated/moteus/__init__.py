"""Emulated moteus controllers: registers, modes and console behind the text of an fdcanusb on a pseudo-terminal.

Not emulated: the CAN bus's own time (some 80 µs for a frame), currents, and everything that drivers here never ask for.
"""
