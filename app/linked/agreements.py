"""What one robot's player has proposed and the other's accepted or not: draw, take-back, rematch.

A take-back is of the position in which it was proposed; a draw stands until who was asked has moved, and once agreed on
until it is in the record; a rematch until another game begins.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from app.linked.log import LinkedState
from app.linked.messages import AgreementMessage, BeginEntry, Entry, MoveEntry, Proposal, ProposalMessage
from app.settings.defaults import LinkRole


@dataclass(slots=True)
class Agreements:
    """Of one robot.

    Attributes:
        role: its own.
        ours: what was proposed here, and not answered yet.
        theirs: what was proposed there, and not answered yet.
        agreed: what both want and is not in the record yet.
        said: our last answers, which the other robot may not have heard.
    """

    role: LinkRole
    ours: dict[Proposal, ProposalMessage] = field(default_factory=dict)
    theirs: dict[Proposal, ProposalMessage] = field(default_factory=dict)
    agreed: dict[Proposal, ProposalMessage] = field(default_factory=dict)
    said: dict[Proposal, AgreementMessage] = field(default_factory=dict)

    def after(self, entry: Entry, writer: LinkRole) -> None:
        """The record has an entry more: what it has overtaken lapses."""
        for proposals, asked in ((self.ours, self.role.other), (self.theirs, self.role)):
            _drop_lapsed(proposals, entry, moved_after=writer is asked)
        _drop_lapsed(self.agreed, entry, moved_after=False)
        for what in [what for what in self.said if what not in self.agreed]:
            del self.said[what]

    def propose(self, proposal: ProposalMessage) -> None:
        """It is proposed here."""
        self.ours[proposal.what] = proposal

    def heard(self, proposal: ProposalMessage) -> bool:
        """It is proposed there; False: that was known already, or agreed on."""
        if proposal in (self.theirs.get(proposal.what), self.agreed.get(proposal.what)):
            return False
        self.theirs[proposal.what] = proposal
        return True

    def answer(self, what: Proposal, *, accepted: bool) -> AgreementMessage | None:
        """It is answered here; None: nothing was proposed."""
        proposal = self.theirs.pop(what, None)
        if proposal is None:
            return None
        if accepted:
            self.agreed[what] = proposal
        self.said[what] = AgreementMessage(what=what, at=proposal.at, accepted=accepted)
        return self.said[what]

    def answered(self, answer: AgreementMessage) -> bool:
        """It is answered there; False: to nothing that stands, or that was known."""
        proposal = self.ours.get(answer.what)
        if proposal is None or proposal.at != answer.at:
            return False
        del self.ours[answer.what]
        if answer.accepted:
            self.agreed[answer.what] = proposal
        return True

    def pending(self) -> Iterator[ProposalMessage | AgreementMessage]:
        """What the other robot may not have heard."""
        yield from self.said.values()
        yield from self.ours.values()


def _drop_lapsed(proposals: dict[Proposal, ProposalMessage], entry: Entry, *, moved_after: bool) -> None:
    kept: tuple[Proposal, ...] = ()
    if not isinstance(entry, BeginEntry):
        kept = ("rematch",)
        if isinstance(entry, MoveEntry) and not moved_after:
            kept = ("rematch", "draw")
    for what in [what for what in proposals if what not in kept]:
        del proposals[what]


def plies_taken_back(state: LinkedState, role: LinkRole) -> int | None:
    """After how many plies a game stands once the last move of a robot is taken back; None: it has made none."""
    done = len(state.board.move_stack)
    back = 1 if state.plays(not state.board.turn) is role else 2
    return done - back if done >= back else None
