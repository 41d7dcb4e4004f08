"""Measurements that say whether a bar is held: ``touchmove bench NAME``. One module for each bench."""
