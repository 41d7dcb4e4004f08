"""Every command that a world's drives were given, tick by tick: a run can be done again without a controller."""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.interfaces import Command, HardwareError
from hardware.sim.clients import wire
from hardware.sim.plant.plant import Plant

JOURNAL_FILE: Final = "commands.bin"
_ENTRY: Final = struct.Struct(f"<BB{wire.COMMAND.size}s")
"""Whether the watchdog tripped before this tick, whether there was a command, the command as on the wire."""
_NOTHING: Final = bytes(wire.COMMAND.size)


class Journal:
    """What happened to the drives, in memory until it is written; 35 bytes a tick."""

    def __init__(self) -> None:
        self._entries = bytearray()
        self._tripped = False

    def tripped(self) -> None:
        """The watchdog braked the drives; before the next tick."""
        self._tripped = True

    def ran(self, command: Command | None) -> None:
        """A tick ran, with a new command or under the last one."""
        message = _NOTHING if command is None else wire.pack_command(command)
        self._entries += _ENTRY.pack(self._tripped, command is not None, message)
        self._tripped = False

    def write(self, run_dir: Path) -> None:
        """Leave it in the run directory."""
        (run_dir / JOURNAL_FILE).write_bytes(self._entries)


class Replay:
    """The journal in a run directory, done again on another plant; ``HardwareError``: there is none, or half of one."""

    def __init__(self, run_dir: Path) -> None:
        path = run_dir / JOURNAL_FILE
        try:
            content = path.read_bytes()
        except OSError as error:
            raise HardwareError(f"no journal at {path}: the world was not asked to keep one") from error
        if len(content) % _ENTRY.size:
            raise HardwareError(f"{path} has {len(content)} bytes, no multiple of {_ENTRY.size}: it was cut off")
        self._entries: list[tuple[bool, Command | None]] = [
            (bool(tripped), wire.unpack_command(message) if given else None)
            for tripped, given, message in _ENTRY.iter_unpack(content)
        ]

    def __len__(self) -> int:
        """Ticks."""
        return len(self._entries)

    def run(self, plant: Plant) -> None:
        """Do all of it, on a plant in the state in which the world began."""
        for tripped, command in self._entries:
            if tripped:
                plant.trip_watchdog()
            if command is not None:
                plant.apply(command)
            plant.step()

    def run_watched(self, plant: Plant, watch: Callable[[], None]) -> list[NDArray[np.float64]]:
        """As ``run``, with a look after each step; what acted in each step, for ``step_alone``."""
        acting = list[NDArray[np.float64]]()

        def look() -> None:
            watch()
            acting.append(np.concatenate((plant.data.ctrl, plant.model.dof_frictionloss)))

        plant.watch_step = look
        self.run(plant)
        return acting


def step_alone(plant: Plant, acting: list[NDArray[np.float64]]) -> None:
    """From the start of a plant the same steps by MuJoCo alone, without drives; ticks are not counted."""
    model, data = plant.model, plant.data
    controls, last = len(data.ctrl), np.empty(0)
    for one in acting:
        if not np.array_equal(one, last):
            data.ctrl[:], model.dof_frictionloss[:] = one[:controls], one[controls:]
            last = one
        mujoco.mj_step(model, data)
