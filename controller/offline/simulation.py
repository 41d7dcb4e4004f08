"""The arm as a plant: the index-1 DAE (2) in time, with friction, payload, external forces and what is attached.

`ConstrainedArm` solves (2b) and (2c) for v̇ and λ and hands (q, v) to an integrator: SciPy's with error control, or
RK4 with a fixed step. Torques come from a law of the moment (continuous time) or from a controller that is asked once
a tick (`simulate_sampled`: hold, and a delay). Something attached to the tool brings states and a force of its own.

    arm = ConstrainedArm(DeltaModel(load_parameters()))
    start = arm.at((0.0, 0.0, 0.45))
    hold = arm.holding_torque(start.q)
    path = arm.simulate(start, lambda moment: hold, 0.3)
    path.position  # shape (n, 3) [m]
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Final, Literal, NamedTuple, get_args

import numpy as np
from scipy.integrate import solve_ivp

from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from controller.model.kinematics import OK, forward_kinematics
from controller.model.reach import posture_at
from controller.offline import constrained
from controller.offline.forward import applied_torque, constrained_acceleration
from controller.offline.trajectory import ArmMotion, Attachment, Law, Moment, Trajectory

__all__ = ["ArmMotion", "Attachment", "ConstrainedArm", "Law", "Method", "Moment", "SimulationFailed", "Trajectory"]

Method = Literal["DOP853", "RK45", "Radau", "BDF", "LSODA", "RK4"]

DEFAULT_STEP: Final = 1e-4
"""Of RK4 [s]."""
LARGEST_STEP: Final = 1e-2
"""Of an integrator with error control: from rest it would else try steps from which no law finds a pose [s]."""
_REST: Final = (0.0, 0.0, 0.0)
Numbers = Sequence[float] | FloatArray


class SimulationFailed(RuntimeError):
    """The integration could not go on; the message says when and why."""


class Accelerations(NamedTuple):
    """v̇, shape (9,) [rad/s²], and λ of (2b), shape (6,) [N]."""

    acceleration: FloatArray
    multiplier: FloatArray


class _Plant:
    """The differential equation of one run: state (q, v, own) in one row."""

    def __init__(
        self, arm: ConstrainedArm, torque_law: Law, force_law: Law | None, attachment: Attachment | None
    ) -> None:
        self.arm, self.torque_law, self.force_law, self.attachment = arm, torque_law, force_law, attachment
        self.evaluations = 0

    def pack(self, start: ArmMotion) -> FloatArray:
        """The first row."""
        own = self.attachment.start() if self.attachment else np.empty(0)
        return np.concatenate([start.q, start.v, np.asarray(own, dtype=np.float64)])

    def moment(self, time: float, row: FloatArray) -> Moment:
        """A row as laws see it."""
        row = np.ascontiguousarray(row)
        return Moment(float(time), row[:9], row[9:18], row[18:], self.arm.model)

    def rates(self, time: float, row: FloatArray) -> FloatArray:
        """Time derivative of a row."""
        self.evaluations += 1
        moment = self.moment(time, row)
        force = np.zeros(3)
        if self.force_law:
            force += self.force_law(moment)
        change = np.empty(row.size)
        if self.attachment:
            force += self.attachment.force(moment)
            change[18:] = self.attachment.rates(moment)
        change[:9] = moment.v
        change[9:18] = self.arm.accelerations(moment.q, moment.v, self.torque_law(moment), force).acceleration
        return change


def _fixed_steps(
    rates: Callable[[float, FloatArray], FloatArray], state: FloatArray, times: FloatArray, step: float
) -> FloatArray:
    """RK4 from times[0] on, one row at each of the times; between two of them equal steps no longer than asked."""
    rows = [state]
    for begin, end in pairwise(times.tolist()):
        count = max(1, math.ceil((end - begin) / step - 1e-9))
        h = (end - begin) / count
        for k in range(count):
            t = begin + k * h
            k1 = rates(t, state)
            k2 = rates(t + h / 2.0, state + h / 2.0 * k1)
            k3 = rates(t + h / 2.0, state + h / 2.0 * k2)
            k4 = rates(t + h, state + h * k3)
            state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        rows.append(state)
    return np.array(rows)


def _require_positive(name: str, value: float) -> None:
    if not 0.0 < value < math.inf:
        raise ValueError(f"{name} is {value} s, it must be positive and finite")


def _require_finite(what: str, *rows: Numbers) -> None:
    for row in rows:
        if not np.isfinite(row).all():
            raise SimulationFailed(f"{what} hold a number that is not finite: {np.asarray(row).tolist()}")


class ConstrainedArm:
    """The delta robot of (2), with its payload, and Baumgarte's stabilisation.

    ``baumgarte`` is α₀ [1/s²] and α₁ [1/s]; s² + α₁ s + α₀ must be stable. The Coulomb friction's sign is tanh(ẏ /
    ``coulomb_speed``) [rad/s].
    """

    def __init__(
        self, model: DeltaModel, *, baumgarte: tuple[float, float] = (4e4, 4e2), coulomb_speed: float = 0.05
    ) -> None:
        numbers = (*baumgarte, coulomb_speed)
        if not all(0.0 < number < math.inf for number in numbers):
            raise ValueError(
                f"baumgarte {baumgarte} and coulomb_speed {coulomb_speed} rad/s must be positive and finite: a stable "
                "s² + α₁ s + α₀ pulls the chain together"
            )
        self.model = model
        self.baumgarte = baumgarte
        self.coulomb_speed = coulomb_speed

    def at(self, point: Numbers, velocity: Numbers = _REST) -> ArmMotion:
        """Consistent state with the tool at a point [m] with a velocity [m/s], base frame, outward branch; raises
        ``Unreachable`` if the arm cannot stand there.
        """
        posture = posture_at(self.model, np.asarray(point, dtype=np.float64))
        q = constrained.coordinates(posture.y, posture.x)
        h_t = constrained.tangent(self.model, q)
        jacobian = constrained.virtual_jacobian(self.model, q) @ h_t
        return ArmMotion(q, h_t @ np.linalg.solve(jacobian, np.asarray(velocity, dtype=np.float64)))

    def consistent(self, q: FloatArray, v: FloatArray) -> ArmMotion:
        """The closed chain with the same servomotor angles and velocities, from x nearby by Newton (7) and (14); raises
        ``SimulationFailed`` if the chain cannot be closed from there.
        """
        y, x = q[constrained.MEASURED], q[constrained.UNMEASURED]
        status, _ = forward_kinematics(self.model.constants, y, x)
        if status != OK:
            raise SimulationFailed(
                f"the chain cannot be closed at servomotor angles {y.round(4).tolist()} rad: start from angles that "
                "`ConstrainedArm.at` gives"
            )
        closed = constrained.coordinates(y, x)
        return ArmMotion(closed, constrained.tangent(self.model, closed) @ v[constrained.MEASURED])

    def holding_torque(self, q: FloatArray) -> FloatArray:
        """τ_u of (15), shape (3,), at which the arm stands still [N m]."""
        return constrained.gravity_compensation(self.model, q)

    def accelerations(
        self, q: FloatArray, v: FloatArray, torque: Numbers, external_force: Numbers = _REST,
        payload: float | None = None,
    ) -> Accelerations:  # fmt: skip
        """Forward dynamics: v̇ and λ of (2b) with (2c), for q and v, shape (9,) each [rad, rad/s], and u, shape (3,) [N
        m].

        The external force f on the tool, base frame, acts through J_v (10) [N]; ``payload`` is a mass held by the
        gripper in place of the model's [kg]. Raises ``SimulationFailed`` if the equations are singular there.
        """
        model = self.model if payload is None else DeltaModel(self.model.parameters, payload)
        q, v = np.ascontiguousarray(q), np.ascontiguousarray(v)
        applied, acceleration, multiplier = np.empty(9), np.empty(9), np.empty(6)
        u1, u2, u3 = torque
        f1, f2, f3 = external_force
        push = (float(f1), float(f2), float(f3))
        _require_finite("the state", q, v)
        _require_finite("torque and force", (u1, u2, u3), (f1, f2, f3))
        applied_torque(model.constants, q, v, (float(u1), float(u2), float(u3)), push, self.coulomb_speed, applied)
        status = constrained_acceleration(model.constants, q, v, applied, self.baumgarte, acceleration, multiplier)
        if status != OK:
            raise SimulationFailed(
                f"the equations of motion are singular at q = {q.round(4).tolist()} rad: a distal link lies in line "
                "with its universal joint's first axis, keep |sin q_i2| above 1e-6"
            )
        return Accelerations(acceleration, multiplier)

    def torques(
        self, q: FloatArray, v: FloatArray, joint_acceleration: FloatArray, external_force: Numbers = _REST
    ) -> constrained.Torques:
        """Inverse dynamics: u and λ with which the servomotors get ÿ, shape (3,) [rad/s²]."""
        needed = constrained.acceleration_at(self.model, q, v, joint_acceleration)
        outside = constrained.virtual_jacobian(self.model, q).T @ np.asarray(external_force, dtype=np.float64)
        outside -= constrained.friction_torque(self.model, v, self.coulomb_speed)
        return constrained.inverse_dynamics(self.model, q, v, needed, outside)

    def simulate(
        self,
        start: ArmMotion,
        torque_law: Law,
        duration: float,
        force_law: Law | None = None,
        *,
        attachment: Attachment | None = None,
        method: Method = "DOP853",
        rtol: float = 1e-9,
        atol: float = 1e-11,
        step: float | None = None,
        times: FloatArray | None = None,
    ) -> Trajectory:
        """Integrate in continuous time; raises ``SimulationFailed`` if the integrator gives up or meets a singularity.

        Args:
            start: consistent state, see `at` and `consistent`.
            torque_law: u of a moment [N m]; a pure function, as the integrator tries moments and comes back.
            duration: [s].
            force_law: external force on the tool of a moment [N].
            attachment: brings states and a force of its own.
            method: RK4 with a fixed step, or one of `scipy.integrate.solve_ivp`.
            rtol: relative tolerance; not for RK4.
            atol: absolute tolerance [rad, rad/s, the attachment's units]; not for RK4.
            step: the largest step, default 0.1 ms for RK4, otherwise 10 ms [s].
            times: when to sample, rising from 0 on; default every millisecond [s].
        """
        _require_positive("duration", duration)
        _require_positive("step", DEFAULT_STEP if step is None else step)
        if method not in get_args(Method):
            raise ValueError(f"there is no method '{method}', choose from: {', '.join(get_args(Method))}")
        if times is None:
            times = np.linspace(0.0, duration, max(2, round(duration / 1e-3) + 1))
        times = np.asarray(times, dtype=np.float64)
        if times.size < 2 or not (times[0] == 0.0 and times[-1] <= duration and (np.diff(times) > 0.0).all()):
            raise ValueError(f"times must be two or more that rise from 0 to at most {duration} s, these are {times} s")
        plant = _Plant(self, torque_law, force_law, attachment)
        state = plant.pack(start)
        if method == "RK4":
            rows = _fixed_steps(plant.rates, state, times, DEFAULT_STEP if step is None else step)
        else:
            largest = LARGEST_STEP if step is None else step
            span = 0.0, duration
            found = solve_ivp(plant.rates, span, state, method, times, rtol=rtol, atol=atol, max_step=largest)
            if not found.success:
                raise SimulationFailed(f"{method} gave up at {found.t[-1]:.6f} s: {found.message}")
            rows = found.y.T
        # backwards from where the integrator stands: a law that starts warm never has to jump
        torque = [torque_law(plant.moment(t, row)) for t, row in zip(times[::-1], rows[::-1], strict=True)]
        return self._trajectory(times, rows, np.array(torque[::-1]), plant.evaluations)

    def simulate_sampled(
        self,
        start: ArmMotion,
        controller: Law,
        ticks: int,
        force_law: Law | None = None,
        *,
        attachment: Attachment | None = None,
        period: float | None = None,
        delay: int = 1,
        substeps: int = 2,
    ) -> Trajectory:
        """Integrate with a controller that is asked once a tick and whose torque is held, RK4 between.

        One row at the start of each tick, and one at the end. The controller is asked exactly once a tick, in order,
        and may have a memory; force and attachment are as of `simulate`. A tick's period is by default the drive's [s].
        ``delay`` is in ticks between a measurement and the torque computed from it; until then the first torque acts.
        """
        tick = self.model.parameters.drive.tick if period is None else period
        _require_positive("period", tick)
        if ticks < 1 or substeps < 1 or delay < 0:
            raise ValueError(
                f"ticks {ticks} and substeps {substeps} must be at least 1, the delay {delay} ticks at least 0"
            )
        held: list[FloatArray] = []
        plant = _Plant(self, lambda moment: held[0], force_law, attachment)
        state = plant.pack(start)
        rows, torques = [state], []
        for k in range(ticks):
            answer = np.asarray(controller(plant.moment(k * tick, state)), dtype=np.float64)
            held = [*held, answer] if held else [answer] * (delay + 1)
            torques.append(held[0])
            state = _fixed_steps(plant.rates, state, np.array([k * tick, (k + 1) * tick]), tick / substeps)[-1]
            held.pop(0)
            rows.append(state)
        torques.append(torques[-1])
        times = np.array([k * tick for k in range(ticks + 1)])
        return self._trajectory(times, np.array(rows), np.array(torques), plant.evaluations)

    def _trajectory(self, times: FloatArray, rows: FloatArray, torque: FloatArray, evaluations: int) -> Trajectory:
        q, v, own = (np.ascontiguousarray(part) for part in np.split(rows, [9, 18], axis=1))
        return Trajectory(times, q, v, own, torque, self.model, evaluations)
