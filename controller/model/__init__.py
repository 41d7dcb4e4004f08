"""Kinematics and dynamics of the delta arm, compiled; derivations are in ``docs/derivations.md``.

Frame ``base``: origin at the centre of the base, z3 down (gravity along +z3), arm 1 along +y, arms 2 and 3 turned by
R_z(-2π/3) and R_z(+2π/3) as in the paper. Angles are the paper's: q_i = (q_i1, q_i2, q_i3) of arm i, y the three
measured q_i1, x = (q_12, q_13, q_22, q_23, q_32, q_33).
"""
