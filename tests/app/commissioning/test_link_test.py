"""``touchmove link-test``: its checks, its screen, its exit status. No test judges this machine."""

from __future__ import annotations

import json
import signal

import pytest
from rich.console import Console
from typer.testing import CliRunner

import app.commissioning.link_test as link_module
from app import UserError
from app.cli.commands import app as command_line
from app.commissioning.link_test import LinkReport, link_checks, link_test, real_time_check, receive_buffer
from app.rig.simulation.timed import GrantedRealTime
from controller.wire.probe import ProbeFigures

GOOD = ProbeFigures(
    pings=500, round_trips=(0.0013,) * 499, telemetry=600, overtaken=0, repeated=0, ticks=10_000, skipped=0,
    period=0.00088, lateness=1e-4, work=1.5e-4, lockstep=False,
)  # fmt: skip
GRANTED = GrantedRealTime(granted=True, scheduled=True, locked=True, pinned=True, awake=True, notes=())
CHECKS = {
    "round_trip_p99", "round_trip_jitter", "pings_lost", "out_of_order", "missed_ticks", "lateness", "tick_work",
    "stolen_time", "receive_buffer", "real_time",
}  # fmt: skip


def report_of(figures: ProbeFigures = GOOD, stolen: float = 0.0, buffer: int = 1 << 20,
              granted: GrantedRealTime = GRANTED) -> LinkReport:  # fmt: skip
    checks = link_checks(figures, stolen, buffer, local=False) | real_time_check(granted)
    holds = all(check.holds for check in checks.values())
    return LinkReport(rig="sim", duration=10.0, holds=holds, checks=checks, notes=granted.notes)


def test_a_good_link_holds() -> None:
    report = report_of()
    assert report.holds
    assert set(report.checks) == CHECKS
    assert report.checks["round_trip_p99"].value == pytest.approx(1.3)
    assert report.checks["pings_lost"].value == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("report", "failing", "advice"),
    [
        (report_of(GOOD._replace(round_trips=(0.0013,) * 400 + (0.03,) * 99)),
         {"round_trip_p99", "round_trip_jitter"}, "a cable instead of Wi-Fi"),
        (report_of(GOOD._replace(round_trips=(0.0013,) * 450)), {"pings_lost"}, "a cable instead of Wi-Fi"),
        (report_of(GOOD._replace(round_trips=())), {"round_trip_p99", "round_trip_jitter", "pings_lost"}, "cable"),
        (report_of(GOOD._replace(overtaken=4, repeated=4)), {"out_of_order"}, "no bonded links"),
        (report_of(GOOD._replace(skipped=20)), {"missed_ticks"}, "end other programs"),
        (report_of(GOOD._replace(lateness=5e-4)), {"lateness"}, "give it real time"),
        (report_of(GOOD._replace(work=5e-4)), {"tick_work"}, "'performance'"),
        (report_of(stolen=0.02), {"stolen_time"}, "a virtual machine on a busy host"),
        (report_of(buffer=212_992), {"receive_buffer"}, "sudo sysctl -w net.core.rmem_max=1048576"),
        (report_of(granted=GrantedRealTime(granted=False, scheduled=False, locked=True, pinned=True, awake=True,
                                           notes=("no SCHED_FIFO: run as root",))),
         {"real_time"}, "no SCHED_FIFO: run as root"),
    ],
)  # fmt: skip
def test_what_is_not_good_enough_says_what_to_change(report: LinkReport, failing: set[str], advice: str) -> None:
    assert not report.holds
    assert {name for name, check in report.checks.items() if not check.holds} == failing
    assert all(advice in report.checks[name].advice for name in failing)
    screen = Console(width=100)
    with screen.capture() as captured:
        screen.print(report.table())
    assert "not good enough" in captured.get()
    assert advice.split(maxsplit=1)[0] in captured.get()
    assert len(captured.get().splitlines()) < 30


def test_only_failing_checks_give_advice_on_the_screen() -> None:
    screen = Console(width=100)
    with screen.capture() as captured:
        screen.print(report_of().table())
    assert "PC and link are good enough (rig sim, 10 s)" in captured.get()
    assert "cable" not in captured.get()
    assert "≤ 13" in captured.get()
    assert "≥ 1024" in captured.get()


def test_on_one_pc_no_network_is_to_blame_and_nothing_is_said_twice() -> None:
    bad = GOOD._replace(round_trips=(), skipped=20)
    checks = link_checks(bad, 0.0, 1 << 20, local=True)
    report = LinkReport(rig="sim", duration=10.0, holds=False, checks=checks, notes=())
    screen = Console(width=100)
    with screen.capture() as captured:
        screen.print(report.table())
    assert "cable" not in captured.get()
    assert captured.get().count("end other programs") == 1
    assert captured.get().count("the same") == 3


def test_the_receive_buffer_is_what_the_system_grants() -> None:
    assert 0 < receive_buffer() <= 1 << 20


@pytest.mark.parametrize(("stolen", "status"), [(0.0, 0), (0.5, 1)])
def test_the_command_reports_in_the_contracts_form(stolen: float, status: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link_module, "link_test", lambda rig, duration, progress: report_of(stolen=stolen))
    done = CliRunner().invoke(command_line, ["link-test", "--json"])
    assert done.exit_code == status
    found = json.loads(done.stdout)
    assert list(found) == ["rig", "duration", "holds", "checks", "notes"]
    assert found["holds"] is (status == 0)
    assert set(found["checks"]) == CHECKS
    shown = CliRunner().invoke(command_line, ["link-test"])
    assert shown.exit_code == status
    assert "round trip p99" in shown.stdout


def test_an_interrupted_test_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(link_module, "link_test", lambda rig, duration, progress: signal.raise_signal(signal.SIGTERM))
    done = CliRunner().invoke(command_line, ["link-test"])
    assert (done.exit_code, done.stderr) == (130, "touchmove: interrupted; nothing is still running\n")
    assert signal.getsignal(signal.SIGTERM) is before


def test_an_unknown_rig_is_refused_with_the_choice() -> None:
    with pytest.raises(UserError, match=r"^rig board has no devices: choose sim, or the TOML file of a lab's rig$"):
        link_test("board", 2.0, print)
    done = CliRunner().invoke(command_line, ["link-test", "--rig", "board"])
    assert done.exit_code == 2
    assert done.stdout == ""


@pytest.mark.slow
@pytest.mark.real_time
def test_the_whole_test_on_its_own_rig() -> None:
    said: list[str] = []
    report = link_test("sim", 2.0, said.append)
    assert set(report.checks) == CHECKS
    assert report.checks["pings_lost"].value < 100.0
    assert report.notes == () or not report.checks["real_time"].holds
    assert said[-1] == "the arm goes onto its brakes"
