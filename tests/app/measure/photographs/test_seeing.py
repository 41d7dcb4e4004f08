"""Following a game in a folder of pictures: drawn ones with and without labels, and photographs where there are any."""

from __future__ import annotations

import json
import os
from pathlib import Path

import chess
import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from app import UserError
from app.cli.commands import app
from app.measure.bench.vision.photos import VARIABLE, sequences
from app.measure.photographs import CornersFrom, follow_folder
from app.measure.photographs.pictures import picture_files
from app.pieces.inventory import Inventory
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.records import GameRecord, GameSetup, PlyOutcome
from hardware.table import TableSettings
from tests.vision.synthetic import camera_matrix, corners_of, draw

LINE = "e4 e5 Nf3 Nc6 Bb5 a6"
MATRIX = camera_matrix(0.15)
NAMES = ("a1", "h1", "h8", "a8")


def quiet(_step: str) -> None:
    """Nobody looks."""


def make(folder: Path, line: str, *, labelled: bool, skip: int = 0) -> Path:
    """Draw a game; ``skip`` leaves a picture out, so that several plies lie between two."""
    rng, board = np.random.default_rng(4), chess.Board()
    offsets = rng.uniform(-0.1, 0.1, (64, 2))
    frames, moves = [], []
    for number, san in enumerate(["", *line.split()]):
        if san:
            move = board.push_san(san)
            moves.append(move.uci())
            offsets[move.to_square] = rng.uniform(-0.1, 0.1, 2)
        if number and number == skip:
            continue
        name = f"{number}.png"
        cv2.imwrite(str(folder / name), draw(board, MATRIX, rng, offsets=offsets, noise=2.0)[..., ::-1])
        frames.append({"file": name, "ply": number, "moves_since_previous": moves, "fen": board.fen()})
        moves = []
    corners = {name: point.tolist() for name, point in zip(NAMES, corners_of(MATRIX), strict=True)}
    labels = {"schema": "chess-seq/1", "initial_fen": chess.STARTING_FEN, "corners_px": corners, "frames": frames}
    if labelled:
        (folder / "labels.json").write_text(json.dumps(labels))
    return folder


@pytest.mark.parametrize("field", ["moves_since_previous", "moves_uci"])
def test_labels_with_moves_in_another_notation_are_refused_at_once(tmp_path: Path, field: str) -> None:
    frame = {"file": "1.png", "moves_since_previous": ["Nf3" if field == "moves_since_previous" else "g1f3"]}
    labels = {"schema": "chess-seq/1", "frames": [frame], "moves_uci": ["Nf3" if field == "moves_uci" else "g1f3"]}
    (tmp_path / "labels.json").write_text(json.dumps(labels))
    with pytest.raises(UserError, match=f"{field}.0: Value error, 'Nf3' is not a move: write it as"):
        follow_folder(tmp_path, CornersFrom.FIND, quiet)


@pytest.mark.parametrize("corners", CornersFrom)
def test_a_drawn_game_is_followed_and_scored(tmp_path, corners):
    report = follow_folder(make(tmp_path, LINE, labelled=True), corners, quiet)
    assert report.failed is None
    assert report.score is not None
    assert report.score.plies == 6
    assert report.score.wrong == 0
    assert report.score.right >= 5
    assert report.score.right + report.score.asked == 6
    assert report.score.square_accuracy is not None
    assert report.score.square_accuracy > 0.99
    assert report.pgn.startswith("1. e4 e5 2. Nf3 Nc6 3. Bb5 a6")


def test_a_ply_and_its_answer_in_one_view_are_both_read(tmp_path):
    report = follow_folder(make(tmp_path, LINE, labelled=True, skip=3), CornersFrom.LABELS, quiet)
    assert report.score is not None
    assert report.score.wrong == 0
    assert report.pgn.startswith("1. e4 e5 2. Nf3 Nc6 3. Bb5 a6")


def test_the_command_prints_the_contract(tmp_path):
    result = CliRunner().invoke(app, ["vision", str(make(tmp_path, LINE, labelled=True)), "--json"])
    assert result.exit_code == 0
    content = json.loads(result.stdout)
    assert {"frame", "moves", "confidence", "asked"} <= set(content["events"][1])
    assert {"plies", "right", "wrong", "asked", "square_accuracy"} == set(content["score"])
    assert content["events"][1]["frame"] == "1.png"


def test_without_labels_there_is_no_score(tmp_path):
    report = follow_folder(make(tmp_path, "e4 e5", labelled=False), CornersFrom.FIND, quiet)
    assert report.score is None
    assert report.holds


@pytest.mark.parametrize("first", [0, 1])
def test_the_frames_of_a_recorded_game_are_followed_from_where_its_record_begins(tmp_path, first):
    """With the frame of its first position, and, as in older records, without."""
    table, rng = TableSettings(), np.random.default_rng(4)
    board = chess.Board("rnbqkbnr/pppp1ppp/8/4p3/8/8/PPPPPPPP/RNBQKBNR w KQkq - 0 2")
    inventory = Inventory.of(start_layout(board, table), table)
    frames, offsets = tmp_path / "game" / "frames", rng.uniform(-0.1, 0.1, (64, 2))
    with GameRecord.begin(tmp_path / "game", GameSetup("a", "b", 1, "fast"), board, inventory, 0.0) as record:
        frames.mkdir()
        for number, san in enumerate(["", "Nf3", "Nc6", "e4"]):
            if san:
                ply = transfers(board, board.parse_san(san), inventory)
                inventory = inventory.after(ply)
                offsets[board.push_san(san).to_square] = rng.uniform(-0.1, 0.1, 2)
                record.ply(ply, PlyOutcome(by="hand"), float(number), inventory)
            if number >= first:
                seen = draw(board, MATRIX, rng, offsets=offsets, noise=2.0)
                cv2.imwrite(str(frames / f"ply-{number:03d}.jpg"), seen[..., ::-1])
    for folder in (tmp_path / "game", frames):
        report = follow_folder(folder, CornersFrom.FIND, quiet)
        assert report.failed is None
        assert report.pgn.startswith("2. Nf3 Nc6 3. e4" if not first else "2... Nc6 3. e4")


def test_a_picture_without_a_board_fails_with_a_sentence(tmp_path):
    cv2.imwrite(str(tmp_path / "1.png"), np.random.default_rng(1).integers(0, 255, (480, 640, 3), np.uint8))
    result = CliRunner().invoke(app, ["vision", str(tmp_path), "--json"])
    assert result.exit_code == 1
    assert json.loads(result.stdout)["failed"]


def test_numbers_in_names_count_as_numbers(tmp_path):
    for name in ("10.png", "9.png", "a2.png", "a10.png", "2.PNG", "notes.txt"):
        (tmp_path / name).touch()
    assert [file.name for file in picture_files(tmp_path)] == ["2.PNG", "9.png", "10.png", "a2.png", "a10.png"]


@pytest.mark.parametrize(
    ("labels", "words"),
    [
        ("[]", "labels: Input should be a valid dictionary"),
        ("{", "cannot be read"),
        ('{"schema": "other/1"}', "schema"),
        ('{"schema": "chess-seq/1", "initial_fen": "nonsense"}', "is not a position"),
    ],
)
def test_wrong_labels_are_refused(tmp_path, labels, words):
    make(tmp_path, "e4", labelled=False)
    (tmp_path / "labels.json").write_text(labels)
    with pytest.raises(UserError, match=words):
        follow_folder(tmp_path, CornersFrom.LABELS, quiet)


def test_usage_is_refused_in_a_sentence(tmp_path):
    empty, drawn = tmp_path / "empty", tmp_path / "drawn"
    empty.mkdir()
    drawn.mkdir()
    make(drawn, "e4", labelled=False)
    for arguments, words in (
        (["vision", str(tmp_path / "nowhere")], "is not a folder"),
        (["vision", str(empty)], "no pictures"),
        (["vision", str(empty), "--corners", "guess"], "find, labels"),
        (["vision", str(drawn), "--corners", "labels"], "no labels.json"),
    ):
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 2, arguments
        assert words in result.output + str(result.stderr), arguments


PHOTOS = Path(os.environ.get(VARIABLE, Path(__file__).resolve().parents[5] / "shared" / "data"))


@pytest.mark.slow
@pytest.mark.skipif(not PHOTOS.is_dir(), reason=f"no labelled photographs here: name their folder in {VARIABLE}")
def test_games_on_real_boards_are_never_read_wrong():
    known = {folder.name: folder for folder in sequences(PHOTOS)}
    short = [known[name] for name in ("en_passant", "game_17_34") if name in known]
    assert short
    for folder in short:
        report = follow_folder(folder, CornersFrom.FIND, quiet)
        assert report.score is not None
        assert report.score.wrong == 0
        assert report.score.right >= 0.8 * report.score.plies
