"""A bad network between a game and its controller: a relay on this computer that loses datagrams, as a seed decides."""

from __future__ import annotations

import json
import select
import socket
import threading
from contextlib import suppress
from pathlib import Path
from typing import Final, Self

import numpy as np

from controller.protocol.datagram_fields import MAX_DATAGRAM
from controller.settings import CONTROLLER_FILE, LOOPBACK

_GLANCE: Final = 0.2
"""So often it looks whether it shall end [s, wall]."""
_IP_RECVERR: Final = 11
"""Linux: what the network says of a datagram that could not be delivered is kept for who asks (``man 7 ip``)."""


class LossyRelay:
    """Forwards datagrams between one client at a time and the controller of a run directory, and loses a share of them.

    Which of them, counted each way, the seed decides. Each client has a port of its own towards the controller, closed
    when the client's is: as without a relay, the controller sees at once that a program was killed. A context manager.

    Args:
        run_dir: in which the controller says where it is, once it is there, and anew where another one follows it.
        loss: share of datagrams lost, each way.
        seed: decides which.

    Attributes:
        port: where the client finds it.
        lost: so many so far.
    """

    def __init__(self, run_dir: Path, loss: float, seed: int) -> None:
        self._file, self._loss = run_dir / CONTROLLER_FILE, loss
        self._rngs = {way: np.random.default_rng([seed, 9, way]) for way in (0, 1)}
        self._front = _bound()
        self._front.setsockopt(socket.SOL_IP, _IP_RECVERR, 1)
        self._back = _bound()
        self._poll = select.poll()
        self.port = int(self._front.getsockname()[1])
        self.lost = 0
        self._client: tuple[str, int] | None = None
        self._controller: tuple[str, int] | None = None
        self._stamp = -1
        self._ending = False
        self._thread = threading.Thread(target=self._forward, name="lossy relay", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending = True
        self._thread.join()

    def _forward(self) -> None:
        self._poll.register(self._front, select.POLLIN)
        self._poll.register(self._back, select.POLLIN)
        try:
            while not self._ending:
                for number, _ in self._poll.poll(1e3 * _GLANCE):
                    with suppress(ConnectionRefusedError, BlockingIOError):  # nobody there: who has sent it repeats it
                        self._pass(0 if number == self._front.fileno() else 1)
                if self._is_gone():
                    self._let_go()
        finally:
            self._front.close()
            self._back.close()

    def _let_go(self) -> None:
        """What the client had towards the controller is closed."""
        self._poll.unregister(self._back)
        self._back.close()
        self._back, self._client = _bound(), None
        self._poll.register(self._back, select.POLLIN)

    def _is_gone(self) -> bool:
        """Whether the client's port is closed."""
        gone = False
        with suppress(BlockingIOError):
            while True:
                gone |= self._front.recvmsg(1, 0, socket.MSG_ERRQUEUE)[3] == self._client
        return gone

    def _pass(self, way: int) -> None:
        """One datagram: 0 to the controller, 1 to the client."""
        source, target = (self._front, self._back) if way == 0 else (self._back, self._front)
        data, sender = source.recvfrom(MAX_DATAGRAM + 1)
        if way == 0:
            if self._client not in (None, sender):
                self._let_go()
                target = self._back
            self._client = sender
            self._look_up()
        to = self._controller if way == 0 else self._client
        if to is None:
            return
        if self._rngs[way].random() < self._loss:
            self.lost += 1
        else:
            target.sendto(data, to)

    def _look_up(self) -> None:
        """Where the controller is, if that has changed."""
        with suppress(FileNotFoundError, json.JSONDecodeError):
            stamp = self._file.stat().st_mtime_ns
            if stamp != self._stamp:
                found = json.loads(self._file.read_text(encoding="utf-8"))
                self._controller, self._stamp = (str(found["host"]), int(found["port"])), stamp


def _bound() -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind((LOOPBACK, 0))
    made.setblocking(False)
    return made
