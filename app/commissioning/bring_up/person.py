"""What a person at the arm is asked: at a terminal, or answered beforehand by options and a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from app import UserError
from app.settings.toml import load_toml
from controller.model.compiled import FloatArray
from hardware.frozen import FrozenFinite

_NO: Final = frozenset({"n", "no"})
Read = Callable[[str], str]
"""Shows a prompt, and returns the line that is typed."""


class GivenAnswers(FrozenFinite):
    """What was answered beforehand: a TOML file of ``--answers``, and options."""

    measured_tool: tuple[float, float, float] | None = None
    """Where the tool was measured on the brakes, after step ``axes`` has moved it: x along the files a to h, y along
    the ranks, height above the playing surface, from the board's centre [mm]."""
    pole_pairs: int = 5
    """Of the servomotors, for step ``identify``; 0: their ripple is not looked for."""


def load_answers(path: Path) -> GivenAnswers:
    """Read a file of answers; raises ``ConfigError`` if something in it is wrong."""
    return load_toml(path, GivenAnswers, "answers", "give a TOML file such as: measured_tool = [0.0, -75.0, 145.0]")


class Commissioner:
    """Somebody who is asked, unless the answer was given beforehand."""

    def __init__(self, answers: GivenAnswers, read: Read | None) -> None:
        """``read`` None: nobody sits there; all that is asked is answered with yes."""
        self.answers = answers
        self._read = read

    def agrees(self, question: str) -> bool:
        """Whether they say yes, which Enter says too."""
        return self._read is None or self._read(f"{question} [Y/n] ").strip().lower() not in _NO

    def goes_on(self) -> bool:
        """Whether the next step may begin."""
        return self.agrees("go on?")

    def sees_room(self, believed: float, needed: float) -> bool:
        """Whether the tool is as high above the board as is needed, though the encoders say that it is not; both [m].

        They may count the wrong way. It is so only where somebody has looked: a tool that was measured beforehand
        counts, a yes to everything does not.
        """
        if self.answers.measured_tool is not None:
            return 1e-3 * self.answers.measured_tool[2] >= needed
        return self._read is not None and self.agrees(
            f"the encoders say that the tool is {1e3 * believed:.0f} mm above the board; is it really at least "
            f"{1e3 * needed:.0f} mm?"
        )

    def tool(self, believed: FloatArray) -> FloatArray:
        """Where they measure the tool, board frame (3,) [m], given where the encoders say it is.

        What the encoders say is told only afterwards: who knows it measures it.

        Raises:
            UserError: it was not given beforehand, and nobody can be asked.
        """
        given = self.answers.measured_tool
        while given is None:
            if self._read is None:
                raise UserError(
                    "where is the tool? Measure it, and give --measured-tool x,y,height [mm], from the board's centre"
                )
            given = parse_triple(self._read(
                "measure the point between the pads: x along the files a to h, y along the ranks, height above the "
                "board, from its centre [mm], to 3 mm: "
            ))  # fmt: skip
        return 1e-3 * np.array(given)


def parse_triple(text: str) -> tuple[float, float, float] | None:
    """Three numbers with commas or spaces between; None: these are none."""
    try:
        values = [float(part) for part in text.replace(",", " ").split()]
    except ValueError:
        return None
    if len(values) != 3 or not np.isfinite(values).all():
        return None
    return values[0], values[1], values[2]
