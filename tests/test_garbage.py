"""Whatever stands in a file or on the command line that a person may write: it is taken, or refused in one sentence."""

from __future__ import annotations

import contextlib
import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import chess
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from app import UserError
from app.analysis.kept import kept_analysis
from app.cli.commands import app
from app.measure.photographs.labels import load_labels
from app.pieces.inventory import Inventory
from app.pieces.layout import start_layout
from app.play.game_setup import rig_setup_of, start_board
from app.players.given_line import parse_line
from app.practice.puzzles import puzzles_of
from app.practice.repertoire import load_repertoire
from app.records import GameRecord, GameSetup, read_events, read_history, summarise
from app.records.recorded_games import recorded_games
from app.rig.rig_file import load_rig
from app.rig.simulation.settings import load_randomisation
from app.settings.calibration import load_calibration
from app.settings.defaults import Settings
from app.settings.files import as_toml, kept_settings, load_settings
from app.settings.time_control import TimeControl
from engine.book import Book, BookSettings
from engine.errors import EngineProblem
from hardware.interfaces import HardwareError
from hardware.parameters import DEFAULT_FILE
from hardware.table import TableSettings

REFUSALS = (UserError, EngineProblem, HardwareError)
"""What the commands answer in one sentence."""
TABLE = TableSettings()
WORDS = (
    b"", b"nan", b"inf", b"-inf", b"1e999", b"-1", b"0", b"9" * 40, b"null", b"true", b"[]", b"{}", b'""', b'"', b"\0",
    b"\xff\xfe", b"\n", b"[" * 3000, b"{" * 50, b"e2e4", b"0000", b"--", b"[/b]", b"K", b"=", b".", b"\\",
    b"\xe2\x80\xa8",
)  # fmt: skip
"""What is put in somewhere: values at the edge, and what means something to a reader of one of the formats."""

RIG = b"""run_dir = "run"
calibration = "calibration.json"
[controller]
host = "127.0.0.1"
port = 47100
linger = 30.0
[drives]
bus = "sim"
[world]
pace = "fast"
seed = 3
fen = "8/8/8/4k3/8/8/8/3QK3 w - - 0 1"
[world.camera]
noise = true
[world.light]
direction = [0.9, 0.5, 1.0]
[world.randomisation]
piece_mass = 0.1
[table]
square = 0.05
centre_in_base = [0.0, 0.0, -0.6]
"""
LABELS = json.dumps({
    "schema": "chess-seq/1", "initial_fen": chess.STARTING_FEN,
    "corners_px": {n: [1.0, 2.0] for n in ("a1", "h1", "h8", "a8")},
    "frames": [{"file": "a.jpg", "moves_since_previous": ["e2e4"], "fen": chess.STARTING_FEN}],
}).encode()  # fmt: skip
CALIBRATION = json.dumps({
    "version": 1, "made": "2026-11-01T00:00:00Z",
    "pinhole": {"width": 1280, "height": 720, "fx": 900.0, "fy": 900.0, "cx": 639.5, "cy": 359.5},
    "camera_from_base": [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]],
    "depth_factor": 1.0, "points": 20, "left_out": 0, "mean_residual": 1e-4, "worst_residual": 2e-4,
    "mean_error": 1e-4, "worst_error": 2e-4,
    "board": {"centre": [0.0, 0.0, -0.6], "yaw": 0.01, "tilt": 0.0, "by_depth": True, "by_corners": True},
}).encode()  # fmt: skip
PUZZLES = b"PuzzleId,FEN,Moves\n1,5rk1/1p3ppp/pq3b2/8/8/1P1Q1N2/P4PPP/3R2K1 w - - 2 27,d3d6 f8d8 d6d8 f6d8\n"
PGN = (
    b'[Event "x"]\n[White "W"]\n[Variant "Chess960"]\n[SetUp "1"]\n[FEN "4k3/8/8/8/8/8/8/1RK5 w Q - 0 1"]\n\n'
    b'1. O-O-O {[%clk 0:01:00]} Kd7 (1... Ke7 2. Re1+) 2. Rd1+ $1 Ke6 1/2-1/2\n\n[Event "y"]\n\n1. e4 e5 *\n'
)


def _summary_of(path: Path) -> None:
    summarise(read_events(path))


def _book_of(path: Path) -> None:
    with Book(BookSettings(path=path, max_plies=20)) as book:
        book.move(chess.Board())


def _calibration_of(path: Path) -> None:
    calibration = load_calibration(path)
    calibration.board_view(calibration.table(TABLE))


def _rig_of(path: Path) -> None:
    rig_setup_of(Settings().with_changes({"rig.name": str(path)}).rig)


def _parameters_of(path: Path) -> None:
    rig = path.with_name("rig.toml")
    rig.write_text(f'parameters = "{path}"\n[controller]\nport = 47100\n', encoding="utf-8")
    load_rig(rig)


READERS: dict[str, tuple[str, bytes | None, Callable[[Path], object]]] = {
    "record's report": ("events.jsonl", None, _summary_of),
    "record's history": ("events.jsonl", None, lambda path: read_history(path, TABLE)),
    "settings": ("my.toml", as_toml(Settings()).encode(), load_settings),
    "kept settings": ("settings.json", Settings().model_dump_json().encode(), lambda path: kept_settings(path.parent)),
    "rig file": ("lab.toml", RIG, _rig_of),
    "robot's parameters": ("robot.toml", DEFAULT_FILE.read_bytes(), _parameters_of),
    "randomisation": ("random.toml", b"piece_mass = 0.1\n[devices.grip]\nholds = [3]\n", load_randomisation),
    "labels": ("labels.json", LABELS, lambda path: load_labels(path.parent)),
    "calibration": ("calibration.json", CALIBRATION, _calibration_of),
    "games": ("games.pgn", PGN, recorded_games),
    "puzzles": ("puzzles.csv", PUZZLES, puzzles_of),
    "repertoire": ("repertoire.pgn", PGN, load_repertoire),
    "analysis": ("analysis.json", b'{"games": []}', lambda path: kept_analysis(path.parent, [])),
    "opening book": ("book.bin", bytes(range(16)) * 4, _book_of),
}


@pytest.fixture(scope="module")
def new_file(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """A file of this name in a folder of its own: what was read from a path may be remembered."""
    root, numbers = tmp_path_factory.mktemp("garbage"), itertools.count()

    def make(name: str) -> Path:
        folder = root / str(next(numbers))
        folder.mkdir()
        return folder / name

    return make


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The events of a short game."""
    folder = tmp_path_factory.mktemp("record") / "game"
    inventory = Inventory.of(start_layout(chess.Board(), TABLE), TABLE)
    with GameRecord.begin(folder, GameSetup("W", "B", 1, "fast"), chess.Board(), inventory, 0.0) as game:
        game.end("*", "left", 1.0)
    return (folder / "events.jsonl").read_bytes()


@st.composite
def edits(draw: st.DrawFn) -> Callable[[bytes], bytes]:
    """What happens to a file: parts are cut out, doubled, replaced or cut off."""
    cuts = draw(
        st.lists(
            st.tuples(st.floats(0, 1), st.integers(0, 12), st.sampled_from(WORDS) | st.binary(max_size=6)), max_size=4
        )
    )
    end = draw(st.none() | st.floats(0, 1))
    swap = draw(st.none() | st.tuples(st.integers(0, 200), st.sampled_from(WORDS)))

    def edit(content: bytes) -> bytes:
        if swap is not None:  # a value of its own, where the formats have one
            parts = content.split(b" ")
            parts[swap[0] % len(parts)] = swap[1]
            content = b" ".join(parts)
        for where, length, put in cuts:
            at = int(where * len(content))
            content = content[:at] + put + content[at + length :]
        return content if end is None else content[: int(end * len(content))]

    return edit


@pytest.mark.parametrize("reader", READERS)
@given(edit=edits())
def test_garbage_in_a_file_is_taken_or_refused(
    reader: str, edit: Callable[[bytes], bytes], new_file: Callable[[str], Path], record: bytes
) -> None:
    name, content, read = READERS[reader]
    path = new_file(name)
    path.write_bytes(edit(record if content is None else content))
    with contextlib.suppress(*REFUSALS):
        read(path)


@pytest.mark.parametrize("reader", READERS)
@given(content=st.binary(max_size=60) | st.sampled_from(WORDS))
def test_anything_in_a_file_is_taken_or_refused(reader: str, content: bytes, new_file: Callable[[str], Path]) -> None:
    name, _, read = READERS[reader]
    path = new_file(name)
    path.write_bytes(content)
    with contextlib.suppress(*REFUSALS):
        read(path)


TEXTS = st.text(st.characters(codec="utf-8"), max_size=30) | st.sampled_from([word.decode("latin-1") for word in WORDS])


@given(
    text=TEXTS | st.from_regex(r"[kqrbnpKQRBNP1-8/]{5,30} [wb] [KQkqA-H-]{1,4} [a-h36-]{1,2} -?[0-9]{1,12} [0-9]{1,4}"),
    chess960=st.booleans(),
)
def test_any_position_is_taken_or_refused(text: str, chess960: bool) -> None:
    with contextlib.suppress(*REFUSALS):
        start_layout(start_board(text, chess960=chess960), TABLE)


@given(
    text=TEXTS | st.lists(st.sampled_from(["e4", "e2e4", "O-O", "--", "Z0", "@@@@", "e7e8q", "1.", "x"])).map(" ".join)
)
def test_any_line_and_any_time_control_is_taken_or_refused(text: str) -> None:
    for read in (lambda: parse_line(text, chess.Board()), lambda: TimeControl.parse(text)):
        with contextlib.suppress(*REFUSALS):
            read()


NUMBERS = ("nan", "inf", "-inf", "-1", "0", "1e308", "1e-308", "9" * 40, "1.5", "abc", "")
NUMERIC: dict[str, tuple[str, ...]] = {
    "demo": ("plies", "games", "seed", "white-elo", "movetime", "nodes", "video-length", "linger", "square", "port"),
    "analyse": ("nodes", "movetime", "lines"),
    "puzzle": ("number", "games", "seed"),
    "play": ("elo", "movetime", "nodes", "seed"),
    "replay": ("game", "from-ply", "plies", "seed"),
    "setup": ("seed",),
    "link-test": ("duration",),
}


@pytest.mark.parametrize(("command", "option"), [(name, one) for name, all_of in NUMERIC.items() for one in all_of])
def test_numbers_on_the_command_line_are_taken_or_refused(
    command: str, option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No rig is ever opened: a missing one ends what was taken."""
    monkeypatch.chdir(tmp_path)
    for number in NUMBERS:
        arguments = [
            command,
            *(["games.pgn"] if command in {"replay", "analyse", "puzzle"} else []),
            *([] if command == "analyse" else ["--rig", "none.toml"]),
            f"--{option}",
            number,
        ]
        _assert_one_sentence(arguments)


TEXTUAL = ("--rig", "--pace", "--profile", "--fen", "--moves", "--clock", "--book", "--engine", "--pads", "--captured",
           "--randomise", "--config", "--out")  # fmt: skip


@pytest.mark.parametrize("option", TEXTUAL)
@pytest.mark.parametrize("text", ["", "\n", "[/b]", "\0", "a" * 5000, "nan", "\u2028", "/"])
def test_texts_on_the_command_line_are_taken_or_refused(
    option: str, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    rig = [] if option == "--rig" else ["--rig", "none.toml"]
    _assert_one_sentence(["demo", *rig, option, text])


def _assert_one_sentence(arguments: list[str]) -> None:
    done = CliRunner().invoke(app, arguments)
    trouble: Any = done.exception
    assert isinstance(trouble, SystemExit), (arguments, done.exc_info)
    assert done.exit_code == 2, (arguments, done.output)
    (line,) = done.output.splitlines()
    assert line.startswith("touchmove: "), line


WRITERS = (
    "demo --rig board --out", "replay x.pgn --out", "analyse x.pgn --out", "film x --output", "figures 99 --out",
    "dataset x --out", "calibrate --rig none.toml --out", "identify --rig none.toml --out", "campaign report x --out",
    "campaign repeat x 1 --out", "campaign x.toml --games 1 --out",
)  # fmt: skip
"""All options that name what is to be written."""


@pytest.mark.parametrize("command", WRITERS)
@pytest.mark.parametrize("name", ["", "  "])
def test_nothing_is_written_to_a_blank_name(
    command: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, [*command.split(), name])
    assert done.exit_code == 2
    (line,) = done.output.splitlines()
    option = command.rsplit(maxsplit=1)[-1]
    assert line.startswith(
        f"touchmove: {option} is '{' ' if name else ''}': name a file or folder, or leave the option out"
    )
    assert not [*tmp_path.iterdir()]


def never(*_: object, **__: object) -> None:
    raise AssertionError("the arm moves before the file is tried")


@pytest.mark.parametrize("command", ["calibrate", "identify"])
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("/proc/x/y", "/proc/x: No such file or directory: choose another file with --out"),
        ("notes.txt/y", "this is a file, and a folder is needed: choose another file with --out"),
        ("notes.txt", "notes.txt exists and is not a"),
        (".", ". is a folder: name a file in it with --out"),
    ],
)
def test_a_file_that_cannot_be_written_is_refused_before_the_arm_moves(
    command: str, name: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("notes.txt").write_text("not to be lost", encoding="utf-8")
    for module in ("app.commissioning.calibrate", "app.commissioning.identify"):
        monkeypatch.setattr(f"{module}.open_rig", never)
    done = CliRunner().invoke(app, [command, "--out", name])
    assert done.exit_code == 2, done.output
    (line,) = filter(None, done.output.splitlines())  # where a bar was, an empty line is left
    assert said in line
    assert Path("notes.txt").read_text(encoding="utf-8") == "not to be lost"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "is damaged: bring it back from a copy, or take that of another game which was started with the same"),
        ("[]", "is damaged: bring it back from a copy, or take that of another game which was started with the same"),
        ('{"new": 1}', "is of another version: continue with the version that wrote it"),
    ],
)
def test_damaged_settings_of_a_game_are_not_taken_for_another_version(content: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "settings.json").write_text(content, encoding="utf-8")
    done = CliRunner().invoke(app, ["resume", str(tmp_path), "--headless"])
    assert done.exit_code == 2
    (line,) = done.output.splitlines()
    assert f"settings.json {said}" in line


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            "demo --rig board --square 59",
            "--square has no effect here, it is for a simulation that this program starts (--rig sim)",
        ),
        ("demo --rig board --video", "--video has no effect here, it is for a simulation that this program starts"),
        (
            "demo --no-video --video-length 9",
            "--video-length has no effect here, it is for a film (without --no-video)",
        ),
        ("demo --no-cameras --video", "--video has no effect here, it is for a simulation that is drawn"),
        ("demo --moves e4 --movetime 1", "--movetime has no effect here, it is for engines that choose the moves"),
        ("demo --nodes 10 --movetime 1", "--movetime has no effect here, it is for engines that think by time"),
        ("demo --moves e4 --black-clock 5+3", "--black-clock has no effect here, it is for engines that choose"),
        ("demo --movetime inf", "--movetime is 'inf': it should be a finite number"),
        ("demo --movetime 1e9", "--movetime is '1000000000.0': it should be at most 86400"),
        ("demo --plies 0", "--plies is '0': it should be at least 1: 'touchmove demo --help' lists the options"),
        ("demo --seed x", "--seed is 'x': it should be a whole number: 'touchmove demo --help'"),
        ("play --movetime nan", "--movetime is 'nan': it should be a finite number: 'touchmove play --help'"),
        ("link-test --duration 1e9", "--duration is '1e9': it should be at most 86400: 'touchmove link-test --help'"),
        ("campaign run x.toml --workers y", "is 'y': it should be a whole number: 'touchmove campaign run --help'"),
        ("analyse x.pgn --nodes 9223372036854775808", "--nodes is '9223372036854775808': it should be at most 92233"),
        (
            "demo --nope",
            "No such option: --nope (Possible options: --no-page, --nodes, --page): 'touchmove demo --help'",
        ),
        ("nope", "No such command 'nope'"),
        ("nope", "'touchmove --help' lists the commands"),
        ("figures 8", "there is no figure '8', choose from: 5, 6, 7, 9"),
        ("bench nosuch", "there is no bench 'nosuch', choose from: law, loop"),
        ("controller status --rig board", "rig board has no devices: choose sim, or the TOML file of a lab's rig"),
        ("check --rig board", "rig board has no devices: choose sim, or the TOML file of a lab's rig"),
        ("setup --rig board --no-page --standing start --fen 8/8", "--fen is not a position (expected 8 rows"),
    ],
)
def test_what_has_no_effect_or_no_meaning_is_refused(
    arguments: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, arguments.split())
    assert done.exit_code == 2
    (line,) = done.output.splitlines()
    assert said in line


def test_a_file_in_the_place_of_a_folder_is_said_to_be_one(tmp_path: Path) -> None:
    out = tmp_path / "file"
    out.touch()
    done = CliRunner().invoke(app, ["demo", "--rig", "board", "--moves", "e4", "--headless", "--out", str(out)])
    said = f"touchmove: {out}: this is a file, and a folder is needed: choose another folder with --out\n"
    assert (done.exit_code, done.output) == (2, said)


def test_squares_that_are_too_small_are_refused() -> None:
    with pytest.raises(UserError, match=r"^--square: squares of 29 mm are too small: choose at least 30 mm$"):
        rig_setup_of(Settings().with_changes({"rig.square": 29.0}).rig)


def test_settings_of_a_file_without_effect_are_said(tmp_path: Path) -> None:
    file, out = tmp_path / "my.toml", tmp_path / "game"
    file.write_text('[rig]\nname = "board"\nsquare = 57.0\nvideo = false\n[game]\nmoves = "e4"\n', encoding="utf-8")
    done = CliRunner().invoke(app, ["demo", "--config", str(file), "--headless", "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert done.output.splitlines() == [
        "touchmove: --square has no effect here, it is for a simulation that this program starts (--rig sim): "
        "leave it out"
    ]
