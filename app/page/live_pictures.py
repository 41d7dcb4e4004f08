"""Pictures of camera and film view while somebody watches: as many as are wanted, none where nobody does."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Final

from app.terminal.shown import View
from hardware.interfaces import HardwareError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from app.terminal.shown import FilmSource

AGAIN: Final = 1.0
"""Pictures that have ended while somebody watches are tried again after this [s, wall]."""
Live = Callable[[View, float], "FilmSource | None"]
"""Opens the pictures of a view, so many a second; None where there are none."""


class LivePictures:
    """Takes pictures in a thread for each view that is watched.

    Args:
        take: told view, picture (h, w, 3) RGB and the plant time of its exposure [s].
    """

    def __init__(self, take: Callable[[View, NDArray[np.uint8], float], None]) -> None:
        self._take = take
        self._live: Live | None = None
        self._tick = 0.0
        self._wanted = dict[View, float]()
        self._running: dict[View, tuple[float, FilmSource]] = {}
        self._lock = threading.Lock()

    def open(self, live: Live, tick: float) -> None:
        """Devices were opened, with a tick of so long [s]; what was wanted before is begun."""
        with self._lock:
            self._live, self._tick = live, tick
            self._follow()

    def want(self, rates: Mapping[View, float]) -> None:
        """So many pictures a second of each view [1/s]."""
        with self._lock:
            self._wanted = dict(rates)
            self._follow()

    def close(self) -> None:
        """Take no more."""
        with self._lock:
            self._live, self._wanted = None, {}
            self._follow()

    def _follow(self) -> None:
        for view in {*self._running, *self._wanted}:
            rate = self._wanted.get(view, 0.0)
            if view in self._running and self._running[view][0] != rate:
                self._running.pop(view)[1].cancel()
            if rate > 0.0 and view not in self._running and self._live is not None:
                with suppress(HardwareError, OSError):  # devices that are going: whoever plays with them says so
                    source = self._live(view, rate)
                    if source is not None:
                        self._running[view] = rate, source
                        threading.Thread(
                            target=self._run, args=(view, source), name=f"{view} live", daemon=True
                        ).start()

    def _run(self, view: View, source: FilmSource) -> None:
        try:
            while (shot := source.next()) is not None:
                self._take(view, shot[0], shot[1] * self._tick)
        finally:
            source.close()
        with self._lock:
            if self._running.get(view, (0.0, None))[1] is not source:
                return  # it was cancelled
            del self._running[view]  # the camera has fallen silent, or its device was closed
        again = threading.Timer(AGAIN, self._begin_again)
        again.daemon = True
        again.start()

    def _begin_again(self) -> None:
        with self._lock:
            self._follow()
