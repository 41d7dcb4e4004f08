"""The tree of settings: as a file, strictly read, with the command line above it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel
from typer.testing import CliRunner

from app.cli.commands import app
from app.motion import Profile
from app.settings.defaults import PlayerKind, Settings
from app.settings.files import as_toml, load_settings, meanings_of, settings_of
from app.settings.toml import ConfigError
from hardware.interfaces import Pace

TEXT = st.text(st.characters(codec="utf-8"), max_size=9)
CHANGES = st.fixed_dictionaries(
    {},
    optional={
        "rig.pace": st.sampled_from(Pace), "rig.profile": st.sampled_from(Profile), "rig.seed": st.integers(0, 9),
        "rig.video": st.booleans(), "rig.name": TEXT, "game.plies": st.integers(0, 99),
        "engine.options": st.dictionaries(TEXT, st.integers(-(2**60), 2**60) | st.booleans() | TEXT),
        "black.player": st.sampled_from(PlayerKind), "clock.time": st.just("5+3"), "vision.verify":
        st.booleans(), "game.replay": st.just(Path("games/a b.pgn")),
    },
)  # fmt: skip


@given(CHANGES)
def test_what_is_printed_is_read_back(tmp_path_factory: Any, changes: dict[str, Any]) -> None:
    settings = settings_of(changes)
    path = tmp_path_factory.mktemp("settings") / "all.toml"
    path.write_text(as_toml(settings), encoding="utf-8")
    assert load_settings(path) == settings


def test_every_field_is_explained() -> None:
    for section in (Settings(), *(value for _, value in Settings() if isinstance(value, BaseModel))):
        meanings = meanings_of(type(section))
        for name in type(section).model_fields:
            assert meanings.get(name) or isinstance(getattr(section, name), BaseModel), name


def written(folder: Path, text: str) -> Path:
    path = folder / "my.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_field_that_does_not_exist_is_refused_with_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"there is no setting rig\.sede: did you mean seed\?"):
        load_settings(written(tmp_path, "[rig]\nsede = 3\n"))
    with pytest.raises(ConfigError, match=r"cannot be read: .*: 'touchmove config' prints one"):
        load_settings(tmp_path / "none.toml")
    with pytest.raises(ConfigError, match=r"out: it should be the name of a file or folder, or be left out, not ''"):
        load_settings(written(tmp_path, 'out = ""\n'))


def test_an_option_counts_for_more_than_the_file_and_the_file_for_more_than_a_default(tmp_path: Path) -> None:
    file = written(tmp_path, '[rig]\nname = "board"\nseed = 7\n[game]\nmoves = "e4 e5"\nplies = 1\n')
    run = CliRunner().invoke(app, ["demo", "--config", str(file), "--moves", "d4 d5", "--out", str(tmp_path / "game")])
    assert run.exit_code == 0, run.output
    kept = Settings.model_validate_json((tmp_path / "game" / "settings.json").read_text())
    assert (kept.game.moves, kept.game.plies, kept.rig.seed) == ("d4 d5", 1, 7)
    shown = CliRunner().invoke(app, ["config", str(file)])
    assert 'moves = "e4 e5"' in shown.output


def test_a_side_has_one_strength_and_the_one_that_is_said_last(tmp_path: Path) -> None:
    both = written(tmp_path, "[black]\nelo = 1500\nskill = 5\n")
    with pytest.raises(ConfigError, match=r"black: elo and skill both set the strength: leave one of them out$"):
        load_settings(both)
    with pytest.raises(ConfigError, match=r"^black: elo and skill both set the strength: leave one of them out$"):
        settings_of({"black.elo": 1500, "black.skill": 5})
    skilled = written(tmp_path, "[black]\nskill = 5\n")
    assert settings_of({}, skilled).black.skill == 5
    chosen = settings_of({"black.elo": 1500}, skilled).black  # as by 'play --elo'
    assert (chosen.elo, chosen.skill) == (1500, None)


@pytest.mark.parametrize(("value", "said"), [("0.5", ", not 0.5"), ("[1]", ""), ("2026-01-01", "")])
def test_a_value_that_no_option_of_an_engine_has_is_named_with_those_it_may_have(
    tmp_path: Path, value: str, said: str
) -> None:
    sentence = rf"engine\.options\.Contempt: it should be true, false, a whole number or a text{said}$"
    with pytest.raises(ConfigError, match=sentence):
        load_settings(written(tmp_path, f"[engine.options]\nContempt = {value}\n"))
