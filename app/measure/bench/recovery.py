"""Bench ``recovery``: games on a simulated rig that goes wrong, and how much of it is put right without a person.

Two sides play random lines that capture often. The gripper lets go of every third piece that it holds, a while after it
has closed; after every fourth ply a hand pushes a piece over, off its middle or onto another square. The
camera looks after each ply, as in a lab. Whether the board is right in the end, and after each ply that was recorded,
is the referee's word.
"""

from __future__ import annotations

import json
import tempfile
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import chess
import numpy as np

from app import UserError
from app.measure.bench.report import BenchReport, Progress, row
from app.measure.bench.vision.games import random_game
from app.play.launch import run_games
from app.play.session import SessionResult
from app.records import EVENTS_FILE, PlyEvent, read_events
from app.settings.tree import Settings
from app.terminal.interface import UserInterface
from hardware.interfaces import HardwareError
from hardware.piece_set import Colour
from hardware.sim.clients.hand import SimHand
from hardware.sim.hand.actions import Action, Knock, Move, Withdraw
from hardware.sim.process.settings import END_FILE
from hardware.table import TableSettings, square_place

SEED: Final = 31
LOSSES: Final = {True: 2, False: 100}
"""By ``quick``: grips that were lost."""
MISHAPS: Final = {True: 1, False: 50}  # pieces that were knocked over or shifted
A_GAME: Final = {True: 6, False: 20}  # plies of a game
EVERY_HOLD: Final = 2  # one grip in so many is lost
EVERY_PLY: Final = 4  # after one ply in so many a hand does something
SHIFT: Final = (0.006, 0.012)  # a shifted piece ends up so far off its middle [m]
_MOST_HOLDS: Final = 400


@dataclass(slots=True)
class RecoveryTally:
    """What happened, over all games."""

    losses: int = 0
    mishaps: int = 0
    unmended: int = 0  # games that could not go on without a person's help
    wrong: int = 0  # plies after which the board was not as recorded
    broken: int = 0  # games whose record is not the beginning of what was to be played
    games: int = 0


class Clumsy(UserInterface):
    """Sees each ply, and then has a hand do harm in the world of a run directory; the seed decides what."""

    def __init__(self, run_dir: Path, seed: int, progress: Progress) -> None:
        self._run_dir, self._progress = run_dir, progress
        self._rng, self._table = np.random.default_rng([seed, 7]), TableSettings()
        self.mishaps = 0  # how often

    def ply(self, event: PlyEvent, board: chess.Board) -> None:
        """See ``UserInterface.ply``."""
        if event.ply % EVERY_PLY:
            return
        what, action = self._mishap(board)
        with closing(SimHand(self._run_dir)) as hand:
            try:
                hand.do(action, Withdraw())
            except HardwareError as error:  # out of reach for a person, who sits at one side
                self._progress(f"ply {event.ply}: {what}: not done: {error}")
                return
        self.mishaps += 1
        self._progress(f"ply {event.ply}: {what}")

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


def recovery_bench(quick: bool, progress: Progress) -> BenchReport:
    """Play games until enough grips were lost and enough pieces were moved by hand; ``quick`` with few of both.

    Raises:
        UserError: a process failed; or in a game nothing of the kind has happened, so that there would be no end.
    """
    tally = RecoveryTally()
    while tally.losses < LOSSES[quick] or tally.mishaps < MISHAPS[quick]:
        before = tally.losses + tally.mishaps
        result = play_one(SEED + tally.games, A_GAME[quick], tally, progress)
        if tally.losses + tally.mishaps == before:
            reasons = "; ".join(failure.reason for failure in result.report.failures)
            raise UserError(f"in game {tally.games} no grip was lost and no piece moved: {reasons or 'see its record'}")
        progress(
            f"game {tally.games}: {tally.losses} grips lost, {tally.mishaps} pieces knocked or shifted, "
            f"{tally.unmended} not repaired, {tally.wrong} unnoticed"
        )
    both = tally.losses + tally.mishaps
    rows = {
        "grips_lost": row([tally.losses], "1"),
        "knocked_or_shifted": row([tally.mishaps], "1"),
        "unnoticed": row([tally.wrong], "plies", 0.0, "max"),
        "history_wrong": row([tally.broken], "games", 0.0, "max"),
        "unmended": row([tally.unmended / max(1, both)], "1", 0.05, "max"),
        "games": row([tally.games], "1"),
    }
    return BenchReport.of("recovery", SEED, rows)


def play_one(seed: int, plies: int, tally: RecoveryTally, progress: Progress) -> SessionResult:
    """Play one game of mishaps, and add up what came of it."""
    line = list(random_game(seed, plies))
    with tempfile.TemporaryDirectory(prefix="touchmove-") as name:
        folder = Path(name)
        faults = folder / "faults.toml"
        holds = list(range(1 + seed % EVERY_HOLD, _MOST_HOLDS, EVERY_HOLD))
        faults.write_text(f"[devices.grip]\nholds = {holds}\n", encoding="utf-8")
        settings = Settings().with_changes(
            {
                "rig.pace": "fast", "rig.seed": seed, "rig.video": False, "rig.randomise": faults, "rig.linger": 2.0,
                "rig.person": Colour.WHITE if seed % 2 else Colour.BLACK, "vision.verify": True,
                "game.moves": " ".join(move.uci() for move in line), "out": folder / "game",
            }
        )  # fmt: skip
        ui = Clumsy(folder / "game" / "run", seed, progress)
        result = run_games(settings, ui)
        done = [event for event in read_events(folder / "game" / EVENTS_FILE, progress) if isinstance(event, PlyEvent)]
        end = json.loads((folder / "game" / "run" / END_FILE).read_text(encoding="utf-8"))
        tally.losses += int(end["grips_lost"])
    tally.games += 1
    tally.mishaps += ui.mishaps
    tally.wrong += sum(event.physical_ok is False for event in done)
    tally.broken += [event.uci for event in done] != [move.uci() for move in line[: len(done)]]
    if len(done) < len(line):
        tally.unmended += 1
        for failure in result.report.failures:
            progress(f"game {tally.games} ended after {len(done)} plies: {failure.reason}")
    return result
