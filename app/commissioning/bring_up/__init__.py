"""From the first switch-on of an arm to its first game, step by step: ``touchmove commission``."""
