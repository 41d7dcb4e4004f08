"""Games on a rig from end to end: devices, telemetry, film, the games, and the report of however each ended."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from pydantic import JsonValue

from app.execution.state import LEFT
from app.game import EXPECTED_FAILURES, Devices, GameEnd
from app.records import GameRecord, RecordError, Report
from app.records.files import TRAJECTORY_FILE, NotWritten
from app.records.rounds import rounds_of
from app.records.telemetry import TELEMETRY_FILE, TelemetryRecorder
from app.rig.devices import EndState, Rig, RigFailed
from app.rig.shown_arm import ShownArm
from app.terminal.game_display import UserInterface
from controller.protocol.messages import Telemetry
from controller.wire.errors import ControllerError
from controller.wire.link import Listener
from engine.errors import EngineProblem
from hardware.interfaces import Camera, HardwareError, RigGone
from hardware.loading import end_loading

if TYPE_CHECKING:
    from app.guard.game_guard import GameGuard, Guarding

FAILED = GameEnd("*", "failed", complete=False)
_SOCKETS_FIRST: Final = 2.0
"""A process that is killed has closed its sockets this long before it has ended, at most [s, wall]."""


@dataclass(frozen=True, slots=True)
class Filming:
    """The film of a simulated world, drawn when all is over.

    Attributes:
        folder: of the session: positions are recorded there while it is played.
        longest: of the film [s]; None: it is left to whoever wants one.
    """

    folder: Path
    longest: float | None


@dataclass(frozen=True, slots=True)
class SessionVision:
    """What sees for a session.

    Attributes:
        camera: makes of the rig's camera the one that the games look through.
        guarding: against hands; None: nobody watches.
    """

    camera: Callable[[Camera], Camera] = lambda camera: camera
    guarding: Guarding | None = None


@dataclass(frozen=True, slots=True)
class Round:
    """One game, or one setting up, on an open rig.

    Attributes:
        record: of it; ended by the session.
        play: plays it.
        details: for its report, asked for at its end.
    """

    record: GameRecord
    play: Callable[[], GameEnd]
    details: Callable[[], dict[str, JsonValue]]


class Schedule(Protocol):
    """What is played on a rig, one round after the other."""

    def next(self, devices: Devices, last: GameEnd | None) -> Round | None:
        """The next round.

        Args:
            devices: of the rig.
            last: how the round before ended; None: there was none.

        Returns:
            None when nothing more is to be played.
        """


class Interrupted(KeyboardInterrupt):
    """What was played in a folder was broken off on purpose, and may be gone on with."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.folder = folder


@dataclass(frozen=True, slots=True)
class SessionResult:
    """The report, where it lies, whether everything held, and whether another program could go on with the game."""

    report: Report
    folder: Path
    holds: bool
    resumable: bool
    before: tuple[SessionResult, ...] = ()
    """Of the rounds before the last one."""


@dataclass(slots=True)
class _RoundProgress:
    """How a round went so far, whatever ends it."""

    round: Round
    end: GameEnd = FAILED
    failures: list[str] = field(default_factory=list)
    interrupted: bool = False
    plant_time: float = 0.0
    speed: float | None = None
    world_state: str | None = None

    @property
    def until(self) -> float:
        """Plant time of its end [s]; one that broke off lasted to its last event."""
        return self.plant_time or self.round.record.events[-1].plant_time


def run_session(
    folder: Path,
    open_rig: Callable[[Listener], Rig],
    schedule: Schedule,
    tick: float,
    filming: Filming | None,
    ui: UserInterface,
    vision: SessionVision = SessionVision(),
) -> SessionResult:
    """Play what is to be played on a rig.

    Args:
        folder: of the session; the telemetry lies there.
        open_rig: given a listener of the telemetry.
        schedule: says what is played.
        tick: length of a tick [s].
        filming: None: no film.
        ui: shown what happens.
        vision: what sees.

    Raises:
        UserError: the rig did not start, or a record cannot be written.
        Interrupted: it was, by Ctrl-C; the record says so, and the arm is at rest.
    """
    telemetry = TelemetryRecorder(_free(folder, TELEMETRY_FILE), tick)
    done: list[SessionResult] = []
    guarding = vision.guarding

    def listen(told: Telemetry) -> None:
        telemetry.take(told)
        if guarding is not None:
            guarding.take(told)

    with telemetry, open_rig(listen) as rig:
        end_loading()
        try:
            with _recording_positions(filming, rig), ExitStack() as stack:
                guard = None if guarding is None else guarding.open(rig)
                if guard is not None:
                    stack.enter_context(guard)
                so_far = _play_all(rig, _devices(rig, vision, guard, ui), schedule, done, ui)
        except (ControllerError, HardwareError) as error:  # between two rounds
            raise RigFailed(rig.failure() or str(error)) from error
        except NotWritten as error:
            if not rounds_of(folder):
                raise
            more = f"what was played is safe: once there is room, 'touchmove resume {folder}' continues it"
            raise RecordError(f"{error.trouble}: {more}") from error
        ui.phase("the arm is coming to rest")
        last = rig.close()
        _note_the_end(so_far, rig, last)
    result = _result(so_far, rested=last is not None)
    if so_far.interrupted:
        raise Interrupted(folder)
    if filming is not None and filming.longest is not None and not so_far.failures:
        _draw(filming, ui)
    holds = result.holds and all(one.holds for one in done)
    return SessionResult(result.report, result.folder, holds, result.resumable, tuple(done))


def _note_the_end(so_far: _RoundProgress, rig: Rig, last: EndState | None) -> None:
    """How the arm was left; where a process has ended, that is the cause, and is said once."""
    cause = rig.failure()
    if cause is not None and not so_far.failures:
        so_far.failures.append(cause)
    elif cause is None and (last is None or not last.at_rest):
        so_far.failures.append("the arm did not come to rest")


def _devices(rig: Rig, vision: SessionVision, guard: GameGuard | None, ui: UserInterface) -> Devices:
    camera = None if rig.camera is None else vision.camera(rig.camera)
    return Devices(ShownArm(rig.arm, ui.path), rig.clock, camera, rig.referee, guard)


def _play_all(
    rig: Rig, devices: Devices, schedule: Schedule, done: list[SessionResult], ui: UserInterface
) -> _RoundProgress:
    """Round after round; the results of all but the last, whose report waits for the arm's rest, go to ``done``."""
    first = schedule.next(devices, None)
    assert first is not None, "a schedule has at least one round"
    so_far = _RoundProgress(first)
    while True:
        _play(rig, so_far, ui)
        if so_far.failures or so_far.interrupted or not so_far.end.complete:
            return so_far
        # what was decided is kept, whatever becomes of this program while it asks or looks what is next
        so_far.round.record.decide(so_far.end.result, so_far.end.reason, so_far.until)
        following = _following(schedule, devices, so_far)
        if following is None:
            return so_far
        done.append(_result(so_far, rested=True))
        so_far = _RoundProgress(following)


def _following(schedule: Schedule, devices: Devices, so_far: _RoundProgress) -> Round | None:
    """The round after one that was played; that one is ended in any case."""
    try:
        return schedule.next(devices, so_far.end)
    except BaseException:
        _result(so_far, rested=True)
        raise


def _play(rig: Rig, so_far: _RoundProgress, ui: UserInterface) -> None:
    try:
        so_far.end = so_far.round.play()
        ui.result(so_far.end.result, so_far.end.reason)
        _take_stock(rig, so_far)
    except KeyboardInterrupt:
        so_far.end, so_far.interrupted = GameEnd("*", "interrupted", complete=False), True
    except RecordError:
        raise
    except (*EXPECTED_FAILURES, EngineProblem) as error:
        so_far.failures.append(_cause(rig, error))


def _cause(rig: Rig, error: Exception) -> str:
    """What to say of a failure: which process has ended, if one has; sockets close a moment before it has."""
    deadline = time.monotonic() + (_SOCKETS_FIRST if isinstance(error, RigGone) else 0.0)
    while (cause := rig.failure()) is None and time.monotonic() < deadline:
        time.sleep(0.01)
    return cause or str(error)


def _result(so_far: _RoundProgress, *, rested: bool) -> SessionResult:
    """End the record of a round."""
    record = so_far.round.record
    report = record.end(
        so_far.end.result, so_far.end.reason, so_far.until, failures=so_far.failures, speed=so_far.speed,
        world_state=so_far.world_state, details=so_far.round.details(),
    )  # fmt: skip
    holds = so_far.end.complete and not so_far.failures and report.physical_ok is not False
    # not where the board came out wrong, which wants a hand first, nor where nobody knows how the arm was left
    resumable = (so_far.end is FAILED or so_far.end is LEFT) and rested
    return SessionResult(report, record.folder, holds, resumable)


def _take_stock(rig: Rig, so_far: _RoundProgress) -> None:
    """The last state of a world; once plant time stands, so that a repeated run ends in the same tick."""
    rig.arm.state()
    so_far.plant_time = rig.clock.now()
    if rig.referee is not None:
        truth, run = rig.referee.look()
        so_far.speed, so_far.world_state = run.ratio, truth.state_sha256


@contextmanager
def _recording_positions(filming: Filming | None, rig: Rig) -> Iterator[None]:
    positions = None if filming is None else rig.record_positions(filming.folder / TRAJECTORY_FILE)
    try:
        yield
    finally:
        if positions is not None:
            positions.finish()


def _draw(filming: Filming, ui: UserInterface) -> None:
    """The film of what was played. All else is done: Ctrl-C leaves the film out, as does what goes wrong with it."""
    if not (filming.folder / TRAJECTORY_FILE).exists():
        return
    from app.rig.simulation.film import (  # only where something is filmed
        FilmFailed,
        FilmWish,
        default_output,
        draw_film,
    )

    wish = FilmWish(
        positions=filming.folder / TRAJECTORY_FILE,
        output=default_output(filming.folder, "film"),
        length=filming.longest,
    )
    again = f"'touchmove film {filming.folder}' draws it at any time"
    ui.phase("drawing the film; Ctrl-C postpones it")
    try:
        draw_film(wish, lambda done, whole: ui.phase(f"drawing the film: {done:.0f} of {whole:.0f} s"))
    except KeyboardInterrupt:
        ui.phase(f"the film was not drawn: {again}")
    except (FilmFailed, RecordError) as error:
        ui.phase(f"there is no film: {error}; {again}")
    else:
        ui.phase("the film is drawn")


def _free(folder: Path, name: str) -> Path:
    """A file of that name, or with a number where a game before took it."""
    path, number = folder / name, 1
    while path.exists():
        number += 1
        path = folder / f"{Path(name).stem}-{number}{Path(name).suffix}"
    return path
