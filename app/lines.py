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


class LineError(UserError):
    """A token of the line is no legal move in its position."""

    def __init__(self, token: str, number: int, reason: str) -> None:
        super().__init__(f'ply {number} of the line, "{token}", {reason}')
        self.token = token
        self.number = number


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
    for token in _tokens(text):
        moves.append(_parse(token, len(moves) + 1, position))
        position.push(moves[-1])
    return tuple(moves)


def _tokens(text: str) -> list[str]:
    words = (_strip_number(word) for word in text.replace(",", " ").split())
    return [word for word in words if word and word not in _RESULTS]


def _strip_number(word: str) -> str:
    number = _NUMBER.match(word)
    return word[number.end() :] if number else word


def _parse(token: str, number: int, board: chess.Board) -> chess.Move:
    text = token.rstrip("!?")
    try:
        move = board.parse_uci(text.lower()) if _UCI.fullmatch(text) else board.parse_san(text)
    except chess.AmbiguousMoveError as error:
        raise LineError(token, number, f"is ambiguous in {board.fen()}: {_choices(text, board)}") from error
    except chess.InvalidMoveError as error:
        reason = f"is neither SAN nor UCI; in {board.fen()} {_choices(text, board)}"
        raise LineError(token, number, reason) from error
    except chess.IllegalMoveError as error:
        raise LineError(token, number, f"is not legal in {board.fen()}: {_choices(text, board)}") from error
    if not move:
        raise LineError(token, number, f"passes, which chess does not allow: {_choices(text, board)}")
    return move


def _choices(text: str, board: chess.Board) -> str:
    """A few legal moves, those written most alike first."""
    legal = {board.uci(move) if _UCI.fullmatch(text) else board.san(move) for move in board.legal_moves}
    if not legal:
        return f"the game is over there ({board.result()})"

    def unlike(move: str) -> tuple[float, str]:
        return -difflib.SequenceMatcher(None, text, move).ratio(), move

    shown = sorted(legal, key=unlike)[:_SHOWN]
    more = f" or {len(legal) - len(shown)} others" if len(legal) > len(shown) else ""
    return f"choose {', '.join(shown)}{more}"
