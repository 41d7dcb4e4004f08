"""What a person did that is no legal move: named, with the squares and what to do about it.

Nothing here decides that a move was made; that is done in ``vision.reading.moves``. Where it is in doubt, the placement
that is seen is compared with the one that should be there, and the commonest ways to the difference are tried in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import chess
import numpy as np
from chess import square_name

from vision.arrays import Indices, Mask
from vision.reading.appearance import BLACK, EMPTY, WHITE
from vision.reading.evidence import codes_of, states_of
from vision.reading.outcome import Situation
from vision.reading.unfinished_moves import halves_of, played

States = Indices

MANY: Final = 6  # with more squares wrong than this, they are counted rather than explained


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """What is the matter, and what to do."""

    situation: Situation  # its sort
    squares: tuple[int, ...]  # all that are not as they should be, and those that the advice is about
    sentence: str  # for the person at the board


@dataclass(frozen=True, slots=True)
class _Difference:
    """Between the position and what is seen: squares by what became of them."""

    board: chess.Board
    seen: States
    gone: tuple[int, ...]
    new: tuple[int, ...]
    turned: tuple[int, ...]
    altered: tuple[int, ...]
    likely: chess.Move | None
    unsure: tuple[int, ...]

    @property
    def squares(self) -> tuple[int, ...]:
        return tuple(sorted({*self.gone, *self.new, *self.turned}))

    def says(self, situation: Situation, sentence: str) -> Diagnosis:
        """About all of its squares."""
        return Diagnosis(situation, self.squares, sentence)


def explain(
    seen: States, board: chess.Board, altered: tuple[int, ...] = (), likely: chess.Move | None = None,
    unsure: tuple[int, ...] = (),
) -> Diagnosis:  # fmt: skip
    """Name what is seen, by the states of squares (64,), after the last known position, with its history as far as
    known.

    ``altered``: squares with a piece of the right colour that looks changed, the most changed first; ``likely``: the
    legal move that explains most, if any does; ``unsure``: squares whose state may well be another.
    """
    expected = states_of(codes_of(board))
    difference = _Difference(
        board, seen,
        gone=_squares((expected != EMPTY) & (seen == EMPTY)),
        new=_squares((expected == EMPTY) & (seen != EMPTY)),
        turned=_squares((expected != EMPTY) & (seen != EMPTY) & (seen != expected)),
        altered=altered, likely=likely, unsure=unsure,
    )  # fmt: skip
    if not difference.squares:
        return Diagnosis(Situation.NOTHING, (), "nothing has changed: make your move")
    for attempt in _ATTEMPTS:
        finding = attempt(difference)
        if finding is not None:
            return finding
    return _wrong_board(difference)


def _legal(at: _Difference) -> Diagnosis | None:
    for move in _moves(at.board):
        if _shows(at, played(at.board, move)):
            return _was_it(move, at)
    return None


def _legal_from_out_of_sight(at: _Difference) -> Diagnosis | None:
    """The likeliest move, which shows but for what it has left: something before that hides it."""
    if at.likely is None:
        return None
    after = states_of(codes_of(played(at.board, at.likely)))
    hidden = all(after[square] == EMPTY and square in at.unsure for square in _squares(after != at.seen))
    return _was_it(at.likely, at) if hidden else None


def _taken_back(at: _Difference) -> Diagnosis | None:
    before = at.board.copy()
    for count in range(1, min(2, len(before.move_stack)) + 1):
        before.pop()
        if _shows(at, before):
            moves = "the last move is" if count == 1 else "the last two moves are"
            return at.says(
                Situation.TAKEN_BACK, f"{moves} taken back: say so if you meant that, or play on from "
                f"the position before ({_names(at.squares)} differ)",
            )  # fmt: skip
    return None


def _unfinished(at: _Difference) -> Diagnosis | None:
    """Parts of legal moves that take more than one piece."""
    for move in _moves(at.board):
        for states, advice in halves_of(at.board, move):
            if np.array_equal(states, at.seen):
                squares = {*_touched(move, at), *_squares(states_of(codes_of(played(at.board, move))) != at.seen)}
                return Diagnosis(Situation.UNFINISHED, tuple(sorted(squares)), advice)
    return None


def _two_moves(at: _Difference) -> Diagnosis | None:
    if len(at.squares) > MANY:
        return None
    for first in _moves(at.board):
        after = played(at.board, first)
        for own in (False, True):
            board = after.copy(stack=False)
            if own:
                board.turn, board.ep_square = at.board.turn, None
            for second in board.legal_moves:
                if _shows(at, played(board, second)):
                    names = f"{at.board.san(first)} and {board.san(second)}"
                    whose = f"{_side(at.board.turn)} has moved twice" if own else "both sides have moved"
                    back = f"that now stands on {square_name(second.to_square)}, to {square_name(second.from_square)}"
                    return at.says(Situation.TWO_MOVES, f"{whose}, {names}: put back the piece {back}")
    return None


def _moved(at: _Difference) -> Diagnosis | None:
    """One piece gone, and one of its colour somewhere else: not a legal move."""
    arrived = at.new + at.turned
    if len(at.gone) != 1 or len(arrived) != 1:
        return None
    (start,), (end,) = at.gone, arrived
    piece = at.board.piece_at(start)
    if piece is None or at.seen[end] != (WHITE if piece.color else BLACK):
        return None
    name, back = f"the {_piece(piece)} from {square_name(start)}", f"put it back on {square_name(start)}"
    taken = at.board.piece_at(end)
    if taken is not None:
        back += f", and the {_piece(taken)} on {square_name(end)}"
    if piece.color != at.board.turn:
        turn = f"it is {_side(at.board.turn)}'s move"
        return at.says(Situation.WRONG_SIDE, f"{name} was moved to {square_name(end)}, but {turn}: {back}")
    reason = _why_not(at.board, chess.Move(start, end), piece)
    return at.says(Situation.ILLEGAL, f"{name} must not go to {square_name(end)}, {reason}: {back}")


def _castled(at: _Difference) -> Diagnosis | None:
    """King and rook moved as in castling where that is not allowed."""
    rank, kings = 0 if at.board.turn else 7, at.board.pieces(chess.KING, at.board.turn)
    rooks = at.board.pieces(chess.ROOK, at.board.turn)
    for san, king, rook in (("O-O", 6, (7, 5)), ("O-O-O", 2, (0, 3))):
        if chess.square(4, rank) not in kings or chess.square(rook[0], rank) not in rooks:
            continue
        states = states_of(codes_of(at.board))
        for start, end in ((4, king), rook):
            states[chess.square(end, rank)] = states[chess.square(start, rank)]
            states[chess.square(start, rank)] = EMPTY
        if np.array_equal(states, at.seen):
            homes = f"{square_name(chess.square(4, rank))} and {square_name(chess.square(rook[0], rank))}"
            return at.says(Situation.ILLEGAL, f"{san} is not allowed here: put king and rook back on {homes}")
    return None


def _own_taken(at: _Difference) -> Diagnosis | None:
    """One piece gone and none arrived, but one of its colour looks changed: it may stand in that one's place."""
    if len(at.gone) != 1 or at.new or at.turned:
        return None
    (start,) = at.gone
    piece = at.board.piece_at(start)
    assert piece is not None  # a square from which something is gone had a piece
    own = [square for square in at.altered if at.board.color_at(square) == piece.color]
    if not own:
        return None
    end = own[0]
    return Diagnosis(
        Situation.ILLEGAL, tuple(sorted((start, end))), f"the {_piece(piece)} on {square_name(start)} is missing, and "
        f"it may stand on {square_name(end)}, on its own {_piece(at.board.piece_at(end))}'s place: put both back",
    )  # fmt: skip


def _single(at: _Difference) -> Diagnosis | None:
    """One square is wrong, or several of one sort."""
    if at.gone and not at.new and not at.turned and len(at.gone) <= MANY:
        pieces = _list(f"the {_piece(at.board.piece_at(square))} on {square_name(square)}" for square in at.gone)
        them, places = ("it", "there") if len(at.gone) == 1 else ("them", "on their squares")
        verb = "is" if len(at.gone) == 1 else "are"
        return at.says(Situation.MISSING, f"{pieces} {verb} missing: put {them} back {places}, or finish your move")
    if at.new and not at.gone and not at.turned and len(at.new) <= MANY:
        pieces = _list(
            f"a {'white' if at.seen[square] == WHITE else 'black'} piece on {square_name(square)}" for square in at.new
        )
        verb, them = ("is", "it") if len(at.new) == 1 else ("are", "them")
        return at.says(Situation.EXTRA, f"there {verb} {pieces}, where none should be: take {them} off")
    if at.turned and not at.gone and not at.new and len(at.turned) <= MANY:
        pieces = _list(f"{square_name(square)} ({_piece(at.board.piece_at(square))})" for square in at.turned)
        return at.says(Situation.RECOLOURED, f"a piece of the other colour stands on {pieces}: put the right one there")
    return None


def _wrong_board(at: _Difference) -> Diagnosis:
    if len(at.squares) > MANY:
        wrong = f"{len(at.squares)} squares are not as they should be ({_names(at.squares)})"
        return at.says(Situation.WRONG_BOARD, f"{wrong}: set the position up again")
    actions = [
        f"the {_piece(at.board.piece_at(square))} belongs on {square_name(square)}" for square in at.gone + at.turned
    ]
    actions += [f"nothing belongs on {square_name(square)}" for square in at.new]
    return at.says(Situation.WRONG_BOARD, f"the board is not as it should be: {_list(iter(actions))}")


_ATTEMPTS: Final[tuple[Callable[[_Difference], Diagnosis | None], ...]] = (
    _legal, _taken_back, _unfinished, _castled, _legal_from_out_of_sight, _moved, _own_taken, _single, _two_moves,
)  # fmt: skip


def _was_it(move: chess.Move, at: _Difference) -> Diagnosis:
    sentence = f"this looks like {at.board.san(move)}, but not clearly: was that it?"
    return Diagnosis(Situation.LEGAL, _touched(move, at), sentence)


def _why_not(board: chess.Board, move: chess.Move, piece: chess.Piece) -> str:
    promoting = piece.piece_type == chess.PAWN and chess.square_rank(move.to_square) in (0, 7)
    tried = chess.Move(move.from_square, move.to_square, chess.QUEEN) if promoting else move
    if tried in board.pseudo_legal_moves:
        return "the king would be in check"
    if board.is_check():
        return "the king is in check"
    if board.color_at(move.to_square) == piece.color:
        return "a piece of its own side stands there"
    return f"a {chess.piece_name(piece.piece_type)} does not move like that here"


def _moves(board: chess.Board) -> Iterator[chess.Move]:
    """Legal moves, of promotions only the queen's: to the eye they are one."""
    return (move for move in board.legal_moves if move.promotion in (None, chess.QUEEN))


def _shows(at: _Difference, board: chess.Board) -> bool:
    return np.array_equal(states_of(codes_of(board)), at.seen)


def _touched(move: chess.Move, at: _Difference) -> tuple[int, ...]:
    return tuple(sorted({move.from_square, move.to_square, *at.squares}))


def _squares(mask: Mask) -> tuple[int, ...]:
    return tuple(int(square) for square in np.flatnonzero(mask))


def _names(squares: tuple[int, ...]) -> str:
    return ", ".join(square_name(square) for square in squares)


def _piece(piece: chess.Piece | None) -> str:
    return "piece" if piece is None else f"{_side(piece.color).lower()} {chess.piece_name(piece.piece_type)}"


def _side(colour: chess.Color) -> str:
    return "White" if colour else "Black"


def _list(words: Iterator[str]) -> str:
    *first, last = list(words)
    return f"{', '.join(first)} and {last}" if first else last
