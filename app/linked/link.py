"""A robot's end of a link: its record, its peer and the connection to it, opened and closed together."""

from __future__ import annotations

import errno
import ipaddress
import socket
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

from app.linked.connection import MOST_STRANGERS, GuestThread, HostThread, LinkThread
from app.linked.errors import LinkError
from app.linked.identity import KNOWN_FILE, KnownRobots, RobotIdentity, default_folder, shown_fingerprint
from app.linked.log import LinkedLog, LinkedState
from app.linked.messages import LONGEST_SENTENCE, printable
from app.linked.opponent import LinkedOpponent, new_game
from app.linked.peer import LinkedPeer
from app.linked.secret import LinkSecret
from app.settings.defaults import LinkRole, LinkSection, Settings
from hardware.piece_set import Colour

ROBOTS_FILE: Final = "link-robots.json"
"""In the folder of a match: the certificate of the other robot."""
LAST_WORDS: Final = 60.0
"""How long is waited for the other robot to have the end of the game [s, wall]."""
_POLL: Final = 0.5
"""[s, wall]"""


@dataclass(frozen=True, slots=True)
class RobotLink:
    """Open, from its making to its close. A context manager.

    Attributes:
        peer: the other robot.
        opponent: who plays there.
    """

    peer: LinkedPeer
    opponent: LinkedOpponent
    _thread: LinkThread
    _stack: ExitStack

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def wait_for_game(self, say: Callable[[str], None]) -> LinkedState:
        """Until both robots know of each other and of a game; people are told what there is to say meanwhile.

        Raises:
            LinkRefused: they never will.
        """
        while True:
            state = self.peer.wait_for_game(_POLL)
            while self.peer.notices:
                say(self.peer.notices.popleft())
            if state is not None:
                return state

    def take_leave(self, reason: str, wait: Callable[[], None]) -> None:
        """Once the other robot has the whole record, or does not come back for it; ``wait`` says that it is awaited."""
        if not self.peer.wait_until_had(_POLL):
            wait()
            self.peer.wait_until_had(LAST_WORDS)
        self._thread.close(printable(reason, LONGEST_SENTENCE))


def open_link(settings: Settings, folder: Path, secret: LinkSecret, here: str, say: Callable[[str], None]) -> RobotLink:
    """Open the link of a new match, or of one that goes on.

    Args:
        settings: of the match; a host's say what is played.
        folder: of the match; it exists.
        secret: of both robots.
        here: who plays at this table.
        say: told what people should know.

    Raises:
        LinkError: a certificate, a port or the record cannot be used.
        RecordError: the record cannot be written.
    """
    section = settings.link
    assert section.role is not None, "a game of two robots"
    home = section.identity or default_folder()
    identity = RobotIdentity.of(home)
    known = KnownRobots(folder / ROBOTS_FILE)
    with ExitStack() as stack:
        log = stack.enter_context(LinkedLog(folder, go_on=True))
        peer = LinkedPeer(log, section.role, here)
        thread: LinkThread
        if section.role is LinkRole.HOST:
            if not log.entries:
                _begin(peer, settings)
            listener = stack.enter_context(listen(str(section.listen), section.port))
            thread = HostThread(peer, identity, secret, known, listener)
            say(
                f"waiting for the other robot at {section.listen}:{section.port}; the certificate here is "
                f"{shown_fingerprint(identity.fingerprint)}"
            )
            if not ipaddress.ip_address(str(section.listen)).is_loopback:
                say("other computers can reach this port; only a robot with the secret gets any further")
        else:
            if section.host is None:
                raise LinkError("no host is named: use 'touchmove join HOST'")
            thread = GuestThread(
                peer, identity, secret, known, section.host, section.port, KnownRobots(home / KNOWN_FILE)
            )
            say(f"joining the robot at {section.host}:{section.port}")
        stack.enter_context(thread)
        return RobotLink(peer, LinkedOpponent(peer, time.monotonic), thread, stack.pop_all())


def _begin(peer: LinkedPeer, settings: Settings) -> None:
    """Write down what the host wants to play."""
    game = settings.game
    assert game.fen is not None, "the host's settings say where the game begins"
    peer.begin(
        new_game(
            game.fen, chess960=game.chess960, host_is_white=settings.link.color is Colour.WHITE,
            clock=settings.clock.time, plies=game.plies,
        )
    )  # fmt: skip


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens for a guest.

    Raises:
        LinkError: nobody can listen there.
    """
    end = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    end.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        end.bind((host, port))
        end.listen(MOST_STRANGERS)
    except OSError as error:
        end.close()
        remedy = "choose another with --port" if error.errno == errno.EADDRINUSE else "choose another with --listen"
        raise LinkError(f"cannot wait for a robot at {host}:{port} ({error.strerror}): {remedy}") from error
    return end


def parse_address(text: str, port: int) -> tuple[str, int]:
    """A host and its port, as people write them: ``robot.local``, ``10.0.0.7:8065``, ``[::1]:8065``.

    Raises:
        LinkError: it is no address.
    """
    host, colon, number = text.strip().rpartition(":")
    if not colon or (":" in host and not host.endswith("]")):  # no port, or an IPv6 address without one
        host, number = text.strip(), str(port)
    host = host.removeprefix("[").removesuffix("]")
    if not host or not number.isdecimal() or not 1 <= int(number) <= 65535 or any(one.isspace() for one in host):
        raise LinkError(f"'{text}' is no address of a robot: write HOST or HOST:PORT, such as robot.local:{port}")
    return host, int(number)


def link_secret(section: LinkSection, typed: Callable[[], str]) -> LinkSecret:
    """The secret as the settings say: from its file, or typed.

    Raises:
        LinkError: there is none that can be used.
    """
    return LinkSecret.of(typed()) if section.secret is None else LinkSecret.load(section.secret)
