"""Steps come in order, are recorded with what they depend on, and are void once that has changed."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest

from app import UserError
from app.commissioning.bring_up import commission
from app.commissioning.bring_up.commission import run_commission
from app.commissioning.bring_up.person import Commissioner, GivenAnswers, load_answers, parse_triple
from app.commissioning.bring_up.rig_file_edit import name_parameters, with_parameters
from app.commissioning.bring_up.runs import CommissionSite
from app.commissioning.bring_up.steps import (
    FILE,
    Commissioning,
    CommissionStep,
    StepRecord,
    StepState,
    fingerprint_of,
    load_record,
    next_step,
    save_record,
    states_of,
)
from app.commissioning.check_report import Finding, Judge
from app.rig.rig_file import RigFile, load_rig
from app.settings.toml import ConfigError
from hardware.parameters import DEFAULT_FILE, RobotParameters, load_parameters

RIG = '[controller]\nport = 47321\n\n[drives]\nbus = "sim"\n'
ROBOT = load_parameters()
ORDER = list(CommissionStep)


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    path = tmp_path / "lab.toml"
    path.write_text(RIG)
    return path


def everything(rig: RigFile, parameters: RobotParameters = ROBOT) -> Commissioning:
    done = Commissioning()
    for step in reversed(ORDER):
        mark = fingerprint_of(step, rig, parameters)
        done = done.with_step(
            StepRecord(step=step, holds=True, when=datetime(2026, 1, 2, tzinfo=UTC), fingerprint=mark, findings=())
        )
    return done


def void(done: Commissioning, rig: RigFile, parameters: RobotParameters = ROBOT) -> set[CommissionStep]:
    states = states_of(done, rig, parameters)
    assert set(states.values()) <= {StepState.HELD, StepState.VOID}
    return {step for step, state in states.items() if state is StepState.VOID}


def test_what_has_changed_voids_the_steps_that_depend_on_it(lab: Path) -> None:
    rig = load_rig(lab)
    done = everything(rig)
    assert void(done, rig) == set()
    heavier = ROBOT.model_copy(update={"inertia": ROBOT.inertia.model_copy(update={"flange_mass": 0.5})})
    assert void(done, rig, heavier) == {CommissionStep.GRAVITY, CommissionStep.TRACKING, CommissionStep.GAME}
    slower = ROBOT.model_copy(update={"drive": ROBOT.drive.model_copy(update={"watchdog_ticks": 60})})
    assert void(done, rig, slower) == set(CommissionStep)
    moved = rig.model_copy(update={"table": rig.table.model_copy(update={"centre_in_base": (0.0, 0.0, 0.46)})})
    assert void(done, moved) == set(CommissionStep) - {CommissionStep.DEVICES, CommissionStep.AXES}
    lab.write_text(RIG + '[world]\nseed = 5\nfen = "8/8/4k3/8/8/4K3/8/8 w - - 0 1"\n')
    assert void(done, load_rig(lab)) == set(CommissionStep)  # another robot
    other = load_rig(lab)
    lab.write_text(RIG + "[world]\nseed = 5\n")
    assert void(everything(other), load_rig(lab)) == set()  # other pieces


def test_a_record_is_read_as_it_was_written(lab: Path, tmp_path: Path) -> None:
    done = everything(load_rig(lab))
    assert [one.step for one in done.steps] == ORDER
    save_record(tmp_path / FILE, done)
    assert load_record(tmp_path / FILE) == done
    assert load_record(tmp_path / "none.json") == Commissioning()
    (tmp_path / FILE).write_text("{")
    with pytest.raises(UserError, match="move it away"):
        load_record(tmp_path / FILE)


class Bench:
    """Steps that do nothing but say what a test wants of them."""

    def __init__(self) -> None:
        self.fails: set[CommissionStep] = set()
        self.ran: list[CommissionStep] = []

    def step(self, step: CommissionStep) -> Callable[[CommissionSite], list[Finding]]:
        def run(_site: CommissionSite) -> list[Finding]:
            self.ran.append(step)
            judge = Judge("arm")
            judge.judge("it", "found", step not in self.fails, "mend it")
            return judge.findings

        return run


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    bench = Bench()
    monkeypatch.setattr(commission, "RUNS", {step: bench.step(step) for step in CommissionStep})
    return bench


def go(lab: Path, read: Callable[[str], str] | None = None, **options: object):  # type: ignore[no-untyped-def]
    return run_commission(str(lab), Commissioner(GivenAnswers(), read), lambda _: None, **options)  # type: ignore[arg-type]


def test_steps_come_in_order_and_a_step_that_fails_ends_it(lab: Path, bench: Bench) -> None:
    bench.fails = {CommissionStep.GRAVITY}
    report = go(lab)
    assert bench.ran == ORDER[:4]
    assert not report.holds
    assert "step gravity failed" in report.next
    assert [one.what for one in report.findings] == ["it"]
    bench.fails = set()
    report = go(lab)
    assert bench.ran == [*ORDER[:4], *ORDER[3:7]]
    assert report.holds
    assert "--game" in report.next
    assert go(lab, game=True).next == "every step held"
    assert bench.ran[-1] is CommissionStep.GAME


def test_status_does_nothing_and_from_does_again(lab: Path, bench: Bench) -> None:
    assert next_step({one.step: one.state for one in go(lab, status=True).steps}) is CommissionStep.DEVICES
    assert not bench.ran
    with pytest.raises(UserError, match="step gravity is refused: step devices comes before it"):
        go(lab, start=CommissionStep.GRAVITY)
    go(lab)
    bench.ran.clear()
    go(lab, start=CommissionStep.IDENTIFY)
    assert bench.ran == [CommissionStep.IDENTIFY, CommissionStep.TRACKING, CommissionStep.CALIBRATE]


def test_whoever_says_no_ends_it(lab: Path, bench: Bench) -> None:
    answers = iter(["", "y", "n"])
    report = go(lab, lambda _: next(answers))
    assert bench.ran == ORDER[:2]
    assert report.holds
    assert "next is step workspace" in report.next


def test_rigs_that_have_no_arm_of_their_own_are_refused() -> None:
    with pytest.raises(UserError, match="needs no commissioning"):
        run_commission("sim", Commissioner(GivenAnswers(), None), lambda _: None)


def test_a_table_says_what_to_do(lab: Path, bench: Bench) -> None:
    from rich.console import Console

    bench.fails = {CommissionStep.DEVICES}
    console = Console(width=160, record=True, file=open("/dev/null", "w"))  # noqa: SIM115, PTH123
    console.print(go(lab).table())
    console.file.close()
    text = console.export_text()
    assert "mend it" in text
    assert "to be done" in text


# ---------------------------------------------------------------------------------------------------------- small parts


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("[controller]\nport = 1\n", 'parameters = "new.toml"\n[controller]\nport = 1\n'),
        ('# mine\nparameters = "old.toml" # so\n[x]\n', '# mine\nparameters = "new.toml"\n[x]\n'),
        ("[x]\nparameters = 1\n", 'parameters = "new.toml"\n[x]\nparameters = 1\n'),
        ('  parameters = "old.toml"\n[drives]\n', 'parameters = "new.toml"\n[drives]\n'),
        ('"parameters" = "old.toml"\n', 'parameters = "new.toml"\n'),
    ],
)
def test_one_line_of_a_rig_file_changes(before: str, after: str) -> None:
    assert with_parameters(before, "new.toml") == after


def test_a_parameters_file_is_named_in_the_rig_file(lab: Path) -> None:
    (lab.parent / "mine.toml").write_bytes(DEFAULT_FILE.read_bytes())
    name_parameters(lab, "mine.toml")
    assert load_rig(lab).parameters == lab.parent / "mine.toml"
    assert lab.read_text().endswith(RIG)


def test_answers_are_numbers_or_asked_again(tmp_path: Path) -> None:
    assert parse_triple("1, -2.5 3") == (1.0, -2.5, 3.0)
    assert parse_triple("1, 2") is parse_triple("here") is parse_triple("1,2,nan") is None
    typed = iter(["there", "0 -75 145"])
    import numpy as np

    asked = Commissioner(GivenAnswers(), lambda _: next(typed)).tool(np.zeros(3))
    assert asked.tolist() == [0.0, -0.075, 0.145]
    with pytest.raises(UserError, match="--measured-tool"):
        Commissioner(GivenAnswers(), None).tool(np.zeros(3))
    file = tmp_path / "answers.toml"
    file.write_text("measured_tool = [0.0, -75.0, 145.0]\npole_pairs = 4\n")
    assert load_answers(file) == GivenAnswers(measured_tool=(0.0, -75.0, 145.0), pole_pairs=4)
    file.write_text("measured_tol = [0.0, -75.0, 145.0]\n")
    with pytest.raises(ConfigError, match="measured_tool"):
        load_answers(file)


def test_the_simulated_robot_may_be_another_than_the_one_believed(lab: Path) -> None:
    from app.rig.simulation.settings import world_settings

    (lab.parent / "built.toml").write_bytes(DEFAULT_FILE.read_bytes())
    lab.write_text(RIG + '[world]\nrobot = "built.toml"\n')
    rig = load_rig(lab)
    assert rig.parameters == DEFAULT_FILE
    assert world_settings(rig).parameters_file == lab.parent / "built.toml"
    lab.write_text(RIG + '[world]\nrobot = "gone.toml"\n')
    with pytest.raises(ConfigError, match="gone"):
        load_rig(lab)


def test_reports_are_json(lab: Path, bench: Bench) -> None:
    content = json.loads(go(lab).model_dump_json())
    assert [one["step"] for one in content["steps"]] == [step.value for step in CommissionStep]


@pytest.mark.parametrize(
    ("answers", "typed", "room"),
    [
        (GivenAnswers(measured_tool=(0.0, -75.0, 145.0)), None, True),
        (GivenAnswers(measured_tool=(0.0, -75.0, 45.0)), "y", False),
        (GivenAnswers(), None, False),  # a yes to everything is nobody who has looked
        (GivenAnswers(), "y", True),
        (GivenAnswers(), "n", False),
    ],
)
def test_room_below_the_tool_is_there_if_somebody_has_looked(
    answers: GivenAnswers, typed: str | None, room: bool
) -> None:
    person = Commissioner(answers, None if typed is None else lambda _question: typed)
    assert person.sees_room(0.03, 0.07) is room
