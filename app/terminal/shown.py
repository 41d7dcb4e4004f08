"""What user interfaces are shown besides words: devices, looks at the board, the arm's paths."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol

import chess

from hardware.interfaces import Pace
from hardware.piece_set import Colour

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class FilmSource(Protocol):
    """Pictures of the whole scene at a steady rate of plant time, for a film."""

    def next(self) -> tuple[NDArray[np.uint8], int] | None:
        """The next picture, RGB (h, w, 3), and its tick; None when there are no more."""

    def cancel(self) -> None:
        """Let ``next`` return None, from another thread."""

    def close(self) -> None:
        """Take no more."""


RigKind = Literal["sim", "board", "lab"]
View = Literal["camera", "film"]


@dataclass(frozen=True, slots=True)
class SessionShown:
    """What is played on which rig.

    Attributes:
        folder: of the session.
        rig: sim, board or lab.
        pace: of plant time.
        tick: its length [s].
        person: who plays by hand; None: nobody.
        hands: a simulated hand moves that person's pieces.
        sees: there is a camera.
        controller: its host, UDP port and key file; None: there is none, or not yet.
        live: pictures of the view camera or film, so many a second, while plant time runs; None where there are none.
        start: FEN of the position that the first game begins from; None: that is not known yet.
    """

    folder: Path
    rig: RigKind
    pace: Pace
    tick: float
    person: Colour | None
    hands: bool
    sees: bool
    controller: tuple[str, int, Path] | None = None
    live: Callable[[View, float], FilmSource | None] = lambda _view, _rate: None
    start: str | None = None


@dataclass(frozen=True, slots=True)
class ClockShown:
    """What both clocks show [s], and whose runs; None: nobody's. For free it stands first, as of a delay [s]."""

    left: Mapping[chess.Color, float]
    running: chess.Color | None
    free: float = 0.0


@dataclass(frozen=True, slots=True)
class RemoteShown:
    """Who plays from somewhere else, which pieces, and the words that it makes sense to say now.

    ``name`` and ``side`` are None while nobody is found yet.
    """

    name: str | None
    side: Colour | None
    words: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class LookShown:
    """What a look at the board came to.

    Attributes:
        colour: the picture, RGB (h, w, 3).
        stamp: of its exposure [s, plant].
        outcome: one word.
        text: for people.
        likelihood: of empty, white and black on each square, shape (64, 3); None: the squares were not read.
        grid: where the corners of the squares are in the picture, from a1's outer one along the files, (81, 2) [px].
        squares: that the text is about.
    """

    colour: NDArray[np.uint8]
    stamp: float
    outcome: str
    text: str
    likelihood: NDArray[np.float64] | None
    grid: NDArray[np.float64]
    squares: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class PathShown:
    """The reference of a motion that begins: its label, of each sample the tool's place [m] and k_p [1/s²], both of
    shape (n, 3), base frame, and its number, as telemetry counts motions.
    """

    label: str
    position: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    motion: int
