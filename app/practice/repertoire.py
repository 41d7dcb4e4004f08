"""An opening trainer: plays a repertoire, and says where a person has left it."""

from __future__ import annotations

import random
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import chess
import chess.pgn

from app import UserError
from app.players.advice import Advice, TakingBack
from app.players.decision import Decision, Player, Thinker

LARGEST: Final = 16 << 20
"""Of a file [bytes]: a repertoire of a hundred thousand positions."""
_SHOWN: Final = 4
"""Moves of the repertoire that are named."""


class RepertoireError(UserError):
    """A file that is no repertoire."""


class Repertoire:
    """The moves of all games and variations of a PGN file, by position: however a position came about, it counts."""

    def __init__(self, moves: Mapping[str, tuple[chess.Move, ...]]) -> None:
        """``moves``: by the EPD of the position, in the order of the file."""
        self._moves = moves

    def __len__(self) -> int:
        return len(self._moves)

    def moves(self, board: chess.Board) -> tuple[chess.Move, ...]:
        """Of a position, the main one first; none where the repertoire has ended, or was left."""
        return self._moves.get(board.epd(), ())


def load_repertoire(path: Path) -> Repertoire:
    """Read a PGN file with variations.

    Raises:
        RepertoireError: it cannot be read, is too large, or holds no move; or a game in it is not legal chess.
    """
    moves: dict[str, dict[chess.Move, None]] = {}
    try:
        if path.stat().st_size > LARGEST:
            raise RepertoireError(f"{path} is larger than {LARGEST >> 20} MiB: give a repertoire, not a database")
        with path.open(encoding="utf-8-sig", errors="replace") as stream:
            number = 0
            while (game := chess.pgn.read_game(stream)) is not None:
                number += 1
                if game.errors:
                    raise RepertoireError(f"{path}, game {number}: {game.errors[0]}: correct the file")
                _gather(game, moves)
    except OSError as error:
        raise RepertoireError(f"{path} cannot be read ({error.strerror}): give a PGN file with a repertoire") from error
    except (IndexError, ValueError) as error:  # python-chess's own, over text that is far from any PGN
        raise RepertoireError(f"{path} is not readable PGN: correct the file") from error
    if not moves:
        raise RepertoireError(f"{path} contains no move: give a PGN file with a repertoire")
    return Repertoire({epd: tuple(known) for epd, known in moves.items()})


def _gather(game: chess.pgn.Game, moves: dict[str, dict[chess.Move, None]]) -> None:
    todo: list[tuple[chess.Board, chess.pgn.GameNode]] = [(game.board(), game)]
    while todo:
        board, node = todo.pop()
        # a null move is how ChessBase writes down a threat: neither it nor what follows it is a line
        lines = [following for following in node.variations if following.move]
        if lines:
            known = moves.setdefault(board.epd(), {})
            known.update(dict.fromkeys(following.move for following in lines))
        for following in reversed(lines):  # the main one comes next, before what branches off from it
            after = board.copy(stack=False)
            after.push(following.move)
            todo.append((after, following))


class RepertoirePlayer:
    """Plays the moves of a repertoire, drawn by seed and position; where it ends, another player goes on."""

    def __init__(self, repertoire: Repertoire, seed: int, then: Player) -> None:
        self._repertoire, self._seed, self._then = repertoire, seed, then

    @property
    def name(self) -> str:
        """For the record."""
        return self._then.name

    def choose(self, board: chess.Board, clock: chess.engine.Limit | None = None) -> Decision:
        """A move of the repertoire, else the other player's."""
        known = self._repertoire.moves(board)
        if known:
            return Decision(random.Random(f"{self._seed} {board.fen()}").choice(known), from_book=True)
        return self._then.choose(board, clock)

    def ponder(self, board: chess.Board, clock: chess.engine.Limit | None, *, certain: bool) -> None:
        """The other player, once the repertoire has nothing to say."""
        if isinstance(self._then, Thinker) and not self._repertoire.moves(board):
            self._then.ponder(board, clock, certain=certain)

    def move_now(self) -> None:
        """The other player."""
        if isinstance(self._then, Thinker):
            self._then.move_now()

    def hint(self, board: chess.Board) -> Decision:
        """The main move of the repertoire, else the other player's."""
        known = self._repertoire.moves(board)
        if known:
            return Decision(known[0], from_book=True)
        return self._then.hint(board) if isinstance(self._then, Thinker) else Decision(None)

    def accepts_draw(self, board: chess.Board) -> bool:
        """The other player."""
        return isinstance(self._then, Thinker) and self._then.accepts_draw(board)


class RepertoireAdviser:
    """``Adviser`` that says where a person has left their repertoire, once, and where it ends."""

    def __init__(self, repertoire: Repertoire) -> None:
        self._repertoire = repertoire

    def judge(self, board: chess.Board, move: chess.Move) -> Advice | None:
        """See ``Adviser``."""
        known = self._repertoire.moves(board)
        if not known:
            return None
        san, after = board.san(move), board.copy()
        after.push(move)
        number = f"{board.fullmove_number}{'.' if board.turn else '…'}"
        if move not in known:
            plays = " or ".join(board.san(one) for one in known[:_SHOWN])
            return Advice(f"{number} {san} leaves your repertoire, which plays {plays}", TakingBack.OFFERED)
        if not self._repertoire.moves(after):
            return Advice(f"your repertoire ends with {number} {san}: from here you are on your own")
        return None
