"""Notices that a person's hand was over the board and has gone: time to look what it did."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from app.guard.game_guard import GameGuard


class HandNotice:
    """Of one game: also of hands that came and went while nobody asked.

    Args:
        guard: that watches for hands; None: nothing is noticed.
    """

    def __init__(self, guard: GameGuard | None) -> None:
        self._guard = guard
        self._known = 0 if guard is None else guard.departures

    @property
    def watches(self) -> bool:
        """Whether anything is noticed at all."""
        return self._guard is not None

    def there(self) -> bool:
        """Whether a hand is over the board.

        Raises:
            UserError: hands cannot be seen any more.
        """
        seen = None if self._guard is None else self._guard.glance()
        return seen is not None and seen.hand_present

    def leaving(self) -> bool:
        """Whether a hand has gone of which ``gone`` will tell once the board lies still."""
        return self._guard is not None and self._guard.leaving

    def gone(self) -> float | None:
        """When a hand has gone [s, plant], if one has, and the board lies still, since this was last said."""
        if self._guard is None or (at := self._guard.gone_at) is None or not self.untold:
            return None
        self._known = self._guard.departures
        return at

    @property
    def untold(self) -> bool:
        """Whether ``gone`` would tell of a hand."""
        return self._guard is not None and self._guard.departures != self._known

    @property
    def last_gone(self) -> float | None:
        """When the last hand had gone [s, plant], told or not."""
        return None if self._guard is None else self._guard.gone_at

    def wake(self, awake: bool) -> None:
        """Whether somebody waits for a hand; see ``GameGuard.wake``."""
        if self._guard is not None:
            self._guard.wake(awake)
