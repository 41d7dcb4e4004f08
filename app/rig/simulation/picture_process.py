"""The process that draws pictures at given ticks: ``python -m app.rig.simulation.picture_process``.

What is wanted comes on stdin, the pictures go to stdout, byte by byte as they are. It ends with the one that reads.
"""

from __future__ import annotations

import os
import sys
from typing import IO

from app.rig.simulation.film_process import NICE, view_of
from app.rig.simulation.pictures import PicturesWish
from hardware.interfaces import HardwareError
from hardware.sim.plant.trajectory import TrajectoryFile
from hardware.sim.process.construction import Construction
from hardware.sim.process.settings import WorldSettings
from hardware.sim.render.drawing import SceneDrawer
from hardware.sim.render.quality import FILM, LOOK
from hardware.sim.render.settings import SceneState


def draw(wish: PicturesWish, output: IO[bytes]) -> None:
    """Draw what is wanted.

    Raises:
        HardwareError: the positions are not of such a world or not of these ticks, or there is no OpenGL.
    """
    file = TrajectoryFile(wish.positions)
    model = Construction.of(WorldSettings.model_validate(file.header.world)).model(looks=True)
    if model.nq != file.header.positions:
        raise HardwareError(f"{wish.positions} is of a world with other joints: take the version that recorded it")
    drawer, quality = SceneDrawer(model), LOOK if wish.fine else FILM
    views, ticks = [view_of(view) for view in wish.views], iter(wish.ticks)
    due = next(ticks, None)
    for frame in file.frames():
        drawn = b""
        while due == frame.tick:
            if not drawn:
                drawer.arrange(frame.positions, None if frame.note is None else SceneState.model_validate(frame.note))
                drawn = b"".join(drawer.see(view, wish.width, wish.height, quality).tobytes() for view in views)
            output.write(drawn)
            due = next(ticks, None)
    output.flush()
    drawer.close()
    if due is not None:
        raise HardwareError(f"{wish.positions} holds no frame at tick {due}: it is of another game")


def main() -> int:
    """Entry of the process: the wish as JSON on stdin."""
    os.nice(NICE)
    output = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # whatever a library prints is no picture
    try:
        draw(PicturesWish.model_validate_json(sys.stdin.buffer.read()), output)
    except BrokenPipeError:  # who listened is gone
        return 1
    except (HardwareError, ValueError) as error:
        print(" ".join(str(error).split()), file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
