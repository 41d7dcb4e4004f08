"""What is said of a session that failed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from app import UserError
from app.play import session
from app.play.session import _cause, _play, _RoundProgress
from app.rig.board import BoardClock
from hardware.interfaces import HardwareError, RigGone

_SILENT: Any = None
"""A user interface that is told nothing."""


class Dying:
    """A rig one of whose processes is found to have ended at the n-th look."""

    def __init__(self, found: int) -> None:
        self.found, self.looks = found, 0

    def failure(self) -> str | None:
        self.looks += 1
        return "the simulated world has ended" if self.looks >= self.found else None


def test_what_has_ended_is_named_though_its_sockets_close_first() -> None:
    rig: Any = Dying(found=4)
    assert _cause(rig, RigGone("reset by peer")) == "the simulated world has ended"


def test_what_only_failed_is_told_at_once() -> None:
    rig: Any = Dying(found=2)
    assert _cause(rig, HardwareError("no picture")) == "no picture"
    assert rig.looks == 1


def test_where_nothing_is_found_to_have_ended_the_error_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session, "_SOCKETS_FIRST", 0.0)
    rig: Any = Dying(found=10**9)
    assert _cause(rig, RigGone("reset by peer")) == "reset by peer"


class Lab(BoardClock):
    """A rig that tells its time unless it has ended, and a round on it that breaks off at 9.5 s."""

    def __init__(self, error: BaseException) -> None:
        super().__init__()
        self.error, self.record, self.clock = error, SimpleNamespace(events=[SimpleNamespace(plant_time=4.75)]), self
        self.arm = SimpleNamespace(state=self._come_to_rest)

    def play(self) -> None:
        self.sleep(9.5)
        raise self.error

    def _come_to_rest(self) -> None:
        self.sleep(0.25)

    def failure(self) -> str | None:
        return "the simulated world has ended" if isinstance(self.error, RigGone) else None

    def now(self) -> float:
        if isinstance(self.error, RigGone):
            raise self.error
        return super().now()


@pytest.mark.parametrize(
    ("error", "until"),
    [(UserError("could not grasp the knight"), 9.75), (RigGone("reset by peer"), 4.75), (KeyboardInterrupt(), 4.75)],
)
def test_a_game_that_failed_lasted_as_long_as_what_was_tried(error: BaseException, until: float) -> None:
    """What an interruption broke off has no end in plant time but its last event: when it came is not repeatable."""
    lab: Any = Lab(error)
    so_far = _RoundProgress(lab)
    _play(lab, so_far, _SILENT)
    assert so_far.until == until
