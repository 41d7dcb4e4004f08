"""The controller's two UDP sockets at one address: an open one for everybody, and one for the client alone.

The kernel gives a datagram to the connected socket if it comes from the client's address, and to the open one if not.
So each has a queue of its own, and whatever strangers send, it takes no place from what the client sends.
"""

from __future__ import annotations

import socket

Address = tuple[str, int]

LOCKSTEP_SILENCE = 30.0
"""Where plant time waits for controller and client, either counts as lost after so long [s, wall]: nothing moves
meanwhile, however busy the machine is. One that is gone is known by its closed port."""
_OPEN_BUFFER = 1 << 17
"""[bytes]; some 300 short datagrams: what strangers sent is not worth a longer wait."""
_CLIENT_BUFFER = 1 << 20
"""[bytes]; all that a client may send ahead, many times over."""


class PortInUse(Exception):
    """The UDP port cannot be taken; the message says what to do."""


def listening_socket(host: str, port: int) -> socket.socket:
    """A socket that hears everybody.

    Args:
        host: IPv4 address to listen at.
        port: UDP port, 0 for a free one.

    Raises:
        PortInUse: the port is taken or may not be used.
    """
    end = _new_socket(_OPEN_BUFFER)
    try:
        end.bind((host, port))
    except OSError as error:
        end.close()
        raise PortInUse(
            f"UDP port {port} at {host} cannot be used: {error.strerror}: end "
            "the program that uses it, or set the port to 0 for a free one"
        ) from error
    return end


def client_socket(beside: socket.socket, client: Address) -> socket.socket:
    """A socket at the same address that hears the client alone (and whoever wrote before this returned).

    Args:
        beside: socket that hears everybody.
        client: address of the client.

    Raises:
        OSError: the system has no such socket to give.
    """
    end = _new_socket(_CLIENT_BUFFER)
    try:
        # The port is shared for this moment only, and with this user only, so that no other program can join later.
        _share(beside, True)
        _share(end, True)
        end.bind(beside.getsockname())
        end.connect(client)
    except OSError:
        end.close()
        raise
    finally:
        _share(beside, False)
    _share(end, False)
    return end


def _new_socket(buffer: int) -> socket.socket:
    end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
    end.setblocking(False)
    return end


def _share(end: socket.socket, shared: bool) -> None:
    end.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, int(shared))
