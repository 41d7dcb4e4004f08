"""``touchmove commission`` from the command line, on a simulated arm that nobody has commissioned yet."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli.commands import app
from app.commissioning.bring_up.steps import FILE, CommissionReport, CommissionStep, StepState
from hardware.sim.clients.wire import world_pid

RIG = """
[controller]
port = 0
[drives]
bus = "sim"
[world]
pace = "fast"
cameras = false
seed = 3
randomisation = { robot_mass = 0.2, arm_mass = 0.1, arm_friction = 0.5, devices = { torque_ripple = 0.02, \
cogging = 0.015, encoder_noise = 1.5e-6, tactile_noise = 0.03, tactile_offset = 0.05 } }
""".replace("\\\n", "")


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    path = tmp_path / "lab.toml"
    path.write_text(RIG)
    return path


def commission(lab: Path, *options: str, typed: str = "") -> tuple[int, str, str]:
    done = CliRunner().invoke(app, ["commission", "--rig", str(lab), *options], input=typed)
    return done.exit_code, done.stdout, done.stderr


def states(out: str) -> dict[CommissionStep, StepState]:
    return {line.step: line.state for line in CommissionReport.model_validate(json.loads(out)).steps}


def test_mistakes_are_one_sentence(lab: Path) -> None:
    for options, said in (
        (("--from", "dance"), "is not a step, choose from: devices, axes"),
        (("--measured-tool", "here"), "give x,y,height"),
        (("--from", "game", "--yes"), "step game is refused: step devices comes before it"),
    ):
        status, _, err = commission(lab, *options)
        assert status == 2
        assert said in err


def test_status_of_an_arm_that_was_just_switched_on(lab: Path) -> None:
    status, out, _ = commission(lab, "--status", "--json")
    assert status == 0
    assert set(states(out).values()) == {StepState.OPEN}


@pytest.mark.slow
def test_devices_and_axes_hold_and_the_tool_that_was_measured_elsewhere_does_not(lab: Path) -> None:
    """Two steps with a person who says yes twice and then no; then the zeros are wrong by what they say they see."""
    status, out, err = commission(lab, "--json", "--measured-tool", "0,-75,143", typed="\n\nn\n")
    assert status == 0, out + err
    assert [step for step, state in states(out).items() if state is StepState.HELD] == ["devices", "axes"]
    assert (lab.parent / FILE).exists()
    status, out, _ = commission(lab, "--json", "--yes", "--from", "axes", "--measured-tool", "0,-60,143")
    assert status == 1
    assert states(out)[CommissionStep.AXES] is StepState.FAILED
    assert "to the offset of joint" in out
    assert world_pid(lab.parent / "run") is None
