"""What a check found: a line for each thing that was looked at."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import StrEnum
from typing import Final

from rich.table import Table

from app.terminal.report_table import judged, rows_table
from hardware.frozen import Frozen


class CheckState(StrEnum):
    """How a thing is."""

    GOOD = "good"
    WRONG = "wrong"
    LEFT_OUT = "left out"  # it could not be looked at, or the rig has none; not counted against it


class Finding(Frozen):
    """One thing that was looked at."""

    device: str  # it belongs to
    what: str  # was looked at
    state: CheckState  # how it is
    found: str  # what was seen, in words
    advice: str = ""  # what to do where it is wrong


class CheckReport(Frozen):
    """All findings of a rig; ``holds`` says whether nothing is wrong."""

    rig: str
    holds: bool
    findings: tuple[Finding, ...]

    @classmethod
    def of(cls, rig: str, findings: Iterable[Finding]) -> CheckReport:
        """Of a rig."""
        found = tuple(findings)
        return cls(rig=rig, holds=all(one.state is not CheckState.WRONG for one in found), findings=found)

    def table(self) -> Table:
        """One screen for people."""
        wrong = sum(one.state is CheckState.WRONG for one in self.findings)
        verdict = "all is well" if self.holds else f"{wrong} thing{'s' * (wrong > 1)} wrong"
        return findings_table(self.findings, f"rig {self.rig}: {verdict}")


def findings_table(findings: Sequence[Finding], title: str) -> Table:
    """A line for each finding; each device is named once."""
    before = ("", *(one.device for one in findings))
    rows = [
        ("" if one.device == last else one.device, one.what, judged(one.found, _HOLDS[one.state]),
         one.advice if one.state is CheckState.WRONG else "")
        for one, last in zip(findings, before, strict=False)
    ]  # fmt: skip
    return rows_table(("device", "what", "found", "what to do"), rows, title)


_HOLDS: Final = {CheckState.GOOD: True, CheckState.WRONG: False, CheckState.LEFT_OUT: None}


class Judge:
    """Writes findings of one device."""

    def __init__(self, device: str) -> None:
        self.device = device
        self.findings: list[Finding] = []

    def good(self, what: str, found: str) -> None:
        """It is as it should be."""
        self.findings.append(Finding(device=self.device, what=what, state=CheckState.GOOD, found=found))

    def wrong(self, what: str, found: str, advice: str) -> None:
        """It is not."""
        self.findings.append(Finding(device=self.device, what=what, state=CheckState.WRONG, found=found, advice=advice))

    def left_out(self, what: str, why: str) -> None:
        """It was not looked at."""
        self.findings.append(Finding(device=self.device, what=what, state=CheckState.LEFT_OUT, found=why))

    def judge(self, what: str, found: str, holds: bool, advice: str) -> None:
        """It is as it should be, or not."""
        if holds:
            self.good(what, found)
        else:
            self.wrong(what, found, advice)
