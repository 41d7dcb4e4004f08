"""The referee of a simulated world: the only door to its ground truth."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hardware.referee import PiecePose, RunSpeed, Truth
from hardware.sim.clients import wire


class SimReferee(wire.WorldClient):
    """``Referee``: asks the world for the truth."""

    def __init__(self, run_dir: Path) -> None:
        super().__init__(run_dir, "referee")

    def look(self, reset_peak: bool = False) -> tuple[Truth, RunSpeed]:
        """The world as it is; optionally start counting the peak contact force anew."""
        answer = wire.ask(self._link, {"reset_peak": reset_peak})
        speed = RunSpeed(answer.pop("ran_ticks") * self._period, answer.pop("ran_wall"))
        pieces = tuple(PiecePose(*row) for row in answer.pop("pieces"))
        (x, y, z), hand = answer.pop("tool"), answer.pop("hand")
        return Truth(pieces=pieces, tool=(x, y, z), hand=None if hand is None else tuple(hand), **answer), speed

    def positions(self) -> NDArray[np.float64]:
        """All generalised positions of the world's model, shape (nq,)."""
        return np.array(wire.ask(self._link, {"positions": True})["positions"])
