"""Workers of a Dask cluster, by the address of its scheduler; needs the extra ``campaign``."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

from app import UserError

CONNECT: Final = 10.0
"""For a scheduler to answer [s, wall]."""


class ClusterProblem(UserError):
    """There is no such scheduler, or no Dask here."""


@dataclass(frozen=True, slots=True)
class Cluster:
    """An open connection to a scheduler.

    Attributes:
        executor: its workers.
        cores: how many games they can play at a time, now.
        dashboard: address of Dask's own; None: there is none.
        deaths: what is raised for a task whose workers died again and again.
    """

    executor: Executor
    cores: Callable[[], int]
    dashboard: str | None
    deaths: tuple[type[BaseException], ...]


@contextmanager
def open_cluster(address: str) -> Iterator[Cluster]:
    """Connect to a scheduler; what is under way there is let go of at the end.

    Raises:
        ClusterProblem: nobody answers there, or Dask is not installed.
    """
    try:
        from dask import config
        from distributed import Client
        from distributed.scheduler import KilledWorker
    except ImportError as error:
        raise ClusterProblem(
            f"--scheduler takes Dask, and {error.name} is missing: 'pip install touchmove[campaign]'"
        ) from error
    for name in ("distributed.client", "distributed.core", "distributed.comm", "tornado.application"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # that a scheduler is lost is said in a sentence
    try:
        with config.set({"distributed.comm.timeouts.connect": CONNECT}):
            opened: Any = Client
            client = opened(address, timeout=CONNECT, set_as_default=False, name="touchmove-campaign")
    except (OSError, ValueError, TimeoutError) as error:
        raise ClusterProblem(f"no Dask scheduler answers at {address}: start it, or name another address") from error
    executor = client.get_executor(pure=False)
    try:
        yield Cluster(
            executor, lambda: sum(client.nthreads().values()) if client.status == "running" else 0,
            str(client.dashboard_link) or None, (KilledWorker,),
        )  # fmt: skip
    finally:
        executor.shutdown(wait=False)
        client.close(timeout=CONNECT)
