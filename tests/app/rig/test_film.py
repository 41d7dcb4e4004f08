"""Films are drawn from recorded positions: of whatever view and size, also of a game that broke off."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from pathlib import Path

import av
import numpy as np
import pytest
from pydantic import ValidationError

from app import UserError
from app.records.files import FILM_FILE, TRAJECTORY_FILE
from app.records.film_start import film_begins
from app.rig.simulation.film import (
    FilmFailed,
    FilmWish,
    Standpoint,
    default_output,
    draw_film,
    positions_of,
    standpoint,
)
from app.rig.simulation.film_process import Encoder
from hardware.sim.plant.trajectory import TrajectoryHeader, TrajectoryWriter
from hardware.sim.process.construction import Construction
from hardware.sim.render.settings import LightSettings, SceneState
from tests.hardware.sim.process.test_world import settings_for

TICK = 0.00088
FIRST = 12345


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with positions: a king is carried up, and in the second half it is darker."""
    folder = tmp_path_factory.mktemp("game")
    settings = settings_for()
    model = Construction.of(settings).model(looks=True)
    header = TrajectoryHeader(period=TICK, every=45, positions=model.nq, world=json.loads(settings.model_dump_json()))
    file = TrajectoryWriter(folder / TRAJECTORY_FILE, header)
    positions = np.array(model.key_qpos[0])
    dark = SceneState(light=LightSettings(brightness=0.1, fill=0.1, ambient=0.1))
    for number in range(10):
        positions[model.joint("king").qposadr[0] + 2] = 0.02 * number
        file.keep(FIRST + 45 * number, positions, (dark if number >= 5 else SceneState()).model_dump_json())
    file.close()
    return folder


def pictures(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as film:
        return [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]


def test_an_encoder_that_has_failed_ends_no_film_as_if_it_were_whole(tmp_path: Path) -> None:
    encoder = Encoder(tmp_path / FILM_FILE, FilmWish(positions=tmp_path, output=tmp_path / FILM_FILE), 0.0)
    encoder.put((np.zeros((480, 640, 3), dtype=np.uint8), 0.0))

    def go_on() -> None:
        encoder.put((np.zeros((480, 640, 3), dtype=float), 1.0))  # type: ignore[arg-type]  # a bug
        encoder.put(None)

    with pytest.raises(ValueError, match="dtype"):
        go_on()


def draw(folder: Path, output: Path, **wish: object) -> list[tuple[float, float]]:
    told = list[tuple[float, float]]()
    whole = {"positions": positions_of(folder), "output": output, "width": 64, "height": 48, **wish}
    try:
        draw_film(FilmWish.model_validate(whole), lambda *so_far: told.append(so_far))
    except FilmFailed as error:
        if "OpenGL" in str(error) and not os.environ.get("CI"):
            pytest.skip(str(error))
        raise
    return told


def test_film_shows_what_was_recorded(recorded: Path, tmp_path: Path) -> None:
    output = tmp_path / FILM_FILE
    told = draw(recorded, output)
    assert told[-1] == pytest.approx((9 * 45 * TICK, 9 * 45 * TICK), abs=0.006)
    assert film_begins(output) == pytest.approx(FIRST * TICK, abs=1e-5)
    seen = pictures(output)
    assert len(seen) == 10
    assert seen[0].shape == (48, 64, 3)
    assert seen[4].mean() > 1.5 * seen[9].mean()
    assert [path.name for path in tmp_path.iterdir()] == [FILM_FILE]


def test_what_rests_is_drawn_once_and_shown_as_long(recorded: Path, tmp_path: Path) -> None:
    """An arm at rest trembles by micrometres."""
    settings = settings_for()
    model = Construction.of(settings).model(looks=True)
    header = TrajectoryHeader(period=TICK, every=45, positions=model.nq, world=json.loads(settings.model_dump_json()))
    file = TrajectoryWriter(tmp_path / TRAJECTORY_FILE, header)
    rng = np.random.default_rng(1)
    positions = np.array(model.key_qpos[0])
    number = 80
    for frame in range(number):
        file.keep(FIRST + 45 * frame, positions + rng.normal(0.0, 1e-6, positions.shape))
    file.close()
    draw(tmp_path, tmp_path / FILM_FILE)
    with av.open(str(tmp_path / FILM_FILE)) as film:
        times = [frame.time for frame in film.decode(video=0)]
    assert times == pytest.approx(
        [0.0, *np.arange(26, number - 1, 26) * 45 * TICK, (number - 1) * 45 * TICK], abs=0.021
    )


def test_part_of_a_film_from_anywhere(recorded: Path, tmp_path: Path) -> None:
    above = Standpoint(position=(0.01, 0.0, 0.9), target=(0.0, 0.0, 0.0))
    draw(recorded, tmp_path / "above.webm", camera=above, width=96, height=64, begin=0.1, length=0.2)
    seen = pictures(tmp_path / "above.webm")
    assert len(seen) == 5
    assert seen[0].shape == (64, 96, 3)
    assert film_begins(tmp_path / "above.webm") == pytest.approx((FIRST + 135) * TICK, abs=1e-5)


def test_game_that_broke_off_is_filmed_up_to_there(recorded: Path, tmp_path: Path) -> None:
    (tmp_path / TRAJECTORY_FILE).write_bytes((recorded / TRAJECTORY_FILE).read_bytes()[:-9])
    draw(tmp_path, tmp_path / FILM_FILE)
    assert len(pictures(tmp_path / FILM_FILE)) == 9


def test_film_that_is_broken_off_leaves_nothing(recorded: Path, tmp_path: Path) -> None:
    older = b"\x1aE\xdf\xa3 an older one"
    (tmp_path / FILM_FILE).write_bytes(older)
    drawn = list[tuple[float, float]]()

    def interrupted(*so_far: float) -> None:
        drawn.append(so_far)
        os.kill(os.getpid(), signal.SIGINT)  # after the first picture

    wish = FilmWish(positions=positions_of(recorded), output=tmp_path / FILM_FILE, width=2048, height=2048)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    try:
        with pytest.raises(KeyboardInterrupt):
            draw_film(wish, interrupted)
    finally:
        signal.signal(signal.SIGINT, before)
    assert len(drawn) == 1
    assert (tmp_path / FILM_FILE).read_bytes() == older
    assert [path.name for path in tmp_path.iterdir()] == [FILM_FILE]


def test_film_without_frames_is_refused(recorded: Path, tmp_path: Path) -> None:
    first_line = (recorded / TRAJECTORY_FILE).read_bytes().splitlines(keepends=True)[0]
    (tmp_path / TRAJECTORY_FILE).write_bytes(first_line)
    with pytest.raises(FilmFailed, match="contains no frame yet: film the game once it has begun"):
        draw(tmp_path, tmp_path / FILM_FILE)
    (tmp_path / TRAJECTORY_FILE).write_bytes(b"no positions")
    with pytest.raises(FilmFailed, match="holds no positions that a film can be drawn from"):
        draw(tmp_path, tmp_path / FILM_FILE)
    with pytest.raises(FilmFailed, match=r"nothing was recorded after 9 s: .* lasts 0\.4 s"):
        draw(recorded, tmp_path / FILM_FILE, begin=9.0)
    with pytest.raises(UserError, match="simulations that are drawn and filmed record positions"):
        positions_of(tmp_path / "elsewhere")


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("events.jsonl", r"a film is written as WebM: give its name the ending \.webm$"),
        ("film.xyz", r"a film is written as WebM: give its name the ending \.webm$"),
        ("other.webm", r"exists and is not a film: choose another file with --output$"),
        ("", r"is a folder: name a file in it with --output$"),
        ("folder.webm", r"is a folder: name a file in it with --output$"),
        ("device.webm", r"is not an ordinary file: choose another file with --output$"),
        (
            "other.webm/film.webm",
            r"(this is a file, and a folder is needed|Not a directory): choose another file with --output$",
        ),
        ("/proc/x/film.webm", r"^/proc/x: No such file or directory: choose another file with --output$"),
    ],
)
def test_a_film_replaces_nothing_but_a_film_and_is_refused_before_it_is_drawn(
    name: str, sentence: str, recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(subprocess, "Popen")  # nothing is drawn
    for kept in ("events.jsonl", "other.webm"):
        (tmp_path / kept).write_bytes(b"the only copy of a game")
    (tmp_path / "folder.webm").mkdir()
    (tmp_path / "device.webm").symlink_to("/dev/null")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(UserError, match=sentence):
        draw(recorded, tmp_path / name)
    assert sorted(tmp_path.iterdir()) == before
    assert (tmp_path / "events.jsonl").read_bytes() == (tmp_path / "other.webm").read_bytes()


def test_views_are_named_or_given_by_two_points(tmp_path: Path) -> None:
    assert standpoint("camera") == "camera"
    assert standpoint("0.5,-0.6,0.4:0,0,0.1") == Standpoint(position=(0.5, -0.6, 0.4), target=(0.0, 0.0, 0.1))
    with pytest.raises(
        UserError, match="there is no view 'above': choose camera or film, or give viewpoint and target"
    ):
        standpoint("above")
    with pytest.raises(UserError, match="has its target at its viewpoint"):
        standpoint("1,1,1:1,1,1")
    for far in ("1e30,0,0:0,0,0", "nan,0,0:0,0,1", "1e400,0,0:0,0,1", "0,0,1:0,-101,0"):
        with pytest.raises(UserError, match=f"'{far}' does not lie within 100 m of the board: give viewpoint"):
            standpoint(far)
    assert default_output(tmp_path, "film").name == FILM_FILE
    assert default_output(tmp_path, "camera").name == "game-camera.webm"
    with pytest.raises(ValidationError, match="multiple of 2"):
        FilmWish(positions=tmp_path, output=tmp_path, width=101)


def test_what_is_no_film_says_nothing(tmp_path: Path) -> None:
    (tmp_path / FILM_FILE).write_bytes(b"no film")
    assert film_begins(tmp_path / FILM_FILE) is None
    assert film_begins(tmp_path / "missing.webm") is None
