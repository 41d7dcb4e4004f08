"""What can go wrong with a chess engine, by who has to act.

EngineProblem
├── EngineMissing   install Stockfish, or name another binary
├── EngineRefused   ask for something that the engine offers
├── BookBroken      name another opening book, or none
└── EngineFailed    the engine misbehaved, was restarted, and misbehaved again; asked anew, it is started anew

Within the room, ``Misbehaved`` is one failure of one process, before anything was tried against it.
"""

from collections.abc import Sequence
from itertools import groupby


class EngineProblem(Exception):
    """Any trouble with the engine; the message is one sentence with the next step."""


class EngineMissing(EngineProblem):
    """There is no engine to start."""


class EngineRefused(EngineProblem):
    """A setting or a question that this engine cannot take; asking again would not help."""


class BookBroken(EngineProblem):
    """An opening book that is not there or cannot be read."""


class EngineFailed(EngineProblem):
    """The engine failed again and again. It may be asked anew: once it is repaired, the game can go on."""

    def __init__(self, path: str, doing: str, reasons: Sequence[str]) -> None:
        """Build the sentence: the binary, what was asked of it such as "choosing a move", and what happened at each
        attempt in order, each a phrase such as "it died with exit code 1".
        """
        super().__init__(
            f"engine {path} failed {len(reasons)} times in a row in {doing} "
            f"({', then '.join(reason for reason, _ in groupby(reasons))}): "
            "try it by hand in a terminal, or name another one with --engine PATH"
        )
        self.path = path
        self.reasons = tuple(reasons)


class Misbehaved(Exception):
    """The engine hung, died or broke the protocol; the message is a phrase, and the process is of no more use."""


class Hung(Misbehaved):
    """It gave no answer: a failure that has cost time already."""
