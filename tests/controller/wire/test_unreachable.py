"""What the network says to a client and to a listener: a host that cannot be reached now and then is there again."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

from controller.protocol.states import State
from controller.wire import link, listener
from controller.wire.address import find_controller, open_socket
from controller.wire.errors import ControllerLost
from controller.wire.link import Link
from controller.wire.listener import TelemetryWatch

Launch = Callable[..., Any]
Until = Callable[..., None]
UNREACHABLE = [errno.EHOSTUNREACH, errno.ENETUNREACH, errno.EACCES, errno.EPERM]
"""What becomes of ICMP messages of routers and firewalls, at the next receive."""


class TroubledSocket(socket.socket):
    """A socket that is told what the network has to say."""

    errors: list[int]
    """In the order in which they come."""

    def recv_into(self, *arguments: Any) -> int:
        if self.errors:
            number = self.errors.pop()
            raise OSError(number, os.strerror(number))
        return super().recv_into(*arguments)


@pytest.fixture
def ends(monkeypatch: pytest.MonkeyPatch) -> list[TroubledSocket]:
    """Sockets that clients and listeners have opened."""
    opened = list[TroubledSocket]()

    def troubled(host: str, port: int, timeout: float) -> socket.socket:
        end = TroubledSocket(fileno=open_socket(host, port, timeout).detach())
        end.settimeout(timeout)
        end.errors = []
        opened.append(end)
        return end

    monkeypatch.setattr(link, "open_socket", troubled)
    monkeypatch.setattr(listener, "open_socket", troubled)
    return opened


def test_a_watch_outlives_hosts_that_cannot_be_reached_and_its_stop_is_sent(
    launch: Launch, until: Until, ends: list[TroubledSocket]
) -> None:
    running = launch()
    with TelemetryWatch(*find_controller(running.directory)) as watch:
        (end,) = ends
        end.errors = [*UNREACHABLE]
        until(lambda: not end.errors)
        assert watch.stop().latched


def test_a_client_outlives_hosts_that_cannot_be_reached(
    launch: Launch, until: Until, ends: list[TroubledSocket]
) -> None:
    running = launch()
    with running.client() as client:
        assert client.wait_standing().state is State.HOLD
        (end,) = ends
        end.errors = [*UNREACHABLE]
        until(lambda: not end.errors)
        before = client._connected.last_telemetry
        until(lambda: _hears(client, before))


def _hears(client: Any, before: Any) -> bool:
    """Whether there is news; what the network has said may be newer than the last of it."""
    with suppress(ControllerLost):
        return client.telemetry is not before
    return False


def test_an_end_that_was_closed_under_its_thread_is_no_host_that_cannot_be_reached() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as nobody:
        nobody.bind(("127.0.0.1", 0))
        host, port = nobody.getsockname()
        client = Link(host, port, bytes(32), name="test", listener=None)
        client.close()
        client._open = True
        with pytest.raises(OSError, match="Bad file descriptor"):
            client._listen()
        watch = TelemetryWatch(host, port, bytes(32))
        watch._open = True
        end = open_socket(host, port, 0.1)
        end.close()
        with pytest.raises(OSError, match="Bad file descriptor"):
            watch._listen(end)
