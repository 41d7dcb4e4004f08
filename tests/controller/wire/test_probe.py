"""The probe: what it sees over a good link, over a bad one, and without a controller."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

from controller.wire.errors import ControllerBusy, ControllerLost, ControllerUnavailable
from controller.wire.probe import PATIENCE, Probe, ProbeFigures
from tests.controllers import free_port
from tests.waiting import until

Launch = Callable[..., Any]


def measured(
    probe: Probe, enough: Callable[[ProbeFigures], object] = lambda figures: True, duration: float = 1.5
) -> ProbeFigures:
    """Measure until there is enough to judge: a busy machine may hold up either end for all of a measurement."""

    def once() -> list[ProbeFigures]:
        with suppress(ControllerLost):
            figures = probe.measure(duration)
            return [figures] if enough(figures) else []
        return []

    return until(once)[0]


def test_a_good_link(launch: Launch, fake_bus: Callable[..., Any]) -> None:
    running = launch(fake_bus(lockstep=False))
    with Probe("127.0.0.1", running.port, running.key) as probe:
        probe.greet()
        figures = measured(probe, lambda figures: figures.pings > 5)  # though hardly one may come back in time
    assert len(figures.round_trips) <= figures.pings
    assert figures.lost == 1.0 - len(figures.round_trips) / figures.pings
    assert all(0.0 < trip <= PATIENCE for trip in figures.round_trips)
    assert (figures.overtaken, figures.repeated, figures.lockstep) == (0, 0, False)
    assert figures.telemetry >= len(figures.round_trips)
    assert figures.ticks > 0
    assert figures.period > 0.0
    assert figures.work > 0.0
    assert running.bus.last.torque != (0.0, 0.0, 0.0), "the arm held"


def test_a_bad_link(launch: Launch, fake_bus: Callable[..., Any], lossy_link: Callable[..., Any]) -> None:
    running = launch(fake_bus(lockstep=False))
    link = lossy_link(running.port, loss=0.3, repeats=0.3, delay=0.02)
    with Probe("127.0.0.1", link.port, running.key) as probe:
        probe.greet()
        figures = measured(probe, lambda f: f.pings > 20 and f.round_trips and f.repeated and f.overtaken)
    assert 0.1 < figures.lost < 1.0
    assert figures.telemetry > figures.repeated + figures.overtaken


def test_the_lease_of_a_silent_client_is_waited_for(launch: Launch) -> None:
    running = launch(lease=0.3)
    client = running.client()
    client.connect()
    client.close()
    with Probe("127.0.0.1", running.port, running.key) as probe:
        probe.greet()
        assert measured(probe, duration=0.3).lockstep


def test_a_client_that_stays_is_named(launch: Launch) -> None:
    running = launch()

    def answered() -> bool:
        with suppress(ControllerUnavailable):  # held up for all of the time
            probe.greet(timeout=0.5)
            return True
        return False

    with running.client(name="a game"), Probe("127.0.0.1", running.port, running.key) as probe:  # noqa: SIM117
        with pytest.raises(ControllerBusy, match=r"is held by a game \(127.0.0.1:\d+, heard \d.\d\d s ago\): end that"):
            until(answered)


def test_no_controller(launch: Launch, lossy_link: Callable[..., Any]) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as deaf:
        port = free_port()  # which nobody gets once this socket is closed
        deaf.bind(("127.0.0.1", port))
        with (
            Probe("127.0.0.1", port, bytes(32)) as probe,
            pytest.raises(ControllerUnavailable, match=rf"^no answer from 127.0.0.1:{port} within 0.1 s: is the contr"),
        ):
            probe.greet(timeout=0.1)
    with (
        Probe("127.0.0.1", port, bytes(32)) as probe,
        pytest.raises(ControllerUnavailable, match=rf"^nothing listens at 127.0.0.1:{port} \(Connection refused\): st"),
    ):
        probe.greet(timeout=1.0)
    with pytest.raises(ControllerUnavailable, match=r"^256.0.0.1:9 cannot be used: .*: give the controller's address"):
        Probe("256.0.0.1", 9, bytes(32))
    cut = False
    running = launch()
    link = lossy_link(running.port, veto=lambda data: cut)
    with Probe("127.0.0.1", link.port, running.key) as probe:
        probe.greet()
        cut = True
        running.bus.lost = True
        running.join()
        with pytest.raises(ControllerLost, match=r"^no telemetry from 127.0.0.1:\d+ for 1 s: is the controller runni"):
            probe.measure(30.0)


def test_a_controller_that_falls_silent_while_it_is_measured_is_lost(
    launch: Launch, fake_bus: Callable[..., Any], lossy_link: Callable[..., Any]
) -> None:
    running = launch(fake_bus(lockstep=False))
    link = lossy_link(running.port)
    with Probe("127.0.0.1", link.port, running.key) as probe:
        probe.greet()
        assert measured(probe, duration=0.3).telemetry > 0
        threading.Timer(0.5, lambda: setattr(link, "loss", 1.0)).start()
        with pytest.raises(ControllerLost, match=r"^no telemetry from 127.0.0.1:\d+ for 1 s"):
            probe.measure(30.0)
        running.bus.lost = True
        running.join()
