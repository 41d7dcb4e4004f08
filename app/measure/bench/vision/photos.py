"""Rows of ``touchmove bench vision`` from photographs and videos of real boards, where there are any.

How often the board is found in them, how well, and how often a wrong one is given without a word; and how the games in
them are read.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app import UserError
from app.measure.bench.report import Progress, Row, row
from app.measure.photographs import CornersFrom, follow_folder
from app.measure.photographs.labels import FILE_NAME, load_labels
from app.measure.photographs.pictures import read_picture, read_video
from vision.arrays import Array
from vision.board.find import find_board
from vision.board.grid import CORNERS
from vision.board.lattice import fit_homography, project
from vision.board.view import CORNER_NAMES, BoardNotFound

TOLERANCE: Final = 0.15  # a corner further from where it was labelled is wrong [sides of a square]
LEAST_FOUND: Final = 0.9  # share of pictures in which the board must be found
POLYGON_ORIGIN: Final = 0.5
"""Polygons drawn in LabelMe (``corners_unordered``) count from the outer corner of the first pixel, as its canvas draws
the picture from (0, 0) on and a click may lie anywhere within a pixel; everything else here, like OpenCV, counts from
that pixel's centre [px]."""
ASTRAY: Final = 0.5  # such a corner belongs to another row, whatever the labels' precision [sides of a square]

VARIABLE: Final = "TOUCHMOVE_PHOTOS"  # names the folder with labelled photographs where the command line does not
LEAST: Final = {CornersFrom.LABELS: 0.95, CornersFrom.FIND: 0.90}  # share of plies that must be read without asking


def photo_folder(given: Path | None) -> Path | None:
    """The folder with labelled photographs, None where there is none."""
    named = given or (Path(os.environ[VARIABLE]) if os.environ.get(VARIABLE) else None)
    return named if named is not None and named.is_dir() else None


def sequences(photos: Path) -> Iterator[Path]:
    """Folders below that hold a labelled game."""
    for path in sorted(photos.rglob(FILE_NAME)):
        text = path.read_text(encoding="utf-8")
        if '"chess-seq/' in text or '"chess-video/' in text:
            yield path.parent


class Photograph(NamedTuple):
    """A labelled picture."""

    name: str  # folder and file
    colour: NDArray[np.uint8]  # RGB, shape (h, w, 3)
    corners: Array  # outer corners counter-clockwise, from a1 on where ``oriented``, shape (4, 2) [px]
    oriented: bool  # whether the label tells a1


def photographs(photos: Path) -> Iterator[Photograph]:
    """The first frame of every sequence and all stills below a folder.

    They stand in its files ``labels.json`` (schemas chess-seq/1, chess-stills/1, chess-video/1).

    Raises:
        FileNotFoundError: no labels lie below the folder.
        UserError: a label names a picture that cannot be read.
    """
    labels = sorted(photos.rglob(FILE_NAME))
    if not labels:
        raise FileNotFoundError(f"no labels.json lies below {photos}: give the folder of the labelled photographs")
    for path in labels:
        yield from _of_folder(path.parent, json.loads(path.read_text()))


def find_rows(photos: Path, progress: Progress = lambda _: None) -> dict[str, Row]:
    """Find the board in all photographs below a folder.

    Returns:
        ``found``: 1 where every corner is within ``TOLERANCE``; ``wrong``: 1 where a board was given without a doubt
        and a corner is not; ``doubtful``: 1 where one was given with a doubt; ``astray``: 1 where a corner is off by
        ``ASTRAY``, doubt or not; ``turned``: 1 where a1 was said to be sure and is not the labelled one; ``corner``:
        worst corner of each board given; ``underrated``: 1 where that is beyond both the error that was given and the
        tolerance; ``find``: time a picture.
    """
    tries = [_try(picture, progress) for picture in photographs(photos)]
    off, claimed = np.array([one.off for one in tries]), np.array([one.claimed for one in tries])
    doubtful = np.array([one.doubtful for one in tries])
    rows = {
        "found": row(off <= TOLERANCE, "1", LEAST_FOUND, "least"),
        "wrong": row((off > TOLERANCE) & ~doubtful, "1"),
        "doubtful": row(doubtful, "1"),
        "astray": row(off > ASTRAY, "1", 0.0, "max"),
        "underrated": row(off > np.maximum(claimed, TOLERANCE), "1"),
        "find": row([one.duration for one in tries], "s", 1.5, "p50"),
    }
    if np.isfinite(off).any():
        rows["corner"] = row(off[np.isfinite(off)], "squares")
    turned = [float(one.turned) for one in tries if one.turned is not None]
    if turned:
        rows["turned"] = row(turned, "1", 0.0, "max")
    return rows


class _Try(NamedTuple):
    """What came of one picture: not a number where there was no board; ``turned`` None where it is not known."""

    duration: float
    off: float = float("nan")
    claimed: float = float("nan")
    doubtful: bool = False
    turned: bool | None = None


def _try(picture: Photograph, progress: Progress) -> _Try:
    start = time.perf_counter()
    try:
        board = find_board(picture.colour)
    except BoardNotFound as reason:
        progress(f"{picture.name}: {reason}")
        return _Try(time.perf_counter() - start)
    duration = time.perf_counter() - start
    off, turn = _corner_error(board.corners, picture.corners)
    if off > TOLERANCE:
        progress(f"{picture.name}: a corner is off by {off:.2f} squares; {board.doubt or 'no doubt was said'}")
    turned = turn != 0 if picture.oriented and board.oriented else None
    return _Try(duration, off, board.error, board.doubt is not None, turned)


def _of_folder(folder: Path, labels: dict[str, Any]) -> Iterator[Photograph]:
    if labels["schema"] == "chess-stills/1":
        for image in labels["images"]:
            named = image.get("corners_px")
            corners = _named(named) if named else _polygon(image["corners_unordered"])
            known = bool(named) and bool(image.get("orientation_known", True))
            yield _photograph(folder / image["file"], corners, known)
    elif labels["schema"] == "chess-seq/1":
        first = labels["frames"][0]
        yield _photograph(folder / first["file"], _named(first.get("corners_px") or labels["corners_px"]), True)
    elif labels["schema"] == "chess-video/1":
        frame = labels["stable_intervals"][0]["first_frame"]
        yield _photograph(folder / labels["video"], _named(labels["corners_px"]), True, frame)


def _photograph(path: Path, corners: Array, oriented: bool, frame: int | None = None) -> Photograph:
    picture = read_picture(path) if frame is None else next(islice(read_video(path), frame, None), None)
    if picture is None:
        raise UserError(f"{path} has no frame {frame}: check that the file is whole")
    return Photograph(f"{path.parent.name}/{path.name}", picture.colour, corners, oriented)


def _named(corners: dict[str, list[float]]) -> Array:
    return np.array([corners[name] for name in CORNER_NAMES], dtype=float)


def _polygon(points: list[list[float]]) -> Array:
    """Corners of a polygon from LabelMe in the sense of a1, h1, h8, a8 (v points down), as OpenCV counts pixels."""
    corners = np.array(points, dtype=float) - POLYGON_ORIGIN
    u, v = (corners - corners.mean(axis=0)).T
    return np.asarray(corners[np.argsort(-np.arctan2(v, u))])


def _corner_error(found: Array, labelled: Array) -> tuple[float, int]:
    """Distance of the worst corner on the board [sides of a square] at the best of four turns, and that turn."""
    places = project(fit_homography(labelled, CORNERS), found)
    errors = [float(np.linalg.norm(places - np.roll(CORNERS, -turn, axis=0), axis=1).max()) for turn in range(4)]
    best = int(np.argmin(errors))
    return errors[best], best


def photo_rows(photos: Path, progress: Progress) -> dict[str, Row]:
    """Follow every labelled game, with the board's corners as labelled and as found.

    Raises:
        UserError: labels are wrong, or a picture cannot be read.
    """
    rows: dict[str, Row] = {}
    for source, least in LEAST.items():
        scores = []
        for folder in sequences(photos):
            labels = load_labels(folder)
            unmarked = labels is not None and labels.video is not None and not labels.corners_px
            if source is CornersFrom.LABELS and unmarked:
                continue
            report = follow_folder(folder, source, lambda _step: None)
            assert report.score is not None
            scores.append(report.score)
            one = report.score
            counts = f"{one.plies} plies, {one.right} right, {one.wrong} wrong, {one.asked} asked"
            progress(f"{folder.name}, corners by {source}: {counts} {report.failed or ''}")
        plies = sum(score.plies for score in scores)
        unasked = sum(score.right for score in scores) / max(plies, 1)
        wrong = [float(score.wrong) for score in scores]
        rows[f"photos {source}"] = row([unasked], "1", least, "least", plies)
        rows[f"photos {source} wrong"] = row(wrong, "1", 0.0, "max")
    return rows
