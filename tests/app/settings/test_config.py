"""Rig files: what they may say, and the one sentence that names each mistake."""

from __future__ import annotations

import re
from pathlib import Path
from shutil import copy
from typing import get_args

import chess
import pytest

from app.rig.devices import RigFailed
from app.rig.factory import choose_rig
from app.rig.rig_file import DrivesSection, RigFile, WorldSection, load_rig
from app.settings.toml import ConfigError
from hardware.camera.settings import FolderSettings, LabCamera, NoCameraSettings, RecordingSettings, WebcamSettings
from hardware.interfaces import Pace
from hardware.parameters import DEFAULT_FILE
from hardware.table import TableSettings

CONTROLLER = '[controller]\nhost = "192.168.7.2"\nport = 47100\n'
LAB = CONTROLLER + '[drives]\nbus = "mitsubishi"\n'


def write(folder: Path, text: str) -> Path:
    path = folder / "lab.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_least_that_a_rig_file_says(tmp_path: Path) -> None:
    rig = load_rig(write(tmp_path, CONTROLLER))
    assert (rig.controller.host, rig.controller.port) == ("192.168.7.2", 47100)
    assert rig.controller.stays, "a lab's controller waits for the next client"
    assert rig.simulated
    assert rig.pace is Pace.REAL
    assert rig.parameters == DEFAULT_FILE
    assert rig.controller.key == tmp_path / "touchmove.key", "paths count from the file's folder"
    assert rig.run_dir == tmp_path / "run"


def test_everything_that_a_rig_file_can_say(tmp_path: Path) -> None:
    copy(DEFAULT_FILE, tmp_path / "robot.toml")
    rig = load_rig(
        write(
            tmp_path,
            'run_dir = "/var/lib/touchmove"\nparameters = "robot.toml"\n'
            + CONTROLLER
            + 'key = "secret/key"\nlinger = 60\ncore = 3\n'
            '[drives]\nbus = "sim"\n[world]\npace = "fast"\nseed = 7\ncameras = false\n'
            "[table]\ncentre_in_base = [0.0, 0.0, 0.48]\n",
        )
    )
    assert rig.pace is Pace.FAST
    assert rig.world_section.seed == 7
    assert rig.controller.core == 3
    assert rig.controller.key == tmp_path / "secret" / "key"
    assert rig.run_dir == Path("/var/lib/touchmove")
    assert rig.parameters == tmp_path / "robot.toml"
    assert rig.table.centre_in_base == (0.0, 0.0, 0.48)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[controller]\n", r"controller\.port is missing: give it a value"),
        ("", r"controller is missing: give it a value"),
        (CONTROLLER + "prot = 1\n", r"no setting controller\.prot: did you mean port\?"),
        (CONTROLLER + "[drive]\n", r"no setting drive: did you mean drives\?"),
        (
            'run_dir = " "\n' + CONTROLLER,
            r"run_dir: it should be the name of a file or folder, or be left out, not ' '",
        ),
        (CONTROLLER + "[world]\nsede = 3\n", r"no setting world\.sede: did you mean seed\?"),
        (
            CONTROLLER + "[world]\nzzz = 3\n",
            r"no setting world\.zzz: choose camera, camera_latency, cameras, fen, hand, journal",
        ),
        ('[controller]\nport = "x"\n', r"controller\.port: it should be a whole number, not 'x'"),
        (CONTROLLER.replace("192.168.7.2", "localhost"), r"controller\.host: .*IPv4.*'localhost'"),
        ("[controller]\nport = -1\n", r"controller\.port: it should be at least 0, not -1"),
        (CONTROLLER.replace("47100", "0"), r"clients on other computers cannot find a free port: give port a number"),
        (CONTROLLER + '[drives]\nbus = "my lab"\n', r"drives\.bus: .*, not 'my lab'"),
        (
            CONTROLLER + '[drives]\nbus = "mitsubishi"\n[world]\n',
            r'a \[world\] stands behind bus = "sim" and emulated drives only',
        ),
        ("[controller\n", r"is not valid TOML: .*: correct that line"),
        (
            CONTROLLER + '[camera]\nkind = "none"\n',
            r'a \[camera\] belongs to a lab; behind bus = "sim" the world has its',
        ),
        (LAB + "[camera]\n", r"camera\.kind is missing: give it one of none, realsense, webcam, folder, recording"),
        (LAB + '[camera]\nkind = "realsens"\n', r"no camera of kind 'realsens': did you mean realsense\?"),
        (LAB + '[camera]\nkind = "telescope"\n', r"no camera of kind 'telescope': choose none, realsense, webcam"),
        (LAB + '[camera]\nkind = "realsense"\nserail = "1"\n', r"no setting camera\.serail: did you mean serial\?"),
        (LAB + '[camera]\nkind = "none"\nfps = 30\n', r"no setting camera\.fps: choose kind"),
        (LAB + '[camera]\nkind = "folder"\n', r"camera\.path is missing: give it a value"),
        (
            LAB + '[camera]\nkind = "folder"\npath = "a"\nplay = "fast"\n',
            r"camera\.play: choose clock or frames, not 'fast'",
        ),
        (LAB + '[camera]\nkind = "realsense"\nfps = 0\n', r"camera\.fps: it should be more than 0, not 0"),
        (LAB + '[camera]\nkind = "realsense"\ngain = 1.0\n', r"camera: a gain needs a fixed exposure"),
        (LAB + '[camera]\nkind = "webcam"\n', r"camera: a webcam's pinhole must be known: give either focal"),
        (LAB + '[camera]\nkind = "webcam"\ndevice = -1\n', r"camera\.device: it should be at least 0, not -1"),
    ],
)
def test_a_mistake_is_named_with_its_remedy(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence) as caught:
        load_rig(write(tmp_path, text))
    assert "lab.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_rig_is_sim_or_a_file(tmp_path: Path) -> None:
    assert choose_rig("sim") is None
    chosen = choose_rig(str(write(tmp_path, CONTROLLER)))
    assert chosen is not None
    with pytest.raises(ConfigError, match="cannot be read: No such file or directory: give sim, board, or the TOML"):
        choose_rig(str(tmp_path / "none.toml"))
    with pytest.raises(RigFailed, match="rig board has no devices: choose sim"):
        choose_rig("board")


def test_the_file_on_the_page_is_a_rig(tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs" / "rigs.md").read_text(encoding="utf-8")
    block = page.split("## The file")[1].split("```toml\n")[1].split("```")[0]
    for name in ("robot.toml", "built.toml"):
        copy(DEFAULT_FILE, tmp_path / name)
    rig = load_rig(write(tmp_path, block))
    assert chess.Board(rig.world_section.fen).is_valid()
    assert rig.table == TableSettings(), "the page shows the usual table"
    shown = set(re.findall(r"^(\w+) =", block, re.MULTILINE))
    assert {*RigFile.model_fields} - {"controller", "drives", "world", "table", "camera"} <= shown
    assert {"bus", *WorldSection.model_fields} - {"hand", "planted"} <= shown


def test_the_drives_on_the_page_are_drives(tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs" / "drives.md").read_text(encoding="utf-8")
    moteus, ethercat, world = (block.split("```")[0] for block in page.split("```toml\n")[1:])
    rig = load_rig(write(tmp_path, moteus))
    assert rig.drives.moteus is not None
    assert [joint.sign for joint in rig.drives.joints] == [-1, 1, 1]
    chained = load_rig(write(tmp_path, CONTROLLER + '[drives]\nbus = "ethercat"\n' + ethercat))
    assert chained.drives.ethercat is not None
    assert chained.drives.ethercat.sdo
    planted = load_rig(write(tmp_path, moteus.replace("# emulated", "emulated") + world)).world_section.planted
    assert [fault.device for fault in planted] == [2, 1]
    shown = set(re.findall(r"^(?:# )?(\w+) =", moteus + ethercat, re.MULTILINE))
    assert {*DrivesSection.model_fields} - {"joints", "finger", "moteus", "ethercat"} <= shown


def test_the_cameras_on_the_page_are_cameras(tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs" / "rigs.md").read_text(encoding="utf-8")
    shown = {}
    for block in page.split("## A lab's camera")[1].split("```toml\n")[1:]:
        text = block.split("```")[0]
        camera = load_rig(write(tmp_path, LAB + text)).lab_camera
        shown[type(camera)] = set(re.findall(r"^(\w+) =", text, re.MULTILINE))
    assert set(shown) == set(get_args(LabCamera))
    for kind, names in shown.items():
        assert set(kind.model_fields) - {"focal"} <= names, f"the page shows every setting of {kind}"


def test_paths_of_a_camera_count_from_the_file(tmp_path: Path) -> None:
    def camera(text: str) -> LabCamera:
        return load_rig(write(tmp_path, LAB + "[camera]\n" + text)).lab_camera

    assert camera('kind = "folder"\npath = "a"') == FolderSettings(path=tmp_path / "a")
    assert camera('kind = "recording"\npath = "/a.db3"') == RecordingSettings(path=Path("/a.db3"))
    assert camera('kind = "webcam"\ndevice = "a.avi"\nfocal = 500') == WebcamSettings(
        device=tmp_path / "a.avi", focal=500
    )
    assert camera('kind = "webcam"\ndevice = 2\nfocal = 500') == WebcamSettings(device=2, focal=500)
    assert load_rig(write(tmp_path, LAB)).lab_camera == NoCameraSettings()
