"""What a simulated rig is started with."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

from controller.settings import ControllerSettings
from hardware.sim.process.settings import WorldSettings


class SimRigSettings(BaseModel):
    """A simulated rig: its world and its controller."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    world: WorldSettings
    controller: ControllerSettings = ControllerSettings()
