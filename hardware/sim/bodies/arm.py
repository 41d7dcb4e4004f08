"""The delta arm and its gripper as MuJoCo bodies, from the parameters alone.

Bodies live in a ``base`` body whose frame is the paper's: z₃ down, arm 1 along +y. Each arm is a proximal link on a
servomotor's hinge and a distal link on a universal joint; the pair of distal rods always stays parallel, so both move
alike and are lumped into one rod of the pair's mass. The flange only translates (the parallelograms keep its
orientation), hence three slide joints; a ``connect`` constraint per arm closes the loop at the flange.
"""

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.parameters import RobotParameters
from hardware.sim.bodies.marker import add_marker, add_marker_looks

ARM_ANGLES = (0.0, -2.0 * math.pi / 3.0, 2.0 * math.pi / 3.0)
"""Rotation of arms 1, 2, 3 about z₃ [rad]."""

CLOSURE_SOLREF = (0.002, 1.0)
CLOSURE_SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)
"""Stiff closures: at softer impedances a closed chain's instantaneous acceleration is wrong."""

CLOSURE_SHARE = 0.1
"""Stiffest impedance still leaves a loop an error of 1e-4 of what the light rods could bear, which lets a weighed-out
arm fall by 2 mm/s². Asked for a tenth of it, it falls by 0.4 mm/s²."""

FRICTION_SOLREF = (0.002, 1.0)
"""Stiff enough that closed brakes creep by less than 1 µm/s under gravity."""

TOOL_BITS, SCENE_BITS = 2, 1
"""Collision classes: tool against scene, scene against scene, never tool against tool."""

GRIPPER_BODY_HALF = (0.040, 0.016, 0.0115)
GRIPPER_BODY_CLEARANCE = 0.052
"""Underside of the gripper's body above the pads' centre [m]: a king beside a gripped pawn must fit below it."""
FINGER_HALF_WIDTH = 0.006
"""Of the finger's bar, across the finger axis [m]."""
AWAKE = 0.001
"""What comes so near to the tool does not sleep [m]: a piece that leans on a finger trembles, touches it in three ticks
of four, and asleep would stay askew when the finger goes."""

PAD_SOLREF = (0.004, 1.0)
PAD_SOLIMP = (0.97, 0.99, 0.0003, 0.5, 2.0)


def inverse_kinematics(parameters: RobotParameters, tool: NDArray[np.float64]) -> NDArray[np.float64]:
    """Joint positions (3 arms × [servomotor, universal 1, universal 2]) [rad] that put the tool at a point (3,) in the
    base frame [m].

    The universal joint's angles are this model's own: first about the tangent, relative to the proximal link, then
    about the rod's normal. Only used to place the arm before the world starts. Raises ``ValueError`` if an arm cannot
    reach the point.
    """
    g = parameters.geometry
    joints = np.empty((3, 3))
    for arm, angle in enumerate(ARM_ANGLES):
        cos, sin = math.cos(angle), math.sin(angle)
        x = cos * tool[0] + sin * tool[1]
        y = -sin * tool[0] + cos * tool[1] + g.flange_radius - g.base_radius
        z = tool[2] - g.gripper_height
        reach = math.hypot(y, z)
        in_plane = g.distal_length**2 - x**2
        if in_plane <= 0.0:
            raise ValueError(f"arm {arm + 1} cannot reach {tool.tolist()} m: {abs(x):.3f} m aside")
        along = (g.proximal_length**2 + reach**2 - in_plane) / (2.0 * g.proximal_length)
        if abs(along) > reach:
            raise ValueError(f"arm {arm + 1} cannot reach {tool.tolist()} m: {reach:.3f} m away")
        servo = math.atan2(z, y) - math.acos(along / reach)  # outward: the elbow lies outside the line to the flange
        rod = np.array([x, y - g.proximal_length * math.cos(servo), z - g.proximal_length * math.sin(servo)])
        joints[arm] = servo, math.atan2(rod[2], rod[1]) - servo, -math.asin(rod[0] / g.distal_length)
    return joints


def _inertial(body: mujoco.MjsBody, mass: float, centre: tuple[float, float, float], diagonal: list[float]) -> None:
    body.mass, body.ipos, body.inertia = mass, list(centre), diagonal
    body.explicitinertial = True


def _rod_inertia(mass: float, length: float) -> list[float]:
    across = mass * length**2 / 12.0
    return [across, 1e-3 * across, across]


def _add_link(proximal: mujoco.MjsBody, parameters: RobotParameters, arm: int) -> None:
    """Mass, centre and inertia of a proximal link: a uniform bar, unless the arm's own numbers are known.

    About a fixed axis mass and centre show in their product alone: the bar is one that has this product and the inertia
    about the axis.
    """
    inertia, length = parameters.inertia, parameters.geometry.proximal_length
    mass = inertia.proximal_mass
    if parameters.arms is not None:
        own = parameters.arm(arm)
        about = own.hinge_inertia - inertia.rotor_inertia
        mass, length = 4.0 / 3.0 * own.proximal_moment**2 / about, 1.5 * about / own.proximal_moment
    _inertial(proximal, mass, (0.0, length / 2.0, 0.0), _rod_inertia(mass, length))


def _capsule(body: mujoco.MjsBody, start: list[float], end: list[float], radius: float, rgba: list[float]) -> None:
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[*start, *end], size=[radius, 0, 0], rgba=rgba,
        contype=0, conaffinity=0, mass=0.0,
    )  # fmt: skip


def _add_leg(base: mujoco.MjsBody, parameters: RobotParameters, arm: int) -> None:
    g, m = parameters.geometry, parameters.inertia
    cos, sin = math.cos(ARM_ANGLES[arm] / 2.0), math.sin(ARM_ANGLES[arm] / 2.0)
    mount = base.add_body(name=f"mount{arm + 1}", quat=[cos, 0.0, 0.0, sin])
    mount.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER, fromto=[-0.045, g.base_radius, 0.0, 0.035, g.base_radius, 0.0],
        size=[0.028, 0, 0], rgba=[0.25, 0.26, 0.28, 1.0], contype=0, conaffinity=0, mass=0.0,
    )  # fmt: skip
    proximal, own = mount.add_body(name=f"proximal{arm + 1}", pos=[0.0, g.base_radius, 0.0]), parameters.arm(arm)
    _add_link(proximal, parameters, arm)
    proximal.add_joint(
        name=f"servo{arm + 1}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[1, 0, 0], armature=m.rotor_inertia,
        damping=own.viscous, frictionloss=own.coulomb,
        solref_friction=list(FRICTION_SOLREF), solimp_friction=list(CLOSURE_SOLIMP),
    )  # fmt: skip
    _capsule(proximal, [0, 0, 0], [0, g.proximal_length, 0], 0.012, [0.75, 0.76, 0.78, 1.0])
    distal = proximal.add_body(name=f"distal{arm + 1}", pos=[0.0, g.proximal_length, 0.0])
    rods = own.distal_pair_mass
    _inertial(distal, rods, (0.0, g.distal_length / 2.0, 0.0), _rod_inertia(rods, g.distal_length))
    distal.add_joint(name=f"universal{arm + 1}a", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[1, 0, 0])
    distal.add_joint(name=f"universal{arm + 1}b", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
    distal.add_site(name=f"rod_end{arm + 1}", pos=[0.0, g.distal_length, 0.0], rgba=[0, 0, 0, 0])
    proximal.add_site(name=f"elbow{arm + 1}", pos=[0.0, g.proximal_length, 0.0], rgba=[0, 0, 0, 0])


def _add_pad(finger: mujoco.MjsBody, parameters: RobotParameters, side: int) -> None:
    """Two faces at ± the groove angle; origin of the finger body: the plane of the pad's front edges."""
    pads = parameters.pads
    depth = pads.half_width * math.tan(pads.groove_angle)
    face = math.hypot(depth, pads.half_width)
    for sign in (1, -1):
        normal = np.array([-side * pads.half_width, -sign * depth]) / face
        centre = np.array([side * depth / 2.0, sign * pads.half_width / 2.0]) - normal * pads.back / 2.0
        yaw = math.atan2(normal[1], normal[0])
        finger.add_geom(
            name=f"pad_{'a' if sign > 0 else 'b'}_{'right' if side > 0 else 'left'}",
            type=mujoco.mjtGeom.mjGEOM_BOX, size=[pads.back / 2.0, face / 2.0, pads.half_height],
            pos=[centre[0], centre[1], 0.0], quat=[math.cos(yaw / 2), 0, 0, math.sin(yaw / 2)],
            contype=TOOL_BITS, conaffinity=SCENE_BITS, gap=AWAKE, friction=[pads.friction, 0.005, 0.0001], priority=1,
            condim=4, solref=list(PAD_SOLREF), solimp=list(PAD_SOLIMP), rgba=[0.95, 0.95, 0.92, 1.0], mass=0.0,
        )  # fmt: skip


def _add_finger(platform: mujoco.MjsBody, parameters: RobotParameters, side: int) -> None:
    name = "right" if side > 0 else "left"
    pads, gripper = parameters.pads, parameters.gripper
    finger = platform.add_body(name=f"finger_{name}")
    mass = parameters.inertia.finger_mass
    _inertial(finger, mass, (0.0, 0.0, -0.02), [mass * 2e-4, mass * 2e-4, mass * 1e-4])
    finger.add_joint(
        name=f"finger_{name}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[side, 0, 0], range=[0.0, gripper.stroke],
        limited=True, armature=gripper.reflected_mass,
    )  # fmt: skip
    _add_pad(finger, parameters, side)
    depth = pads.half_width * math.tan(pads.groove_angle)
    top = GRIPPER_BODY_CLEARANCE
    finger.add_geom(
        name=f"bar_{name}", type=mujoco.mjtGeom.mjGEOM_BOX, mass=0.0,
        contype=TOOL_BITS, conaffinity=SCENE_BITS, gap=AWAKE,
        size=[pads.back / 2.0, FINGER_HALF_WIDTH, (top + pads.half_height) / 2.0],
        pos=[side * (depth + pads.back / 2.0), 0.0, (pads.half_height - top) / 2.0], rgba=[0.35, 0.36, 0.38, 1.0],
    )  # fmt: skip


def _add_platform(base: mujoco.MjsBody, parameters: RobotParameters) -> None:
    g, m = parameters.geometry, parameters.inertia
    platform = base.add_body(name="platform")
    mass = m.flange_mass + m.gripper_body_mass
    _inertial(platform, mass, (0.0, 0.0, -0.065), [mass * 1e-3, mass * 1e-3, mass * 1e-3])
    for axis, name in enumerate("xyz"):
        platform.add_joint(
            name=f"platform_{name}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[float(i == axis) for i in range(3)]
        )
    platform.add_geom(
        name="flange", type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[g.flange_radius - 0.006, 0, 0], mass=0.0,
        fromto=[0, 0, -g.gripper_height - 0.006, 0, 0, -g.gripper_height], rgba=[0.75, 0.76, 0.78, 1.0],
        contype=TOOL_BITS, conaffinity=SCENE_BITS, gap=AWAKE,
    )  # fmt: skip
    platform.add_geom(
        name="gripper_body", type=mujoco.mjtGeom.mjGEOM_BOX, size=list(GRIPPER_BODY_HALF), mass=0.0,
        pos=[0.0, 0.0, -GRIPPER_BODY_CLEARANCE - GRIPPER_BODY_HALF[2]], rgba=[0.15, 0.16, 0.18, 1.0],
        contype=TOOL_BITS, conaffinity=SCENE_BITS, gap=AWAKE,
    )  # fmt: skip
    platform.add_site(name="tool", rgba=[0, 0, 0, 0])
    for arm, angle in enumerate(ARM_ANGLES):
        at = [-g.flange_radius * math.sin(angle), g.flange_radius * math.cos(angle), -g.gripper_height]
        platform.add_site(name=f"flange_joint{arm + 1}", pos=at, rgba=[0, 0, 0, 0])
    for side in (1, -1):
        _add_finger(platform, parameters, side)
    if parameters.marker is not None:
        add_marker(platform, parameters.marker)


def _add_gripper_drive(spec: mujoco.MjSpec, parameters: RobotParameters) -> None:
    """One motor for both fingers: a velocity servo on their mean, a stiff rack and pinion between them."""
    gripper = parameters.gripper
    opening = spec.add_tendon(name="opening")
    coupling = spec.add_tendon(
        name="coupling",
        stiffness=gripper.coupling_stiffness / 2.0,
        damping=math.sqrt(gripper.coupling_stiffness * gripper.reflected_mass) / 2.0,
        springlength=[0.0, 0.0],
    )
    for name, sign in (("finger_right", 1.0), ("finger_left", -1.0)):
        opening.wrap_joint(name, 0.5)
        coupling.wrap_joint(name, sign)
    gain = 2.0 * gripper.velocity_gain
    drive = spec.add_actuator(
        name="gripper", target="opening", trntype=mujoco.mjtTrn.mjTRN_TENDON, gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE, forcelimited=True,
        forcerange=[-2.0 * gripper.max_force, 2.0 * gripper.max_force],
        ctrllimited=True, ctrlrange=[-gripper.max_speed, gripper.max_speed],
    )  # fmt: skip
    drive.gainprm[0] = gain
    drive.biasprm[2] = -gain


def add_arm(
    spec: mujoco.MjSpec, parameters: RobotParameters, base_position: tuple[float, float, float], turn: float = 0.0
) -> None:
    """Add the whole robot to a scene whose world frame is the board frame (z up), the base's centre at a point of it
    [m].

    ``turn`` is of the board about the vertical against the robot, which therefore is turned the other way [rad].
    """
    cos, sin = math.cos(turn / 2.0), math.sin(turn / 2.0)
    # first about the world's z by -turn, then about x by half a turn: z₃ points down
    base = spec.worldbody.add_body(name="base", pos=list(base_position), quat=[0.0, cos, -sin, 0.0])
    base.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER, fromto=[0, 0, -0.025, 0, 0, -0.012], size=[0.15, 0, 0],
        rgba=[0.30, 0.31, 0.33, 1.0], contype=0, conaffinity=0, mass=0.0,
    )  # fmt: skip
    for arm in range(3):
        _add_leg(base, parameters, arm)
    if parameters.marker is not None:
        add_marker_looks(spec, parameters.marker)
    _add_platform(base, parameters)
    for arm in range(3):
        spec.add_equality(
            name=f"closure{arm + 1}", type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=f"rod_end{arm + 1}", name2=f"flange_joint{arm + 1}",
            solref=list(CLOSURE_SOLREF), solimp=list(CLOSURE_SOLIMP),
        )  # fmt: skip
        motor = spec.add_actuator(name=f"servo{arm + 1}", target=f"servo{arm + 1}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        peak = parameters.drive.peak_torque
        motor.ctrllimited, motor.ctrlrange = True, [-peak, peak]
    _add_gripper_drive(spec, parameters)


def stiffen_closures(model: mujoco.MjModel) -> None:
    """Make the loops of a compiled arm stiffer than MuJoCo's largest impedance allows.

    MuJoCo scales a constraint's softness by the inverse masses of the bodies it joins; those of the distal links count
    for nothing else, since links do not touch.
    """
    for arm in (1, 2, 3):
        model.body_invweight0[model.body(f"distal{arm}").id, 0] *= CLOSURE_SHARE


def add_contact_sensor(
    spec: mujoco.MjSpec, name: str, part: str, kind: mujoco.mjtObj = mujoco.mjtObj.mjOBJ_BODY
) -> None:
    """Net force of all contacts of a part of the scene, world frame [N]."""
    net = 3  # reduction of a contact sensor; before it its data: found bit 0, force bit 1; after it how many
    spec.add_sensor(
        name=name, type=mujoco.mjtSensor.mjSENS_CONTACT, objtype=kind, objname=part,
        reftype=mujoco.mjtObj.mjOBJ_UNKNOWN, intprm=[2, net, 1],
    )  # fmt: skip


def add_contact_sensors(spec: mujoco.MjSpec) -> None:
    """Those that a plant reads: on each finger, on the gripper's body, and on the scene's geom ``deck``."""
    for name, part in (("right", "finger_right"), ("left", "finger_left"), ("body", "platform")):
        add_contact_sensor(spec, f"force_{name}", part)
    add_contact_sensor(spec, "force_deck", "deck", mujoco.mjtObj.mjOBJ_GEOM)


def start_positions(
    model: mujoco.MjModel, parameters: RobotParameters, tool: NDArray[np.float64], fingers: float
) -> NDArray[np.float64]:
    """All generalised positions of a world, (nq,), with the tool at a point, base frame (3,), and fingers open [m].

    Raises ``ValueError`` if the arm does not reach it.
    """
    qpos = np.array(model.qpos0)
    joints = inverse_kinematics(parameters, tool)
    values = {f"platform_{name}": tool[axis] for axis, name in enumerate("xyz")}
    values |= {f"finger_{side}": fingers for side in ("right", "left")}
    for arm in range(3):
        values |= zip((f"servo{arm + 1}", f"universal{arm + 1}a", f"universal{arm + 1}b"), joints[arm], strict=True)
    for name, value in values.items():
        qpos[model.joint(name).qposadr[0]] = value
    return qpos
