"""A piece that a hand has knocked over is noticed; what lies on another square, or stands half on it, is no move."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import chess
import numpy as np
import pytest

from app.execution.observation import GameObserver
from app.execution.state import Devices
from app.execution.table import Table
from app.game.set_down import badly_set
from app.measure.bench.vision.actions import ClumsyHands
from app.measure.bench.vision.games import Scene, open_studio, random_game
from app.pieces.inventory import Inventory, Transfer
from app.pieces.judging import most_off_centre
from app.pieces.layout import start_layout
from app.pieces.manipulation import NoSpare, transfers
from app.rig.simulation.nominal_view import nominal_view
from hardware.interfaces import Frame
from hardware.piece_set import PIECE_SHAPES
from hardware.sim.process.table_studio import PlacedPiece, TableStudio
from hardware.sim.render.settings import SceneState
from hardware.table import Captured, TableSettings, square_place
from vision.pieces.placement_faults import Fault, FaultKind, examine_board
from vision.reading.outcome import ReadingOutcome

TABLE = TableSettings()


class Still:
    """Camera, arm and clock of a table that is photographed; all stand still."""

    def __init__(self, frame: Frame) -> None:
        self.shown = frame

    def read(self, max_age: float) -> Frame:
        return self.shown

    def state(self) -> None:
        return None

    def now(self) -> float:
        return self.shown.stamp

    def sleep(self, duration: float) -> None:
        raise AssertionError("every picture is new")


@pytest.fixture(scope="module")
def studio() -> Iterator[TableStudio]:
    with open_studio(TABLE) as opened:
        yield opened


def following(still: Still, board: chess.Board, table: TableSettings = TABLE) -> GameObserver:
    """A position that is followed by a camera."""
    devices = Devices(*(cast(Any, still) for _ in range(3)), None)
    observer = GameObserver(devices, table, lambda intrinsics: nominal_view(intrinsics, table))
    observer.begin(board)
    return observer


def of(observer: GameObserver, board: chess.Board, stands: Inventory) -> Table:
    """A table where this stands, with nothing that moves."""
    return cast(Table, SimpleNamespace(observer=observer, board=board, inventory=stands))


def watched(studio: TableStudio, seed: int, board: chess.Board) -> tuple[GameObserver, Still, Scene]:
    """A position set up as a seed decides, and followed by a camera."""
    scene = Scene(studio, TABLE, seed)
    still = Still(scene.picture(board))
    return following(still, board), still, scene


def table_after(
    studio: TableStudio, seed: int, plies: int
) -> tuple[chess.Board, Inventory, GameObserver, Still, Scene]:
    """A position of a random game, followed by a camera; it is White's turn."""
    board = chess.Board()
    for move in random_game(seed, plies):
        board.push(move)
    observer, still, scene = watched(studio, seed, board)
    return board, Inventory.of(start_layout(board, TABLE), TABLE), observer, still, scene


@pytest.mark.parametrize("seed", [4100, 4101, 4102])
def test_a_knocked_piece_is_a_fault_and_a_legal_move_none(studio: TableStudio, seed: int) -> None:
    board, stands, observer, still, scene = table_after(studio, seed, 2 * (seed % 9))
    observer.read()
    assert observer.faults(stands, beyond=math.inf) == ()
    move = scene.rng.choice(list(board.legal_moves))
    after = board.copy()
    after.push(move)
    still.shown = scene.picture(after)
    reading = observer.read()
    assert (reading.decision.verdict, reading.decision.moves) == (ReadingOutcome.MOVE, (move,))
    ply = transfers(board, move, stands)
    assert observer.faults(stands.after(ply), beyond=math.inf) == (), "what was moved stands"
    hands = ClumsyHands(scene.table, TABLE, after, scene.rng)
    hands.knock(move.to_square)
    still.shown = scene.photograph(hands.poses)
    observer.read()
    kinds = {fault.kind for fault in observer.faults(stands.after(ply), beyond=math.inf)}
    assert kinds & {FaultKind.FALLEN, FaultKind.MISSING, FaultKind.FOREIGN}


def test_a_pawn_that_leans_on_a_bishop_before_it_does_not_stand(studio: TableStudio) -> None:
    """As one lay in a campaign: as much like a pawn as not, and the bishop's head is as high as a pawn's."""
    poses = [PlacedPiece(piece.name, *TABLE.xy(piece.place)) for piece in start_layout(chess.Board(), TABLE)]
    leaning = PlacedPiece("black-pawn-f", 0.0599, 0.1056, height=0.0078, yaw=-0.044, tip=-1.17)
    expected = {piece.place.index: piece for piece in start_layout(chess.Board(), TABLE) if piece.place.on_board}
    for seed in range(4600, 4604):
        frame = studio.frame([leaning if one.name == leaning.name else one for one in poses], SceneState(), seed)
        view = nominal_view(frame.intrinsics, TABLE)
        assert [fault.square for fault in examine_board(frame, view, expected).faults] == [chess.F7]


@pytest.mark.parametrize("seed", [4201, 4204, 4208])
def test_a_piece_left_half_way_is_a_fault_however_much_it_looks_like_a_move(studio: TableStudio, seed: int) -> None:
    board, stands, observer, still, scene = table_after(studio, seed, 2 * (seed % 9))
    move = scene.rng.choice([one for one in board.legal_moves if not board.is_capture(one) and one.promotion is None])
    standing, after = stands.after(transfers(board, move, stands)), board.copy()
    after.push(move)
    scene.picture(after)
    hands = ClumsyHands(scene.table, TABLE, after, scene.rng)
    name, (x, y) = hands.name(move.to_square), TABLE.xy(square_place(move.to_square))
    along = np.array(scene.rng.choice([(0, 1), (1, 0), (0, -1), (-1, 0)])) * TABLE.square

    def far_off(share: float) -> bool:
        """Moved, and left by so many squares towards the next one."""
        dx, dy = share * along
        still.shown = scene.photograph({**hands.poses, name: replace(hands.poses[name], x=x + dx, y=y + dy)})
        observer.read()
        faults = observer.faults(standing, beyond=most_off_centre(TABLE), exchanges=False)
        return move.to_square in {fault.square for fault in faults}

    assert far_off(scene.rng.uniform(0.35, 0.5))
    assert not far_off(scene.rng.uniform(0.0, 0.2)), "as people do"


@pytest.mark.parametrize(("said", "beyond"), [(False, most_off_centre(TABLE)), (True, math.inf)])
def test_of_a_move_only_what_it_set_down_counts_and_nothing_off_centre_where_it_was_said(
    said: bool, beyond: float
) -> None:
    asked = list[float]()

    class Watching:
        """Sees two pieces amiss, of which the move has touched one."""

        def faults(self, stands: Inventory, *, beyond: float, exchanges: bool) -> tuple[Fault, ...]:
            asked.append(beyond)
            return tuple(Fault(FaultKind.OFF_CENTRE, square, "", (0.0, 0.0)) for square in (chess.E4, chess.A1))

    table = of(cast(Any, Watching()), chess.Board(), Inventory.of(start_layout(chess.Board(), TABLE), TABLE))
    faults = badly_set(table, [chess.Move.from_uci("e2e4")], said=said)
    assert ([fault.square for fault in faults], asked) == ([chess.E4], [beyond])


PROMOTING = [  # positions of random games, and what a pawn becomes there, whose outline or height is not a queen's
    ("rn1qkbnr/p1P1pp2/8/1ppp2pp/1PP1P3/N2b3P/P2PB1PR/R1BQK1N1 w - - 3 10", "c7c8b", 106004),
    ("r1bqkbr1/2pppppP/2n5/1p3Q2/Pp4P1/2n5/3PPP2/RNB1KBNR w - - 1 9", "h7h8r", 6005),
    ("1n2k1nr/1QP2p1p/r7/1Pp5/4p2P/8/Pb1KPP2/R2N1BNR w - - 0 17", "c7c8n", 6018),
]


@pytest.mark.parametrize(("fen", "uci", "seed"), PROMOTING)
def test_a_pawn_may_become_what_does_not_look_like_a_queen(studio: TableStudio, fen: str, uci: str, seed: int) -> None:
    board, move = chess.Board(fen), chess.Move.from_uci(uci)
    observer, still, scene = watched(studio, seed, board)
    stands, after = Inventory.of(start_layout(board, TABLE), TABLE), board.copy()
    after.push(move)
    still.shown = scene.picture(after)
    decision = observer.read().decision
    assert (decision.verdict, decision.promotion_unsure) == (ReadingOutcome.MOVE, True)
    assert move in decision.possible
    assert badly_set(of(observer, board, stands), decision.moves, said=False), "as a queen it would lie"
    assert not badly_set(of(observer, board, stands), decision.possible, said=False)
    hands = ClumsyHands(scene.table, TABLE, after, scene.rng)
    hands.knock(move.to_square)
    still.shown = scene.photograph(hands.poses)
    observer.read()
    assert badly_set(of(observer, board, stands), decision.possible, said=False), "whatever it is, it lies"


def test_a_promotion_for_which_only_some_pieces_are_left_is_none_to_another(studio: TableStudio) -> None:
    fen, uci, seed = PROMOTING[1]
    board, move = chess.Board(fen), chess.Move.from_uci(uci)
    observer, still, scene = watched(studio, seed, board)
    set_up = start_layout(board, TABLE)
    no_queens = [piece for piece in set_up if piece.place.on_board or not piece.name.startswith("white-queen")]
    after = board.copy()
    after.push(move)
    still.shown = scene.picture(after)
    decision = observer.read().decision
    stands = Inventory.of(no_queens, TABLE)
    assert not badly_set(of(observer, board, stands), decision.possible, said=False)
    with pytest.raises(NoSpare, match="no spare white queen is left for the promotion on h8"):
        badly_set(of(observer, board, stands), decision.moves, said=False)


def bled(frame: Frame, x: float, y: float) -> Frame:
    """With what stands at a place of the board frame [m] as wide in depth as if it lay, as depth bleeds at edges."""
    assert frame.depth is not None
    view, depth = nominal_view(frame.intrinsics, TABLE), frame.depth.copy()
    (u, v), raised = view.project([(x - 0.016, y, 0.018)])[0], float(view.depth([(x - 0.016, y, 0.018)])[0])
    window = depth[round(v) - 9 : round(v) + 9, round(u) - 9 : round(u) + 9]
    np.minimum(window, raised, out=window)
    return replace(frame, depth=depth)


def test_one_look_in_which_depth_has_a_piece_lie_hides_no_exchange(studio: TableStudio) -> None:
    """As in a campaign: two black pieces stood on each other's squares, and 'fix' saw nothing to be put right."""
    poses = {
        piece.name: PlacedPiece(piece.name, *TABLE.xy(piece.place)) for piece in start_layout(chess.Board(), TABLE)
    }
    still = Still(studio.frame(poses.values(), SceneState(), 4700))
    observer, stands = following(still, chess.Board()), Inventory.of(start_layout(chess.Board(), TABLE), TABLE)
    assert not observer.verify(stands).faults
    one, other = poses["black-knight-b"], poses["black-pawn-a"]
    swapped = poses | {one.name: replace(other, name=one.name), other.name: replace(one, name=other.name)}
    frames = [studio.frame(swapped.values(), SceneState(), 4701 + number) for number in range(3)]
    frames[0] = bled(frames[0], *TABLE.xy(square_place(chess.A1)))
    still.shown, later = frames[0], iter(frames[1:])
    assert not observer.verify(stands).faults, "outlines see nothing"
    still.read = lambda max_age: next(later)  # type: ignore[method-assign]
    seen = observer.whereabouts(stands)
    assert seen is not None
    assert (seen.moved, seen.missing, seen.lying) == ({one.name, other.name}, (), ())
    assert len(list(later)) == 1, "it has looked once more"


@pytest.mark.slow
def test_a_spare_that_lies_about_its_place_in_a_tray_is_known_to_lie(studio: TableStudio) -> None:
    """Its neighbours stand close by, and the outline of one that is missing may be found where they do."""
    found = []
    for seed in range(6):
        _, stands, observer, still, scene = table_after(studio, 4300 + seed, 0)
        rng, spares = np.random.default_rng(seed), [piece for piece in stands if piece.place.in_tray]
        while True:  # until there is room for it to lie
            one = spares[rng.integers(len(spares))]
            shape, (x, y) = PIECE_SHAPES[one.kind], TABLE.xy(one.place)
            others = [TABLE.xy(piece.place) for piece in stands if piece is not one]
            yaw, foot = rng.uniform(-math.pi, math.pi), np.array((x, y)) + rng.uniform(-0.012, 0.012, 2)
            along = [foot + part * shape.height * np.array((math.cos(yaw), math.sin(yaw))) for part in (0.0, 0.5, 1.0)]
            if min(math.dist(spot, other) for spot in along for other in others) > 0.022:
                break
        lying = PlacedPiece(
            one.name, *foot.tolist(), height=shape.foot_radius, yaw=yaw + 0.5 * math.pi, tip=0.5 * math.pi
        )
        still.shown = scene.photograph({**scene.table.poses, one.name: lying})
        observer.verify(stands)
        found.append(any(stray.lies and stray.piece.name == one.name for stray in observer.misplaced(stands)))
    assert sum(found) >= 5


@pytest.mark.slow
def test_what_boxes_hold_is_nothing_that_stands_or_lies_about() -> None:
    """Pieces that came to stand in a box are as high as any, and its walls rise from the table, too."""
    table = TableSettings(captured=Captured.BOX)
    with open_studio(table) as studio:
        for seed in range(3):
            scene, board = Scene(studio, table, 4400 + seed), chess.Board()
            still = Still(scene.picture(board))
            observer = following(still, board, table)
            stands, poses = Inventory.of(start_layout(board, table), table), dict(scene.table.poses)
            for square, drop in zip((chess.A2, chess.D7, chess.B1, chess.D8), table.drop_points()[::3], strict=False):
                piece = stands.at(square_place(square))
                assert piece is not None
                stands = stands.moved(Transfer.of(piece, drop))
                x, y = table.xy(drop)
                poses[piece.name] = replace(poses[piece.name], x=x, y=y)
            still.shown = scene.photograph(poses)
            observer.verify(stands)
            seen = observer.whereabouts(stands)
            assert seen is not None
            assert (seen.moved, seen.missing, seen.lying) == (frozenset(), (), ())
