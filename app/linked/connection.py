"""The connection between two robots: TLS over TCP, in one thread of its own, taken up again whenever it is cut.

asyncio, because one thread then owns each TLS connection; OpenSSL's may not be read and written by two.
"""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Final, Self

from app.linked.errors import LinkBroken, LinkError, LinkRefused
from app.linked.identity import KnownRobots, RobotIdentity, fingerprint_of, shown_fingerprint
from app.linked.introduction import Introduced, introduce_guest, introduce_host, line_of
from app.linked.messages import LONGEST_MESSAGE, AliveMessage, LeavingMessage, Message, message_of
from app.linked.peer import LinkedPeer
from app.linked.secret import LinkSecret
from app.records import RecordError
from app.settings.defaults import LinkRole

HEARTBEAT: Final = 2.0
"""Something is said at least so often [s, wall]."""
SILENCE: Final = 10.0
"""Of which the other robot counts as gone: five heartbeats [s, wall]."""
INTRODUCTION: Final = 10.0
"""In which both must have proved who they are [s, wall]."""
MOST_STRANGERS: Final = 16
"""That may try to prove themselves at a time; more are turned away at once."""
PENALTY: Final = 1.0
"""Before somebody with a wrong secret hears so, which limits how many can be tried [s, wall]."""
RETRIES: Final = (0.2, 0.5, 1.0, 2.0, 5.0)
"""The guest waits so long before it tries again; the last one from then on [s, wall]."""
FAREWELL: Final = 1.0
"""Longer than this TLS's is not waited for [s, wall]."""
_TOLD: Final = 2
"""After so many tries people hear that nobody answers."""
_TURNS: Final = 5
"""Of the loop, in which what is closed is closed down to its socket."""
LEAVE: Final = 3.0
"""Longer than this nobody waits for the last words [s, wall]."""


class _Connection:
    """Of two robots that know each other, until it is cut."""

    def __init__(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, met: Introduced, role: LinkRole
    ) -> None:
        self._reader, self._writer = reader, writer
        self._sealer, self._opener = met.handshake.sealer(role), met.handshake.opener(role.other)
        self._queue: asyncio.Queue[Message | None] = asyncio.Queue()
        self._loop = asyncio.get_running_loop()
        self._over = False

    def send(self, message: Message) -> None:
        """From any thread."""
        if not self._over:
            with suppress(RuntimeError):  # the loop is closed
                self._loop.call_soon_threadsafe(self._queue.put_nowait, message)

    async def leave(self) -> None:
        """Once what was said is on its way."""
        self._queue.put_nowait(None)

    def cut(self) -> None:
        """Now."""
        self._over = True
        self._writer.transport.abort()

    async def talk(self, received: Callable[[Message], None]) -> None:
        """Until it is cut, by whomever.

        Raises:
            LinkBroken: what came cannot be.
            OSError, TimeoutError: it was cut.
        """
        writing = asyncio.create_task(self._write())
        reading = asyncio.create_task(self._read(received))
        try:
            done, _ = await asyncio.wait((writing, reading), return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            self._over = True
            for task in (writing, reading):
                task.cancel()
            await asyncio.gather(writing, reading, return_exceptions=True)

    async def _read(self, received: Callable[[Message], None]) -> None:
        while True:
            async with asyncio.timeout(SILENCE):
                line = await line_of(self._reader, LONGEST_MESSAGE)
            received(message_of(self._opener.open(line)))

    async def _write(self) -> None:
        while True:
            message: Message | None = AliveMessage()
            with suppress(TimeoutError):
                async with asyncio.timeout(HEARTBEAT):
                    message = await self._queue.get()
            if message is None:
                return
            self._writer.write(self._sealer.seal(message.model_dump_json().encode()))
            await self._writer.drain()


class LinkThread:
    """Keeps a robot connected to its peer. A context manager.

    Args:
        peer: told what comes.
        identity: of this robot.
        secret: of both.
        known: fingerprint of the other robot of this match, by its role.
    """

    def __init__(self, peer: LinkedPeer, identity: RobotIdentity, secret: LinkSecret, known: KnownRobots) -> None:
        self._peer, self._identity, self._secret, self._known = peer, identity, secret, known
        self._role = peer.role
        self._loop = asyncio.new_event_loop()
        self._current: _Connection | None = None
        self._closing = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="link", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close("the program has ended")

    def close(self, reason: str) -> None:
        """Take leave; a second call does nothing."""
        if self._thread.is_alive():
            if self._current is not None:
                self._current.send(LeavingMessage(reason=reason))
            with suppress(RuntimeError):  # it has just ended
                self._loop.call_soon_threadsafe(self._closing.set)
            self._thread.join(LEAVE + 2.0)

    def cut(self) -> None:
        """Break the connection off as if the network had; it is taken up again."""
        if (current := self._current) is not None:
            self._loop.call_soon_threadsafe(current.cut)

    def _run(self) -> None:
        try:
            self._loop.run_until_complete(self._until_closed())
        finally:
            self._loop.run_until_complete(_end_tasks())
            self._loop.close()

    async def _until_closed(self) -> None:
        work = asyncio.create_task(self._work())
        leaving = asyncio.create_task(self._leave())
        await asyncio.wait((work, leaving), return_when=asyncio.FIRST_COMPLETED)
        leaving.cancel()
        work.cancel()
        (ended,) = await asyncio.gather(work, return_exceptions=True)
        if isinstance(ended, Exception):
            self._peer.fail(str(ended))

    async def _leave(self) -> None:
        """Once that is wanted; it waits in the loop's own thread, which may end before it is wanted."""
        await self._closing.wait()
        current = self._current
        if current is not None:
            await current.leave()
            with suppress(TimeoutError):
                async with asyncio.timeout(LEAVE):
                    while self._current is current:
                        await asyncio.sleep(0.01)

    async def _work(self) -> None:
        raise NotImplementedError

    async def _talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, met: Introduced) -> None:
        """As long as the connection lasts."""
        if self._current is not None:  # the other robot has lost that one, or it would not come again
            self._current.cut()
        connection = self._current = _Connection(reader, writer, met, self._role)
        why: str | None = f"the link to {self._peer.name} is cut: the clocks stand until it is back"
        try:
            self._peer.connected(connection.send)
            await connection.talk(self._peer.received)
            why = None
        except (LinkBroken, LinkRefused) as error:
            why = str(error)
        except RecordError as error:
            self._peer.fail(str(error))
        except (OSError, TimeoutError):
            pass
        finally:
            if self._current is connection:
                self._current = None
                self._peer.disconnected(None if self._closing.is_set() else why)
            await hang_up(writer, at_once=why is not None)

    def _pinned(self) -> str | None:
        return self._known.fingerprint(self._role.other)

    def _pin(self, fingerprint: str) -> None:
        if self._pinned() is None:
            self._known.remember(self._role.other, fingerprint)


class HostThread(LinkThread):
    """The host's: listens.

    Args:
        peer, identity, secret, known: as of ``LinkThread``.
        listener: where the guest comes to.
    """

    def __init__(
        self, peer: LinkedPeer, identity: RobotIdentity, secret: LinkSecret, known: KnownRobots, listener: socket.socket
    ) -> None:
        super().__init__(peer, identity, secret, known)
        self._tls = identity.tls(host=True)
        self._listener = listener
        self._strangers, self._refused = 0, 0
        self._served = set[asyncio.Task[None]]()

    async def _work(self) -> None:
        self._listener.setblocking(False)
        while True:
            try:
                end, _ = await self._loop.sock_accept(self._listener)
            except OSError:  # this program has too many files open, or whoever knocked has gone
                await asyncio.sleep(RETRIES[0])
                continue
            if self._strangers < MOST_STRANGERS:
                task = asyncio.create_task(self._serve(end))
                self._served.add(task)
                task.add_done_callback(self._served.discard)
            else:
                end.close()

    async def _serve(self, end: socket.socket) -> None:
        self._strangers += 1
        try:
            met = await self._introduced(end)
        finally:
            self._strangers -= 1
        if met is not None:
            await self._talk(*met)

    async def _introduced(
        self, end: socket.socket
    ) -> tuple[asyncio.StreamReader, asyncio.StreamWriter, Introduced] | None:
        """Whoever has come and has proved who they are; nobody else is told anything but why not."""
        writer = met = None
        try:
            async with asyncio.timeout(INTRODUCTION):
                reader, writer = await self._secured(end)
                met = await introduce_host(reader, writer, self._identity, self._secret, self._pinned())
            self._pin(met.fingerprint)
            return reader, writer, met
        except LinkRefused as error:
            self._refused += 1
            if self._refused.bit_count() == 1:  # 1, 2, 4, 8 …: nobody fills the screen
                self._peer.note(str(error) if self._refused == 1 else f"{error} ({self._refused} refused so far)")
            await asyncio.sleep(PENALTY)
        except (LinkBroken, OSError, TimeoutError):
            pass  # whoever that was
        except (LinkError, RecordError) as error:  # the files here
            self._peer.fail(str(error))
        finally:
            if met is None and writer is not None:
                writer.transport.abort()
        return None

    async def _secured(self, end: socket.socket) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """TLS over a connection that was accepted."""
        reader = asyncio.StreamReader(LONGEST_MESSAGE)
        protocol = asyncio.StreamReaderProtocol(reader)
        transport, _ = await self._loop.connect_accepted_socket(
            lambda: protocol, end, ssl=self._tls, ssl_shutdown_timeout=FAREWELL
        )
        return reader, asyncio.StreamWriter(transport, protocol, reader, self._loop)


class GuestThread(LinkThread):
    """The guest's: joins a host, whenever it is there.

    Args:
        peer, identity, secret, known: as of ``LinkThread``.
        host: name or address of the host's computer.
        port: its TCP port.
        hosts: all hosts that were met before, by address.
    """

    def __init__(
        self, peer: LinkedPeer, identity: RobotIdentity, secret: LinkSecret, known: KnownRobots, host: str, port: int,
        hosts: KnownRobots,
    ) -> None:  # fmt: skip
        super().__init__(peer, identity, secret, known)
        self._tls = identity.tls(host=False)
        self._host, self._port, self._hosts = host, port, hosts
        self._met = False

    @property
    def _address(self) -> str:
        return f"{self._host}:{self._port}"

    async def _work(self) -> None:
        tries = 0
        while not self._closing.is_set():
            since = self._loop.time()
            try:
                await self._join()
                if self._loop.time() - since > INTRODUCTION:  # not one that the other robot ends at once
                    tries = 0
            except LinkRefused as error:
                if not self._met:
                    raise
                self._peer.note(str(error))
                tries = len(RETRIES) - 1
            except (OSError, TimeoutError, LinkBroken) as error:
                if tries == _TOLD:
                    self._peer.note(f"no robot answers at {self._address} ({_reason(error)}): it is tried again")
            await asyncio.sleep(RETRIES[min(tries, len(RETRIES) - 1)])
            tries += 1

    async def _join(self) -> None:
        async with asyncio.timeout(INTRODUCTION):
            reader, writer = await asyncio.open_connection(
                self._host, self._port, ssl=self._tls, limit=LONGEST_MESSAGE, ssl_shutdown_timeout=FAREWELL
            )
            try:
                fingerprint = fingerprint_of(writer.get_extra_info("ssl_object").getpeercert(True))
                self._require_known(fingerprint)
                met = await introduce_guest(reader, writer, self._identity, self._secret)
                self._trust(met.fingerprint)
            except BaseException:
                writer.transport.abort()
                raise
        self._met = True
        await self._talk(reader, writer, met)

    def _require_known(self, fingerprint: str) -> None:
        """Nothing is proved to a host that is not the one that was met: it could try secrets on the proof."""
        pinned = self._pinned() or self._hosts.fingerprint(self._address)
        if pinned not in (None, fingerprint):
            raise LinkRefused(
                f"the robot at {self._address} has another certificate than before, so it may be somebody else's: if "
                f"it has a new one, remove its line from {self._hosts.path}, and begin a new game"
            )

    def _trust(self, fingerprint: str) -> None:
        self._pin(fingerprint)
        if self._hosts.fingerprint(self._address) is None:
            self._hosts.remember(self._address, fingerprint)
            self._peer.note(
                f"{self._address} is met for the first time and knows the secret; its certificate is "
                f"{shown_fingerprint(fingerprint)}, which is shown there, too"
            )


async def hang_up(writer: asyncio.StreamWriter, *, at_once: bool) -> None:
    """Close a connection: with TLS's own farewell, or at once."""
    try:
        if not at_once:
            writer.close()
            with suppress(OSError, TimeoutError):
                async with asyncio.timeout(FAREWELL):
                    await writer.wait_closed()
    finally:
        writer.transport.abort()


async def _end_tasks() -> None:
    """Of guests that are still being served."""
    left = asyncio.all_tasks() - {asyncio.current_task()}
    for task in left:
        task.cancel()
    await asyncio.gather(*left, return_exceptions=True)
    for _ in range(_TURNS):
        await asyncio.sleep(0.0)


def _reason(error: Exception) -> str:
    if isinstance(error, TimeoutError):
        return "no answer in time"
    return getattr(error, "strerror", None) or str(error) or "the connection was closed"
