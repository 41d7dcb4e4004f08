"""Settings of a lab's cameras, one class a kind. Nothing here opens anything: ``hardware.camera.factory`` does."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import Field, PositiveFloat, PositiveInt, model_validator

from hardware.frozen import FrozenFinite

FRAME_RATE: Final = 30
"""What USB cameras give at the sizes used here [1/s]."""


class NoCameraSettings(FrozenFinite):
    """``kind = "none"``: the game is played blind."""

    kind: Literal["none"] = "none"


class RealSenseSettings(FrozenFinite):
    """``kind = "realsense"``: an Intel RealSense depth camera."""

    kind: Literal["realsense"] = "realsense"
    serial: str | None = None
    """Serial number, as printed on it; left out: the only one that is plugged in."""
    width: PositiveInt = 640
    """Of colour pictures [px]."""
    height: PositiveInt = 480
    """Of colour pictures [px]."""
    depth_width: PositiveInt = 848
    """Of depth pictures before they are aligned [px]; a D435 measures best at 848×480."""
    depth_height: PositiveInt = 480
    """Of depth pictures before they are aligned [px]."""
    fps: PositiveInt = FRAME_RATE
    """Pictures a second, of both."""
    exposure: PositiveFloat | None = None
    """Exposure time of the colour sensor [s]; left out: the camera adjusts it by itself."""
    gain: PositiveFloat | None = None
    """Gain of the colour sensor in its own units (0 to 128 on a D435); wants a fixed exposure."""
    emitter: bool = True
    """Whether the pattern of infrared light is projected; without it plain surfaces have no depth."""

    @model_validator(mode="after")
    def _gain_with_exposure(self) -> RealSenseSettings:
        if self.gain is not None and self.exposure is None:
            raise ValueError("a gain needs a fixed exposure: give exposure as well, or leave gain out")
        return self


class WebcamSettings(FrozenFinite):
    """``kind = "webcam"``: any camera that OpenCV can open; it has no depth.

    Its pinhole: the focal length as measured, or estimated from the horizontal field of view that its maker states.
    """

    kind: Literal["webcam"] = "webcam"
    device: Annotated[int, Field(ge=0)] | Path = 0
    """Number of the camera, its device file, or a video file that is played over and over."""
    width: PositiveInt = 1280
    """Asked for [px]; some cameras deliver another size."""
    height: PositiveInt = 720
    """Asked for [px]."""
    fps: PositiveInt = FRAME_RATE
    focal: PositiveFloat | None = None
    """Focal length at this size [px]."""
    field_of_view_deg: Annotated[float, Field(gt=5.0, lt=150.0)] | None = None
    """Horizontal [°]; exactly one of this and ``focal`` has to be given."""

    @model_validator(mode="after")
    def _one_pinhole(self) -> WebcamSettings:
        if (self.focal is None) == (self.field_of_view_deg is None):
            raise ValueError("a webcam's pinhole must be known: give either focal [px] or field_of_view_deg")
        return self


class Play(StrEnum):
    """How recorded frames come."""

    CLOCK = "clock"
    """By their stamps, as time passes."""
    FRAMES = "frames"
    """Each read gives the next one."""


class FolderSettings(FrozenFinite):
    """``kind = "folder"``: frames in a folder, as ``hardware.camera.folder`` writes them."""

    kind: Literal["folder"] = "folder"
    path: Path
    """Of the folder; counts from the rig file's own."""
    play: Play = Play.CLOCK


class RecordingSettings(FrozenFinite):
    """``kind = "recording"``: a ``.db3`` file, recorded here or by librealsense's own tools."""

    kind: Literal["recording"] = "recording"
    path: Path
    """Of the file; counts from the rig file's folder."""
    play: Play = Play.CLOCK


LabCamera = NoCameraSettings | RealSenseSettings | WebcamSettings | FolderSettings | RecordingSettings
"""Of any kind; ``kind`` says which."""
