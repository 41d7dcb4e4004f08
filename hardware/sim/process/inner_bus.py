"""Drives of a simulated world that runs in the thread of its controller: direct calls, no messages."""

from hardware.interfaces import BusLost, Command, Measurement, PlantCall, Stretch
from hardware.sim.process.server import World


class InnerServoBus:
    """``ServoBusInThread`` of a world in pace fast, which serves its other visitors whenever it is called."""

    lockstep = True

    def __init__(self, world: World) -> None:
        """Take the drives; nobody else gets them while this world lasts."""
        self._world = world
        self._said: Measurement = world.plant.measure(standing=False)
        self.period = world.plant.parameters.drive.tick
        self._closed = False
        world.hold_drives()

    def exchange(self, command: Command) -> Measurement:
        """See ``ServoBus.exchange``."""
        if self._closed:
            raise BusLost("the simulated drives were given up")
        self._world.exchange(command, self._take)
        return self._said

    def run(self, controller: PlantCall, most: int, busy: bool) -> Stretch:
        """See ``ServoBusInThread.run``."""
        return self._world.run_plainly(controller, most, busy)

    def hear(self, seconds: float) -> None:
        """See ``ServoBusInThread.hear``."""
        self._world.listen(seconds)

    def close(self) -> None:
        """See ``ServoBus.close``; the world comes to rest on its brakes as it closes."""
        self._closed = True

    def _take(self, measurement: Measurement) -> None:
        self._said = measurement
