"""Plays what a seed has drawn, in a folder of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final

import chess

from app.campaign.schema import TaskKind
from app.campaign.task import CampaignTask
from app.campaign.tasks.acts import LEGAL
from app.campaign.tasks.lines import random_game, random_position
from app.campaign.tasks.mishaps import ListeningPerson, MeddlingHands, ReachingHands
from app.campaign.tasks.relay import LossyRelay
from app.campaign.tasks.rows import TaskStory
from app.campaign.tasks.scripted_person import ScriptedPerson
from app.campaign.troubles import GameDied
from app.execution.state import EXPECTED_FAILURES
from app.play.game_setup import rig_setup_of, start_board
from app.play.launch import run_games
from app.play.session import SessionResult
from app.players.given_line import parse_line
from app.records.files import GAME
from app.rig.devices import RigFailed
from app.settings.defaults import Settings
from app.settings.toml import toml_value
from app.terminal.game_display import Together, UserInterface
from engine.errors import EngineProblem
from hardware.sim.plant.grip_faults import GripFaults
from hardware.sim.process.randomisation import AS_A_LAB, Randomisation

_WORLD: Final = "world.toml"


def play_here(task: CampaignTask, folder: Path, film: bool) -> TaskStory:
    """Play a task in this process.

    Args:
        task: what is played; its program is not killed.
        folder: of the task, which is empty.
        film: so that it can be filmed afterwards.

    Raises:
        GameDied: world or controller did not start.
        UserError: the record cannot be written.
        KeyboardInterrupt: it was broken off.
    """
    with prepared(task, folder, film) as (settings, relay):
        if task.kind is TaskKind.SESSION:
            story, _ = play_session(task, settings)
        else:
            story = TaskStory(asked_for=asked_for(task, settings), line=line_of(settings))
            told = ListeningPerson()
            with interface(task, settings, told) as (ui, mishaps):
                _play(story, lambda: run_games(settings, ui))
                story.mishaps = mishaps()
            story.said, story.asked = told.said, told.asked
        story.datagrams_lost = 0 if relay is None else relay.lost
        return story


@contextmanager
def prepared(task: CampaignTask, folder: Path, film: bool) -> Iterator[tuple[Settings, LossyRelay | None]]:
    """The settings of a task that is played in a folder, and the relay before its controller."""
    changes: dict[str, Any] = {"out": folder / GAME, **_beginning(task)}
    world = randomisation_of(task)
    if world is not None:
        changes["rig.randomise"] = folder / _WORLD
        (folder / _WORLD).write_text(as_toml(world), encoding="utf-8")
    if film:
        changes["rig.positions"] = True
    with ExitStack() as stack:
        relay = None
        if task.faults.link_loss:
            relay = stack.enter_context(LossyRelay(folder / GAME / "run", task.faults.link_loss, task.seed))
            changes["rig.relay"] = relay.port
        yield task.settings.with_changes(changes), relay


def randomisation_of(task: CampaignTask) -> Randomisation | None:
    """How its world differs; None: as a world does that nothing is said of."""
    world, share = task.randomisation, task.faults.grip
    if not share:
        return world
    world = AS_A_LAB if world is None else world
    grip = GripFaults(**{**world.devices.grip.model_dump(), "share": share})
    return world.model_copy(update={"devices": world.devices.model_copy(update={"grip": grip})})


def as_toml(world: Randomisation) -> str:
    """As a file for ``--randomise``."""
    return "".join(f"{name} = {toml_value(value)}\n" for name, value in world.model_dump().items())


def _beginning(task: CampaignTask) -> dict[str, Any]:
    seed, start, plies = task.seed, task.start, task.settings.game.plies
    if task.kind is TaskKind.SETUP:
        given = task.settings.game
        return {
            "game.standing": given.standing or random_position(2 * seed).fen(),
            "game.fen": given.fen or random_position(2 * seed + 1).fen(),
        }
    if task.kind is TaskKind.SESSION and task.settings.game.fen is None:
        return {"game.fen": random_position(seed, start.plies).fen()}
    if start.line:
        return {"game.moves": " ".join(move.uci() for move in random_game(seed, plies))}
    return {"game.fen": random_position(seed, start.plies).fen()} if start.plies else {}


def line_of(settings: Settings) -> tuple[str, ...] | None:
    """The moves that are to be played, UCI; None: engines choose them."""
    game = settings.game
    if game.moves is None:
        return None
    line = parse_line(game.moves, start_board(game.fen, chess960=game.chess960))
    return tuple(move.uci() for move in line[: game.plies])


def asked_for(task: CampaignTask, settings: Settings) -> int | None:
    """So many plies a task is to have; None: until the rules end it, at most so many as the settings say."""
    line = line_of(settings)
    return 0 if task.kind is TaskKind.SETUP else None if line is None else len(line)


@contextmanager
def interface(
    task: CampaignTask, settings: Settings, told: UserInterface
) -> Iterator[tuple[UserInterface, Callable[[], int]]]:
    """What is told about a game: ``told``, and the hands of its faults; and how often those have done something."""
    faults, run_dir, members = task.faults, _run_dir(settings), [told]
    table = rig_setup_of(settings.rig).table if faults.knocks or faults.hands else None
    reaching, clumsy = None, None
    if faults.hands and table is not None:
        reaching = ReachingHands(run_dir, task.seed, faults.hands, table)
        members.append(reaching)
    if faults.knocks and table is not None:
        clumsy = MeddlingHands(run_dir, task.seed, faults.knocks, table)
        members.append(clumsy)
    try:
        yield (
            Together(*members),
            lambda: (0 if clumsy is None else clumsy.mishaps) + (0 if reaching is None else reaching.reached),
        )
    finally:
        if reaching is not None:
            reaching.close()


def _run_dir(settings: Settings) -> Path:
    assert settings.out is not None, "a task has its folder"
    return settings.out / "run"


def _play(story: TaskStory, run: Callable[[], SessionResult]) -> None:
    """Play, and note how it ended.

    Raises:
        GameDied: world or controller did not start.
    """
    try:
        result = run()
    except RigFailed as error:
        raise GameDied(str(error)) from error
    except (*EXPECTED_FAILURES, EngineProblem) as error:
        story.reason = str(error)
        if story.asked_for is None:
            story.asked_for = 1  # it did not come to its end, whatever that would have been
        return
    note_end(story, result)


def note_end(story: TaskStory, result: SessionResult) -> None:
    """How a game ended that has a report."""
    report = result.report
    story.completed = result.holds
    story.reason = next((failure.reason for failure in report.failures), report.exit_reason)


def play_session(task: CampaignTask, settings: Settings) -> tuple[TaskStory, ScriptedPerson]:
    """A person errs at the board; whether what was made of it is right, they see themselves."""
    story = TaskStory(asked_for=task.session.acts)
    table, board = rig_setup_of(settings.rig).table, chess.Board(settings.game.fen or chess.STARTING_FEN)
    person = ScriptedPerson(_run_dir(settings), task.seed, board, task.session, table)
    _play(story, lambda: run_games(settings, person, person.typed))
    if not story.completed:
        person.failed(story.reason)
    found = {mishap.what: f"{mishap.what} after {mishap.act}: {mishap.story}" for mishap in reversed(person.mishaps)}
    story.wrong = found.get("wrong", found.get("unnoticed"))
    if "stuck" in found:
        story.completed, story.reason = False, found["stuck"]
    story.said, story.asked = person.told, sum(mishap.what == "asked" for mishap in person.mishaps)
    story.mishaps = sum(number for act, number in person.acts.items() if act not in LEGAL)
    return story, person
