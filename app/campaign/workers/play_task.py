"""What a worker does: plays one task in a folder of its own, and tells what came of it. Nothing is shared.

Orders and answers are texts, so that any scheduler can carry them. What is no result of the game is an exception:
another environment, a machine that has no room, processes of the game that were killed.
"""

from __future__ import annotations

import json
import shutil
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Final

from app import UserError
from app.campaign.environment import CampaignEnvironment, environment_here, host_and_cpu
from app.campaign.folder import CAMPAIGN_FILE
from app.campaign.schema import GAMES_FOLDER, GameRow, TaskResult
from app.campaign.tasks.kills import LOG, KilledWithLog, play_with_kills
from app.campaign.tasks.playing import play_here
from app.campaign.tasks.rows import TaskStory, crashed, result_of
from app.campaign.tasks.scratch import scratch_folder
from app.campaign.troubles import MACHINE, BrokenOff, EnvironmentDiffers, GameDied, MachineTrouble
from app.campaign.workers.order import Kept, TaskOrder
from app.records.files import GAME, full_disk
from app.rig.simulation.processes import last_words
from app.settings.files import SETTINGS_FILE
from controller.protocol.key import KEY_FILE
from hardware.sim.process.settings import END_FILE

RUNS: Final = 8
"""Of so many campaigns a worker of a cluster plays in turn without looking at engines and files again."""


def play_task(text: str) -> str:
    """Play one task.

    Args:
        text: a ``TaskOrder``.

    Returns:
        A ``TaskResult``.

    Raises:
        EnvironmentDiffers: it is not played here.
        MachineTrouble: it may work later.
        GameDied: it may work again.
        BrokenOff: it was told to end.
    """
    order = TaskOrder.model_validate_json(text)
    try:
        here = _environment_in(order.run, order.engines, tuple(order.environment.files))
    except UserError as error:  # it has no engine, or not the files
        raise EnvironmentDiffers(str(error)) from error
    if found := order.environment.differences(here):
        raise EnvironmentDiffers("; ".join(found))
    with _classified(order), scratch_folder(order.task.seed) as folder:
        return _played(order, folder).model_dump_json()


@lru_cache(maxsize=RUNS)
def _environment_in(_run: str, engines: tuple[str, ...], files: tuple[str, ...]) -> CampaignEnvironment:
    """See ``environment_here``: once a campaign, since an engine takes longer to say its name than a task may cost."""
    return environment_here(engines, files)


def play_again(text: str) -> str:
    """Play one task, and leave its folder as the order says, which becomes that folder.

    Raises:
        OSError: it cannot be kept there. Else as ``play_task``.
    """
    order = TaskOrder.model_validate_json(text)
    assert order.folder is not None, "whoever plays again wants to see it"
    with _classified(order), scratch_folder(order.task.seed) as folder:
        result = _played(order.model_copy(update={"keep": Kept.NONE}), folder)
        _copy(folder, order.folder, order.folder)
        return result.model_dump_json()


@contextmanager
def _classified(order: TaskOrder) -> Iterator[None]:
    try:
        yield
    except KeyboardInterrupt:
        raise BrokenOff(f"seed {order.task.seed} was broken off") from None
    except OSError as error:
        if error.errno not in MACHINE:
            raise
        raise MachineTrouble(str(error)) from error


def _played(order: TaskOrder, folder: Path) -> TaskResult:
    task, digest, begun = order.task, order.environment.digest, time.monotonic()
    play = play_with_kills if task.faults.kills else play_here
    try:
        story = play(task, folder, order.film)
    except KilledWithLog as error:
        _require_machine(folder, error)
        result = crashed(task, "the game's program ended with an error", str(error), digest, host_and_cpu())
    except GameDied as error:
        _require_machine(folder, error)
        raise GameDied(f"{error}; {_last_words(folder)}") from error
    except Exception as error:
        _require_machine(folder, error)
        result = crashed(task, f"{type(error).__name__}: {error}", traceback.format_exc(), digest, host_and_cpu())
    else:
        _require_machine(folder, None)
        _require_alive(folder, story)
        story.wall_s = time.monotonic() - begun
        result = result_of(task, folder / GAME, story, digest)
    return result.model_copy(update={"game": _keep(order, folder, result.game)})


def _require_machine(folder: Path, error: BaseException | None) -> None:
    """Tell a machine's failure from a game's; by what was raised, or what the disk says now.

    Raises:
        MachineTrouble: it is one.
        KeyboardInterrupt: it was broken off, and something made another error of that, as compiled code does.
    """
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            raise error
        if isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno in MACHINE):
            raise MachineTrouble(str(error) or "there is not enough memory") from error
        error = error.__cause__ or error.__context__
    if full := full_disk(folder):
        raise MachineTrouble(full)


def _require_alive(folder: Path, story: TaskStory) -> None:
    """A world that has ended in order says how, whatever became of the game.

    Raises:
        GameDied: it does not.
    """
    run_dir = folder / GAME / "run"
    if story.completed or not run_dir.is_dir() or (run_dir / END_FILE).exists():
        return
    raise GameDied(f"{story.reason}; {_last_words(folder)}")


def _last_words(folder: Path) -> str:
    """Of every process of a game."""
    logs = [folder / LOG, *sorted((folder / GAME / "run").glob("*.log"))]
    return "; ".join(f"{log.name}: {last_words(log) or 'nothing'}" for log in logs if log.exists())


def _keep(order: TaskOrder, folder: Path, game: GameRow) -> GameRow:
    """Keep the folder of a game where that is wanted, and where the campaign's folder can be reached from here.

    Raises:
        MachineTrouble: it cannot be written there.
    """
    wanted = order.keep is Kept.ALL or (order.keep is Kept.FAILED and game.failed)
    if not wanted or order.folder is None or not (order.folder / CAMPAIGN_FILE).exists():
        return game
    kept = order.folder / GAMES_FOLDER / str(game.seed)
    shutil.rmtree(kept, ignore_errors=True)  # of a worker that was killed while it copied
    part = kept.with_name(f".{kept.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    try:
        _copy(folder, part, kept)
        part.rename(kept)
    except OSError as error:
        full = full_disk(part.parent)  # which it no longer is once that is gone
        shutil.rmtree(part, ignore_errors=True)
        raise MachineTrouble(full or f"{kept} cannot be kept: {_first_of(error)}") from error
    return game.model_copy(update={"folder": f"{GAMES_FOLDER}/{game.seed}"})


def _copy(folder: Path, to: Path, kept: Path) -> None:
    """Copy a game's folder, which will stand at ``kept``: its settings name the files that are beside them there."""
    shutil.copytree(folder, to, ignore=_no_record)
    before, after = (json.dumps(str(path), ensure_ascii=False)[1:-1] for path in (folder, kept.absolute()))
    for file in to.rglob(SETTINGS_FILE):
        file.write_text(file.read_text(encoding="utf-8").replace(before, after), encoding="utf-8")


def _first_of(error: OSError) -> str:
    """What went wrong first: copying a folder collects it all."""
    return str(error.args[0][0][2]) if isinstance(error, shutil.Error) else str(error)


def _no_record(folder: str, names: list[str]) -> list[str]:
    """Keys, sockets and locks."""
    return [name for name in names if name.startswith(".") or name == KEY_FILE or (Path(folder) / name).is_socket()]
