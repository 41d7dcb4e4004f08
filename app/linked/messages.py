"""What two robots tell each other: one line each, checked by these classes at both ends.

A game is a sequence of *entries* that both record: how it begins, moves, take-backs, its end. Each follows from the one
before, so there is no question of order: the robot whose side is to move writes the next one, and the host writes the
first. Everything else, such as an offer, is said once and is no part of the record.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field, TypeAdapter, ValidationError

from app.linked.errors import LinkBroken
from app.players.game_end import Result
from hardware.frozen import FrozenFinite

VERSION: Final = 1
"""Of the link. Two robots of different versions refuse each other."""
LONGEST_HELLO: Final = 4096
LONGEST_MESSAGE: Final = 65536
"""Of a line with its end, before and after both ends are known [bytes]."""
MOST_ENTRIES: Final = 200
"""In one message."""
MOST_PLIES: Final = 2000
"""Of a game, far more than any has had."""
LONGEST_NAME: Final = 60
LONGEST_SENTENCE: Final = 300
"""[characters]"""

Name = Annotated[str, Field(max_length=LONGEST_NAME, pattern=r"^[\x20-\x7e\u00a0-\uffff]*$")]
Sentence = Annotated[str, Field(max_length=LONGEST_SENTENCE, pattern=r"^[\x20-\x7e\u00a0-\uffff]*$")]
Plies = Annotated[int, Field(ge=0, le=MOST_PLIES)]
Length = Annotated[int, Field(ge=0, le=1 << 31)]
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Fen = Annotated[str, Field(max_length=100, pattern=r"^[ -~]*$")]
Proposal = Literal["draw", "take back", "rematch"]
Request = Literal["resign", "abort"]


class BeginEntry(FrozenFinite):
    """A game begins; the host writes it."""

    entry: Literal["begin"] = "begin"
    game: Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]
    """Drawn by lot, so that no two games begin alike."""
    fen: Fen
    chess960: bool = False
    host_is_white: bool
    clock: Annotated[str, Field(max_length=100)] | None = None
    """Time control of both sides; None: no clock."""
    plies: Plies
    """The game ends after so many."""


class MoveEntry(FrozenFinite):
    """A ply, by the robot whose side was to move."""

    entry: Literal["move"] = "move"
    ply: Plies
    """Counted from 0."""
    uci: Annotated[str, Field(pattern=r"^[a-h][1-8][a-h][1-8][qrbn]?$")]
    thought: Annotated[float, Field(ge=0.0, le=1e7)] = 0.0
    """What it took of the mover's time [s]."""


class TakeBackEntry(FrozenFinite):
    """The game stands after so many plies, by agreement."""

    entry: Literal["take back"] = "take back"
    plies: Plies


class EndEntry(FrozenFinite):
    """The game is over, for a reason that does not stand on the board."""

    entry: Literal["end"] = "end"
    result: Result
    reason: Sentence


Entry = Annotated[BeginEntry | MoveEntry | TakeBackEntry | EndEntry, Field(discriminator="entry")]


class HelloMessage(FrozenFinite):
    """First of all, from both ends, the guest first; nothing in it is believed until both have proved who they are."""

    message: Literal["hello"] = "hello"
    version: int
    nonce: Digest
    certificate: Annotated[str, Field(max_length=2000, pattern=r"^[0-9a-f]*$")] = ""
    """The guest's, in DER, as hex; the host's is known by TLS."""


class ProofMessage(FrozenFinite):
    """That one knows the secret; from the guest first."""

    message: Literal["proof"] = "proof"
    proof: Digest
    signature: Annotated[str, Field(max_length=200, pattern=r"^[0-9a-f]*$")] = ""
    """By the guest's key."""


class RefusalMessage(FrozenFinite):
    """Why the host goes no further; sent before both are known, so only said to people."""

    message: Literal["refusal"] = "refusal"
    why: Literal["secret", "certificate", "version", "game"]


class SyncMessage(FrozenFinite):
    """How much of the record one has; first of all once both are known."""

    message: Literal["sync"] = "sync"
    name: Name
    """Who plays here, for the record."""
    length: Length
    head: Digest
    """Digest of the record so far."""


class EntriesMessage(FrozenFinite):
    """Entries from one on."""

    message: Literal["entries"] = "entries"
    at: Length
    """Number of the first one."""
    entries: Annotated[tuple[Entry, ...], Field(min_length=1, max_length=MOST_ENTRIES)]
    head: Digest
    """Digest of the record with the last one."""


class HaveMessage(FrozenFinite):
    """So many entries are on the disk here."""

    message: Literal["have"] = "have"
    length: Length


class StandingMessage(FrozenFinite):
    """What stands on the table here once everything up to an entry has been carried out."""

    message: Literal["standing"] = "standing"
    length: Length
    fen: Fen


class MendingMessage(FrozenFinite):
    """The table here must be put right, or has been."""

    message: Literal["mending"] = "mending"
    busy: bool


class ProposalMessage(FrozenFinite):
    """Something is proposed, after so many entries."""

    message: Literal["proposal"] = "proposal"
    what: Proposal
    at: Length
    plies: Plies = 0
    """For a take-back: the game would stand after so many."""


class AgreementMessage(FrozenFinite):
    """What was proposed after so many entries is accepted, or not."""

    message: Literal["agreement"] = "agreement"
    what: Proposal
    at: Length
    accepted: bool


class RematchMessage(FrozenFinite):
    """The game is over here, and somebody is asked whether they want another; or nobody is, and one is agreed to."""

    message: Literal["rematch"] = "rematch"
    asks: bool


class RequestMessage(FrozenFinite):
    """Something that ends the game, from the robot whose side is not to move, after so many entries."""

    message: Literal["request"] = "request"
    what: Request
    at: Length


class AliveMessage(FrozenFinite):
    """Nothing else was said for a while."""

    message: Literal["alive"] = "alive"


class LeavingMessage(FrozenFinite):
    """The program ends here; the game may go on when it is back."""

    message: Literal["leaving"] = "leaving"
    reason: Sentence


Opening = Annotated[HelloMessage | ProofMessage | RefusalMessage, Field(discriminator="message")]
Message = Annotated[
    SyncMessage | EntriesMessage | HaveMessage | StandingMessage | MendingMessage | ProposalMessage | AgreementMessage
    | RequestMessage | RematchMessage | AliveMessage | LeavingMessage,
    Field(discriminator="message"),
]  # fmt: skip
_OPENING: Final[TypeAdapter[Opening]] = TypeAdapter(Opening)
_MESSAGE: Final[TypeAdapter[Message]] = TypeAdapter(Message)
ENTRY: Final[TypeAdapter[Entry]] = TypeAdapter(Entry)
"""Reads entries of a record."""


def printable(text: str, longest: int) -> str:
    """Text as it may be said to the other robot: on one line, without what moves a cursor, and not too long."""
    return "".join(one if one.isprintable() and ord(one) < 0x10000 else " " for one in text)[:longest]


def opening_of(line: bytes) -> Opening:
    """Read a line that came before both were known.

    Raises:
        LinkBroken: it means nothing.
    """
    try:
        return _OPENING.validate_json(line, strict=True)
    except ValidationError as error:
        raise _meaningless(error) from None


def message_of(body: bytes) -> Message:
    """Read what a line said.

    Raises:
        LinkBroken: it means nothing.
    """
    try:
        return _MESSAGE.validate_json(body, strict=True)
    except ValidationError as error:
        raise _meaningless(error) from None


def _meaningless(error: ValidationError) -> LinkBroken:
    first = error.errors(include_url=False, include_input=False)[0]
    where = ".".join(str(part) for part in first["loc"]) or "the line"
    return LinkBroken(f"a message of the other robot makes no sense ({where}: {first['msg']}): the link is cut")
