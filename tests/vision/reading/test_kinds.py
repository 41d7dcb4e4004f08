"""Heights of kinds as a camera sees them, which need not be what they are."""

from __future__ import annotations

import chess
import numpy as np
import pytest

from vision.reading.evidence import codes_of
from vision.reading.piece_kinds import KindClassifier


def test_heights_are_what_known_positions_have_shown() -> None:
    board, kinds = chess.Board(), KindClassifier()
    real = {chess.PAWN: 0.034, chess.KNIGHT: 0.043, chess.BISHOP: 0.047, chess.ROOK: 0.038, chess.QUEEN: 0.054}
    rng, codes = np.random.default_rng(1), codes_of(board)
    for _ in range(3):
        heights = np.array([real.get(abs(int(code)), 0.0) for code in codes]) + 0.0018
        kinds.learn(np.where(codes, heights + rng.normal(0.0, 0.0005, 64), 0.0), codes)
    seen = kinds.heights()
    assert {kind: seen[kind] for kind in real} == pytest.approx({k: h + 0.0018 for k, h in real.items()}, abs=5e-4)


def test_of_kinds_that_were_not_seen_nothing_is_said() -> None:
    board, kinds = chess.Board("4k3/8/8/8/8/8/4P3/4K3 w - - 0 1"), KindClassifier()
    kinds.learn(np.full(64, 0.03), codes_of(board))
    assert set(kinds.heights()) == {chess.PAWN, chess.KING}
