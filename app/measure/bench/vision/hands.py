"""Rows of bench ``vision`` about hands: how soon the arm rests when one comes, and how often it stops for nothing.

Hands come at random moments of the arm's motion, to random points, at random speeds, over a board that the guard has
seen settled, as before any motion of a game. When a hand crosses the board's edge is the referee's word, when the arm
rests the controller's. The arm moves by the profile ``separation``, watched as in a game. Where a hand touches it the
tool must be no faster than the default profile lets it be; where nobody is, the arm must not be slowed down.
"""

from __future__ import annotations

import math
import random
import threading
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from typing import Final

import chess
import numpy as np

from app import UserError
from app.measure.bench.loop import WAY, sweep_motion
from app.measure.bench.report import Progress, Row, row
from app.measure.bench.vision.hand_scene import Follower, HandScene, hand_scene, until
from app.motion import Motion, Plan, Planner
from app.pieces.manipulation import transfers
from app.rig.arm import ArmGaveWay, ArmHeld
from controller.protocol.causes import Cause
from controller.protocol.states import State
from controller.wire.errors import MotionRefused, MotionStopped
from hardware.contact_speeds import CONTACT_PROFILES
from hardware.interfaces import HardwareError
from hardware.piece_set import Colour
from hardware.sim.clients.hand import SimHand
from hardware.sim.hand.actions import HandSettings, Hover, Withdraw
from vision.hands.hand_and_motion import Watch

SEED: Final = 11
ENTRIES: Final = {True: 3, False: 200}
"""By ``quick``."""
PLIES: Final = {True: 1, False: 500}
REST_LIMIT: Final = 0.3
"""From the hand's crossing of the board's edge until the arm rests, plant time [s]."""
FORCE_LIMIT: Final = 280.0
"""On a hand that comes into the arm's way and is free to give way, ISO/TS 15066: twice what a clamped one bears [N]."""
CONTROLLED_STOP: Final = 0.12
"""A controlled stop takes no longer [s]; an arm that a hand reaches meanwhile gives way and rests later."""
TOUCH: Final = 0.5  # a hand that feels more is touched [N]
FALSE_STOPS_LIMIT: Final = 1.0  # in 500 plies
A_WORLD: Final = 20  # so many entries, or plies, are made in one world
HAND_SPEEDS: Final = (0.4, 1.6)  # [m/s]
TOUCH_SPEED_LIMIT: Final = CONTACT_PROFILES["default"].tool_speed + 0.05
"""Of the tool where it touches a hand: the default profile's, and what tracking adds [m/s]."""
QUIET_LIMIT: Final = 1.1  # a quiet ply from home to home with nobody near, mean [s]
SLOWED_LIMIT: Final = 0.01  # share of frames that admit no speed though nobody is there


@dataclass(slots=True)
class HandFigures:
    """What was seen: durations in plant time [s], and counts."""

    rest: list[float] = field(default_factory=list)  # of hands that the arm did not touch, until it was at rest
    yielded: list[float] = field(default_factory=list)
    """Of hands that reached the arm before it was at rest, until it left off its motion and gave way: after that it is
    the hand that moves it."""
    force: list[float] = field(default_factory=list)  # of the robot on those hands [N]
    touch_speed: list[float] = field(default_factory=list)
    """Of the tool where a hand was touched, whoever gave way [m/s]."""
    top_speed: list[float] = field(default_factory=list)
    """Of the tool within the half second before a hand crossed the edge, the most [m/s]."""
    quiet: list[float] = field(default_factory=list)  # plies of one transfer, from home to home, with nobody near
    frames: int = 0
    unadmitted: int = 0
    missed: int = 0
    braked: int = 0
    """Hands that went on through the arm at rest, and pushed it to the end of its range: it was on its brakes then, and
    their world was left."""
    plies: int = 0
    false_stops: int = 0

    @property
    def hands(self) -> int:
        """That came while the arm moved."""
        return len(self.rest) + len(self.yielded) + self.missed


def hand_rows(quick: bool, progress: Progress) -> dict[str, Row]:
    """Measure; ``quick`` with few entries and plies.

    Raises:
        UserError: a process failed, or there is no OpenGL.
    """
    entries, plies, figures, rng = ENTRIES[quick], PLIES[quick], HandFigures(), random.Random(SEED)
    try:
        first = 0
        while figures.hands < entries:
            person = HandSettings(side=rng.choice(list(Colour)), speed=rng.uniform(*HAND_SPEEDS))
            with hand_scene(SEED + first, person) as scene:
                watch = Watch()
                with scene.guard(watch) as guard:
                    guard.clear()
                most = min(figures.hands + A_WORLD, entries)
                while figures.hands < most and not scene.braked():
                    _enter(scene, watch, rng, figures)
                    rest = f"rest after {figures.rest[-1]:.3f} s" if figures.rest else "none"
                    touched = f"{len(figures.yielded)} touched first, {figures.missed} missed"
                    progress(f"{figures.hands} of {entries} hands: {rest}, {touched}")
                figures.braked += scene.braked()
            first += A_WORLD
        world = 0
        while figures.plies < plies:  # a stop ends its world, so how many there are is not known beforehand
            with hand_scene(SEED + 1000 + world, None) as scene:
                _play(scene, min(A_WORLD, plies - figures.plies), rng, figures, progress)
            world += 1
    except HardwareError as error:
        raise UserError(str(error)) from error
    return _rows(figures)


def _rows(figures: HandFigures) -> dict[str, Row]:
    rows = {}
    if figures.rest:
        rows["hand_to_rest"] = row(figures.rest, "s", REST_LIMIT, "max")
    if figures.hands:
        rows["hand_missed"] = row([figures.missed], "hands", 0.0, "max")
        rows["hand_touched_first"] = row([len(figures.yielded)], "hands")
        rows["hand_pushed_to_brakes"] = row([figures.braked], "hands")
    if figures.yielded:
        rows["hand_to_give_way"] = row(figures.yielded, "s", REST_LIMIT, "max")
        rows["hand_force"] = row(figures.force, "N", FORCE_LIMIT, "max")
    if figures.touch_speed:
        rows["hand_touch_speed"] = row(figures.touch_speed, "m/s", TOUCH_SPEED_LIMIT, "max")
    if figures.top_speed:
        rows["speed_before_hand"] = row(figures.top_speed, "m/s")
    if figures.quiet:
        rows["quiet_ply_guarded"] = row(figures.quiet, "s", QUIET_LIMIT, "mean")
        rows["slowed_for_nothing"] = row(
            [figures.unadmitted / figures.frames], "1", SLOWED_LIMIT, "max", figures.frames
        )
    if figures.plies:
        stops = 500.0 * figures.false_stops / figures.plies
        rows["false_stops"] = row([stops], "in 500", FALSE_STOPS_LIMIT, "max", figures.plies)
    return rows


def _enter(scene: HandScene, watch: Watch, rng: random.Random, figures: HandFigures) -> None:
    """A hand comes while the arm moves, and goes again."""
    half = 3.4 * scene.table.square
    point = rng.uniform(-half, half), rng.uniform(-half, half)
    hover = Hover(at=point, height=rng.uniform(0.07, 0.14), duration=rng.uniform(0.1, 0.5))
    delay = rng.uniform(0.0, 0.5)
    watch.pause()
    guard = scene.guard(watch)
    with ExitStack() as stack:
        hand = stack.enter_context(closing(SimHand(scene.run_dir)))
        stack.callback(guard.close)
        follower = stack.enter_context(closing(Follower(scene)))
        guard.start()

        def come() -> None:
            # plant time that ran for the hand already would keep a motion from beginning
            until(lambda: scene.moving() or scene.braked(), "an arm that moves")
            if not scene.braked():
                scene.rig.clock.sleep(delay)
                hand.perform(hover, Withdraw())

        comer = threading.Thread(target=come, name="comer")
        stopped = _sweep(scene, comer)
        comer.join()
        guard.close()
        if stopped is Cause.NOT_HOLDING:  # the hand before this one had pushed it so far
            return
        _note_stop(scene, figures, follower, stopped)
        hand.wait()
        if not scene.braked():
            scene.rig.client.resume()


def _sweep(scene: HandScene, comer: threading.Thread) -> Cause:
    """Move to and fro in one motion that is longer than a hand's way; why it was stopped."""
    at, motions = scene.rig.arm.state().reference, list[Motion]()
    for target in map(np.array, 3 * WAY):
        motions.append(sweep_motion(at, target, scene.motion, scene.parameters.drive.tick))
        at = target
    try:
        scene.rig.arm.execute(Plan("sweep", tuple(motions)), lambda _: comer.start() if comer.ident is None else None)
    except ArmHeld:
        return Cause.HOLD_COMMAND
    except ArmGaveWay:
        return scene.rig.client.telemetry.cause
    except (MotionStopped, MotionRefused) as error:
        return error.cause
    return Cause.NONE


def _note_stop(scene: HandScene, figures: HandFigures, follower: Follower, stopped: Cause) -> None:
    """How long the arm moved after the hand had crossed the edge."""
    crossed = until(lambda: follower.crossings()[:1], "a hand that crosses the board's edge")[0]
    if stopped is Cause.NONE:
        # a hand that came when the motion was over, on a busy machine, counts for nothing and comes again
        figures.missed += crossed < until(scene.at_rest_since, "an arm at rest")
        return
    tick, told = scene.parameters.drive.tick, list(scene.telemetry)
    before = [math.hypot(*one.velocity) for one in told if 0.0 <= crossed - one.tick * tick < 0.5]
    figures.top_speed.append(max(before, default=0.0))
    touched = [when for when, force in list(follower.touches) if force > TOUCH]
    figures.touch_speed += [scene.tool_speed(when) for when in touched[:1]]
    rested = until(lambda: scene.ended(crossed, State.TRACK, State.STOPPING), "an arm at rest")
    left_off = until(lambda: scene.ended(crossed, State.TRACK), "an arm that leaves off")
    force = max([force for when, force in list(follower.touches) if when <= rested], default=0.0)
    if rested - left_off > CONTROLLED_STOP and force > TOUCH:
        figures.yielded.append(max(0.0, left_off - crossed))
        figures.force.append(force)
    else:
        figures.rest.append(max(0.0, rested - crossed))


def _play(scene: HandScene, plies: int, rng: random.Random, figures: HandFigures, progress: Progress) -> None:
    """Random plies without a hand, all of them watched."""
    board, inventory = chess.Board(), scene.inventory
    with scene.guard(Watch()) as guard, ExitStack() as stack:
        stack.callback(_count_frames, scene, figures)
        for _ in range(plies):
            move = rng.choice(list(board.legal_moves))
            ply = transfers(board, move, inventory)
            guard.clear()
            state = scene.rig.arm.state()
            planner = Planner.of(
                scene.motion, scene.parameters, inventory.table, state.reference, state.finger, scene.rig.arm.lead_ticks
            )
            plan = planner.ply(ply.san, ply.transfers, inventory)
            figures.plies += 1
            try:
                outcome = scene.rig.arm.execute(plan)
            except ArmHeld:
                figures.false_stops += 1
                progress(f"ply {figures.plies}, {ply.san}: stopped, {guard.stops[-1]}")
                return  # the piece is somewhere on its way: go on in another world
            if len(ply.transfers) == 1:
                figures.quiet.append(outcome.duration)
            progress(f"{figures.plies} plies without a hand, {figures.false_stops} stops")
            board.push(move)
            inventory = inventory.after(ply)


def _count_frames(scene: HandScene, figures: HandFigures) -> None:
    figures.frames += scene.separation.frames
    figures.unadmitted += scene.separation.frames - scene.separation.admitted
