"""``touchmove commission``: the steps one after the other, each refused until the one before it held."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from app import UserError
from app.commissioning.bring_up.person import Commissioner
from app.commissioning.bring_up.runs import GAME_PLIES, RUNS, WHAT, CommissionSite, Progress, require_free
from app.commissioning.bring_up.steps import (
    FILE,
    Commissioning,
    CommissionReport,
    CommissionStep,
    StepLine,
    StepRecord,
    StepState,
    fingerprint_of,
    load_record,
    next_step,
    save_record,
    states_of,
)
from app.commissioning.check_report import CheckState, Finding
from app.rig.rig_file import load_rig
from app.settings.defaults import BOARD, SIMULATED


def run_commission(
    name: str,
    person: Commissioner,
    progress: Progress,
    *,
    start: CommissionStep | None = None,
    status: bool = False,
    game: bool = False,
) -> CommissionReport:
    """Go on with the commissioning of a rig file from where it stands, until a step fails, or a person says no.

    Args:
        name: of the rig file.
        person: who is asked.
        progress: told what is done.
        start: this step and all after it are done again, if those before it hold.
        status: only say where it stands.
        game: the last step is done as well, which wants the pieces set up.

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
        if first is not None and list(CommissionStep).index(first) < list(CommissionStep).index(start):
            raise UserError(f"step {start} is refused: step {first} comes before it, and is {states[first].value}")
        done = done.without(start)
    return _go_on(site, path, done, game)


def _site(name: str, person: Commissioner, progress: Progress) -> CommissionSite:
    rig = load_rig(Path(name))
    return CommissionSite(name, rig, rig.robot(), person, progress)


def _go_on(site: CommissionSite, path: Path, done: Commissioning, game: bool) -> CommissionReport:
    findings: tuple[Finding, ...] = ()
    while True:
        site = _site(site.name, site.person, site.progress)  # a step may have named another parameters file
        states = states_of(done, site.rig, site.parameters)
        step = next_step(states)
        if step is None or (step is CommissionStep.GAME and not game):
            return _report(site.name, done, states, findings)
        number = list(CommissionStep).index(step) + 1
        site.progress(f"step {number} of {len(CommissionStep)}, {step}: {WHAT[step]}")
        if not site.person.goes_on():
            return _report(site.name, done, states, findings)
        require_free(site)
        findings = tuple(RUNS[step](site))
        holds = all(one.state is not CheckState.WRONG for one in findings)
        mark = fingerprint_of(step, site.rig, site.parameters)
        record = StepRecord(step=step, holds=holds, when=datetime.now(UTC), fingerprint=mark, findings=findings)
        done = done.with_step(record)
        save_record(path, done)
        if not holds:
            return _report(site.name, done, states_of(done, site.rig, site.parameters), findings)


def _report(
    name: str, done: Commissioning, states: dict[CommissionStep, StepState], findings: tuple[Finding, ...]
) -> CommissionReport:
    lines = []
    for step, state in states.items():
        record = done.of(step)
        lines.append(StepLine(step=step, state=state, when=None if record is None else record.when))
    waiting = next_step(states)
    if waiting is None:
        sentence = "every step held"
    elif states[waiting] is StepState.FAILED:
        sentence = f"step {waiting} failed: fix what it says, then run 'touchmove commission --rig {name}' again"
    elif waiting is CommissionStep.GAME:
        sentence = f"set up the pieces for {GAME_PLIES} plies, and run 'touchmove commission --rig {name} --game'"
    else:
        sentence = f"next is step {waiting}: 'touchmove commission --rig {name}'"
    return CommissionReport(
        rig=name, holds=StepState.FAILED not in states.values(), steps=tuple(lines), findings=findings, next=sentence
    )
