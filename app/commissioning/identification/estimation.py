"""What a record tells: base parameters, friction and ripple by weighted least squares, with bands of confidence.

Each tick of each servomotor is an equation, linear in what is looked for,

    u = W(y, ẏ, ÿ) θ + F_v ẏ + F_c sign ẏ + τ u̇ - u (a sin 6 p y + b cos 6 p y) - (c sin 12 p y + d cos 12 p y)

with p pole pairs: ripple is torque that the drive adds to what was asked. The dead time τ is that of the drives against
their encoders; left out, it would pass for viscous friction. Left and right side pass the same filter and
are thinned out; ticks in which the shaft turns slowly say nothing of dry friction and are left out. Each servomotor
counts by how well its equations are met. What is left over is neither white nor equally large all the time, so bands
are those of a jackknife: how far the figures change where a stretch of the motion is left out. What the data cannot
tell to a tenth is taken as believed, and the rest found again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from app import UserError
from app.commissioning.identification.recording import JointMotion, JointRecord, between_ticks, low_pass
from controller.model.base_parameters import NAMES, UNITS, base_of, regressor, robot_with
from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from hardware.parameters import RobotParameters

SLOW: Final = 0.1
"""Below this a shaft may stick [rad/s]."""
PASS: Final = 25.0
"""Of the equations' filter [Hz]."""
EVERY: Final = 8
"""Ticks from one equation to the next: 142 a second, above twice what passes."""
TOLD: Final = 0.10
"""Half of the 95 % band, as a share of the value: what is known no better is not told by the data."""
LEAST_FRICTION: Final = 0.002
"""A friction that is known to this is told, however small it is [N m at 1 rad/s]."""
OUTLIER: Final = 8.0
"""An equation that is met so many times worse than the median one does not count: of noise that is normally
distributed, one in ten million."""
STRETCHES: Final = 48
"""Parts of the motion that are left out one by one for the bands: half a second each, ten times as long as the filter
remembers (Efron and Tibshirani, An Introduction to the Bootstrap, chapter 11)."""
_TWO_SIGMA: Final = 2.01  # of Student's t with so many parts
FRICTION_NAMES: Final = ("viscous1", "viscous2", "viscous3", "coulomb1", "coulomb2", "coulomb3")
_DELAY: Final = len(NAMES) + 6
_FIRST_WAVE: Final = _DELAY + 1
FRICTION_UNITS: Final = ("N m s/rad",) * 3 + ("N m",) * 3


class IdentificationFailed(UserError):
    """The record does not tell what a robot weighs, or tells of none that could be."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """One number."""

    name: str
    unit: str
    value: float
    """As found; where the data could not tell, as believed."""
    band: float
    """Half of the 95 % band [the same unit]."""
    believed: float
    """Before."""
    told: bool
    """The data could tell it."""


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """What a record told."""

    estimates: tuple[Estimate, ...]
    """Ten base parameters, then the shafts' friction."""
    delay: float
    """Of the torque against the angles, beyond the tick that the protocol states [s]."""
    ripple: FloatArray
    """Amplitude of each servomotor's torque ripple, as a share of the torque, (3,)."""
    cogging: FloatArray
    """The same of its cogging [N m], (3,)."""
    residual: FloatArray
    """What the equations leave unexplained, root mean square of each servomotor, (3,) [N m]."""
    before: FloatArray
    """What they left with the parameters as believed, (3,) [N m]."""
    condition: float
    """Of the regressor with columns of length one."""
    order: tuple[str, ...]
    """Of the names, by how much of its own each adds, from a pivoted QR: the last is what the motion shows least."""
    parameters: RobotParameters
    """The robot as found."""

    def value(self, name: str) -> float:
        """Of an estimate."""
        return next(one.value for one in self.estimates if one.name == name)


def identify(record: JointRecord, believed: RobotParameters, pole_pairs: int | None = None) -> Identification:
    """Find a robot from a record of its servomotors.

    Args:
        record: of an exciting motion.
        believed: lengths are taken from it, and what the data cannot tell.
        pole_pairs: of the servomotors; None: their ripple is left in what is not explained.

    Raises:
        IdentificationFailed: the record does not fit a robot of these lengths, or none at all.
    """
    system = _System.of(between_ticks(record), believed, pole_pairs)
    start = np.array([*base_of(believed), *_friction(believed)])
    free = np.ones(len(start), dtype=bool)
    while True:
        solution, deviation = system.solve(start, free)
        told = _told(solution, deviation)
        if (told | ~free).all():
            break
        share = deviation[: len(free)] / np.maximum(np.abs(solution[: len(free)]), 1e-9)
        worst = np.where(free & ~told, share, 0.0)
        free[int(np.argmax(worst))] = False
    return _result(system, believed, start, free, solution, deviation)


def _friction(robot: RobotParameters) -> list[float]:
    arms = [robot.arm(number) for number in range(3)]
    return [arm.viscous for arm in arms] + [arm.coulomb for arm in arms]


def _told(solution: FloatArray, deviation: FloatArray) -> NDArray[np.bool_]:
    band = _TWO_SIGMA * deviation[: len(NAMES) + 6]
    enough = band <= TOLD * np.abs(solution[: len(band)])
    small = np.arange(len(band)) >= len(NAMES)
    told: NDArray[np.bool_] = enough | (small & (band <= LEAST_FRICTION))
    return told


@dataclass(slots=True, eq=False)
class _System:
    """Equations of three servomotors: columns (3, n, m) and right sides (3, n), all filtered and thinned out."""

    columns: FloatArray
    right: FloatArray
    counts: NDArray[np.bool_]
    """Which of them count, (3, n)."""

    @classmethod
    def of(cls, motion: JointMotion, believed: RobotParameters, pole_pairs: int | None) -> _System:
        try:
            base = regressor(DeltaModel(believed).constants, motion.angle, motion.rate, motion.change)
        except ValueError as error:
            raise IdentificationFailed(str(error)) from error
        ripple_columns = 0 if pole_pairs is None else 12
        full = np.zeros((3, len(motion.angle), _FIRST_WAVE + ripple_columns))
        quickening = np.gradient(motion.torque, motion.period, axis=0)
        for i in range(3):
            full[i, :, : base.shape[2]] = base[:, i]
            full[i, :, len(NAMES) + i] = motion.rate[:, i]
            full[i, :, len(NAMES) + 3 + i] = np.sign(motion.rate[:, i])
            full[i, :, _DELAY] = quickening[:, i]
            if pole_pairs is not None:
                angle, torque, at = motion.angle[:, i], motion.torque[:, i], _FIRST_WAVE + 4 * i
                for place, (turns, factor) in enumerate(((6, torque), (12, np.ones(len(angle))))):
                    phase = turns * pole_pairs * angle
                    full[i, :, at + 2 * place] = -factor * np.sin(phase)
                    full[i, :, at + 2 * place + 1] = -factor * np.cos(phase)
        slow = np.abs(motion.rate.T) < SLOW
        reach = round(1.0 / (2.0 * PASS * motion.period))
        kernel = np.ones(2 * reach + 1)
        near = np.array([np.convolve(row, kernel, mode="same") > 0.5 for row in slow])
        columns = np.stack([low_pass(one, PASS, motion.period)[::EVERY] for one in full])
        right = low_pass(motion.torque, PASS, motion.period)[::EVERY].T
        return cls(columns, right, ~near[:, ::EVERY])

    def solve(self, start: FloatArray, free: FloatArray) -> tuple[FloatArray, FloatArray]:
        """All parameters and their standard deviations, those not free as at the start; weights by servomotor."""
        size = self.columns.shape[2]
        used = np.concatenate((free, np.ones(size - len(free), dtype=bool)))
        fixed = np.concatenate((np.where(free, 0.0, start), np.zeros(size - len(free))))
        weights, counts = np.ones(3), self.counts
        for _ in range(4):
            left = np.concatenate([w * self.columns[i][counts[i]][:, used] for i, w in enumerate(weights)])
            right = np.concatenate([
                w * (self.right[i] - self.columns[i] @ fixed)[counts[i]] for i, w in enumerate(weights)
            ])  # fmt: skip
            scale = np.linalg.norm(left, axis=0)
            if not (scale > 0.0).all():
                raise IdentificationFailed("a servomotor never turned fast enough to show its friction: move it more")
            found, _, rank, _ = np.linalg.lstsq(left / scale, right, rcond=1e-10)
            if rank < len(scale):
                raise IdentificationFailed("the motion does not distinguish the parameters: give it more room")
            solution = fixed.copy()
            solution[used] = found / scale
            last = counts
            counts = self._believed(solution)
            weights = 1.0 / np.maximum(self.residual(solution), 1e-6)
        deviation = np.full(size, np.inf)
        deviation[used] = _jackknife(left / scale, right, _stretches(last), found) / scale
        return solution, deviation

    def _believed(self, solution: FloatArray) -> NDArray[np.bool_]:
        """Equations that count and are met about as well as the others: the rest are of moments in which the computer,
        or somebody, held the arm or its clock up.
        """
        rest = np.array([np.abs(self.unexplained(solution, i)) for i in range(3)])
        usual = np.array([np.median(one[counts]) for one, counts in zip(rest, self.counts, strict=True)])
        believed: NDArray[np.bool_] = self.counts & (rest <= OUTLIER * usual[:, None])
        return believed

    def unexplained(self, solution: FloatArray, i: int) -> FloatArray:
        rest: FloatArray = self.right[i] - self.columns[i] @ solution
        return rest

    def residual(self, solution: FloatArray) -> FloatArray:
        return np.array([np.sqrt((self.unexplained(solution, i)[self.counts[i]] ** 2).mean()) for i in range(3)])

    def shape(self) -> tuple[float, tuple[int, ...]]:
        """Condition number, and the order of a pivoted QR, of base parameters and friction."""
        number = len(NAMES) + 6
        left = np.concatenate([self.columns[i][self.counts[i]][:, :number] for i in range(3)])
        left = left / np.linalg.norm(left, axis=0)
        values = np.linalg.svd(left, compute_uv=False)
        _, _, order = qr(left, mode="economic", pivoting=True)
        return float(values[0] / values[-1]), tuple(int(one) for one in order)


def _stretches(counts: NDArray[np.bool_]) -> NDArray[np.intp]:
    """To which stretch of the motion each equation that counts belongs, servomotor after servomotor; (3, n) to (m,)."""
    count = counts.shape[1]
    of_time = np.arange(count) * STRETCHES // count
    return np.concatenate([of_time[one] for one in counts])


def _jackknife(left: FloatArray, right: FloatArray, stretch: NDArray[np.intp], found: FloatArray) -> FloatArray:
    """Standard deviations of a least squares solution, from those without one stretch of its equations each.

    Args:
        left: columns, (n, m), about as long each.
        right: (n,).
        stretch: to which one each equation belongs, (n,).
        found: the solution with all of them, (m,).
    """
    square, product = left.T @ left, left.T @ right
    moved = np.zeros(len(found))
    for one in range(STRETCHES):
        rows, values = left[stretch == one], right[stretch == one]
        without = np.linalg.lstsq(square - rows.T @ rows, product - rows.T @ values, rcond=None)[0]
        moved += (without - found) ** 2
    deviation: FloatArray = np.sqrt(moved * (STRETCHES - 1) / STRETCHES)
    return deviation


def _result(
    system: _System, believed: RobotParameters, start: FloatArray, free: FloatArray, solution: FloatArray,
    deviation: FloatArray,
) -> Identification:  # fmt: skip
    number = len(NAMES)
    friction = solution[number : number + 6]
    try:
        robot = robot_with(believed, solution[:number], friction[:3], friction[3:])
    except ValueError as error:
        raise IdentificationFailed(
            f"the motion fits no possible robot ({error}): check the lengths in the parameters, the encoders' zeros "
            "and the torque constants"
        ) from error
    condition, order = system.shape()
    names, units = (*NAMES, *FRICTION_NAMES), (*UNITS, *FRICTION_UNITS)
    estimates = tuple(
        Estimate(name, unit, float(solution[k]), float(_TWO_SIGMA * deviation[k]), float(start[k]), bool(free[k]))
        for k, (name, unit) in enumerate(zip(names, units, strict=True))
    )
    waves = solution[_FIRST_WAVE:].reshape(-1, 2, 2) if len(solution) > _FIRST_WAVE else np.zeros((3, 2, 2))
    amplitude = np.linalg.norm(waves, axis=2)
    rest = np.concatenate((start, np.zeros(len(solution) - len(start))))
    return Identification(
        estimates, float(solution[_DELAY]), amplitude[:, 0], amplitude[:, 1], system.residual(solution),
        system.residual(rest), condition, tuple(names[k] for k in order), robot,
    )  # fmt: skip
