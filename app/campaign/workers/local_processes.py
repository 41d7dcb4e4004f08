"""Workers on this machine: an ``Executor`` whose every worker is a process of its own.

The pool of the standard library ends all of its workers where one of them dies; here the others go on, and it is known
whose task it was. A worker plays one game at a time, ends after some, and ends with the program that has started it.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import queue
import signal
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from types import FrameType
from typing import Any, Final, ParamSpec, TypeVar

from app.campaign.troubles import MachineTrouble
from app.campaign.workers.threads import ONE_THREAD

P = ParamSpec("P")
T = TypeVar("T")

MOST_TASKS: Final = 25
"""A worker ends after this many tasks, so that nothing its libraries leak adds up: a game watched by the camera left
some 30 MB behind (measured over three games); a new worker takes 3 s."""
PATIENCE: Final = 30.0
"""For a worker that is told to end: an arm comes to rest first [s, wall]."""
_SPAWN: Final = multiprocessing.get_context("spawn")
_Item = tuple[Future[Any], Callable[[], Any]]


class WorkerDied(BrokenExecutor):
    """A worker's process was killed or has crashed while it did this task."""


class LocalWorkers(Executor):
    """So many workers.

    Args:
        workers: how many.
        most_tasks: of one process; then another one takes its place.
    """

    def __init__(self, workers: int, most_tasks: int = MOST_TASKS) -> None:
        self._items: queue.SimpleQueue[_Item | None] = queue.SimpleQueue()
        self._most_tasks = most_tasks
        self._ending = False
        self._slots = [_Slot() for _ in range(workers)]
        self._threads = [threading.Thread(target=self._serve, args=(slot,), daemon=True) for slot in self._slots]
        for thread in self._threads:
            thread.start()

    @property
    def pids(self) -> list[int]:
        """Of the processes that there are."""
        return [process.pid for slot in self._slots if (process := slot.process) is not None and process.pid]

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """See ``Executor.submit``; what is called, and with what, has to be picklable."""
        if self._ending:
            raise RuntimeError("the workers have ended: nothing more can be submitted")
        future: Future[T] = Future()
        self._items.put((future, _Call(fn, args, kwargs)))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """See ``Executor.shutdown``."""
        self._ending = True
        while cancel_futures:
            try:
                item = self._items.get_nowait()
            except queue.Empty:
                break
            if item is not None:
                item[0].cancel()
        for _ in self._threads:
            self._items.put(None)
        if wait:
            for thread in self._threads:
                thread.join()

    def stop(self) -> None:
        """Break off what is being done, in good order, and end."""
        self._ending = True
        for slot in self._slots:
            slot.tell_to_end()
        self.shutdown(wait=False, cancel_futures=True)
        for thread, slot in zip(self._threads, self._slots, strict=True):
            thread.join(PATIENCE)
            slot.kill()
            thread.join()

    def _serve(self, slot: _Slot) -> None:
        """A worker's thread: hands one thing after the other to its process."""
        done = 0
        while (item := self._items.get()) is not None:
            future, call = item
            if self._ending or not future.set_running_or_notify_cancel():
                future.cancel()
                continue
            if done >= self._most_tasks:
                slot.end()
            done = done + 1 if slot.process is not None else 1
            try:
                answered, value = slot.ask(call)
            except (EOFError, ConnectionError):
                future.set_exception(WorkerDied(slot.bury()))
            except Exception as error:  # what cannot be pickled is a fault of whoever has submitted it
                future.set_exception(error)
            else:
                (future.set_result if answered else future.set_exception)(value)
        slot.end()


class _Call:
    """A function with its arguments."""

    def __init__(self, function: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> None:
        self._function, self._args, self._kwargs = function, args, kwargs

    def __call__(self) -> Any:
        return self._function(*self._args, **self._kwargs)


class _Slot:
    """The process of a worker; None until it is needed."""

    def __init__(self) -> None:
        self.process: SpawnProcess | None = None
        self._link: Connection | None = None

    def ask(self, call: Callable[[], Any]) -> tuple[bool, Any]:
        """Have something done: whether it gave an answer, or else raised something; and that.

        Raises:
            EOFError: the process died.
            MachineTrouble: none can be started now.
        """
        if self._link is None:
            self._start()
        assert self._link is not None
        self._link.send(call)
        answer: tuple[bool, Any] = self._link.recv()
        return answer

    def _start(self) -> None:
        theirs: Connection | None = None
        try:
            self._link, theirs = _SPAWN.Pipe()
            process = _SPAWN.Process(target=_work, args=(theirs,), name="campaign worker", daemon=True)
            process.start()
        except OSError as error:  # no more open files, processes or memory
            self._forget()
            raise MachineTrouble(f"a worker cannot be started ({error.strerror})") from error
        finally:
            if theirs is not None:
                theirs.close()
        self.process = process  # only now: what has not started cannot be waited for

    def bury(self) -> str:
        """What became of a process that died."""
        process = self.process
        self._forget()
        assert process is not None, "only a started process can die"
        process.join()
        code = process.exitcode or 0
        how = f"was killed ({signal.Signals(-code).name})" if code < 0 else f"ended with status {code}"
        return f"the worker of process {process.pid} {how}"

    def tell_to_end(self) -> None:
        """Break off what it does."""
        if self.process is not None and self.process.is_alive():
            self.process.terminate()

    def end(self) -> None:
        """Let it go: it has nothing to do."""
        process = self.process
        self._forget()
        if process is not None:
            process.join(PATIENCE)

    def kill(self) -> None:
        """Nothing is waited for any more."""
        if self.process is not None and self.process.is_alive():
            self.process.kill()

    def _forget(self) -> None:
        if self._link is not None:
            self._link.close()
        self.process, self._link = None, None


def _work(link: Connection) -> None:
    """Body of a worker's process: does what it is told until nobody is there any more.

    Ctrl-C at the terminal, and its end, reach it too, and are not for it: who has started it decides. SIGTERM breaks
    off what is being done, and ends it.
    """
    os.environ.update(ONE_THREAD)  # before anything is loaded that counts cores
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    busy = threading.Event()

    def end(_number: int, _frame: FrameType | None) -> None:
        if busy.is_set():
            raise KeyboardInterrupt
        os._exit(0)

    signal.signal(signal.SIGTERM, end)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with contextlib.suppress(EOFError, OSError):  # whoever has asked is gone
        while True:
            call = link.recv()
            busy.set()
            answer = _answer(call)
            busy.clear()
            link.send(answer)


def _answer(call: Callable[[], Any]) -> tuple[bool, Any]:
    try:
        return True, call()
    except BaseException as error:
        return False, error


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os.kill(os.getpid(), signal.SIGTERM)
