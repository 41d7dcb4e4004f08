"""Positions that are written down while plant time runs, so that a film can be drawn later: nothing waits for them."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hardware.sim.clients import wire
from hardware.sim.plant.plant import Plant
from hardware.sim.plant.trajectory import TrajectoryHeader, TrajectoryWriter
from hardware.sim.process.connections import Service, Visitor
from hardware.sim.process.scene_control import SceneControlService
from hardware.sim.process.settings import load_settings


@dataclass(slots=True, eq=False)
class _OpenFile:
    file: TrajectoryWriter
    every: int
    """Ticks from frame to frame."""
    due: int
    """Tick of the next frame."""


class PositionRecordings:
    """The files of visitors who want positions written down; ``stage`` tells how light and camera are."""

    def __init__(self, plant: Plant, run_dir: Path, stage: SceneControlService) -> None:
        self._plant, self._run_dir, self._stage = plant, run_dir, stage
        self._files: dict[Visitor, _OpenFile] = {}

    def due(self, never: int) -> int:
        """Tick of the next frame; ``never`` where nobody wants any."""
        return min((one.due for one in self._files.values()), default=never)

    def hear(self, visitor: Visitor, request: wire.RecordWish | wire.RecordEnd) -> None:
        """Begin or end a visitor's file."""
        if isinstance(request, wire.RecordEnd):
            self.end(visitor)
        elif visitor in self._files:
            visitor.tell({"error": "one recording at a time: this one is under way"})
            return
        else:
            try:
                self._begin(visitor, request)
            except OSError as error:
                visitor.tell({"error": f"{request.record}: {error.strerror}"})
                return
        visitor.tell({})

    def _begin(self, visitor: Visitor, request: wire.RecordWish) -> None:
        header = TrajectoryHeader(
            period=self._plant.parameters.drive.tick, every=request.record_ticks,
            positions=len(self._plant.positions()), world=load_settings(self._run_dir).model_dump(mode="json"),
        )  # fmt: skip
        self._files[visitor] = _OpenFile(TrajectoryWriter(request.record, header), request.record_ticks, 0)
        self.keep()

    def keep(self) -> None:
        """Write down what is due. A full disk ends a recording, and not the game."""
        tick = self._plant.tick
        for visitor in [visitor for visitor, one in self._files.items() if one.due <= tick]:
            one = self._files[visitor]
            one.due = (tick // one.every + 1) * one.every
            try:
                one.file.keep(tick, self._plant.positions(), self._stage.looks.model_dump_json())
            except OSError as error:
                print(f"no more positions for a film: {error.strerror}", file=sys.stderr, flush=True)
                self.end(visitor)

    def end(self, visitor: Visitor) -> None:
        """End a visitor's file, if there is one."""
        if (one := self._files.pop(visitor, None)) is not None:
            one.file.close()

    def close(self) -> None:
        """End all files."""
        for visitor in list(self._files):
            self.end(visitor)


class PositionService(Service):
    """Positions for who wants them written down, also in a world without cameras: role ``positions``.

    ``planned`` is called whenever another frame may be due.
    """

    def __init__(self, facts: dict[str, Any], recordings: PositionRecordings, planned: Callable[[], None]) -> None:
        super().__init__(facts)
        self._recordings, self._planned = recordings, planned

    def hear(self, visitor: Visitor, message: bytes) -> None:
        """See ``Service``."""
        request = wire.CAMERA_REQUEST.validate_json(message)
        if isinstance(request, wire.RecordWish | wire.RecordEnd):
            self._recordings.hear(visitor, request)
            self._planned()
        else:
            visitor.tell({"error": "here positions are written down: ask the cameras for pictures"})

    def leave(self, visitor: Visitor) -> None:
        """See ``Service``."""
        self._recordings.end(visitor)
        self._planned()
