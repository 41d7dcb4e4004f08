"""The page as browsers see it: really served, on loopback."""

from __future__ import annotations

import errno
import gc
import gzip
import http.client
import json
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from app.page.live import controls, people
from app.page.news import (
    ClockNews,
    DeviceNews,
    EndNews,
    HeardNews,
    LineSaid,
    LookNews,
    PathNews,
    PhaseNews,
    PictureNews,
    PicturesWanted,
    Present,
    PromptNews,
    ResultNews,
    RoundNews,
    SayNews,
    SessionNews,
)
from app.page.recorded import shower
from app.page.recorded.catalogue import Catalogue
from app.page.web.pictures import BOUNDARY
from app.records.files import EVENTS_FILE, FILM_FILE
from app.records.telemetry import TELEMETRY_FILE
from tests.app.page.recorded.recorded_games import RecordedGame
from tests.app.page.serving import PageProcess, ServedPage, served
from tests.waiting import PATIENCE, until

OTHER, THIRD = "fedcba9876543210", "00000000000000000000"


def session(folder: Path) -> SessionNews:
    return SessionNews(
        program="play", folder=str(folder), rig="sim", pace="real", tick=0.00088, person="white", hands=True, sees=True
    )


@pytest.fixture
def games(tmp_path: Path) -> Path:
    """A folder with a match of two games."""
    first = RecordedGame(tmp_path / "games" / "match")
    for san in ("e4", "e5", "Nf3"):
        first.ply(san)
    first.end()
    second = RecordedGame(tmp_path / "games" / "match" / "game-2")
    second.ply("d4")
    second.record.close()
    return tmp_path / "games"


@pytest.fixture
def page(games: Path) -> Iterator[ServedPage]:
    with served(games) as running:
        yield running


# --------------------------------------------------------------------------------------------------------------- state


def test_a_browser_is_told_all_and_then_what_changes(page: ServedPage, games: Path) -> None:
    page.take(session(games / "new"))
    page.take(PhaseNews(text="thinking"))
    with page.browser() as browser:
        assert browser.state["phase"] == "thinking"
        assert browser.state["session"]["live"] is True
        assert browser.state["session"]["id"] == "new"
        assert "folder" not in browser.state["session"]
        assert browser.state["game"] is None
        page.take(RoundNews(folder=str(games / "new"), number=1, sets_up=False))
        game = RecordedGame(games / "new")
        browser.until(lambda: browser.state["game"] and browser.state["game"]["id"] == "new")
        game.ply("e4")
        browser.until(lambda: [one["san"] for one in browser.state["game"]["moves"]] == ["e4"])
        page.take(ResultNews(result="1-0", reason="Black resigns"))
        browser.until(lambda: browser.state["game"]["result"] == "1-0")
        game.end("the person has left")
        browser.until(lambda: browser.state["game"]["result"] == "*")


def test_what_the_game_says_stands_in_its_section(page: ServedPage, games: Path) -> None:
    page.take(session(games / "new"))
    with page.browser() as browser:
        page.take(PromptNews(id=3, text="Which?", answers=("yes", "no"), squares=("e4",)))
        page.take(SayNews(text="Put it back", squares=("e4", "e5")))
        page.take(HeardNews(text="yes"))
        page.take(ClockNews(white=60.0, black=50.0, running="black", at=time.time() - 5.0))
        page.take(DeviceNews(name="camera", ok=True, text="well"))
        page.take(DeviceNews(name="camera", ok=False, text="gone"))
        page.take(DeviceNews(name="guard", ok=None, text="unknown"))
        page.take(PathNews(label="carry", motion=4, points=((0.0, 0.0, 0.3),), stiffness=((1.0, 1.0, 1.0),), stride=9))
        page.take(PictureNews(view="camera", stamp=3.0, bytes=3), b"abc")
        page.take(LookNews(stamp=3.0, outcome="ok", text="well", width=640, height=480))
        browser.until(lambda: browser.state["look"])
        state = browser.state
        assert state["prompt"] == {
            "id": 3,
            "text": "Which?",
            "answers": ["yes", "no"],
            "squares": ["e4"],
            "turn": False,
        }
        assert [(one["kind"], one["text"], one["squares"]) for one in state["log"]] == [
            ("say", "Put it back", ["e4", "e5"]), ("heard", "yes", []),
        ]  # fmt: skip
        assert state["clock"]["running"] == "black"
        assert 5.0 <= state["clock"]["age"] < 60.0
        assert [(one["name"], one["ok"]) for one in state["devices"]] == [("camera", False), ("guard", None)]
        assert (state["path"]["motion"], state["path"]["stride"]) == (4, 9)
        assert state["pictures"] == {"camera": {"number": 1, "stamp": 3.0}, "film": None}
        assert state["look"]["picture"] == 1
        page.take(PromptNews())
        browser.until(lambda: browser.state["prompt"] is None)
        for number in range(300):
            page.take(PhaseNews(text=f"phase {number}"))
        browser.until(lambda: browser.state["phase"] == "phase 299")
        assert len(browser.state["log"]) == 200


def test_a_clock_is_as_old_as_it_is_for_who_comes_later(page: ServedPage) -> None:
    page.take(ClockNews(white=60.0, black=50.0, running="white", free=3.0, at=time.time() - 2.0))
    with page.browser() as first:
        assert first.state["clock"]["free"] == 3.0
        age = first.state["clock"]["age"]
        time.sleep(0.1)
        with page.browser(OTHER) as second:
            assert second.state["clock"]["age"] >= age + 0.1


def test_the_end_is_told_and_then_nobody_hears_lines(page: ServedPage) -> None:
    with page.browser() as browser:
        page.take(EndNews(text="all is over"))
        browser.until(lambda: browser.state["session"]["live"] is False)
        assert browser.state["session"]["ended"] == "all is over"
        browser.send({"type": "line", "text": "e4"})
        browser.until(lambda: browser.refusals)
        assert browser.refusals == ["the game's program has ended: this was not sent"]


def test_a_record_that_cannot_be_read_is_trouble_and_no_end(page: ServedPage, games: Path) -> None:
    broken = games / "broken"
    broken.mkdir()
    (broken / EVENTS_FILE).write_text('{"event": "never heard of"}\n', encoding="utf-8")
    page.take(session(broken))
    page.take(RoundNews(folder=str(broken), number=1, sets_up=False))
    with page.browser() as browser:
        assert [one["kind"] for one in browser.state["log"]] == ["trouble"]
        assert "is not an event of this version" in browser.state["log"][0]["text"]


def test_a_record_that_starts_from_no_position_is_trouble_and_no_end(page: ServedPage, games: Path) -> None:
    first, _, rest = (games / "match" / EVENTS_FILE).read_text(encoding="utf-8").partition("\n")
    start = json.loads(first) | {"fen": "no position"}
    broken = games / "broken"
    broken.mkdir()
    (broken / EVENTS_FILE).write_text(f"{json.dumps(start)}\n{rest}", encoding="utf-8")
    page.take(session(broken))
    page.take(RoundNews(folder=str(broken), number=1, sets_up=False))
    with page.browser() as browser:
        assert "starts from no position" in browser.state["log"][0]["text"]
    assert page.get("/games/broken/record.json").status == 409


# ------------------------------------------------------------------------------------------------------------ controls


def test_one_holds_the_controls_and_hands_them_over(page: ServedPage) -> None:
    with page.browser() as first, page.browser(OTHER) as second, page.browser(THIRD) as third:
        first.until(lambda: first.controls["watchers"] == 3)
        assert first.holds
        assert not second.holds
        second.send({"type": "line", "text": "e4"})
        second.until(lambda: second.refusals)
        first.send({"type": "line", "text": "d4"})
        second.send({"type": "controls", "action": "ask"})
        first.until(lambda: first.controls["asking"] == second.controls["you"])
        third.send({"type": "controls", "action": "ask"})
        third.until(lambda: third.refusals)
        first.send({"type": "controls", "action": "give"})
        second.until(lambda: second.holds)
        second.send({"type": "line", "text": "c4"})
        until(lambda: LineSaid(text="c4") in page.said)
        assert [one for one in page.said if isinstance(one, LineSaid)] == [LineSaid(text="d4"), LineSaid(text="c4")]
        assert "you do not hold the controls" in second.refusals[0]
        assert "somebody else has already asked" in third.refusals[0]


def test_a_page_that_is_loaded_anew_holds_the_controls_still(page: ServedPage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(controls, "GRACE", PATIENCE)  # however long it takes to be loaded
    with page.browser(OTHER) as first:
        number = first.controls["you"]
        with page.browser() as other:
            first.close()
            other.until(lambda: other.controls["watchers"] == 1)
            assert other.controls["holder"] == number
            with page.browser(OTHER) as again:
                assert again.controls["you"] == number
                assert again.holds


def test_who_stays_away_loses_the_controls(page: ServedPage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(controls, "GRACE", 0.3)
    with page.browser() as first, page.browser(OTHER) as other:
        other.send({"type": "controls", "action": "ask"})
        other.until(lambda: other.controls["asking"] == other.controls["you"])
        first.close()
        other.until(lambda: other.holds)
        other.send({"type": "controls", "action": "release"})
        other.until(lambda: other.controls["holder"] is None)
    until(lambda: page.said[-1] == Present(holder=False))
    assert [one for one in page.said if isinstance(one, Present)] == [Present(holder=True), Present(holder=False)]


def test_who_comes_back_before_the_lost_connection_is_missed_holds_the_controls_still(page: ServedPage) -> None:
    with page.browser() as lost, page.browser(OTHER) as other:
        number = lost.controls["you"]
        (before,) = (one for one in page.page.hub.watchers if one.number == number)
        with page.browser(again=number) as back:
            assert back.controls["you"] == number
            assert back.holds
            page.do(lambda: page.page.people.left(before))  # found out at last
            back.send({"type": "line", "text": "e4"})
            until(lambda: LineSaid(text="e4") in page.said)
            assert page.page.people.controls.watchers == {number, other.controls["you"]}
        with page.browser(OTHER) as copy:
            assert copy.controls["you"] not in (number, other.controls["you"])


def test_two_windows_with_one_token_are_two_watchers(page: ServedPage) -> None:
    with page.browser() as first, page.browser() as copy:
        assert first.controls["you"] != copy.controls["you"]


@pytest.mark.parametrize("told", [True, False], ids=["game known", "browsers first"])
def test_a_page_that_was_started_again_gives_the_controls_back(
    page: ServedPage, games: Path, monkeypatch: pytest.MonkeyPatch, told: bool
) -> None:
    for module in (controls, people):
        monkeypatch.setattr(module, "GRACE", PATIENCE)
    if told:
        page.take(session(games / "new"))
    with page.browser() as watcher, page.browser(OTHER, held="new") as holder, page.browser(THIRD, held="new") as late:
        if not told:
            page.take(session(games / "new"))
        holder.until(lambda: holder.holds)
        watcher.until(lambda: not watcher.holds)
        assert not late.holds, "who came first of those who claim them"
    with page.browser(held="another game") as stranger:
        assert not stranger.holds


def test_no_page_of_long_ago_takes_the_controls(page: ServedPage, games: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(people, "GRACE", 0.0)
    page.take(session(games / "new"))
    with page.browser() as first, page.browser(OTHER, held="new") as late:
        assert first.holds
        assert not late.holds


def test_without_a_controller_there_is_no_stop(page: ServedPage) -> None:
    with page.browser() as browser:
        assert browser.controls["stoppable"] is False
        browser.send({"type": "stop"})
        browser.until(lambda: browser.refusals)
        assert browser.refusals == ["there is no controller to stop"]


def test_no_more_than_so_many_watch(page: ServedPage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(people, "MOST", 1)
    with page.browser(), pytest.raises(Exception, match=r"1013.*browsers are already watching"):
        page.browser(OTHER)
    until(lambda: not page.page.hub.watchers)
    with page.browser(OTHER) as again:
        assert again.state["controls"]


# ------------------------------------------------------------------------------------------------------------ pictures


def test_pictures_are_wanted_while_somebody_looks(page: ServedPage) -> None:
    def wanted() -> PicturesWanted | None:
        return next((one for one in reversed(page.said) if isinstance(one, PicturesWanted)), None)

    with page.browser() as browser:
        browser.send({"type": "watch", "telemetry": False, "camera": True, "film": False})
        until(lambda: wanted() == PicturesWanted(camera=5.0, film=0.0))
        with page.browser(OTHER) as other:
            other.send({"type": "watch", "camera": True, "film": True})
            until(lambda: wanted() == PicturesWanted(camera=5.0, film=5.0))
        until(lambda: wanted() == PicturesWanted(camera=5.0, film=0.0))
    until(lambda: wanted() == PicturesWanted(camera=0.0, film=0.0))


def test_mjpeg_is_a_stream_of_the_newest_pictures(page: ServedPage) -> None:
    assert page.get("/picture/film.jpg").status == 404
    assert page.get("/picture/else.jpg").status == 404
    assert page.get("/stream/else").status == 404
    page.take(PictureNews(view="film", stamp=1.0, bytes=5), b"first")
    assert page.get("/picture/film.jpg").content == b"first"  # type: ignore[attr-defined]
    with socket.create_connection(("127.0.0.1", page.port)) as end, end.makefile("rb") as stream:
        end.sendall(f"GET /stream/film HTTP/1.0\r\nHost: 127.0.0.1:{page.port}\r\n\r\n".encode())
        head = b"".join(iter(stream.readline, b"\r\n"))
        assert b"multipart/x-mixed-replace; boundary=" + BOUNDARY.encode() in head

        def part() -> bytes:
            assert stream.readline() == f"--{BOUNDARY}\r\n".encode()
            lines = [line.split(b": ") for line in iter(stream.readline, b"\r\n")]
            content = stream.read(int(dict(lines)[b"Content-Length"]))
            assert stream.readline() == b"\r\n"
            return content

        assert part() == b"first"
        until(lambda: PicturesWanted(camera=0.0, film=5.0) in page.said)
        for number in range(3):
            page.take(PictureNews(view="camera", stamp=2.0, bytes=5), b"other")
            page.take(PictureNews(view="film", stamp=2.0, bytes=7), f"jpeg\r\n{number}".encode())
            assert part() == f"jpeg\r\n{number}".encode()
    until(lambda: page.said[-1] == PicturesWanted(camera=0.0, film=0.0))


# ------------------------------------------------------------------------------------------------------------- records


def test_recorded_games_are_listed_and_shown(page: ServedPage) -> None:
    listed = {one["id"]: one for one in page.json("/games")}
    assert [*listed] == ["match", "match~game-2"]
    assert (listed["match"]["plies"], listed["match"]["reason"], listed["match"]["number"]) == (
        3,
        "the person has left",
        1,
    )
    assert (listed["match~game-2"]["plies"], listed["match~game-2"]["result"]) == (1, "*")
    record = page.json("/games/match/record.json")
    assert [one["san"] for one in record["game"]["moves"]] == ["e4", "e5", "Nf3"]
    times = [one["t"] for one in record["moments"]]
    assert times == sorted(times)
    assert record["span"] == [times[0], times[-1]]
    at = {}
    for moment in record["moments"]:
        at.update(moment["moved"])
    assert at == {one["name"]: one["at"] for one in record["game"]["pieces"]}
    assert {one["held"] for one in record["moments"]} == {None, "white-pawn-e", "black-pawn-e", "white-knight-g"}


def test_the_telemetry_of_a_match_is_that_of_all_its_games(page: ServedPage, games: Path) -> None:
    (games / "match" / TELEMETRY_FILE).write_bytes(b"telemetry")
    assert {one["id"]: one["telemetry"] for one in page.json("/games")} == {"match": True, "match~game-2": True}
    assert page.json("/games/match~game-2/record.json")["telemetry"]
    assert page.get("/games/match~game-2/telemetry.mcap").content == b"telemetry"  # type: ignore[attr-defined]


def test_plies_that_were_taken_back_are_not_listed(games: Path) -> None:
    game = RecordedGame(games / "another")
    for san in ("e4", "e5", "Nf3"):
        game.ply(san)
    game.take_back(2)

    def plies() -> int:
        return next(one["plies"] for one in Catalogue(games).games() if one["id"] == "another")

    assert plies() == 1
    game.ply("d5", broken_off=2)
    assert plies() == 1
    with (games / "another" / EVENTS_FILE).open("ab") as file:
        file.write(b'{"event":"ply","ply":2,')  # a crash cut it off
    assert plies() == 1
    game.record.close()


@pytest.mark.parametrize("white", ["NaN", r'"\ud800"', "{}", "[NaN]"])
def test_a_record_that_is_damaged_hides_no_other(page: ServedPage, games: Path, white: str) -> None:
    (games / "damaged").mkdir()
    (games / "damaged" / EVENTS_FILE).write_text(f'{{"event":"start","white":{white},"ply":{white},"fen":null}}\n')
    listed = {one["id"]: one for one in page.json("/games")}
    assert sorted(listed) == ["damaged", "match", "match~game-2"]
    assert listed["damaged"]["white"] in (None, "?")


def test_a_record_that_cannot_be_read_hides_no_other(
    page: ServedPage, games: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    RecordedGame(games / "locked").record.close()
    read = Path.read_bytes

    def refused(path: Path) -> bytes:
        if "locked" in path.parts:
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return read(path)

    monkeypatch.setattr(Path, "read_bytes", refused)
    assert [one["id"] for one in page.json("/games") if one["plies"]] == ["match", "match~game-2"]


def test_answers_are_packed_and_not_sent_twice(page: ServedPage) -> None:
    packed = page.get("/games/match/record.json", {"Accept-Encoding": "gzip"})
    assert packed.headers["Content-Encoding"] == "gzip"
    content = packed.content  # type: ignore[attr-defined]
    assert json.loads(gzip.decompress(content)) == page.json("/games/match/record.json")
    again = page.get("/games/match/record.json", {"If-None-Match": packed.headers["ETag"]})
    assert (again.status, again.content) == (304, b"")  # type: ignore[attr-defined]


def test_a_film_is_sent_in_parts(page: ServedPage, games: Path) -> None:
    assert page.get("/games/match/film").status == 404
    film = bytes(range(256)) * 40
    (games / "match" / FILM_FILE).write_bytes(film)
    whole = page.get("/games/match/film")
    assert (whole.status, whole.headers["Content-Type"], whole.content) == (200, "video/webm", film)  # type: ignore[attr-defined]
    for wanted, first, last in (("0-99", 0, 99), ("100-", 100, len(film) - 1), ("-10", len(film) - 10, len(film) - 1)):
        part = page.get("/games/match/film", {"Range": f"bytes={wanted}"})
        assert part.status == 206
        assert part.headers["Content-Range"] == f"bytes {first}-{last}/{len(film)}"
        assert part.content == film[first : last + 1]  # type: ignore[attr-defined]
    assert page.get("/games/match/film", {"Range": "bytes=999999-"}).status == 416
    assert page.json("/games/match/record.json")["film"] is True


def test_what_a_game_still_writes_is_sent_as_far_as_it_was_when_it_was_asked_for(page: ServedPage, games: Path) -> None:
    telemetry = games / "match" / TELEMETRY_FILE
    telemetry.write_bytes(bytes(1 << 24))  # more than sockets hold
    connection = http.client.HTTPConnection("127.0.0.1", page.port, timeout=PATIENCE)
    connection.request("GET", "/games/match/telemetry.mcap")
    answer = connection.getresponse()
    with telemetry.open("ab") as file:
        file.write(bytes(1 << 20))
    assert len(answer.read()) == int(answer.headers["Content-Length"]) == 1 << 24
    connection.request("GET", "/games/match/telemetry.mcap", headers={"Range": "bytes=1-2"})
    assert len(connection.getresponse().read()) == 2  # by the same connection
    connection.close()


def test_no_link_in_a_record_leads_out_of_it(page: ServedPage, games: Path, tmp_path: Path) -> None:
    secret, match = tmp_path / "secret", games / "match"
    secret.write_bytes(b"secret")
    (match / "frames").mkdir()
    (match / "own.webm").write_bytes(b"film")
    (match / FILM_FILE).symlink_to("own.webm")
    for link in (match / TELEMETRY_FILE, match / "frames" / "ply-001.jpg"):
        link.symlink_to(secret)
    for name in ("telemetry.mcap", "frames/ply-001.jpg"):
        assert page.get(f"/games/match/{name}").status == 404
    assert page.get("/games/match/film").content == b"film"  # type: ignore[attr-defined]


def test_what_others_have_locked_hides_no_record(
    page: ServedPage, games: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (games / "locked").mkdir()
    listed, stat = Path.iterdir, Path.stat

    def refused(path: Path) -> None:
        if "locked" in path.parts:
            raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(Path, "iterdir", lambda path: (refused(path), listed(path))[1])
    monkeypatch.setattr(
        Path, "stat", lambda path, **how: (path.name != "locked" and refused(path), stat(path, **how))[1]
    )
    assert [one["id"] for one in page.json("/games")] == ["match", "match~game-2"]


def test_pictures_of_a_record_are_those_of_its_folder(page: ServedPage, games: Path) -> None:
    frames = games / "match" / "frames"
    frames.mkdir()
    (frames / "ply-001.jpg").write_bytes(b"jpeg")
    (frames / "secret.txt").write_bytes(b"secret")
    assert page.get("/games/match/frames/ply-001.jpg").content == b"jpeg"  # type: ignore[attr-defined]
    for name in ("secret.txt", "ply-002.jpg", "..%2F..%2Fevents.jsonl", "%2e%2e", ".."):
        assert page.get(f"/games/match/frames/{name}").status == 404


def test_what_takes_long_is_made_elsewhere(page: ServedPage, games: Path) -> None:
    robot = page.json("/games/match/robot.json")
    assert set(robot) >= {"geometry", "table", "kinds"}
    missing = page.get("/games/match/telemetry.json")
    assert missing.status == 409
    assert b"has no telemetry.mcap" in missing.content  # type: ignore[attr-defined]
    assert page.get("/games/match/telemetry.json?from=x").status == 400
    assert page.get("/games/match/telemetry.json?from=-1").status == 400
    report = page.get("/games/match/report.html")
    assert report.status == 200
    assert report.headers["Content-Type"].startswith("text/html")
    assert "sandbox" in report.headers["Content-Security-Policy"]
    assert b"Nf3" in report.content  # type: ignore[attr-defined]


def test_more_wishes_than_can_be_made_are_refused(page: ServedPage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shower, "MOST", 0)
    answer = page.get("/games/match/record.json")
    assert answer.status == 503
    assert b"try again in a moment" in answer.content  # type: ignore[attr-defined]


def test_what_is_still_made_ends_with_the_page(games: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    maker, begun = tmp_path / "maker", tmp_path / "begun"
    maker.write_text(f"#!/bin/sh\necho $$ > {begun}\nexec sleep 600\n")
    maker.chmod(0o700)
    monkeypatch.setattr(shower, "sys", SimpleNamespace(executable=str(maker)))
    with served(games) as page, socket.create_connection(("127.0.0.1", page.port), PATIENCE) as browser:
        browser.sendall(b"GET /games/match/report.html HTTP/1.1\r\nHost: 127.0.0.1:%d\r\n\r\n" % page.port)
        until(lambda: begun.exists() and begun.read_text().endswith("\n"))
    assert not Path(f"/proc/{int(begun.read_text())}").exists(), "nobody would ever end it, nor wait for it"
    gc.collect()  # what was left open warns, which fails the test


def test_several_ask_for_the_same_at_once(page: ServedPage) -> None:
    answers: list[int] = []
    threads = [
        threading.Thread(target=lambda: answers.append(page.get("/games/match/record.json").status)) for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert answers == [200] * 8


def test_records_with_odd_names_are_found(page: ServedPage, games: Path) -> None:
    for name in ("with space ünïcode", "a~b=100%", "#?&"):
        RecordedGame(games / name).record.close()
    listed = [one["id"] for one in page.json("/games")]
    assert len(listed) == len(set(listed)) == 5
    for record in listed:
        assert page.json(f"/games/{record}/record.json")["game"]["id"] == record


def test_a_page_that_understands_its_game_no_more_ends_to_be_started_again(games: Path) -> None:
    with PageProcess(games) as process:
        process.tell(session(games / "match"))
        process.game.sendall(b'{"news": "nobody has heard of this"}\n')
        assert process.process.wait(PATIENCE) == 1
    assert "nobody has heard of this" in process.said
