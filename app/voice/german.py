"""What a German voice says: moves, results, and what people are asked most; other sentences stay English.

Commands are English words, and are said as they must be typed. Each pattern is a sentence of the program, or a part of
one; ``tests`` see to it that the program still says it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from app.voice.spoken_moves import MoveWords

MOVES: Final = MoveWords(
    pieces=MappingProxyType({"K": "König", "Q": "Dame", "R": "Turm", "B": "Läufer", "N": "Springer"}),
    takes="schlägt", short="kurze Rochade", long="lange Rochade", becomes="wird {}",
    ends=MappingProxyType({"": "", "+": ", Schach", "#": ", matt"}),
)  # fmt: skip
_NOUNS: Final[Mapping[str, str]] = MappingProxyType({
    "white king": "weiße König", "white queen": "weiße Dame", "white rook": "weiße Turm",
    "white bishop": "weiße Läufer", "white knight": "weiße Springer", "white pawn": "weiße Bauer",
    "black king": "schwarze König", "black queen": "schwarze Dame", "black rook": "schwarze Turm",
    "black bishop": "schwarze Läufer", "black knight": "schwarze Springer", "black pawn": "schwarze Bauer",
})  # fmt: skip
_SIDES: Final[Mapping[str, str]] = MappingProxyType({"White": "Weiß", "Black": "Schwarz"})
_PIECE: Final = "|".join(_NOUNS)
_SQUARE: Final = "[a-h][1-8]"
_SIDE: Final = "White|Black"
SENTENCES: Final[Mapping[str, str]] = MappingProxyType({
    "checkmate": "matt",
    "stalemate": "patt",
    "draw agreed": "Remis vereinbart",
    "insufficient material": "ungenügendes Material, Remis",
    "threefold repetition": "dreimal dieselbe Stellung, Remis",
    "fivefold repetition": "fünfmal dieselbe Stellung, Remis",
    "fifty moves": "fünfzig Züge ohne Schlagen, Remis",
    "seventyfive moves": "fünfundsiebzig Züge ohne Schlagen, Remis",
    "puzzle (\\S+) is solved(?:: checkmate)?": "Aufgabe {0} ist gelöst",
    "puzzle (\\S+) is not solved (.+)": "Aufgabe {0} ist nicht gelöst",
    "({side}) resigns": "{0} gibt auf",
    "({side}) claims a draw": "{0} beansprucht Remis",
    "you play ({side}) now": "Sie spielen jetzt {0}",
    "I offer a draw: say 'draw' if you agree": "ich biete Remis an: sagen Sie 'draw', wenn Sie annehmen",
    "I would like to play on": "ich möchte weiterspielen",
    "I would play (.+)": "ich würde {move} spielen",
    "I see no change on the board": "ich sehe keine Veränderung auf dem Brett",
    "I do not see (\\S+) on the board": "ich sehe {0} nicht auf dem Brett",
    "I am not sure what I see: make your move, or say 'fix' and the arm checks the board":
        "ich bin nicht sicher, was ich sehe: ziehen Sie, oder sagen Sie 'fix', und der Arm prüft das Brett",
    "this looks like (.+): was that your move\\?": "das sieht aus wie {move}: war das Ihr Zug?",
    "this looks like (.+), but not clearly: was that it\\?": "das sieht aus wie {move}, aber undeutlich: war es das?",
    "then put the pieces back as they were, or type the move you have made":
        "dann stellen Sie die Figuren zurück, oder tippen Sie Ihren Zug",
    "there is nothing of yours to take back yet": "Sie haben noch nichts, das man zurücknehmen könnte",
    "nothing is paused: it is your move": "nichts ist angehalten: Sie sind am Zug",
    "the arm may move again": "der Arm darf sich wieder bewegen",
    "the game is paused": "die Partie ist unterbrochen",
    "nobody watched the board for a while": "eine Zeit lang hat niemand auf das Brett gesehen",
    "the clocks are stopped; say 'go' to continue, or 'quit' to leave":
        "die Uhren stehen; sagen Sie 'go', um fortzufahren, oder 'quit', um zu gehen",
    "({square}) is empty, a ({piece}) should stand there": "{0} ist leer, dort gehört der {1} hin",
    "something lies on ({square}), where a ({piece}) should stand": "auf {0} liegt etwas, wo der {1} stehen sollte",
    "something lies on ({square})": "auf {0} liegt etwas",
    "the ({piece}) of ({square}) has fallen over": "der {0} von {1} ist umgefallen",
    "the ({piece}) on ({square}) stands (\\S+) mm off towards (.+)":
        "der {0} auf {1} steht {2} Millimeter daneben, in Richtung {3}",
})  # fmt: skip
"""What is said, as a pattern, and in German. ``{side}``, ``{square}`` and ``{piece}`` stand for words as above; in the
German, numbers for what the brackets found, ``{move}`` for a move in SAN."""
_TAILS: Final[Mapping[str, str]] = MappingProxyType({
    " (yes or no)": " ('yes' oder 'no')",
    ". Put it right by hand, or say 'fix' and the arm does it":
        ". Stellen Sie es richtig, oder sagen Sie 'fix', und der Arm tut es",
    ". Put it right by hand and say 'look', or say 'fix' and the arm does it":
        ". Stellen Sie es richtig, und sagen Sie 'look'; oder sagen Sie 'fix', und der Arm tut es",
    ". Put it right by hand and say 'done'": ". Stellen Sie es richtig, und sagen Sie 'done'",
    ". Put it right and say 'done'": ". Stellen Sie es richtig, und sagen Sie 'done'",
    ": put it right": ": stellen Sie es richtig",
})  # fmt: skip
"""What may follow a sentence."""
_PATTERNS: Final = [
    (re.compile(english.replace("{side}", _SIDE).replace("{square}", _SQUARE).replace("{piece}", _PIECE)), german)
    for english, german in SENTENCES.items()
]


def in_german(sentence: str) -> str | None:
    """A sentence of the program in German; None: there is none."""
    for english, german in _TAILS.items():
        if sentence.endswith(english):
            head = in_german(sentence.removesuffix(english))
            return None if head is None else head + german
    for pattern, german in _PATTERNS:
        if (found := pattern.fullmatch(sentence)) is not None:
            words = [_NOUNS.get(word, _SIDES.get(word, word)) for word in found.groups()]
            return german.format(*words, move=MOVES.spoken(words[0]) if "{move}" in german else "")
    if " and " in sentence:
        parts = [in_german(part) for part in sentence.split(" and ")]
        if all(parts):
            return " und ".join(part for part in parts if part)
    return None
