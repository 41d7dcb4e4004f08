"""What a camera sees of the board.

This room imports of ours only ``hardware.interfaces``, ``hardware.table`` and ``hardware.loading``, and so knows
nothing of simulations.
"""
