"""A world from its settings: what the seed draws, the models for physics and for pictures, and the plant."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import mujoco
import numpy as np

from hardware.parameters import load_parameters
from hardware.sim.bodies.hand import add_hand
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant.imperfections import Flaws
from hardware.sim.plant.plant import Plant
from hardware.sim.plant.snapshot import Snapshot
from hardware.sim.process.randomisation import Draw, draw
from hardware.sim.process.settings import WorldSettings
from hardware.sim.render.settings import CameraSettings, SceneState


class Construction(NamedTuple):
    """A world that can be built."""

    settings: WorldSettings
    """What was asked for."""
    drawn: Draw
    """What the seed made of it."""

    @classmethod
    def of(cls, settings: WorldSettings) -> Construction:
        """Draw a world; raises ``ParametersError`` if the robot's parameters cannot be read."""
        one = settings
        parameters = load_parameters(one.parameters_file)
        if one.drives is not None:
            parameters = one.drives.robot(parameters)
        return cls(one, draw(one.randomisation, one.seed, one.pieces, one.table, parameters, one.light, one.camera))

    @property
    def camera(self) -> CameraSettings:
        """As it really hangs and exposes at the start."""
        return self.drawn.camera

    @property
    def looks(self) -> SceneState:
        """Light, exposure and mount at the start."""
        return SceneState(light=self.drawn.light, exposure=self.camera.exposure, mount=self.camera.mount)

    def model(self, *, looks: bool) -> mujoco.MjModel:
        """The whole world, with or without what is only seen; raises ``ValueError`` if the arm does not reach home."""
        home, drawn, hand = np.array(self.settings.home), self.drawn, self.settings.hand
        return build_model(
            drawn.parameters, self.settings.table, drawn.pieces, home, looks=looks, offset=drawn.board,
            add=partial(add_hand, side=hand.side) if hand else None,
        )  # fmt: skip

    def plant(self, snapshot: Snapshot | None = None) -> Plant:
        """The plant, new or from a snapshot; ``ValueError`` if home is out of reach, or that is of another world."""
        names = tuple(piece.name for piece in self.settings.pieces)
        flaws = Flaws(self.settings.randomisation.devices, self.settings.seed)
        boxes = self.settings.table.boxes()
        return Plant(self.model(looks=False), self.drawn.parameters, names, snapshot, flaws, boxes)
