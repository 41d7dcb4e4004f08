"""A line of play given as text, as in ``--moves "e4 d5 exd5"``."""

from __future__ import annotations

import difflib
import re

import chess

from app import UserError

_NUMBER = re.compile(r"\d+\.+")
_RESULTS = frozenset({"1-0", "0-1", "1/2-1/2", "½-½", "*"})
_UCI = re.compile(r"[a-h][1-8][a-h][1-8][qrbn]?", re.IGNORECASE)
_SHOWN = 5
"""Legal moves named in an error."""
_PASSES = "passes, which chess does not allow"


class LineError(UserError):
    """A token of the line is no legal move in its position."""

    def __init__(self, token: str, number: int, reason: str) -> None:
        super().__init__(f'ply {number} of the line, "{token}", {reason}')
        self.token = token
        self.number = number


class MoveError(UserError):
    """What was written is no legal move.

    Args:
        token: what was written.
        what: is wrong with it.
        choices: what else there is.
    """

    def __init__(self, token: str, what: str, choices: str) -> None:
        super().__init__(f'"{token}" {what}: {choices}')
        self.token, self.what, self.choices = token, what, choices


def parse_line(text: str, board: chess.Board) -> tuple[chess.Move, ...]:
    """Read moves in SAN or UCI, mixed as one likes; move numbers, results and marks such as ``!?`` are passed over.

    Args:
        text: the line, tokens separated by white space or commas.
        board: the position before its first move; it is not changed.

    Raises:
        LineError: a token is not a legal move; the message has the token, its ply (from 1) and legal choices.
    """
    position = board.copy()
    moves: list[chess.Move] = []
    for token in tokens_of(text):
        try:
            moves.append(parse_move(token, position))
        except MoveError as error:
            where = "" if error.what == _PASSES else f" in {position.fen()}"
            raise LineError(token, len(moves) + 1, f"{error.what}{where}: {error.choices}") from error
        position.push(moves[-1])
    return tuple(moves)


def parse_move(token: str, board: chess.Board) -> chess.Move:
    """Read one move in SAN or UCI; marks such as ``!?`` are passed over.

    Raises:
        MoveError: it is none that is legal in the position; the message has what there is to choose from.
    """
    text = token.rstrip("!?")
    try:
        move = board.parse_uci(text.lower()) if _UCI.fullmatch(text) else board.parse_san(text)
    except chess.AmbiguousMoveError as error:
        raise MoveError(token, "is ambiguous", _choices(text, board)) from error
    except chess.InvalidMoveError as error:
        raise MoveError(token, "is neither SAN nor UCI", _choices(text, board)) from error
    except chess.IllegalMoveError as error:
        raise MoveError(token, "is not legal", _choices(text, board)) from error
    if not move:
        raise MoveError(token, _PASSES, _choices(text, board))
    return move


def given_line(text: str, board: chess.Board) -> tuple[chess.Move, ...]:
    """The line that is to be played instead of asking players; arguments as of ``parse_line``.

    Raises:
        LineError: as ``parse_line``.
        UserError: no move is in it.
    """
    if not (line := parse_line(text, board)):
        raise UserError(f"--moves is '{text}': give at least one move, such as e4, or leave it out")
    return line


def tokens_of(text: str) -> list[str]:
    """What is written of moves in a line, without its numbers and its result."""
    words = (_strip_number(word) for word in text.replace(",", " ").split())
    return [word for word in words if word and word not in _RESULTS]


def _strip_number(word: str) -> str:
    number = _NUMBER.match(word)
    return word[number.end() :] if number else word


def _choices(text: str, board: chess.Board) -> str:
    """A few legal moves, those written most alike first."""
    legal = {board.uci(move) if _UCI.fullmatch(text) else board.san(move) for move in board.legal_moves}
    if not legal:
        return f"the game is over at that point ({board.result()})"

    def unlike(move: str) -> tuple[float, str]:
        return -difflib.SequenceMatcher(None, text, move).ratio(), move

    shown = sorted(legal, key=unlike)[:_SHOWN]
    more = f" or {len(legal) - len(shown)} others" if len(legal) > len(shown) else ""
    return f"choose {', '.join(shown)}{more}"
