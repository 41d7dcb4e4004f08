"""A game that was really played, as a dataset: states are the telemetry's, pictures what is drawn at their ticks."""

from __future__ import annotations

import base64
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader

from app import UserError
from app.dataset.making import DatasetReport, make_dataset
from app.dataset.signals import state_row
from app.dataset.told import read_told
from app.dataset.wish import DatasetFormat, DatasetWish
from app.records.events import PlyEvent
from app.records.files import EVENTS_FILE, TRAJECTORY_FILE
from app.records.history import read_events
from app.records.telemetry import TELEMETRY_FILE, read_telemetry
from app.rig.simulation.film import FilmFailed
from app.rig.simulation.pictures import PicturesWish, draw_pictures, recorded_ticks
from tests.app.dataset.lerobot_reader import LeRobotReader

WIDTH, HEIGHT = 160, 120
QUIET = 20.0
"""Of a picture of this size, by its codec: root of the mean squared error, of 255 levels."""


@pytest.fixture(scope="module")
def game(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("played") / "game"
    played = subprocess.run(
        [
            sys.executable, "-P", "-m", "app.cli", "demo", "--pace", "fast", "--moves", "e4 d5", "--out", str(folder),
            "--headless", "--no-page", "--video-length", "1",
        ],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if "OpenGL" in played.stderr and not os.environ.get("CI"):
        pytest.skip(played.stderr)
    assert played.returncode == 0, played.stderr
    return folder


def make(game: Path, output: Path, **wish: Any) -> DatasetReport:
    whole = {"source": game, "output": output, "width": WIDTH, "height": HEIGHT, **wish}
    return make_dataset(DatasetWish(**whole), lambda done, whole: None, print)


@pytest.fixture(scope="module")
def made(game: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[DatasetReport, LeRobotReader]:
    told = list[tuple[int, int]]()
    output = tmp_path_factory.mktemp("made") / "set"
    wish = DatasetWish(source=game, output=output, width=WIDTH, height=HEIGHT)
    report = make_dataset(wish, lambda *done: told.append(done), print)
    assert told == [(0, 2), (1, 2), (2, 2)]
    return report, LeRobotReader(output)


def test_it_reads_back_as_lerobot_reads_it(made: tuple[DatasetReport, LeRobotReader]) -> None:
    report, dataset = made
    dataset.check()
    assert (report.episodes, report.games, report.left_out, report.skipped) == (2, 1, {}, ())
    assert report.frames == len(dataset.frames)
    assert dataset.tasks == ["move the white pawn from e2 to e4", "move the black pawn from d7 to d5"]


def test_each_state_is_the_telemetry_of_its_tick(made: tuple[DatasetReport, LeRobotReader], game: Path) -> None:
    _, dataset = made
    rows = {round(t, 6): one for t, one in read_telemetry(game / TELEMETRY_FILE)}
    for time, state, reference in zip(
        *(dataset.frames[name].to_pylist() for name in ("plant_time", "observation.state", "observation.reference")),
        strict=True,
    ):
        told = rows[round(time, 6)]
        assert state == np.array(state_row(told), dtype=np.float32).tolist()
        assert reference == np.array(told.reference, dtype=np.float32).tolist()


def test_episodes_are_whole_plies_from_home_to_home(made: tuple[DatasetReport, LeRobotReader], game: Path) -> None:
    _, dataset = made
    plies = [event for event in read_events(game / EVENTS_FILE) if isinstance(event, PlyEvent)]
    home = None
    for ply, episode in zip(plies, dataset.episodes.to_pylist(), strict=True):
        rows = dataset.frames.slice(episode["dataset_from_index"], episode["length"])
        time, state = rows["plant_time"].to_numpy(), np.array(rows["observation.state"].to_pylist())
        assert ply.real_s is not None
        assert time[-1] - time[0] == pytest.approx(ply.real_s, abs=0.08)
        assert np.diff(time) == pytest.approx(0.0396)
        ends = state[[0, -1], 6:9]  # the tool's position
        assert np.abs(state[[0, -1], 9:12]).max() < 0.02, "at rest"
        home = ends[0] if home is None else home
        assert ends == pytest.approx(np.array([home, home]), abs=0.002)
        assert np.ptp(state[:, 6:9], axis=0).max() > 0.05


def test_the_first_picture_of_an_episode_is_what_is_drawn_at_its_tick(
    made: tuple[DatasetReport, LeRobotReader], game: Path
) -> None:
    _, dataset = made
    told = read_told(game)
    starts = dataset.episodes["dataset_from_index"].to_pylist()
    times = [dataset.frames["plant_time"][start].as_py() for start in starts]
    ticks = told.tick[told.nearest(np.round(np.array(times) / 0.00088).astype(np.int64))]
    wish = PicturesWish(
        positions=game / TRAJECTORY_FILE, ticks=tuple(ticks.tolist()), views=("camera",), width=WIDTH, height=HEIGHT
    )
    drawn = [shown[0].astype(float) for shown in draw_pictures(wish)]
    seen = [dataset.item(start)["observation.images.camera"].astype(float) for start in starts]
    for number, picture in enumerate(drawn):
        errors = [float(np.sqrt(((one - picture) ** 2).mean())) for one in seen]
        assert errors[number] < QUIET
        assert errors[number] < errors[1 - number]


def test_episodes_as_mcap(game: Path, tmp_path: Path) -> None:
    output = tmp_path / "set"
    report = make(game, output, format=DatasetFormat.MCAP)
    index = [json.loads(line) for line in (output / "index.jsonl").read_text().splitlines()]
    assert [path.name for path in sorted(output.iterdir())] == [*(one["file"] for one in index), "index.jsonl"]
    assert report.frames == sum(one["frames"] for one in index)
    with (output / index[1]["file"]).open("rb") as file:
        reader = make_reader(file)
        found: dict[str, list[Any]] = {}
        for _, channel, message in reader.iter_messages():
            found.setdefault(channel.topic, []).append((message.log_time, json.loads(message.data)))
        (metadata,) = reader.iter_metadata()
    assert metadata.metadata["task"] == found["/task"][0][1]["task"] == "move the black pawn from d7 to d5"
    each = ("/observation/state", "/observation/reference", "/action", "/observation/images/camera", "/tf")
    assert {len(found[topic]) for topic in each} == {index[1]["frames"]}
    assert [when for when, _ in found["/action"]] == [39_600_000 * k for k in range(index[1]["frames"])]
    jpeg = base64.b64decode(found["/observation/images/camera"][0][1]["data"])
    assert cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR).shape == (HEIGHT, WIDTH, 3)
    assert {"/tf_static", "/scene/robot", "/scene/table"} < set(found)


def test_what_is_missing_is_one_sentence_and_leaves_nothing(game: Path, tmp_path: Path) -> None:
    bare = tmp_path / "bare"
    bare.mkdir()
    (bare / EVENTS_FILE).symlink_to(game / EVENTS_FILE)
    with pytest.raises(UserError, match=r"has no positions\.bin, from which pictures are drawn: .* --view none"):
        make(bare, tmp_path / "set")
    with pytest.raises(UserError, match=r"has no telemetry\.mcap with telemetry"):
        make(bare, tmp_path / "set", views=())
    with pytest.raises(UserError, match="there is no view 'moon': choose camera or film"):
        make(game, tmp_path / "set", views=("moon",))
    with pytest.raises(UserError, match="--fps 60 is more than was recorded"):
        make(game, tmp_path / "set", fps=60)
    assert [path.name for path in tmp_path.iterdir()] == ["bare"]


def test_games_that_lack_something_are_skipped_among_others(game: Path, tmp_path: Path) -> None:
    for name in ("1", "2", "3"):
        (tmp_path / "games" / name).mkdir(parents=True)
        (tmp_path / "games" / name / EVENTS_FILE).symlink_to(game / EVENTS_FILE)
    garbled = tmp_path / "games" / "3" / EVENTS_FILE
    garbled.unlink()
    garbled.write_text("nonsense\n{}\n")
    (tmp_path / "games" / "2" / TELEMETRY_FILE).symlink_to(game / TELEMETRY_FILE)
    report = make(tmp_path, tmp_path / "set", views=())
    assert (report.episodes, report.games) == (2, 1)
    assert [sentence.split()[0].rstrip(",") for sentence in report.skipped] == [
        str(garbled), str(tmp_path / "games" / "1"),
    ]  # fmt: skip
    games = LeRobotReader(tmp_path / "set").episodes["game"].to_pylist()
    assert games == ["games/2", "games/2"]


def test_pictures_of_ticks_that_were_not_recorded_are_refused(game: Path) -> None:
    positions = game / TRAJECTORY_FILE
    wish = PicturesWish(positions=positions, ticks=(1,), views=("film",), width=64, height=64)
    with pytest.raises(FilmFailed, match="holds no frame at tick 1: it is of another game"):
        list(draw_pictures(wish))
    with pytest.raises(FilmFailed, match="holds no positions that a film can be drawn from"):
        recorded_ticks(game / EVENTS_FILE)
