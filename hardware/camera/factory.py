"""The factory of a lab's cameras."""

from pathlib import Path

from hardware.camera.db3 import Db3Recorder, Db3Recording
from hardware.camera.folder import FolderRecorder, FolderRecording
from hardware.camera.realsense import RealSenseCamera
from hardware.camera.recorded import RecordedCamera
from hardware.camera.settings import (
    FolderSettings,
    LabCamera,
    NoCameraSettings,
    Play,
    RealSenseSettings,
    RecordingSettings,
    WebcamSettings,
)
from hardware.camera.webcam import WebcamCamera
from hardware.interfaces import Camera, Clock


def open_camera(settings: LabCamera, clock: Clock) -> Camera | None:
    """Open a camera, whose frames' stamps are the clock's; None if there is to be none.

    Raises ``HardwareError`` if it is not there or does not work; the sentence says what to do.
    """
    match settings:
        case NoCameraSettings():
            return None
        case RealSenseSettings():
            return RealSenseCamera(settings, clock)
        case WebcamSettings():
            return WebcamCamera(settings, clock)
        case FolderSettings(path=path, play=play):
            return RecordedCamera(FolderRecording(path), _clock(play, clock))
        case RecordingSettings(path=path, play=play):
            return RecordedCamera(Db3Recording(path), _clock(play, clock))


def open_recorder(path: Path) -> FolderRecorder | Db3Recorder:
    """Record frames of any camera: into a file that ends in ``.db3``, else into a folder; raises ``HardwareError`` if
    it exists already or cannot be written.
    """
    return Db3Recorder(path) if path.suffix == ".db3" else FolderRecorder(path)


def _clock(play: Play, clock: Clock) -> Clock | None:
    return clock if play is Play.CLOCK else None
