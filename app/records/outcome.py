"""What is recorded of a game's start and of each ply, as events; scores as text and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime

import chess
import chess.engine

from app.pieces.inventory import Inventory, Ply
from app.pieces.layout import colour_of
from app.records.events import By, Pace, PlyEvent, StartEvent, piece_records, transfer_records


@dataclass(frozen=True, slots=True)
class GameSetup:
    """Who plays, and how."""

    white: str
    black: str
    seed: int
    pace: Pace
    site: str = "?"
    time_control: str | None = None
    """As in PGN; None: played without a clock."""


@dataclass(frozen=True, slots=True)
class PlyOutcome:
    """What is known of a ply or task that was done; None: what a referee alone knows in a lab, or an arm of a hand."""

    planned: float | None = None
    """Plant time from home to home, as planned [s]."""
    real: float | None = None
    """Plant time from home to home, as it was [s]."""
    peak_torque: float | None = None
    """Largest servomotor torque [N m]."""
    placement_mm: Mapping[str, float] | None = None
    """Distance of each moved piece from the centre of its place, by name [mm]."""
    peak_force: float | None = None
    """Largest contact force [N]."""
    physical_ok: bool | None = None
    frame: str | None = None
    """Name of the camera's picture in the folder."""
    failures: tuple[str, ...] = ()
    resumed: bool = False
    """Another program had begun it."""
    by: By = "arm"
    """Who moved the pieces."""
    score: chess.engine.PovScore | None = None
    """What the player thinks of it."""
    clocks: Mapping[chess.Color, float] | None = None
    """What both clocks show after it [s]."""
    comment: str = ""
    """For the PGN."""


def start_event(
    wall_time: datetime, plant_time: float, setup: GameSetup, board: chess.Board, inventory: Inventory
) -> StartEvent:
    """The first event of a record: who plays, from which position, and what stands where."""
    return StartEvent(
        wall_time=wall_time, plant_time=plant_time, ply=0, fen=board.fen(), chess960=board.chess960, white=setup.white,
        black=setup.black, seed=setup.seed, pace=setup.pace, time_control=setup.time_control,
        inventory=piece_records(inventory),
    )  # fmt: skip


def ply_event(
    wall_time: datetime, plant_time: float, *, number: int, ply: Ply, outcome: PlyOutcome, fen: str,
    places: dict[str, str],
) -> PlyEvent:  # fmt: skip
    """The event of a ply that is done."""
    return PlyEvent(
        wall_time=wall_time, plant_time=plant_time, ply=number, side=ply.colour, san=ply.san, uci=ply.uci,
        kind=ply.kind, fen=fen, by=outcome.by, planned_s=outcome.planned, real_s=outcome.real,
        peak_torque_Nm=outcome.peak_torque, peak_force_N=outcome.peak_force, physical_ok=outcome.physical_ok,
        frame=outcome.frame, failures=outcome.failures, resumed=outcome.resumed, comment=outcome.comment,
        placement_mm=None if outcome.placement_mm is None else dict(outcome.placement_mm),
        transfers=transfer_records(ply.transfers),
        inventory=places,
        score=None if outcome.score is None else score_text(outcome.score),
        clock_s=None if outcome.clocks is None else {colour_of(c): left for c, left in outcome.clocks.items()},
    )  # fmt: skip


def own_clock(event: PlyEvent) -> float | None:
    """What the clock of the side that moved showed after its ply [s]; None: there is none."""
    return None if event.clock_s is None else event.clock_s.get(event.side)


def score_text(score: chess.engine.PovScore) -> str:
    """Pawns from White's side with two decimals and sign, or #3 and #-3 for mates."""
    white = score.white()
    mate, pawns = white.mate(), white.score()
    if mate is not None:
        return f"#{mate}"
    assert pawns is not None
    return f"{pawns / 100.0:+.2f}"


def score_of(text: str) -> chess.engine.PovScore:
    """What ``score_text`` has written."""
    score = chess.engine.Mate(int(text[1:])) if text.startswith("#") else chess.engine.Cp(round(100.0 * float(text)))
    return chess.engine.PovScore(score, chess.WHITE)
