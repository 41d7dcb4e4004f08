"""Two robots over TLS on the loopback interface: who may come in, what is refused, and that a cut link comes back."""

from __future__ import annotations

import asyncio
import json
import socket
import ssl
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import chess
import pytest

from app.linked import connection
from app.linked.connection import GuestThread, HostThread, LinkThread
from app.linked.errors import LinkError, LinkRefused
from app.linked.identity import KnownRobots, RobotIdentity
from app.linked.link import listen
from app.linked.messages import VERSION, HelloMessage, opening_of
from app.linked.opponent import new_game
from app.linked.secret import LinkSecret
from app.players.remote import Notice
from tests.app.linked.pair import GUEST, HOST, SECRET, Clockwork, Robot
from tests.waiting import until

OTHER = LinkSecret(b"o" * 32)


@pytest.fixture(scope="module")
def identities(tmp_path_factory: pytest.TempPathFactory) -> dict[str, RobotIdentity]:
    folder = tmp_path_factory.mktemp("identities")
    return {name: RobotIdentity.of(folder / name) for name in ("host", "guest", "stranger")}


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "PENALTY", 0.0)
    monkeypatch.setattr(connection, "RETRIES", (0.02,))


class Ends:
    """Both ends; each can be replaced."""

    def __init__(self, folder: Path, identities: dict[str, RobotIdentity], stack: ExitStack) -> None:
        self.folder, self.identities, self.stack = folder, identities, stack
        self.listener = stack.enter_context(listen("127.0.0.1", 0))
        self.port: int = self.listener.getsockname()[1]
        now = Clockwork()
        self.host, self.guest = Robot(folder / "host", HOST, now), Robot(folder / "guest", GUEST, now)
        self.host.peer.begin(
            new_game(chess.STARTING_FEN, chess960=False, host_is_white=True, clock=None, plies=300)
        )  # fmt: skip
        self.hosting = HostThread(
            self.host.peer, identities["host"], SECRET, KnownRobots(folder / "host-known.json"), self.listener
        )
        stack.enter_context(self.hosting)

    def join(self, who: str = "guest", secret: LinkSecret = SECRET, port: int | None = None) -> LinkThread:
        thread = GuestThread(
            self.guest.peer, self.identities[who], secret, KnownRobots(self.folder / f"{who}-known.json"),
            "127.0.0.1", port or self.port, KnownRobots(self.folder / f"{who}-hosts.json"),
        )  # fmt: skip
        return self.stack.enter_context(thread)

    def met(self) -> bool:
        return self.host.peer.wait_for_game(0.0) is not None and self.guest.peer.wait_for_game(0.0) is not None

    def play(self, *moves: str) -> None:
        for move in moves:
            newest = max((self.host, self.guest), key=lambda robot: len(robot.log))
            mover = self.host if newest.log.state.board.turn else self.guest
            until(lambda mover=mover: self.shows(mover), "the move before")
            mover.move(move)

    def shows(self, robot: Robot) -> bool:
        """Whether a table shows the newest position of both."""
        robot.heed()
        return len(robot.table.move_stack) == max(
            len(one.log.state.board.move_stack) for one in (self.host, self.guest)
        )


@pytest.fixture
def ends(tmp_path: Path, identities: dict[str, RobotIdentity]) -> Iterator[Ends]:
    with ExitStack() as stack:
        yield Ends(tmp_path, identities, stack)


def test_a_cut_link_is_taken_up_again_and_no_ply_is_lost(ends: Ends) -> None:
    thread = ends.join()
    until(ends.met, "both know each other")
    moves = ["e2e4", "e7e5", "g1f3", "b8c6", "f1b5", "a7a6"]
    for move in moves:
        ends.play(move)
        thread.cut()
    until(lambda: ends.shows(ends.host) and ends.shows(ends.guest), "both tables show the last move")
    assert [move.uci() for move in ends.guest.table.move_stack] == moves
    assert ends.host.log.digests == ends.guest.log.digests
    until(lambda: ends.guest.heed() or any("connected again" in one for one in ends.guest.said()), "it says so")


def test_a_host_is_met_once_and_shown_by_its_fingerprint(ends: Ends) -> None:
    thread = ends.join()
    until(ends.met, "both know each other")
    (said,) = list(ends.guest.peer.notices)
    shown = ends.identities["host"].fingerprint[:8].upper()
    assert said.startswith(f"127.0.0.1:{ends.port} is met for the first time and knows the secret; its certificate is ")
    assert f" {shown[:4]}:{shown[4:]}:" in said
    known = json.loads((ends.folder / "guest-hosts.json").read_text())
    assert known == {f"127.0.0.1:{ends.port}": ends.identities["host"].fingerprint}
    assert json.loads((ends.folder / "host-known.json").read_text()) == {"guest": ends.identities["guest"].fingerprint}
    thread.close("enough")


def test_a_wrong_secret_is_refused_at_both_ends(ends: Ends) -> None:
    ends.join(secret=OTHER)
    with pytest.raises(LinkRefused, match=r"^the two robots do not have the same secret, or somebody stands between"):
        until(lambda: ends.guest.peer.wait_for_game(0.1), "refused")
    until(lambda: len(ends.host.peer.notices) > 0, "the host says so")
    assert ends.host.peer.notices[0] == "somebody with another secret wants to join and was refused"
    assert len(ends.guest.log) == 0
    assert not (ends.folder / "guest-hosts.json").exists(), "nobody is trusted who has proved nothing"


def test_another_certificate_of_the_host_is_refused_before_anything_is_proved(ends: Ends) -> None:
    KnownRobots(ends.folder / "guest-hosts.json").remember(f"127.0.0.1:{ends.port}", "0" * 64)
    ends.join()
    with pytest.raises(LinkRefused, match=r"^the robot at 127.0.0.1:\d+ has another certificate than before, so"):
        until(lambda: ends.guest.peer.wait_for_game(0.1), "refused")
    assert not ends.host.peer.notices


def test_another_guest_than_the_one_that_began_the_game_is_refused(ends: Ends) -> None:
    thread = ends.join()
    until(ends.met, "both know each other")
    thread.close("enough")
    stranger = Robot(ends.folder / "stranger", GUEST, Clockwork())
    ends.guest = stranger
    ends.join("stranger")
    with pytest.raises(LinkRefused, match=r"^the host plays this game with another robot: join with the one that"):
        until(lambda: stranger.peer.wait_for_game(0.1), "refused")


def test_who_stands_between_with_a_certificate_of_their_own_learns_and_changes_nothing(ends: Ends) -> None:
    """They end TLS at both sides and pass every line on; both proofs fail, as each end has seen another certificate."""
    middle = _Middle(ends.port, ends.identities["stranger"])
    with middle.running() as port:
        ends.join(port=port)
        with pytest.raises(LinkRefused, match="or somebody stands between them"):
            until(lambda: ends.guest.peer.wait_for_game(0.1), "refused")
    assert len(ends.guest.log) == 0


class _Middle:
    """Reads and passes on what two robots say."""

    def __init__(self, port: int, identity: RobotIdentity) -> None:
        self._port, self._identity = port, identity

    @contextmanager
    def running(self) -> Iterator[int]:
        loop, end = asyncio.new_event_loop(), listen("127.0.0.1", 0)
        over = asyncio.Event()

        async def serve() -> None:
            server = await asyncio.start_server(self._pass_on, sock=end, ssl=self._identity.tls(host=True))
            async with server:
                await over.wait()
            await connection._end_tasks()

        thread = threading.Thread(target=lambda: loop.run_until_complete(serve()))
        thread.start()
        try:
            yield end.getsockname()[1]
        finally:
            loop.call_soon_threadsafe(over.set)
            thread.join()
            loop.close()

    async def _pass_on(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there = await asyncio.open_connection("127.0.0.1", self._port, ssl=self._identity.tls(host=False))
        await asyncio.gather(_copy(reader, there[1]), _copy(there[0], writer))


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while data := await reader.read(4096):
            writer.write(data)
            await writer.drain()
    writer.transport.abort()


def _garbage() -> list[Callable[[socket.socket], None]]:
    def plain(data: bytes) -> Callable[[socket.socket], None]:
        return lambda end: end.sendall(data)

    def tls(data: bytes) -> Callable[[socket.socket], None]:
        def say(end: socket.socket) -> None:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
            context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
            with context.wrap_socket(end) as wrapped:
                wrapped.sendall(data)
                wrapped.settimeout(5.0)
                while wrapped.recv(1000):
                    pass

        return say

    long = b'{"message":"hello","version":1,"nonce":"' + b"0" * 5000 + b'"}\n'
    bodies = (b"\n", b"GET / HTTP/1.1\r\n\r\n", b"{}\n", long, b"x" * 100_000, b'{"message":"alive"}\n')
    return [plain(b"GET / HTTP/1.1\r\n\r\n"), plain(b"\x16\x03\x01" + b"\xff" * 300), *map(tls, bodies)]


@pytest.mark.parametrize("number", range(8))
def test_what_is_no_robot_is_turned_away_and_the_game_goes_on(ends: Ends, number: int) -> None:
    ends.join()
    until(ends.met, "both know each other")
    with socket.create_connection(("127.0.0.1", ends.port)) as end, suppress(OSError):
        _garbage()[number](end)
    ends.play("e2e4", "e7e5")
    until(lambda: ends.shows(ends.host), "the game goes on")
    assert not ends.host.said()


def test_tls_of_before_1_3_is_refused(ends: Ends) -> None:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    context.maximum_version = ssl.TLSVersion.TLSv1_2
    with socket.create_connection(("127.0.0.1", ends.port)) as end, pytest.raises((ssl.SSLError, OSError)):
        context.wrap_socket(end)


def test_a_guest_of_another_version_is_told_so(ends: Ends) -> None:
    async def join() -> bytes:
        reader, writer = await asyncio.open_connection(
            "127.0.0.1", ends.port, ssl=ends.identities["guest"].tls(host=False)
        )
        writer.write(HelloMessage(version=VERSION + 1, nonce="0" * 64).model_dump_json().encode() + b"\n")
        answer = await reader.readline()
        writer.transport.abort()
        return answer

    hello = opening_of(asyncio.run(join()))
    assert isinstance(hello, HelloMessage)
    assert hello.version == VERSION, "from which the guest knows that they differ"
    until(lambda: len(ends.host.peer.notices) > 0, "the host says so")
    assert ends.host.peer.notices[0].startswith("a robot with another version of Touchmove wants to join")


def test_who_leaves_says_so(ends: Ends) -> None:
    thread = ends.join()
    until(ends.met, "both know each other")
    ends.play("e2e4")
    until(lambda: ends.shows(ends.guest), "the move")
    thread.close("its person had to go")
    ends.host.events.clear()

    def heard() -> bool:
        ends.host.heed()
        return Notice("engine of the guest has left (its person had to go); the game goes on when it is back") in (
            ends.host.events
        )

    until(heard, "the host hears it")


def test_a_port_in_use_is_said(ends: Ends) -> None:
    with pytest.raises(LinkError, match=r"^cannot wait for a robot at 127.0.0.1:\d+ \(Address already in use\): "):
        listen("127.0.0.1", ends.port)
