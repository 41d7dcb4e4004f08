"""The robot in the record: every message fits its schema, frames are the model's, pieces stand where the game says."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from app.pieces.inventory import Stage, Transfer
from app.records.events import Purpose
from app.records.foxglove import scene as module
from app.records.foxglove.scene import (
    FIXED_TOPIC,
    FRAMES_TOPIC,
    PATH_TOPIC,
    PICTURE_TOPIC,
    PIECES_TOPIC,
    RATE,
    ROBOT_TOPIC,
    SCHEMAS,
    TABLE_TOPIC,
    TRACKING_TOPIC,
    thinned,
)
from app.records.telemetry import LOG_TOPIC, TELEMETRY_FILE, TOPIC, TelemetryRecorder, read_telemetry
from app.scene.frames import turned_by
from controller.model.constants import DeltaModel
from controller.model.reach import posture_at, tool_point_at
from controller.model.vectors import turn
from controller.protocol.datagram_fields import TELEMETRY
from controller.protocol.messages import Telemetry
from hardware.interfaces import Triple
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES, Kind
from hardware.table import Place, TableSettings
from tests.app.played_game import EVERY_KIND, LINE_OF_EVERY_KIND, PlayedGame

TICK = 0.00088
TELL = 16
"""Ticks from one telemetry to the next."""
TABLE, PARAMETERS = TableSettings(), load_parameters()
MODEL = DeltaModel(PARAMETERS)
BLANK = Telemetry.unpack(bytes(TELEMETRY.size))
LAYOUT = Path(__file__).parents[4] / "docs" / "foxglove-layout.json"


class Seen(NamedTuple):
    """A message that was read back."""

    topic: str
    stamp: int
    content: Any


def at(seconds: float, point: Triple, **changes: Any) -> Telemetry:
    """Telemetry of an arm whose tool is at a point, base frame."""
    a, b, c = posture_at(MODEL, np.array(point)).y.tolist()
    tick = round(seconds / TICK)
    told = BLANK._replace(tick=tick, angle=(a, b, c), position=point, reference=point, finger_position=0.012)
    return told._replace(**changes)


def moving(seconds: float) -> Telemetry:
    """Of an arm that is never at rest."""
    point = (0.1 * math.sin(seconds), 0.08 * math.cos(1.3 * seconds), 0.38 + 0.04 * math.sin(2.0 * seconds))
    return at(seconds, point, motion=1 + int(seconds))


def recorded(folder: Path, told: Callable[[float], Telemetry], until: float, since: float = 0.0) -> list[Seen]:
    """What a recorder in a folder makes of telemetry; the messages in the order of their times."""
    ticks = range(round(since / TICK), round(until / TICK), TELL)
    path = folder / TELEMETRY_FILE
    with TelemetryRecorder(path, TICK) as recorder:
        for tick in ticks:
            recorder.take(told(tick * TICK)._replace(tick=tick))
    assert recorder.lost == 0
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        seen = []
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            content = json.loads(message.data)
            assert channel.message_encoding == "json"
            if channel.topic in SCHEMAS:
                assert json.loads(schema.data) == SCHEMAS[channel.topic]
                assert schema.name == SCHEMAS[channel.topic]["title"]
                assert schema.encoding == "jsonschema"
                fits(content, SCHEMAS[channel.topic], channel.topic)
            seen.append(Seen(channel.topic, message.log_time, content))
    return seen


def fits(value: Any, schema: dict[str, Any], where: str) -> None:
    """A message has what its schema lists, all of it and nothing else, each of its type."""
    if "oneOf" in schema:
        assert value in [choice["const"] for choice in schema["oneOf"]], where
        return
    match schema["type"]:
        case "object":
            assert isinstance(value, dict), where
            if "properties" in schema:
                assert set(value) == set(schema["properties"]), where
                for name, inner in schema["properties"].items():
                    fits(value[name], inner, f"{where}.{name}")
        case "array":
            assert isinstance(value, list), where
            for one in value:
                fits(one, schema["items"], f"{where}[]")
        case "integer":
            assert type(value) is int, where
            assert schema.get("minimum", value) <= value <= schema.get("maximum", value), where
        case kind:
            assert type(value) in {"number": (int, float), "string": (str,), "boolean": (bool,)}[kind], where


def only(seen: list[Seen], topic: str) -> list[Seen]:
    return [one for one in seen if one.topic == topic]


def vector(content: dict[str, float]) -> Triple:
    return content["x"], content["y"], content["z"]


class Tree:
    """Transforms as a viewer puts them together."""

    def __init__(self, *messages: Seen) -> None:
        self.frames = {one["child_frame_id"]: one for seen in messages for one in seen.content["transforms"]}

    def point(self, frame: str, point: Triple, root: str) -> np.ndarray:
        while frame != root:
            one = self.frames[frame]
            q = one["rotation"]
            point_turned = turned_by((q["x"], q["y"], q["z"], q["w"]), point)
            x, y, z = (a + b for a, b in zip(point_turned, vector(one["translation"]), strict=True))
            point, frame = (x, y, z), one["parent_frame_id"]
        return np.array(point)


def entities(seen: Seen) -> dict[str, Any]:
    return {one["id"]: one for one in seen.content["entities"]}


def foot(entity: dict[str, Any]) -> tuple[Triple, Triple]:
    """The lowest point of a piece's axis in its frame, and where its top is."""
    ends = []
    for one in entity["cylinders"]:
        q = one["pose"]["orientation"]
        half = turned_by((q["x"], q["y"], q["z"], q["w"]), (0.0, 0.0, 0.5 * one["size"]["z"]))
        middle = vector(one["pose"]["position"])
        ends.append((tuple(np.subtract(middle, half).tolist()), tuple(np.add(middle, half).tolist())))
    first, last = ends[0][0], ends[-1][1]
    return first, last  # type: ignore[return-value]


@pytest.fixture
def played(tmp_path: Path) -> PlayedGame:
    """Plies of every kind; the first one ends at 2 or 3 s, see ``PlayedGame.play``."""
    return PlayedGame(tmp_path / "game", EVERY_KIND).play(LINE_OF_EVERY_KIND)


# the robot


def test_frames_are_where_the_model_s_forward_kinematics_has_them(played: PlayedGame) -> None:
    seen = recorded(played.record.folder, moving, 6.0)
    told = {one.stamp: one.content for one in only(seen, TOPIC)}
    (fixed,) = only(seen, FIXED_TOPIC)
    frames = only(seen, FRAMES_TOPIC)
    assert len(frames) > 50
    g = PARAMETERS.geometry
    for one in frames:
        tree, angle = Tree(fixed, one), told[one.stamp]["angle"]
        tool = tool_point_at(MODEL, np.array(angle))
        assert tree.point("tool", (0.0, 0.0, 0.0), "base") == pytest.approx(tool, abs=2e-5)
        assert tree.point("tool", (0.0, 0.0, 0.0), "board") == pytest.approx(TABLE.board_from_base(tool), abs=3e-5)
        assert tree.point("reference", (0.0, 0.0, 0.0), "base") == pytest.approx(told[one.stamp]["reference"], abs=2e-5)
        for side, finger in ((1, "finger_right"), (-1, "finger_left")):
            pad = tool + np.array([side * told[one.stamp]["finger_position"], 0.0, 0.0])
            assert tree.point(finger, (0.0, 0.0, 0.0), "base") == pytest.approx(pad, abs=2e-5)
        for arm in range(3):
            elbow = turn(arm, (0.0, g.base_radius + g.proximal_length * math.cos(angle[arm]),
                               g.proximal_length * math.sin(angle[arm])))  # fmt: skip
            end = tree.point(f"arm{arm + 1}/proximal", (0.0, 0.0, g.proximal_length), "base")
            assert end == pytest.approx(elbow, abs=3e-5)
            ends = [tree.point(f"arm{arm + 1}/rod_{rod}", (0.0, 0.0, g.distal_length), "base") for rod in "ab"]
            wrist = tool + np.array(turn(arm, (0.0, g.flange_radius, -g.gripper_height)))
            assert np.mean(ends, axis=0) == pytest.approx(wrist, abs=5e-5)


def test_what_rests_is_said_once_in_frames_that_there_are(played: PlayedGame) -> None:
    seen = recorded(played.record.folder, moving, 2.0)
    tree = Tree(*only(seen, FIXED_TOPIC), only(seen, FRAMES_TOPIC)[-1])
    (robot,), (table,) = only(seen, ROBOT_TOPIC), only(seen, TABLE_TOPIC)
    assert {one["frame_id"] for one in entities(robot).values()} == set(tree.frames)
    assert all(one["frame_locked"] for one in entities(robot).values())
    assert {one["frame_id"] for one in entities(table).values()} == {"board"}
    assert len(entities(table)["board"]["cubes"]) == 65
    lengths = {one["size"]["z"] for entity in entities(robot).values() for one in entity["cylinders"]}
    assert {PARAMETERS.geometry.proximal_length, PARAMETERS.geometry.distal_length} <= lengths


def test_frames_come_at_a_rate_and_seldom_at_rest(played: PlayedGame) -> None:
    def rests(seconds: float) -> Telemetry:
        return moving(seconds if seconds < 1.0 else 1.0 if seconds < 4.0 else seconds - 3.0)

    stamps = [one.stamp * 1e-9 for one in only(recorded(played.record.folder, rests, 5.0), FRAMES_TOPIC)]
    gaps = [after - before for before, after in pairwise(stamps)]
    assert all(gap >= 1.0 / RATE - 1e-6 for gap in gaps)
    assert sum(1.2 < stamp < 3.8 for stamp in stamps) <= 3
    assert sum(stamp < 1.0 for stamp in stamps) > 0.8 * RATE
    resting = max(stamp for stamp in stamps if stamp <= 4.0)
    assert 4.0 - resting <= 2.0 / RATE, "the last pose at rest is told before the first one after it"


def test_an_arm_without_a_pose_is_not_drawn(played: PlayedGame) -> None:
    seen = recorded(played.record.folder, lambda seconds: BLANK._replace(angle=(math.nan, 0.0, 0.0)), 1.0)
    assert not only(seen, FRAMES_TOPIC)
    assert len(only(seen, ROBOT_TOPIC)) == 1
    assert len(only(seen, TOPIC)) > 50


def test_without_a_robot_in_the_record_nothing_is_added(tmp_path: Path) -> None:
    assert {one.topic for one in recorded(tmp_path, moving, 1.0)} == {TOPIC, LOG_TOPIC}


# the pieces


def test_pieces_stand_where_the_inventory_says_after_each_ply(played: PlayedGame) -> None:
    seen = only(recorded(played.record.folder, moving, played.time + 1.0), PIECES_TOPIC)
    places = {piece.name: piece.place for piece in played.record.start.inventory}
    plies = [event for event in played.record.events if event.event == "ply"]
    assert len(plies) == len(LINE_OF_EVERY_KIND.split())
    for event in plies:
        places |= event.inventory
        shown = entities([one for one in seen if one.stamp <= round(event.plant_time * 1e9)][-1])
        assert set(shown) == set(places)
        for name, place in places.items():
            assert shown[name]["frame_id"] == "board"
            (x, y, z), (_, _, top) = foot(shown[name])
            assert (x, y, z) == pytest.approx((*TABLE.xy(Place.parse(place)), 0.0), abs=1e-5)
            assert top > 0.02, "upright"
    assert places == {piece.name: str(piece.place) for piece in played.inventory}


def test_a_piece_is_in_the_fingers_from_its_carry_to_its_release(tmp_path: Path) -> None:
    game = PlayedGame(tmp_path / "game")
    steps = (Stage.APPROACH, Stage.GRASP, Stage.CARRY, Stage.RELEASE)
    for number, stage in enumerate(steps, start=1):
        game.record.step("g1f3", 0, stage, float(number))
    seen = only(recorded(tmp_path / "game", moving, 5.0), PIECES_TOPIC)
    carried, name = seen[1:], "white-knight-g"
    assert [one.stamp for one in carried] == [3_000_000_000, 4_000_000_000]
    held, released = (entities(one)[name] for one in carried)
    assert held["frame_id"] == "tool"
    (x, y, z), (_, _, top) = foot(held)
    assert (x, y) == (0.0, 0.0)
    assert z == pytest.approx(PIECE_SHAPES[Kind.KNIGHT].grip_height, abs=1e-5), "its foot hangs below the pads"
    assert top < z, "upright: z of the tool's frame points down"
    assert foot(released)[0] == pytest.approx((*TABLE.xy(Place.parse("f3")), 0.0), abs=1e-5)
    others = {one for entity in carried for one, what in entities(entity).items() if what["frame_id"] == "tool"}
    assert others == {name}


def test_a_repair_is_followed_too_from_where_the_piece_was_seen(tmp_path: Path) -> None:
    game = PlayedGame(tmp_path / "game").play("Nf3")
    knight = game.inventory.find("white-knight-g")
    stands = game.inventory
    lost = type(knight)(knight.name, knight.kind, knight.colour, Place.parse("g5"))
    moved = type(stands).of((lost if piece.name == lost.name else piece for piece in stands), TABLE)
    game.record.found(moved, "f3 is empty", 4.0)
    seen_at = (0.101, 0.022)
    game.record.task(Purpose.REPAIR, "put the board right", [Transfer.of(lost, knight.place, seen_at)], 4.1)
    game.record.step(None, 0, Stage.GRASP, 4.5)
    game.record.step(None, 0, Stage.CARRY, 5.0)
    game.record.step(None, 0, Stage.RELEASE, 6.0)
    seen = {one.stamp: entities(one)[lost.name] for one in only(recorded(tmp_path / "game", moving, 7.0), PIECES_TOPIC)}
    assert foot(seen[4_000_000_000])[0][:2] == pytest.approx(TABLE.xy(Place.parse("g5")), abs=1e-5)
    assert foot(seen[4_500_000_000])[0][:2] == pytest.approx(seen_at, abs=1e-5)
    assert seen[5_000_000_000]["frame_id"] == "tool"
    assert foot(seen[6_000_000_000])[0][:2] == pytest.approx(TABLE.xy(Place.parse("f3")), abs=1e-5)


def test_a_record_that_is_gone_on_with_begins_where_it_stood(played: PlayedGame) -> None:
    """Of all that was before the first telemetry, only how it ended is told."""
    seen = only(recorded(played.record.folder, moving, played.time + 2.0, since=played.time + 1.0), PIECES_TOPIC)
    assert len(seen) == 1
    assert seen[0].stamp >= round(1e9 * played.time)
    places = {piece.name: str(piece.place) for piece in played.inventory}
    for name, entity in entities(seen[0]).items():
        assert foot(entity)[0][:2] == pytest.approx(TABLE.xy(Place.parse(places[name])), abs=1e-5)


def test_another_round_of_the_match_is_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.records.foxglove.tail._LOOK", 0.0)
    PlayedGame(tmp_path / "match").play("e4")
    second = PlayedGame(tmp_path / "match" / "game-2", "8/8/4k3/8/8/3Q4/8/4K2R w - - 0 1")
    seen = only(recorded(tmp_path / "match", moving, 4.0), PIECES_TOPIC)
    places = {piece.name: str(piece.place) for piece in second.inventory}
    assert any(
        all(
            foot(entity)[0][:2] == pytest.approx(TABLE.xy(Place.parse(places[name])), abs=1e-5)
            for name, entity in entities(one).items()
        )
        for one in seen
    )


def test_a_record_that_contradicts_itself_ends_the_scene_and_not_the_telemetry(played: PlayedGame) -> None:
    path = played.record.folder / "events.jsonl"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:2]) + lines[2].replace('"uci":"e5d6"', '"uci":"a1a1"') + "".join(lines[3:]))
    seen = recorded(played.record.folder, moving, 8.0)
    sentences = [one.content["message"] for one in only(seen, LOG_TOPIC)]
    assert sum("not shown in 3-D from here on" in sentence for sentence in sentences) == 1
    assert max(one.stamp for one in only(seen, FRAMES_TOPIC)) < 4_000_000_000
    assert len(list(read_telemetry(played.record.folder / TELEMETRY_FILE))) == len(only(seen, TOPIC)) > 500


# path, pictures, worst


def test_the_path_of_a_motion_lies_there_from_its_beginning(played: PlayedGame) -> None:
    seen = recorded(played.record.folder, moving, 4.0)
    told = only(seen, TOPIC)
    paths = only(seen, PATH_TOPIC)
    assert len(paths) == 4
    for path in paths:
        motion = next(one.content["motion"] for one in told if one.stamp == path.stamp)
        references = [one.content["reference"] for one in told if one.content["motion"] == motion]
        (entity,) = path.content["entities"]
        (line,) = entity["lines"]
        points = [vector(point) for point in line["points"]]
        assert entity["frame_id"] == "base"
        assert points[0] == pytest.approx(references[0], abs=2e-5)
        assert points[-1] == pytest.approx(references[-1], abs=2e-5)
        assert len(points) < 0.5 * len(references)


@given(st.lists(st.tuples(*[st.floats(-0.3, 0.3)] * 3), min_size=2, max_size=30))
def test_a_thinned_path_stays_near_all_of_its_points(points: list[Triple]) -> None:
    left = thinned(points, 0.02)
    assert (left[0], left[-1]) == (points[0], points[-1])
    remaining = iter(points)
    assert all(point in remaining for point in left), "some of them, in their order"
    for point in points:
        assert min(module._aside(point, a, b) for a, b in pairwise(left)) <= 0.02 + 1e-12


def test_pictures_are_the_record_s_at_their_plant_time(tmp_path: Path) -> None:
    game = PlayedGame(tmp_path / "game")
    (tmp_path / "game" / "frames").mkdir()
    (tmp_path / "secret.jpg").write_bytes(b"secret")
    pictures = {}
    for number in range(4):
        pictures[number] = bytes([number]) * 100
        (tmp_path / "game" / "frames" / f"ply-{number:03d}.jpg").write_bytes(pictures[number])
    names = {1: "frames/ply-001.jpg", 2: "../secret.jpg", 3: "frames/ply-003.jpg"}
    game.play("e4 e5 Nf3", lambda number: {"frame": names[number]})
    seen = only(recorded(tmp_path / "game", moving, game.time + 1.0), PICTURE_TOPIC)
    assert [base64.b64decode(one.content["data"]) for one in seen] == [pictures[0], pictures[1], pictures[3]]
    ends = [round(1e9 * e.plant_time) for e in game.record.events if e.event == "ply"]
    assert [one.stamp for one in seen][1:] == [ends[0], ends[2]]
    assert {one.content["format"] for one in seen} == {"jpeg"}


def test_peaks_between_two_messages_are_not_lost(played: PlayedGame) -> None:
    def peaks(seconds: float) -> Telemetry:
        tick = round(seconds / TICK)
        struck = tick == TELL * 101
        return moving(seconds)._replace(
            torque=(0.1, -7.5 if struck else 0.0, 0.0), tactile=(9.0 if struck else 1.0, 0.0)
        )

    seen = only(recorded(played.record.folder, peaks, 3.0), TRACKING_TOPIC)
    assert max(one.content["torque"] for one in seen) == 7.5
    assert max(one.content["tactile"] for one in seen) == 9.0
    assert sum(one.content["torque"] == 7.5 for one in seen) == 1


# the layout


def words(value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield key
            yield from words(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from words(inner)
    elif isinstance(value, str):
        yield value


def test_the_layout_names_only_what_a_record_has() -> None:
    layout = json.loads(LAYOUT.read_text(encoding="utf-8"))
    fields = {TOPIC: {field.name for field in TELEMETRY.fields}}
    fields |= {topic: set(schema["properties"]) for topic, schema in SCHEMAS.items()}
    named = [word for word in words(layout["configById"]) if word.startswith("/")]
    assert {FRAMES_TOPIC, PIECES_TOPIC, ROBOT_TOPIC, TABLE_TOPIC, PATH_TOPIC, PICTURE_TOPIC, LOG_TOPIC} & set(named)
    for word in named:
        topic, _, path = word.partition(".")
        assert topic in {*fields, LOG_TOPIC}, word
        if path:
            assert path.split("[")[0] in fields[topic], word
    panels = set(layout["configById"])

    def leaves(node: Any) -> Iterator[str]:
        if isinstance(node, str):
            yield node
        else:
            yield from leaves(node["first"])
            yield from leaves(node["second"])

    assert set(leaves(layout["layout"])) == panels
    assert {name.split("!")[0] for name in panels} >= {"3D", "Image", "Plot"}
