from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.campaign.drawing import draw, stream
from app.campaign.folder import load_spec
from app.campaign.schema import TaskKind
from app.campaign.spec import RESERVED, CampaignSpec, UniformRange, fields
from app.campaign.task import CampaignTask
from app.settings.defaults import Settings
from app.settings.toml import ConfigError
from hardware.piece_set import Colour

EXAMPLES = sorted((Path(__file__).parents[3] / "docs" / "examples").glob("campaign*.toml"))
KINGS = "8/8/8/4k3/8/8/4K3/8 w - - 0 1"
QUEENS = "4k3/8/8/8/8/8/QQQQQ3/4K3 b - - 0 1"
_RANGE_KEYS = "a range has from and to, and perhaps log; or one_of alone"
RANGES = {
    "engine.nodes": {"from": 10, "to": 1000, "log": True},
    "randomisation.piece_mass": {"from": 0.0, "to": 0.4},
    "rig.profile": {"one_of": ["default", "fast"]},
    "game.plies": 6,
}


def spec(**draw: object) -> CampaignSpec:
    return CampaignSpec.model_validate({"draw": {"engine.nodes": 300, **draw}})


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "campaign.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_seed_draws_the_same_each_time_and_survives_its_way_to_a_worker() -> None:
    one = spec(**RANGES)
    task = draw(one, 7)
    assert draw(CampaignSpec.model_validate({"draw": RANGES}), 7) == task
    assert CampaignTask.model_validate_json(task.model_dump_json()) == task
    assert task.seed == 8
    assert task.settings.rig.seed == 8
    assert task.settings.engine.nodes == task.drawn["engine.nodes"]
    assert isinstance(task.settings.engine.nodes, int)


def test_another_range_or_another_first_seed_moves_no_value() -> None:
    few = spec(**RANGES)
    more = spec(**RANGES, **{"faults.grip": {"from": 0.0, "to": 1.0}})
    later = CampaignSpec.model_validate({"first_seed": 5, "draw": RANGES})
    for index in range(20):
        assert draw(more, index).drawn.items() >= draw(few, index).drawn.items()
    assert draw(later, 0).drawn == draw(few, 4).drawn


def test_ranges_are_drawn_independently_and_evenly() -> None:
    one = spec(**RANGES)
    drawn = [draw(one, index).drawn for index in range(400)]
    mass, nodes = (np.array([one[name] for one in drawn]) for name in ("randomisation.piece_mass", "engine.nodes"))
    assert abs(float(np.corrcoef(mass, np.log(nodes))[0, 1])) < 0.12
    assert float(np.median(nodes)) == pytest.approx(100, rel=0.3)  # by its logarithm
    assert mass.min() < 0.02
    assert mass.max() > 0.38
    assert 150 < sum(one["rig.profile"] == "fast" for one in drawn) < 250
    assert stream("a", 1).random() != stream("b", 1).random()


def test_whole_numbers_include_both_ends() -> None:
    one = spec(**{"faults.knocks": {"from": 2, "to": 4}})
    assert {draw(one, index).faults.knocks for index in range(60)} == {2, 3, 4}
    assert UniformRange.model_validate({"from": 1, "to": 100, "log": True}).at(0.0, whole=True) == 1


def test_what_is_watched_and_who_sits_there_follows_from_the_faults() -> None:
    quiet = draw(spec(), 0).settings
    assert (quiet.rig.cameras, quiet.vision.verify, quiet.rig.person) == (False, None, None)
    knocked = draw(spec(**{"faults.knocks": 3}), 1).settings
    assert (knocked.rig.cameras, knocked.vision.verify, knocked.rig.person) == (True, True, Colour.BLACK)
    session = draw(CampaignSpec.model_validate({"kind": "session", "draw": {"engine.nodes": 9}}), 0)
    assert session.kind is TaskKind.SESSION
    assert session.settings.rig.cameras


def test_only_what_wall_time_has_a_part_in_cannot_repeat() -> None:
    assert draw(spec(**{"faults.grip": 0.5, "faults.knocks": 2}), 0).repeatable
    for name, value in (("faults.link_loss", 0.1), ("faults.kills", 1), ("faults.hands", 3), ("engine.threads", 2)):
        assert not draw(spec(**{name: value}), 0).repeatable


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[draw]\nengine.node = 3\n", "there is nothing called engine.node to draw: did you mean engine.nodes?"),
        (
            "[draw]\ngame.plies = 3\n",
            "give engine.nodes, such as 2000, and each game can be repeated; or engine.move_time",
        ),
        ("[draw]\nengine.nodes = {from = 5, to = 3}\n", "to = 3 is below from = 5: exchange them"),
        ("[draw]\nengine.nodes = {from = 0, to = 3, log = true}\n", "from = 0 has no logarithm"),
        ("[draw]\nengine.nodes = 3\nfaults.grip = {from = 0, to = 1.5}\n", ": faults.grip: "),
        ("[draw]\nengine.nodes = 3\nrig.profile = {one_of = ['fast', 'faster']}\n", "faster"),
        ("kind = 'setup'\n[draw]\nfaults.kills = 1\n", 'faults.kills is for kind = "game", not setup: leave it out'),
        ("kind = 'setup'\n[draw]\ngame.plies = 4\n", 'game.plies is for kind = "game" or "session", not setup: leave'),
        ("kind = 'setup'\n[draw]\nengine.nodes = 4\n", 'engine.nodes is for kind = "game" or "session", not setup: l'),
        ("kind = 'session'\n[draw]\nengine.nodes = 4\nstart.line = true\n", 'start.line is for kind = "game", not se'),
        ("sort = 'game'\n", "there is no setting sort"),
    ],
)
def test_a_file_that_cannot_be_played_is_refused_in_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_spec(written(tmp_path, text))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"game.standing = '{QUEENS}'", "game.standing: the position has 5 white queens"),
        ("game.standing = 'xx'", "game.standing is not a position (expected 8 rows"),
    ],
)
def test_positions_of_settings_up_are_tried_too(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_spec(written(tmp_path, f'kind = "setup"\n[draw]\n{text}\n'))
    assert str(caught.value).partition("campaign.toml: ")[2].startswith(said)


def test_of_many_pairs_some_are_tried(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tried = list[object]()
    monkeypatch.setattr("app.campaign.drawing._try", lambda _spec, drawn: tried.append(tuple(drawn.values())))
    several = "{one_of = [" + ", ".join(map(str, range(1, 101))) + "]}"
    load_spec(written(tmp_path, f"[draw]\nengine.nodes = {several}\ngame.plies = {several}\n"))
    assert len(set(tried)) == len(tried)
    assert 1 + 2 * 99 + 900 < len(tried) <= 1 + 2 * 99 + 1000


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("engine.name = 3", "there is nothing called engine.name to draw: did you mean engine.nodes?"),
        ("engine.nodes = {one_of = []}", "engine.nodes: one_of is empty: name at least one value"),
        ("engine.nodes = {from = 1, too = 10}", f"engine.nodes: {_RANGE_KEYS}; there is from, too"),
        ("engine.nodes = {from = 1}", f"engine.nodes: {_RANGE_KEYS}; there is from"),
        ("engine.nodes = {}", f"engine.nodes: {_RANGE_KEYS}; there is nothing"),
        ("engine.nodes = {from = 'a', to = 3}", "engine.nodes: from: it should be a number"),
        ("engine.nodes = {from = 0.4, to = 10, log = true}", "engine.nodes is a whole number: write from = 0.4 and"),
        ("start.line = {from = 0, to = 1}", "start.line is true or false, and has no from and to: use one_of = [true"),
        ("rig.profile = {from = 0, to = 1}", "rig.profile is no number, and has no from and to: use one_of with"),
        ("engine.nodes = 'many'", "engine.nodes: it should be a whole number"),
        ("rig.profile = 'faster'", "rig.profile: choose default"),
        ("start.line = 'no idea'", "start.line: it should be true or false"),
        ("engine.options.Hash = 1.5", "engine.options.Hash: it should be"),
        ("session.often = {knok = 1}", "session.often: there is no act knok: did you mean knock? There are move, ill"),
        ("session.often = {zzz = 1}", "session.often: there is no act zzz: choose move, illegal, knock, two, swap"),
        ("session.often = {knock = -1}", "session.often.knock: it should be at least 0, not -1"),
        ("session.acts = 3", 'session.acts is for kind = "session", not game: leave it out'),
        ("start.plies = 4\nstart.line = true", "start.plies and start.line exclude each other: leave one of them out"),
        ("start.line = true\ngame.fen = '8/8/8/4k3/8/8/4K3/8 w - - 0 1'", "start.line and game.fen exclude each other"),
        ("game.plies = 0", 'game.plies = 0 plays nothing: choose at least 1, or kind = "setup", which has no plies'),
        ("game.plies = {from = 0, to = 3}", "game.plies = 0 plays nothing"),
        (
            "rig.square = 900",
            "rig.square: a board of 900.0 mm squares with its trays fits nowhere below the base: choose",
        ),
        ("rig.square = 0.09", "rig.square: squares of 0.09 mm are too small: choose at least 30 mm"),
        ("rig.square = {from = 30, to = 900}", "rig.square: a board of 900.0 mm squares"),
        (
            "randomisation.friction = {from = -0.2, to = 0.2}",
            "randomisation.friction: it should be at least 0, not -0.2",
        ),
        ("game.fen = 'xx'", "game.fen is not a position (expected 8 rows"),
        (
            f"game.fen = {{one_of = ['{KINGS}', '{KINGS[:-9]} b - - 0 1', '8/8/8/8/8/8/8/8 w - - 0 1']}}",
            "game.fen is not a legal po",
        ),
        (f"game.fen = '{QUEENS}'", "game.fen: the position has 5 white queens"),
        ("game.moves = 'e4 e9'", 'game.moves: ply 2 of the line, "e9", is neither SAN nor UCI'),
        (f"game.moves = 'e4'\ngame.fen = '{KINGS}'", 'game.moves: ply 1 of the line, "e4", is not legal'),
        ("game.moves = ' '", "game.moves: it is ' ': give at least one move, such as e4, or leave it out"),
        ("clock.time = 'foo'", "clock.time: 'foo' is not a time control: write minutes"),
        ("black.time = {one_of = ['5+3', 'x']}\nwhite.time = '5'", "black.time: 'x' is not a time control"),
        ("white.time = '5+3'", "only one side has a time control: give both, or clock.time for both"),
        (
            "start.plies = {from = 0, to = 20}\nstart.line = {one_of = [false, true]}",
            "start.plies and start.line exclude each other: leave one of them out",
        ),
        ("rig.seed = 3", "rig.seed is the campaign's own: say first_seed"),
        ("out = 'there'", "out is the campaign's own: say --out on the command line"),
        ("rig.pace = 'fast'", "rig.pace is the campaign's own: it is always fast; leave it out"),
        ("page.on = true", "page.on is the campaign's own: nobody looks on; leave it out"),
        ("terminal.speak = true", "terminal.speak is the campaign's own: nobody listens"),
        ("online.token_file = 'x'", "online.token_file is the campaign's own: nothing is played on Lichess"),
        ("practice.coach = true", "practice.coach is the campaign's own: nobody learns"),
        ("link.port = {from = 1, to = 9}", "link.port is the campaign's own: one robot plays alone"),
    ],
)
def test_a_sentence_has_the_name_as_it_is_in_the_file_and_the_remedy(tmp_path: Path, text: str, said: str) -> None:
    nodes = "" if text.startswith("engine.nodes") else "engine.nodes = 3\n"
    kind = 'kind = "session"\n' if text.startswith("session.often") else ""
    with pytest.raises(ConfigError) as caught:
        load_spec(written(tmp_path, f"{kind}[draw]\n{nodes}{text}\n"))
    _, _, sentence = str(caught.value).partition("campaign.toml: ")
    assert sentence.startswith(said), sentence
    assert "what is there" not in sentence
    assert "\n" not in sentence


def test_what_is_reserved_is_a_setting() -> None:
    sections = Settings()
    for name in RESERVED:
        value: object = sections
        for part in name.split("."):
            value = getattr(value, part)
        assert name not in fields()


def test_names_may_be_written_as_tables_or_dotted(tmp_path: Path) -> None:
    dotted = load_spec(
        written(tmp_path, "[draw]\nengine.nodes = 3\nrandomisation.devices.cogging = {from=0, to=0.1}\n")
    )
    tables = load_spec(
        written(tmp_path, "[draw.engine]\nnodes = 3\n[draw.randomisation.devices]\ncogging={from=0,to=0.1}")
    )
    assert dotted == tables
    assert dotted.ranges == {"randomisation.devices.cogging": UniformRange.model_validate({"from": 0, "to": 0.1})}
    acts = load_spec(
        written(tmp_path, "kind='session'\n[draw]\nengine.nodes=3\nsession.often = {knock = 2, move = 2}\n")
    )
    assert sorted(draw(acts, 0).session.shares.values()) == [0.5, 0.5]


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_the_examples_can_be_drawn(example: Path) -> None:
    found = load_spec(example)
    assert {draw(found, index).seed for index in range(3)} == set(range(found.first_seed, found.first_seed + 3))
