"""Who holds the controls: one of those who watch, who can hand them over. Pure: time is an argument.

Whoever comes first to a page where nobody is holds them. Who leaves keeps them for ``GRACE`` seconds, so that a page
can be loaded anew; then they go to who asks for them, or to nobody. Where nobody holds them, anybody takes them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

GRACE: Final = 10.0
"""So long the controls wait for a holder who has left [s, wall]."""


class ControlsRefused(Exception):
    """What somebody wants to do with the controls cannot be done; the message is one sentence for them."""


@dataclass(frozen=True, slots=True)
class Controls:
    """Who watches, and who holds the controls; watchers are numbers."""

    watchers: frozenset[int] = field(default_factory=frozenset)
    """Who is there."""
    holder: int | None = None
    """Who holds the controls, there or gone for a moment; None: nobody."""
    asking: int | None = None
    """Who there wants them; None: nobody."""
    left: float | None = None
    """When the holder left [s]; None: they are there, or nobody holds the controls."""

    def joined(self, who: int, now: float) -> Controls:
        """Somebody comes, or comes again under their number."""
        here = self.expired(now)
        first = here.holder is None and not here.watchers
        here = replace(here, watchers=here.watchers | {who})
        if first:
            return replace(here, holder=who)
        return replace(here, left=None) if here.holder == who else here

    def gone(self, who: int, now: float) -> Controls:
        """Somebody leaves."""
        here = self.expired(now)
        if who not in here.watchers:
            return here
        here = replace(here, watchers=here.watchers - {who}, asking=None if here.asking == who else here.asking)
        return replace(here, left=now) if here.holder == who else here

    def expired(self, now: float) -> Controls:
        """After a holder has been gone for too long: who asks has them, or nobody."""
        if self.left is None or now - self.left < GRACE:
            return self
        return self._handed()

    @property
    def deadline(self) -> float | None:
        """When ``expired`` changes something; None: it does not."""
        return None if self.left is None else self.left + GRACE

    def taken(self, who: int) -> Controls:
        """Somebody takes controls that nobody holds.

        Raises:
            ControlsRefused: somebody else holds them.
        """
        if self.holder == who:
            return self
        if self.holder is not None:
            raise ControlsRefused("somebody else holds the controls: ask for them")
        return replace(self, holder=who, asking=None if self.asking == who else self.asking, left=None)

    def asked(self, who: int) -> Controls:
        """Somebody asks for the controls; where nobody holds them, they have them.

        Raises:
            ControlsRefused: they hold them already, or somebody else asks already.
        """
        if self.holder == who:
            raise ControlsRefused("you already hold the controls")
        if self.holder is None:
            return self.taken(who)
        if self.asking not in (None, who):
            raise ControlsRefused("somebody else has already asked for the controls: wait until they are answered")
        return replace(self, asking=who)

    def given(self, who: int) -> Controls:
        """The holder hands the controls to who asks.

        Raises:
            ControlsRefused: they do not hold them, or nobody asks.
        """
        self._require(who)
        if self.asking is None:
            raise ControlsRefused("nobody asks for the controls: release them, and anybody can take them")
        return self._handed()

    def kept(self, who: int) -> Controls:
        """The holder keeps the controls, and who asks is answered so.

        Raises:
            ControlsRefused: they do not hold them.
        """
        self._require(who)
        return replace(self, asking=None)

    def released(self, who: int) -> Controls:
        """The holder lets go: who asks has them, or nobody.

        Raises:
            ControlsRefused: they do not hold them.
        """
        self._require(who)
        return self._handed()

    def _require(self, who: int) -> None:
        if self.holder != who:
            raise ControlsRefused("you do not hold the controls: ask for them")

    def _handed(self) -> Controls:
        return replace(self, holder=self.asking, asking=None, left=None)
