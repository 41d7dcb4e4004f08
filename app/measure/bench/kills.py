"""Bench ``kills``: game program, controller or all at once killed while the arm moves, and the game resumed.

Nothing is spared: ``kill -9`` of a real process in the middle of a real game, from outside. Then ``touchmove resume``,
as a person would type it, has to find out what was done of the ply and finish it.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Final

import chess

from app import UserError
from app.campaign.tasks.kills import LATEST, await_motion, heard
from app.measure.bench.report import BenchReport, Progress, Row, Tally, row
from app.rig.arm import FELT
from app.rig.remote import RESTING
from app.rig.simulation.processes import last_words
from controller.protection.limits import default_limits
from controller.protocol.key import KeyFileError
from controller.protocol.messages import Telemetry
from controller.protocol.states import BRAKED, State
from controller.settings import CONTROLLER_FILE
from controller.wire.address import find_controller
from controller.wire.errors import ControllerError
from controller.wire.listener import TelemetryWatch
from hardware.interfaces import HardwareError
from hardware.parameters import load_parameters
from hardware.sim.clients.referee import SimReferee
from hardware.sim.clients.wire import world_pid
from hardware.table import TableSettings

SEED: Final = 1
KILLS: Final = {True: 3, False: 50}  # of each victim, by ``quick``
VICTIMS: Final = ("app", "controller")
EVERYTHING: Final = "everything"
"""Program, controller and world at once, as when a computer loses its power …"""
ONE_OF: Final = 5  # … once for so many kills of the program alone, at least once
PLIES: Final = 8  # of one game, the last of them in peace; as many games as the kills need
REST_LIMIT: Final = 0.3  # from the kill until the arm rests [s, plant]
JUMP_LIMIT: Final = 1.0  # of the tool while a new controller takes the arm over, sagging from the brakes included [mm]
JOINTS_RESTING: Final = 0.02  # an arm whose joints are all slower than this rests [rad/s]
BRAKED_AFTER: Final = 200
"""So long after the controller's death an arm that rests does so on its brakes [ticks]; the watchdog waits for 50."""
STANDS: Final = 0.05  # plant time that has not gone on for so long stands: all rests, on the brakes [s, wall]
OPENED: Final = 0.0005  # fingers that have opened so far were letting go on purpose [m]
TIMEOUT: Final = 180.0  # for anything that is waited for [s, wall]
_GLANCE = 0.0005


def kills_bench(quick: bool, progress: Progress) -> BenchReport:
    """Measure in pace fast; ``quick``: 3 kills of each and 1 of all, instead of 50 and 10; see ``measure_kills``."""
    return measure_kills(KILLS[quick], "fast", progress)


def measure_kills(number: int, pace: str, progress: Progress) -> BenchReport:
    """Measure with so many kills of program and controller each, and a fifth as many of all at once.

    Raises:
        UserError: a game did not start, or failed.
    """
    rng, figures = random.Random(SEED), Tally(list)
    victims = [victim for _ in range(number) for victim in VICTIMS] + [EVERYTHING] * max(1, number // ONE_OF)
    total = len(victims)
    rng.shuffle(victims)
    with tempfile.TemporaryDirectory(prefix="touchmove-") as folder:
        for game_number in itertools.count(1):
            with _KilledGame(Path(folder) / f"game-{game_number}", _line(rng), pace, figures) as game:
                try:
                    game.play(victims, rng, lambda left: progress(f"{total - left} of {total} kills"))
                except HardwareError as error:
                    raise UserError(f"{error}; last words: {game.last_words()}") from error
            if not victims:
                break
    return BenchReport.of("kills", SEED, _rows(figures), pace)


def _rows(figures: Tally) -> dict[str, Row]:
    """Durations until rest are of the plant, those until a game is resumed of the wall; the others should not be."""
    return {
        **{name: row(figures[name], "s", REST_LIMIT, "max") for name in ("app_rest", "controller_rest")},
        "jump": row(figures["jump"], "mm", JUMP_LIMIT, "max"),
        **{name: row(figures[name], "", 0.0, "max") for name in ("dropped", "outside", "wrong", "misrecorded")},
        "resumed": row(figures["resumed"], "s"),
    }


def _line(rng: random.Random) -> list[str]:
    """A random legal line, which takes whatever it can: captures are the longest plies."""
    board = chess.Board()
    while len(board.move_stack) < PLIES:
        legal = [move for move in board.legal_moves if not _ends(board, move)]
        board.push(rng.choice([move for move in legal if board.is_capture(move)] or legal))
    return [board.uci(move) for move in board.move_stack]


def _ends(board: chess.Board, move: chess.Move) -> bool:
    board.push(move)
    over = board.is_game_over()
    board.pop()
    return over


class _KilledGame:
    """One game with its victims; a context manager that leaves nothing running."""

    _app: subprocess.Popen[bytes]

    def __init__(self, folder: Path, line: list[str], pace: str, figures: Tally) -> None:
        self._folder, self._run_dir, self._log = folder, folder / "run", folder.parent / "app.log"
        self._figures, self._line, self._pace = figures, line, pace
        parameters = load_parameters()
        self._tick, self._limits = parameters.drive.tick, default_limits(parameters, TableSettings())

    def __enter__(self) -> _KilledGame:
        self._run(
            "demo", "--out", str(self._folder), "--pace", self._pace, "--processes", "separate",
            "--moves", " ".join(self._line), "--no-cameras", "--no-page",
            "--linger", "60",
        )  # fmt: skip
        return self

    def __exit__(self, *_: object) -> None:
        if self._app.poll() is None:
            self._app.send_signal(signal.SIGINT)
            self._app.wait(TIMEOUT)

    def play(self, victims: list[str], rng: random.Random, progress: Callable[[int], None]) -> None:
        """Play the game to its end; while it lasts, victims are taken off the list and killed."""
        while victims:
            moved = rng.uniform(0.0, LATEST)
            with self._watching() as seen:
                if seen is None or not self._await_motion(seen, moved):
                    break
                progress(len(victims))
                rested = self._kill(victims.pop(), seen)
            since = time.monotonic()
            self._run("resume", str(self._folder), "--no-page")
            if rested is not None:
                self._watch_taking_over(rested)
            self._await(lambda: self._step_count() > 0, "a resumed game")
            self._figures["resumed"].append(time.monotonic() - since)
        status = self._app.wait(TIMEOUT)
        self._figures["wrong"].append(float(status != 0))
        if status != 0:
            raise UserError(f"a resumed game failed: {self.last_words()}")
        self._figures["misrecorded"].append(float(self._plies() != self._line))

    def _run(self, *arguments: str) -> None:
        self._begun = self._steps_in_record()
        with self._log.open("ab") as log:
            self._app = subprocess.Popen(
                [sys.executable, "-P", "-m", "app.cli", *arguments],
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True,
            )  # fmt: skip

    def _steps_in_record(self) -> int:
        events = self._folder / "events.jsonl"
        return events.read_text(encoding="utf-8").count("\n") if events.exists() else 0

    def _plies(self) -> list[str]:
        """The moves in the record, none of which may be lost or doubled."""
        lines = (self._folder / "events.jsonl").read_text(encoding="utf-8").splitlines()
        events = [json.loads(line) for line in lines if '"event":"ply"' in line and line.endswith("}")]
        return [event["uci"] for event in events]

    def _step_count(self) -> int:
        return self._steps_in_record() - self._begun

    def last_words(self) -> str:
        """Of every process of the game."""
        logs = [self._log, *sorted(self._run_dir.glob("*.log"))]
        return "; ".join(f"{log.stem}: {last_words(log) or 'nothing'}" for log in logs)

    def _check_alive(self) -> None:
        if self._app.poll():
            raise UserError(f"a game failed: {self.last_words()}")

    def _await(self, condition: Callable[[], bool], what: str) -> None:
        deadline = time.monotonic() + TIMEOUT
        while not condition():
            self._check_alive()
            if self._app.poll() == 0:
                return  # the game was all but over
            if time.monotonic() > deadline:
                raise UserError(f"there was no {what} within {TIMEOUT:.0f} s")
            time.sleep(0.01)

    @contextmanager
    def _watching(self) -> Iterator[list[Telemetry] | None]:
        """Telemetry as it comes; None where the game is over."""
        self._await(lambda: (self._run_dir / CONTROLLER_FILE).exists() and self._step_count() > 0, "controller")
        seen: list[Telemetry] = []
        try:
            with TelemetryWatch(*find_controller(self._run_dir), listener=seen.append):
                yield seen
        except (ControllerError, KeyFileError):
            if self._app.wait(TIMEOUT) != 0:
                raise
            yield None

    def _await_motion(self, seen: list[Telemetry], moved: float) -> bool:
        """Wait until the arm has moved for so long [s, plant] and moves; false where the game is over before."""
        moves = await_motion(seen, round(moved / self._tick), lambda: self._app.poll() is None)
        return moves and len(self._plies()) < PLIES - 1  # the end of a game has to do with other processes

    def _kill(self, victim: str, seen: list[Telemetry]) -> tuple[float, float, float] | None:
        """Kill, and see how the arm comes to rest; where the tool rests if only the controller is lost."""
        with closing(SimReferee(self._run_dir)) as referee:
            if victim == "app":
                self._app.kill()
                self._app.wait()
                self._see_rest(seen)
                return None
            pid = int(json.loads((self._run_dir / CONTROLLER_FILE).read_text(encoding="utf-8"))["pid"])
            before = seen[-1].tick
            if victim == EVERYTHING:
                world = world_pid(self._run_dir)
                assert world is not None, "the referee has just spoken to it"
                for one in (world, self._app.pid, pid):
                    os.kill(one, signal.SIGKILL)
                self._app.wait()
                return None
            self._app.kill()  # first: else it would end the world, and a lab's arm does not end with its controller
            os.kill(pid, signal.SIGKILL)
            self._app.wait()
            return self._see_brakes(referee, before)

    def _see_rest(self, seen: list[Telemetry]) -> None:
        killed, deadline = seen[-1], time.monotonic() + TIMEOUT
        for now in heard(seen, len(seen), lambda: time.monotonic() < deadline):
            self._figures["outside"].append(float(self._is_outside(now)))
            if now.state is State.HOLD and math.hypot(*now.velocity) < RESTING:
                self._figures["app_rest"].append((now.tick - killed.tick) * self._tick)
                held = min(killed.tactile) >= FELT
                opened = now.finger_position > killed.finger_position + OPENED
                self._figures["dropped"].append(float(held and not opened and min(now.tactile) < FELT))
                return
        raise UserError("the arm did not come to rest after its program was killed")

    def _see_brakes(self, referee: SimReferee, before: int) -> tuple[float, float, float]:
        """Wait until the drives' own watchdog has braked the arm; where its tool rests."""
        deadline, quiet_since, stands_since, last = time.monotonic() + TIMEOUT, -1, 0.0, -1
        while (now := time.monotonic()) < deadline:
            truth, _ = referee.look()
            if truth.tick != last:
                last, stands_since = truth.tick, now
            if truth.arm_speed >= JOINTS_RESTING or truth.tick <= before:
                quiet_since = -1
            elif quiet_since < 0:
                quiet_since = truth.tick
            # the last torques act on until the watchdog brakes: an arm that rests before that may move again
            if quiet_since >= 0 and (now - stands_since > STANDS or truth.tick - before > BRAKED_AFTER):
                self._figures["controller_rest"].append((quiet_since - before) * self._tick)
                return truth.tool
            time.sleep(_GLANCE)
        raise UserError("the arm did not come to rest after its controller was killed")

    def _watch_taking_over(self, rested: tuple[float, float, float]) -> None:
        """How far the tool moves from where it rested until the first motion of a new controller."""
        worst = 0.0
        with closing(SimReferee(self._run_dir)) as referee:
            while self._step_count() < 2:  # the first of them tells that the game is resumed, the next begins to move
                truth, _ = referee.look()
                worst = max(worst, math.dist(truth.tool, rested))
                self._check_alive()
        self._figures["jump"].append(1e3 * worst)

    def _is_outside(self, telemetry: Telemetry) -> bool:
        """Whether the arm left its limits, or fell onto its brakes for no reason."""
        limits = self._limits
        apart = zip(telemetry.position, limits.centre, limits.half_size, strict=True)
        return telemetry.state in BRAKED or any(abs(p - c) > h + limits.outside for p, c, h in apart)
