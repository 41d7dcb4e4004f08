"""Workers of a Dask cluster, by the address of its scheduler; needs the extra ``campaign``."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

from app import UserError

CONNECT: Final = 10.0
"""For a scheduler to answer [s, wall]."""
TELL_EVERY: Final = 30.0
"""So often it is said that no worker answers yet [s, wall]; one that does takes a few seconds."""
_ADDRESS: Final = re.compile(r"(?:(?P<protocol>tcp|tls|ws|wss)://)?[^\s/]+:(?P<port>\d{1,5})/?")
_SECURE: Final = ("tls", "wss")
_CERTIFICATES: Final = ("distributed.comm.tls.ca-file", "distributed.comm.tls.client.cert")


class ClusterProblem(UserError):
    """There is no such scheduler, or no Dask here."""


@dataclass(frozen=True, slots=True)
class Cluster:
    """An open connection to a scheduler.

    Attributes:
        address: of the scheduler.
        executor: its workers.
        cores: how many games they can play at a time, now.
        dashboard: address of Dask's own; None: there is none.
        deaths: what is raised for a task whose workers died again and again.
    """

    address: str
    executor: Executor
    cores: Callable[[], int]
    dashboard: str | None
    deaths: tuple[type[BaseException], ...]

    def why_none(self) -> str:
        """What to say while no worker answers."""
        start = f"start some with 'dask worker {self.address}' where this program is installed"
        if self.cores():
            return f"no worker answers yet: it is busy, or its environment lacks this program: wait, or {start}"
        return f"no worker is there yet, or its environment lacks this program: {start}"


@contextmanager
def open_cluster(address: str) -> Iterator[Cluster]:
    """Connect to a scheduler; what is under way there is let go of at the end.

    Raises:
        ClusterProblem: nobody answers there, it is no address that can be used, or Dask is not installed.
    """
    try:
        from dask import config
        from distributed import Client
        from distributed.scheduler import KilledWorker
    except ImportError as error:
        raise ClusterProblem(
            f"--scheduler takes Dask, and {error.name} is missing: 'pip install touchmove[campaign]'"
        ) from error
    _require_address(address, all(config.get(name, None) for name in _CERTIFICATES))
    for name in ("distributed.client", "distributed.core", "distributed.comm", "tornado.application"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # that a scheduler is lost is said in a sentence
    try:
        with config.set({"distributed.comm.timeouts.connect": CONNECT}):
            opened: Any = Client
            client = opened(address, timeout=CONNECT, set_as_default=False, name="touchmove-campaign")
    except (OSError, ValueError, TypeError) as error:
        raise ClusterProblem(f"no Dask scheduler answers at {address}: start it, or name another address") from error
    executor = client.get_executor(pure=False)
    try:
        yield Cluster(
            address, executor, lambda: sum(client.nthreads().values()) if client.status == "running" else 0,
            str(client.dashboard_link) or None, (KilledWorker,),
        )  # fmt: skip
    finally:
        executor.shutdown(wait=False)
        client.close(timeout=CONNECT)


def _require_address(address: str, certified: bool) -> None:
    """Make sure that Dask can use an address: a client that it could not make ends in a traceback, and late.

    Raises:
        ClusterProblem: it is none, or takes certificates that Dask's configuration does not name.
    """
    found = _ADDRESS.fullmatch(address)
    if found is None or not 0 < int(found["port"]) <= 65535:
        raise ClusterProblem(f"--scheduler is '{address}', which is no address: name one such as tcp://host:8786")
    if found["protocol"] in _SECURE and not certified:
        raise ClusterProblem(
            f"--scheduler is '{address}', and Dask's configuration names no certificates: set "
            f"{' and '.join(_CERTIFICATES)} there, or name an address such as tcp://host:8786"
        )
