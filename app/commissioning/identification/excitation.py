"""A motion that shows what a robot weighs: the tool's place as a sum of sines, chosen so that torques tell most.

The harmonics of a base frequency of 0.1 Hz reach from slow and wide to quick and narrow; in the first and the last
second all of it is faded in and out. Their coefficients are found by a search that begins at random numbers of its own
and changes some of them as long as that is better: what it looks at is how uncertain the least certain parameter would
be, as a share of what is believed of it. It is stretched until it comes to a border of the workspace, of speed,
acceleration, or torque. The same robot and limits always have the same motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from app import UserError
from controller.model.base_parameters import base_of, regressor
from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from controller.model.demand import torque_demand
from controller.model.kinematics import OK, inverse_arm
from hardware.parameters import RobotParameters

BASE_FREQUENCY: Final = 0.1
"""[Hz]"""
HARMONICS: Final = (1, 2, 3, 5, 8, 13, 21, 30)
"""Of it, up to 3 Hz: what quicker ways would show more of, the workspace and the drives' rating forbid."""
FADE: Final = 1.0
"""In and out [s]."""
_LOOKED_AT: Final = 240
"""States of the motion that the search looks at."""
_DRAWS: Final = 60
_CHANGES: Final = 1500
"""First coefficients that are tried, and how often the best of them are changed."""
_MARGIN: Final = 1.12
"""Places so much farther from the middle have to be within reach as well."""
_SEED: Final = 0x1DE27
_COULOMB_SPEED: Final = 0.05
"""Over which the sign of dry friction is smoothed [rad/s], as in the law."""
_TORQUE_NOISE: Final = 0.02
"""What a torque is known to, as a share of the rated one: ripple and cogging; it decides no more than the figures that
are told beforehand."""


class NoExcitation(UserError):
    """No motion of the kind fits into the limits."""


@dataclass(frozen=True, slots=True)
class Borders:
    """Within which the tool stays, base frame."""

    low: tuple[float, float, float]
    """[m]"""
    high: tuple[float, float, float]
    """[m]"""
    reach: float
    """From the base's axis [m]."""
    speed: float
    """[m/s]"""
    acceleration: float
    """[m/s²]"""
    torque: float
    """Of a servomotor, at any time [N m]."""
    rms_torque: float
    """Of a servomotor, on average [N m]."""

    @property
    def middle(self) -> FloatArray:
        """(3,) [m]."""
        middle: FloatArray = 0.5 * (np.array(self.low) + np.array(self.high))
        return middle

    def __str__(self) -> str:
        sides = " × ".join(f"{1e3 * (b - a):.0f}" for a, b in zip(self.low, self.high, strict=True))
        return f"a box of {sides} mm, {self.speed:.2f} m/s, {self.acceleration:.1f} m/s²"


@dataclass(frozen=True, slots=True, eq=False)
class Excitation:
    """A motion around a middle."""

    middle: FloatArray
    """(3,), base frame [m]."""
    cosines: FloatArray
    """Of each axis and harmonic, (3, 8) [m]."""
    sines: FloatArray
    """The same."""
    duration: float
    """With both fades [s]."""
    spread: float
    """How uncertain the least certain parameter should be, as a share of what is believed of it."""
    condition: float
    """Condition number of the regressor with columns of length one."""

    def motion(self, times: FloatArray) -> FloatArray:
        """Place [m], velocity [m/s] and acceleration [m/s²] of the tool at times (n,) [s], (n, 9)."""
        shape, rate, change = _sines(self.cosines, self.sines, times)
        fade, fading, faded = _fade(times, self.duration)
        return np.hstack((
            self.middle + fade * shape, fade * rate + fading * shape,
            fade * change + 2.0 * fading * rate + faded * shape,
        ))  # fmt: skip

    def sampled(self, tick: float) -> FloatArray:
        """A tick apart [s], from rest to rest, (n, 9)."""
        times: FloatArray = np.arange(round(self.duration / tick) + 1, dtype=np.float64) * tick
        table = self.motion(times)
        table[[0, -1], 0:3] = self.middle
        table[[0, -1], 3:9] = 0.0
        return table


def find_excitation(parameters: RobotParameters, borders: Borders, duration: float) -> Excitation:
    """The motion for a robot as it is believed to be, so long [s].

    Raises:
        NoExcitation: there is none within the borders.
    """
    search = _Search(parameters, borders, duration)
    rng = np.random.default_rng(_SEED)
    damping = 1.0 / np.array(HARMONICS)
    draws = [damping * rng.standard_normal((2, 3, len(HARMONICS))) for _ in range(_DRAWS)]
    spread, best = min(((search.spread(draw), draw) for draw in draws), key=lambda pair: pair[0])
    width = 0.5
    for _ in range(_CHANGES):
        mask = rng.random((2, 3, len(HARMONICS))) < 0.25
        tried = best + width * damping * mask * rng.standard_normal(best.shape)
        found = search.spread(tried)
        if found < spread:
            spread, best = found, tried
        else:
            width = max(0.1, 0.995 * width)
    if not np.isfinite(spread):
        raise NoExcitation(f"no motion that shows enough fits into {borders}: give it more room, or a longer time")
    return search.excitation(best)


class _Search:
    """Judges coefficients."""

    def __init__(self, parameters: RobotParameters, borders: Borders, duration: float) -> None:
        self._borders, self._duration = borders, duration
        self._constants = DeltaModel(parameters).constants
        friction = [parameters.arm(number) for number in range(3)]
        believed = [*base_of(parameters), *(arm.viscous for arm in friction), *(arm.coulomb for arm in friction)]
        self._believed = np.maximum(believed, 1e-4)
        self._times: FloatArray = np.linspace(0.0, duration, _LOOKED_AT, dtype=np.float64)
        self._room = 0.5 * (np.array(borders.high) - np.array(borders.low))
        self._noise = _TORQUE_NOISE * parameters.drive.rated_torque
        self._ticks = duration / parameters.drive.tick

    def spread(self, coefficients: FloatArray) -> float:
        """See `Excitation.spread`; infinite where it does not fit."""
        return self._judge(coefficients)[0]

    def excitation(self, coefficients: FloatArray) -> Excitation:
        """What is made of coefficients (2, 3, 8)."""
        spread, condition, scaled = self._judge(coefficients)
        return Excitation(self._borders.middle, scaled[0], scaled[1], self._duration, spread, condition)

    def _judge(self, coefficients: FloatArray) -> tuple[float, float, FloatArray]:
        shape, _, _ = _sines(coefficients[0], coefficients[1], self._times)
        filled = coefficients * (self._room / np.abs(shape).max(axis=0))[:, None]
        scaled = filled * self._largest(filled)
        nothing = (np.inf, np.inf, scaled)
        for _ in range(25):
            motion = Excitation(self._borders.middle, scaled[0], scaled[1], self._duration, 0.0, 0.0).motion(
                self._times
            )
            status, _, torque, _ = torque_demand(self._constants, _COULOMB_SPEED, np.ascontiguousarray(motion))
            if status != OK or not self._within_reach(motion):
                scaled = 0.93 * scaled
                continue
            rms = np.sqrt((torque**2).mean(axis=0)).max()
            if np.abs(torque).max() <= self._borders.torque and rms <= self._borders.rms_torque:
                break
            scaled = 0.93 * scaled
        else:
            return nothing
        try:
            columns = friction_columns(self._constants, motion)
        except ValueError:
            return nothing
        inverse = np.linalg.inv((scale := np.linalg.norm(columns, axis=0))[:, None] * np.eye(len(scale)))
        values = np.linalg.svd(columns @ inverse, compute_uv=False)
        information = (columns * self._believed).T @ (columns * self._believed)
        if values[-1] < 1e-6 * values[0]:
            return nothing
        share = np.sqrt(np.diag(np.linalg.inv(information)) * _LOOKED_AT / self._ticks) * self._noise
        return float(share.max()), float(values[0] / values[-1]), scaled

    def _within_reach(self, motion: FloatArray) -> bool:
        """Also a little farther out: an arm that is not quite as believed shall not come near its singular poses."""
        farther = motion.copy()
        farther[:, :3] += (_MARGIN - 1.0) * (motion[:, :3] - self._borders.middle)
        return torque_demand(self._constants, _COULOMB_SPEED, farther)[0] == OK

    def _largest(self, coefficients: FloatArray) -> float:
        """By how much they can be multiplied until place, speed or acceleration comes to its border."""
        borders = self._borders
        shape, rate, change = _sines(coefficients[0], coefficients[1], self._times)
        fade, fading, faded = _fade(self._times, self._duration)
        place, speed = fade * shape, fade * rate + fading * shape
        acceleration = fade * change + 2.0 * fading * rate + faded * shape
        sideways = borders.reach - float(np.hypot(*borders.middle[:2]))
        shares = (
            float((np.abs(place).max(axis=0) / self._room).max()), float(np.hypot(*place[:, :2].T).max()) / sideways,
            float(np.linalg.norm(speed, axis=1).max()) / borders.speed,
            float(np.linalg.norm(acceleration, axis=1).max()) / borders.acceleration,
        )  # fmt: skip
        return 0.92 / max(shares)  # between the states that are looked at it may be a little quicker


def friction_columns(constants: FloatArray, motion: FloatArray) -> FloatArray:
    """The regressor of a motion of the tool (n, 9) with the friction of its shafts, (3 n, 16).

    Raises:
        ValueError: it is out of reach.
    """
    angle = np.empty((len(motion), 3))
    for row, place in enumerate(motion[:, :3].tolist()):
        for arm in range(3):
            status, angle[row, arm] = inverse_arm(constants, arm, (place[0], place[1], place[2]))
            if status != OK:
                raise ValueError(f"the arm does not reach {place} m")
    step = 1e-4
    before, after = (
        _angles(constants, motion[:, :3] + sign * step * motion[:, 3:6] + 0.5 * step**2 * motion[:, 6:9])
        for sign in (-1.0, 1.0)
    )
    rate, change = (after - before) / (2.0 * step), (after - 2.0 * angle + before) / step**2
    return with_friction(regressor(constants, angle, rate, change), rate)


def with_friction(columns: FloatArray, rate: FloatArray) -> FloatArray:
    """Columns of viscous and of dry friction beside those of `regressor` (n, 3, 10), for rates (n, 3): (3 n, 16)."""
    out = np.zeros((len(rate), 3, columns.shape[2] + 6))
    out[:, :, : columns.shape[2]] = columns
    for arm in range(3):
        out[:, arm, columns.shape[2] + arm] = rate[:, arm]
        out[:, arm, columns.shape[2] + 3 + arm] = np.tanh(rate[:, arm] / _COULOMB_SPEED)
    return out.reshape(-1, out.shape[2])


def _angles(constants: FloatArray, places: FloatArray) -> FloatArray:
    angle = np.empty((len(places), 3))
    for row, place in enumerate(places.tolist()):
        for arm in range(3):
            _, angle[row, arm] = inverse_arm(constants, arm, (place[0], place[1], place[2]))
    return angle


def _sines(cosines: FloatArray, sines: FloatArray, times: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The sum and its first two derivatives, (n, 3) each."""
    pulsation = 2.0 * np.pi * BASE_FREQUENCY * np.array(HARMONICS, dtype=float)
    phase = np.outer(times, pulsation)
    c, s = np.cos(phase), np.sin(phase)
    shape = c @ cosines.T + s @ sines.T
    rate = (-s * pulsation) @ cosines.T + (c * pulsation) @ sines.T
    change = (-c * pulsation**2) @ cosines.T + (-s * pulsation**2) @ sines.T
    return shape, rate, change


def _fade(times: FloatArray, duration: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """From 0 to 1 and back again by quintics, with two derivatives [1/s, 1/s²], (n, 1) each."""
    left = np.minimum(times, duration - times)
    sign = np.where(times < duration - times, 1.0, -1.0)
    t = np.clip(left / FADE, 0.0, 1.0)
    value = t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
    rate = sign * 30.0 * t**2 * (1.0 - t) ** 2 / FADE
    change = 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t) / FADE**2
    return value[:, None], rate[:, None], change[:, None]
