"""How high the board really is, once something was touched at another height than it should be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from app import UserError
from app.pieces.inventory import Inventory
from app.rig.arm import Arm, ArmPaused, NothingTouched, TouchedElsewhere
from app.terminal.interface import UserInterface

if TYPE_CHECKING:
    from app.motion import Planner
    from vision.pieces.lying_or_standing import MisplacedPiece


class BoardHeight:
    """What is known of it; felt once, when it is doubted.

    Attributes:
        lower: by how much the board is lower than its table says [m]; 0 as long as nobody has felt it.
        doubtful: something was not as high as it should be, and nobody has felt the board since.
    """

    def __init__(self) -> None:
        self.lower, self.doubtful = 0.0, False
        self._felt = False

    def doubt(self, stop: UserError) -> None:
        """A motion ended so."""
        self.doubtful = isinstance(stop, TouchedElsewhere) and not self._felt

    def feel(
        self, arm: Arm, planner: Planner, near: MisplacedPiece, misplaced: Sequence[MisplacedPiece], stands: Inventory,
        ui: UserInterface,
    ) -> None:  # fmt: skip
        """Feel it beside a piece; the arm stays there. Where that cannot be done it counts as believed."""
        from app.execution.recovery_plans import plan_feeling_board
        from app.motion.plan import PlanRefused

        self.doubtful, self._felt = False, True
        try:
            feeling = plan_feeling_board(planner, near, misplaced, stands)
            touched = arm.execute(feeling.plan).touched
        except (ArmPaused, NothingTouched, PlanRefused) as stop:
            ui.phase(str(stop))
            return
        self.lower = 0.0 if touched is None else touched - feeling.expected
        ui.phase(f"the board is {self.lower * 1e3:.1f} mm lower than its table says")
