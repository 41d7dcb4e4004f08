"""What hands do in a simulated world while a game is played there, and what the program says about it."""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import closing, suppress
from pathlib import Path
from typing import Final

import chess
import numpy as np

from app.records import PlyEvent
from app.records.events import unsaid
from app.terminal.game_display import UserInterface
from app.terminal.shown import PathShown
from hardware.interfaces import HardwareError
from hardware.sim.clients.hand import SimHand
from hardware.sim.hand.actions import Action, Hover, Knock, Move, Withdraw
from hardware.table import TableSettings, square_place

SHIFT: Final = (0.006, 0.012)
"""A shifted piece ends up so far off its middle [m]."""


class ListeningPerson(UserInterface):
    """Remembers what a person at the board was told and asked.

    Attributes:
        said: the last sentence; None: there was none.
        asked: so often somebody was asked for something.
    """

    def __init__(self) -> None:
        self.said: str | None = None
        self.asked = 0

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        """See ``UserInterface.say``."""
        self.said = sentence

    def prompt(
        self, sentence: str, answers: Collection[str] = (), squares: Collection[str] = (), *, turn: bool = False
    ) -> None:
        """See ``UserInterface.prompt``."""
        self.said = sentence
        self.asked += not turn


class MeddlingHands(UserInterface):
    """Sees each ply, and every so often a hand then does harm in the world of a run directory; the seed decides what.

    Args:
        run_dir: of the world.
        seed: decides what is done.
        every: after one ply in so many.
        table: as a person sees it.
        told: what was done, or could not be.

    Attributes:
        mishaps: how often something was done.
    """

    def __init__(
        self, run_dir: Path, seed: int, every: int, table: TableSettings, told: Callable[[str], None] = unsaid
    ) -> None:
        self._run_dir, self._every, self._table, self._told = run_dir, every, table, told
        self._rng = np.random.default_rng([seed, 7])
        self.mishaps = 0

    def ply(self, event: PlyEvent, board: chess.Board) -> None:
        """See ``UserInterface.ply``."""
        if event.ply % self._every:
            return
        what, action = self._mishap(board)
        with closing(SimHand(self._run_dir)) as hand:
            try:
                hand.do(action, Withdraw())
            except HardwareError as error:  # out of reach for a person, who sits at one side
                self._told(f"ply {event.ply}: {what}: not done: {error}")
                return
        self.mishaps += 1
        self._told(f"ply {event.ply}: {what}")

    def _mishap(self, board: chess.Board) -> tuple[str, Action]:
        rng = self._rng
        square = int(rng.choice(list(board.piece_map())))
        at, name, sort = self._xy(square), chess.square_name(square), self.mishaps % 3
        if sort == 0:
            return f"a hand knocks over {name}", Knock(at=at, direction=float(rng.uniform(-np.pi, np.pi)))
        if sort == 1:
            angle, far = rng.uniform(-np.pi, np.pi), rng.uniform(*SHIFT)
            to = at[0] + far * float(np.cos(angle)), at[1] + far * float(np.sin(angle))
            return f"a hand shifts {name} by {1e3 * far:.0f} mm", Move(start=at, to=to)
        empty = int(rng.choice([other for other in chess.SQUARES if board.piece_at(other) is None]))
        return f"a hand carries {name} to {chess.square_name(empty)}", Move(start=at, to=self._xy(empty))

    def _xy(self, square: int) -> tuple[float, float]:
        return self._table.xy(square_place(square))


class ReachingHands(UserInterface):
    """In every n-th ply a hand reaches over some square when the arm sets out, stays a moment, and withdraws.

    Args:
        run_dir: of the world.
        seed: decides where.
        every: in one ply of so many.
        table: as a person sees it.

    Attributes:
        reached: how often.
    """

    def __init__(self, run_dir: Path, seed: int, every: int, table: TableSettings) -> None:
        self._run_dir, self._every, self._table = run_dir, every, table
        self._rng = np.random.default_rng([seed, 8])
        self._hand: SimHand | None = None
        self._armed = every == 1
        self.reached = 0

    def ply(self, event: PlyEvent, board: chess.Board) -> None:
        """See ``UserInterface.ply``."""
        self.close()
        self._armed = (event.ply + 1) % self._every == 0

    def path(self, shown: PathShown) -> None:
        """See ``UserInterface.path``."""
        if not self._armed:
            return
        self._armed = False
        square = int(self._rng.integers(64))
        over = Hover(at=self._table.xy(square_place(square)), duration=float(self._rng.uniform(0.3, 2.0)))
        self._hand = SimHand(self._run_dir)
        self._hand.perform(over, Withdraw())
        self.reached += 1

    def close(self) -> None:
        """The hand goes, if it has not yet."""
        if self._hand is not None:
            with suppress(HardwareError), closing(self._hand):  # out of reach, or the world has ended
                self._hand.wait()
            self._hand = None
