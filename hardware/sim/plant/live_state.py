"""The state of a running world, kept on disk tick by tick: a real table stands where it stood after a power cut.

A world that ends in order leaves a snapshot; one that is killed leaves this. The file has two slots that are written
in turn, each with a check sum, so that whatever moment the world is killed in, one of them is whole.
"""

import contextlib
import errno
import os
import struct
import sys
import threading
import zlib
from pathlib import Path
from queue import SimpleQueue
from typing import Final

import mujoco
import numpy as np

from hardware.interfaces import HardwareError
from hardware.sim.plant.snapshot import STATE, Snapshot

LIVE_FILE: Final = "world_live.bin"
_HEAD: Final = struct.Struct("<4sIQQ")
"""Of a slot: magic, CRC-32 of what follows, number of this writing, tick; then the state, as doubles."""
_MAGIC: Final = b"TMLS"
_SUMMED: Final = 8
"""Where in a slot what is summed begins [bytes]."""
SLOTS: Final = 2
ASIDE_PRIORITY: Final = 60
"""In real time: below that of controllers and of the world, above what other programs have."""


class LiveState:
    """Keeps the state of one plant in a file, made anew; a state that lay there is replaced when the new one is whole.

    What was kept survives the process as soon as ``keep`` has returned, or, written aside, some hundred microseconds
    later; not a computer that loses its power before the system has written it to its disk. Raises ``HardwareError`` if
    the file cannot be made, or there is no room for it.
    """

    def __init__(self, path: Path, model: mujoco.MjModel, data: mujoco.MjData, tick: int) -> None:
        self._path, self._model, self._data = path, model, data
        size = mujoco.mj_stateSize(model, STATE)
        self._slot = bytearray(_HEAD.size + 8 * size)
        self._summed = memoryview(self._slot)[_SUMMED:]
        self._state = np.frombuffer(self._slot, dtype="<f8", offset=_HEAD.size)
        self._number, self._file = 0, -1
        self._jobs = SimpleQueue[int | None]()
        self._idle = True
        self._writer: threading.Thread | None = None
        new = path.with_suffix(".new.bin")
        try:
            self._file = os.open(new, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600)
            os.posix_fallocate(self._file, 0, SLOTS * len(self._slot))  # later writes need no more room
            mujoco.mj_getState(model, data, self._state, STATE)
            self._write(tick)
            new.replace(path)
        except OSError as error:
            self._drop()
            new.unlink(missing_ok=True)
            raise HardwareError(
                f"the world cannot keep its state in {path}: {error.strerror}; make room there"
            ) from error

    def write_aside(self) -> None:
        """From here on write in a thread of its own: a file system may let a writer wait while it writes to its disk,
        and a plant in real time cannot. While that thread is not done, ticks are not kept.

        In real time the thread is so, too: who calls this would else wait for the interpreter's lock behind an ordinary
        one that was put off the processor. But it is less urgent than a controller, which it must not keep from its
        tick; who waits for it then leaves it a processor.
        """
        policy, urgency = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK, os.sched_getparam(0).sched_priority
        aside = policy, os.sched_param(min(urgency, ASIDE_PRIORITY))
        self._writer = threading.Thread(target=self._write_all, args=aside, daemon=True)
        self._writer.start()

    def keep(self, tick: int) -> None:
        """The plant is at this tick now."""
        if self._file < 0:
            return
        if self._writer is None:
            mujoco.mj_getState(self._model, self._data, self._state, STATE)
            self._try_to_write(tick)
        elif self._idle:
            self._idle = False
            mujoco.mj_getState(self._model, self._data, self._state, STATE)
            self._jobs.put(tick)

    def end(self) -> None:
        """Another record of the state has taken its place: the file goes."""
        if self._writer is not None:
            self._jobs.put(None)
            self._writer.join()
        self._drop()
        self._path.unlink(missing_ok=True)

    def _write_all(self, policy: int, parameters: os.sched_param) -> None:
        with contextlib.suppress(PermissionError):  # without privileges its maker is an ordinary thread as well
            os.sched_setscheduler(0, policy, parameters)
        while (tick := self._jobs.get()) is not None:
            self._try_to_write(tick)
            self._idle = True

    def _try_to_write(self, tick: int) -> None:
        """A world that cannot keep its state goes on, but leaves none that is old."""
        try:
            self._write(tick)
        except OSError as error:
            print(f"the world's state is no longer kept in {self._path}: {error}", file=sys.stderr, flush=True)
            self._drop()
            with contextlib.suppress(OSError):
                self._path.unlink()

    def _write(self, tick: int) -> None:
        slot = self._slot
        self._number += 1
        _HEAD.pack_into(slot, 0, _MAGIC, 0, self._number, tick)
        _HEAD.pack_into(slot, 0, _MAGIC, zlib.crc32(self._summed), self._number, tick)
        if os.pwrite(self._file, slot, self._number % SLOTS * len(slot)) != len(slot):
            raise OSError(errno.EIO, os.strerror(errno.EIO))

    def _drop(self) -> None:
        if self._file >= 0:
            os.close(self._file)
            self._file = -1


def load_live_state(path: Path) -> Snapshot | None:
    """What a world kept that was killed; None: no such file. Raises ``HardwareError`` if no slot of it is whole."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise HardwareError(f"{path} cannot be read: {error.strerror}") from error
    size = len(content) // SLOTS
    found: dict[int, Snapshot] = {}
    for slot in (content[:size], content[size:]):
        if len(slot) < _HEAD.size or (len(slot) - _HEAD.size) % 8:
            continue
        magic, crc, number, tick = _HEAD.unpack_from(slot)
        if magic == _MAGIC and crc == zlib.crc32(slot[_SUMMED:]):
            state = np.frombuffer(slot, dtype="<f8", offset=_HEAD.size).astype(float)
            found[number] = Snapshot(state, tick, at_rest=False)
    if not found:
        raise HardwareError(f"{path} is not the state of a world: delete it, and start a new game")
    return found[max(found)]
