"""What can be said to the robot in a position, and the line that would be typed for it."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Final

import chess

from app.players.typed_commands import Word
from app.voice.spoken_moves import ENGLISH

ADDRESS: Final = "computer"
"""What is said to the robot begins with this: people talk at a chess board, and not to it. Of the words tried (robot,
hey robot, okay robot, hey computer) it was found most often where it was said, and least where it was not."""
YES: Final = "yes"
NO: Final = "no"
NEITHER: Final = (
    "hello",
    "okay",
    "what",
    "maybe",
    "thank you",
    "i think",
    "let me see",
    "well",
    "now",
    "good",
    "right",
)
"""What else people say where a yes or no is expected: each stands beside them, or a cough would be one of them."""
Pattern = tuple[tuple[str, ...], ...]
"""What can be said: one of some words in each place, of which one may be empty."""
REQUESTS: Final[Mapping[str, Word]] = MappingProxyType({
    "look": Word.LOOK, "take a look": Word.LOOK,
    "take back": Word.TAKE_BACK, "take that back": Word.TAKE_BACK, "undo": Word.TAKE_BACK,
    "hint": Word.HINT, "give me a hint": Word.HINT,
    "fix": Word.FIX, "fix the board": Word.FIX,
    "pause": Word.PAUSE, "wait": Word.PAUSE,
    "go": Word.GO, "go on": Word.GO, "continue": Word.GO,
    "draw": Word.DRAW, "i offer a draw": Word.DRAW, "i claim a draw": Word.DRAW,
    "resign": Word.RESIGN, "i resign": Word.RESIGN,
    "decline": Word.DECLINE, "abort": Word.ABORT, "claim": Word.CLAIM,
    "change sides": Word.SIDE,
})  # fmt: skip
"""Words of a game as people say them. What needs more words, or ends the program, is typed."""
_NUMBERS: Final = dict(zip("12345678", ("one", "two", "three", "four", "five", "six", "seven", "eight"), strict=True))
_FILES: Final = dict(
    zip("abcdefgh", ("alpha", "bravo", "charlie", "delta", "echo", "foxtrot", "golf", "hotel"), strict=True)
)
"""Letters that rhyme (b, c, d, e, g) are mistaken for each other; the ICAO's alphabet is not."""
_CASTLING: Final = MappingProxyType({
    "O-O": ("castles short", "castle short", "castles king side", "castle king side", "short castle"),
    "O-O-O": ("castles long", "castle long", "castles queen side", "castle queen side", "long castle"),
})  # fmt: skip
_SAN: Final = re.compile(r"([KQRBN]?)([a-h]?[1-8]?)x?([a-h][1-8])(?:=([QRBN]))?")


def sayable(board: chess.Board, answers: Iterable[str] = ()) -> dict[str, list[Pattern]]:
    """What makes sense in a position, without the address: by the line that would be typed.

    Args:
        board: the position.
        answers: words that are asked for.
    """
    said: dict[str, list[Pattern]] = {answer: [((answer,),)] for answer in answers}
    for phrase, word in REQUESTS.items():
        said.setdefault(word, []).append(((phrase,),))
    for move in board.legal_moves:
        said[board.san(move).rstrip("+#")] = list(move_patterns(board, move))
    return said


def move_patterns(board: chess.Board, move: chess.Move) -> Iterator[Pattern]:
    """How a legal move can be said: as in SAN, or from square to square; files by letter or by the ICAO's alphabet."""
    san = board.san(move).rstrip("+#")
    if san in _CASTLING:
        yield (_CASTLING[san],)
        return
    found = _SAN.fullmatch(san)
    assert found is not None, san
    piece, origin, target, promoted = found.groups()
    joints = ("takes", "captures") if board.is_capture(move) else ("", "to")
    kind = ENGLISH.pieces.get(promoted, "")
    tail = (kind, f"becomes a {kind}", f"promotes to {kind}", f"equals {kind}") if promoted else ("",)
    end = (*_square(target), tail)
    if piece:
        yield ((ENGLISH.pieces[piece],), *_square(origin), joints, *end)
    else:
        yield (("pawn",), joints, *end)
        yield (("pawn", ""), *_square(origin), joints, *end)
    yield (
        (ENGLISH.pieces.get(piece, "pawn"), ""), *_square(chess.square_name(move.from_square)),
        tuple({*joints, "", "to"}), *end,
    )  # fmt: skip


def lines_of(said: Mapping[str, Iterable[Pattern]]) -> dict[str, str | None]:
    """Each phrase, and the line that it stands for; None: it could be several."""
    lines: dict[str, str | None] = {}
    for line, patterns in said.items():
        for words in itertools.chain.from_iterable(itertools.product(*pattern) for pattern in patterns):
            phrase = " ".join(filter(None, words))
            lines[phrase] = line if lines.setdefault(phrase, line) == line else None
    return lines


def grammar_of(said: Mapping[str, Iterable[Pattern]]) -> str:
    """The same as an expression in JSGF, in which what patterns have in common is not written out."""
    return " | ".join(
        " ".join(
            f"[ {' | '.join(filter(None, words))} ]" if "" in words else f"( {' | '.join(words)} )"
            for words in pattern
            if any(words)
        )
        for patterns in said.values()
        for pattern in patterns
    )


def _square(name: str) -> Pattern:
    """The words of a square, or of a file or rank alone."""
    return tuple((_NUMBERS[sign],) if sign in _NUMBERS else (sign, _FILES[sign]) for sign in name)
