"""Cameras: RealSense, webcams, recordings, and a RealSense made of software."""
