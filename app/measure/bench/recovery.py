"""Bench ``recovery``: games on a simulated rig that goes wrong, and how much of it is put right without a person.

Two sides play random lines that capture often. The gripper lets go of each second piece that it holds, a while after it
has closed; after every fourth ply a hand pushes a piece over, off its middle or onto another square. The
camera looks after each ply, as in a lab. Whether the board is right in the end, and after each ply that was recorded,
is the referee's word.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from app import UserError
from app.campaign.drawing import draw
from app.campaign.schema import GameRow
from app.campaign.spec import CampaignSpec
from app.campaign.tasks.mishaps import MeddlingHands
from app.campaign.tasks.playing import line_of, note_end, prepared
from app.campaign.tasks.rows import TaskStory, result_of
from app.campaign.tasks.scratch import scratch_folder
from app.measure.bench.report import BenchReport, Progress, row
from app.play.launch import run_games
from app.records.files import GAME
from hardware.table import TableSettings

SEED: Final = 31
LOSSES: Final = {True: 2, False: 100}
"""By ``quick``: grips that were lost."""
MISHAPS: Final = {True: 1, False: 50}  # pieces that were knocked over or shifted
A_GAME: Final = {True: 6, False: 20}  # plies of a game
EVERY_HOLD: Final = 2  # one grip in so many is lost
EVERY_PLY: Final = 4  # after one ply in so many a hand does something
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


def recovery_bench(quick: bool, progress: Progress) -> BenchReport:
    """Play games until enough grips were lost and enough pieces were moved by hand; ``quick`` with few of both.

    Raises:
        UserError: a process failed; or in a game nothing of the kind has happened, so that there would be no end.
    """
    tally = RecoveryTally()
    while tally.losses < LOSSES[quick] or tally.mishaps < MISHAPS[quick]:
        before = tally.losses + tally.mishaps
        game = play_one(SEED + tally.games, A_GAME[quick], tally, progress)
        if tally.losses + tally.mishaps == before:
            raise UserError(f"in game {tally.games} no grip was lost and no piece moved: {game.reason}")
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


def play_one(seed: int, plies: int, tally: RecoveryTally, progress: Progress) -> GameRow:
    """Play one game of mishaps, and add up what came of it."""
    holds = list(range(1 + seed % EVERY_HOLD, _MOST_HOLDS, EVERY_HOLD))
    spec = CampaignSpec(first_seed=seed, draw={
        "randomisation.devices.grip.holds": holds, "faults.knocks": EVERY_PLY, "start.line": True, "game.plies": plies,
    })  # fmt: skip
    task, told = draw(spec, 0), f"game {tally.games + 1}"
    with scratch_folder(seed) as folder, prepared(task, folder, film=False) as (settings, _):
        story = TaskStory(asked_for=plies, line=(line := line_of(settings) or ()))
        hands = MeddlingHands(folder / GAME / "run", seed, EVERY_PLY, TableSettings(), progress)
        note_end(story, run_games(settings, hands))
        story.mishaps = hands.mishaps
        result = result_of(task, folder / GAME, story, "")
    game = result.game
    tally.games += 1
    tally.losses += game.grips_lost or 0
    tally.mishaps += game.mishaps
    tally.wrong += game.wrong_plies
    tally.broken += [ply.uci for ply in result.plies] != list(line[: len(result.plies)])
    if game.plies < plies:
        tally.unmended += 1
        progress(f"{told} ended after {game.plies} plies: {game.reason}")
    return game
