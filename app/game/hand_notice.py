"""Notices that a person's hand was over the board and has gone: time to look what it did."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from app.guarding import GameGuard


class HandNotice:
    """Of one turn.

    Args:
        guard: that watches for hands; None: nothing is noticed.
    """

    def __init__(self, guard: GameGuard | None) -> None:
        self._guard = guard
        self._came = False

    @property
    def watches(self) -> bool:
        """Whether anything is noticed at all."""
        return self._guard is not None

    @property
    def there(self) -> bool:
        """Whether a hand has come and has not gone yet, as far as ``gone`` was told."""
        return self._came

    def wake(self, awake: bool) -> None:
        """Whether somebody waits for a hand; see ``GameGuard.wake``."""
        if self._guard is not None:
            self._guard.wake(awake)

    def gone(self) -> bool:
        """Whether a hand that was there has gone, and the board lies still; said once of each.

        Raises:
            UserError: hands cannot be seen any more.
        """
        seen = None if self._guard is None else self._guard.glance()
        if seen is None:
            return False
        self._came = self._came or seen.hand_present
        if self._came and seen.settled and not seen.hand_present:
            self._came = False
            return True
        return False
