"""Draws hand.jpg: a person's hand puts a piece down and rests in the arm's way, as the board's camera sees it.

Run from the top of the repository: PYTHONPATH=. MUJOCO_GL=egl python docs/pictures/hand.py
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import chess
import cv2
import mujoco
import numpy as np

from app.motion import MotionSettings
from app.pieces.layout import start_layout
from hardware.parameters import load_parameters
from hardware.sim.bodies.hand import add_hand
from hardware.sim.bodies.scene import build_model
from hardware.sim.hand.actions import Action, HandSettings, Put, Rest, Take
from hardware.sim.hand.hand import Hand
from hardware.sim.plant.plant import Plant
from hardware.sim.process.settings import WorldSettings, stand_pieces
from hardware.table import Place, TableSettings

POSITION = "r1bqkbnr/pppp1ppp/2n5/4p3/4P3/5N2/PPPP1PPP/RNBQKB1R w KQkq - 2 3"
TARGET = Path(__file__).with_name("hand.jpg")
HALF_WIDTH = 640


class Scene:
    """A plant with a hand, and its double that is drawn."""

    def __init__(self) -> None:
        table, parameters = TableSettings(), load_parameters()
        pieces = start_layout(chess.Board(POSITION), table)
        world = WorldSettings(pieces=pieces, home=MotionSettings().home, seed=1)
        person = HandSettings()
        build = partial(
            build_model, parameters, table, stand_pieces(world), np.array(world.home),
            add=partial(add_hand, side=person.side),
        )  # fmt: skip
        self.plant = Plant(build(looks=False), parameters, tuple(piece.name for piece in pieces))
        self.hand = Hand(self.plant, person, pieces, table, world.seed)
        self._seen = build()
        self._renderer = mujoco.Renderer(self._seen, 480, HALF_WIDTH)

    def run(self, action: Action, ticks: int = 10**6) -> None:
        """Carry an action out, or its first ticks."""
        self.hand.perform((action,))
        while self.hand.busy and ticks > 0:
            self.hand.drive()
            self.plant.step()
            ticks -= 1

    def draw(self, camera: str) -> np.ndarray:
        """A picture of the world as it is, RGB."""
        data, option = mujoco.MjData(self._seen), mujoco.MjvOption()
        option.geomgroup[3] = 0
        data.qpos[:] = self.plant.positions()
        mujoco.mj_forward(self._seen, data)
        self._renderer.update_scene(data, camera=camera, scene_option=option)
        return self._renderer.render()


def main() -> None:
    """Draw it."""
    table = TableSettings()
    scene = Scene()
    scene.run(Take(at=table.xy(Place.parse("f1"))))
    scene.run(Put(at=table.xy(Place.parse("c4"))), ticks=2450)
    left = scene.draw("camera")
    while scene.hand.busy:
        scene.hand.drive()
        scene.plant.step()
    scene.run(Rest(at=(-0.10, 0.02), duration=2.0), ticks=3000)
    right = scene.draw("camera")
    cv2.imwrite(str(TARGET), cv2.cvtColor(np.hstack([left, right]), cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main()
