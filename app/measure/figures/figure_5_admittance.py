"""Figure ``5``: Bode plot of the admittance, finger velocity over force at one finger, with and without feedback.

Curves: the nonlinear closed loop of arm (2), law (23), gripper and sensors, linearised. Dots: a force of one frequency
after the other on the right finger of the nonlinear model itself. Crosses: the same with the torque held for a tick and
given a tick late, as the controller does it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import JsonValue

from app.measure.figures.drawing import DARK, WITH, WITHOUT, axes, label, picture
from app.measure.figures.grasp_model import SPEED, STATES, Fingers, TactileLaw, effective_mass, push
from app.measure.figures.result import Bar, FigureResult, Picture, Progress
from controller.law.tactile import Pair, admittance
from controller.law.task_space import pack_reference
from controller.model.compiled import FloatArray, Vector
from controller.model.constants import DeltaModel
from controller.offline import constrained
from controller.offline.simulation import ArmMotion, ConstrainedArm, Moment, Trajectory
from hardware.parameters import RobotParameters, load_parameters

POINT = (0.0, 0.0, 0.4575)  # over the middle of the board, the pads' centre 12.5 mm above it [m]
STIFFNESS, DAMPING = 1.0, 2.0  # k_p [1/s²] and k_v [1/s] along z1; the paper's
ASIDE = 70.0  # ω of the other directions, as in a game [rad/s]
GAINS = (0.0, 2.0)  # k* [1/kg]
OMEGA = np.logspace(-2.0, 3.0, 251)
SWEEP = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Frequencies of the sweep [rad/s]."""
SAMPLED_FROM = 10.0
EXCURSION = 5e-3
"""The force is chosen for this amplitude of the finger … [m]"""
LARGEST_FORCE = 1.0  # … but is at most this [N]
PERIODS = 2
SAMPLES = 64
"""Of a period."""
DIFFERENCE = 1e-5  # of a central difference [rad, rad/s, m, m/s, N]

ComplexArray = NDArray[np.complex128]


class LinearLoop(NamedTuple):
    """ξ̇ = A ξ + B f, finger velocity = C ξ + D f for a force f on the right finger; D is zero."""

    a: FloatArray  # shape (22, 22)
    b: FloatArray  # shape (22,)
    c: FloatArray  # shape (22,)

    def state(self, omega: float) -> ComplexArray:
        """Ξ(jω) / F, shape (22,)."""
        system = 1j * omega * np.eye(len(self.b)) - self.a
        return np.asarray(np.linalg.solve(system, self.b.astype(np.complex128)))

    def response(self, omega: FloatArray) -> ComplexArray:
        """A(jω), the admittance at frequencies (n,) [rad/s]: shape (n,) [m/(N s)]."""
        return np.array([self.c @ self.state(float(w)) for w in omega])


def linearised(arm: ConstrainedArm, at: ArmMotion, law: TactileLaw, fingers: Fingers) -> LinearLoop:
    """Differentiate the closed loop where the arm rests under a smooth law (``warm`` False)."""
    rest = np.concatenate([at.q, at.v, np.zeros(STATES)])

    def rates(row: FloatArray, force: float) -> FloatArray:
        moment = Moment(0.0, row[:9].copy(), row[9:18].copy(), row[18:].copy(), arm.model)
        forces = (force, 0.0)
        found = arm.accelerations(moment.q, moment.v, law(moment), push(forces))
        return np.concatenate([moment.v, found.acceleration, fingers.rates(moment.own, forces)])

    def difference(unit: FloatArray, force: float) -> FloatArray:
        ahead, behind = (rates(rest + step * unit, step * force) for step in (DIFFERENCE, -DIFFERENCE))
        return (ahead - behind) / (2.0 * DIFFERENCE)

    columns = [difference(unit, 0.0) for unit in np.eye(rest.size)]
    velocity = np.zeros(rest.size)
    velocity[9:18] = constrained.virtual_jacobian(arm.model, at.q)[0]
    velocity[18 + SPEED] = 1.0
    return LinearLoop(np.stack(columns, axis=1), difference(np.zeros(rest.size), 1.0), velocity)


class _Pushed(NamedTuple):
    """Gripper whose right finger is pushed by a cosine."""

    fingers: Fingers
    amplitude: float
    omega: float
    states: FloatArray  # at time 0

    def _forces(self, time: float) -> Pair:
        return self.amplitude * float(np.cos(self.omega * time)), 0.0

    def start(self) -> FloatArray:
        """See ``Attachment``."""
        return self.states

    def rates(self, moment: Moment) -> FloatArray:
        """See ``Attachment``."""
        return np.array(self.fingers.rates(moment.own, self._forces(moment.time)))

    def force(self, moment: Moment) -> Vector:
        """See ``Attachment``."""
        return push(self._forces(moment.time))


class Loop(NamedTuple):
    """One closed loop: plant, rest position, gripper, its law for a gain, and the linearisation of the whole."""

    arm: ConstrainedArm
    rest: ArmMotion
    fingers: Fingers
    law: Callable[[], TactileLaw]
    linear: LinearLoop


def closed_loop(parameters: RobotParameters, tactile_gain: float) -> Loop:
    """The loop of Fig. 5 for a k* [1/kg]."""
    model = DeltaModel(parameters)
    arm, fingers = ConstrainedArm(model), Fingers(parameters)
    stiffness, damping = (STIFFNESS, ASIDE**2, ASIDE**2), (DAMPING, 2.0 * ASIDE, 2.0 * ASIDE)
    reference = pack_reference(POINT, stiffness=stiffness, damping=damping, tactile_gain=tactile_gain)
    rest = arm.at(POINT)
    linear = linearised(arm, rest, TactileLaw(model, reference, warm=False), fingers)
    return Loop(arm, rest, fingers, lambda: TactileLaw(model, reference), linear)


def swept(loop: Loop, omega: float, sampled: bool = False) -> complex:
    """The admittance at ω [rad/s] as the nonlinear model shows it: first harmonic of the finger's velocity.

    ``sampled``: with torque held for a tick and a tick late; else in continuous time.
    """
    per_force = loop.linear.state(omega)
    amplitude = min(LARGEST_FORCE, EXCURSION * omega / float(np.abs(loop.linear.c @ per_force)))
    # the linear model's own oscillation as the start leaves hardly anything to die out
    first = amplitude * per_force.real
    start = loop.arm.consistent(loop.rest.q + first[:9], loop.rest.v + first[9:18])
    pushed = _Pushed(loop.fingers, amplitude, omega, first[18:])
    period = 2.0 * np.pi / omega
    if sampled:
        ticks = int(np.ceil(PERIODS * period / loop.arm.model.parameters.drive.tick))
        path = loop.arm.simulate_sampled(start, loop.law(), max(ticks, 200), attachment=pushed)
    else:
        times = np.linspace(0.0, PERIODS * period, PERIODS * SAMPLES + 1)
        path = loop.arm.simulate(
            start, loop.law(), float(times[-1]), attachment=pushed, method="RK4", step=min(1e-3, period / 100.0),
            times=times,
        )  # fmt: skip
    return _harmonic(path, omega) / amplitude


def _harmonic(path: Trajectory, omega: float) -> complex:
    """Complex amplitude of the finger's velocity at ω over the path's second half, with a mean and a slope [m/s]."""
    half = path.time >= path.time[-1] / 2.0
    time, velocity = path.time[half], (path.velocity[:, 0] + path.own[:, SPEED])[half]
    basis = np.stack([np.cos(omega * time), -np.sin(omega * time), np.ones_like(time), time], axis=1)
    real, imaginary = np.linalg.lstsq(basis, velocity)[0][:2].tolist()
    return complex(real, imaginary)


class Curve(NamedTuple):
    """The admittance for one k*, [m/(N s)]."""

    linear: ComplexArray  # at ``OMEGA``
    at_sweep: ComplexArray  # the linear model at the frequencies of the sweep
    sweep: ComplexArray
    sampled: ComplexArray  # from ``SAMPLED_FROM`` on
    formula_error: float  # of the closed form `controller.law.tactile.admittance` (arm: one mass), the largest [dB]


def curve(parameters: RobotParameters, tactile_gain: float, frequencies: tuple[float, ...] = SWEEP) -> Curve:
    """All there is to know for one k* [1/kg]."""
    loop = closed_loop(parameters, tactile_gain)
    linear, mass = loop.linear.response(OMEGA), effective_mass(loop.arm.model, POINT)
    formula = [admittance(parameters, mass, STIFFNESS, DAMPING, tactile_gain, 1j * w) for w in OMEGA.tolist()]
    return Curve(
        linear,
        loop.linear.response(np.array(frequencies)),
        np.array([swept(loop, omega) for omega in frequencies]),
        np.array([swept(loop, omega, sampled=True) for omega in frequencies if omega >= SAMPLED_FROM]),
        float(np.abs(decibel(np.array(formula) / linear)).max()),
    )


def decibel(gain: ComplexArray) -> FloatArray:
    """Magnitude in dB."""
    return np.asarray(20.0 * np.log10(np.abs(gain)))


def figure_5(progress: Progress) -> FigureResult:
    """Compute and draw."""
    parameters, curves = load_parameters(), dict[str, Curve]()
    for gain in GAINS:
        progress(f"sweeping a sine over the nonlinear model, k* = {gain:g}")
        curves[f"{gain:g}"] = curve(parameters, gain)
    without, fed_back = curves.values()
    increase = decibel(fed_back.linear / without.linear)
    at = {omega: float(np.interp(omega, OMEGA, increase)) for omega in (0.1, 1.0, 10.0, 100.0, 1000.0)}
    worst = max(float(np.abs(decibel(one.sweep / one.at_sweep)).max()) for one in curves.values())
    bars = {
        "increase_at_1_rad_s": Bar(at[1.0], "dB", 9.0, 11.0),
        "increase_at_10_rad_s": Bar(at[10.0], "dB", 9.0, 11.0),
        "increase_at_the_sensors_bandwidth": Bar(at[100.0], "dB", 5.0, 8.0),
        "increase_at_1000_rad_s": Bar(at[1000.0], "dB", 0.0, 1.0),
        "sweep_against_linear_model": Bar(worst, "dB", high=0.05),
    }
    mass = effective_mass(DeltaModel(parameters), POINT)
    numbers: dict[str, JsonValue] = {
        "k_p": STIFFNESS, "k_v": DAMPING, "k_s_rad_s": parameters.tactile.bandwidth, "k_star": list(GAINS),
        "point_m": list(POINT),
        "effective_mass_kg": mass,
        "increase_of_the_arm_alone_dB": 20.0 * float(np.log10(1.0 + GAINS[1] * mass)),
        "increase_dB": {f"{omega:g}": value for omega, value in at.items()},
        "sweep_rad_s": list(SWEEP),
        "sweep_dB": {gain: decibel(one.sweep).tolist() for gain, one in curves.items()},
        "sampled_dB": {gain: decibel(one.sampled).tolist() for gain, one in curves.items()},
        "closed_form_against_linear_model_dB": max(without.formula_error, fed_back.formula_error),
    }  # fmt: skip
    title = "Admittance of arm and gripper at one finger"
    return FigureResult(title, bars, numbers, {"": _draw(curves, increase, parameters.tactile.bandwidth, title)})


def _draw(curves: Mapping[str, Curve], increase: FloatArray, bandwidth: float, title: str) -> Picture:
    sheet = picture(7.6, 7.8)
    magnitude, phase, more = axes(sheet, 3, 1, sharex=True)
    frequencies = np.array(SWEEP)
    late = frequencies[frequencies >= SAMPLED_FROM]
    for (gain, one), colour in zip(curves.items(), (WITHOUT, WITH), strict=True):
        magnitude.semilogx(OMEGA, decibel(one.linear), color=colour, lw=1.5, label=f"k* = {gain}")
        magnitude.plot(frequencies, decibel(one.sweep), "o", color=colour, ms=5)
        magnitude.plot(late, decibel(one.sampled), "x", color=DARK, ms=5, mew=1.2)
        phase.semilogx(OMEGA, np.degrees(np.unwrap(np.angle(one.linear))), color=colour, lw=1.5)
        phase.plot(frequencies, np.degrees(np.angle(one.sweep)), "o", color=colour, ms=5)
        phase.plot(late, np.degrees(np.angle(one.sampled)), "x", color=DARK, ms=5, mew=1.2)
    magnitude.plot([], [], "o", color="grey", ms=5, label="swept sine, nonlinear model")
    magnitude.plot([], [], "x", color=DARK, ms=5, label="the same, law in ticks of 0.88 ms, one late")
    label(magnitude, ylabel="|A| [dB re 1 m/(N s)]", ylim=(-60.0, 22.0))
    magnitude.set_title(f"{title}: $k_p$ = 1/s², $k_v$ = 2/s, $k_s$ = {bandwidth:g} rad/s", fontsize=10)
    magnitude.legend(fontsize=8, loc="upper right")
    label(phase, ylabel="phase [°]", yticks=[-90, -45, 0, 45, 90])
    more.semilogx(OMEGA, increase, color=DARK, lw=1.5)
    more.axhline(10.0, color="grey", lw=0.8, ls="--")
    more.axvline(bandwidth, color="grey", lw=0.8, ls=":")
    more.text(bandwidth * 0.92, 2.0, "sensor's bandwidth", fontsize=8, color="grey", ha="right")
    label(more, ylim=(-0.5, 11.5), ylabel="increase by k* = 2 [dB]", xlabel="ω [rad/s]")
    return sheet
