"""What can go wrong with a chess engine, by who has to act.

EngineProblem
├── EngineMissing   install Stockfish, or name another binary
├── EngineRefused   ask for something that the engine offers
└── EngineFailed    the engine misbehaved, was restarted, and misbehaved again
"""

from __future__ import annotations

from collections.abc import Sequence


class EngineProblem(Exception):
    """Any trouble with the engine; the message is one sentence with the next step."""


class EngineMissing(EngineProblem):
    """There is no engine to start."""


class EngineRefused(EngineProblem):
    """A setting or a question that this engine cannot take; asking again would not help."""


class EngineFailed(EngineProblem):
    """The engine failed, was restarted, and failed again."""

    def __init__(self, path: str, doing: str, reasons: Sequence[str]) -> None:
        """Build the sentence.

        Args:
            path: the binary.
            doing: what was asked of it, such as "choosing a move".
            reasons: what happened at each attempt, in order, each a phrase such as "it died with exit code 1".
        """
        super().__init__(
            f"engine {path} failed in {doing}, again after a restart ({', then '.join(reasons)}): "
            "try it by hand in a terminal, or name another one with --engine PATH"
        )
        self.path = path
        self.reasons = tuple(reasons)
