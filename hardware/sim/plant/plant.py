"""The plant itself: MuJoCo stepped by drive commands. Amplifiers, encoders, brakes, gripper and tactile sensors.

No state is written and no external force applied after the start: what happens, happens by torques and contacts.
A tick is short, so sensors are read as plain numbers through views of MuJoCo's arrays, and drive status is an integer.
"""

import hashlib
import math
from collections.abc import Callable
from typing import Any, Final, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.interfaces import Command, DriveStatus, Measurement, PlantCall, Triple
from hardware.parameters import RobotParameters
from hardware.referee import PiecePose, Truth
from hardware.sim.bodies.finger_world import STIFFNESS as SKIN_STIFFNESS
from hardware.sim.bodies.hand import GRAVITY, JOINTS, SKIN_MASS, SPRINGS
from hardware.sim.bodies.hand import SENSOR as HAND_SENSOR
from hardware.sim.plant import tick
from hardware.sim.plant.imperfections import PERFECT, Flaws
from hardware.sim.plant.snapshot import STATE, Snapshot
from hardware.sim.plant.tick import NOTHING, ServoStrokes
from hardware.table import Box

LONGEST_RUN: Final = 64
"""Ticks that ``Plant.run`` advances by at most."""
SKIN: Final = (SKIN_STIFFNESS, SKIN_MASS * GRAVITY / SKIN_STIFFNESS)
"""Stiffness of a hand's skin [N/m], and how far its own weight presses it in [m]."""
_ENABLED, _BRAKED, _SATURATED, _WATCHDOG, _FAULT, _STANDING, _OVERSPEED = map(int, DriveStatus)
_TRIPS: Final = _WATCHDOG | _FAULT | _OVERSPEED
"""What switches the drives off and stays until they are disabled."""
_STATUS: Final = tuple(DriveStatus(bits) for bits in range(1 << len(DriveStatus)))


class Plant:
    """The simulated robot and table, advanced one tick at a time: ``tick`` counts periods since the start.

    Of ``data`` only the controls are ever written, of ``model`` only the dry friction of the servomotors' joints, which
    acts as the brakes. Raises ``ValueError`` if the timestep does not divide the tick, or the snapshot is of another
    model.

    Args:
        model: compiled by ``scene.build_model``, or another one with the same arm; key frame 0 is the start. Contact
            sensors ``force_right`` and ``force_left`` feel the fingers; these and all others count for the peak.
        parameters: robot.
        pieces: names of all pieces.
        snapshot: where another plant of this model ended, to go on from there.
        flaws: of amplifiers, shafts and sensors; None: they are as the parameters say.
        boxes: in which pieces lie in heaps.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        parameters: RobotParameters,
        pieces: tuple[str, ...],
        snapshot: Snapshot | None = None,
        flaws: Flaws | None = None,
        boxes: tuple[Box, ...] = (),
    ) -> None:
        self.model = model
        self.data = mujoco.MjData(model)
        self.parameters = parameters
        self.tick = 0
        self.watch_step: Callable[[], None] | None = None
        """Called after every step of the integration; for measurements."""
        drive = parameters.drive
        self._steps = _steps_of_a_tick(drive.tick, model.opt.timestep)
        self._boxes = boxes
        self._constants = tick.constants_of(drive.encoder_bits, drive.tick, parameters.tactile.bandwidth, SKIN)
        self._rad_per_count = 1.0 / float(self._constants[0])
        self._flaws = flaws or Flaws(PERFECT, 0)
        self._ripples = self._flaws.ripples(self._rad_per_count)
        self._memory = np.zeros(tick.MEMORY)
        self._noise = self._flaws.noise.copy()
        self._noise[:, tick.ENCODER_NOISE : tick.FINGER_NOISE] *= self._constants[0]
        self._noise_rows = cast("list[list[float]]", self._noise.tolist())
        mujoco.mj_resetDataKeyframe(model, self.data, 0)
        if snapshot is not None:
            self._restore(snapshot)
        mujoco.mj_forward(model, self.data)
        self._find(pieces)
        self._switches = self._latched = 0
        self._brake_open, self._brake_closed = np.zeros(3), np.ones(3)
        self._wake_up()
        self._switch(enabled=False, brake=True)

    def _restore(self, snapshot: Snapshot) -> None:
        size = mujoco.mj_stateSize(self.model, STATE)
        if snapshot.state.shape != (size,):
            raise ValueError(f"the snapshot holds {snapshot.state.size} numbers, this world has {size}")
        mujoco.mj_setState(self.model, self.data, snapshot.state, STATE)
        self.tick = snapshot.tick
        self._cut_controls()  # of one that was in motion

    def _find(self, pieces: tuple[str, ...]) -> None:
        """Views and addresses of what is read and written in every tick."""
        model, data = self.model, self.data
        self._qpos, self._qvel, self._sensors = data.qpos, data.qvel, data.sensordata
        self._positions = cast("memoryview[float]", memoryview(data.qpos).toreadonly())
        self._controls = cast("memoryview[float]", memoryview(data.ctrl))
        servos = [model.joint(f"servo{i}") for i in (1, 2, 3)]
        self._servo_v = np.array([joint.dofadr[0] for joint in servos])
        others = ["platform_x", "platform_y", "platform_z", "finger_right", "finger_left"]
        others += [f"universal{i}{c}" for i in (1, 2, 3) for c in "ab"]
        pads = [int(model.sensor(f"force_{side}").adr[0]) for side in ("right", "left")]
        contacts = np.flatnonzero(model.sensor_type == mujoco.mjtSensor.mjSENS_CONTACT)
        names = {int(model.sensor_adr[i]): model.sensor(int(i)).name for i in contacts}
        touched = [at for at, name in names.items() if name == HAND_SENSOR]
        joints = {name: model.joint(name) for name in pieces}
        self._places = tick.Places(
            servo_angles=[joint.qposadr[0] for joint in servos],
            fingers=[int(model.joint(f"finger_{side}").qposadr[0]) for side in ("right", "left")],
            joints=[*self._servo_v, *(model.joint(name).dofadr[0] for name in others)],
            forces=[*pads, *(at for at, name in names.items() if at not in pads and name != HAND_SENSOR)],
            touched=touched,
            skin=[int(model.sensor(name).adr[0]) for name in SPRINGS] if touched else [],
            pieces=[(joint.qposadr[0], joint.dofadr[0]) for joint in joints.values()],
        )
        self._found = tick.found(self._places)
        self._step = (tick.step_address(), int(model._address), int(data._address), self._steps)
        self._felt = cast("memoryview[float]", memoryview(cast("Any", self._memory)).toreadonly())
        self._hand_q = [int(model.joint(name).qposadr[0]) for name in JOINTS[:4]] if touched else []
        self._piece_q = {name: int(joint.qposadr[0]) for name, joint in joints.items()}
        self._rest_scale = np.ones(model.nv)
        for _, start in self._places.pieces:
            turning = slice(start + 3, start + 6)
            self._rest_scale[turning] = tick.PIECE_REST_SPEED / tick.PIECE_REST_TURNING
        boxes = [(box.x, box.y, box.half_x, box.half_y) for box in self._boxes]
        self._box_borders = np.array(boxes, dtype=float).reshape(-1, 4)
        self._fixed: tuple[Any, ...] = (self._found, self._constants, self._rest_scale, self._box_borders, self._memory)
        self._drives, self._taken = np.zeros(8), np.zeros((LONGEST_RUN, 4))
        ends = [(data.site(f"rod_end{i}"), data.site(f"flange_joint{i}")) for i in (1, 2, 3)]
        self._closures = [(a.xpos, b.xpos) for a, b in ends]

    # what a drive and a sensor do

    def _wake_up(self) -> None:
        """Encoders and fingers at the beginning: at rest, with the forces that are there already."""
        memory, sensors = self._memory, self.data.sensordata
        noise = self._noise[self.tick % len(self._noise)][tick.ENCODER_NOISE : tick.FINGER_NOISE]
        memory[tick.COUNTS] = np.rint(self.data.qpos[self._found.servos] * self._constants[0] + noise)
        right, left = self._places.forces[:2]
        memory[tick.TOUCH] = max(0.0, -sensors[right]), max(0.0, sensors[left])

    def _switch(self, enabled: bool, brake: bool) -> None:
        """Amplifiers on or off, brakes closed or open; a closed brake is dry friction on the shaft."""
        switches = enabled * _ENABLED | brake * _BRAKED
        if switches == self._switches:
            return
        self._switches = switches
        self._set_friction()

    def set_brakes(self, opened: Triple, closed: Triple) -> None:
        """Shares of the brakes' torque that act on each servomotor while they are open, usually 0, and closed, 1."""
        self._brake_open, self._brake_closed = np.array(opened), np.array(closed)
        self._set_friction()

    def _set_friction(self) -> None:
        coulomb = np.array([self.parameters.arm(number).coulomb for number in range(3)]) * self._flaws.friction
        share = self._brake_closed if self.braked else self._brake_open
        self.model.dof_frictionloss[self._servo_v] = share * self.parameters.drive.brake_torque + coulomb

    def _trip(self, cause: int) -> None:
        """The drives switch themselves off and brake; the gripper keeps its grip, but opens no further."""
        self._latched |= cause
        self._switch(enabled=False, brake=True)
        self._cut_controls()

    def _cut_controls(self) -> None:
        u = self.data.ctrl
        u[:3] = 0.0
        u[3] = min(u[3], 0.0)

    @property
    def grip(self) -> float:
        """Velocity with which each finger is pressed to close now, at most 0 [m/s]."""
        return min(0.0, float(self.data.ctrl[3]))

    @property
    def braked(self) -> bool:
        """True while the brakes are closed."""
        return bool(self._switches & _BRAKED)

    def measure(self, standing: bool) -> Measurement:
        """What encoders, gripper and tactile sensors say now; the status says so if plant time stood still."""
        a, b, c, v1, v2, v3, right, left, *_ = self._felt
        scale, q, fingers = self._rad_per_count, self._positions, self._places.fingers
        more_right, more_left, _, _, _, wider = self._noise_rows[self.tick % len(self._noise_rows)]
        status = self._latched | self._switches | (_STANDING if standing else 0)
        return Measurement(
            self.tick, (a * scale, b * scale, c * scale), (v1, v2, v3), 0.5 * (q[fingers[0]] + q[fingers[1]]) + wider,
            (right + more_right, left + more_left), _STATUS[status],
        )  # fmt: skip

    def apply(self, command: Command) -> None:
        """Latch a command for the ticks to come.

        Amplifiers cut torques at their peak. Not enabled means no torque and closed brakes, and clears what tripped
        the drives; until then the gripper opens no further. A command that is not finite is a fault.
        """
        u1, u2, u3 = command.torque
        finger = command.finger_velocity
        latched = self._latched & (_TRIPS if command.enable else 0)
        if not math.isfinite(u1 + u2 + u3 + finger):
            self._trip(_FAULT)
            return
        enabled = command.enable and not latched
        if enabled:
            peak = self.parameters.drive.peak_torque
            if abs(u1) > peak or abs(u2) > peak or abs(u3) > peak:
                latched |= _SATURATED
        else:
            u1 = u2 = u3 = 0.0
        if latched & _TRIPS:
            finger = min(finger, 0.0)
        self._latched = latched
        self._switch(enabled, command.brake or not enabled)
        if self._flaws.ripple and enabled:
            u1, u2, u3 = tick.rippled((u1, u2, u3), self._memory, self._ripples)
        if self._flaws.grip.possible:
            right, left = self._felt[tick.TOUCH]
            finger = self._flaws.grip.velocity(self.tick, self.parameters.drive.tick, finger, right, left)
        u = self._controls
        u[0], u[1], u[2], u[3] = u1, u2, u3, finger  # the model's actuators cut at the peak

    def trip_watchdog(self) -> None:
        """No command came for too long: the drives switch off and brake, the gripper keeps its grip.

        Drives that are not enabled stand on their brakes already and have nothing to report.
        """
        self._trip(_WATCHDOG if self._switches & _ENABLED else 0)

    # time

    def step(self) -> None:
        """Advance by one tick."""
        steps = self._steps
        if self.watch_step is not None:
            while steps:
                mujoco.mj_step(self.model, self.data)
                self.watch_step()
                steps -= 1
        self.tick += 1
        noise = self._noise[self.tick % len(self._noise)]
        tick.advance(  # type: ignore[call-arg]
            *self._step[:3], steps, self._qpos, self._qvel, self._sensors, *self._fixed, noise
        )
        self._watch_speed()

    def _watch_speed(self) -> None:
        if self._felt[tick.FASTEST] > self.parameters.drive.max_speed:
            self._trip(_OVERSPEED)

    @property
    def may_run(self) -> bool:
        """Whether ``run`` does the same as ticks one by one: the drives follow, and nobody wants to see each tick."""
        return self._switches == _ENABLED and not self._latched & _TRIPS and self.watch_step is None

    def run(
        self, controller: PlantCall, most: int, until_rest: bool, followed: ServoStrokes = NOTHING
    ) -> tuple[int, int]:
        """Advance by up to so many ticks, each under the command that the controller has made of the one before.

        Args:
            controller: in the same thread; its ``command`` is the one for the first tick.
            most: ticks at most, and ``LONGEST_RUN``.
            until_rest: end with the tick in which all has come to rest.
            followed: by servos that are not the controller's; the tick in which it is over is not begun.

        Returns:
            How many ticks, and what the controller has said after the last one, see ``PlantCall``.
        """
        drive = self.parameters.drive
        self._drives[:] = (
            self.tick, self._switches | (self._latched & ~_SATURATED), bool(self._latched & _SATURATED),
            drive.peak_torque, drive.max_speed, *self._flaws.grip.obeys(self.tick),
        )  # fmt: skip
        ticks, said = tick.run(  # type: ignore[call-arg]
            *self._step, self._qpos, self._qvel, self._sensors, self.data.ctrl, *self._fixed, self._noise,
            self._ripples, self._drives, min(most, LONGEST_RUN), controller.function, controller.context,
            controller.measurement, controller.command, self._taken, followed, until_rest,
        )  # fmt: skip
        self.tick += ticks
        self._latched = self._latched & ~_SATURATED | (_SATURATED if self._drives[2] else 0)
        self._watch_speed()
        return ticks, said

    def applied(self, ticks: int) -> NDArray[np.float64]:
        """Torques and finger velocities of so many ticks of the last ``run``, (ticks, 4)."""
        return self._taken[:ticks]

    @property
    def resting(self) -> bool:
        """True when arm, gripper and every piece have been at rest for a while."""
        return self._felt[tick.RESTING] >= tick.REST_TICKS

    def arm_speed(self) -> float:
        """Fastest joint of arm and gripper [rad/s, m/s]."""
        return float(np.abs(self._qvel[self._found.joints]).max())

    # the truth

    def truth(self, reset_peak: bool) -> Truth:
        """Everything the referee may know; optionally start new peaks of the contact forces."""
        peak, hand = math.sqrt(self._felt[tick.PEAK_SQUARED]), self._felt[tick.HAND_PEAK]
        if reset_peak:
            self._memory[tick.PEAK_SQUARED] = self._memory[tick.HAND_PEAK] = 0.0
        poses = tuple(self._pose(name, start) for name, start in self._piece_q.items())
        return Truth(
            self.tick, poses, peak, self.closure_gap(), self.arm_speed(), self.digest(), self._tool(), hand,
            self._hand(), self._flaws.grip.lost,
        )  # fmt: skip

    def closure_gap(self) -> float:
        """How far the loops of the arm are from being closed, the widest one [m]."""
        return max(float(np.linalg.norm(a - b)) for a, b in self._closures)

    def _tool(self) -> Triple:
        base = self.data.body("base")
        x, y, z = (base.xmat.reshape(3, 3).T @ (self.data.site("tool").xpos - base.xpos)).tolist()
        return x, y, z

    def _hand(self) -> tuple[float, float, float, float] | None:
        if not self._hand_q:
            return None
        x, y, z, yaw = (float(self._positions[start]) for start in self._hand_q)
        return x, y, z, yaw

    def _pose(self, name: str, start: int) -> PiecePose:
        x, y, z, _, i, j, _ = self._positions[start : start + 7].tolist()
        upright = 1.0 - 2.0 * (i * i + j * j)  # of the piece's axis, from its unit quaternion
        return PiecePose(name, x, y, z, math.acos(max(-1.0, min(1.0, upright))))

    def digest(self) -> str:
        """SHA-256 of positions, velocities and tick."""
        state = hashlib.sha256(self.data.qpos.tobytes())
        state.update(self.data.qvel.tobytes())
        state.update(self.tick.to_bytes(8, "little"))
        return state.hexdigest()

    def positions(self) -> NDArray[np.float64]:
        """Copy of all generalised positions, shape (nq,); what a renderer needs."""
        return np.array(self.data.qpos)


def _steps_of_a_tick(tick: float, timestep: float) -> int:
    steps = round(tick / timestep)
    if steps < 1 or abs(steps * timestep - tick) > 1e-9 * tick:
        raise ValueError(f"a timestep of {timestep} s does not divide the tick of {tick} s: take a whole fraction")
    return steps
