"""The plant itself: MuJoCo stepped by drive commands. Amplifiers, encoders, brakes, gripper and tactile sensors.

No state is written and no external force applied after ``reset``: what happens, happens by torques and contacts.
"""

from __future__ import annotations

import hashlib
import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.interfaces import Command, DriveStatus, Measurement
from hardware.parameters import RobotParameters
from hardware.sim.truth import PiecePose, Truth

ARM_TREES = 4
"""Kinematic trees of the robot: three legs and the platform. They never sleep."""
REST_SPEED = 2e-4
"""All joints of arm and gripper slower than this [rad/s, m/s] count as resting."""
PIECE_REST_SPEED = 2e-3
"""An awake piece, held or about to sleep, slower than this [m/s, rad/s scaled] counts as resting."""
REST_TICKS = 25


class Plant:
    """The simulated robot and table, advanced one tick at a time."""

    def __init__(self, model: mujoco.MjModel, parameters: RobotParameters, pieces: tuple[str, ...]) -> None:
        self.model = model
        self.data = mujoco.MjData(model)
        self.parameters = parameters
        self._pieces = pieces
        drive = parameters.drive
        self._counts_per_rad = 2.0**drive.encoder_bits / (2.0 * math.pi)
        self._steps = max(1, round(drive.tick / model.opt.timestep))
        self._filter = 1.0 - math.exp(-parameters.tactile.bandwidth * drive.tick)
        self._index()
        mujoco.mj_resetDataKeyframe(model, self.data, 0)
        mujoco.mj_forward(model, self.data)
        self.tick = 0
        self._latched = DriveStatus.OK
        self._resting = 0
        self._tactile = [0.0, 0.0]
        self._peak_force = 0.0
        self._counts = self._encoder_counts()
        self._speeds = (0.0, 0.0, 0.0)
        self._set_brake(True)
        self._enabled = False

    def _index(self) -> None:
        model, data = self.model, self.data
        joints = [model.joint(f"servo{i}") for i in (1, 2, 3)]
        self._servo_q = tuple(int(j.qposadr[0]) for j in joints)
        self._servo_v = np.array([j.dofadr[0] for j in joints])
        self._finger_q = [int(model.joint(f"finger_{side}").qposadr[0]) for side in ("right", "left")]
        arm_names = [f"{name}" for name in ("platform_x", "platform_y", "platform_z", "finger_right", "finger_left")]
        arm_names += [f"universal{i}{c}" for i in (1, 2, 3) for c in "ab"]
        self._arm_v = np.array([*self._servo_v, *(model.joint(name).dofadr[0] for name in arm_names)])
        self._force = {
            name: data.sensordata[model.sensor(name).adr[0] : model.sensor(name).adr[0] + 3]
            for name in ("force_right", "force_left", "strongest_deck", "strongest_body")
        }
        self._body = {name: model.body(name).id for name in self._pieces}
        ends = [(data.site(f"rod_end{i}"), data.site(f"flange_joint{i}")) for i in (1, 2, 3)]
        self._closures = [(a.xpos, b.xpos) for a, b in ends]

    def _encoder_counts(self) -> tuple[int, int, int]:
        item, scale = self.data.qpos.item, self._counts_per_rad  # a tick is short: plain numbers beat small arrays
        a, b, c = self._servo_q
        return round(item(a) * scale), round(item(b) * scale), round(item(c) * scale)

    def _set_brake(self, closed: bool) -> None:
        drive, friction = self.parameters.drive, self.parameters.friction
        self._braked = closed
        self.model.dof_frictionloss[self._servo_v] = drive.brake_torque if closed else friction.coulomb

    def measure(self, standing: bool) -> Measurement:
        """What encoders, gripper and tactile sensors say now."""
        status = self._latched
        if self._enabled:
            status |= DriveStatus.ENABLED
        if self._braked:
            status |= DriveStatus.BRAKED
        if standing:
            status |= DriveStatus.STANDING
        scale = 1.0 / self._counts_per_rad
        a, b, c = self._counts
        qpos = self.data.qpos
        finger = 0.5 * (qpos.item(self._finger_q[0]) + qpos.item(self._finger_q[1]))
        return Measurement(
            self.tick, (a * scale, b * scale, c * scale), self._speeds, finger,
            (self._tactile[0], self._tactile[1]), status,
        )  # fmt: skip

    def apply(self, command: Command) -> None:
        """Latch a command: amplifiers saturate at the peak torque; not enabled means no torque and closed brakes."""
        peak = self.parameters.drive.peak_torque
        u1, u2, u3 = command.torque
        self._latched &= ~DriveStatus.SATURATED
        if abs(u1) > peak or abs(u2) > peak or abs(u3) > peak:
            self._latched |= DriveStatus.SATURATED
        if not command.enable:
            self._latched &= ~(DriveStatus.WATCHDOG | DriveStatus.OVERSPEED)
        tripped = self._latched & (DriveStatus.WATCHDOG | DriveStatus.OVERSPEED)
        self._enabled = command.enable and not tripped
        brake = command.brake or not self._enabled
        if brake != self._braked:
            self._set_brake(brake)
        ctrl = self.data.ctrl
        if self._enabled:
            ctrl[0], ctrl[1], ctrl[2] = u1, u2, u3  # the model's actuators cut at the peak
        else:
            ctrl[:3] = 0.0
        ctrl[3] = command.finger_velocity

    def trip_watchdog(self) -> None:
        """No command came for too long: the drives switch off and brake, the gripper keeps its grip.

        Drives that were never enabled, or are disabled, stand on their brakes and wait for no command.
        """
        if not self._enabled:
            return
        self._latched |= DriveStatus.WATCHDOG
        self._enabled = False
        self._set_brake(True)
        self.data.ctrl[:3] = 0.0
        self.data.ctrl[3] = min(float(self.data.ctrl[3]), 0.0)

    def step(self) -> None:
        """Advance by one tick."""
        for _ in range(self._steps):
            mujoco.mj_step(self.model, self.data)
        self.tick += 1
        drive = self.parameters.drive
        old, new = self._counts, self._encoder_counts()
        scale = 1.0 / (self._counts_per_rad * drive.tick)
        self._speeds = ((new[0] - old[0]) * scale, (new[1] - old[1]) * scale, (new[2] - old[2]) * scale)
        self._counts = new
        if max(map(abs, self._speeds)) > drive.max_speed:
            self._latched |= DriveStatus.OVERSPEED
            self._set_brake(True)
            self.data.ctrl[:3] = 0.0
        self._sense()
        self._watch_rest()

    def _sense(self) -> None:
        # A finger's sensor sits behind its pad and feels the force along the finger axis, pressing positive.
        force = self._force
        right, left = max(0.0, -force["force_right"].item(0)), max(0.0, force["force_left"].item(0))
        self._tactile[0] += self._filter * (right - self._tactile[0])
        self._tactile[1] += self._filter * (left - self._tactile[1])
        for name in ("strongest_deck", "strongest_body"):
            x, y, z = force[name].tolist()
            strength = math.sqrt(x * x + y * y + z * z)
            if strength > self._peak_force:
                self._peak_force = strength

    def _watch_rest(self) -> None:
        data = self.data
        if max(map(abs, self._speeds)) > 20.0 * REST_SPEED:  # cheap and usual: the arm is under way
            self._resting = 0
            return
        quiet = float(np.abs(data.qvel[self._arm_v]).max()) < REST_SPEED
        if quiet and data.ntree_awake > ARM_TREES:
            awake = data.dof_awake_ind[: data.nv_awake]
            quiet = float(np.abs(data.qvel[awake]).max()) < PIECE_REST_SPEED
        self._resting = self._resting + 1 if quiet else 0

    @property
    def resting(self) -> bool:
        """True when arm, gripper and every piece have been at rest for a while."""
        return self._resting >= REST_TICKS

    def arm_speed(self) -> float:
        """Fastest joint of arm and gripper [rad/s, m/s]."""
        return float(np.abs(self.data.qvel[self._arm_v]).max())

    def truth(self, reset_peak: bool) -> Truth:
        """Everything the referee may know; optionally start a new peak of the contact force."""
        peak = self._peak_force
        if reset_peak:
            self._peak_force = 0.0
        poses = []
        for name, body in self._body.items():
            x, y, z = self.data.xpos[body].tolist()
            upright = min(1.0, float(self.data.xmat[body, 8]))
            poses.append(PiecePose(name, x, y, z, math.acos(max(-1.0, upright))))
        gap = max(float(np.linalg.norm(a - b)) for a, b in self._closures)
        return Truth(self.tick, tuple(poses), peak, gap, self.arm_speed(), self.digest())

    def digest(self) -> str:
        """SHA-256 of positions, velocities and tick."""
        state = hashlib.sha256(self.data.qpos.tobytes())
        state.update(self.data.qvel.tobytes())
        state.update(self.tick.to_bytes(8, "little"))
        return state.hexdigest()

    def positions(self) -> NDArray[np.float64]:
        """Copy of all generalised positions, shape (nq,); what a renderer needs."""
        return np.array(self.data.qpos)
