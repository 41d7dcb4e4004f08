"""The other robot: what it has said, what it has to hear, and the record that both keep.

The link's thread brings what arrives, the game loop's thread asks and tells; both hold the lock. Nothing here knows of
sockets, and what is said while the link is cut is not lost: once it is back, both say what they have, and the robot
with the longer record tells what the other one lacks.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from types import MappingProxyType
from typing import Final

from app.linked.agreements import Agreements
from app.linked.errors import LinkBroken, LinkRefused
from app.linked.log import LinkedLog, LinkedState
from app.linked.messages import (
    MOST_ENTRIES,
    AgreementMessage,
    BeginEntry,
    EndEntry,
    EntriesMessage,
    Entry,
    HaveMessage,
    LeavingMessage,
    MendingMessage,
    Message,
    Proposal,
    ProposalMessage,
    RematchMessage,
    Request,
    RequestMessage,
    StandingMessage,
    SyncMessage,
)
from app.linked.stopwatch import Stopwatch
from app.players.remote import ABORTABLE, Offer, OfferAnswered, Offered
from app.settings.defaults import LinkRole

OFFERS: Final = MappingProxyType[Proposal, Offer](
    {"draw": Offer.DRAW, "take back": Offer.TAKE_BACK, "rematch": Offer.REMATCH}
)
MOST_NOTICES: Final = 50
"""That wait for the loop; later ones are left out."""
_DIFFER: Final = "the other robot plays another game than this one: name the folder of the same game on both"


class LinkedPeer:
    """The other robot.

    Args:
        log: the record of the match.
        role: of this robot.
        here: who plays at this table, for the record.
        now: monotonic wall time [s].

    Attributes:
        they_ask: whether somebody there is asked for a rematch, once the game is over there; None: it is not, yet.
        changed: the lock of all this, notified whenever something has arrived.
        agreements: between the players.
        request: how this side wants to end the game, until it has.
        asked: the same of the other side.
        events: for the loop, besides entries.
        notices: for people.
        fault: why the game can go no further; None: it can.
        have: entries that are on the other robot's disk, as it has said.
        watch: of the side to move.
    """

    def __init__(self, log: LinkedLog, role: LinkRole, here: str, now: Callable[[], float] = time.monotonic) -> None:
        self.changed = threading.Condition(threading.RLock())
        self.log, self.role, self.here = log, role, here
        self.agreements = Agreements(role)
        self.request: Request | None = None
        self.asked: Request | None = None
        self.events, self.notices = deque[Offered | OfferAnswered](maxlen=MOST_NOTICES), deque[str]()
        self.fault: str | None = None
        self.have = 0
        self.they_ask: bool | None = None
        self._ask: RematchMessage | None = None
        self.watch = Stopwatch(now)
        self._send: Callable[[Message], None] | None = None
        self._their_name: str | None = None
        self._synced = False
        """Both have said how much they have; before that nothing else is said."""
        self._lacking = 0
        """Entries before this one may be our own, as the other robot had more when the link was made."""
        self._stands: StandingMessage | None = None
        self._their_stand = 0
        self._mends, self._they_mend = False, False

    @property
    def name(self) -> str:
        """Who plays there, as they have said."""
        return self._their_name or "the other robot"

    @property
    def writes(self) -> bool:
        """Whether the next entry is this robot's; not while it hears of some that it has lost."""
        return self.log.state.writer is self.role and len(self.log) >= self._lacking

    @property
    def there(self) -> bool:
        """Whether the link is up."""
        return self._send is not None

    def wait_for_game(self, timeout: float) -> LinkedState | None:
        """Both robots know of a game and of each other; waits at most so long [s, wall]; None: not yet.

        Raises:
            LinkRefused: they never will.
        """
        with self.changed:
            self.changed.wait_for(lambda: self.fault or self.notices or self._met, timeout)
            if self.fault is not None:
                raise LinkRefused(self.fault)
            return self.log.state if self._met else None

    def wait_until_had(self, timeout: float) -> bool:
        """Whether the other robot has the whole record; waits at most so long [s, wall]."""
        with self.changed:
            return self.changed.wait_for(lambda: self.have >= len(self.log), timeout)

    @property
    def _met(self) -> bool:
        return self._their_name is not None and self.log.state.begin is not None

    def begin(self, entry: BeginEntry) -> None:
        """The host begins the first game, before anybody joins; raises as ``append``."""
        with self.changed:
            self.append(entry)

    # ------------------------------------------------------------------------------------------------ the link's side

    def connected(self, send: Callable[[Message], None]) -> None:
        """The other robot is there and has proved who it is; ``send`` returns at once, and may lose what it is told."""
        with self.changed:
            self._send, self._synced, self._lacking, self.have = send, False, 0, 0
            head = self.log.digests[-1]
            send(SyncMessage(name=self.here, length=len(self.log), head=head))

    def disconnected(self, sentence: str | None = None) -> None:
        """The link is cut; people are told a sentence."""
        with self.changed:
            self._send, self._lacking, self._they_mend = None, 0, False
            self.time()
            if sentence is not None:
                self.note(sentence)

    def note(self, sentence: str) -> None:
        """Tell people, once in a row."""
        with self.changed:
            if len(self.notices) < MOST_NOTICES and (not self.notices or self.notices[-1] != sentence):
                self.notices.append(sentence)
            self.changed.notify_all()

    def fail(self, sentence: str) -> None:
        """The game can go no further."""
        with self.changed:
            self.fault = self.fault or sentence
            self.changed.notify_all()

    def received(self, message: Message) -> None:
        """What the other robot says.

        Raises:
            LinkBroken: that cannot be; nothing has changed.
            LinkRefused: it plays another game.
            RecordError: it cannot be written down.
        """
        with self.changed:
            match message:
                case SyncMessage():
                    self._sync(message)
                case EntriesMessage():
                    self._take(message)
                case HaveMessage():
                    self._require_known(message.length)
                    self.have = max(self.have, message.length)
                case StandingMessage():
                    self._compare(message)
                case MendingMessage():
                    self._hear_mending(busy=message.busy)
                case LeavingMessage() if not self.log.state.over:
                    self.note(f"{self.name} has left ({message.reason}); the game goes on when it is back")
                case _:
                    self._hear_player(message)
            self.changed.notify_all()

    def _hear_player(self, message: Message) -> None:
        """What the player there wants."""
        match message:
            case ProposalMessage():
                self._hear_proposal(message)
            case AgreementMessage() if self.agreements.answered(message) and not message.accepted:
                self.events.append(OfferAnswered(OFFERS[message.what], accepted=False))
            case RequestMessage():
                self._require_known(message.at)
                self.asked = None if self.log.state.over or self._comes_too_late(message.what) else message.what
            case RematchMessage():
                self.they_ask = message.asks
            case _:  # it is alive
                pass

    def _sync(self, sync: SyncMessage) -> None:
        log, back = self.log, self._their_name is not None
        if sync.length < len(log.digests) and log.digests[sync.length] != sync.head:
            raise LinkRefused(_DIFFER)
        self._their_name, self._synced = sync.name, True
        self._lacking, self.have = sync.length, min(sync.length, len(log))
        for at in range(sync.length, len(log), MOST_ENTRIES):
            self._tell(at, log.entries[at : at + MOST_ENTRIES])
        if sync.length <= len(log):  # else what it lacks comes first
            self._remind()
        self.time()
        if back:
            self.note(f"{self.name} is connected again")

    def _remind(self) -> None:
        """Say again what may not have been heard."""
        if self._stands is not None:
            self.say(self._stands)
        if self._ask is not None:
            self.say(self._ask)
        if self._mends:
            self.say(MendingMessage(busy=True))
        for pending in self.agreements.pending():
            self.say(pending)
        if self.request is not None:
            self.say(RequestMessage(what=self.request, at=len(self.log)))

    def _take(self, message: EntriesMessage) -> None:
        """Entries that the other robot has; all of them, or none where one cannot be."""
        log = self.log
        if message.at > len(log):
            raise LinkBroken("entries are missing before those that came: the link is taken up anew")
        known = len(log) - message.at
        if any(mine != theirs for mine, theirs in zip(log.entries[message.at :], message.entries, strict=False)):
            raise LinkRefused(_DIFFER)
        new = message.entries[known:]
        if new:
            log.require_next(new, message.head)
            self._require_theirs(new)
        lagged = len(log) < self._lacking
        for entry in new:
            self.append(entry, ours=False)
        self.have = max(self.have, message.at + len(message.entries))
        self.say(HaveMessage(length=len(log)))
        if lagged and len(log) >= self._lacking:
            self._remind()

    def _require_theirs(self, entries: Sequence[Entry]) -> None:
        """The other robot speaks for its own side alone, but for what was lost here."""
        state = self.log.state
        for number, entry in enumerate(entries, len(self.log)):
            if number >= self._lacking and state.writer is self.role:
                raise LinkBroken("the other robot has moved for this side: the link is taken up anew")
            state = state.after(entry)

    def _require_known(self, length: int) -> None:
        if length > len(self.log):
            raise LinkBroken("the other robot speaks of entries that it has not told: the link is taken up anew")

    def _compare(self, standing: StandingMessage) -> None:
        """What stands on the other table with what both have recorded."""
        self._require_known(standing.length)
        if standing.fen != self.log.fens[standing.length]:
            self.differ(f"on the other table stands {standing.fen}")
        self._their_stand = standing.length
        self.time()

    def _hear_mending(self, *, busy: bool) -> None:
        if busy is not self._they_mend:
            does = "puts its board right: both clocks stand" if busy else "has put its board right: the game goes on"
            self.note(f"{self.name} {does}")
        self._they_mend = busy
        self.time()

    def _hear_proposal(self, proposal: ProposalMessage) -> None:
        self._require_known(proposal.at)
        done = len(self.log.state.board.move_stack)
        overtaken = proposal.at < len(self.log) and proposal.what != "rematch"
        if overtaken or (proposal.what == "take back" and proposal.plies >= done):
            return
        if self.agreements.heard(proposal):
            plies = done - proposal.plies if proposal.what == "take back" else 0
            self.events.append(Offered(OFFERS[proposal.what], plies))

    # ------------------------------------------------------------------------------------------------ the loop's side

    def stand(self, length: int, fen: str) -> None:
        """What stands on the table here once everything up to an entry has been carried out."""
        self._stands = StandingMessage(length=length, fen=fen)
        self.say(self._stands)
        if fen != self.log.fens[length]:
            self.differ(f"on the table here stands {fen}")
        self.time()

    def mend(self, *, busy: bool) -> None:
        """The table here must be put right, or has been."""
        if self._mends is not busy:
            self._mends = busy
            self.say(MendingMessage(busy=busy))
            self.time()

    def ask(self, request: Request) -> None:
        """End the game: at once where it is our turn, else as soon as the other robot has heard of it."""
        if not self.log.state.over:
            self.request = request
            self.say(RequestMessage(what=request, at=len(self.log)))
            self.changed.notify_all()

    def _comes_too_late(self, request: Request | None) -> bool:
        return request == "abort" and len(self.log.state.board.move_stack) >= ABORTABLE

    def rematch(self, *, asks: bool) -> None:
        """The game is over here; whether somebody is asked for another."""
        with self.changed:
            self._ask = RematchMessage(asks=asks)
            self.say(self._ask)

    def propose(self, what: Proposal, plies: int = 0) -> None:
        """Say it, and again after each cut until it lapses."""
        proposal = ProposalMessage(what=what, at=len(self.log), plies=plies)
        self.agreements.propose(proposal)
        self.say(proposal)

    def answer(self, what: Proposal, *, accepted: bool) -> bool:
        """Accept or decline what is proposed there; False: nothing is."""
        said = self.agreements.answer(what, accepted=accepted)
        if said is not None:
            self.say(said)
            self.changed.notify_all()
        return said is not None

    def append(self, entry: Entry, *, ours: bool = True) -> None:
        """On the disk here before anybody there hears of it.

        Raises:
            LinkBroken: it cannot follow; nothing has changed.
            RecordError: it cannot be written.
        """
        writer = self.log.state.writer
        self.log.append(entry)
        self.agreements.after(entry, writer)
        if isinstance(entry, EndEntry | BeginEntry):
            self.request = self.asked = None
        # else it would wait, and end the game as soon as its moves were taken back
        if self._comes_too_late(self.asked):
            self.asked = None
        if self._comes_too_late(self.request):
            self.request = None
            self.note("your 'abort' came too late: both sides have moved by now; resign or offer a draw")
        if isinstance(entry, BeginEntry):
            self._stands = self._ask = self.they_ask = None
        self.watch.reset()
        self.time()
        if ours:
            self._tell(len(self.log) - 1, [entry])
        self.changed.notify_all()

    def _tell(self, at: int, entries: Sequence[Entry]) -> None:
        self.say(EntriesMessage(at=at, entries=tuple(entries), head=self.log.digests[at + len(entries)]))

    def say(self, message: Message) -> None:
        """Tell the other robot, if it is connected; what it misses now it hears once both have said what they have."""
        if self._send is not None and self._synced:
            self._send(message)

    def differ(self, sentence: str) -> None:
        """A table does not show what both have recorded: nothing may move before people have looked."""
        recorded = self.log.state.board.fen()
        self.fail(f"{sentence}, but the game has {recorded}: put the board right, then resume the game on both")

    def time(self) -> None:
        """Whether the time of the side to move runs: its own table shows the position, and nothing holds it up."""
        state = self.log.state
        if state.over or self._send is None or self._mends or self._they_mend:
            self.watch.run(False)
            return
        ours = self._stands.length if self._stands is not None else 0
        self.watch.run((ours if state.writer is self.role else self._their_stand) == len(self.log))
