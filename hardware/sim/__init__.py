"""The simulated plant: arm, gripper, board and pieces in MuJoCo, as a process of its own.

It offers what a lab offers (a servo bus, a camera's view) and, through the referee alone, the truth. It derives the
arm from the parameters by itself and does not use ``controller.model``: two derivations of one robot check each other.
"""
