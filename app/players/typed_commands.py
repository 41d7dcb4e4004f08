"""What a person types at the terminal: moves in SAN or UCI, and plain words."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from types import MappingProxyType
from typing import Final

import chess

from app import UserError
from app.players.given_line import MoveError, parse_move, tokens_of
from hardware.piece_set import Colour, Kind, Look
from hardware.table import Place

NOTHING: Final = ("nothing", "empty", "none")
"""Words for an empty square."""
_LETTERS: Final[Mapping[str, Kind]] = MappingProxyType(
    {"k": Kind.KING, "q": Kind.QUEEN, "r": Kind.ROOK, "b": Kind.BISHOP, "n": Kind.KNIGHT, "p": Kind.PAWN}
)
_SAYS: Final = re.compile(r"([a-h][1-8])\s*[:=]?\s*(?:is\s+)?(?:an?\s+)?(\w+)(?:\s+(\w+))?")


class Word(StrEnum):
    """A command of one word."""

    HELP = "help"
    LOOK = "look"
    TAKE_BACK = "takeback"
    HINT = "hint"
    FIX = "fix"
    PAUSE = "pause"
    GO = "go"
    DRAW = "draw"
    RESIGN = "resign"
    DECLINE = "decline"
    ABORT = "abort"
    CLAIM = "claim"
    SIDE = "side"
    NEW = "new"
    KEEP = "keep"
    QUIT = "quit"


MEANINGS: Mapping[Word, str] = MappingProxyType(
    {
        Word.HELP: "what can be typed",
        Word.LOOK: "the camera looks at the board, for instance when it has missed a move",
        Word.TAKE_BACK: "the arm takes back your last move and its own",
        Word.HINT: "what the engine would play for you",
        Word.FIX: "the arm puts the board right after an illegal or unfinished move",
        Word.PAUSE: "stop the clocks",
        Word.GO: "continue after a pause, or after STOP",
        Word.DRAW: "offer a draw, or claim one",
        Word.RESIGN: "give up the game",
        Word.DECLINE: "decline the draw or take-back that an opponent elsewhere proposes",
        Word.ABORT: "end a game against an opponent elsewhere without a result, if it has hardly begun",
        Word.CLAIM: "claim the game if an opponent elsewhere has left it",
        Word.SIDE: "change sides: the engine plays for you, and you for it",
        Word.NEW: "give up this game and play another, as before or for instance 'new black elo 1500 clock 10+5'",
        Word.KEEP: "continue with the board as it stands: another game begins from what the camera sees",
        Word.QUIT: "leave; 'touchmove resume' continues the game",
    }
)
MEANINGS_ELSEWHERE: Mapping[Word, str] = MappingProxyType(
    {
        **MEANINGS,
        Word.TAKE_BACK: "propose to take back your last move, or agree to what your opponent proposes",
        Word.DRAW: "offer a draw, accept the one that is offered, or claim one",
        Word.DECLINE: "decline the draw or take-back that your opponent proposes",
        Word.ABORT: "end the game without a result, as it has hardly begun",
        Word.CLAIM: "claim the game, as your opponent has left it",
        Word.QUIT: "leave the table; the game goes on, and 'touchmove resume' takes it up",
    }
)
"""The same in a game against somebody elsewhere."""
_SAME: Mapping[str, Word] = MappingProxyType(
    {"undo": Word.TAKE_BACK, "back": Word.TAKE_BACK, "exit": Word.QUIT, "?": Word.HELP, "swap": Word.SIDE}
)


class HandVerb(StrEnum):
    """What a simulated hand can be told to do, besides making legal moves."""

    MOVE = "move"
    KNOCK = "knock"
    HOVER = "hover"
    REST = "rest"


@dataclass(frozen=True, slots=True)
class PlayMove:
    """A legal move."""

    move: chess.Move


@dataclass(frozen=True, slots=True)
class MoveHand:
    """``hand VERB PLACES``: the simulated hand does something, legal or not.

    Attributes:
        verb: what.
        places: of move: from and to; of the others one.
    """

    verb: HandVerb
    places: tuple[Place, ...]


@dataclass(frozen=True, slots=True)
class NewGame:
    """``new [white|black] [elo N|full] [clock 5+3|none] [fen FEN|start]``: another game, as before but for that.

    Attributes:
        person: the person's colour; None: as before.
        elo: of the robot, 0 for full strength; None: as before.
        clock: time control, "" for none; None: as before.
        fen: where it starts, "" for the usual position; None: as before.
    """

    person: chess.Color | None = None
    elo: int | None = None
    clock: str | None = None
    fen: str | None = None


Command = PlayMove | MoveHand | NewGame | Word


class CommandError(UserError):
    """What was typed means nothing here; says what would."""


def parse_command(
    text: str, board: chess.Board, refusal: Callable[[str], str | None] = lambda _: None
) -> Command:  # fmt: skip
    """Understand a line as typed in a position, in which a move must be legal; ``refusal`` says why it cannot be had.

    Raises:
        CommandError: it is neither a word nor a legal move, or is refused.
    """
    words = text.strip().split()
    if not words:
        raise CommandError("type a move such as e4 or e2e4, or 'help'")
    if (why := refusal(text)) is not None:
        raise CommandError(why)
    first = words[0].lower()
    if first == "hand":
        return parse_hand(words[1:])
    if (word := word_of(text)) is not None:
        return word
    if first == Word.NEW:
        return parse_new(words[1:])
    tokens = tokens_of(text) or words
    try:
        move = parse_move(tokens[0], board)
    except MoveError as error:
        near = difflib.get_close_matches(first, [*Word, *_SAME], n=1, cutoff=0.75)
        hint = f"did you mean '{near[0]}'?" if near else "'help' lists what can be typed"
        raise CommandError(f"{error}; {hint}") from error
    if len(tokens) > 1:
        raise CommandError("one move at a time: type only yours")
    return PlayMove(move)


def word_of(text: str) -> Word | None:
    """The command of one word that a line is; None: it is something else."""
    word = text.strip().lower()
    return Word(word) if word in list(Word) else _SAME.get(word)


def parse_hand(words: list[str]) -> MoveHand:
    """Understand what the simulated hand is to do, from the words after ``hand``.

    Raises:
        CommandError: that is nothing that a hand can do.
    """
    usage = "say 'hand move b1 b4', 'hand knock e4', 'hand hover e4' or 'hand rest e4'"
    if not words or words[0].lower() not in list(HandVerb):
        raise CommandError(f"what should the hand do? {usage}")
    verb = HandVerb(words[0].lower())
    try:
        places = tuple(_place(word) for word in words[1:])
    except ValueError as error:
        raise CommandError(f"{error}; {usage}") from error
    if len(places) != (2 if verb is HandVerb.MOVE else 1):
        raise CommandError(f"'hand {verb}' needs {2 if verb is HandVerb.MOVE else 1} place(s): {usage}")
    return MoveHand(verb, places)


_NEW: Final = "say for instance 'new', 'new black elo 1500', 'new full clock 10+5', 'new clock none fen start'"


def parse_new(words: list[str]) -> NewGame:
    """Understand what another game is to be like, from the words after ``new``; whether it can be is found out later.

    Raises:
        CommandError: that says nothing.
    """
    wish, rest = NewGame(), list(words)
    while rest:
        word = rest.pop(0).lower()
        match word, rest[:1]:
            case "white" | "black", _:
                wish = replace(wish, person=word == "white")
            case "full", _:
                wish = replace(wish, elo=0)
            case "elo", [number] if number.isdecimal() and int(number):
                wish, rest = replace(wish, elo=int(number)), rest[1:]
            case "clock", [control]:
                wish, rest = replace(wish, clock="" if control.lower() == "none" else control), rest[1:]
            case "fen", [start] if start.lower() == "start":
                wish, rest = replace(wish, fen=""), rest[1:]
            case "fen", [_]:
                wish, rest = replace(wish, fen=_position(" ".join(rest))), []
            case "elo", [number]:
                raise CommandError(f"'{number}' is not an Elo: say for instance 'new elo 1500', or 'new full'")
            case "elo" | "clock" | "fen", []:
                raise CommandError(f"'{word}' needs a value: {_NEW}")
            case _:
                raise CommandError(f"'{word}' is not part of a new game: {_NEW}")
    return wish


def _position(fen: str) -> str:
    try:
        chess.Board(fen)
    except ValueError as error:
        raise CommandError(f"'{fen}' is not a position ({error}): give a FEN, or say 'new fen start'") from error
    return fen


def _place(word: str) -> Place:
    """A place in any case: people type E4 and l3."""
    return Place.parse(word.lower() if len(word) == 2 and word[0] in "abcdefghABCDEFGH" else word.upper())


def help_text(words: Collection[Word] = tuple(Word), meanings: Mapping[Word, str] = MEANINGS) -> str:
    """What can be typed, a line each: a move, or one of some words."""
    width = max(len(word) for word in Word)
    return "\n".join(["a move: e4, Nf3, O-O, e2e4, e7e8q", *(f"{word:{width}}  {meanings[word]}" for word in words)])


def said_of_square(words: str) -> tuple[Place, Look | None] | None:
    """What a person says of a square, such as 'e4 white knight', 'e4 wN' or 'e4 empty'; None: something else."""
    found = _SAYS.fullmatch(words.strip().lower())
    if found is None:
        return None
    place = Place.parse(found[1])
    if found[2] in NOTHING and found[3] is None:
        return place, None
    side, kind = (found[2], found[3]) if found[3] is not None else (found[2][:1], found[2][1:])
    colour = {"white": Colour.WHITE, "w": Colour.WHITE, "black": Colour.BLACK, "b": Colour.BLACK}.get(side)
    which = _LETTERS.get(kind) or next((one for one in Kind if one == kind), None)
    return None if colour is None or which is None else (place, (colour, which))
