"""What the world does for cameras: single frames, delivered a latency after their exposure, and streams for films.

A single frame lets plant time run until it is due. A stream takes frames of whatever happens, and lets nothing happen;
so do watchers (``hardware.sim.process.cameras.video_stream``), unless they wake the plant up.
"""

import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hardware.interfaces import HardwareError
from hardware.sim.bodies.scene import CAMERAS
from hardware.sim.clients import wire
from hardware.sim.plant.plant import Plant
from hardware.sim.process.cameras.recordings import PositionRecordings, PositionService
from hardware.sim.process.cameras.video_stream import PATIENCE, StreamClient
from hardware.sim.process.connections import Refused, Service, Visitor
from hardware.sim.process.scene_control import SceneControlService
from hardware.sim.process.services import NEVER, SILENCE
from hardware.sim.render.d435 import GLANCE, LEFT_IMAGER, colour_intrinsics, depth_intrinsics
from hardware.sim.render.quality import FILM, LOOK
from hardware.sim.render.renderer import Renderer, RenderRequest, Sensor, frame_path, intrinsics_for, make_slot
from hardware.sim.render.settings import CameraSettings

RGBD = "camera"
"""The view of the board's RGB-D camera; the others show the world to people."""


@dataclass(slots=True, eq=False)
class _View:
    """A camera's client and the one frame, or the stream, that it waits for."""

    visitor: Visitor
    slot: int
    due: int = NEVER
    """Tick of delivery of a single frame, or of a stream's next exposure."""
    exposed: int = 0
    """Tick of the last frame's exposure."""
    drawing: bool = False
    camera: str = ""
    every: int = 0
    """Ticks from frame to frame of a stream; 0 for single frames."""
    taken: bool = True
    """The client of a stream has read its last frame."""

    @property
    def stuck(self) -> bool:
        """A stream's last frame is not drawn or not taken yet."""
        return self.drawing or not self.taken


class CameraService(Service):
    """Frames for cameras: of the board's RGB-D camera, the view ``camera``, and clean pictures of other views.

    ``due`` is the tick at which the next frame is to be exposed or delivered, ``waiting`` whether somebody waits for
    one, so that plant time has to run. ``latency`` is from exposure to delivery [ticks]. ``renderer`` is None in a
    world without cameras; ``seed`` is of the sensors' noise, ``stage`` how light and camera are at the moment.
    """

    def __init__(
        self,
        facts: dict[str, Any],
        plant: Plant,
        renderer: Renderer | None,
        run_dir: Path,
        latency: int,
        camera: CameraSettings,
        seed: int,
        stage: SceneControlService,
    ) -> None:
        super().__init__(facts)
        self.due, self.waiting = NEVER, False
        self._plant, self._renderer, self._run_dir, self._latency = plant, renderer, run_dir, latency
        self._camera, self._seed, self._stage = camera, seed, stage
        self._views: dict[Visitor, _View] = {}
        self._stream_clients: dict[Visitor, StreamClient] = {}
        self._recordings = PositionRecordings(plant, run_dir, stage)
        self.positions = PositionService(facts, self._recordings, self._plan)
        self._slots = 0
        self._free: list[int] = []
        """Slots that nobody has; room is made for no more than are needed at once."""
        self._slots_of: dict[Visitor, list[int]] = {}
        self._owed: set[int] = set()
        """Slots that the renderer is yet to draw into …"""
        self._left: set[int] = set()
        """… of which these were a visitor's who is gone."""
        self._absent, self._lost = "this world was started without cameras", False

    # visitors

    def welcome(self, visitor: Visitor) -> dict[str, Any]:
        """See ``Service``. Where the renderer was lost, another one is started for who comes anew."""
        if self._renderer is None and self._lost:
            print("another renderer is started", file=sys.stderr, flush=True)
            self._renderer = Renderer(self._run_dir, alone=bool(self._facts["lockstep"]))
        if self._renderer is None:
            raise Refused(self._absent)
        (slot,) = self._new_slots(visitor, 1)
        self._views[visitor] = _View(visitor, slot)
        return {**self._facts, "slot": slot, "views": {name: self._describe(name) for name in CAMERAS}}

    def hear(self, visitor: Visitor, message: bytes) -> None:
        """See ``Service``."""
        request = wire.CAMERA_REQUEST.validate_json(message)
        view, client = self._views[visitor], self._stream_clients.get(visitor)
        if client is not None:
            self._hear_watcher(client, request)
        elif isinstance(request, wire.Wake):
            visitor.tell({"error": "only a watcher can wake the plant up: ask to watch first"})
        elif isinstance(request, wire.Taken):
            view.taken = True
        elif isinstance(request, wire.RecordWish | wire.RecordEnd):
            visitor.tell({"error": "the cameras write no positions down: ask for the role positions"})
        elif self._renderer is None:
            visitor.tell({"error": self._absent})
        elif request.camera not in CAMERAS:
            visitor.tell({"error": f"no camera '{request.camera}': there are {', '.join(CAMERAS)}"})
        elif view.due != NEVER:
            visitor.tell({"error": "one frame or stream at a time: this one is under way"})
        elif isinstance(request, wire.Exposure | wire.WatchWish) and request.depth and request.camera != RGBD:
            visitor.tell({"error": f"the view '{request.camera}' has no depth: '{RGBD}' has"})
        elif isinstance(request, wire.WatchWish) and not request.shows_something:
            visitor.tell({"error": "a frame without colour and depth shows nothing: ask for one of them"})
        elif isinstance(request, wire.WatchWish):
            self._watch(view, request)
        elif isinstance(request, wire.Exposure):
            view.due = self._plant.tick + self._latency
            self._draw(view, request.camera, request.depth)
        else:
            view.camera, view.every = request.camera, request.stream_ticks
            view.due = self._after(self._plant.tick, view.every)
        self._plan()

    def _new_slots(self, visitor: Visitor, number: int) -> list[int]:
        while len(self._free) < number:
            slot, self._slots = self._slots, self._slots + 1
            try:
                make_slot(self._run_dir, slot)
            except OSError as error:
                raise Refused(f"there is no room for pictures in {self._run_dir}: {error.strerror}") from error
            self._free.append(slot)
        slots, self._free = self._free[:number], self._free[number:]
        self._slots_of.setdefault(visitor, []).extend(slots)
        return slots

    def leave(self, visitor: Visitor) -> None:
        """See ``Service``."""
        del self._views[visitor]
        self._stream_clients.pop(visitor, None)
        for slot in self._slots_of.pop(visitor):
            if slot in self._owed:  # until it is drawn nobody else can have it
                self._left.add(slot)
            else:
                self._free.append(slot)
        self._plan()

    def _watch(self, view: _View, request: wire.WatchWish) -> None:
        rooms = self._latency // request.watch_ticks + 3  # frames under way, one that is read, one that is begun
        try:
            slots = [view.slot, *self._new_slots(view.visitor, rooms - 1)]
        except Refused as error:
            view.visitor.tell({"error": str(error)})
            return
        first = self._after(self._plant.tick, request.watch_ticks)
        self._stream_clients[view.visitor] = StreamClient(
            view.visitor, request.camera, request.depth, request.watch_ticks, self._latency, slots, first,
            request.colour_asleep, request.glance,
        )  # fmt: skip

    def _hear_watcher(self, client: StreamClient, request: wire.CameraRequest) -> None:
        if isinstance(request, wire.Taken):
            client.take()
        elif isinstance(request, wire.Wake):
            client.wake = request.wake
        else:
            client.visitor.tell({"error": "one frame or stream at a time: this one is under way"})
        self._plan()

    # frames

    def look(self) -> None:
        """Notice frames that were finished meanwhile."""
        while self._drawing and self._take(wait=False):
            pass

    @property
    def awaited(self) -> tuple[int, ...]:
        """Number of the open file that has something to read when a picture is finished, if one is being drawn."""
        return (self._renderer.number,) if self._renderer is not None and self._drawing else ()

    @property
    def _drawing(self) -> bool:
        return any(view.drawing for view in self._views.values()) or any(
            flight.drawing for client in self._stream_clients.values() for flight in client.flights
        )

    def serve(self, waits: bool) -> Iterator[None]:
        """Expose and deliver what is due now.

        Where plant time ``waits`` for frames and their takers (pace fast), each step is a moment for which to hear
        visitors. Where it does not (pace real) there is none: what is not drawn yet is delivered later, and streams
        leave frames out.
        """
        tick = self._plant.tick
        self._recordings.keep()
        for view in [view for view in self._views.values() if view.due <= tick]:
            yield from self._expose(view, waits) if view.every else self._deliver(view, waits)
        for client in [client for client in self._stream_clients.values() if client.due <= tick]:
            yield from self._serve_watcher(client, waits)
        self._plan()

    def _serve_watcher(self, client: StreamClient, waits: bool) -> Iterator[None]:
        tick = self._plant.tick
        flight = client.expose(tick)
        if flight is not None:
            sensed = client.camera == RGBD
            self._request(
                flight.slot, client.camera, client.depth, sensed=sensed, colour=flight.colour, glance=client.glance
            )
        return client.deliver(
            tick, waits, lambda: client.visitor in self._stream_clients and self._renderer is not None
        )

    def close(self) -> None:
        """End the renderer and remove its frames."""
        self._lost = False
        self._recordings.close()
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
        for slot in range(self._slots):
            frame_path(self._run_dir, slot).unlink(missing_ok=True)

    def _deliver(self, view: _View, waits: bool) -> Iterator[None]:
        while waits and view.drawing and view.visitor in self._views:
            yield
        if not view.drawing and view.due != NEVER:
            view.due = NEVER
            view.visitor.tell({"exposed": view.exposed, "tick": self._plant.tick})

    def _expose(self, view: _View, waits: bool) -> Iterator[None]:
        begun = drawn = time.monotonic()
        while waits and view.stuck and view.visitor in self._views:
            yield
            now = time.monotonic()
            if view.drawing:  # by a second renderer, if the first one has ended: that takes seconds
                drawn = now
            if now - drawn > SILENCE or now - begun > PATIENCE:
                view.visitor.dismiss()
        if view.visitor in self._views and view.due != NEVER:
            view.due = self._after(self._plant.tick, view.every)
            if not view.stuck:
                self._draw(view, view.camera, depth=False)

    def _take(self, wait: bool) -> bool:
        """Take one finished frame from the renderer, if there is one; False if not."""
        if self._renderer is None:
            return False
        try:
            slot = self._renderer.take(wait)
        except HardwareError as error:
            self._go_blind(error)
            return False
        if slot is not None:
            self._owed.discard(slot)
            if slot in self._left:
                self._left.remove(slot)
                self._free.append(slot)
        for client in self._stream_clients.values():
            if slot is not None:
                client.drawn(slot)
        for view in self._views.values():
            if view.slot == slot and view.visitor not in self._stream_clients:
                view.drawing = False
                if view.every:
                    view.taken = False
                    view.visitor.tell({"exposed": view.exposed})
        return slot is not None

    def _draw(self, view: _View, camera: str, depth: bool) -> None:
        if self._renderer is None:
            return
        view.drawing, view.exposed = True, self._plant.tick
        # streams are for people: clean pictures, quickly drawn
        self._request(view.slot, camera, depth, sensed=camera == RGBD and not view.every, filmed=view.every > 0)

    def _request(
        self, slot: int, camera: str, depth: bool, sensed: bool, colour: bool = True, *, glance: bool = False,
        filmed: bool = False,
    ) -> None:  # fmt: skip
        if self._renderer is None:
            return
        tick = self._plant.tick
        sensor = None
        if sensed:
            sensor = Sensor(camera=self._camera, seed=self._seed, tick=tick, depth=depth, colour=colour, glance=glance)
        shot = RenderRequest(
            slot=slot, view=camera, looks=self._stage.looks, sensor=sensor, quality=FILM if filmed else LOOK
        )
        self._owed.add(slot)
        try:
            self._renderer.request(shot, self._plant.positions())
        except HardwareError as error:
            self._go_blind(error)

    def _go_blind(self, error: HardwareError) -> None:
        """The renderer is lost. The arm goes on: it does not need to be seen."""
        print(f"no more pictures: {error}", file=sys.stderr, flush=True)
        self._absent, self._lost = str(error), True
        self._free.extend(sorted(self._left))
        self._left.clear()
        self._owed.clear()
        if self._renderer is not None:
            self._renderer.close(patience=0.0)
            self._renderer = None
        for view in self._views.values():
            if view.due != NEVER:
                view.due, view.drawing = NEVER, False
                view.visitor.tell({"error": self._absent})
        for visitor in self._stream_clients:
            visitor.tell({"error": self._absent})
        self._stream_clients.clear()

    def _describe(self, view: str) -> dict[str, Any]:
        """What a client has to know about a view: pinholes, and where depth is seen from [m] in which units [m]."""
        if view != RGBD:
            return {"colour": asdict(intrinsics_for(CAMERAS[view].field_of_view)), "depth": None}
        colour = colour_intrinsics(self._camera.width, self._camera.height)
        depth = {
            "pinhole": asdict(depth_intrinsics()), "glance": asdict(depth_intrinsics(GLANCE)), "offset": LEFT_IMAGER,
            "unit": self._camera.depth_unit,
        }  # fmt: skip
        return {"colour": asdict(colour), "depth": depth}

    def _plan(self) -> None:
        views, stream_clients = self._views.values(), self._stream_clients.values()
        dues = [*(view.due for view in views), *(client.due for client in stream_clients)]
        self.due = min([self._recordings.due(NEVER), *dues])
        alone = any(view.due != NEVER and not view.every for view in views)
        self.waiting = alone or any(client.wake for client in stream_clients)

    @staticmethod
    def _after(tick: int, every: int) -> int:
        """The first multiple of ``every`` after a tick."""
        return (tick // every + 1) * every
