"""Drivers of real drives."""
