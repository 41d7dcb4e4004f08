"""From recorded games to a dataset: match by match, episode by episode, frame by frame."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from app import UserError
from app.dataset.demonstrations import Demonstration, LeftOut, Moments, demonstrations
from app.dataset.games import MatchPlies, match_folders, plies_of_match
from app.dataset.lerobot.writer import LeRobotWriter
from app.dataset.mcap_files import McapWriter
from app.dataset.staging import appearing
from app.dataset.told import read_told
from app.dataset.wish import DatasetFormat, DatasetWish
from app.dataset.writers import EpisodeWriter, folder_size
from app.records.files import TRAJECTORY_FILE, RecordError
from app.records.robot import RobotRecord, kept_robot
from app.records.rounds import rounds_of
from app.rig.simulation.film import Standpoint, standpoint
from app.rig.simulation.pictures import Pictures, PicturesWish, draw_pictures, recorded_ticks
from hardware.frozen import Frozen

Progress = Callable[[int, int], None]
"""Told how many plies are done, of how many."""
Said = Callable[[str], None]


class DatasetReport(Frozen):
    """What became of the games."""

    output: Path
    games: int
    """Whose plies are in it."""
    episodes: int
    frames: int
    plant_s: float
    """Of all episodes together, by their true times [s]."""
    left_out: dict[str, int]
    """Plies that are no episodes, by why."""
    skipped: tuple[str, ...]
    """Why whole matches are not in it, a sentence each."""
    size_bytes: int
    wall_s: float


@dataclass(slots=True)
class _EpisodeTally:
    """What is done so far."""

    whole: int
    done: int = 0
    episodes: int = 0
    frames: int = 0
    plant_s: float = 0.0
    games: set[str] = field(default_factory=set)
    left_out: Counter[str] = field(default_factory=Counter)
    skipped: list[str] = field(default_factory=list)

    def take(self, episode: Demonstration) -> None:
        self.episodes += 1
        self.frames += len(episode)
        self.plant_s += float(episode.time[-1] - episode.time[0])
        self.games.add(episode.ply.game)


def make_dataset(wish: DatasetWish, progress: Progress, said: Said) -> DatasetReport:
    """Make a dataset; under its name it is whole or not there.

    Args:
        wish: what is asked for.
        progress: told how far it is.
        said: told what was left out at the end of a record.

    Raises:
        UserError: there are no games, none of them has what is needed, or the dataset cannot be written.
    """
    began, views = time.monotonic(), _views(wish)
    matches, unreadable = list[MatchPlies](), list[str]()
    for home, games in match_folders(wish.source):
        try:
            matches.append(plies_of_match(home, games, wish.source, said))
        except RecordError as error:
            unreadable.append(str(error))
    tally = _EpisodeTally(sum(len(match.plies) for match in matches), skipped=unreadable)
    progress(0, tally.whole)
    with appearing(wish.output) as folder:
        writer = _writer(wish, folder, views)
        try:
            for match in matches:
                _add_match(match, wish, views, writer, tally, progress)
            if not tally.episodes:
                raise UserError(_nothing(wish, tally))
            writer.close()
        except BaseException:
            writer.drop()
            raise
    return DatasetReport(
        output=wish.output, games=len(tally.games), episodes=tally.episodes, frames=tally.frames,
        plant_s=tally.plant_s, left_out=dict(tally.left_out), skipped=tuple(tally.skipped),
        size_bytes=folder_size(wish.output), wall_s=time.monotonic() - began,
    )  # fmt: skip


def _views(wish: DatasetWish) -> dict[str, str | Standpoint]:
    """Views by the names they have in the dataset; those from anywhere are numbered."""
    views = dict[str, str | Standpoint]()
    for view in map(standpoint, wish.views):
        views[view if isinstance(view, str) else f"view{sum(name.startswith('view') for name in views) + 1}"] = view
    return views


def _writer(wish: DatasetWish, folder: Path, views: dict[str, str | Standpoint]) -> EpisodeWriter:
    if wish.format is DatasetFormat.MCAP:
        return McapWriter(folder)
    return LeRobotWriter(folder, tuple(views), (wish.width, wish.height), wish.fps)


def _nothing(wish: DatasetWish, tally: _EpisodeTally) -> str:
    if tally.skipped:
        return tally.skipped[0]
    reasons = ", ".join(f"{number} {why}" for why, number in tally.left_out.items())
    return f"of {tally.whole} plies of {wish.source} none can be an episode{': ' if reasons else ''}{reasons}"


def _add_match(
    match: MatchPlies, wish: DatasetWish, views: dict[str, str | Standpoint], writer: EpisodeWriter,
    tally: _EpisodeTally, progress: Progress,
) -> None:  # fmt: skip
    """Its episodes; a match without what is needed is skipped, and it is said why."""
    positions = match.folder / TRAJECTORY_FILE
    try:
        if not match.plies:
            raise UserError(f"{match.folder} holds no ply that an arm has played")
        pictured = recorded_ticks(_positions(positions)) if views else None
        moments = Moments(read_told(match.folder), pictured, wish.fps)
    except UserError as error:
        tally.skipped.append(str(error))
        tally.done += len(match.plies)
        return
    found = demonstrations(match.plies, moments, wish.failures)
    episodes = list(_kept(found, tally))
    ticks = tuple(tick for episode in episodes for tick in episode.tick.tolist())
    drawn = PicturesWish(
        positions=positions, ticks=ticks, views=tuple(views.values()), width=wish.width, height=wish.height,
        fine=wish.fine,
    )  # fmt: skip
    robot = _robot(match.folder)
    with closing(draw_pictures(drawn) if views and ticks else _no_pictures()) as pictures:
        for episode in episodes:
            _add_episode(episode, robot, tuple(views), pictures, writer)
            tally.take(episode)
            tally.done += 1
            progress(tally.done, tally.whole)


def _kept(found: Iterator[Demonstration | LeftOut], tally: _EpisodeTally) -> Iterator[Demonstration]:
    for one in found:
        if isinstance(one, LeftOut):
            tally.left_out[str(one)] += 1
            tally.done += 1
        else:
            yield one


def _add_episode(
    episode: Demonstration, robot: RobotRecord | None, views: tuple[str, ...], pictures: Iterator[Pictures],
    writer: EpisodeWriter,
) -> None:  # fmt: skip
    writer.begin(episode, robot)
    if views:
        for frame in range(len(episode)):
            writer.show(frame, dict(zip(views, next(pictures), strict=True)))
    writer.end()


def _no_pictures() -> Generator[Pictures]:
    yield from ()


def _positions(path: Path) -> Path:
    if not path.is_file():
        raise UserError(
            f"{path.parent} has no {path.name}, from which pictures are drawn: simulations with cameras record it, as "
            "'touchmove demo' does without --no-video, and campaigns with rig.positions = true or one game by "
            "'touchmove campaign repeat DIR SEED --film'; or say --view none for a dataset without pictures"
        )
    return path


def _robot(match: Path) -> RobotRecord | None:
    """What a match was played on, as far as it is told."""
    return next((found for found in map(kept_robot, (match, *rounds_of(match))) if found is not None), None)
