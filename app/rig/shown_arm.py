"""An arm whose paths are shown as they begin, to whoever watches."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from app.rig.arm import Arm, Outcome
from app.terminal.shown import PathShown

if TYPE_CHECKING:
    from app.motion.plan import Motion, Plan


class ShownArm:
    """``Arm`` that does as another one does; ``show`` is told each motion before it begins."""

    def __init__(self, arm: Arm, show: Callable[[PathShown], None]) -> None:
        self._arm, self._show = arm, show
        self.lead_ticks = arm.lead_ticks
        self.state, self.settle = arm.state, arm.settle
        self.resume, self.release = arm.resume, arm.release

    @property
    def stopped(self) -> bool:
        """See ``Arm.stopped``."""
        return self._arm.stopped

    @property
    def last_motion(self) -> int:
        """See ``Arm.last_motion``."""
        return self._arm.last_motion

    def execute(self, plan: Plan, begin: Callable[[Motion], None] | None = None) -> Outcome:
        """See ``Arm.execute``."""

        def shown(motion: Motion) -> None:
            samples = motion.samples
            number = self._arm.last_motion + 1
            self._show(PathShown(motion.label, samples["position"], samples["stiffness"], number))
            if begin is not None:
                begin(motion)

        return self._arm.execute(plan, shown)
