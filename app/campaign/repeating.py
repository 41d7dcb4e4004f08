"""Plays one seed of a campaign again, alone, and says whether it came to the same."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor
from pathlib import Path

from app import UserError
from app.campaign.drawing import draw
from app.campaign.environment import environment_here
from app.campaign.folder import kept_campaign
from app.campaign.ledger import ledgers_in, results_in
from app.campaign.named_files import engines_of, files_of
from app.campaign.running import require_games
from app.campaign.schema import GAMES_FOLDER, MEASURED, GameRow, TaskResult
from app.campaign.troubles import BrokenOff, EnvironmentDiffers, GameDied, MachineTrouble
from app.campaign.workers.local_processes import LocalWorkers
from app.campaign.workers.order import Kept, TaskOrder
from app.campaign.workers.play_task import play_again
from app.records.files import AGAIN, GAME, TRAJECTORY_FILE
from app.rig.simulation.film import FilmWish, default_output, draw_film
from hardware.frozen import Frozen


class Repetition(Frozen):
    """A game of a campaign, and the same once more."""

    folder: Path
    """Where it lies now."""
    before: GameRow | None
    """As it was in the campaign; None: it has not been played there."""
    now: GameRow
    different: tuple[str, ...]
    """Columns in which it came to something else; rows of plies count as one, called plies."""
    environment: tuple[str, ...] = ()
    """What the environment has otherwise, a phrase each."""
    other_cpu: bool = False
    """It was played on another kind of processor, whose last bits may be others."""
    unfilmed: bool = False
    """A film was asked for, and it ended before there was anything to draw."""

    @property
    def holds(self) -> bool:
        """Whether it is the same, to the last bit of the world's state; of one that cannot be, whether it ended so."""
        if self.before is None:
            return not self.now.failed
        return not self.different if self.now.repeatable else self.before.outcome is self.now.outcome

    def sentences(self) -> Iterator[str]:
        """For people."""
        yield f"seed {self.now.seed} {self.now.outcome}: {self.now.reason}"
        if self.before is None:
            yield "it has no result in the campaign yet"
        elif not self.different:
            yield f"the same to the last bit: world state {self.now.world_state}, and every column"
        elif self.now.repeatable:
            yield f"NOT the same: {', '.join(self.different)}"
        else:
            yield (
                "not the same to the last bit, as it cannot be: lost datagrams, killed programs and hands before a "
                f"moving arm are met by wall time; it differs in {', '.join(self.different)}"
            )
        if self.unfilmed:
            yield "there is no film: it ended before there was anything to draw"
        if self.before is not None and self.environment:
            yield f"the environment is another one: {'; '.join(self.environment)}"
        if self.different and self.other_cpu:
            yield "it was played on another kind of processor, whose sums may differ in the last bit"


def repeat_seed(folder: Path, seed: int, output: Path, film: bool, drawn: Callable[[float, float], None]) -> Repetition:
    """Play a seed again.

    Args:
        folder: of the campaign.
        seed: of the game.
        output: where its folder is to lie; must not be there.
        film: it is filmed, from beginning to end.
        drawn: told how much of the film is drawn, and how much there is [s].

    Raises:
        UserError: there is no such campaign or seed, the folder is taken, or it crashes or cannot be played here.
    """
    kept = kept_campaign(folder)
    index = require_games(kept, folder, seed)
    try:
        task = draw(kept.spec, index)
    except ValueError as error:  # an older version may have allowed what this one does not
        raise UserError(f"the campaign in {folder} cannot be drawn by this version: {error}") from error
    if output.exists():
        raise UserError(f"{output} is there already: name another folder with --out")
    before = next((one for path in ledgers_in(folder) for one in results_in(path) if one.game.seed == seed), None)
    workers = LocalWorkers(1)
    try:
        engines = engines_of(kept.spec)
        here = workers.submit(environment_here, engines, files_of(kept.spec)).result()
        order = TaskOrder(
            task=task, environment=here, engines=engines, keep=Kept.ALL, folder=output.absolute(), film=film
        )
        now = TaskResult.model_validate_json(workers.submit(play_again, order.model_dump_json()).result())
    except (BrokenExecutor, GameDied, BrokenOff) as error:
        workers.stop()
        raise UserError(f"seed {seed} crashed: {error}") from error
    except (MachineTrouble, EnvironmentDiffers, OSError) as error:
        workers.stop()
        raise UserError(f"seed {seed} cannot be played here: {error}") from error
    except BaseException:
        workers.stop()
        raise
    workers.shutdown()
    positions = output / GAME / TRAJECTORY_FILE
    filmed = film and positions.is_file()
    if filmed:
        draw_film(FilmWish(positions=positions, output=default_output(output / GAME, "film")), drawn)
    return Repetition(
        folder=output, before=None if before is None else before.game, now=now.game,
        different=() if before is None else _different(before, now),
        environment=kept.environment.differences(here),
        other_cpu=before is not None and before.game.cpu not in (None, now.game.cpu), unfilmed=film and not filmed,
    )  # fmt: skip


def _different(before: TaskResult, now: TaskResult) -> tuple[str, ...]:
    left_out = {*MEASURED, "environment"}
    one, other = before.game.columns(), now.game.columns()
    return (
        *(name for name in one if name not in left_out and one[name] != other.get(name)),
        *(("plies",) if before.plies != now.plies else ()),
    )


def usual_output(folder: Path, seed: int) -> Path:
    """Where a game that is played again lies unless somebody says otherwise."""
    return folder / GAMES_FOLDER / f"{seed}{AGAIN}"
