"""Parameter files: the default set holds what paper and datasheets print, and a wrong file is one clear sentence."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path

import pytest
from pydantic import ValidationError

from hardware.parameters import DEFAULT_FILE, ParametersError, RobotParameters, load_parameters

TEXT = DEFAULT_FILE.read_text(encoding="utf-8")


def refusal(folder: Path, text: str | bytes) -> str:
    """What is said of a file; the path is cut off."""
    path = folder / "robot.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ParametersError) as caught:
        load_parameters(path)
    start = f"parameter file {path}"
    assert str(caught.value).startswith(start)
    return str(caught.value).removeprefix(start)


def change(old: str, new: str) -> str:
    """The default file with one thing changed."""
    assert TEXT.count(old) == 1
    return TEXT.replace(old, new)


def test_lengths_are_those_of_the_papers_table() -> None:
    g = load_parameters().geometry
    lengths = (g.base_radius, g.proximal_length, g.distal_length, g.flange_radius, g.gripper_height)
    assert lengths == (0.165, 0.2, 0.4, 0.0562, 0.075)


def test_drives_are_those_of_the_datasheet() -> None:
    parameters = load_parameters()
    drive = parameters.drive
    assert (drive.rated_torque, drive.peak_torque, drive.encoder_bits, drive.tick) == (2.4, 8.4, 22, 0.00088)
    assert parameters.inertia.rotor_inertia == 1.37e-4
    assert parameters.tactile.bandwidth == 100.0


def test_what_moves_with_the_tool_weighs_what_it_was_chosen_for() -> None:
    assert load_parameters().inertia.moving_platform_mass == pytest.approx(0.86)


def test_a_stem_slides_to_the_centre_of_the_pads_groove() -> None:
    pads = load_parameters().pads
    assert pads.friction < math.tan(pads.groove_angle)


def test_every_value_not_from_paper_or_datasheet_is_marked() -> None:
    """Each line of the tables whose numbers nobody printed says *assumed*, or what follows from what."""
    section = ""
    for line in TEXT.splitlines():
        if line.startswith("["):
            section = line.split("]")[0].strip("[")
        printed = section in ("geometry", "tactile") or "datasheet" in line or "HG-KR73B" in line
        if "=" in line and section in ("inertia", "drive", "gripper") and not printed:
            known = ("rated_torque", "encoder_bits", "tick ")
            assert "assumed" in line or line.startswith(known), line


def test_a_lab_may_have_a_file_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(change("proximal_mass = 0.35 ", "proximal_mass = 0.41 "), encoding="utf-8")
    assert load_parameters(path).inertia.proximal_mass == 0.41
    assert load_parameters(path).geometry == load_parameters().geometry


def test_parameters_cannot_be_changed() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        load_parameters().drive.tick = 0.001


def test_no_file(tmp_path: Path) -> None:
    path = tmp_path / "none.toml"
    with pytest.raises(
        ParametersError, match=re.escape(f"parameter file {path} cannot be read: No such file or directory")
    ):
        load_parameters(path)
    with pytest.raises(ParametersError, match=re.escape(f"{tmp_path} cannot be read: Is a directory")):
        load_parameters(tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("stroke = 0.022", "", ": gripper.stroke is missing, compare parameters.toml"),
        (
            "stroke = 0.022",
            "strok = 0.022",
            ": gripper.strok is unknown, choose from stroke, velocity_gain, max_force, max_speed, reflected_mass, "
            "coupling_stiffness",
        ),
        (
            "[tactile]",
            "[touch]",
            ": touch is unknown, choose from geometry, inertia, friction, drive, gripper, pads, tactile, marker, arms",
        ),
        ("coulomb = 0.02", "coulomb = -1.0", ": friction.coulomb is -1.0: it should be at least 0"),
        ("coulomb = 0.02", "coulomb = inf", ": friction.coulomb is inf: it should be a finite number"),
        ("coulomb = 0.02", "coulomb = nan", ": friction.coulomb is nan: it should be a finite number"),
        ("coulomb = 0.02", 'coulomb = "0.02"', ": friction.coulomb is '0.02': it should be a number"),
        ("stroke = 0.022", "stroke = 0.0", ": gripper.stroke is 0.0: it should be more than 0"),
        ("encoder_bits = 22", "encoder_bits = 2.5", ": drive.encoder_bits is 2.5: it should be a whole number"),
        ("peak_torque = 8.4", "peak_torque = 2.0", ": drive: peak_torque 2.0 N m is below rated_torque 2.4 N m"),
    ],
)
def test_a_wrong_file_is_named_with_field_value_and_what_is_valid(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    assert refusal(tmp_path, change(old, new)) == said


def test_what_is_no_toml_is_no_parameter_file(tmp_path: Path) -> None:
    assert refusal(tmp_path, "[drive").startswith(" is not valid TOML: Expected ']'")
    assert refusal(tmp_path, b"\xff\xfe\x00").startswith(" is not valid TOML: 'utf-8' codec")


def test_the_file_and_the_model_have_the_same_fields() -> None:
    raw = tomllib.loads(TEXT)
    assert RobotParameters.model_validate(raw).model_dump(exclude_none=True) == raw


def test_arms_that_are_said_to_be_other_count_for_more_than_what_is_said_of_all(tmp_path: Path) -> None:
    plain = RobotParameters.model_validate(tomllib.loads(TEXT))
    section = "\n[arms]\n" + "\n".join(
        f"{name} = [{', '.join(str(value * factor) for factor in (1.0, 1.1, 0.9))}]"
        for name, value in plain.arm(0)._asdict().items()
    )
    path = tmp_path / "robot.toml"
    path.write_text(TEXT + section + "\n", encoding="utf-8")
    robot = load_parameters(path)
    assert robot.arm(0) == plain.arm(0)
    assert robot.arm(1).coulomb == pytest.approx(1.1 * plain.friction.coulomb)
    assert robot.arm(2).hinge_inertia == pytest.approx(0.9 * plain.arm(2).hinge_inertia)


def test_an_arm_lighter_than_its_rotor_is_refused(tmp_path: Path) -> None:
    plain = RobotParameters.model_validate(tomllib.loads(TEXT))
    robot = plain.with_arms([plain.arm(number)._replace(hinge_inertia=1e-4) for number in range(3)])
    assert robot.arms is not None
    path = tmp_path / "robot.toml"
    lines = "\n".join(f"{name} = {list(value)}" for name, value in robot.arms.model_dump().items())
    path.write_text(TEXT + "\n[arms]\n" + lines + "\n", encoding="utf-8")
    with pytest.raises(ParametersError, match=r"must exceed inertia\.rotor_inertia"):
        load_parameters(path)
