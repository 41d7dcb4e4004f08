"""What the world does for cameras: single frames, streams, and positions for films."""
