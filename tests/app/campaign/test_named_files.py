"""What a campaign's file names: found beside it, missed in one sentence, and part of its environment."""

from __future__ import annotations

from pathlib import Path

import pytest

from app import UserError
from app.campaign import environment
from app.campaign.drawing import draw
from app.campaign.environment import environment_here
from app.campaign.folder import load_spec
from app.campaign.named_files import engines_of, files_of
from app.campaign.running import _require_this_program
from app.campaign.scheduling import CampaignStopped
from app.campaign.spec import CampaignSpec, ChoiceRange
from app.campaign.tasks.rows import crashed
from app.campaign.troubles import EnvironmentDiffers
from app.campaign.workers import play_task as worker
from app.campaign.workers.order import TaskOrder
from app.settings.toml import ConfigError

NODES = "[draw]\nengine.nodes = 3\n"


def written(folder: Path, text: str) -> Path:
    path = folder / "campaign.toml"
    path.write_text(NODES + text, encoding="utf-8")
    return path


def program(path: Path, name: str = "Some 1") -> Path:
    """An engine that says its name and no more."""
    path.write_text(f"#!/bin/sh\nread line\necho id name {name}\necho uciok\nread line\n", encoding="utf-8")
    path.chmod(0o755)
    return path


@pytest.fixture(autouse=True)
def no_sources(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment, "_sources", lambda: "")


def test_files_and_engines_lie_beside_the_campaigns(tmp_path: Path) -> None:
    for name in ("a.bin", "b.bin"):
        (tmp_path / name).touch()
    program(tmp_path / "sf")
    (tmp_path / "tables").mkdir()
    absolute = tmp_path / "b.bin"
    found = load_spec(
        written(
            tmp_path,
            f"engine.book = {{one_of = ['a.bin', '{absolute}']}}\nwhite.path = 'sf'\nblack.path = 'true'\n"
            "engine.syzygy = 'tables'\n",
        )
    )
    assert found.draw["engine.book"] == ChoiceRange(one_of=(str(tmp_path / "a.bin"), str(absolute)))
    assert found.draw["white.path"] == str(tmp_path / "sf")
    assert found.draw["black.path"] == "true", "what is on PATH and not beside the file is found anywhere"
    assert files_of(found) == (str(tmp_path / "a.bin"), str(absolute), str(tmp_path / "tables"))


@pytest.mark.parametrize(
    ("text", "name", "file"),
    [
        ("engine.path = 'stockfisch'\n", "engine.path", "stockfisch"),
        ("engine.path = {one_of = ['fine', 'sf']}\n", "engine.path", "sf"),
        ("white.path = '/nonexistent/sf'\n", "white.path", "/nonexistent/sf"),
        ("black.path = 'campaign.toml'\n", "black.path", "campaign.toml"),
        ("vision.calibration = 'none.json'\n", "vision.calibration", "none.json"),
        ("engine.book = 'none.bin'\n", "engine.book", "none.bin"),
        ("engine.syzygy = 'campaign.toml'\n", "engine.syzygy", "campaign.toml"),
    ],
)
def test_what_is_named_and_not_there_is_said_by_its_name(tmp_path: Path, text: str, name: str, file: str) -> None:
    program(tmp_path / "fine")
    with pytest.raises(ConfigError) as caught:
        load_spec(written(tmp_path, text))
    assert f"campaign.toml: {name} names {tmp_path / file}, which is no " in str(caught.value)
    assert "\n" not in str(caught.value)


def test_every_engine_that_may_be_asked_is_compared(tmp_path: Path) -> None:
    one, two, three = (str(program(tmp_path / name, name)) for name in ("one", "two", "three"))

    def engines(text: str) -> tuple[str, ...]:
        return engines_of(load_spec(written(tmp_path, text)))

    assert engines("") == ("",)
    assert engines("engine.path = {one_of = ['one', 'two']}\n") == (one, two)
    assert engines("white.path = 'one'\n") == ("", one)
    assert engines("white.path = 'one'\nblack.path = 'two'\n") == ("", one, two), "the usual one opens"
    assert engines(f"white.path = 'one'\nblack.path = 'two'\ngame.fen = '{FEN}'\n") == (one, two)
    assert engines("white.path = 'one'\nblack.path = 'two'\nengine.path = 'three'\n") == (one, three, two)
    assert engines("white.path = 'one'\nstart.line = true\n") == ()
    here, there = environment_here((one, two), ()), environment_here((one, three), ())
    assert here.engine == "one, two"
    assert here.differences(there) == ("engine is one, three instead of one, two",)


FEN = "8/8/8/4k3/8/8/4P3/4K3 w - - 0 1"


def test_an_engine_or_a_file_that_a_worker_has_not_is_a_sentence(tmp_path: Path) -> None:
    mute = tmp_path / "mute"
    mute.write_text("#!/bin/sh\nexit 3\n", encoding="utf-8")
    mute.chmod(0o755)
    with pytest.raises(UserError, match=r"engine \S+/none cannot play on \S+ \(it is not there\): install it"):
        environment_here((str(tmp_path / "none"),), ())
    with pytest.raises(UserError, match=r"engine \S+/mute cannot play on \S+ \(it died with exit code 3\)"):
        environment_here((str(mute),), ())
    with pytest.raises(UserError, match=r"none\.bin, which the campaign names, cannot be read on .*\(No such file"):
        environment_here((), (str(tmp_path / "none.bin"),))


def test_a_folder_of_tables_is_compared_by_names_and_sizes(tmp_path: Path) -> None:
    (tmp_path / "KQvK.rtbw").write_bytes(b"123")
    before = environment_here((), (str(tmp_path),))
    (tmp_path / "KQvK.rtbw").write_bytes(b"1234")
    assert before.differences(environment_here((), (str(tmp_path),)))


def test_a_worker_that_stays_looks_at_files_once_a_campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    task = draw(CampaignSpec(draw={"start.line": True}), 0)
    monkeypatch.setattr(worker, "_played", lambda order, _folder: crashed(task, "", "", order.environment.digest))
    book = tmp_path / "book.bin"
    book.write_bytes(b"one")
    order = TaskOrder(task=task, environment=environment_here((), (str(book),)), engines=(), run="first")
    worker.play_task(order.model_dump_json())
    book.write_bytes(b"two")
    worker.play_task(order.model_dump_json())
    later = order.model_copy(update={"run": "second"})
    with pytest.raises(EnvironmentDiffers, match=r"files\.\S+book\.bin is [0-9a-f]{12} instead of [0-9a-f]{12}"):
        worker.play_task(later.model_dump_json())


def test_workers_of_a_cluster_are_of_the_program_that_draws() -> None:
    there = environment_here((), ())
    theirs = there.model_copy(update={"engine": "Stockfish 17", "files": {"book": "1"}, "threads": {"A": "1"}})
    _require_this_program(theirs)
    with pytest.raises(CampaignStopped, match="a worker is not as the others are: sources is 2 instead of "):
        _require_this_program(theirs.model_copy(update={"sources": "2"}))


def test_versions_differ_by_their_last_digit_and_digests_are_short() -> None:
    here = environment_here((), ()).model_copy(update={"packages": {"a": "18.1.0.dev20261101"}, "sources": "1" * 64})
    there = here.model_copy(update={"packages": {"a": "18.1.0.dev20261102"}, "sources": "2" * 64})
    assert here.differences(there) == (
        "packages.a is 18.1.0.dev20261102 instead of 18.1.0.dev20261101",
        "sources is 222222222222 instead of 111111111111",
    )
