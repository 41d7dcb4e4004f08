"""How high the board really is, once something was touched at another height than it should be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from app import UserError
from app.pieces.inventory import Inventory
from app.rig.arm import Arm, ArmPaused, NothingTouched, TouchedElsewhere
from app.terminal.game_display import UserInterface

if TYPE_CHECKING:
    from app.motion import Planner
    from vision.pieces.lying_or_standing import MisplacedPiece


FURTHEST: Final = 0.005
"""What is felt further from where the board should be is something else [m]."""
MOST: Final = 3
"""It is felt so often at most: what is touched elsewhere again and again is not the board's fault."""


class BoardHeight:
    """What is known of it; felt when it is doubted.

    Attributes:
        lower: by how much the board is lower than its table says [m]; 0 as long as nobody has felt it.
    """

    def __init__(self) -> None:
        self.lower = 0.0
        self._left = MOST

    def is_doubted_by(self, stop: UserError) -> bool:
        """Whether a motion that ended so is a reason to feel it."""
        return isinstance(stop, TouchedElsewhere) and self._left > 0

    def feel(
        self, arm: Arm, planner: Planner, near: MisplacedPiece, misplaced: Sequence[MisplacedPiece], stands: Inventory,
        ui: UserInterface,
    ) -> None:  # fmt: skip
        """Feel it beside a piece; the arm stays there. Where that cannot be done nothing more is known than before."""
        from app.execution.recovery_plans import plan_feeling_board
        from app.motion.plan import PlanRefused

        try:
            feeling = plan_feeling_board(planner, near, misplaced, stands)
            touched = arm.execute(feeling.plan).touched
        except (ArmPaused, NothingTouched, PlanRefused) as stop:
            ui.phase(str(stop))
            return
        self._left -= 1
        lower = 0.0 if touched is None else touched - feeling.expected
        if abs(lower) > FURTHEST:
            ui.phase(f"something was touched {_off(lower)} the board should be: it counts as no board")
            return
        self.lower = lower
        ui.phase(f"the board is {_off(lower)} its table says")


def _off(lower: float) -> str:
    return f"{abs(lower) * 1e3:.1f} mm {'lower' if lower > 0.0 else 'higher'} than"
