"""A piece that stands behind another, where the camera sees no more than a corner of it, is not asked for."""

from __future__ import annotations

import chess

from app.measure.bench.vision.games import open_studio
from app.pieces.inventory import Inventory, Transfer
from app.pieces.layout import start_layout
from hardware.piece_set import Colour, Kind
from hardware.sim.process.table_studio import PlacedPiece
from hardware.sim.render.settings import SceneState
from hardware.table import Place, TableSettings, square_place
from tests.app.execution.test_toppled import Still, following

TABLE = TableSettings()
BEHIND, BEFORE = Place("L", 0), Place("L", 1)  # seen from Black's side


def test_what_a_person_has_put_behind_a_captured_queen_is_where_it_peeps_out() -> None:
    """As in a campaign: a pawn was captured by an illegal move, and put beside the board."""
    board = chess.Board("rnbqkbnr/pppppppp/8/8/4P3/8/PPPP1PPP/RNB1KBNR w KQkq - 0 1")
    stands = Inventory.of(start_layout(board, TABLE), TABLE)
    queen = next(
        piece for piece in stands if (piece.colour, piece.kind) == (Colour.WHITE, Kind.QUEEN) and piece.place.in_tray
    )
    stands = stands.moved(Transfer.of(queen, BEFORE))
    pawn = stands.at(square_place(chess.E4))
    assert pawn is not None
    assert stands.at(BEHIND) is None
    poses = {piece.name: PlacedPiece(piece.name, *TABLE.xy(piece.place)) for piece in stands}
    (x, y), (column, line) = TABLE.xy(BEHIND), TABLE.xy(BEFORE)
    aside = poses | {queen.name: PlacedPiece(queen.name, column, line)}
    with open_studio(TABLE) as studio:
        still = Still(studio.frame(poses.values(), SceneState(), 4800))
        observer = following(still, board)
        hidden = aside | {pawn.name: PlacedPiece(pawn.name, x - 0.002, y + 0.0024)}
        gone = {name: pose for name, pose in aside.items() if name != pawn.name}
        seen = []
        for number, shown in enumerate((hidden, gone)):
            still.shown = studio.frame(shown.values(), SceneState(), 4801 + number)
            observer.verify(stands)
            seen.append(observer.whereabouts(stands))
    there, nowhere = seen
    assert there is not None
    assert nowhere is not None
    assert (there.moved, there.missing) == (frozenset({pawn.name}), ())
    assert there.standing[pawn.name] == TABLE.xy(BEHIND)
    assert nowhere.missing == (pawn,)
