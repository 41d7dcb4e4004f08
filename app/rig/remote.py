"""A rig whose controller was started by somebody else, perhaps on another computer; a rig file says where it is.

The controller stays when the game ends: it holds the arm, and after a while puts it on its brakes by itself.
"""

import math
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Final, Self

from app.rig.arm import Arm, ControllerArm
from app.rig.attach import attach
from app.rig.devices import EndState, GuardFeed, PositionRecording, RigFailed
from app.rig.rig_file import RigFile
from app.rig.steady_frames import CameraPictures, SteadyFrames
from app.terminal.shown import FilmSource, View
from controller.protocol.key import KeyFileError
from controller.protocol.states import State
from controller.wire.client import ControllerClient
from controller.wire.errors import ControllerError
from controller.wire.link import Listener
from hardware.camera.factory import open_camera
from hardware.interfaces import Camera, Clock, HardwareError, Pace
from hardware.referee import Referee
from hardware.sim.clients.camera import FrameStream, SimCamera, SimClock
from hardware.sim.clients.referee import SimReferee
from hardware.sim.clients.trajectory import TrajectoryRecording
from hardware.sim.clients.video_stream import SimWatchCamera
from hardware.sim.clients.wire import world_pid
from hardware.sim.render.d435 import GLANCE, LEFT_IMAGER, depth_intrinsics

RESTING: Final = 0.005
"""A tool slower than this is at rest [m/s]: the noise of the encoders makes less than a tenth of it."""

FILM_TICKS: Final = 45
"""A frame of a film each so many ticks of 0.88 ms: 25 a second."""
LIVE_TICKS: Final = {Pace.FAST: 45, Pace.REAL: 135}
"""Of what is drawn while the game goes on; in pace real 8 a second, to leave the cores to the plant."""


class RemoteClock:
    """``Clock`` of a lab: plant time is what the controller's ticks say, and it passes as wall time does."""

    def __init__(self, client: ControllerClient) -> None:
        self._client = client

    def now(self) -> float:
        """Plant time [s]."""
        return self._client.telemetry.tick * self._client.period

    def sleep(self, duration: float) -> None:
        """Wait."""
        time.sleep(max(0.0, duration))


class RemoteRig:
    """Devices behind a controller that runs already; its ``client`` serves who has to stop it. A context manager."""

    client: ControllerClient
    controller: tuple[str, int, Path]
    arm: Arm
    clock: Clock
    camera: Camera | None
    referee: Referee | None

    def __init__(self, rig: RigFile, progress: Callable[[str], None], listener: Listener | None = None) -> None:
        """Connect; returns when the arm holds. The listener is called with each telemetry, in a thread of its own.

        Raises ``RigFailed`` if the key cannot be read, or the controller does not answer or stands on its brakes after
        a fault.
        """
        self._rig, self._left = rig, False
        try:
            self._connect(progress, listener, forgive=False)
        except (ControllerError, KeyFileError, HardwareError) as error:
            raise RigFailed(str(error)) from error

    def _connect(self, progress: Callable[[str], None], listener: Listener | None, *, forgive: bool) -> None:
        """Take the arm over, see ``attach``, and open what else there is; nothing is left open where that fails."""
        rig = self._rig
        with ExitStack() as devices:
            host, port, key = rig.address()
            self.client = ControllerClient(host, port, key, name="touchmove game", listener=listener)
            self.controller = host, port, rig.controller.key
            failing = devices.enter_context(ExitStack())
            failing.callback(self.client.close)
            attach(self.client, progress, forgive=forgive)
            self.arm = ControllerArm(self.client, progress)
            if rig.simulated:
                self.clock = devices.enter_context(closing(SimClock(rig.run_dir)))
                self.referee = devices.enter_context(closing(SimReferee(rig.run_dir)))
            else:
                self.clock, self.referee = RemoteClock(self.client), None
            self.camera = open_board_camera(rig, self.clock)
            if self.camera is not None:
                devices.callback(self.camera.close)
            failing.pop_all()
            self._devices = devices.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def guard_feed(self) -> GuardFeed | None:
        """See ``Rig.guard_feed``."""
        camera, world = self.camera, self._rig.run_dir
        if camera is None:
            return None
        if self._rig.simulated:
            return GuardFeed(
                lambda interval: SimWatchCamera(world, interval, glance=True), self.client,
                lambda view: view.beside(depth_intrinsics(GLANCE), LEFT_IMAGER),
            )  # fmt: skip
        return GuardFeed(lambda _: SteadyFrames(camera), self.client)

    def film(self, view: View = "film", rate: float | None = None) -> FilmSource | None:
        """See ``Rig.film``."""
        rig = self._rig
        if view == "camera" and self.camera is not None and not rig.simulated:
            return CameraPictures(self.camera, rate, self.client.period)
        if not (rig.simulated and rig.sees) or (view == "camera" and rig.pace is Pace.FAST):
            return None
        ticks = LIVE_TICKS[rig.pace] if rate is None else max(1, round(1.0 / (rate * self.client.period)))
        return FrameStream(rig.run_dir, view, ticks)

    def record_positions(self, path: Path) -> PositionRecording | None:
        """See ``Rig.record_positions``."""
        rig = self._rig
        return TrajectoryRecording(rig.run_dir, path, FILM_TICKS) if rig.simulated else None

    def failure(self) -> str | None:
        """A sentence on a controller that does not answer any more or a world that has ended; none once it is left."""
        if self._left:
            return None
        if self._rig.simulated and world_pid(self._rig.run_dir) is None:
            return f"the simulated world has ended: start the controller of {self._rig.run_dir} again"
        try:
            self.client.telemetry  # noqa: B018  # asked for its error alone
        except ControllerError as error:
            return str(error)
        return None

    def close(self) -> EndState | None:
        """Stop the arm, which the controller goes on holding, and leave; a second call finds nobody to ask."""
        try:
            self.client.stop()
            telemetry = self.client.wait_standing()
            self._left = True
        except ControllerError:
            return None
        finally:
            self.client.close()
            self._devices.close()
        speed = math.hypot(*telemetry.velocity)
        return EndState(telemetry.state is not State.STOPPING and speed < RESTING, speed)


def open_board_camera(rig: RigFile, clock: Clock) -> Camera | None:
    """The camera that looks at a rig's board, alone; None where there is none. A simulated rig has to run.

    The clock is of a lab's camera. Raises ``HardwareError`` if it is not there or does not work.
    """
    if not rig.simulated:
        return open_camera(rig.lab_camera, clock)
    return SimCamera(rig.run_dir) if rig.sees else None
