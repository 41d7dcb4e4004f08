"""Has a world write down where everything is, for a film that is drawn later."""

import contextlib
import json
from pathlib import Path

from hardware.sim.clients import wire


class TrajectoryRecording(wire.WorldClient):
    """The world writes frames into a new file, from now until this is closed or the world ends."""

    def __init__(self, run_dir: Path, path: Path, ticks: int) -> None:
        """Begin.

        Args:
            run_dir: of the world; ``HardwareError`` where none answers, or it cannot write the file.
            path: of the file, which must not be there yet; on the world's own computer.
            ticks: a frame at every multiple of so many.
        """
        super().__init__(run_dir, "positions")
        with contextlib.ExitStack() as failing:
            failing.callback(self.close)
            wire.ask(self._link, {"record": str(path.absolute()), "record_ticks": ticks})
            failing.pop_all()

    def finish(self) -> None:
        """End the file, with what was written up to now; a world that is gone has ended it."""
        with contextlib.suppress(OSError):
            self._link.send(json.dumps({"recorded": True}).encode())
            self._link.recv(wire.LARGEST_MESSAGE)
        self.close()
