"""Which position a person has put on the board: what the camera is sure of, what is asked, and what nobody can see.

Shown first, so that a person can say what is wrong. Then the doubtful squares, who moves, and whether they may castle.
At every question the person may change the board and say 'look', or say what stands on a square.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, NoReturn

import chess

from app.game.person import ask, hand_command
from app.pieces.inventory import Inventory
from app.pieces.layout import PIECE_TYPES
from app.players.person import Human
from app.players.typed_commands import NOTHING, CommandError, Word, said_of_square
from app.terminal.game_display import UserInterface
from hardware.interfaces import HandRefused
from hardware.piece_set import Colour, Look
from hardware.table import Place, TableSettings
from vision.standing.recognised_set import RecognisedSet

_LEAVES: Final = (Word.QUIT, Word.RESIGN, Word.NEW)
"""Nothing is kept that is not known yet."""
_HOW: Final = "say for instance 'e4 white knight' or 'e4 empty', or change the board and say 'look'"
_CASTLINGS: Final = (
    (chess.WHITE, chess.E1, ((chess.H1, "short"), (chess.A1, "long"))),
    (chess.BLACK, chess.E8, ((chess.H8, "short"), (chess.A8, "long"))),
)
_YES_OR_NO: Final = ("yes", "no", "y", "n")
_STATUS: Final[Mapping[chess.Status, str]] = MappingProxyType({
    chess.Status.NO_WHITE_KING: "there is no white king on the board",
    chess.Status.NO_BLACK_KING: "there is no black king on the board",
    chess.Status.TOO_MANY_KINGS: "there are too many kings on the board",
    chess.Status.TOO_MANY_WHITE_PAWNS: "there are more than eight white pawns",
    chess.Status.TOO_MANY_BLACK_PAWNS: "there are more than eight black pawns",
    chess.Status.PAWNS_ON_BACKRANK: "a pawn stands on the first rank or the last",
    chess.Status.TOO_MANY_WHITE_PIECES: "there are more than sixteen white pieces",
    chess.Status.TOO_MANY_BLACK_PIECES: "there are more than sixteen black pieces",
    chess.Status.OPPOSITE_CHECK: "the side that does not move is in check",
    chess.Status.TOO_MANY_CHECKERS: "a king is in check by more pieces than any move can cause",
    chess.Status.IMPOSSIBLE_CHECK: "a king is in check in a way that no move can cause",
})  # fmt: skip
_BY_PIECES: Final = (
    chess.Status.NO_WHITE_KING | chess.Status.NO_BLACK_KING | chess.Status.TOO_MANY_KINGS
    | chess.Status.TOO_MANY_WHITE_PAWNS | chess.Status.TOO_MANY_BLACK_PAWNS | chess.Status.PAWNS_ON_BACKRANK
    | chess.Status.TOO_MANY_WHITE_PIECES | chess.Status.TOO_MANY_BLACK_PIECES
)  # fmt: skip
"""What is wrong whoever moves."""


class _Changed(Exception):
    """The board, or what is said to stand on it, is no longer what the question was about."""


@dataclass(frozen=True, slots=True)
class _Said:
    """What a person said of a square, and what had been seen there."""

    look: Look | None
    seen: Look | None


class PositionDialogue:
    """Finds out with a person which position stands on the board.

    Args:
        human: asked.
        ui: shows board and questions.
        look: what stands on the table, in new pictures.
        table: board and trays.
    """

    def __init__(
        self, human: Human, ui: UserInterface, look: Callable[[], RecognisedSet], table: TableSettings
    ) -> None:
        self._human, self._ui, self._look, self._table = human, ui, look, table
        self._said = dict[chess.Square, _Said]()
        self._found = RecognisedSet((), frozenset(), frozenset(), frozenset(), frozenset())

    def ask(self) -> tuple[chess.Board, RecognisedSet]:
        """The position, a legal one, and what was seen last.

        Raises:
            GameLeft: they leave.
            PersonGone: nobody types any more.
            UserError: the board cannot be seen.
            HardwareError: the camera failed.
        """
        self._see()
        self._ui.position(self._pieces())
        self._ui.say(f"This is what I see. If anything is wrong, {_HOW}")
        while True:
            try:
                self._settle()
                board = self._pieces()
                self._turn(board)
                self._castling(board)
                self._en_passant(board)
                if problem := position_problem(board):
                    self._insist(problem)
                return board, self._found
            except _Changed:
                self._ui.position(self._pieces())

    def _see(self) -> None:
        self._ui.phase("looking at the board")
        self._found = self._look()
        seen = self._seen()
        self._said = {square: said for square, said in self._said.items() if seen.get(square) == said.seen}

    def _seen(self) -> dict[chess.Square, Look]:
        return {one.place.index: one.look for one in self._found.pieces if one.place.on_board}

    def _pieces(self) -> chess.Board:
        """What stands there as far as is known; nobody's turn yet."""
        board = chess.Board(None)
        looks = self._seen() | {square: said.look for square, said in self._said.items()}
        for square, look in looks.items():
            if look is not None:
                board.set_piece_at(square, _piece(look))
        return board

    # questions

    def _settle(self) -> None:
        """What is doubtful is asked, what is impossible said."""
        for place in sorted(self._unsaid(self._found.lying)):
            self._insist(f"something lies on {place}, or more than one piece stands there")
        for place in sorted(self._unsaid(self._found.between)):
            self._insist(f"the piece on {place} stands between two squares")
        for one in sorted(self._found.pieces, key=lambda one: one.place):
            if one.instead is not None and self._unsaid([one.place]):
                self._say_of(one.place, self._which(one.place, one.look, one.instead))
        hidden = sorted(self._unsaid(self._found.uncertain))
        if hidden:
            places = " and ".join(map(str, hidden))
            it = "that square" if len(hidden) == 1 else "any of those squares"
            self._answer(f"I cannot see {places}: is there nothing on {it}? (nothing, or what there is)", NOTHING)
            for place in hidden:
                self._say_of(place, None, changes=False)
        if problem := position_problem(self._pieces(), _BY_PIECES):
            self._insist(problem)

    def _which(self, place: Place, look: Look, instead: Look) -> Look:
        """One of two that a piece may be."""
        if look[1] is instead[1]:
            question = f"is the {look[1]} on {place} white or black?"
            words = {"white": (Colour.WHITE, look[1]), "black": (Colour.BLACK, look[1])}
        else:
            question = f"what stands on {place}: {_named(look)} or {_named(instead)}?"
            words = {str(one[1]): one for one in (look, instead)}
        return words[self._answer(question, tuple(words))]

    def _turn(self, board: chess.Board) -> None:
        possible = list[chess.Color]()
        for colour in chess.COLORS:
            board.turn = colour
            if not board.was_into_check():
                possible.append(colour)
        if not possible:
            self._insist("both kings are in check")
        if len(possible) == 1:
            board.turn = possible[0]
            self._ui.say(f"it is {_side(board.turn)}'s move, because {_side(board.turn)} is in check")
        else:
            board.turn = self._answer("who moves next, white or black?", ("white", "black")) == "white"

    def _castling(self, board: chess.Board) -> None:
        for colour, home, rooks in _CASTLINGS:
            if board.king(colour) != home:
                continue
            there = {word: square for square, word in rooks
                     if board.piece_at(square) == chess.Piece(chess.ROOK, colour)}  # fmt: skip
            if not there:
                continue
            words = ("both", *there, "no") if len(there) > 1 else (*there, "no")
            answer = self._answer(f"may {_side(colour)} still castle? ({_or(words)})", words)
            for word, square in there.items():
                if answer in (word, "both"):
                    board.castling_rights |= chess.BB_SQUARES[square]

    def _en_passant(self, board: chess.Board) -> None:
        rank = 4 if board.turn else 3
        for pawn in board.pieces(chess.PAWN, not board.turn) & chess.SquareSet(chess.BB_RANKS[rank]):
            ahead = 8 if board.turn else -8
            if board.piece_at(pawn + ahead) or board.piece_at(pawn + 2 * ahead):
                continue
            board.ep_square = pawn + ahead
            if board.has_legal_en_passant() and not position_problem(board):
                question = f"did the pawn on {chess.square_name(pawn)} just make a double step? (yes or no)"
                if self._answer(question, _YES_OR_NO).startswith("y"):
                    return
            board.ep_square = None

    def _insist(self, problem: str) -> NoReturn:
        """Something has to be changed."""
        self._answer(f"{problem}: {_HOW}", ())
        raise AssertionError("there is no other answer")

    def _answer(self, question: str, valid: tuple[str, ...]) -> str:
        """One of some words; raises ``_Changed`` where the person changed something instead."""
        return ask(self._human, self._ui, question, valid, self._other, _how_else(valid), _LEAVES)

    def _other(self, line: str) -> bool:
        """What makes sense besides the answers."""
        words = line.strip().lower()
        if words in ("look", "fix", "done", "ok"):
            self._see()
            raise _Changed
        if (said := said_of_square(words)) is not None:
            place, look = said
            self._say_of(place, look)
            raise _Changed
        try:
            command = hand_command(line)
        except CommandError as error:
            self._ui.say(str(error))
            return True
        if command is None:
            return False
        if self._human.hands is None:
            self._ui.say("only a simulated hand can be told what to do: move the piece yourself, then say 'look'")
            return True
        try:
            self._human.hands.do(command, Inventory.of((), self._table))
        except HandRefused as error:
            self._ui.say(str(error))
            return True
        self._see()
        raise _Changed

    def _say_of(self, place: Place, look: Look | None, *, changes: bool = True) -> None:
        self._said[place.index] = _Said(look, self._seen().get(place.index))
        if changes:
            self._ui.say(f"{place}: {'nothing' if look is None else _named(look)}")

    def _unsaid(self, places: Iterable[Place]) -> list[Place]:
        return [place for place in places if place.on_board and place.index not in self._said]


def position_problem(board: chess.Board, only: chess.Status | None = None) -> str:
    """What is impossible about a position, for people; empty: nothing.

    Args:
        board: it is not changed.
        only: these faults alone count; None: all.
    """
    status = board.status()
    problems = [sentence for flag, sentence in _STATUS.items() if status & flag and (only is None or flag & only)]
    return " and ".join(problems)


def _piece(look: Look) -> chess.Piece:
    return chess.Piece(PIECE_TYPES[look[1]], look[0] is Colour.WHITE)


def _named(look: Look) -> str:
    return f"a {look[0]} {look[1]}"


def _side(colour: chess.Color) -> str:
    return "White" if colour else "Black"


def _how_else(valid: tuple[str, ...]) -> str:
    return "; or ".join([" or ".join(valid), _HOW] if valid else [_HOW])


def _or(words: tuple[str, ...]) -> str:
    return f"{', '.join(words[:-1])} or {words[-1]}"
