"""The bench of motion runs, its parts measure what they say, and the optimum agrees with what is known."""

from __future__ import annotations

import sys
from dataclasses import replace

import chess
import numpy as np
import pytest

from app import UserError
from app.measure.bench.beds.parts import Part
from app.measure.bench.beds.plies import Disorder, GameBed, positions
from app.measure.bench.beds.touchdown import WOOD, Touchdown, set_down
from app.measure.bench.motion import rows as motion
from app.measure.bench.motion.optimum import optimal_duration
from app.motion import PROFILES, Profile
from app.motion.path import blend
from app.motion.route import timed
from app.motion.timing.time_law import Bounds, time_law
from app.pieces.inventory import MoveKind
from controller.protocol import Guard, Result
from hardware.parameters import load_parameters
from hardware.piece_set import Kind
from hardware.table import TableSettings

PARAMETERS, TABLE, DEFAULT = load_parameters(), TableSettings(), PROFILES[Profile.DEFAULT]


@pytest.mark.slow
def test_the_bench_runs_and_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion, "QUICK", {Profile.DEFAULT: 6, Profile.FAST: 3, Profile.GENTLE: 2})
    monkeypatch.setitem(motion.COMPARED, True, 3)
    monkeypatch.setitem(motion.GRASPS, True, 6)
    said: list[str] = []
    report = motion.motion_bench(True, said.append)
    failing = {name for name, one in report.rows.items() if not one.holds}
    assert failing <= {"planning", "to_stopping", "slide"}, "the machine decides the first, so few moves the others"
    assert report.rows["slide"].mean < report.rows["slide_without"].mean
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
    bed = GameBed(board, DEFAULT, TABLE, Disorder((0.003, 0.003), 0.05), 5)
    stood = bed.positions()
    done = bed.play(chess.Move.from_uci("a2a4"))
    name = done.ply.transfers[0].name
    assert np.hypot(*(stood[name][:2] - TABLE.xy(done.ply.transfers[0].source))) > 1e-3
    assert done.ply.kind is MoveKind.QUIET
    assert done.released[name] < 3e-4
    assert done.disturbed < 1e-4
    assert done.duration == pytest.approx(done.plan.expected, abs=0.1)
    assert len(done.torques) * PARAMETERS.drive.tick == pytest.approx(done.duration)
    assert sum(done.parts.values()) == pytest.approx(done.duration), "each tick belongs to one part"
    assert set(done.parts) == set(Part)
    touched = DEFAULT.touch_height / DEFAULT.touch_speed
    assert done.parts[Part.TOUCH_DOWN] == pytest.approx(touched, abs=0.03)
    assert done.parts[Part.FIRMING] == pytest.approx(DEFAULT.grip.settle, abs=2 * PARAMETERS.drive.tick)
    again = bed.play(chess.Move.from_uci("e8d8"))
    assert again.released.keys() == {again.ply.transfers[0].name}


@pytest.mark.parametrize("higher", [-0.003, 0.0, 0.003])
def test_a_square_at_another_height_than_the_others_is_touched_gently_and_surely(higher: float) -> None:
    """The piece comes down on a square that is higher than the plan believes: its way ends so much lower."""
    board = chess.Board("4k3/8/8/8/8/8/P6R/4K3 w - - 0 1")
    bed = GameBed(board, DEFAULT, TABLE, Disorder(mass_error=0.05), 6)
    ply, plan, _ = bed.planned(chess.Move.from_uci("h2h6"))
    carry = plan.motions[2]
    assert carry.route is not None
    points = np.array(carry.route.points)
    points[-1, 2] += higher
    wrong = timed(replace(carry.route, points=points), DEFAULT, TABLE, PARAMETERS.drive.tick)
    motions = (*plan.motions[:2], replace(carry, samples=wrong.samples, paths=wrong.paths), plan.motions[3])
    bed.plant.truth(reset_peak=True)
    ended = [bed.execute(motions[i].continued(bed.supervisor.reference.position).samples, i < 3) for i in range(4)]
    assert [one.result for one in ended] == [Result.DONE, Result.GRIPPED, Result.TOUCHED, Result.DONE]
    x, y = TABLE.xy(ply.transfers[0].target)
    np.testing.assert_allclose(bed.positions()[ply.transfers[0].name], [x, y, 0.0], atol=3e-4)
    assert bed.plant.truth(reset_peak=False).peak_contact_force < 10.0
    guarded = np.flatnonzero(wrong.samples["guard"] == Guard.TOUCH)[0] * PARAMETERS.drive.tick
    touched = (ended[2].end_tick - ended[2].first_tick) * PARAMETERS.drive.tick - guarded
    assert touched == pytest.approx((DEFAULT.touch_height - higher) / DEFAULT.touch_speed, abs=0.03)


def test_positions_are_of_running_games() -> None:
    found = positions(3)
    boards = [next(found) for _ in range(20)]
    assert not any(board.is_game_over() for board in boards)
    assert len({board.fen() for board in boards}) > 15


@pytest.mark.parametrize("profile", [Profile.DEFAULT, Profile.FAST])
@pytest.mark.parametrize("error", [-0.003, 0.003])
def test_a_piece_is_set_down_softly_wherever_the_board_is_and_harder_on_bare_wood(error, profile):
    felt = set_down(Touchdown(error), PROFILES[profile])
    wood = set_down(Touchdown(error, WOOD, kind=Kind.PAWN), PROFILES[profile])
    assert 4.0 < felt.peak <= 10.0
    assert wood.peak > 1.05 * felt.peak  # not by much: the piece slips in the fingers
    assert felt.lasting < 8.0


def test_without_the_guard_a_piece_is_pressed_until_the_way_ends():
    guarded, pressed = (set_down(Touchdown(0.0, guard=on)) for on in (True, False))
    assert guarded.lasting < 3.0
    assert pressed.lasting > 1.5 * guarded.lasting


def test_without_casadi_it_is_refused_before_anything_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "casadi", None)  # as if it were not installed
    done = list[str]()
    with pytest.raises(UserError, match=r"CasADi, which is not installed: pip install 'touchmove\[bench\]'$"):
        motion.motion_bench(True, done.append)
    assert not done
