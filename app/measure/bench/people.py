"""Benches ``people`` and ``knocks``: games against a scripted person who errs, and how many of them end as they should.

From a random position on, the person moves by hand and says 'look'; or plays what is not allowed, knocks a piece over,
moves two at once, exchanges two, leaves one between squares, takes a move back by hand, and says 'look' or 'fix'.
Light, camera and how the pieces stand are drawn anew for each game. Asked for something, they do it; but what lies they
leave to the arm. Whether the board is right in the end is the referee's word. In ``knocks`` they do nothing but knock.
"""

from __future__ import annotations

from collections import Counter
from typing import Any, Final

from app import UserError
from app.campaign.drawing import draw
from app.campaign.schema import TaskKind
from app.campaign.spec import CampaignSpec
from app.campaign.tasks.acts import Act
from app.campaign.tasks.playing import play_session, prepared
from app.campaign.tasks.scratch import scratch_folder
from app.campaign.tasks.scripted_person import ScriptedPerson
from app.measure.bench.report import BenchReport, Progress, row

SEED: Final = 9001  # of the first game
GAMES: Final = {True: 3, False: 300}  # by ``quick``
KNOCKS: Final = {True: 4, False: 500}  # by ``quick``
KNOCKS_SEED: Final = 12001
DRAWN: Final[dict[str, Any]] = {
    "engine.nodes": 300,
    "randomisation.light_brightness": 0.3,
    "randomisation.light_colour": 0.15,
    "randomisation.light_direction": 3.1,
    "randomisation.light_radius": 0.1,
    "randomisation.exposure": 0.15,
    "randomisation.white_balance": 0.08,
    "randomisation.camera_shift": 0.01,
    "randomisation.camera_turn": 0.03,
    "randomisation.placement_sigma": 0.0015,
    "randomisation.placement_limit": 0.004,
}
"""How games are played, and how worlds differ."""


def play_one(seed: int, also: dict[str, Any] | None = None) -> ScriptedPerson:
    """Play one game; ``also``: what is drawn otherwise, by the names of a campaign's file."""
    task = draw(CampaignSpec(kind=TaskKind.SESSION, first_seed=seed, draw={**DRAWN, **(also or {})}), 0)
    with scratch_folder(seed) as folder, prepared(task, folder, film=False) as (settings, _):
        return play_session(task, settings)[1]


def people_bench(quick: bool, progress: Progress) -> BenchReport:
    """Play games and count those that went right.

    Raises:
        UserError: no game could be played.
    """
    games = GAMES[quick]
    counted, acts, right = Counter[str](), Counter[Act](), 0
    for number in range(games):
        person = play_one(SEED + number)
        acts += person.acts
        right += not person.mishaps
        counted.update({mishap.what for mishap in person.mishaps})
        for mishap in person.mishaps:
            progress(f"game {SEED + number}: {mishap.what} after {mishap.act}: {mishap.story}")
        progress(f"{number + 1} of {games} games, {right} went right")
    if not acts:
        raise UserError("in no game anything was done")
    rows = {
        "right": row([right / games], "1", 0.98, "least", n=games),
        "wrong": row([counted["wrong"] + counted["unnoticed"]], "games", 0.0, "max", n=games),
        "stuck": row([counted["stuck"]], "games", 0.0, "max", n=games),
        "failed": row([counted["failed"]], "games", n=games),
        "asked": row([counted["asked"]], "games", n=games),
        "acts": row([acts.total()], "1"),
    }
    return BenchReport.of("people", SEED, rows)


def knocks_bench(quick: bool, progress: Progress) -> BenchReport:
    """Knock pieces over, any of them in any direction, in random middle games, until it was done so often.

    Raises:
        UserError: a game could not be played.
    """
    done, flawed, games, counted = 0, 0, 0, Counter[str]()
    while done < KNOCKS[quick]:
        person = play_one(KNOCKS_SEED + games, {"session.often": {"knock": 1.0}})
        for mishap in person.mishaps:
            progress(f"game {KNOCKS_SEED + games}: {mishap.what}: {mishap.story}")
        if not person.acts:
            raise UserError(f"in game {KNOCKS_SEED + games} nothing was done: see what was said")
        games += 1
        done += person.acts.total()
        flawed += len(person.flawed)
        counted.update({mishap.what for mishap in person.mishaps})
        progress(f"{done} knocks in {games} games, {done - flawed} put right unaided")
    rows = {
        "unaided": row([1.0 - flawed / done], "1", 0.98, "least", n=done),
        "taken_for_a_move": row([counted["wrong"]], "games", 0.0, "max", n=games),
        "unnoticed": row([counted["unnoticed"]], "games", 0.0, "max", n=games),
        "knocks": row([done], "1"),
    }
    return BenchReport.of("knocks", KNOCKS_SEED, rows)
