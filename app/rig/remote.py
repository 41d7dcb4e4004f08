"""A rig whose controller was started by somebody else, perhaps on another computer; a rig file says where it is.

The controller stays when the game ends: it holds the arm, and after a while puts it on its brakes by itself.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Final, Self

from app.rig.arm import Arm, ControllerArm
from app.rig.attach import attach
from app.rig.devices import EndState, RigFailed, Watched
from app.rig.rig_file import RigFile
from app.rig.steady_frames import SteadyFrames
from controller.protocol.key import KeyFileError, load_key
from controller.protocol.states import State
from controller.wire.client import ControllerClient
from controller.wire.errors import ControllerError
from controller.wire.link import Listener
from hardware.camera.factory import open_camera
from hardware.interfaces import Camera, Clock, HardwareError
from hardware.sim.clients.camera import SimCamera, SimClock
from hardware.sim.clients.referee import SimReferee
from hardware.sim.clients.video_stream import SimWatchCamera
from hardware.sim.clients.wire import world_pid

RESTING: Final = 0.005
"""A tool slower than this is at rest [m/s]: the noise of the encoders makes less than a tenth of it."""


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
    """Devices behind a controller that runs already. Use as a context manager."""

    def __init__(self, rig: RigFile, progress: Callable[[str], None], listener: Listener | None = None) -> None:
        """Connect; returns when the arm holds.

        Args:
            rig: says where the controller is.
            progress: told what is being waited for.
            listener: called with each telemetry of the controller, in a thread of its own.

        Raises:
            RigFailed: the key cannot be read, the controller does not answer or stands on its brakes after a fault.
        """
        section = rig.controller
        try:
            key = load_key(section.key)
        except KeyFileError as error:
            raise RigFailed(str(error)) from error
        self._client = ControllerClient(section.host, section.port, key, name="touchmove game", listener=listener)
        self.arm: Arm
        self.clock: Clock = RemoteClock(self._client)
        self.camera: Camera | None = None
        self.referee: SimReferee | None = None
        self._world = rig.run_dir if rig.simulated else None
        self._left = False
        try:
            attach(self._client, progress, forgive=False)
            self.arm = ControllerArm(self._client, progress)
            if rig.simulated:
                self.clock, self.referee = SimClock(rig.run_dir), SimReferee(rig.run_dir)
                self.camera = SimCamera(rig.run_dir) if rig.world_section.cameras else None
            else:
                self.camera = open_camera(rig.lab_camera, self.clock)
        except (ControllerError, HardwareError) as error:
            self.close()
            raise RigFailed(str(error)) from error
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def watched(self) -> Watched | None:
        """See ``Rig.watched``."""
        camera = self.camera
        if camera is None:
            return None
        if self._world is not None:
            world = self._world
            return Watched(lambda interval: SimWatchCamera(world, interval, colour_asleep=False), self._client)
        return Watched(lambda _: SteadyFrames(camera), self._client)

    def failure(self) -> str | None:
        """A sentence on a controller that does not answer any more or a world that has ended; none once it is left."""
        if self._left:
            return None
        if self._world is not None and world_pid(self._world) is None:
            return f"the simulated world has ended: start the controller of {self._world} again"
        try:
            self._client.telemetry  # noqa: B018  # asked for its error alone
        except ControllerError as error:
            return str(error)
        return None

    def close(self) -> EndState | None:
        """Stop the arm, which the controller goes on holding, and leave; a second call finds nobody to ask."""
        try:
            self._client.stop()
            telemetry = self._client.wait_standing()
            self._left = True
        except ControllerError:
            return None
        finally:
            self._client.close()
            if self.camera is not None:
                self.camera.close()
            for device in (self.referee, self.clock):
                if isinstance(device, (SimClock, SimReferee)):
                    device.close()
        speed = math.hypot(*telemetry.velocity)
        return EndState(telemetry.state is not State.STOPPING and speed < RESTING, speed)
