"""Who is connected to the world: the door, greetings, and the hand-over of messages to the service of each role.

Nothing here ever waits for a visitor: one who stops reading, talks nonsense or says nothing only harms himself.
"""

import contextlib
import json
import select
import socket
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from hardware.sim.clients import wire


class Refused(Exception):
    """A visitor is not welcome; the message says why in a few words."""


class Visitor:
    """One connection: ``link`` never blocks; ``service`` is that of its role, None before its greeting."""

    def __init__(self, link: socket.socket) -> None:
        link.setblocking(False)
        self.link = link
        self.service: Service | None = None

    def send(self, message: bytes) -> None:
        """Send without waiting. A visitor who is gone or reads nothing is dismissed."""
        try:
            self.link.send(message)
        except OSError:
            self.dismiss()

    def tell(self, answer: dict[str, Any]) -> None:
        """Send JSON."""
        self.send(json.dumps(answer).encode())

    def dismiss(self) -> None:
        """End the connection; the visitor leaves as soon as the world listens to its visitors again."""
        with contextlib.suppress(OSError):  # gone already
            self.link.shutdown(socket.SHUT_RDWR)


class Service:
    """What the world does for visitors of one role, who are all told the same facts about it."""

    def __init__(self, facts: dict[str, Any]) -> None:
        self._facts = facts

    def welcome(self, visitor: Visitor) -> dict[str, Any]:
        """What the visitor has to know; raises ``Refused`` if it cannot come in."""
        return self._facts

    def hear(self, visitor: Visitor, message: bytes) -> None:
        """Take a message in; ``ValidationError`` is told the visitor."""
        raise NotImplementedError

    def leave(self, visitor: Visitor) -> None:
        """The visitor is gone."""


class Visitors:
    """All connections of a world, by a socket in its run directory; services are by role."""

    def __init__(self, run_dir: Path, services: Mapping[str, Service]) -> None:
        self._path = run_dir / wire.SOCKET_NAME
        self._services = services
        self._path.unlink(missing_ok=True)
        self._door = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._door.setblocking(False)
        with wire.socket_address(run_dir) as address:
            self._door.bind(address)
        self._door.listen(8)
        self._visitors: dict[int, Visitor] = {}
        self._numbers = [self._door.fileno()]

    def listen(self, timeout: float, also: Sequence[int] = ()) -> set[int]:
        """Handle everything that is there, or wait up to ``timeout`` for something to come [s].

        It is exact to a few dozen microseconds: ``poll`` would round up to whole milliseconds. ``also`` are numbers of
        other open files that end the wait; the result says which of them have something to read.
        """
        others = set[int]()
        for number in select.select([*self._numbers, *also], (), (), timeout)[0]:
            if number in also:
                others.add(number)
            elif number == self._numbers[0]:
                self._open()
            elif number in self._visitors:
                self._hear(self._visitors[number])
        return others

    def close(self) -> None:
        """End all connections and take the door away."""
        for visitor in self._visitors.values():
            visitor.link.close()
        self._door.close()
        self._path.unlink(missing_ok=True)

    def _open(self) -> None:
        with contextlib.suppress(OSError):  # gone again before the door was open
            visitor = Visitor(self._door.accept()[0])
            self._visitors[visitor.link.fileno()] = visitor
            self._numbers.append(visitor.link.fileno())

    def _hear(self, visitor: Visitor) -> None:
        try:
            message = visitor.link.recv(wire.LARGEST_MESSAGE)
        except BlockingIOError:
            return
        except OSError:
            message = b""
        if not message:
            self._leave(visitor)
        elif visitor.service is None:
            self._greet(visitor, message)
        else:
            try:
                visitor.service.hear(visitor, message)
            except ValidationError as error:
                visitor.tell({"error": wire.explain(error)})

    def _greet(self, visitor: Visitor, message: bytes) -> None:
        try:
            role = wire.Greeting.model_validate_json(message).role
            if role not in self._services:
                raise Refused(f"'{role}' is none of {', '.join(self._services)}")
            answer = self._services[role].welcome(visitor)
        except (Refused, ValidationError) as error:
            visitor.tell({"error": wire.explain(error) if isinstance(error, ValidationError) else str(error)})
            visitor.dismiss()
            return
        visitor.service = self._services[role]
        visitor.tell(answer)

    def _leave(self, visitor: Visitor) -> None:
        del self._visitors[visitor.link.fileno()]
        self._numbers.remove(visitor.link.fileno())
        visitor.link.close()
        if visitor.service is not None:
            visitor.service.leave(visitor)
