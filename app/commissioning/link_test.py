"""``touchmove link-test``: whether this PC and the network to the controller are good enough, and what to change.

The arm holds all the time. Each check has its number, its limit and, where it fails, what to do about it.
"""

from __future__ import annotations

import socket
from collections.abc import Callable
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from typing import Final, Self

import numpy as np
from rich.table import Table
from rich.text import Text

from app import UserError
from app.rig.factory import choose_rig
from app.rig.rig_file import RigFile
from app.rig.simulation.timed import GrantedRealTime, timed_rig
from app.terminal.report_table import judged, rows_table
from controller.protocol.key import KeyFileError
from controller.wire.errors import ControllerError
from controller.wire.probe import PATIENCE, Probe, ProbeFigures
from hardware.frozen import Frozen

SEED: Final = 1
ROUND_TRIP: Final = 13.0
"""p99 [ms]: an announcement is sent 26 ms ahead, and must arrive with as much to spare."""
JITTER: Final = 5.0  # p99 less median of the round trip [ms]
LOST: Final = 1.0  # pings lost [%]: a motion survives thirty times as much, but a wired network loses next to nothing
OVERTAKEN: Final = 1.0  # telemetry overtaken or repeated [%]
MISSED: Final = 0.1  # ticks without an exchange [%]
HALF_TICK: Final = 0.44  # lateness and work of a tick [ms]: the other half is the reserve
STOLEN: Final = 0.1  # processor time taken by the host of a virtual machine [%]
BUFFER: Final = 1 << 20  # what the controller asks for [bytes]: 3000 datagrams


@dataclass(frozen=True, slots=True)
class ProcessorTime:
    """Counters since the PC was started, over all cores [ticks of the system]: all time, and what a host stole.

    In a virtual machine stolen time is what the host gave to others while this machine wanted to work. No privilege
    within the machine protects a loop from it.
    """

    total: int
    stolen: int

    @classmethod
    def now(cls) -> Self | None:
        """The counters; None where the system does not tell."""
        try:
            first = Path("/proc/stat").read_text(encoding="ascii").splitlines()[0].split()
        except (OSError, IndexError):
            return None
        values = [int(value) for value in first[1:9]]  # what follows is counted in these already
        return cls(sum(values), values[7]) if len(values) == 8 else None


def stolen_share(before: ProcessorTime | None, after: ProcessorTime | None) -> float:
    """Share of the processors' time that a host stole between two counts, 0 to 1; 0 where it is not known."""
    if before is None or after is None or after.total <= before.total:
        return 0.0
    return (after.stolen - before.stolen) / (after.total - before.total)


class LinkCheck(Frozen):
    """One line of the test: ``holds`` where the value is on the good side of its limit."""

    unit: str  # of value and limit
    value: float  # found
    limit: float  # the bar
    at_least: bool = False  # whether the value must reach the limit instead of staying below
    holds: bool  # whether it is good enough
    advice: str  # what to change where it is not


class LinkReport(Frozen):
    """All checks; ``holds`` says whether all of them hold."""

    rig: str  # on which
    duration: float  # of the measurement [s]
    holds: bool  # whether PC and network are good enough
    checks: dict[str, LinkCheck]  # by name
    notes: tuple[str, ...]  # what real time was not granted, with the remedy

    def table(self) -> Table:
        """One screen for people."""
        verdict = "good enough" if self.holds else "not good enough"
        said, rows = set[str](), list[tuple[str | Text, ...]]()
        for name, check in self.checks.items():
            advice = "" if check.holds else "the same" if check.advice in said else check.advice
            said.add(advice)
            found = judged(f"{check.value:.4g} {check.unit}", check.holds)
            rows.append((name.replace("_", " "), found, f"{'≥' if check.at_least else '≤'} {check.limit:g}", advice))
        title = f"PC and link are {verdict} (rig {self.rig}, {self.duration:g} s)"
        return rows_table(("", ">found", ">good", "what to change"), rows, title)


def link_test(rig: str, duration: float, progress: Callable[[str], None]) -> LinkReport:
    """Measure for so long [s, wall] on a rig: ``sim``, which is started for the test in pace real; or a rig file, whose
    controller runs already.

    Raises:
        UserError: there is no such rig, or it did not start or answer.
    """
    chosen = choose_rig(rig)
    notes: tuple[str, ...] = ()
    if chosen is not None:  # what real time its controller got that has said when it started
        checks = _checks_of(chosen, duration, progress)
    else:
        with timed_rig(SEED, progress) as timed:
            timed.rig.client.close()  # another client comes; from here this one only waits for the end
            checks = _checks_of(timed.file, duration, progress)
            progress("the arm goes onto its brakes")
            granted = timed.finish().statistics.realtime
        checks, notes = checks | real_time_check(granted), granted.notes
    holds = all(check.holds for check in checks.values())
    return LinkReport(rig=rig, duration=duration, holds=holds, checks=checks, notes=notes)


def _checks_of(rig: RigFile, duration: float, progress: Callable[[str], None]) -> dict[str, LinkCheck]:
    """Of a controller that runs.

    Raises:
        UserError: it did not answer, or the key cannot be read.
    """
    try:
        host, port, key = rig.address()
        progress(f"measuring the link to {host}:{port} for {duration:g} s")
        before = ProcessorTime.now()
        with Probe(host, port, key) as probe:
            probe.greet()
            figures = probe.measure(duration)
        stolen = stolen_share(before, ProcessorTime.now())
        return link_checks(figures, stolen, receive_buffer(), local=ip_address(host).is_loopback)
    except (ControllerError, KeyFileError) as error:
        raise UserError(str(error)) from error


def link_checks(figures: ProbeFigures, stolen: float, buffer: int, *, local: bool) -> dict[str, LinkCheck]:
    """Checks of the network, by figures of a probe, of the controller's clock and of the PC.

    ``stolen``: share of the processor's time that a host stole, 0 to 1; ``buffer``: granted to a receiving socket
    [bytes]; ``local``: the controller runs on this PC, so that no network is to blame.
    """
    median, p99 = np.percentile(figures.round_trips or (0.0, PATIENCE), (50.0, 99.0)) * 1e3
    disorder = (figures.overtaken + figures.repeated) / max(1, figures.telemetry)
    missed = figures.skipped / max(1, figures.ticks)
    busy = "end other programs on the controller's PC, give it real time, and set its processor to 'performance'"
    network = busy if local else "use a cable instead of Wi-Fi, and a switch without other traffic"
    return {
        "round_trip_p99": _at_most(float(p99), "ms", ROUND_TRIP, network),
        "round_trip_jitter": _at_most(float(p99 - median), "ms", JITTER, network),
        "pings_lost": _at_most(100.0 * figures.lost, "%", LOST, network),
        "out_of_order": _at_most(100.0 * disorder, "%", OVERTAKEN, "send all datagrams over one path: no bonded links"),
        "missed_ticks": _at_most(100.0 * missed, "%", MISSED, busy),
        "lateness": _at_most(1e3 * figures.lateness, "ms", HALF_TICK, busy),
        "tick_work": _at_most(1e3 * figures.work, "ms", HALF_TICK, busy),
        "stolen_time": _at_most(
            100.0 * stolen, "%", STOLEN, "run it on a PC of its own: this is a virtual machine on a busy host"
        ),
        "receive_buffer": _at_least(
            buffer / 1024, "KiB", BUFFER / 1024, f"sudo sysctl -w net.core.rmem_max={BUFFER}"
        ),
    }  # fmt: skip


def real_time_check(granted: GrantedRealTime) -> dict[str, LinkCheck]:
    """One check: whether the operating system gave the controller what it asked for."""
    advice = "; ".join(granted.notes) or "switch on real time in the controller's settings"
    return {"real_time": _at_least(float(granted.granted), "granted", 1.0, advice)}


def receive_buffer() -> int:
    """What the system grants a socket that asks for as much as the controller does [bytes]."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        granted = one.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
    return granted // 2  # Linux doubles it for its own bookkeeping, and says so


def _at_most(value: float, unit: str, limit: float, advice: str) -> LinkCheck:
    return LinkCheck(unit=unit, value=value, limit=limit, holds=value <= limit, advice=advice)


def _at_least(value: float, unit: str, limit: float, advice: str) -> LinkCheck:
    return LinkCheck(unit=unit, value=value, limit=limit, at_least=True, holds=value >= limit, advice=advice)
