"""Commands about a rig's devices: its controller, its world, its camera and its link."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

import app.cli.options as options  # noqa: PLR0402 - the package itself imports this module
from app.cli.ending import ask, fail, run_process, say, show_report

if TYPE_CHECKING:
    from app.commissioning.bring_up.steps import CommissionReport

_Rig = Annotated[str, typer.Option(help="sim, which this command starts, or the TOML file of a lab's rig.")]


def controller(
    action: Annotated[
        str,
        typer.Argument(help="run, status, press-stop, enable, hold, resume, stop, release, clear-fault or shutdown."),
    ] = "run",
    rig: Annotated[str, typer.Option(help="sim, or the TOML file of a lab's rig.")] = "sim",
    run_dir: Annotated[Path | None, typer.Option("--run-dir", hidden=True)] = None,
    ahead: Annotated[bool, typer.Option("--ahead", hidden=True)] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the telemetry as JSON.")] = False,
) -> None:
    """Run a rig's controller until Ctrl-C, show the status of a running one, or send it a command."""
    from app.rig.simulation.processes import run_controller, run_controller_of_rig

    if run_dir is not None:
        run_process(lambda: run_controller(run_dir, ahead=ahead))
    if action == "run":
        run_process(lambda: run_controller_of_rig(rig, say))
    _operate(action, rig, as_json)


def _operate(action: str, rig: str, as_json: bool) -> NoReturn:
    import json

    from rich.console import Console

    from app import UserError
    from app.commissioning.operate import operate, status_json, status_table

    try:
        telemetry = operate(action, rig)
    except UserError as error:
        fail(str(error))
    if as_json:
        print(json.dumps(status_json(telemetry), indent=2))
    else:
        Console().print(status_table(telemetry))
    raise typer.Exit(0)


def world(
    view: Annotated[bool, typer.Option("--view", help="Show the world of a running game in MuJoCo's viewer.")] = False,
    game: Annotated[Path | None, typer.Argument(help="Folder of the game; if left out, the newest one.")] = None,
    run_dir: Annotated[Path | None, typer.Option("--run-dir", hidden=True)] = None,
    controlled: Annotated[bool, typer.Option("--controlled", hidden=True)] = False,
    ahead: Annotated[bool, typer.Option("--ahead", hidden=True)] = False,
    drawn: Annotated[bool, typer.Option("--drawn", hidden=True)] = False,
) -> None:
    """Look at a running simulated world; games start their own."""
    from app.rig.simulation.processes import run_simulation, run_world, view_world

    if view:
        run_process(lambda: view_world(game, say))
    if run_dir is None:
        fail("games start their own worlds: use 'touchmove world --view' to look at a running one")
    run = run_simulation if controlled else run_world
    run_process(lambda: run(run_dir, ahead=ahead, drawn=drawn))


def check(
    rig: _Rig = "sim",
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
) -> None:
    """Test each device of a rig by itself, say what is wrong and how to fix it; the arm stays on its brakes."""
    from app.commissioning.check_rig import check_rig

    show_report(lambda: check_rig(rig, say), as_json)


def calibrate(
    rig: _Rig = "sim",
    out: Annotated[
        Path | None,
        options.output("File to write; if left out, the rig file's, or games/calibration.json."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the calibration as JSON.")] = False,
) -> None:
    """Find the camera's pose: the arm moves over the board and shows its marker. Keep hands away."""
    from app.commissioning.calibrate import run_calibrate

    show_report(lambda: run_calibrate(rig, out, say), as_json)


def identify(
    rig: _Rig = "sim",
    out: Annotated[
        Path | None,
        options.output("Parameters file to write; if left out, identified.toml beside the rig file or in games/."),
    ] = None,
    pole_pairs: Annotated[
        int,
        typer.Option(
            min=0, max=64, help="Pole pairs of the servomotors, to identify their ripple; 0: do not identify it."
        ),
    ] = 5,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was found as JSON.")] = False,
) -> None:
    """Find the robot's masses and friction: the arm swings over the board for 24 s. Keep hands away."""
    from app.commissioning.identification.survey import Meter
    from app.commissioning.identify import IdentifyReport, run_identify
    from app.terminal.progress_bar import progress_bar

    def find() -> IdentifyReport:
        with progress_bar("swinging", "{task.completed:.0f} s", stays=False) as tell:
            return run_identify(rig, out, pole_pairs, say, Meter(tell))

    show_report(find, as_json)


def commission(
    rig: Annotated[str, typer.Option(help="TOML file of the arm's rig.")],
    status: Annotated[bool, typer.Option("--status", help="Only show which steps are done.")] = False,
    start: Annotated[str | None, typer.Option("--from", help="Repeat this step and all after it.")] = None,
    game: Annotated[bool, typer.Option("--game", help="Also play the first game; set up the pieces for it.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Answer every question with yes.")] = False,
    answers: Annotated[
        Path | None, typer.Option(help="TOML file with answers: measured_tool [mm], pole_pairs.")
    ] = None,
    measured_tool: Annotated[
        str | None,
        typer.Option(
            help="Measured position of the tool, x,y,height from the board's centre [mm]; if left out, you are asked."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the steps and the last findings as JSON.")] = False,
) -> None:
    """Bring an arm up, step by step, from the first switch-on to its first game. Keep hands away."""
    from app.commissioning.bring_up.steps import CommissionStep

    if start is not None and start not in list(CommissionStep):
        fail(f"'--from {start}' is not a step, choose from: {', '.join(CommissionStep)}")
    from app.commissioning.bring_up.commission import run_commission  # takes seconds to load
    from app.commissioning.bring_up.person import Commissioner, GivenAnswers, load_answers, parse_triple

    def bring_up() -> CommissionReport:
        given = GivenAnswers() if answers is None else load_answers(answers)
        if measured_tool is not None:
            point = parse_triple(measured_tool)
            if point is None:
                fail(f"'--measured-tool {measured_tool}' is not a point: give x,y,height [mm], such as 0,-75,145")
            given = given.model_copy(update={"measured_tool": point})
        person = Commissioner(given, None if yes else ask)
        first = None if start is None else CommissionStep(start)
        return run_commission(rig, person, say, start=first, status=status, game=game)

    show_report(bring_up, as_json)


def link_test(
    rig: _Rig = "sim",
    duration: Annotated[float, typer.Option(min=2.0, max=86400.0, help="How long to measure [s].")] = 10.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the checks as JSON.")] = False,
) -> None:
    """Test whether this PC and network are good enough for the controller, and say what to change."""
    from app.commissioning.link_test import link_test as run_link_test

    show_report(lambda: run_link_test(rig, duration, say), as_json)
