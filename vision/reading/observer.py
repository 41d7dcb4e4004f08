"""Follows a game by looking: learns the set of pieces, reads what was played, and takes in what the rules confirm."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

import chess

from vision.arrays import Array
from vision.reading.appearance import Appearance
from vision.reading.evidence import Codes, Cover, Evidence, codes_of, states_of
from vision.reading.features import Light, change_odds, describe, exposure_step, light_of
from vision.reading.moves import MoveReading, decide
from vision.reading.occupancy import DepthOccupancy
from vision.reading.piece_kinds import KindClassifier
from vision.reading.rectified_view import SQUARE_PX, RectifiedView
from vision.reading.solids import Solids
from vision.reading.visibility import cover

_STEP: Final = SQUARE_PX // 10
SHIFTS: Final = tuple((x, y) for x in (-_STEP, 0, _STEP) for y in (-_STEP, 0, _STEP))
"""By which squares are taken off their places to learn from them: a tenth of a side, as people put pieces down [px]."""


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """One look and what it says. Comes from ``Observer.look`` and goes to ``Observer.confirm``."""

    evidence: Evidence
    light: Light
    solids: Solids | None


class Observer:
    """Knows a position, and what it looks like."""

    def __init__(self, board: chess.Board, sight: RectifiedView) -> None:
        """Begin with a position that is known to stand there."""
        self.board = board.copy()  # the last position that is known; a copy of its own
        light = light_of(sight.plan)
        self._appearance = Appearance(describe(light).shape[1])
        self._standing = DepthOccupancy()
        self._kinds = KindClassifier()
        self._deep = sight.solids is not None
        self._learn(light, sight.solids, codes_of(board))

    def look(self, sight: RectifiedView) -> Observation:
        """Take in a settled view.

        Raises:
            ValueError: the camera has depth and had none before, or the other way round.
        """
        if (sight.solids is not None) != self._deep:
            raise ValueError("one look has depth and another has none: follow a game with one camera")
        light = light_of(sight.plan)
        # brightness as if the exposure had stayed what it was at first
        light = light.brighter(-exposure_step(light, self._light_before))
        states = self._appearance.likelihood(describe(light))
        solid = None if sight.solids is None else self._standing.likelihood(sight.solids)
        odds = change_odds(light, self._light_before)
        evidence = Evidence(states, odds, cover(sight.camera), solid, self._measured(sight.solids))
        return Observation(evidence, light, sight.solids)

    def _measured(self, solids: Solids | None) -> Cover | None:
        """What hides squares in this picture and in the one before it."""
        if solids is None or self._other_before is None:
            return None
        now, before = solids.other, self._other_before
        return Cover(now.mean(axis=1), before.mean(axis=1), (now ^ before).mean(axis=1))

    def decide(self, look: Observation, plies: int = 1) -> MoveReading:
        """What was played since the known position, or doubt."""
        decision = decide(look.evidence, self.board, plies, self._codes_before)
        return self._kinds.promoted(decision, None if look.solids is None else look.solids.top)

    @property
    def pictured(self) -> Codes:
        """The pieces in the picture that looks are compared with: of the last position that a look has shown."""
        return self._codes_before

    @property
    def heights(self) -> dict[int, float]:
        """How high each kind of ``chess.PIECE_TYPES`` looks to this camera [m], as far as they were seen."""
        return self._kinds.heights()

    def confirm(self, look: Observation, board: chess.Board) -> None:
        """Take a position as known: the rules or a person have confirmed that the look shows it."""
        self.board = board.copy()
        self._learn(look.light, look.solids, codes_of(board))

    def stand(self, board: chess.Board) -> None:
        """Take a position as known that no look has shown, as the next move may be made already: nothing is learnt."""
        self.board = board.copy()

    def _learn(self, light: Light, solids: Solids | None, codes: Codes) -> None:
        states = states_of(codes)
        self._appearance.learn([describe(light, shift) for shift in SHIFTS], states)
        if solids is not None:
            self._standing.learn(solids, states)
            self._kinds.learn(solids.top, codes)
        self._light_before, self._codes_before = light, codes
        self._other_before = None if solids is None else solids.other


def likelihood_by_others(sight: RectifiedView, codes: Codes, doubted: Collection[int]) -> Array:
    """What squares of one picture look like, as ``Appearance.likelihood``, by what is known to stand on the other ones.

    On the doubted squares the position may be anything, and nothing is learnt from them.
    """
    light = light_of(sight.plan)
    states = states_of(codes).copy()
    states[list(doubted)] = -1
    appearance = Appearance(describe(light).shape[1])
    appearance.learn([describe(light, shift) for shift in SHIFTS], states)
    return appearance.likelihood(describe(light))
