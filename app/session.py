"""A game on a rig from end to end: devices, telemetry, film, the game itself, and the report of however it ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import JsonValue

from app.devices import Rig
from app.faces import Face
from app.game import EXPECTED_FAILURES, Devices, Game, GameEnd
from app.records import GameRecord, RecordError, Report
from app.records.telemetry import TELEMETRY_FILE, TelemetryRecorder
from app.video import Film
from controller.link import Listener
from engine.errors import EngineProblem
from hardware.sim.settings import Pace

FAILED = GameEnd("*", "failed", complete=False)


@dataclass(frozen=True, slots=True)
class Filming:
    """The film of a simulated world: run directory of the world, the file, its longest duration [s], pace."""

    run_dir: Path
    path: Path
    longest: float
    pace: Pace


@dataclass(frozen=True, slots=True)
class SessionResult:
    """The report, where it lies, whether everything held, and whether another program could go on with the game."""

    report: Report
    folder: Path
    holds: bool
    resumable: bool


@dataclass(slots=True)
class _Course:
    """How a game went so far, whatever ends it."""

    end: GameEnd = FAILED
    failures: list[str] = field(default_factory=list)
    interrupted: bool = False
    plant_time: float = 0.0
    speed: float | None = None
    world_state: str | None = None


def run_session(
    open_rig: Callable[[Listener], Rig],
    make_game: Callable[[Devices], Game],
    plies: int,
    record: GameRecord,
    tick: float,
    filming: Filming | None,
    face: Face,
) -> SessionResult:
    """Play a game on a rig.

    Args:
        open_rig: given a listener of the telemetry.
        make_game: on the devices of that rig.
        plies: the game ends after so many.
        record: of the game; ended here.
        tick: length of a tick [s].
        filming: None: no film.
        face: shown what happens.

    Raises:
        UserError: the rig did not start, or the record cannot be written.
        KeyboardInterrupt: it was interrupted; the record says so, and the arm is at rest.
    """
    course = _Course()
    telemetry = TelemetryRecorder(_free(record.folder, TELEMETRY_FILE), tick)
    with telemetry, open_rig(telemetry.take) as rig:
        game = make_game(Devices(rig.arm, rig.clock, rig.camera, rig.referee))
        try:
            with _filming(filming, tick):
                course.end = game.play(plies)
            _take_stock(rig, course)
        except KeyboardInterrupt:
            course.end, course.interrupted = GameEnd("*", "interrupted", complete=False), True
        except RecordError:
            raise
        except (*EXPECTED_FAILURES, EngineProblem) as error:
            course.failures.append(rig.failure() or str(error))
        face.phase("the arm goes to rest")
        last = rig.close()
    if last is None or not last.at_rest:
        course.failures.append("the arm did not come to rest")
    details: dict[str, JsonValue] = {"thinking_s": round(game.thinking, 3)}
    until = course.plant_time or record.events[-1].plant_time  # a game that broke off lasted to its last event
    report = record.end(
        course.end.result, course.end.reason, until, failures=course.failures, speed=course.speed,
        world_state=course.world_state, details=details,
    )  # fmt: skip
    if course.interrupted:
        raise KeyboardInterrupt
    holds = course.end.complete and not course.failures and report.physical_ok is not False
    # not where the board came out wrong, which wants a hand first, nor where nobody knows how the arm was left
    resumable = course.end is FAILED and last is not None
    return SessionResult(report, record.folder, holds, resumable)


def _take_stock(rig: Rig, course: _Course) -> None:
    """The last state of a world; once plant time stands, so that a repeated run ends in the same tick."""
    rig.arm.state()
    course.plant_time = rig.clock.now()
    if rig.referee is not None:
        truth, run = rig.referee.look()
        course.speed, course.world_state = run.ratio, truth.state_sha256


@contextmanager
def _filming(filming: Filming | None, tick: float) -> Iterator[None]:
    if filming is None:
        yield
        return
    film = Film(filming.run_dir, filming.path, filming.longest, filming.pace, tick)
    try:
        yield
    finally:
        film.finish()


def _free(folder: Path, name: str) -> Path:
    """A file of that name, or with a number where a game before took it."""
    path, number = folder / name, 1
    while path.exists():
        number += 1
        path = folder / f"{Path(name).stem}-{number}{Path(name).suffix}"
    return path
