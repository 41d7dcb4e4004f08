"""Rows of campaigns that nobody played: figures of plies and games about as the arm's, with what is planted in them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from app.campaign.report.analysis.rows import CampaignRows, RowTable
from app.pieces.inventory import MoveKind

PLIES = 40
TIMES = {"quiet": 1.30, "capture": 2.50, "castling": 2.60, "en_passant": 2.60, "promotion": 3.90}
CHANCES = (0.75, 0.20, 0.03, 0.005, 0.015)
PROFILES = ("default", "fast", "gentle")

Columns = dict[str, np.ndarray[Any, Any]]
Plant = Callable[[Columns, Columns, np.random.Generator], None]
"""Changes the columns of games and plies of the newer campaign."""


def ranges_of(seeds: np.ndarray[Any, Any]) -> Columns:
    """What was drawn for each seed: the same in every campaign."""
    draws = np.array([np.random.default_rng([7, int(seed)]).random(6) for seed in seeds])
    return {
        "drawn.randomisation.light_brightness": 0.5 + draws[:, 0],
        "drawn.randomisation.camera_shift": -5.0 + 10.0 * draws[:, 1],
        "drawn.faults.grip": 0.05 * draws[:, 2],
        "drawn.randomisation.friction": 10.0 ** (-1.0 + draws[:, 3]),
        "drawn.rig.profile": np.array([PROFILES[int(3.0 * one)] for one in draws[:, 4]], dtype=np.object_),
        "drawn.rig.square": np.array([(45.0, 50.0, 57.0)[int(3.0 * one)] for one in draws[:, 5]]),
    }


def campaign(
    seeds: Iterable[int], run: int, plant: Plant | None = None, name: str = "new", length: int = PLIES
) -> CampaignRows:
    """A campaign of these seeds: moves are the seeds', and so is most of the figures; the rest is that of the run."""
    numbers = np.array(list(seeds))
    games, rng = numbers.size, np.random.default_rng([11, run])
    own = np.random.default_rng([13, int(numbers[0]), games])
    chosen = own.choice(5, games * length, p=CHANCES)
    kinds = np.array([kind.value for kind in MoveKind], dtype=np.object_)[chosen]
    shared, noise = own.normal(size=(4, games * length)), rng.normal(size=(4, games * length))
    mixed = 0.9 * shared + 0.44 * noise
    ply = np.tile(np.arange(1, length + 1), games)
    plies: Columns = {
        "seed": np.repeat(numbers, length).astype(float),
        "ply": ply.astype(float),
        "uci": np.array([f"m{number}" for number in ply], dtype=np.object_),
        "kind": kinds,
        "piece": np.array(list("PNBRQKpnbrqk"), dtype=np.object_)[own.integers(0, 12, games * length)],
        "planned_s": np.array([TIMES[kind] for kind in kinds]),
        "real_s": np.array([TIMES[kind] for kind in kinds]) + 0.08 * mixed[0],
        "error_mm": 0.30 * np.exp(0.35 * mixed[1]),
        "peak_torque_Nm": 3.0 + 0.5 * mixed[2],
        "peak_force_N": 6.0 * np.exp(0.2 * mixed[3]),
    }
    told: Columns = {
        "seed": numbers.astype(float),
        "kind": np.full(games, "game", dtype=np.object_),
        "outcome": np.where(rng.random(games) < 0.05, "mended", "right").astype(np.object_),
        "reason": np.full(games, None, dtype=np.object_),
        "said": np.full(games, None, dtype=np.object_),
        "wall_s": 20.0 + rng.random(games),
        "sim_s": np.full(games, 90.0),
        "grips_lost": rng.poisson(0.1, games).astype(float),
        "repairs": rng.poisson(0.1, games).astype(float),
        "asked": rng.poisson(0.02, games).astype(float),
        "missed_ticks": np.zeros(games),
        "world_state": np.array([f"{run}-{number}" for number in numbers], dtype=np.object_),
        "environment": np.full(games, f"{run:08x}", dtype=np.object_),
        "host": np.full(games, "laboratory", dtype=np.object_),
        "cpu": np.full(games, "Two cores", dtype=np.object_),
        **ranges_of(numbers),
    }
    if plant is not None:
        plant(told, plies, rng)
    by_game = {name: plies[name].reshape(games, length) for name in ("error_mm", "peak_torque_Nm", "peak_force_N")}
    told |= {
        "placement_mean_mm": by_game["error_mm"].mean(axis=1),
        "placement_max_mm": by_game["error_mm"].max(axis=1),
        "peak_torque_Nm": by_game["peak_torque_Nm"].max(axis=1),
        "peak_force_N": by_game["peak_force_N"].max(axis=1),
    }
    return CampaignRows(name, RowTable(told), RowTable(plies), games)


def game_column_of(plies: Mapping[str, np.ndarray[Any, Any]], column: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """A column of games, once for each ply."""
    return np.repeat(column, plies["ply"].size // column.size)


def dark_rooms_fail(games: Columns, _plies: Columns, rng: np.random.Generator) -> None:
    """In the darkest fifth two games of three fail: as after a change of vision."""
    dark = games["drawn.randomisation.light_brightness"] < 0.7
    games["outcome"][dark & (rng.random(dark.size) < 0.67)] = "unmended"


def captures_are_slower(_games: Columns, plies: Columns, _rng: np.random.Generator) -> None:
    """By 0.06 s: as after a change of clearance."""
    plies["real_s"][plies["kind"] == "capture"] += 0.06


def knights_stand_off(games: Columns, plies: Columns, _rng: np.random.Generator) -> None:
    """Where friction is high, by 0.3 mm: a piece and a range."""
    rough = game_column_of(plies, games["drawn.randomisation.friction"]) > 10.0**-0.2
    knight = np.isin(plies["piece"], ("N", "n"))
    plies["error_mm"][rough & knight] += 0.3


def blows_are_harder(_games: Columns, plies: Columns, _rng: np.random.Generator) -> None:
    """By a tenth, everywhere: as with another k*."""
    plies["peak_force_N"] *= 1.1
