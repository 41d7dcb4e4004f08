"""Real time for the controller's process, as its settings ask for it and its bus allows."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Protocol, runtime_checkable

from controller.records.stderr import say_at_once
from controller.settings import ControllerSettings
from hardware.interfaces import ServoBus
from hardware.realtime import RealTime, quiet_memory, real_time

_NOT_WANTED = RealTime(scheduled=False, locked=False, pinned=False, awake=False, notes=())


@runtime_checkable
class SerialBus(Protocol):
    """A ``ServoBus`` by a serial port."""

    by_serial_port: bool


@contextlib.contextmanager
def set_up_real_time(settings: ControllerSettings, bus: ServoBus) -> Iterator[RealTime]:
    """Real time while the loop runs: SCHED_FIFO, locked memory, a core of its own, a frozen garbage collector.

    What the system does not grant is said on stderr, with the remedy, and the loop runs without it. On a lockstep bus
    nothing can be late, and the loop would take the processor from the plant: there only the garbage collector is
    frozen, as where the settings ask for no real time.

    Args:
        settings: whether, which priority, which core.
        bus: whether plant time waits for the controller, and whether its answers come by a serial port.

    Yields:
        What was granted.
    """
    if bus.lockstep or not settings.realtime:
        with quiet_memory():
            yield _NOT_WANTED
        return
    serial = isinstance(bus, SerialBus) and bus.by_serial_port
    with real_time("the controller", settings.priority, settings.core, serial=serial) as granted:
        for note in granted.notes:
            say_at_once(f"{note}; until then the controller runs without it, and may miss ticks on a busy PC")
        yield granted
