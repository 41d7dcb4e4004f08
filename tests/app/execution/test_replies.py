"""Which move a person has made while nobody looked: from one picture of the board after it."""

from __future__ import annotations

from collections.abc import Iterator

import chess
import numpy as np
import pytest

from app.execution.unseen_reply import pieces_of, reply_shown
from app.pieces.layout import start_layout
from hardware.sim.process.table_studio import PlacedPiece, TableStudio
from hardware.sim.render.settings import SceneState
from hardware.table import PieceSpec, TableSettings, square_place
from tests.vision.rendering import studio_of
from vision.board.view import BoardView
from vision.pieces.placement_faults import FaultKind, examine_board

TABLE = TableSettings()
PERSON = 0.006
"""So far people put pieces off the centre, along both axes [m]."""


@pytest.fixture(scope="module")
def studio() -> Iterator[TableStudio]:
    with studio_of(start_layout(chess.Board(), TABLE)) as made:
        yield made


def reply(
    studio: TableStudio, before: chess.Board, after: chess.Board, seed: int, off: tuple[float, float] = (0.0, 0.0)
) -> chess.Move | None:
    """What is found in a picture of the second position, of which the first is known; what changed is off so far."""
    rng = np.random.default_rng(seed)
    spare: dict[tuple[str, str], list[PieceSpec]] = {}
    for one in start_layout(chess.Board(), TABLE):
        spare.setdefault((one.kind, one.colour), []).append(one)
    poses = []
    for square, piece in pieces_of(after).items():
        name = spare[piece.kind, piece.colour].pop().name
        far = PERSON if before.piece_at(square) != after.piece_at(square) else 0.001
        shift = np.array(off) if far == PERSON and any(off) else rng.uniform(-far, far, 2)
        x, y = np.array(TABLE.xy(square_place(square))) + shift
        poses.append(PlacedPiece(name, float(x), float(y), yaw=float(rng.uniform(-3.0, 3.0))))
    frame = studio.frame(poses, SceneState(), seed)
    view = BoardView(frame.intrinsics, studio.camera_from_board(SceneState().mount), TABLE)
    faults = examine_board(frame, view, pieces_of(before)).faults
    wrong = {fault.square for fault in faults if fault.kind is not FaultKind.OFF_CENTRE}
    return reply_shown(frame, view, before, wrong)


@pytest.mark.parametrize(
    ("fen", "move"),
    [
        (chess.STARTING_FEN, "e2e4"),
        (chess.STARTING_FEN, "b1c3"),
        ("rnbqkb1r/ppp2ppp/3p1n2/4N3/4P3/8/PPPP1PPP/RNBQKB1R w KQkq - 0 4", "e5f7"),
        ("rnbqkbnr/ppp1p1pp/8/3pPp2/8/8/PPPP1PPP/RNBQKBNR w KQkq f6 0 3", "e5f6"),
        ("r1bqk1nr/pppp1ppp/2n5/2b1p3/2B1P3/5N2/PPPP1PPP/RNBQK2R w KQkq - 4 4", "e1g1"),
        ("r3k2r/ppp2ppp/2n5/8/8/2N5/PPP2PPP/R3K2R b KQkq - 0 1", "e8c8"),
        ("8/P4k2/8/8/8/8/5K2/8 w - - 0 1", "a7a8q"),
    ],
)
def test_the_move_is_found_that_explains_the_picture(studio: TableStudio, fen: str, move: str) -> None:
    before = chess.Board(fen)
    after = before.copy()
    after.push_uci(move)
    assert reply(studio, before, after, 3) == chess.Move.from_uci(move)


@pytest.mark.parametrize(
    ("fen", "after"),
    [
        (chess.STARTING_FEN, chess.STARTING_FEN),  # nothing was played
        (chess.STARTING_FEN, "rnbqkbnr/pppppppp/8/4P3/8/8/PPPP1PPP/RNBQKBNR b KQkq - 0 1"),  # e2e5
        (chess.STARTING_FEN, "rnbqkbnr/pppppppp/8/8/3PP3/8/PPP2PPP/RNBQKBNR b KQkq - 0 1"),  # two moves
        ("4k3/8/8/3r4/4P3/8/8/4K3 w - - 0 1", "4k3/8/8/3r4/8/8/8/4K3 w - - 0 1"),  # one piece was taken off
    ],
)
def test_what_no_move_explains_is_none(studio: TableStudio, fen: str, after: str) -> None:
    assert reply(studio, chess.Board(fen), chess.Board(after), 4) is None


@pytest.mark.parametrize("off", [(0.0, 0.014), (-0.012, -0.012), (0.013, 0.0)])
def test_a_piece_that_was_put_down_anywhere_is_no_move(studio: TableStudio, off: tuple[float, float]) -> None:
    before, after = chess.Board(), chess.Board()
    after.push_san("e3")
    assert reply(studio, before, after, 5) == chess.Move.from_uci("e2e3")
    assert reply(studio, before, after, 5, off) is None


def test_a_king_that_stays_where_it_stands_castles_by_its_rook(studio: TableStudio) -> None:
    before = chess.Board("4k3/8/8/8/8/8/8/6KR w H - 0 1", chess960=True)
    after = before.copy()
    after.push_san("O-O")
    found = reply(studio, before, after, 6)
    assert found is not None
    assert before.is_castling(found)
