"""A game by its events: the same live, read at once, and shown again."""

from __future__ import annotations

import tempfile
from pathlib import Path

import chess
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.analysis.openings import opening_of
from app.page.recorded.catalogue import Catalogue, RecordPlace
from app.page.recorded.follower import RecordFollower
from app.page.recorded.game_fold import PERSON, GameFold, RecordContradicts, RoundShown, fold
from app.page.recorded.record import record_shown
from app.pieces.inventory import Stage
from app.play import match
from app.records.files import EVENTS_FILE, RecordError
from app.records.history import read_events
from app.records.robot import RobotRecord, keep_robot
from hardware.parameters import load_parameters
from hardware.piece_set import Colour
from hardware.table import Captured, TableSettings
from tests.app.analysis.analysed import analysed
from tests.app.page.recorded.recorded_games import PARTS, TABLE, RecordedGame

SHOWN = RoundShown("id", 2, sets_up=False, person=Colour.WHITE)


def of(game: RecordedGame) -> GameFold:
    return fold(read_events(game.folder / EVENTS_FILE), game.table)


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.integers(0, 25), st.data())
def test_followed_in_pieces_or_read_at_once_a_record_says_the_same(seed: int, steps: int, data: st.DataObject) -> None:
    with tempfile.TemporaryDirectory() as folder:
        game = RecordedGame(Path(folder) / "whole", seed)
        game.by_lot(steps)
        game.end()
        content = (game.folder / EVENTS_FILE).read_bytes()
        growing = Path(folder) / "growing"
        growing.mkdir()
        follower = RecordFollower(growing)
        cuts = sorted(data.draw(st.lists(st.integers(0, len(content)), max_size=8)))
        count = 0
        for cut in [*cuts, len(content)]:
            (growing / EVENTS_FILE).write_bytes(content[:cut])
            count += len(follower.follow())
            assert count == content[:cut].count(b"\n")
            if count:
                assert follower.game is not None
                events = read_events(game.folder / EVENTS_FILE)[:count]
                assert follower.game.section(SHOWN) == fold(events, TABLE).section(SHOWN)
        place = Catalogue(Path(folder)).places()["whole"]
        shown = record_shown(place, events)
        assert shown["game"] == fold(events, TABLE).section(RoundShown("whole"))


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.integers(0, 30))
def test_position_moves_and_pieces_are_those_of_the_game(seed: int, steps: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        game = RecordedGame(Path(folder), seed)
        game.by_lot(steps)
        game.record.close()
        section = of(game).section(SHOWN)
        assert section["fen"] == game.board.fen()
        assert [move["uci"] for move in section["moves"]] == [move.uci() for move in game.board.move_stack]
        assert [move["ply"] for move in section["moves"]] == [*range(1, len(game.board.move_stack) + 1)]
        legal = {(source, target) for source, targets in section["legal"].items() for target in targets}
        moves = [move.uci() for move in game.board.legal_moves]
        assert legal == {(move[:2], move[2:4]) for move in moves}
        assert {tuple(way) for way in section["promoting"]} == {(m[:2], m[2:4]) for m in moves if len(m) == 5}
        assert {one["name"]: one["place"] for one in section["pieces"]} == {
            piece.name: str(piece.place) for piece in game.inventory
        }
        for one in section["pieces"]:
            assert one["at"] == pytest.approx(TABLE.xy(game.inventory.find(one["name"]).place), abs=1e-5)
        assert section["held"] is None
        assert section["turn"] == ("white" if game.board.turn else "black")


@pytest.mark.parametrize("parts", range(2 * len(PARTS) + 1))
def test_a_piece_is_where_the_part_of_a_capture_has_brought_it(tmp_path: Path, parts: int) -> None:
    game = RecordedGame(tmp_path)
    for san in ("e4", "d5"):
        game.ply(san)
    before, capture = game.inventory, game.board.parse_san("exd5")
    game.ply(capture, broken_off=parts)
    section = of(game).section(SHOWN)
    places = {one["name"]: one["place"] for one in section["pieces"]}
    taken, taking = "black-pawn-d", "white-pawn-e"
    at = parts - 1  # of the parts begun, the last one
    stage, first = PARTS[at % len(PARTS)], at < len(PARTS)
    assert (places[taken] == "d5") == (parts == 0 or (first and stage is not Stage.RELEASE))
    assert (places[taking] == "d5") == (not first and stage is Stage.RELEASE)
    held = None if parts == 0 or stage is not Stage.CARRY else taken if first else taking
    assert section["held"] == held
    assert section["fen"] == game.board.fen(), "the ply is not done yet"
    assert before.find(taking).place != before.find(taken).place


def test_what_was_taken_back_is_gone(tmp_path: Path) -> None:
    game = RecordedGame(tmp_path)
    for san in ("e4", "e5", "Qh5", "Nc6"):
        game.ply(san)
    game.take_back(2)
    game.ply("Nf3")
    section = of(game).section(SHOWN)
    assert [move["san"] for move in section["moves"]] == ["e4", "e5", "Nf3"]
    assert section["last"] == ["g1", "f3"]


def test_sides_change_with_their_names(tmp_path: Path) -> None:
    game = RecordedGame(tmp_path)
    section = of(game).section(SHOWN)
    assert (section["white"], section["black"], section["person"]) == ("a", "b", Colour.WHITE)
    game.record.sides_changed(Colour.BLACK, 1.0)
    section = of(game).section(SHOWN)
    assert (section["white"], section["black"], section["person"]) == ("b", "a", Colour.BLACK)


def test_castling_is_shown_as_the_king_goes(tmp_path: Path) -> None:
    game = RecordedGame(tmp_path)
    for san in ("e4", "e5", "Nf3", "Nf6", "Bc4", "Bc5"):
        game.ply(san)
    assert "g1" in of(game).section(SHOWN)["legal"]["e1"]
    game.ply("O-O")
    assert of(game).section(SHOWN)["last"] == ["e1", "g1"]


def test_check_promotion_and_the_end(tmp_path: Path) -> None:
    game = RecordedGame(tmp_path, start="4k3/P7/8/8/8/8/8/4K3 w - - 0 1")
    assert of(game).section(SHOWN)["promoting"] == [["a7", "a8"]]
    game.ply("a8=Q+")
    section = of(game).section(SHOWN)
    assert (section["check"], section["turn"]) == ("e8", "black")
    decided = of(game).section(SHOWN, ("1-0", "resigned"))
    assert (decided["result"], decided["reason"], decided["legal"]) == ("1-0", "resigned", {})
    game.end("left")
    section = of(game).section(SHOWN)
    assert (section["result"], section["reason"], section["legal"]) == ("*", "left", {})


def test_a_piece_in_a_box_is_where_the_records_table_has_it(tmp_path: Path) -> None:
    table = TableSettings(captured=Captured.BOX)
    game = RecordedGame(tmp_path / "a", table=table)
    for san in ("e4", "d5", "exd5"):
        game.ply(san)
    game.record.close()
    follower = RecordFollower(tmp_path / "a")
    follower.follow()
    assert follower.game is not None
    taken = {one["name"]: one for one in follower.game.section(SHOWN)["pieces"]}["black-pawn-d"]
    assert (taken["place"][0], taken["at"]) == ("B", None), "nothing says yet what the table is like"
    keep_robot(tmp_path / "a", RobotRecord(parameters=load_parameters(), table=table))
    again = RecordFollower(tmp_path / "a")
    again.follow()
    assert again.game is not None
    assert {one["name"]: one for one in again.game.section(SHOWN)["pieces"]}["black-pawn-d"]["at"] is not None


def test_records_that_contradict_themselves_are_said_so(tmp_path: Path) -> None:
    game = RecordedGame(tmp_path)
    game.ply("e4")
    game.record.close()
    lines = (tmp_path / EVENTS_FILE).read_bytes().splitlines(keepends=True)
    (tmp_path / EVENTS_FILE).write_bytes(b"".join([*lines, lines[-1]]))
    with pytest.raises(RecordError, match=r"events\.jsonl, line 7: after ply 1: ply 1 follows ply 1"):
        RecordFollower(tmp_path).follow()
    (tmp_path / EVENTS_FILE).write_bytes(lines[1])
    with pytest.raises(RecordError, match="does not begin with the start"):
        RecordFollower(tmp_path).follow()
    with pytest.raises(RecordContradicts, match="does not begin with the start"):
        fold((), TABLE)


def test_a_step_of_no_transfer_is_a_sentence(tmp_path: Path) -> None:
    game = RecordedGame(tmp_path / "game")
    game.ply("e4", broken_off=1)
    game.record.close()
    path = tmp_path / "game" / EVENTS_FILE
    path.write_bytes(path.read_bytes().replace(b'"transfer":0', b'"transfer":-2'))
    follower = RecordFollower(tmp_path / "game")
    with pytest.raises(RecordError, match="line 2, is not an event of this version: step"):
        follower.follow()
    with pytest.raises(RecordError, match="line 2, is not an event of this version: step"):
        read_events(path)


def test_a_record_that_nests_without_end_is_listed_as_one_that_cannot_be_read(tmp_path: Path) -> None:
    game = RecordedGame(tmp_path / "deep")
    game.record.close()
    (tmp_path / "deep" / EVENTS_FILE).write_bytes(b"[" * 100_000 + b"]" * 100_000 + b"\n")
    (shown,) = Catalogue(tmp_path).games()
    assert (shown["id"], shown["white"], shown["start"], shown["result"]) == ("deep", None, None, "*")


def test_a_last_line_that_is_taken_back_is_forgotten(tmp_path: Path) -> None:
    game = RecordedGame(tmp_path)
    game.ply("e4")
    game.record.close()
    whole = (tmp_path / EVENTS_FILE).read_bytes()
    follower = RecordFollower(tmp_path)
    follower.follow()
    (tmp_path / EVENTS_FILE).write_bytes(whole[: whole.rstrip(b"\n").rindex(b"\n") + 1])
    follower.follow()
    assert follower.game is not None
    assert follower.game.plies == ()


# ------------------------------------------------------------------------------------------------------------ openings


@pytest.mark.parametrize(
    ("line", "eco", "name"),
    [
        ("e4 c5", "B20", "Sicilian Defense"),
        ("d4 d5 c4", "D06", "Queen's Gambit"),
        ("c4 d5 d4", "D06", "Queen's Gambit"),
        ("e4 e5 Nf3 Nc6 Bb5", "C60", "Ruy Lopez"),
    ],
)
def test_openings_are_known_by_their_position(tmp_path: Path, line: str, eco: str, name: str) -> None:
    game = RecordedGame(tmp_path)
    for san in line.split():
        game.ply(san)
    assert of(game).section(SHOWN)["opening"] == {"eco": eco, "name": name}
    assert opening_of(chess.Board()) is None


def test_a_game_keeps_the_last_name_it_had(tmp_path: Path) -> None:
    game = RecordedGame(tmp_path)
    for san in ("e4", "c5", "a3", "h5"):
        game.ply(san)
    assert of(game).section(SHOWN)["opening"]["name"].startswith("Sicilian")


def test_a_person_is_called_as_the_program_calls_one() -> None:
    assert PERSON == match.PERSON


def test_a_record_shows_the_analysis_of_just_its_game(tmp_path: Path) -> None:
    game = RecordedGame(tmp_path)
    for san in ("e4", "e5"):
        game.ply(san)
    place = RecordPlace("id", tmp_path, 1, False)
    events = read_events(tmp_path / EVENTS_FILE)
    assert record_shown(place, events)["analysis"] is None
    made = analysed("e4 e5", [0, 0, 300], tmp_path)
    assert record_shown(place, events)["analysis"] == made.model_dump(mode="json")
    analysed("e4 c5", [0, 0, 300], tmp_path)
    assert record_shown(place, events)["analysis"] is None
