"""What is said of a session that failed."""

from __future__ import annotations

from typing import Any

import pytest

from app.play import session
from app.play.session import _cause
from hardware.interfaces import HardwareError, RigGone


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
