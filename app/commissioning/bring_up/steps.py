"""The steps from the first switch-on to the first game, in order, and what each depends on.

A step is done once the one before it held. What it found stands in ``commissioning.json`` beside the rig file, with the
*fingerprint* of what it depends on: if that changes, the step has to be done again.
"""

from __future__ import annotations

import hashlib
import json
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError
from rich.console import Group, RenderableType
from rich.text import Text

from app import UserError
from app.commissioning.check_report import Finding, findings_table
from app.records.files import write_atomically
from app.rig.rig_file import RigFile
from app.terminal.report_table import judged, rows_table
from hardware.frozen import Frozen
from hardware.parameters import RobotParameters

FILE: Final = "commissioning.json"


class CommissionStep(StrEnum):
    """One step; members stand in order."""

    DEVICES = "devices"
    """Drives, gripper and fingers answer; the watchdog bites; switched off they stand on their brakes."""
    AXES = "axes"
    """Each brake, encoder and motor alone."""
    WORKSPACE = "workspace"
    """Home and the edges of the workspace, at creep speed."""
    GRAVITY = "gravity"
    """What the arm takes to be held, over the workspace."""
    IDENTIFY = "identify"
    """What it weighs and how it rubs."""
    TRACKING = "tracking"
    """How well it follows motions of a game, and how gently it touches."""
    CALIBRATE = "calibrate"
    """Where the camera hangs."""
    GAME = "game"
    """A first game, gently."""


class StepState(StrEnum):
    """How a step stands."""

    HELD = "held"
    FAILED = "failed"
    VOID = "to be repeated"  # what it depends on has changed since
    OPEN = "to be done"


_WIRED: Final = ("drives", "motor")
DEPENDS: Final[dict[CommissionStep, tuple[str, ...]]] = {
    CommissionStep.DEVICES: (*_WIRED, "fingers"),
    CommissionStep.AXES: (*_WIRED, "geometry"),
    CommissionStep.WORKSPACE: (*_WIRED, "geometry", "table"),
    CommissionStep.GRAVITY: (*_WIRED, "geometry", "table", "masses"),
    CommissionStep.IDENTIFY: (*_WIRED, "geometry", "table"),
    CommissionStep.TRACKING: (*_WIRED, "geometry", "table", "masses"),
    CommissionStep.CALIBRATE: (*_WIRED, "geometry", "table", "camera"),
    CommissionStep.GAME: (*_WIRED, "geometry", "table", "masses", "fingers", "camera"),
}
"""By step: which parts of rig file and parameters file it depends on, see ``_parts``."""
_NOT_THE_ROBOT: Final = frozenset({
    "fen", "person", "linger", "journal", "camera", "cameras", "light", "camera_latency", "pace", "processes",
    "realtime", "hand",
})  # fmt: skip
"""Fields of a simulated ``[world]`` that change nothing about its robot."""


class StepRecord(Frozen):
    """What came of a step."""

    step: CommissionStep
    holds: bool
    when: datetime
    fingerprint: str
    """Of what it depends on, see ``fingerprint_of``."""
    findings: tuple[Finding, ...]


class Commissioning(Frozen):
    """What was recorded of a rig: the last of each step."""

    steps: tuple[StepRecord, ...] = ()

    def of(self, step: CommissionStep) -> StepRecord | None:
        """The last record of a step."""
        return next((one for one in self.steps if one.step is step), None)

    def with_step(self, record: StepRecord) -> Commissioning:
        """With a new record of its step."""
        others = [one for one in self.steps if one.step is not record.step]
        return Commissioning(
            steps=tuple(sorted([*others, record], key=lambda one: list(CommissionStep).index(one.step)))
        )

    def without(self, step: CommissionStep) -> Commissioning:
        """With this step and all after it to be done again."""
        order = list(CommissionStep)
        return Commissioning(steps=tuple(one for one in self.steps if order.index(one.step) < order.index(step)))


def _parts(rig: RigFile, parameters: RobotParameters) -> dict[str, Any]:
    robot = parameters.model_dump(mode="json")
    world = {} if rig.world is None else rig.world.model_dump(mode="json", exclude=set(_NOT_THE_ROBOT))
    return {
        "drives": [rig.drives.model_dump(mode="json"), world],
        "motor": robot["drive"],
        "fingers": [robot[name] for name in ("gripper", "pads", "tactile")],
        "geometry": robot["geometry"],
        "masses": [robot[name] for name in ("inertia", "friction", "arms")],
        "table": rig.table.model_dump(mode="json"),
        "camera": [None if rig.camera is None else rig.camera.model_dump(mode="json"), robot["marker"]],
    }


def fingerprint_of(step: CommissionStep, rig: RigFile, parameters: RobotParameters) -> str:
    """Twelve digits that change with what a step depends on."""
    parts = _parts(rig, parameters)
    content = json.dumps([parts[name] for name in DEPENDS[step]], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()[:12]


def states_of(done: Commissioning, rig: RigFile, parameters: RobotParameters) -> dict[CommissionStep, StepState]:
    """How each step stands."""
    states = {}
    for step in CommissionStep:
        record = done.of(step)
        if record is None:
            states[step] = StepState.OPEN
        elif record.fingerprint != fingerprint_of(step, rig, parameters):
            states[step] = StepState.VOID
        else:
            states[step] = StepState.HELD if record.holds else StepState.FAILED
    return states


def next_step(states: dict[CommissionStep, StepState]) -> CommissionStep | None:
    """The first that does not hold; None: all do."""
    return next((step for step, state in states.items() if state is not StepState.HELD), None)


def load_record(path: Path) -> Commissioning:
    """Read what was recorded; nothing yet where there is no file. ``UserError``: it cannot be read."""
    try:
        return Commissioning.model_validate_json(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return Commissioning()
    except (OSError, ValidationError) as error:
        raise UserError(f"{path} cannot be read: move it away to start commissioning again") from error


def save_record(path: Path, done: Commissioning) -> None:
    """Write it; raises ``RecordError`` if it cannot be written."""
    write_atomically(path, done.model_dump_json(indent=2))


class StepLine(Frozen):
    """How a step stands, for people and programs."""

    step: CommissionStep
    state: StepState
    when: datetime | None


class CommissionReport(Frozen):
    """How a rig stands, and what the steps of this run found."""

    rig: str
    holds: bool
    """No step stands as failed; some may be to be done."""
    steps: tuple[StepLine, ...]
    findings: tuple[Finding, ...]
    """Of the last step that was done."""
    next: str
    """What to do next, one sentence."""

    def table(self) -> RenderableType:
        """One screen for people."""
        rows = [
            (line.step.value, judged(line.state.value, _HOLDS[line.state]),
             "" if line.when is None else f"{line.when.astimezone():%Y-%m-%d %H:%M}")
            for line in self.steps
        ]  # fmt: skip
        steps = Group(
            Text(f"rig {self.rig}: {self.next}"), rows_table(("step", "state", "last done"), rows)
        )  # a title would be folded to the width of this narrow table
        if not self.findings:
            return steps
        return Group(findings_table(self.findings, "the last step found"), "", steps)


_HOLDS: Final = {StepState.HELD: True, StepState.FAILED: False, StepState.VOID: None, StepState.OPEN: None}
