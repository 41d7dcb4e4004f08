"""``touchmove commission``: the steps one after the other, each refused until the one before it held."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from app import UserError
from app.commissioning.bring_up.axes import try_axes
from app.commissioning.bring_up.person import Person
from app.commissioning.bring_up.steps import (
    FILE,
    Commissioning,
    CommissionReport,
    Step,
    StepLine,
    StepRecord,
    StepState,
    fingerprint_of,
    load_record,
    next_step,
    save_record,
    states_of,
)
from app.commissioning.check_drives import check_bus
from app.commissioning.check_report import CheckState, Finding, Judge
from app.commissioning.operate import STATUS, operate
from app.rig.rig_file import RigFile, load_rig
from app.rig.simulation.processes import drives_of
from app.settings.tree import BOARD, SIMULATED
from hardware.interfaces import HardwareError, ServoBus
from hardware.parameters import RobotParameters, load_parameters

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Site:
    """The arm that is brought up, and who stands beside it."""

    name: str
    """Of the rig file."""
    rig: RigFile
    parameters: RobotParameters
    person: Person
    progress: Progress


WHAT: Final[dict[Step, str]] = {
    Step.DEVICES: "drives, gripper and fingers; the brakes stay closed",
    Step.AXES: "each axis alone; the brakes open for milliseconds, and the tool drops by some millimetres: hands off, "
    "and nothing below the tool",
}
"""What is done, told before."""
_RUNS: Final[dict[Step, Callable[[Site], list[Finding]]]] = {}


def run_commission(
    name: str, person: Person, progress: Progress, *, start: Step | None = None, status: bool = False
) -> CommissionReport:
    """Go on with the commissioning of a rig file from where it stands, until a step fails, or a person says no.

    Args:
        name: of the rig file.
        person: who is asked.
        progress: told what is done.
        start: this step and all after it are done again, if those before it hold.
        status: only say where it stands.

    Raises:
        UserError: there is no such rig, a step before ``start`` does not hold, or a controller has the drives.
    """
    if name in (SIMULATED, BOARD):
        raise UserError(f"rig {name} needs no commissioning: give --rig the TOML file of an arm's rig")
    path = Path(name).absolute().parent / FILE
    site = _site(name, person, progress)
    done = load_record(path)
    states = states_of(done, site.rig, site.parameters)
    if status:
        return _report(name, done, states, ())
    if start is not None:
        first = next_step(states)
        if first is not None and list(Step).index(first) < list(Step).index(start):
            raise UserError(f"step {start} is refused: step {first} comes before it, and is {states[first].value}")
        done = done.without(start)
    return _go_on(site, path, done)


def _site(name: str, person: Person, progress: Progress) -> Site:
    rig = load_rig(Path(name))
    return Site(name, rig, load_parameters(rig.parameters), person, progress)


def _go_on(site: Site, path: Path, done: Commissioning) -> CommissionReport:
    findings: tuple[Finding, ...] = ()
    while True:
        site = _site(site.name, site.person, site.progress)  # a step may have named another parameters file
        states = states_of(done, site.rig, site.parameters)
        step = next_step(states)
        if step is None or step not in _RUNS:
            return _report(site.name, done, states, findings)
        number = list(Step).index(step) + 1
        site.progress(f"step {number} of {len(Step)}, {step}: {WHAT[step]}")
        if not site.person.agrees("go on?"):
            return _report(site.name, done, states, findings)
        findings = tuple(_RUNS[step](site))
        holds = all(one.state is not CheckState.WRONG for one in findings)
        mark = fingerprint_of(step, site.rig, site.parameters)
        record = StepRecord(step=step, holds=holds, when=datetime.now(UTC), fingerprint=mark, findings=findings)
        done = done.with_step(record)
        save_record(path, done)
        if not holds:
            return _report(site.name, done, states_of(done, site.rig, site.parameters), findings)


def _report(
    name: str, done: Commissioning, states: dict[Step, StepState], findings: tuple[Finding, ...]
) -> CommissionReport:
    lines = []
    for step, state in states.items():
        record = done.of(step)
        lines.append(StepLine(step=step, state=state, when=None if record is None else record.when))
    waiting = next_step(states)
    if waiting is None:
        sentence = "every step held"
    elif states[waiting] is StepState.FAILED:
        sentence = f"step {waiting} failed: put right what it says, then say 'touchmove commission --rig {name}' again"
    else:
        sentence = f"next is step {waiting}: 'touchmove commission --rig {name}'"
    return CommissionReport(
        rig=name, holds=StepState.FAILED not in states.values(), steps=tuple(lines), findings=findings, next=sentence
    )


# steps on the bare drives


def _on_drives(site: Site, try_it: Callable[[ServoBus], list[Finding]]) -> list[Finding]:
    """Open the drives for a step, and leave them on their brakes; raises ``UserError`` if a controller has them."""
    _require_free(site)
    try:
        with drives_of(site.rig, site.progress) as open_bus:
            bus = open_bus(site.parameters)
            try:
                return try_it(bus)
            finally:
                bus.close()
    except HardwareError as error:
        judge = Judge("drives")
        judge.wrong("connection", str(error), "put right what it says, then begin this step again")
        return judge.findings


def _require_free(site: Site) -> None:
    if not site.rig.controller.key.exists():
        return
    try:
        operate(STATUS, site.name)
    except UserError:
        return  # none answers
    raise UserError(
        f"a controller holds the drives of {site.name}: end it with 'touchmove controller shutdown --rig {site.name}'"
    )


def _devices(site: Site) -> list[Finding]:
    return _on_drives(site, lambda bus: check_bus(bus, site.parameters, site.rig.table))


def _axes(site: Site) -> list[Finding]:
    return _on_drives(site, lambda bus: try_axes(bus, site.parameters, site.rig.table, site.person.tool, site.progress))


_RUNS.update({Step.DEVICES: _devices, Step.AXES: _axes})
