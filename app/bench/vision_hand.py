"""Rows of bench ``vision`` about hands: how soon the arm rests when one comes, how often it stops for nothing, and how
soon a board is settled that a hand has left.

Processes of a real game in pace fast: world with a person, camera with its noise, controller, and the guard of
``app.hand_guard``. Light, exposure, camera noise and mount are drawn anew for each world. Hands come at random moments
of the arm's motion, to random points, at random speeds. When a hand crosses the board's edge, and when it leaves,
is the referee's word; when the arm rests, the controller's.
"""

from __future__ import annotations

import random
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Final, TypeVar

import chess
import numpy as np

from app import UserError
from app.arm import ArmHeld
from app.arm_view import ArmHistory
from app.bench.loop import straight
from app.bench.report import Row, row
from app.hand_guard import ArmMasks, HandGuard
from app.layout import start_layout
from app.manipulation import Inventory, transfers
from app.motion import Motion, MotionSettings, Plan, plan_ply
from app.sim_rig import SimRig
from app.sim_settings import SimRigSettings
from app.watch_view import nominal_view
from controller.causes import Cause
from controller.errors import MotionRefused, MotionStopped
from controller.protocol.messages import Telemetry
from controller.states import State
from hardware.interfaces import HardwareError, Intrinsics
from hardware.parameters import load_parameters
from hardware.sim.hand_actions import HandSettings, Hover, Withdraw
from hardware.sim.hand_client import SimHand
from hardware.sim.randomisation import Randomisation
from hardware.sim.referee import Referee
from hardware.sim.settings import Pace, WorldSettings
from hardware.sim.watching import SimWatchCamera
from hardware.table import Colour, TableSettings
from vision.watch import Seen

SEED: Final = 11
ENTRIES: Final = 200
QUICK_ENTRIES: Final = 3
PLIES: Final = 40
QUICK_PLIES: Final = 1
REST_LIMIT: Final = 0.4
"""From the hand's crossing of the board's edge until the arm rests, plant time [s]."""
FALSE_STOPS_LIMIT: Final = 1.0
"""In 500 plies."""
GONE_LIMIT: Final = 0.6
"""From the hand's leaving the board until that is known and the board settled, plant time [s]."""
GONE_EVERY: Final = 4
"""Only each so manieth hand is watched until it is gone: pictures take most of the bench's time."""
A_WORLD: Final = 10
"""So many entries, or plies, are made in one world."""
WAY: Final = ((0.12, 0.02, 0.335), (-0.12, -0.05, 0.345), (0.06, -0.10, 0.355), (-0.08, 0.10, 0.33))
"""The arm goes round these tool points, base frame [m]; above every piece."""
NEAR: Final = 0.16
"""The guard's camera is switched on when the hand is so near to the board's edge [m]: it then has looked at several
frames before the hand comes, and the bench draws no others."""
LOOKS: Final = Randomisation(
    light_brightness=0.3, light_colour=0.15, light_direction=0.6, exposure=0.2, white_balance=0.08, camera_noise=0.3,
    camera_shift=0.001, camera_turn=0.002,
)  # fmt: skip
"""What differs from world to world; the camera's mount by what a calibration leaves."""
TIMEOUT: Final = 240.0
"""For anything that is waited for [s, wall]."""


@dataclass(slots=True)
class Figures:
    """What was seen: durations in plant time [s], and counts."""

    rest: list[float] = field(default_factory=list)
    gone: list[float] = field(default_factory=list)
    collisions: int = 0
    missed: int = 0
    plies: int = 0
    false_stops: int = 0


def hand_rows(quick: bool, progress: Callable[[str], None]) -> dict[str, Row]:
    """Measure.

    Args:
        quick: few entries and plies.
        progress: told what is being done.

    Raises:
        UserError: a process failed, or there is no OpenGL.
    """
    return measure(QUICK_ENTRIES if quick else ENTRIES, QUICK_PLIES if quick else PLIES, progress)


def measure(entries: int, plies: int, progress: Callable[[str], None], seed: int = SEED) -> dict[str, Row]:
    """Measure with so many entries of a hand, and so many plies without one; see ``hand_rows``."""
    figures, rng = Figures(), random.Random(seed)
    try:
        for first in range(0, entries, A_WORLD):
            count = min(A_WORLD, entries - first)
            with _scene(
                seed + first, HandSettings(side=rng.choice(list(Colour)), speed=rng.uniform(0.4, 1.2))
            ) as scene:
                for number in range(first, first + count):
                    _enter(scene, rng, figures, to_the_end=number % GONE_EVERY == 0)
                    progress(f"{number + 1} of {entries} hands")
        for first in range(0, plies, A_WORLD):
            with _scene(seed + 1000 + first, None) as scene:
                _play(scene, min(A_WORLD, plies - first), rng, figures, progress)
    except HardwareError as error:
        raise UserError(str(error)) from error
    return _rows(figures)


def _rows(figures: Figures) -> dict[str, Row]:
    rows = {}
    if figures.rest:
        rows["hand_to_rest"] = row(figures.rest, "s", REST_LIMIT, "max")
        rows["hand_missed"] = row([figures.missed], "hands", 0.0, "max")
        rows["hand_touched_first"] = row([figures.collisions], "hands")
    if figures.gone:
        rows["hand_gone_to_settled"] = row(figures.gone, "s", GONE_LIMIT, "max")
    if figures.plies:
        stops = row([500.0 * figures.false_stops / figures.plies], "in 500", FALSE_STOPS_LIMIT, "max")
        rows["false_stops"] = stops.model_copy(update={"n": figures.plies})
    return rows


class _Scene:
    """A world, its controller, and what watches them."""

    def __init__(self, run_dir: Path, seed: int, person: HandSettings | None) -> None:
        self.table, self.motion, self.parameters = TableSettings(), MotionSettings(), load_parameters()
        self.inventory = Inventory.of(start_layout(chess.Board(), self.table), self.table)
        world = WorldSettings(
            pieces=tuple(self.inventory), home=self.motion.home, table=self.table, pace=Pace.FAST, seed=seed,
            hand=person, randomisation=LOOKS, linger=1.0,
        )  # fmt: skip
        self.run_dir, self.telemetry = run_dir, list[Telemetry]()
        self.history = ArmHistory(self.parameters.drive.tick)
        self.rig = SimRig(run_dir, SimRigSettings(world=world), lambda _: None, self._listen)
        self.view = nominal_view(self._intrinsics(), self.table)

    def _intrinsics(self) -> Intrinsics:
        if self.rig.camera is None:
            raise UserError("this bench needs a world with cameras: 'apt-get install libegl1 libgl1-mesa-dri'")
        return self.rig.camera.intrinsics

    def _listen(self, telemetry: Telemetry) -> None:
        self.history.take(telemetry)
        self.telemetry.append(telemetry)

    def guard(self, seen: list[tuple[float, Seen]]) -> HandGuard:
        """A guard that is not started yet; ``seen`` gets what it sees, and when, in plant time."""
        masks = ArmMasks(self.view, self.parameters, self.table, self.history)
        camera = SimWatchCamera(self.run_dir)
        return HandGuard(
            camera, self.view, masks, self.rig.client, listener=lambda _, one: seen.append((self.history.newest, one))
        )

    def rested(self, since: float) -> float | None:
        """When the arm came to rest, if it has moved after a plant time and moves no more [s]; None: it still moves."""
        told = [one for one in list(self.telemetry) if one.tick * self.parameters.drive.tick >= since]
        moving = [k for k, one in enumerate(told) if one.state in (State.TRACK, State.STOPPING)]
        if not told or (moving and moving[-1] == len(told) - 1):
            return None
        return told[moving[-1] + 1 if moving else 0].tick * self.parameters.drive.tick


@contextmanager
def _scene(seed: int, person: HandSettings | None) -> Iterator[_Scene]:
    with tempfile.TemporaryDirectory(prefix="touchmove-") as folder:
        scene = _Scene(Path(folder) / "run", seed, person)
        with scene.rig:
            yield scene


class _Follower:
    """Asks the referee again and again where the hand is, in a thread: when it comes near, crosses the edge, and goes.

    Times are between the last look before and the first one after, by a straight line.
    """

    def __init__(self, run_dir: Path, table: TableSettings, near: Callable[[], None]) -> None:
        self.looks: list[tuple[float, float]] = []
        """Plant time [s], and how far the fingertips are outside the board's edge [m]."""
        self._referee = Referee(run_dir)
        self._edge, self._near = 4.0 * table.square, near
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._follow, name="hand follower")
        self._thread.start()

    def _follow(self) -> None:
        tick, told = load_parameters().drive.tick, False
        while not self._done.is_set():
            truth, _ = self._referee.look()
            assert truth.hand is not None
            outside = max(abs(truth.hand[0]), abs(truth.hand[1])) - self._edge
            if not self.looks or truth.tick * tick > self.looks[-1][0]:
                self.looks.append((truth.tick * tick, outside))
            if outside < NEAR and not told:
                told = True
                self._near()
            time.sleep(0.0005)

    def crossings(self) -> list[float]:
        """Plant times at which the fingertips crossed the edge, first inwards, then outwards and so on [s]."""
        found = []
        for (t0, d0), (t1, d1) in pairwise(list(self.looks)):
            if (d0 > 0.0) != (d1 > 0.0):
                found.append(t0 + (t1 - t0) * d0 / (d0 - d1))
        return found

    def close(self) -> None:
        self._done.set()
        self._thread.join()
        self._referee.close()


def _enter(scene: _Scene, rng: random.Random, figures: Figures, *, to_the_end: bool) -> None:
    """A hand comes while the arm moves, and goes again; ``to_the_end``: it is watched until it is gone."""
    half = 3.4 * scene.table.square
    point = rng.uniform(-half, half), rng.uniform(-half, half)
    hover = Hover(at=point, height=rng.uniform(0.07, 0.14), duration=rng.uniform(0.1, 0.5))
    delay = rng.uniform(0.05, 0.6)
    seen = list[tuple[float, Seen]]()
    guard = scene.guard(seen)
    with ExitStack() as stack:
        hand = stack.enter_context(closing(SimHand(scene.run_dir)))
        stack.callback(guard.close)
        follower = stack.enter_context(closing(_Follower(scene.run_dir, scene.table, guard.start)))

        def come() -> None:
            scene.rig.clock.sleep(delay)
            hand.perform(hover, Withdraw())

        comer = threading.Thread(target=come, name="comer")
        stopped = _sweep(scene, comer)
        comer.join()
        _note_stop(scene, figures, follower, stopped)
        if to_the_end:
            _note_gone(figures, follower, guard, seen)
        guard.close()
        hand.wait()
        scene.rig.client.resume()


def _sweep(scene: _Scene, comer: threading.Thread) -> Cause:
    """Move to and fro in one motion that is longer than a hand's way; why it was stopped."""
    arm = scene.rig.arm
    state = arm.state()
    plan = _round(state.reference, scene.motion)
    try:
        arm.execute(plan, lambda _: comer.start() if comer.ident is None else None)
    except ArmHeld:
        return Cause.HOLD_COMMAND
    except (MotionStopped, MotionRefused) as error:
        return error.cause
    return Cause.NONE


def _round(start: np.ndarray[tuple[int], np.dtype[np.float64]], settings: MotionSettings) -> Plan:
    """Three times round, as one plan of straight motions."""
    motions, at = list[Motion](), start
    for target in (*WAY, *WAY, *WAY):
        motions.extend(straight(at, np.array(target), settings).motions)
        at = np.array(target)
    return Plan("sweep", tuple(motions))


def _note_stop(scene: _Scene, figures: Figures, follower: _Follower, stopped: Cause) -> None:
    """How long the arm moved after the hand had crossed the edge."""
    if stopped is Cause.NONE:
        figures.missed += 1
        return
    figures.collisions += stopped not in (Cause.HOLD_COMMAND, Cause.NOT_ADMITTED)
    crossed = _until(lambda: follower.crossings()[:1], "a hand that crosses the board's edge")[0]
    rested = _until(lambda: scene.rested(crossed), "an arm at rest")
    figures.rest.append(max(0.0, rested - crossed))


def _note_gone(figures: Figures, follower: _Follower, guard: HandGuard, seen: list[tuple[float, Seen]]) -> None:
    """How long after the hand had left the board the guard knew of a settled board."""
    guard.clear()
    left = follower.crossings()
    if len(left) >= 2:
        known = [when for when, one in list(seen) if one.settled and one.stamp > left[-1]]
        figures.gone.append(known[0] - left[-1])


_T = TypeVar("_T")


def _until(ask: Callable[[], _T | None], what: str) -> _T:
    deadline = time.monotonic() + TIMEOUT
    while time.monotonic() < deadline:
        if answer := ask():
            return answer
        time.sleep(0.01)
    raise UserError(f"the bench was cut short: {what} did not come within {TIMEOUT:g} s")


def _play(scene: _Scene, plies: int, rng: random.Random, figures: Figures, progress: Callable[[str], None]) -> None:
    """Random plies without a hand, all of them watched."""
    board, inventory = chess.Board(), scene.inventory
    with scene.guard([]) as guard:
        for _ in range(plies):
            move = rng.choice(list(board.legal_moves))
            ply = transfers(board, move, inventory)
            guard.clear()
            state = scene.rig.arm.state()
            plan = plan_ply(
                ply.san, ply.transfers, inventory, state.reference, state.finger, scene.motion, scene.parameters,
                scene.rig.arm.lead_ticks,
            )  # fmt: skip
            figures.plies += 1
            try:
                scene.rig.arm.execute(plan)
            except ArmHeld:
                figures.false_stops += len(guard.stops)
                return  # the piece is somewhere on its way: go on in another world
            progress(f"{figures.plies} plies without a hand, {figures.false_stops} stops")
            board.push(move)
            inventory = inventory.after(ply)
