"""Rows of ``touchmove bench vision``: what people do that is no legal move, none of which may be taken for one."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Final, TypeVar

import chess
import numpy as np

from app.campaign.tasks.lines import random_game
from app.measure.bench.report import Progress, Row, row
from app.measure.bench.vision.games import BoardReader, RandomTable, Scene, open_studio
from app.pieces.layout import start_layout
from hardware.piece_set import PIECE_SHAPES, Kind
from hardware.sim.process.table_studio import PlacedPiece
from hardware.table import TableSettings, square_place
from vision.pieces.placement_faults import examine_board
from vision.pieces.swapped import KnownPicture, looked_closer
from vision.reading.diagnosis import explain
from vision.reading.evidence import codes_of, states_of
from vision.reading.outcome import ReadingOutcome

_T = TypeVar("_T")
Poses = dict[str, PlacedPiece]

ACTIONS: Final = {True: 15, False: 510}  # by ``quick``
LINES: Final = (
    "e4 e5 Nf3 Nc6 Bc4 Bc5",
    "d4 d5 Nc3 Nf6 Bg5 e6 Qd3 Be7",
    "e4 a6 e5 d5",
    "e4 d5 exd5 Nf6 d4 c6 dxc6 Nxc6",
)
"""Positions in which castling, en passant and captures are at hand."""


class ClumsyHands:
    """What a person's hands can do to a position that is set up on a table."""

    def __init__(
        self, table: RandomTable, settings: TableSettings, board: chess.Board, rng: np.random.Generator
    ) -> None:
        self.board, self.rng = board, rng
        self.table, self.settings = table, settings
        self.poses: Poses = dict(table.poses)
        self.touched: set[int] = set()

    def name(self, square: int) -> str:
        """Of the piece on a square."""
        return self.table.standing_on(square)

    def put(self, name: str, square: int) -> None:
        """Put a piece on a square."""
        self.poses[name] = self.table.put_down(name, square_place(square))
        self.touched.add(square)

    def lift(self, square: int) -> None:
        """Take off what stands on a square."""
        del self.poses[self.name(square)]
        self.touched.add(square)

    def carry(self, start: int, end: int) -> None:
        """Move a piece, and take off what stood there."""
        self.lift(start)
        if self.board.piece_at(end) is not None:
            self.lift(end)
        self.put(self.name(start), end)

    def shift(self, square: int, share: float) -> None:
        """Push a piece towards a neighbour by a share of a square's side."""
        pose, side = self.poses[self.name(square)], self.settings.square
        angle = 0.5 * np.pi * self.rng.integers(4)
        x, y = self.settings.xy(square_place(square))
        dx, dy = share * side * np.cos(angle), share * side * np.sin(angle)
        self.poses[pose.name] = replace(pose, x=float(x + dx), y=float(y + dy))
        self.touched.add(square)

    def knock(self, square: int) -> None:
        """Knock a piece over: it lies beside its place."""
        pose, piece = self.poses[self.name(square)], self.board.piece_at(square)
        assert piece is not None
        shape = PIECE_SHAPES[Kind(chess.piece_name(piece.piece_type))]
        self.poses[pose.name] = replace(pose, height=shape.foot_radius, tip=0.5 * np.pi)
        self.touched.add(square)

    def pick(self, these: Sequence[_T]) -> _T:
        """One of them."""
        return these[int(self.rng.integers(len(these)))]

    def side(self) -> chess.Color:
        """One of the two."""
        return bool(self.rng.random() < 0.5)

    def pieces(self, colour: chess.Color) -> list[int]:
        """Squares of a side's pieces but the king's."""
        found = self.board.piece_map().items()
        return [square for square, piece in found if piece.color == colour and piece.piece_type != chess.KING]

    def piece(self) -> int:
        """The square of one piece of either side."""
        return self.pick(self.pieces(self.side()))

    def empty(self) -> int:
        """An empty square."""
        return self.pick([square for square in chess.SQUARES if self.board.piece_at(square) is None])

    def spare(self, like: chess.Color) -> str:
        """A piece of a colour from the trays."""
        start = "white" if like else "black"
        return self.pick(sorted(name for name in self.poses if name.startswith(start) and "spare" in name))


def _quiet(board: chess.Board) -> list[chess.Move]:
    """Legal moves of one piece to an empty square."""
    return [
        move
        for move in board.legal_moves
        if move.promotion is None and not board.is_capture(move) and not board.is_castling(move)
    ]


def _illegal(hands: ClumsyHands) -> None:
    hands.carry(hands.pick(hands.pieces(hands.board.turn)), hands.empty())


def _own_piece_taken(hands: ClumsyHands) -> None:
    own = hands.pieces(hands.board.turn)
    start = hands.pick(own)
    hands.carry(start, hands.pick([square for square in own if square != start]))


def _missing(hands: ClumsyHands) -> None:
    hands.lift(hands.piece())


def _extra(hands: ClumsyHands) -> None:
    hands.put(hands.spare(hands.side()), hands.empty())


def _recoloured(hands: ClumsyHands) -> None:
    colour = hands.side()
    square = hands.pick(hands.pieces(colour))
    hands.lift(square)
    hands.put(hands.spare(not colour), square)


def _twice(hands: ClumsyHands, *, own: bool) -> None:
    board = hands.board.copy()
    first = hands.pick(_quiet(board))
    hands.carry(first.from_square, first.to_square)
    board.push(first)
    if own:
        board.turn, board.ep_square = hands.board.turn, None
    move = hands.pick(
        [m for m in _quiet(board) if m.from_square != first.to_square and m.to_square != first.from_square]
    )
    hands.carry(move.from_square, move.to_square)


def _taken_back(hands: ClumsyHands) -> None:
    last = hands.board.peek()
    if hands.board.piece_at(last.from_square) is None and not hands.board.is_castling(last):
        hands.carry(last.to_square, last.from_square)


def _first_piece_only(
    hands: ClumsyHands, sort: Callable[[chess.Move], bool], otherwise: Callable[[ClumsyHands], None]
) -> None:
    """Of a move of this sort, that takes two pieces, only the first is moved; something else where there is none."""
    move = next(filter(sort, hands.board.legal_moves), None)
    if move is None:
        otherwise(hands)
    else:
        hands.carry(move.from_square, move.to_square)


def _capture_begun(hands: ClumsyHands) -> None:
    captures = [move for move in hands.board.legal_moves if hands.board.is_capture(move) and not move.promotion]
    move = hands.pick(captures) if captures else None
    if move is None or hands.board.is_en_passant(move):
        _missing(hands)
        return
    hands.lift(move.to_square)
    if hands.side():
        hands.lift(move.from_square)


def _swept(hands: ClumsyHands) -> None:
    for square in hands.pieces(True)[:4] + hands.pieces(False)[:4]:
        hands.lift(square)


SORTS: Final[Mapping[str, Callable[[ClumsyHands], None]]] = {
    "illegal move": _illegal,
    "own piece taken": _own_piece_taken,
    "wrong side": lambda hands: hands.carry(hands.pick(hands.pieces(not hands.board.turn)), hands.empty()),
    "missing": _missing,
    "extra": _extra,
    "recoloured": _recoloured,
    "both moved": partial(_twice, own=False),
    "moved twice": partial(_twice, own=True),
    "taken back": _taken_back,
    "half castled": lambda hands: _first_piece_only(hands, hands.board.is_castling, _illegal),
    "en passant left": lambda hands: _first_piece_only(hands, hands.board.is_en_passant, _extra),
    "capture begun": _capture_begun,
    "between squares": lambda hands: hands.shift(hands.piece(), 0.5),
    "knocked over": lambda hands: hands.knock(hands.piece()),
    "swept off": _swept,
}


def action_rows(quick: bool, progress: Progress) -> dict[str, Row]:
    """All sorts, in random positions, light and camera: whether one was accepted, whether its squares were named."""
    accepted, unnamed = list[float](), list[float]()
    settings, count = TableSettings(), ACTIONS[quick]
    with open_studio(settings) as studio:
        for seed in itertools.count():
            scene = Scene(studio, settings, 5000 + seed)
            board = chess.Board()
            reader = BoardReader(scene.picture(board), board, settings)
            for san in _line(seed):
                board.push(san)
            before = KnownPicture(scene.picture(board), reader.view)
            reader.observer.confirm(reader.observer.look(reader.rectified(before.frame)), board)
            for sort, act in list(SORTS.items())[: count - len(accepted)]:
                hands = ClumsyHands(scene.table, settings, board, scene.rng)
                act(hands)
                if _is_legal(hands):
                    continue
                bad, named = _judge(reader, before, scene, hands)
                accepted.append(float(bad))
                unnamed.append(float(not named))
                progress(f"set-up {seed}, {sort}{', ACCEPTED' if bad else ''}{'' if named else ', squares not named'}")
            if len(accepted) >= count:
                break
    return {"action accepted": row(accepted, "1", 0.0, "max"), "action unnamed": row(unnamed, "1", 0.0, "mean")}


def _line(seed: int) -> list[chess.Move]:
    """A position to act in: every other one of the lines', else one of a random game."""
    if seed % 2:
        return list(random_game(seed, 10 + 7 * (seed % 5)))
    board = chess.Board()
    return [board.push_san(san) for san in LINES[(seed // 2) % len(LINES)].split()]


def _is_legal(hands: ClumsyHands) -> bool:
    """Whether the hands have, by chance, left what a legal move or none would."""
    board, side, states = hands.board, hands.settings.square, np.zeros(64, dtype=np.intp)
    for name, pose in hands.poses.items():
        file, rank = int(np.floor(pose.x / side)) + 4, int(np.floor(pose.y / side)) + 4
        if 0 <= file < 8 and 0 <= rank < 8:
            states[8 * rank + file] = 1 if name.startswith("white") else 2
    legal = []
    for move in board.legal_moves:
        board.push(move)
        legal.append(states_of(codes_of(board)))
        board.pop()
    return hands.poses == hands.table.poses or any(np.array_equal(states, one) for one in legal)


def _judge(reader: BoardReader, before: KnownPicture, scene: Scene, hands: ClumsyHands) -> tuple[bool, bool]:
    """Whether what the hands did was taken for a move, and whether all its squares are named."""
    frame, board = scene.photograph(hands.poses), hands.board
    look, decision = reader.read(frame)
    known = codes_of(board)
    expected = {piece.place.index: piece for piece in start_layout(board, hands.settings) if piece.place.on_board}
    seen = look.evidence.read(known)
    finding = explain(seen, board, look.evidence.altered(known), decision.move, look.evidence.unsure(known))
    named = set(looked_closer(finding, seen, board, before, KnownPicture(frame, reader.view), expected).squares)
    if not hands.touched <= named:
        named |= {fault.square for fault in examine_board(frame, reader.view, expected).faults}
    return decision.verdict is ReadingOutcome.MOVE, hands.touched <= named
