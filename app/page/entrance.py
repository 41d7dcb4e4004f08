"""Where the page is reached: its socket, its names, and what must hold before others than this computer's may come."""

from __future__ import annotations

import errno
import ipaddress
import socket
from dataclasses import dataclass
from typing import Final
from urllib.parse import urlsplit

from app import UserError
from app.page.web.security import Names
from app.page.web.sign_in import PasswordHash, SignIn
from app.settings.defaults import PageSection

BACKLOG: Final = 64


class PageRefused(UserError):
    """The page is not opened as it is wished; the message is one sentence with the next step."""


@dataclass(frozen=True, slots=True)
class Entrance:
    """A socket that listens, what the page is called, and who may come in."""

    socket: socket.socket
    names: Names
    sign_in: SignIn | None
    """None: everybody on this computer."""
    address: str
    """For a browser on this computer."""


def open_entrance(settings: PageSection) -> Entrance:
    """Listen as the settings say; at any free port where theirs is taken.

    Raises:
        PageRefused: others may come and nothing protects the page, or nobody can listen there.
        PasswordFileError: the password's file cannot be used.
    """
    _require_protection(settings)
    password = None if settings.password is None else PasswordHash.load(settings.password)
    end = _listening(settings.host, settings.port)
    port = end.getsockname()[1]
    secure = settings.address is not None and settings.address.startswith("https:")
    sign_in = None if password is None else SignIn(password, port, secure=secure)
    names = Names.of(settings.host, port, settings.address)
    return Entrance(end, names, sign_in, f"http://{settings.host}:{port}/")


def _require_protection(settings: PageSection) -> None:
    set_one = "'touchmove page --set-password FILE' makes one"
    if settings.address is not None:
        parts = urlsplit(settings.address)
        if parts.scheme not in ("http", "https") or not parts.hostname or parts.path not in ("", "/"):
            raise PageRefused(
                f"the page's address is '{settings.address}': write it as the browser shows it, such as "
                "https://robot.example"
            )
        if settings.password is None:
            raise PageRefused(f"a page with an address ({settings.address}) needs a password: {set_one}")
    if not ipaddress.IPv4Address(settings.host).is_loopback:
        if settings.password is None:
            raise PageRefused(f"a page that others reach at {settings.host} needs a password: {set_one}")
        if settings.address is None or urlsplit(settings.address).scheme != "https":
            raise PageRefused(
                f"a page that others reach at {settings.host} needs a TLS proxy in front of it, or everybody can read "
                "its password: give the proxy's address, such as https://robot.example"
            )


def _listening(host: str, port: int) -> socket.socket:
    end = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    end.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        try:
            end.bind((host, port))
            end.listen(BACKLOG)  # where two that begin at once were both let have it, one hears so here
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise
            end.close()
            end = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            end.bind((host, 0))
            end.listen(BACKLOG)
    except OSError as error:
        end.close()
        raise PageRefused(
            f"cannot listen on {host}:{port}: {error.strerror}: choose another host or port of the page"
        ) from error
    return end
