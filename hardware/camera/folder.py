"""Frames in a folder: readable by anything, lossless, depth in whole units.

``camera.json`` holds pinhole and depth unit, ``frames.jsonl`` one line a frame (stamp [s] and file names); colour is an
8-bit PNG, depth a 16-bit one.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat, PositiveInt, ValidationError

from hardware.camera.recorded import RecordedFrame
from hardware.frozen import FrozenFinite
from hardware.interfaces import Frame, HardwareError, Intrinsics

CAMERA_FILE: Final = "camera.json"
FRAMES_FILE: Final = "frames.jsonl"
DEPTH_UNIT: Final = 1e-4
"""Of depth pictures [m]; what is further away than 6.55 m has none."""


class _Pinhole(FrozenFinite):
    width: PositiveInt
    height: PositiveInt
    fx: PositiveFloat
    fy: PositiveFloat
    cx: float
    cy: float


class _CameraFile(FrozenFinite):
    intrinsics: _Pinhole
    depth_unit: PositiveFloat


class _Line(FrozenFinite):
    stamp: float
    colour: str
    depth: str | None


class FolderRecorder:
    """Writes frames into a folder, made if need be; raises ``HardwareError`` if it holds some or cannot be written."""

    def __init__(self, folder: Path) -> None:
        if (folder / FRAMES_FILE).exists():
            raise HardwareError(f"{folder} already holds a recording: choose another folder")
        self._folder = folder
        self._intrinsics: Intrinsics | None = None
        self._count = 0
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lines = (folder / FRAMES_FILE).open("w", encoding="utf-8")
        except OSError as error:
            raise HardwareError(f"{folder} cannot be written: {error.strerror}: choose another folder") from error

    def write(self, frame: Frame) -> None:
        """Add a frame; raises ``HardwareError`` if it is of another camera than the first one, or the disk is full."""
        try:
            self._write(frame)
        except OSError as error:
            raise HardwareError(f"{self._folder} cannot be written: {error.strerror}") from error

    def _write(self, frame: Frame) -> None:
        if self._intrinsics is None:
            self._intrinsics = frame.intrinsics
            camera = _CameraFile(intrinsics=_Pinhole(**asdict(frame.intrinsics)), depth_unit=DEPTH_UNIT)
            (self._folder / CAMERA_FILE).write_text(camera.model_dump_json(indent=1) + "\n", encoding="utf-8")
        elif frame.intrinsics != self._intrinsics:
            raise HardwareError(
                f"a frame with {frame.intrinsics} does not belong to a recording with {self._intrinsics}"
            )
        self._count += 1
        name = f"{self._count:06d}.png"
        self._save(name, frame.colour[..., ::-1])
        depth = None
        if frame.depth is not None:
            depth = f"{self._count:06d}-depth.png"
            self._save(depth, whole_units(frame.depth, DEPTH_UNIT))
        self._lines.write(_Line(stamp=frame.stamp, colour=name, depth=depth).model_dump_json() + "\n")
        self._lines.flush()

    def close(self) -> None:
        """Finish; a second call does nothing."""
        self._lines.close()

    def _save(self, name: str, pixels: NDArray[np.integer]) -> None:
        if not cv2.imwrite(str(self._folder / name), np.ascontiguousarray(pixels)):
            raise HardwareError(f"{self._folder / name} cannot be written: is the disk full?")


class FolderRecording:
    """``Recording`` of a folder; raises ``HardwareError`` if there is none, or it is malformed."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        try:
            camera = _CameraFile.model_validate_json((folder / CAMERA_FILE).read_text(encoding="utf-8"))
            lines = (folder / FRAMES_FILE).read_text(encoding="utf-8").splitlines()
            self._frames = iter([_Line.model_validate_json(line) for line in lines])
        except OSError as error:
            raise HardwareError(
                f"{folder} is not a recording: {error.filename} cannot be read ({error.strerror})"
            ) from error
        except ValidationError as error:
            raise HardwareError(f"{folder} is not a recording: {error.errors()[0]['msg']}") from error
        self._intrinsics = Intrinsics(**camera.intrinsics.model_dump())
        self._unit = camera.depth_unit

    def next(self) -> RecordedFrame | None:
        """See ``Recording``."""
        line = next(self._frames, None)
        return None if line is None else RecordedFrame(line.stamp, lambda: self._load(line))

    def close(self) -> None:
        """See ``Recording``."""

    def _load(self, line: _Line) -> Frame:
        colour = self._read(line.colour, cv2.IMREAD_COLOR_RGB).astype(np.uint8)
        depth = None
        if line.depth is not None:
            units = self._read(line.depth, cv2.IMREAD_UNCHANGED)
            depth = units.astype(np.float32) * np.float32(self._unit)
        return Frame(colour, depth, self._intrinsics, line.stamp)

    def _read(self, name: str, how: int) -> NDArray[np.generic]:
        picture = cv2.imread(str(self._folder / name), how)
        if picture is None:
            raise HardwareError(f"{self._folder / name} is missing or is not a picture: record again")
        size = self._intrinsics.height, self._intrinsics.width
        if picture.shape[:2] != size:
            raise HardwareError(
                f"{self._folder / name} is {picture.shape[1]}x{picture.shape[0]}, not {size[1]}x{size[0]}"
            )
        return np.asarray(picture)


def whole_units(depth: NDArray[np.float32], unit: float) -> NDArray[np.uint16]:
    """Depth [m] in whole units; 0 where there is none, or more than 16 bits hold."""
    units = np.rint(np.nan_to_num(depth, posinf=0.0) / unit)
    return np.where(units < 65536.0, units, 0.0).astype(np.uint16)
