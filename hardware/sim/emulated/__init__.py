"""Devices emulated at the level of their wire."""
