"""The page of a record: whole and safe HTML, every figure from the events, whatever state the record is in."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from app.cli.commands import app
from app.pieces.inventory import MoveKind, Transfer
from app.records import PlyEvent, PlyOutcome, RecordError, read_events
from app.records.events import Purpose
from app.report import REPORT_PAGE, report_page, write_report_pages
from app.report.markup import Html, tag
from app.report.pictures import MOST, MOST_OF_TROUBLE, evenly
from app.report.source import read_source
from hardware.parameters import RobotParameters, load_parameters
from hardware.table import Place
from tests.app.played_game import EVERY_KIND, LINE_OF_EVERY_KIND, PlayedGame

VOID = {"meta", "img", "br", "hr", "col"}
SHUFFLE = "Nf3 Nf6 Ng1 Ng8 "


class Walk(HTMLParser):
    """All that a page is made of; fails where an element is not closed in its order."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.texts: list[tuple[str, str]] = []
        """The element that a text stands in, and the text."""
        self.feed(page)
        self.close()
        assert not self.open, f"{self.open} are not closed"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append((self.open[-1] if self.open else "", data))

    def all(self, name: str) -> list[dict[str, str]]:
        return [attributes for element, attributes in self.elements if element == name]

    def said(self, name: str) -> list[str]:
        return [text for element, text in self.texts if element == name]

    @property
    def text(self) -> str:
        return " ".join(text for element, text in self.texts if element != "style")


def page_of(folder: Path) -> Walk:
    return Walk(report_page(read_source(folder)))


def picture(folder: Path, number: int, seed: int = 0, size: tuple[int, int] = (480, 640)) -> str:
    """Noise, which no encoder makes small."""
    name = f"frames/ply-{number:03d}.jpg"
    (folder / "frames").mkdir(exist_ok=True)
    pixels = np.random.default_rng(seed + number).integers(0, 255, (*size, 3), dtype=np.uint8)
    cv2.imwrite(str(folder / name), pixels)
    return name


# ------------------------------------------------------------------------------------------------------- what is in it


def test_every_mark_and_row_says_its_ply_and_is_an_event_s(game: PlayedGame) -> None:
    page = page_of(game.record.folder)
    events = {
        event.ply: event for event in read_events(game.record.folder / "events.jsonl") if isinstance(event, PlyEvent)
    }
    assert len(events) == len(LINE_OF_EVERY_KIND.split())
    marks = [text for text in page.said("title") if text.startswith("ply ")]
    assert len(marks) > 5 * len(events), "each chart marks each ply"
    for text in marks:
        found = re.match(r"ply (\d+)", text)
        assert found is not None
        assert int(found[1]) in events
    for number, event in events.items():
        times = [text for text in marks if text.startswith(f"ply {number},") and text.endswith(" s")]
        assert {text.rsplit(" ", 2)[1] for text in times} == {f"{event.real_s:.2f}"}
        assert f"{event.peak_torque_Nm:.2f}" in page.said("td")
        assert event.score in page.said("td")


def test_all_kinds_have_their_own_shape_and_their_times(game: PlayedGame) -> None:
    page = page_of(game.record.folder)
    names = {"capture", "castling", "en passant", "promotion"}
    assert names <= set(page.said("th")), "rows of the table by kind"
    assert names <= set(page.said("text")), "and of the chart"
    shapes = {
        (element, attributes["class"])
        for element, attributes in page.elements
        if attributes.get("class", "").startswith("m k-")
    }
    assert {look for _, look in shapes} == {f"m k-{kind.value}" for kind in MoveKind if kind is not MoveKind.QUIET}
    triangles = [a["points"] for e, a in page.elements if e == "polygon" and a["class"] == "m k-en_passant"]
    others = [a["points"] for e, a in page.elements if e == "polygon" and a["class"] == "m k-promotion"]
    assert triangles
    assert others
    assert sorted(float(p.split(",")[1]) for p in triangles[0].split())[1:] != sorted(
        float(p.split(",")[1]) for p in others[0].split()
    )[1:]  # fmt: skip


def test_every_chart_has_its_numbers_beside_it_and_says_what_it_shows(game: PlayedGame) -> None:
    page = page_of(game.record.folder)
    pictures = [one for one in page.all("svg") if one.get("role") == "img"]
    assert len(pictures) >= 5
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    for one in pictures:
        assert one["aria-labelledby"] in ids
        assert one["aria-describedby"] in ids
    assert len(page.all("details")) >= len(pictures)
    assert all(head.get("scope") in {"col", "row"} for head in page.all("th"))
    assert len(page.all("caption")) == len(page.all("table"))
    levels = [int(element[1]) for element, _ in page.elements if re.fullmatch(r"h\d", element)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))


def test_limits_are_those_of_the_robot_that_played(tmp_path: Path) -> None:
    other = load_parameters().model_dump()
    other["drive"]["peak_torque"] = 6.6
    weaker = RobotParameters.model_validate(other)
    PlayedGame(tmp_path / "a", EVERY_KIND).play("exd6")
    PlayedGame(tmp_path / "b", EVERY_KIND, parameters=weaker).play("exd6")
    usual = load_parameters().drive.peak_torque
    assert f"peak of the drives, {usual:g} N m" in page_of(tmp_path / "a").said("text")
    assert "peak of the drives, 6.6 N m" in page_of(tmp_path / "b").said("text")
    (tmp_path / "a" / "robot.json").unlink()
    page = page_of(tmp_path / "a")
    assert not any("peak of the drives" in text for text in page.said("text"))
    assert "does not say which robot" in page.text


def test_squares_show_the_farthest_placement_and_whether_a_hand_did_it(tmp_path: Path) -> None:
    game = PlayedGame(tmp_path / "game")
    far = {3: {"white-knight-g": 4.25}, 5: {"white-knight-g": 0.5}}
    game.play(
        "Nf3 Nf6 Ng1 Ng8 Nf3",
        lambda n: {"placement_mm": far.get(n, {"white-knight-g": 0.02}), "by": "hand" if n == 3 else "arm"}
        if n % 2 else {"placement_mm": {}},
    )  # fmt: skip
    page = page_of(game.record.folder)
    titles = [text for text in page.said("title") if "white-knight-g on" in text]
    assert titles == ["ply 3, white-knight-g on g1: 4.250 mm", "ply 5, white-knight-g on f3: 0.500 mm"]
    assert [one["class"] for one in page.all("rect") if one.get("class", "").endswith("by-hand")] == ["q5 by-hand"]


def test_a_set_up_is_nothing_that_went_wrong(tmp_path: Path) -> None:
    game = PlayedGame(tmp_path / "game")
    pawn = game.inventory.find("white-pawn-e")
    game.record.task(Purpose.SET_UP, "set the board up", [Transfer.of(pawn, Place.parse("e3"))], 2.0)
    moved = game.inventory.after_all([Transfer.of(pawn, Place.parse("e3"))])
    game.record.task_done(moved, PlyOutcome(real=1.5, physical_ok=True), 4.0)
    game.record.end("*", "set up", 4.0)
    page = page_of(game.record.folder)
    assert "Nothing went wrong" in page.text
    assert "Set the board up. The arm started: white pawn e from e2 to e3." in page.text
    assert "Done by the arm in 1.50 s. All pieces then stood where they should." in page.text


def test_what_went_wrong_is_told_in_sentences(tmp_path: Path) -> None:
    smooth = PlayedGame(tmp_path / "smooth").play("Nf3")
    smooth.record.end("*", "left", smooth.time)
    assert "Nothing went wrong" in page_of(smooth.record.folder).text
    game = PlayedGame(tmp_path / "game").play("Nf3")
    game.record.trouble("illegal", ("b1", "b4"), "the knight from b1 must not go to b4", None, 4.0)
    game.record.trouble("missing", ("b1",), "b1 is empty", "arm", 4.5)
    game.record.trouble("legal", ("e2",), "this looks like e4, but not clearly", None, 5.0)
    page = page_of(game.record.folder)
    assert "3 things went wrong at the board: 1 put right by the arm, 2 noted." in page.text
    assert "The knight from b1 must not go to b4. It was noted." in page.text
    assert "It reported 3 times, and was not sure 1 time." in page.text
    assert "after ply 1, at 4.50 s · seen: missing" in page.text


def test_clocks_and_scores_at_the_edges(tmp_path: Path) -> None:
    game = PlayedGame(tmp_path / "game", time_control="180+2")
    assert "Clocks" not in page_of(game.record.folder).said("h3")
    game.play("f3 e5 g4 Qh4#", lambda n: {"clocks": {True: 180.0 - n, False: 181.0 - n}})
    path = game.record.folder / "events.jsonl"
    path.write_text(re.sub(r'"score":"\+1.24"', '"score":"#-0"', path.read_text()))
    page = page_of(game.record.folder)
    assert "Clocks" in page.said("h3")
    assert "176.00" in page.said("td")
    assert any(text == "ply 4, 2… Qh4#: #-0" for text in page.said("title"))


def test_a_record_that_broke_off_says_so_and_what_was_under_way(game: PlayedGame) -> None:
    path = game.record.folder / "events.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    assert json.loads(lines[-2])["event"] == "step"
    path.write_bytes(b"".join(lines[:-1]) + lines[-1][:40])
    told: list[str] = []
    page = Walk(report_page(read_source(game.record.folder, told.append)))
    assert len(told) == 1
    assert "cut off or garbled" in told[0]
    assert "The record breaks off here" in page.text
    assert "Under way was d1h1, in its approach" in page.text
    assert told[0] in page.text


def test_a_record_without_a_ply(tmp_path: Path) -> None:
    game = PlayedGame(tmp_path / "game")
    page = page_of(game.record.folder)
    assert "No ply was done." in page.text
    assert "there is nothing to draw" in page.text


def test_ended_games_say_how(game: PlayedGame) -> None:
    game.record.end("1/2-1/2", "threefold repetition", game.time)
    page = page_of(game.record.folder)
    assert "1/2-1/2: threefold repetition" in page.text
    assert "breaks off" not in page.text


def test_plies_that_contradict_each_other_are_refused(game: PlayedGame) -> None:
    path = game.record.folder / "events.jsonl"
    path.write_text(path.read_text().replace('"ply":3,"event":"ply"', '"ply":33333,"event":"ply"'))
    with pytest.raises(RecordError, match=r"contradicts those before it: ply 33333 follows ply 2"):
        read_source(game.record.folder)


# ------------------------------------------------------------------------------------------------------ safe, by itself


def test_a_page_needs_nothing_and_runs_nothing(game: PlayedGame) -> None:
    picture(game.record.folder, 0)
    text = report_page(read_source(game.record.folder))
    page = Walk(text)
    assert not page.all("script")
    assert not page.all("link")
    assert len(page.all("img")) == 1
    for _, attributes in page.elements:
        assert "style" not in attributes
        assert not [name for name in attributes if name.startswith("on")]
        assert attributes.get("src", "data:").startswith("data:image/jpeg;base64,") or "src" not in attributes
    assert not re.search(r"url\(|@import", text)
    assert set(re.findall(r"https?://[^\"' ]*", text)) <= {"http://www.w3.org/2000/svg"}
    (policy,) = [one["content"] for one in page.all("meta") if one.get("http-equiv") == "Content-Security-Policy"]
    (style,) = page.said("style")
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    assert policy.startswith("default-src 'none';")
    assert f"style-src 'sha256-{digest}'" in policy


HOSTILE = [
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "</title></style><h1>x",
    "&lt;b&gt; ' ` =",
    "\u202egnp.exe",
    "a\x00b\x1b[31m",
]


@pytest.mark.parametrize("name", HOSTILE)
def test_names_and_comments_change_no_markup(tmp_path: Path, name: str) -> None:
    """The same elements with the same attributes stand on the page, whatever a file calls the players."""
    pages = []
    for folder, called in (("plain", "Anna"), ("hostile", name)):
        game = PlayedGame(tmp_path / folder, white=called, black=called)
        game.play("e4 e5", lambda n, called=called: {"comment": called, "failures": (called,)})
        game.record.trouble("illegal", (called,), called, None, 4.0)
        pages.append(page_of(tmp_path / folder))
    plain, hostile = pages
    assert [element for element, _ in hostile.elements] == [element for element, _ in plain.elements]
    names = [(set(a), a.get("class"), a.get("id")) for _, a in plain.elements]
    assert [(set(a), a.get("class"), a.get("id")) for _, a in hostile.elements] == names
    assert "\u202e" not in hostile.text
    assert "\x00" not in hostile.text
    assert "\x1b" not in hostile.text


@given(st.text(), st.text())
def test_what_is_put_into_markup_comes_out_as_it_went_in(inside: str, attribute: str) -> None:
    def shown(text: str) -> bool:
        return "�" not in tag("p", text)

    walk = Walk(tag("div", tag("p", inside, title=attribute), Html("<b>bold</b>")))
    assert [element for element, _ in walk.elements] == ["div", "p", "b"]
    if shown(inside) and "\r" not in inside:
        assert "".join(walk.said("p")) == inside
    if shown(attribute) and "\r" not in attribute:
        assert walk.all("p")[0]["title"] == attribute


def test_only_pictures_of_the_record_are_shown(game: PlayedGame, tmp_path: Path) -> None:
    secret = tmp_path / "secret.jpg"
    cv2.imwrite(str(secret), np.zeros((20, 20, 3), dtype=np.uint8))
    path = game.record.folder / "events.jsonl"
    for name in ("../secret.jpg", str(secret), "frames/../../secret.jpg"):
        path.write_text(re.sub(r'"frame":(null|"[^"]*")', f'"frame":"{name}"', path.read_text()))
        assert not page_of(game.record.folder).all("img"), name


def test_a_picture_that_is_none_is_left_out(game: PlayedGame) -> None:
    (game.record.folder / "frames").mkdir()
    (game.record.folder / "frames" / "ply-000.jpg").write_bytes(b"no picture")
    (game.record.folder / "frames" / "ply-001.jpg").write_bytes(b"")
    assert "The record holds no pictures." in page_of(game.record.folder).text


def test_sixty_plies_with_pictures_of_noise_stay_small(tmp_path: Path) -> None:
    game = PlayedGame(tmp_path / "game")
    (tmp_path / "game" / "frames").mkdir()
    picture(tmp_path / "game", 0)
    game.play(SHUFFLE * 15, lambda n: {"frame": picture(tmp_path / "game", n)})
    for ply in range(1, 61):
        game.record.trouble("missing", ("e4",), "e4 is empty", "arm", float(ply))
    (page,) = write_report_pages(tmp_path / "game")
    assert page.stat().st_size < 5e6
    shown = Walk(page.read_text()).all("img")
    assert MOST <= len(shown) <= MOST + MOST_OF_TROUBLE
    assert all(one["alt"] for one in shown)


@given(st.lists(st.integers(0, 500), unique=True, max_size=200).map(sorted), st.integers(2, 40))
def test_pictures_are_chosen_evenly_first_and_last_among_them(numbers: list[int], most: int) -> None:
    chosen = evenly(numbers, most)
    assert list(chosen) == sorted(set(chosen))
    assert set(chosen) <= set(numbers)
    assert len(chosen) == min(most, len(numbers))
    if numbers:
        assert (chosen[0], chosen[-1]) == (numbers[0], numbers[-1])
        places = [numbers.index(one) for one in chosen]
        gaps = [after - before for before, after in pairwise(places)]
        assert not gaps or max(gaps) - min(gaps) <= 1


# --------------------------------------------------------------------------------------------------- match and command


def test_a_match_has_a_page_for_each_round_and_links_that_lead_there(tmp_path: Path) -> None:
    match = tmp_path / "match"
    for folder, white in (
        (match, "one"),
        (match / "set-up-2", "nobody"),
        (match / "game-2", "two"),
        (match / "game-10", "ten"),
    ):
        PlayedGame(folder, white=white).play("e4")
    (match / "game-3").mkdir()  # without a record
    pages = write_report_pages(match)
    rounds = [match, match / "set-up-2", match / "game-2", match / "game-10"]
    assert list(pages) == [folder / REPORT_PAGE for folder in rounds]
    for page in pages:
        walk = Walk(page.read_text())
        assert len(walk.all("a")) == 3
        targets = {(page.parent / one["href"]).resolve() for one in walk.all("a")}
        assert targets == {other.resolve() for other in pages} - {page.resolve()}
        assert [one for _, one in walk.elements if one.get("aria-current") == "page"]
    for page in pages:
        page.unlink()
    assert write_report_pages(match / "game-2") == (match / "game-2" / REPORT_PAGE,)
    assert not (match / REPORT_PAGE).exists()


def test_the_command_says_where_and_leaves_json_as_it_is(game: PlayedGame, tmp_path: Path) -> None:
    folder = str(game.record.folder)
    plain = CliRunner().invoke(app, ["report", folder, "--json"])
    run = CliRunner().invoke(app, ["report", folder, "--html"])
    assert run.stdout.splitlines() == [str(game.record.folder / REPORT_PAGE)]
    assert run.exit_code == plain.exit_code == 1, "the record breaks off"
    both = CliRunner().invoke(app, ["report", folder, "--html", "--json"])
    assert both.stdout == plain.stdout
    nothing = CliRunner().invoke(app, ["report", str(tmp_path / "nothing"), "--html"])
    assert nothing.exit_code == 2
    assert "cannot be read" in nothing.stderr


def test_garbage_in_a_record_is_shown_or_refused_in_a_sentence(game: PlayedGame) -> None:
    path = game.record.folder / "events.jsonl"
    events: list[dict[str, Any]] = [json.loads(line) for line in path.read_text().splitlines()]
    for event in events:
        if event["event"] == "ply":
            event |= {"score": "+nan", "fen": "", "san": "x" * 300, "inventory": {"white-rook-h": "L" + "9" * 40}}
            event["placement_mm"] = {"white-rook-h": -1e12, "nobody": 1e12}
            event |= {"real_s": -1e12, "peak_force_N": 1e12, "wall_time": "0001-01-01T00:00:00+14:00"}
    path.write_text("\n".join(map(json.dumps, events)) + "\n")
    page = page_of(game.record.folder)
    assert "No player gave an evaluation" in page.text
