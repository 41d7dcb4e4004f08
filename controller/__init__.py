"""The arm's controller: its model, the control law, protection, and the server that ticks with the plant.

This room imports of ours only ``hardware.interfaces``, ``hardware.parameters`` and ``hardware.table``.
"""
