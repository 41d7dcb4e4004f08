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

from hardware.interfaces import Command, DriveStatus, Measurement, Triple
from hardware.parameters import RobotParameters
from hardware.referee import PiecePose, Truth
from hardware.sim.bodies.hand import JOINTS, SPRINGS, felt_force
from hardware.sim.bodies.hand import SENSOR as HAND_SENSOR
from hardware.sim.plant import tick
from hardware.sim.plant.imperfections import PERFECT, Flaws
from hardware.sim.plant.snapshot import STATE, Snapshot
from hardware.table import Box

ARM_TREES = 4
"""Kinematic trees of the robot: three legs and the platform. They never sleep."""
REST_SPEED = 2e-4
"""All joints of arm and gripper slower than this [rad/s, m/s] count as resting."""
PIECE_REST_SPEED = 2e-3
"""An awake piece, held or about to sleep, slower than this counts as resting [m/s] …"""
PIECE_REST_TURNING = 0.02
"""… if it also turns more slowly than this [rad/s]. A piece that is gripped while it stands never comes quite to rest:
its contacts are more than it needs, and the solver lets it tremble by up to 0.007 rad/s."""
HEAP_REST_SPEED = 5e-3
HEAP_REST_TURNING = 0.3
"""The same of a piece in a box [m/s, rad/s]: on bare wood one of some hundred that fell on others trembled for
good, by up to 0.2 rad/s about the points that held it, and went nowhere; on a lining none was seen to."""
REST_TICKS = 25
"""Everything must have been resting for so long."""

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
        self._flaws = flaws or Flaws(PERFECT, 0)
        self._constants = tick.constants_of(drive.encoder_bits, drive.tick, parameters.tactile.bandwidth)
        self._rad_per_count = 1.0 / float(self._constants[0])
        self._memory = np.zeros(tick.MEMORY)
        mujoco.mj_resetDataKeyframe(model, self.data, 0)
        if snapshot is not None:
            self._restore(snapshot)
        mujoco.mj_forward(model, self.data)
        self._find(pieces)
        self._switches = self._latched = 0
        self._resting = 0
        self._wake_up()
        self._peak_hand = 0.0
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
        self._servo_q = np.array([joint.qposadr[0] for joint in servos], dtype=np.int64)
        self._servo_v = np.array([joint.dofadr[0] for joint in servos])
        self._finger_q = tuple(int(model.joint(f"finger_{side}").qposadr[0]) for side in ("right", "left"))
        others = ["platform_x", "platform_y", "platform_z", "finger_right", "finger_left"]
        others += [f"universal{i}{c}" for i in (1, 2, 3) for c in "ab"]
        self._arm_v = np.array([*self._servo_v, *(model.joint(name).dofadr[0] for name in others)], dtype=np.int64)
        pads = [int(model.sensor(f"force_{side}").adr[0]) for side in ("right", "left")]
        contacts = np.flatnonzero(model.sensor_type == mujoco.mjtSensor.mjSENS_CONTACT)
        names = {int(model.sensor_adr[i]): model.sensor(int(i)).name for i in contacts}
        more = [at for at, name in names.items() if at not in pads and name != HAND_SENSOR]
        self._forces = np.array([*pads, *more], dtype=np.int64)
        self._touched = [at for at, name in names.items() if name == HAND_SENSOR]
        self._skin = [int(model.sensor(name).adr[0]) for name in SPRINGS] if self._touched else []
        self._step = (tick.step_address(), int(model._address), int(data._address))
        self._felt = cast("memoryview[float]", memoryview(cast("Any", self._memory)).toreadonly())
        self._hand_q = [int(model.joint(name).qposadr[0]) for name in JOINTS[:4]] if self._touched else []
        self._piece_q = {name: int(model.joint(name).qposadr[0]) for name in pieces}
        self._rest_scale = np.ones(model.nv)
        for name in pieces:
            turning = int(model.joint(name).dofadr[0]) + 3
            self._rest_scale[turning : turning + 3] = PIECE_REST_SPEED / PIECE_REST_TURNING
        ends = [(data.site(f"rod_end{i}"), data.site(f"flange_joint{i}")) for i in (1, 2, 3)]
        self._closures = [(a.xpos, b.xpos) for a, b in ends]

    # what a drive and a sensor do

    def _wake_up(self) -> None:
        """Encoders and fingers at the beginning: at rest, with the forces that are there already."""
        memory, sensors = self._memory, self.data.sensordata
        memory[tick.COUNTS] = np.rint(self.data.qpos[self._servo_q] * self._constants[0])
        right, left = self._forces[:2]
        memory[tick.TOUCH] = max(0.0, -sensors[right]), max(0.0, sensors[left])

    def _switch(self, enabled: bool, brake: bool) -> None:
        """Amplifiers on or off, brakes closed or open; a closed brake is dry friction on the shaft."""
        switches = enabled * _ENABLED | brake * _BRAKED
        if switches == self._switches:
            return
        self._switches = switches
        drive, friction = self.parameters.drive, self.parameters.friction
        coulomb = friction.coulomb * self._flaws.friction
        self.model.dof_frictionloss[self._servo_v] = drive.brake_torque + coulomb if brake else coulomb

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
    def braked(self) -> bool:
        """True while the brakes are closed."""
        return bool(self._switches & _BRAKED)

    def measure(self, standing: bool) -> Measurement:
        """What encoders, gripper and tactile sensors say now; the status says so if plant time stood still."""
        a, b, c, v1, v2, v3, right, left, *_ = self._felt
        scale, q, fingers = self._rad_per_count, self._positions, self._finger_q
        more_right, more_left = self._flaws.tactile(self.tick)
        status = self._latched | self._switches | (_STANDING if standing else 0)
        return Measurement(
            self.tick, (a * scale, b * scale, c * scale), (v1, v2, v3), 0.5 * (q[fingers[0]] + q[fingers[1]]),
            (right + more_right, left + more_left), _STATUS[status],
        )  # fmt: skip

    def apply(self, command: Command) -> None:
        """Latch a command for the ticks to come.

        Amplifiers cut torques at their peak. Not enabled means no torque and closed brakes, and clears what tripped
        the drives. A command that is not finite is a fault.
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
        self._latched = latched
        self._switch(enabled, command.brake or not enabled)
        if self._flaws.ripples and enabled:
            a, b, c = (self._felt[i] * self._rad_per_count for i in range(3))
            u1, u2, u3 = self._flaws.torque((u1, u2, u3), (a, b, c))
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
        tick.advance(
            *self._step, steps, self._qpos, self._qvel, self._sensors, self._servo_q, self._arm_v, self._forces,
            self._constants, self._memory,
        )  # fmt: skip
        self.tick += 1
        if self._touched:
            self._feel_for_the_hand()
        fastest = self._felt[tick.FASTEST]
        if fastest > self.parameters.drive.max_speed:
            self._trip(_OVERSPEED)
        self._watch_rest(fastest)

    def _feel_for_the_hand(self) -> None:
        """The largest force of the robot on the skin of a person's hand, if there is one in this world."""
        s = self._sensors
        for i in self._touched:
            if s[i] or s[i + 1] or s[i + 2]:
                x, y, z = (float(s[j]) for j in self._skin)
                self._peak_hand = max(self._peak_hand, felt_force((x, y, z)))

    def _watch_rest(self, fastest: float) -> None:
        if fastest > 20.0 * REST_SPEED:  # cheap and usual: the arm is under way
            self._resting = 0
            return
        data = self.data
        quiet = self._felt[tick.ARM_SPEED] < REST_SPEED
        if quiet and data.ntree_awake > ARM_TREES:
            awake = data.dof_awake_ind[: data.nv_awake]
            scaled = np.abs(self._qvel) * self._rest_scale
            quiet = float(scaled[awake].max()) < PIECE_REST_SPEED
            if not quiet and self._boxes:
                quiet = float((scaled * self._calm_heaps())[awake].max()) < PIECE_REST_SPEED
        self._resting = self._resting + 1 if quiet else 0

    def _calm_heaps(self) -> NDArray[np.float64]:
        """Factors of all velocities, (nv,): below 1 for pieces in a box, which may tremble."""
        factors = np.ones(self.model.nv)
        for name, start in self._piece_q.items():
            x, y = self._positions[start : start + 2]
            if any(box.holds(x, y) for box in self._boxes):
                at = int(self.model.joint(name).dofadr[0])
                factors[at : at + 3] = PIECE_REST_SPEED / HEAP_REST_SPEED
                factors[at + 3 : at + 6] = PIECE_REST_TURNING / HEAP_REST_TURNING
        return factors

    @property
    def resting(self) -> bool:
        """True when arm, gripper and every piece have been at rest for a while."""
        return self._resting >= REST_TICKS

    def arm_speed(self) -> float:
        """Fastest joint of arm and gripper [rad/s, m/s]."""
        return float(np.abs(self._qvel[self._arm_v]).max())

    # the truth

    def truth(self, reset_peak: bool) -> Truth:
        """Everything the referee may know; optionally start new peaks of the contact forces."""
        peak, hand = math.sqrt(self._felt[tick.PEAK_SQUARED]), self._peak_hand
        if reset_peak:
            self._memory[tick.PEAK_SQUARED] = self._peak_hand = 0.0
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
