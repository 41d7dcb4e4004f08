"""Names of figures and benches: what computes them takes seconds to load, and a wrong name is refused before."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from app import UserError

FIGURES: Final = ("5", "6", "7", "9", "newton", "encoder", "touch", "workspace", "separation", "move")
"""Numbers are the paper's."""
BENCHES: Final = (
    "law", "loop", "finger", "kills", "motion", "sim", "grip", "fallen", "recovery", "people", "knocks", "vision",
    "clock", "drives", "pictures", "identify", "commission", "campaign",
)  # fmt: skip


def require_name(what: str, name: str, names: Sequence[str]) -> None:
    """Make sure that there is a figure, or a bench, of a name.

    Raises:
        UserError: there is none.
    """
    if name not in names:
        raise UserError(f"there is no {what} '{name}', choose from: {', '.join(names)}")
