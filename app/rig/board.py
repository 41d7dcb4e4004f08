"""The rig ``board``: no physics, no camera, no arm. Plans are made as for a real arm and come out exactly as planned.

Time is virtual: it passes by what the arm would have needed, and by what somebody sleeps; nobody waits for it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike

from app.rig.arm import Arm, ArmAtRest, Outcome
from app.rig.devices import EndState, GuardFeed
from app.terminal.shown import View
from controller.protocol import Result
from hardware.interfaces import Clock
from hardware.parameters import RobotParameters

if TYPE_CHECKING:
    from app.motion.plan import Motion, Plan


class BoardClock:
    """``Clock`` of virtual time."""

    def __init__(self) -> None:
        self._now = 0.0

    def now(self) -> float:
        """Virtual time [s]."""
        return self._now

    def sleep(self, duration: float) -> None:
        """Let virtual time pass; returns at once."""
        self._now += max(0.0, duration)


class BoardArm:
    """``Arm`` that does exactly what is planned, in no time.

    A motion that a guard has to end is ended by it when that is expected: the fingers find their piece, a piece finds
    the board. What is between the fingers presses with the force that fired the guard, until they open.
    """

    lead_ticks = 0
    last_motion = 0
    """Nobody hears telemetry of it."""
    stopped = False
    """Nobody listens to an arm of paper, and it is where it goes at once: there is nothing to stop."""

    def __init__(self, home: ArrayLike, parameters: RobotParameters, clock: BoardClock) -> None:
        """At rest at a tool point, base frame (3,) [m], fingers open; the clock goes on by what each plan takes."""
        self._drive_tick, self._clock = parameters.drive.tick, clock
        self._stroke = parameters.gripper.stroke
        self._state = ArmAtRest(np.array(home, dtype=float), self._stroke, 0)

    def state(self) -> ArmAtRest:
        """See ``Arm.state``."""
        return self._state

    def settle(self) -> ArmAtRest:
        """See ``Arm.settle``."""
        return self._state

    def resume(self) -> None:
        """See ``Arm.resume``: nobody pushes an arm of paper."""

    def release(self) -> None:
        """See ``Arm.release``: nobody has stopped it."""

    def execute(self, plan: Plan, begin: Callable[[Motion], None] | None = None) -> Outcome:
        """See ``Arm.execute``; nothing is late and nothing is held. Torques and forces are unknown: zero."""
        before = self._state.tick
        for index, planned in enumerate(plan.motions):
            motion = planned.continued(self._state.reference)
            if begin is not None:
                begin(motion)
            self._state = self._after(motion, plan.lead if index else 0.0)
        duration = (self._state.tick - before) * self._drive_tick
        self._clock.sleep(duration)
        return Outcome(duration, 0.0, 0.0, self._state.tick)

    def _after(self, motion: Motion, lead: float) -> ArmAtRest:
        samples = motion.samples
        if motion.wanted is not Result.DONE:
            samples = samples[: max(1, min(len(samples), round(motion.expected / self._drive_tick)))]
        state = self._state
        velocity = samples["finger_velocity"]
        felt = state.felt
        if felt > 0.0:  # what is held keeps them apart
            velocity = np.maximum(velocity, 0.0)
            felt = 0.0 if velocity.any() else felt
        if motion.grips:
            felt = float(samples["guard_level"][-1])
        finger = min(max(state.finger + float(velocity.sum()) * self._drive_tick, 0.0), self._stroke)
        ticks = len(samples) + round(lead / self._drive_tick)
        return ArmAtRest(samples["position"][-1].copy(), finger, state.tick + ticks, felt)


class BoardRig:
    """``Rig`` of paper: nothing is opened, and nothing can fail. A context manager."""

    def __init__(self, home: ArrayLike, parameters: RobotParameters) -> None:
        """With the arm at ``home``, base frame (3,) [m]."""
        clock = BoardClock()
        self.clock: Clock = clock
        self.arm: Arm = BoardArm(home, parameters, clock)
        self.camera: None = None
        self.referee: None = None
        self.controller: None = None

    def guard_feed(self) -> GuardFeed | None:
        """See ``Rig.guard_feed``."""
        return None

    def film(self, view: View = "film", rate: float | None = None) -> None:
        """See ``Rig.film``."""

    def record_positions(self, path: Path) -> None:
        """See ``Rig.record_positions``."""

    def failure(self) -> str | None:
        """Never."""
        return None

    def close(self) -> EndState | None:
        """Nothing moves."""
        return EndState(at_rest=True, arm_speed=0.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
