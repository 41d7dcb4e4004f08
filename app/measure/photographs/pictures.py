"""Pictures of a folder, in the order in which they were taken."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from app import UserError

PICTURES: Final = frozenset({".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp"})
VIDEOS: Final = frozenset({".avi", ".mp4", ".webm", ".mkv", ".mov", ".m4v"})


class Picture(NamedTuple):
    """One picture: its name, RGB pixels (h, w, 3), and in a video its time [s]."""

    name: str
    colour: NDArray[np.uint8]
    stamp: float = 0.0


def picture_files(folder: Path) -> list[Path]:
    """The folder's pictures by name; numbers in names count as numbers.

    Raises:
        UserError: there is no such folder, or no picture in it.
    """
    if not folder.is_dir():
        raise UserError(f"{folder} is not a folder: name one with pictures or a video of a game")
    files = sorted((one for one in folder.iterdir() if one.suffix.lower() in PICTURES), key=_by_numbers)
    if not files:
        raise UserError(f"there are no pictures in {folder}: {', '.join(sorted(PICTURES | VIDEOS))} are read")
    return files


def read_picture(path: Path) -> Picture:
    """Decode a picture.

    Raises:
        UserError: it is none.
    """
    pixels = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if pixels is None:
        raise UserError(f"{path} is not a readable picture: remove it, or save it as PNG or JPEG")
    return Picture(path.name, np.ascontiguousarray(pixels[..., ::-1], dtype=np.uint8))


def read_video(path: Path, fps: float | None = None) -> Iterator[Picture]:
    """Frames of a video, named by their numbers; ``fps`` where the file's own rate is not to be believed [1/s].

    Raises:
        UserError: it cannot be read.
    """
    video = cv2.VideoCapture(str(path))
    try:
        rate = fps or video.get(cv2.CAP_PROP_FPS)
        if not video.isOpened() or not rate > 0.0:
            raise UserError(f"{path} is not a readable video: save it as MP4 or WebM")
        for number in itertools.count():
            more, pixels = video.read()
            if not more:
                return
            yield Picture(str(number), np.ascontiguousarray(pixels[..., ::-1], dtype=np.uint8), number / rate)
    finally:
        video.release()


def _by_numbers(path: Path) -> tuple[list[tuple[int, int, str]], str]:
    """Key for sorting: 2.jpg before 10.jpg."""
    parts = re.findall(r"\d+|\D+", path.name)
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts], path.name
