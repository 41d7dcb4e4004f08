"""Why a move is bad, in one sentence from the line that refutes it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Final

import chess
import chess.engine

from app.analysis.judgement import win_percent
from engine.answers import Candidate

LONGEST: Final = 8
"""Of a line that is looked at for what it wins [plies]; further on an engine's line says little."""
SHOWN: Final = 5
"""Of a line that is written [plies]."""
_WORTH: Final = {chess.QUEEN: 9, chess.ROOK: 5, chess.BISHOP: 3, chess.KNIGHT: 3, chess.PAWN: 1}
"""Of a piece [pawns]."""
_COUNTED: Final = {1: "a", 2: "two", 3: "three", 4: "four"}


def reason(board: chess.Board, move: chess.Move, best: Candidate | None, reply: Candidate | None) -> str:
    """Why a move is bad, without a full stop.

    Args:
        board: the position before it.
        move: the move that was made.
        best: the best line of that position; None: it is not known.
        reply: the best line after the move; None: the game is over with it.
    """
    san = board.san(move)
    better = "" if best is None or best.move == move else f"; {board.san(best.move)} was better"
    after = board.copy()
    after.push(move)
    mate = None if best is None else _mate_in(best, board.turn)
    if best is not None and mate is not None and (reply is None or _mate_in(reply, board.turn) is None):
        return f"{san} misses mate in {mate}: {line_text(board, best.pv or (best.move,))}"
    if reply is None:
        return f"{san} ends the game in a draw{better}" if not after.is_checkmate() else f"{san} gives mate"
    line = reply.pv or (reply.move,)
    shown = line_text(after, line)
    if (mate := _mate_in(reply, after.turn)) is not None:
        return f"{san} allows mate in {mate}: {shown}{better}"
    if lost := _lost(board, (move, *line)):
        return f"{san} loses {lost}: {shown}{better}"
    if best is None:
        return f"{san} is answered by {shown}"
    before, now = (win_percent(one.score.pov(board.turn)) for one in (best, reply))
    return f"{san} lets the winning chances fall from {before:.0f} to {now:.0f} %: {shown}{better}"


def line_text(board: chess.Board, line: Iterable[chess.Move], most: int = SHOWN) -> str:
    """The first moves of a line as players write them, such as ``12… Nf6 13. Bg5``."""
    position, words = board.copy(), list[str]()
    for number, move in enumerate(line):
        if number == most:
            break
        if position.turn:
            words.append(f"{position.fullmove_number}.")
        elif not words:
            words.append(f"{position.fullmove_number}…")
        words.append(position.san(move))
        position.push(move)
    return " ".join(words)


def _mate_in(one: Candidate, side: chess.Color) -> int | None:
    """In how many moves a side mates by a line; None: it does not."""
    mate = one.score.pov(side).mate()
    return mate if mate is not None and mate > 0 else None


def _lost(board: chess.Board, line: Sequence[chess.Move]) -> str:
    """What the side to move loses by a line that its own move begins, such as ``a rook for a pawn``; "": nothing.

    The line counts up to where it is known to be quiet: an exchange that the line does not finish is not counted.
    """
    side, position = board.turn, board.copy()
    taken = {side: Counter[int](), not side: Counter[int]()}
    quiet: tuple[Counter[int], Counter[int]] = (Counter(), Counter())
    for number, move in enumerate(line[:LONGEST]):
        captures = position.is_capture(move)
        victim = chess.PAWN if position.is_en_passant(move) else position.piece_type_at(move.to_square)
        if captures and victim is not None:
            taken[not position.turn][victim] += 1
        position.push(move)
        following = line[number + 1] if number + 1 < len(line) else None
        if not (captures if following is None else position.is_capture(following)):
            quiet = Counter(taken[side]), Counter(taken[not side])
    gone, won = quiet[0] - quiet[1], quiet[1] - quiet[0]
    if _value(gone) - _value(won) < 1:
        return ""
    return _named(gone) + (f" for {_named(won)}" if won else "")


def _value(pieces: Counter[int]) -> int:
    return sum(_WORTH[kind] * count for kind, count in pieces.items())


def _named(pieces: Counter[int]) -> str:
    """Such as ``a queen and two pawns``."""
    words = []
    for kind in sorted(pieces, key=lambda one: -_WORTH[one]):
        count, name = pieces[kind], chess.piece_name(kind)
        words.append(f"{_COUNTED.get(count, str(count))} {name}{'' if count == 1 else 's'}")
    return " and ".join(words) if len(words) < 3 else f"{', '.join(words[:-1])} and {words[-1]}"
