"""The parameters file of an identified robot: the form that ``hardware.parameters`` reads, and a word on each value."""

from __future__ import annotations

import tomllib
from datetime import datetime
from pathlib import Path
from typing import Final

from app.commissioning.identification.estimation import Estimate, Identification
from app.records.files import check_output, write_atomically
from app.settings.toml import toml_value
from hardware.parameters import RobotParameters

_BY: Final = "as 'touchmove identify' found it"
"""Stands in the head of every such file."""
_MOVING: Final = ("flange_mass", "gripper_body_mass", "finger_mass")
_SHARED: Final = "identified together with all that moves with the tool; how it is divided is assumed"
_OVERRULED: Final = "assumed; [arms] overrides it"
_SOURCES: Final = {
    "hinge_inertia": ("A", "B"), "proximal_moment": ("E", "B"), "distal_pair_mass": ("B",), "viscous": ("viscous",),
    "coulomb": ("coulomb",),
}  # fmt: skip
"""Of which estimates each of the arms' values is made."""


def robot_text(found: Identification, made: datetime, how: str) -> str:
    """The file.

    Args:
        found: the robot.
        made: when.
        how: on what, for the file's head.
    """
    robot = found.parameters
    untold = [one.name for one in found.estimates if not one.told]
    lines = [
        f"# A delta robot {_BY}, {made.isoformat(timespec='seconds')}, {how}.",
        "# Values are SI. Bands are half of the 95 % interval. Base parameters (docs/commissioning.md):",
        *(f"#   {_said(one)}" for one in found.estimates),
        f"# The data could not determine: {', '.join(untold)}; these keep their previous values."
        if untold
        else "# The data determined all of them.",
        "# The masses are as accurate as the torque constants: all masses and frictions share",
        "# their error. Lengths, drives, gripper, pads and marker are not identified: they keep their values.",
    ]
    for name, section in robot.model_dump(exclude_none=True).items():
        lines += ["", f"[{name}]"]
        lines += [f"{key} = {_number(value)}{_word(found, name, key)}" for key, value in section.items()]
    return "\n".join(lines) + "\n"


def check_robot_file(path: Path) -> None:
    """See before the robot moves whether the file can be written.

    Raises:
        RecordError: it cannot, or would replace a file that was not written by this program.
    """
    check_output(path, "a file of 'touchmove identify'", _BY.encode())


def write_robot(path: Path, text: str) -> None:
    """Write the file; the one before it stays until the new one is whole and was read.

    Raises:
        RecordError: it cannot be written, or would replace a file that was not written by this program.
    """
    RobotParameters.model_validate(tomllib.loads(text))
    check_robot_file(path)
    write_atomically(path, text)


def _said(one: Estimate) -> str:
    told = "" if one.told else ", not told"
    return f"{one.name} = {one.value:.6g} ± {one.band:.2g} {one.unit} (believed {one.believed:.6g}{told})"


def _number(value: object) -> str:
    return f"[{', '.join(repr(float(one)) for one in value)}]" if isinstance(value, tuple) else toml_value(value)


def _word(found: Identification, section: str, key: str) -> str:
    """The comment behind a value."""
    if section == "arms":
        return f"  # {_told_of_arms(found, key)}"
    if section == "inertia":
        return f"  # {_SHARED if key in _MOVING else 'assumed' if key == 'rotor_inertia' else _OVERRULED}"
    return f"  # {_OVERRULED}" if section == "friction" else ""


def _told_of_arms(found: Identification, key: str) -> str:
    parts = [one for one in found.estimates if one.name.rstrip("123") in _SOURCES[key]]
    untold = sorted({one.name for one in parts if not one.told})
    if untold:
        return f"assumed in part: {', '.join(untold)} could not be determined"
    worst = max(one.band / max(abs(one.value), 1e-12) for one in parts if one.name.startswith(_SOURCES[key][0]))
    return f"identified, ± {100.0 * worst:.2g} %"
