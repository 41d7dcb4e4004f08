"""The controller's telemetry for browsers, by one listener however many watch; and STOP, straight to the controller."""

from __future__ import annotations

import asyncio
import math
import threading
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

from app.page.live.hub import Hub
from app.page.live.people import People
from controller.protocol.causes import Cause
from controller.protocol.key import KeyFileError, load_key
from controller.protocol.messages import Telemetry
from controller.protocol.states import State
from controller.wire.errors import ControllerError
from controller.wire.listener import TelemetryWatch

PERIOD: Final = 0.05
"""From one telemetry that is told to the next [s, wall]."""
AGAIN: Final = 1.0
"""A controller that does not answer is looked for so often [s, wall]."""
PATIENCE: Final = 2.0
"""A STOP that was not carried out within so long is said to be so [s, wall]."""
ON_BRAKES: Final = frozenset({State.BOOT, State.FAULT, State.OFF})
"""The arm rests on its brakes, or is on its way there: nothing is left to be stopped."""
WORDS: Final[Mapping[State, str]] = {
    State.BOOT: "on its brakes, getting ready",
    State.HOLD: "holds still",
    State.TRACK: "moves",
    State.STOPPING: "comes to rest",
    State.FAULT: "on its brakes until the fault is cleared",
    State.OFF: "is coming to rest on its brakes",
}
_DIGITS: Final = 6


def telemetry_shown(telemetry: Telemetry, tick: float) -> dict[str, Any]:
    """The fields of the message ``telemetry``, with ticks of so many seconds; a number that is not finite is null."""
    return {
        "t": round(telemetry.tick * tick, 4), "tool": _finite(telemetry.position),
        "reference": _finite(telemetry.reference), "velocity": _finite(telemetry.velocity),
        "angles": _finite(telemetry.angle), "finger": _number(telemetry.finger_position),
        "tactile": _finite(telemetry.tactile), "force": _finite(telemetry.force),
        "torque": _finite(telemetry.torque), "state": telemetry.state.name.lower(), "word": in_words(telemetry),
        "motion": telemetry.motion, "executed": telemetry.executed, "late": _number(telemetry.lateness),
        "work": _number(telemetry.work), "stopped": telemetry.latched,
    }  # fmt: skip


def in_words(telemetry: Telemetry) -> str:
    """What the arm does, for people, and why where it had to stop."""
    if telemetry.latched:
        return "stopped until somebody says 'go'"
    words = WORDS[telemetry.state]
    if telemetry.cause is Cause.NONE:
        return words
    return f"{words}: {telemetry.explain_cause()}"


class TelemetryFeed:
    """Listens to the controller of a game, wherever that is just now.

    Args:
        hub: is told telemetry.
        people: may stop the arm while the controller answers.
    """

    def __init__(self, hub: Hub, people: People) -> None:
        self._hub, self._people = hub, people
        self._tick = 0.0
        self._address: tuple[str, int, str] | None = None
        self._watch: TelemetryWatch | None = None
        self._told: Telemetry | None = None
        self._pressing: asyncio.Task[str | None] | None = None
        self._search: threading.Event | None = None
        self._finding = threading.Lock()
        # of its own: whoever has records looked through keeps no STOP waiting
        self._stopper = ThreadPoolExecutor(1, "stop")

    def listen(self, address: tuple[str, int, str] | None, tick: float) -> None:
        """Listen to a controller from now on: its host, UDP port and key file; None: there is none."""
        self._tick = tick
        if address == self._address:
            return
        self.close()
        self._address = address
        if address is not None:
            self._search = threading.Event()
            threading.Thread(target=self._find, args=(address, self._search), name="find", daemon=True).start()

    def close(self) -> None:
        """Listen no more."""
        self._address = None
        with self._finding:
            if self._search is not None:
                self._search.set()
            watch, self._watch = self._watch, None
        if watch is not None:
            watch.close()
        self._told = None

    @property
    def newest(self) -> Telemetry | None:
        """What the controller said last; None: it is silent."""
        try:
            return None if self._watch is None else self._watch.telemetry
        except ControllerError:
            return None

    @property
    def at_rest(self) -> bool:
        """Whether there is nothing to be stopped: no controller answers, or the arm is on its brakes."""
        newest = self.newest
        return newest is None or newest.state in ON_BRAKES

    async def run(self) -> None:
        """Tell telemetry to who watches it, for good."""
        while True:
            await asyncio.sleep(PERIOD)
            newest = self.newest
            stop = None if newest is None else self.stop
            if stop != self._people.stop:
                self._people.stop = stop
                self._people.show()
            if newest is not None and newest is not self._told and self._hub.watched("telemetry"):
                self._told = newest
                self._hub.telemetry(telemetry_shown(newest, self._tick))

    async def stop(self) -> str | None:
        """Stop the arm; a sentence where nobody knows that it was. Who presses meanwhile waits for the same answer."""
        if self._pressing is None or self._pressing.done():
            self._pressing = asyncio.create_task(self._press())
        return await asyncio.shield(self._pressing)

    async def _press(self) -> str | None:
        watch = self._watch
        if watch is None:
            return "there is no controller to stop"
        try:
            loop = asyncio.get_running_loop()
            await loop.run_in_executor(self._stopper, watch.stop, PATIENCE)
        except ControllerError as error:
            return f"the arm may still move: {error}"
        return None

    def _find(self, address: tuple[str, int, str], over: threading.Event) -> None:
        """The thread: connect, as soon as the controller can be reached."""
        host, port, key_file = address
        while not over.is_set():
            try:
                watch = TelemetryWatch(host, port, load_key(Path(key_file)))
                watch.connect(AGAIN)
            except (ControllerError, KeyFileError):
                over.wait(AGAIN)
                continue
            with self._finding:
                if not over.is_set():
                    self._watch = watch
                    return
            watch.close()
            return


def _finite(values: Iterable[float]) -> list[float | None]:
    return [_number(value) for value in values]


def _number(value: float) -> float | None:
    return round(value, _DIGITS) if math.isfinite(value) else None
