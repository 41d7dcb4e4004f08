"""What a camera sees of the board.

This room imports of ours only ``hardware.interfaces`` and ``hardware.table``, and so knows nothing of simulations.
"""
