"""A person's hand as MuJoCo bodies: fingertips that pinch, a palm, a forearm in its sleeve.

The hand hangs on position servos of limited force, as soft and as strong as a person's: three slides, a turn about the
vertical, and one slide for each of thumb and index finger. What a robot feels of it is ISO/TS 15066's: 0.6 kg behind a
spring of 75 N/mm. The robot meets a skin on that spring; pieces and board meet the fingers themselves. So a hand that
is pressed on the board gives by its spring, and the force on it is the spring's.

Frame of the hand: origin in the middle between the fingertips, x along the pinch from thumb to index finger, −y back
along the forearm, z up.
"""

import math
from functools import cache
from typing import Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.piece_set import Colour
from hardware.sim.bodies.arm import TOOL_BITS
from hardware.sim.bodies.finger_world import MASS, STIFFNESS

NAME: Final = "hand"
SENSOR: Final = "hand_force"
"""Net force of the robot on the skin [N], world frame; the spring's is what counts."""
SPRINGS: Final = ("skin_x", "skin_y", "skin_z")
"""Joints of the skin, and sensors of how far the spring is pressed in [m]."""
JOINTS: Final = ("hand_x", "hand_y", "hand_z", "hand_yaw", "hand_thumb", "hand_index")
"""Each with an actuator of the same name, in this order, after the robot's."""

TIP_RADIUS: Final = 0.006
"""Of a fingertip [m]: narrow ones, that pass between pieces on squares of 40 mm."""
_TIP_HALF_WIDTH: Final = 0.005
_FLESH_SEEN: Final = 0.001
"""A finger looks so much thicker than it is where it presses on something [m]."""
DISTAL: Final = 0.040
"""A finger's last two bones stand upright for so long [m]."""
WIDEST_GAP: Final = 0.030

FINGER_MASS: Final = 0.03
"""Of thumb or index finger alone [kg], assumed; part of ISO's 0.6 kg, which are what is felt at the fingertips."""
SKIN_MASS: Final = 0.08
"""Of the skin on its spring [kg], part of the 0.6 kg. √(75 N/mm / 0.08 kg) times a tick of 0.88 ms is 0.85, well below
the 2 at which a spring that is stepped through time would no longer be one."""
_HAND_MASS: Final = MASS - 2.0 * FINGER_MASS - SKIN_MASS
_TURNING_INERTIA: Final = 0.004
"""Of hand and forearm about the fingertips' vertical axis [kg m²], assumed."""

STRENGTH: Final = 40.0
"""Most with which the hand pushes or pulls [N]; a person who is not on guard."""
REACH_STIFFNESS: Final = 600.0
"""Of the arm that holds the hand [N/m]; people's is some 100 to 800 N/m, and critically damped with the hand's mass."""
_TURNING_STIFFNESS: Final = 8.0
_TURNING_STRENGTH: Final = 2.0
PINCH_STIFFNESS: Final = 1000.0
"""Of each finger [N/m]."""
_PINCH_STRENGTH: Final = 8.0

_FLESH_FRICTION: Final = (0.8, 0.002, 0.0001)
"""Skin on lacquered wood: 0.5 to 1 (assumed); torsional for a patch of some millimetres [m]."""
_FLESH_SOLREF: Final = (0.004, 1.0)
_FLESH_SOLIMP: Final = (0.97, 0.99, 0.0003, 0.5, 2.0)
"""As the robot's pads: what gives in a pinch are the fingers' servos."""
_SKIN_DAMPING: Final = 15.0
"""Of that spring [N s/m]; a tenth of what would keep the skin from swinging."""
_SKIN_SOLREF: Final = (0.002, 1.0)
_SKIN_SOLIMP: Final = (0.9999, 0.9999, 0.001, 0.5, 2.0)
"""A hard surface: what gives is the spring; as in ``finger_world``."""
GRAVITY: Final = 9.81

SKIN_RGBA: Final = (0.86, 0.64, 0.52, 1.0)
SLEEVE_RGBA: Final = (0.17, 0.25, 0.42, 1.0)
_CUFF_RGBA: Final = (0.92, 0.92, 0.94, 1.0)

Vector = tuple[float, float, float]
Bone = tuple[Vector, Vector, float]
"""Both ends [m], frame of the hand, and the radius [m]."""

KNUCKLE: Final[Vector] = (0.024, -0.052, 0.080)
"""Of the index finger; the thumb's root is its mirror image."""
PALM: Final[Bone] = ((0.0, -0.060, 0.086), (0.0, -0.115, 0.090), 0.020)
FOREARM: Final[Bone] = ((0.0, -0.135, 0.092), (0.0, -0.400, 0.165), 0.030)
SLEEVE: Final[Bone] = ((0.0, -0.260, 0.126), (0.0, -0.700, 0.248), 0.043)


_DISC_SPACING: Final = 0.005


class HandPose(NamedTuple):
    """Where a hand is."""

    x: float
    """Of the middle between the fingertips, board frame [m]."""
    y: float
    z: float
    """Of the centres of the fingertips' rounded ends [m]."""
    yaw: float
    """0 where the forearm points along −y, as white's does; counter-clockwise [rad]."""
    gap: float
    """Of each fingertip's inner side from the middle [m]."""


def parked(side: Colour) -> HandPose:
    """Where a player's hand is while it has nothing to do: outside the pictures and out of the arm's reach."""
    if side is Colour.WHITE:
        return HandPose(0.10, -0.72, 0.10, 0.0, 0.0)
    return HandPose(-0.10, 0.72, 0.10, math.pi, 0.0)


def seen_from_above(x: float, y: float, yaw: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Discs that cover the hand, its forearm and sleeve, seen from above, at most 5 mm apart, for ``HandPose``'s x, y
    and yaw.

    Returns their centres (n, 2), board frame, and radii (n,) [m].
    """
    centres, radii = _discs()
    cos, sin = math.cos(yaw), math.sin(yaw)
    turned = centres @ np.array([[cos, sin], [-sin, cos]])
    return turned + np.array([x, y]), radii


@cache
def _discs() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """In the frame of the hand: (n, 2) and (n,) [m]."""
    bones = [_shifted(bone, side * TIP_RADIUS) for side in (-1, 1) for bone in finger_bones(side)]
    centres, radii = [], []
    for start, end, radius in (*bones, PALM, FOREARM, SLEEVE):
        count = 2 + int(math.dist(start[:2], end[:2]) / _DISC_SPACING)
        centres.append(np.linspace(start[:2], end[:2], count))
        radii.append(np.full(count, radius))
    return np.concatenate(centres), np.concatenate(radii)


def finger_bones(side: int) -> tuple[Bone, Bone]:
    """Upright end and slanting root of thumb (−1) or index finger (1), with its inner side at x = 0."""
    x = side * TIP_RADIUS
    root = (side * KNUCKLE[0], KNUCKLE[1], KNUCKLE[2])
    return ((x, 0.0, 0.0), (x, 0.0, DISTAL), TIP_RADIUS), ((x, 0.0, DISTAL), root, 0.0080)


def _bone(body: mujoco.MjsBody, bone: Bone, **options: object) -> mujoco.MjsGeom:
    start, end, radius = bone
    return body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[*start, *end], size=[radius, 0, 0], mass=0.0, **options
    )


def _add_skin(hand: mujoco.MjsBody) -> None:
    """What the robot meets, on its spring."""
    skin = hand.add_body(name="hand_skin")
    skin.mass, skin.explicitinertial = SKIN_MASS, True
    skin.ipos, skin.inertia = [0.0, 0.0, 0.0], [2e-4] * 3
    for name, axis in zip(SPRINGS, ([1, 0, 0], [0, 1, 0], [0, 0, 1]), strict=True):
        skin.add_joint(
            name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, stiffness=STIFFNESS, damping=_SKIN_DAMPING
        )
    fingers = [_shifted(bone, side * TIP_RADIUS) for side in (-1, 1) for bone in finger_bones(side)]
    for bone in (*fingers, PALM, FOREARM):
        _bone(
            skin, bone, contype=0, conaffinity=TOOL_BITS, friction=[0.5, 0.005, 0.0001], group=3, rgba=[0, 0, 0, 0],
            priority=2, solref=list(_SKIN_SOLREF), solimp=list(_SKIN_SOLIMP),
        )  # fmt: skip


def _shifted(bone: Bone, aside: float) -> Bone:
    (a, b, c), (d, e, f), radius = bone
    return (a + aside, b, c), (d, e, f), radius


def _add_flesh(finger: mujoco.MjsBody, name: str, side: int) -> None:
    """What pieces and board meet: a flat fingertip, as soft ones become on what they hold, and the finger's root.

    MuJoCo finds one contact between two capsules that are not quite parallel, and a piece would swing about it.
    """
    (low, high, radius), root = finger_bones(side)
    options = {
        "contype": TOOL_BITS, "conaffinity": 0, "condim": 4, "friction": list(_FLESH_FRICTION), "priority": 1,
        "solref": list(_FLESH_SOLREF), "solimp": list(_FLESH_SOLIMP), "group": 3, "rgba": [0, 0, 0, 0], "mass": 0.0,
    }  # fmt: skip
    finger.add_geom(
        name=f"{name}_tip", type=mujoco.mjtGeom.mjGEOM_BOX, pos=[low[0], 0.0, (low[2] - radius + high[2]) / 2.0],
        size=[radius, _TIP_HALF_WIDTH, (high[2] - low[2] + radius) / 2.0], **options,
    )  # fmt: skip
    start, end, thickness = root
    finger.add_geom(
        name=f"{name}_root", type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[*start, *end], size=[thickness, 0, 0],
        **options,
    )  # fmt: skip


def _add_look(body: mujoco.MjsBody, bone: Bone, rgba: tuple[float, ...] = SKIN_RGBA) -> None:
    _bone(body, bone, contype=0, conaffinity=0, group=1, rgba=list(rgba))


def _add_servo(spec: mujoco.MjSpec, joint: str, stiffness: float, mass: float, strength: float, hold: float) -> None:
    """A position servo, critically damped for the mass that it moves [kg, kg m²], on a joint of its name.

    ``stiffness`` [N/m, N m/rad]; ``strength`` is the largest force beyond ``hold`` [N, N m], which is constant: what
    the muscles do against gravity [N].
    """
    servo = spec.add_actuator(
        name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT, gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE, forcelimited=True, forcerange=[hold - strength, hold + strength],
    )  # fmt: skip
    servo.gainprm[0] = stiffness
    servo.biasprm[0], servo.biasprm[1] = hold, -stiffness
    servo.biasprm[2] = -2.0 * math.sqrt(stiffness * mass)


def servo_constants() -> tuple[tuple[float, float], ...]:
    """Stiffness and mass that each joint's servo is made for, in the order of ``JOINTS``; SI."""
    reach, pinch = (REACH_STIFFNESS, MASS), (PINCH_STIFFNESS, FINGER_MASS)
    return (reach, reach, reach, (_TURNING_STIFFNESS, _TURNING_INERTIA), pinch, pinch)


def _add_finger(hand: mujoco.MjsBody, name: str, side: int) -> None:
    finger = hand.add_body(name=f"hand_{name}")
    finger.mass, finger.explicitinertial = FINGER_MASS, True
    finger.ipos, finger.inertia = [0.0, 0.0, 0.0], [2e-5, 2e-5, 5e-6]
    finger.add_joint(
        name=f"hand_{name}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[side, 0, 0], limited=True, range=[0.0, WIDEST_GAP]
    )
    for bone in finger_bones(side):
        start, end, radius = bone
        _add_look(finger, (start, end, radius + _FLESH_SEEN))
    _add_flesh(finger, f"hand_{name}", side)


def _add_looks(hand: mujoco.MjsBody) -> None:
    """Palm, the three fingers that are not used, curled in, and the sleeve."""
    for geom_type, centre, size in (
        (mujoco.mjtGeom.mjGEOM_ELLIPSOID, (0.012, -0.088, 0.088), (0.040, 0.050, 0.017)),
        (mujoco.mjtGeom.mjGEOM_ELLIPSOID, (-0.020, -0.075, 0.082), (0.018, 0.034, 0.016)),
    ):
        hand.add_geom(
            type=geom_type, pos=list(centre), size=list(size), mass=0.0, contype=0, conaffinity=0, group=1,
            rgba=list(SKIN_RGBA),
        )  # fmt: skip
    for x, forward, radius in ((0.030, -0.016, 0.0078), (0.040, -0.030, 0.0072), (0.049, -0.042, 0.0064)):
        knuckle, joint = (x - 0.004, -0.062, 0.089), (x, forward, 0.079)
        _add_look(hand, (knuckle, joint, radius))
        _add_look(hand, (joint, (x - 0.003, forward - 0.014, 0.060), radius))
    start, end, radius = FOREARM
    _add_look(hand, ((0.0, -0.115, 0.090), (0.0, -0.150, 0.096), 0.0235))
    _add_look(hand, (start, end, radius))
    (x, y, z), far, wide = SLEEVE
    _add_look(hand, ((x, y + 0.012, z - 0.003), (x, y - 0.02, z + 0.005), 0.037), _CUFF_RGBA)
    _add_look(hand, ((x, y, z), far, wide), SLEEVE_RGBA)


def add_hand(spec: mujoco.MjSpec, side: Colour) -> None:
    """Add a player's hand to a scene, where it is parked; joints are in the board frame."""
    x, y, z, yaw, _ = parked(side)
    turn = 1.0 if side is Colour.WHITE else -1.0  # slides' axes are given in a frame that is turned by the yaw
    hand = spec.worldbody.add_body(name=NAME, pos=[x, y, z], quat=[math.cos(yaw / 2.0), 0.0, 0.0, math.sin(yaw / 2.0)])
    hand.sleep = mujoco.mjtSleepPolicy.mjSLEEP_ALLOWED
    hand.mass, hand.explicitinertial = _HAND_MASS, True
    hand.ipos, hand.inertia = [0.0, 0.0, 0.0], [_TURNING_INERTIA] * 3
    slides = zip(JOINTS[:3], ([turn, 0, 0], [0, turn, 0], [0, 0, 1]), (x, y, z), strict=True)
    for name, axis, start in slides:
        hand.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, ref=start)
    hand.add_joint(name=JOINTS[3], type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1], ref=math.degrees(yaw))
    _add_skin(hand)
    _add_looks(hand)
    _add_finger(hand, "thumb", -1)
    _add_finger(hand, "index", 1)
    for finger in ("hand_thumb", "hand_index"):
        spec.add_exclude(bodyname1=finger, bodyname2="hand_skin")
    strengths = (STRENGTH, STRENGTH, STRENGTH, _TURNING_STRENGTH, _PINCH_STRENGTH, _PINCH_STRENGTH)
    for joint, (stiffness, mass), strength in zip(JOINTS, servo_constants(), strengths, strict=True):
        _add_servo(spec, joint, stiffness, mass, strength, MASS * GRAVITY if joint == "hand_z" else 0.0)
    net_force = 3
    spec.add_sensor(
        name=SENSOR, type=mujoco.mjtSensor.mjSENS_CONTACT, objtype=mujoco.mjtObj.mjOBJ_BODY, objname="hand_skin",
        reftype=mujoco.mjtObj.mjOBJ_XBODY, refname="base", intprm=[2, net_force, 1],
    )  # fmt: skip
    for name in SPRINGS:
        spec.add_sensor(
            name=name, type=mujoco.mjtSensor.mjSENS_JOINTPOS, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=name
        )
