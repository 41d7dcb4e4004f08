"""What touches what in the world, and how stiff that is: each pair with its stiffness and where the number is from.

A stiffness holds for the blow for which it is stated. Of a blow by something much lighter the contact is softer, since
a step of 0.88 ms cannot resolve it: two free pieces that knock against each other part after 0.3 ms in the world, and
after some ms here. Their impulses are right; their forces, which nobody feels, are not.
"""

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import mujoco

from hardware.parameters import Pads
from hardware.sim.bodies.mujoco_contact import Contact, Solver

FOOT_FRICTION: Final = 0.45
"""Felt on lacquered wood (assumed)."""
WOOD_FRICTION: Final = 0.4
"""Lacquered wood on wood and on metal (assumed)."""
PAD_TORSION: Final = (0.005, 0.0001)
"""Friction of a pad against turning and rolling [m]: of a contact some mm wide."""
FACES_OF_A_PAD: Final = 2
POINTS_OF_A_FACE: Final = 2
"""Where a flat face meets a stem along its length."""
POINTS_OF_A_FOOT: Final = 4
POINTS_OF_AN_EDGE: Final = 2
POINTS_OF_A_BOX: Final = 4


WALL: Final = "wall."
LINED: Final = "lining."
"""Names of a box's walls and of its floor begin so."""


class Pair(NamedTuple):
    """Two surfaces that can meet."""

    what: str
    """Meets what."""
    contact: Contact
    """How."""
    source: str
    """Of the number."""


FOOT_ON_BOARD: Final = Pair(
    "a held piece and the board",
    Contact(stiffness=1.0e5, mass=1.1, damping_ratio=0.12, followed=0.08),
    "felt of 2 mm on 2 cm² (assumed: its modulus is some MPa); it gives back little of what it takes",
)
PAD_ON_PIECE: Final = Pair(
    "a finger's pad and a piece",
    Contact(stiffness=2.0e4, mass=0.54, damping_ratio=0.12, followed=0.02),
    "a tactile sensor of 3 mm silicone behind the pad (assumed: 1 cm², modulus 1 MPa, and the finger bends)",
)
TOOL_ON_BOARD: Final = Pair(
    "the gripper and the board",
    Contact(stiffness=3.0e5, mass=1.1, damping_ratio=0.12, followed=0.1),
    "the gripper's fingers and the flange's joints give way before wood does (assumed)",
)
TOOL_ON_PIECE: Final = Pair(
    "the gripper and a standing piece",
    Contact(stiffness=2.0e5, mass=1.1, damping_ratio=0.12, followed=0.15),
    "as on the board, and the piece's neck (assumed)",
)
PIECE_IN_BOX: Final = Pair(
    "a piece and a box",
    Contact(stiffness=1.0e4, mass=0.02, damping_ratio=0.5, followed=0.06),
    "3 mm of felt on thin wood, met by a piece's edge (assumed); a sixth of the speed of a fall is left",
)
"""Nobody feels its force, so that it is not among those whose peak has to be that of an undamped blow."""
PAIRS: Final = (FOOT_ON_BOARD, PAD_ON_PIECE, TOOL_ON_BOARD, TOOL_ON_PIECE)


def give_stiffness(
    spec: mujoco.MjSpec, model: mujoco.MjModel, pads: Pads, pieces: Mapping[str, float], feet: Contact
) -> None:
    """Make every contact of a world as stiff as its pair says.

    MuJoCo scales a contact by the masses of bodies at the start, those of the ``model`` compiled from ``spec``;
    ``pieces`` are by name what each has of the usual friction, ``feet`` theirs on the board.
    """
    fingers = [f"{part}_{side}" for side in ("right", "left") for part in ("pad_a", "pad_b", "bar")]
    masses = {piece: _lighter(model, model.body(piece).id) for piece in pieces}
    typical = sum(masses.values()) / max(1, len(masses))
    boxes = [geom.name for geom in spec.geoms if geom.name.startswith((WALL, LINED))]
    if pieces:
        for name in boxes:
            _set(spec.geom(name), PIECE_IN_BOX.contact.solver(typical, POINTS_OF_AN_EDGE), priority=2)
    for name in (*fingers, "gripper_body", "flange"):
        points = POINTS_OF_A_BOX * (len(fingers) if name in fingers else 1)
        solver = TOOL_ON_BOARD.contact.solver(_lighter(model, model.geom(name).bodyid[0]), points)
        for hard in ("deck", *boxes):
            spec.add_pair(
                geomname1=name, geomname2=hard, condim=3, solref=list(solver.solref), solimp=list(solver.solimp),
                friction=[WOOD_FRICTION, WOOD_FRICTION, *3 * PAD_TORSION[1:]],
            )  # fmt: skip
        if pieces and not name.startswith("pad"):
            _set(spec.geom(name), TOOL_ON_PIECE.contact.solver(typical, POINTS_OF_A_FACE), priority=2)
    finger = model.body("finger_right").id
    share = FACES_OF_A_PAD * POINTS_OF_A_FACE * _along_the_finger(pads)
    for piece, mass in masses.items():
        _set(spec.geom(f"{piece}.foot"), feet.solver(mass, POINTS_OF_A_FOOT), priority=1)
        stem, held = spec.geom(f"{piece}.stem"), _lighter(model, model.body(piece).id, finger)
        _set(stem, PAD_ON_PIECE.contact.solver(held, share), priority=1)
        stem.condim, stem.friction = 4, [pieces[piece] * pads.friction, *PAD_TORSION]


def _along_the_finger(pads: Pads) -> float:
    """Share of a face's stiffness along the finger axis: it meets the stem obliquely, and slides with friction."""
    return math.cos(pads.groove_angle) ** 2 * (1.0 + pads.friction * math.tan(pads.groove_angle))


def _lighter(model: mujoco.MjModel, *bodies: int) -> float:
    """The mass by which MuJoCo scales a contact of these bodies, the others being fixed [kg]."""
    return 1.0 / sum(float(model.body_invweight0[body, 0]) for body in bodies)


def _set(geom: mujoco.MjsGeom, solver: Solver, priority: int) -> None:
    geom.solref, geom.solimp, geom.priority = list(solver.solref), list(solver.solimp), priority
