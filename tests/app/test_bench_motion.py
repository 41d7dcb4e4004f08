"""The bench of motion runs, its parts measure what they say, and the optimum agrees with what is known."""

from __future__ import annotations

import chess
import numpy as np
import pytest

from app.bench import motion
from app.bench.optimum import optimal_duration
from app.bench.plies import Bed, Disorder, positions
from app.manipulation import MoveKind
from app.motion import PROFILES, Profile
from app.motion.path import blend
from app.motion.time_law import Bounds, time_law
from hardware.parameters import load_parameters
from hardware.table import TableSettings

PARAMETERS, TABLE, DEFAULT = load_parameters(), TableSettings(), PROFILES[Profile.DEFAULT]


@pytest.mark.slow
def test_the_bench_runs_and_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion, "QUICK", {Profile.DEFAULT: 6, Profile.FAST: 3, Profile.GENTLE: 2})
    monkeypatch.setattr(motion, "QUICK_COMPARED", 3)
    said: list[str] = []
    report = motion.motion_bench(True, said.append)
    failing = {name for name, one in report.rows.items() if not one.holds}
    assert failing <= {"planning", "to_stopping"}, "the machine decides the one, so few moves the other"
    assert report.rows["default_quiet"].n + report.rows.get("default_capture", report.rows["failed"]).n >= 4
    assert said[0] == "profile default: 6 transfers in the world"


@pytest.mark.parametrize(
    ("length", "expected"), [(0.3, 0.3 / 0.8 + 0.8 / 15 + 15 / 500), (0.002, (32 * 0.002 / 500) ** (1 / 3))]
)
def test_the_optimum_along_a_line_is_the_known_one(length: float, expected: float) -> None:
    """A trapezoid of acceleration; or four phases of the largest jerk, with the length j T³ / 32."""
    path = blend(np.array([[0.0, 0.0, 0.0], [length, 0.0, 0.0]]), np.zeros(0))
    bounds = [Bounds(0.8, 15.0, 500.0)]
    assert time_law(path, bounds).duration == pytest.approx(expected, rel=1e-6)
    assert optimal_duration(path, bounds, intervals=40) == pytest.approx(expected, rel=0.01)


def test_pieces_that_stand_off_are_set_down_on_their_squares() -> None:
    board = chess.Board("4k3/8/8/8/8/8/P6R/4K3 w - - 0 1")
    bed = Bed(board, DEFAULT, PARAMETERS, TABLE, Disorder((0.003, 0.003), 0.05), 5)
    stood = bed.positions()
    done = bed.play(chess.Move.from_uci("a2a4"))
    name = done.ply.transfers[0].name
    assert np.hypot(*(stood[name][:2] - TABLE.xy(done.ply.transfers[0].source))) > 1e-3
    assert done.ply.kind is MoveKind.QUIET
    assert done.released[name] < 3e-4
    assert done.disturbed < 1e-4
    assert done.duration == pytest.approx(done.plan.expected, abs=0.1)
    assert len(done.torques) * PARAMETERS.drive.tick == pytest.approx(done.duration)
    again = bed.play(chess.Move.from_uci("e8d8"))
    assert again.released.keys() == {again.ply.transfers[0].name}


def test_a_board_at_another_height_is_touched_gently() -> None:
    durations = []
    for sunk in (-0.003, 0.003):
        board = chess.Board("4k3/8/8/8/8/8/P6R/4K3 w - - 0 1")
        bed = Bed(board, DEFAULT, PARAMETERS, TABLE, Disorder(sunk=sunk), 6)
        done = bed.play(chess.Move.from_uci("h2h6"))
        name = done.ply.transfers[0].name
        assert done.released[name] < 3e-4
        assert bed.positions()[name][2] == pytest.approx(0.0, abs=5e-4)
        assert done.peak_contact < 12.0
        durations.append(done.duration)
    slow = 0.006 / DEFAULT.touch_speed
    assert durations[1] - durations[0] == pytest.approx(slow, abs=0.05), "down to where the board really is"


def test_positions_are_of_running_games() -> None:
    found = positions(3)
    boards = [next(found) for _ in range(20)]
    assert not any(board.is_game_over() for board in boards)
    assert len({board.fen() for board in boards}) > 15
