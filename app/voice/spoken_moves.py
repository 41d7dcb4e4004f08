"""Moves as people say them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

_SAN: Final = re.compile(r"([KQRBN]?)([a-h]?[1-8]?)(x?)([a-h][1-8])(?:=([QRBN]))?([+#]?)")


@dataclass(frozen=True, slots=True)
class MoveWords:
    """The words of one language.

    Attributes:
        pieces: by SAN's letters.
        takes: between a piece and where it takes.
        short: castling on the king's side.
        long: the same on the queen's side.
        becomes: of a pawn that is promoted, with a place for the piece.
        ends: what is said of check and mate, by SAN's signs.
    """

    pieces: Mapping[str, str]
    takes: str
    short: str
    long: str
    becomes: str
    ends: Mapping[str, str]

    def spoken(self, san: str) -> str:
        """A move in SAN: ``Nbxd7+`` is "knight b takes d7, check".

        Raises:
            ValueError: it is none.
        """
        castles = san.rstrip("+#")
        if castles in ("O-O", "O-O-O"):
            return (self.short if castles == "O-O" else self.long) + self.ends[san[len(castles) :]]
        found = _SAN.fullmatch(san)
        if found is None:
            raise ValueError(f"'{san}' is not a move in SAN: take it from python-chess")
        piece, origin, takes, target, promoted, end = found.groups()
        words = [self.pieces.get(piece, ""), origin, self.takes if takes else "", target]
        if promoted:
            words.append(self.becomes.format(self.pieces[promoted]))
        return " ".join(word for word in words if word) + self.ends[end]


ENGLISH: Final = MoveWords(
    pieces=MappingProxyType({"K": "king", "Q": "queen", "R": "rook", "B": "bishop", "N": "knight"}),
    takes="takes", short="castles short", long="castles long", becomes="becomes a {}",
    ends=MappingProxyType({"": "", "+": ", check", "#": ", checkmate"}),
)  # fmt: skip
