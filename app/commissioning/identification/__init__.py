"""What a robot weighs and how it rubs, found from a motion that shows it: ``touchmove identify``."""
