"""A world with a controller, a camera that watches, and a person or none: what the benches of hands are made in.

Processes of a real game in pace fast. Light, exposure, camera noise and mount are drawn anew for each world. Where the
hand is, is the referee's word; when the arm rests, the controller's.
"""

from __future__ import annotations

import math
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Final, TypeVar

import chess
import numpy as np

from app import UserError
from app.guard.arm_silhouette import ArmHistory, ArmMasks
from app.guard.game_guard import LATENCY
from app.guard.hand_guard import HandGuard, Listener
from app.guard.separation import Separation
from app.motion import PROFILES, Profile, contact_speeds
from app.pieces.inventory import Inventory
from app.pieces.layout import start_layout
from app.rig.rig_file import WorldSection
from app.rig.simulation.nominal_view import nominal_view
from app.rig.simulation.settings import own_rig
from app.rig.simulation.sim import SimRig
from controller.protocol.messages import Telemetry
from controller.protocol.states import State
from hardware.interfaces import Pace
from hardware.parameters import load_parameters
from hardware.sim.bodies.hand import seen_from_above
from hardware.sim.clients.camera import SimCamera
from hardware.sim.clients.referee import SimReferee
from hardware.sim.clients.video_stream import SimWatchCamera
from hardware.sim.hand.actions import HandSettings
from hardware.sim.process.randomisation import Randomisation
from hardware.table import TableSettings
from vision.hands.hand_and_motion import Watch

LOOKS: Final = Randomisation(
    light_brightness=0.3, light_colour=0.15, light_direction=0.6, exposure=0.2, white_balance=0.08, camera_noise=0.3,
    camera_shift=0.001, camera_turn=0.002,
)  # fmt: skip
"""What differs from world to world; the camera's mount by what a calibration leaves."""
INTERVAL: Final = 1.0 / 30.0  # from frame to frame [s]
TIMEOUT: Final = 240.0  # for anything that is waited for [s, wall]
_EVERY: Final = 0.006  # plant time between questions to the referee [s]: each takes the world as long as several ticks
_GLANCE: Final = 0.001  # how often it is seen whether so much has passed [s, wall]
_T = TypeVar("_T")


class HandScene:
    """A world of the start position, its controller, and what watches them.

    The seed decides light, camera and how the pieces stand; ``person``: whose hand there is, None: no hand.
    """

    def __init__(self, run_dir: Path, seed: int, person: HandSettings | None) -> None:
        self.table = TableSettings(limits=contact_speeds(Profile.SEPARATION))
        self.motion, self.parameters = PROFILES[Profile.SEPARATION].at(self.table), load_parameters()
        self.inventory = Inventory.of(start_layout(chess.Board(), self.table), self.table)
        world = WorldSection(pace=Pace.FAST, seed=seed, hand=person, randomisation=LOOKS, linger=1.0)
        self.run_dir, self.telemetry = run_dir, list[Telemetry]()
        self.history = ArmHistory(self.parameters.drive.tick)
        self.rig = SimRig(own_rig(run_dir, world, table=self.table), lambda _: None, self._listen)
        if not isinstance(self.rig.camera, SimCamera):
            raise UserError("this bench needs a world with cameras: 'apt-get install libegl1 libgl1-mesa-dri'")
        self.view = nominal_view(self.rig.camera.intrinsics, self.table)

    def _listen(self, telemetry: Telemetry) -> None:
        self.history.take(telemetry)
        self.telemetry.append(telemetry)

    def guard(self, watch: Watch) -> HandGuard:
        """A guard as a game has it, that is not started yet; see ``HandGuard``."""
        feed = self.rig.guard_feed()
        assert feed is not None
        view = feed.seen_from(self.view)
        masks = ArmMasks(view, self.parameters, self.table, self.history)
        self.separation = Separation(view, feed.holder, INTERVAL, LATENCY, self.table.limits)
        return HandGuard(feed.frames(INTERVAL), view, masks, feed.holder, watch, self.separation)

    def colour_guard(self, watch: Watch, listener: Listener | None = None) -> HandGuard:
        """One whose frames have colour, too, as a lab's have, while somebody waits for a settled board."""
        masks = ArmMasks(self.view, self.parameters, self.table, self.history)
        camera = SimWatchCamera(self.run_dir, INTERVAL, colour_asleep=False)
        return HandGuard(camera, self.view, masks, self.rig.client, watch, listener=listener)

    def tool_speed(self, when: float) -> float:
        """The fastest that the tool was in the 16 ms until a plant time [m/s]."""
        tick = self.parameters.drive.tick
        speeds = [math.hypot(*one.velocity) for one in list(self.telemetry) if -0.016 < one.tick * tick - when <= 0.0]
        return max(speeds, default=0.0)

    def moving(self) -> bool:
        """Whether the arm follows a motion."""
        return bool(self.telemetry) and self.telemetry[-1].state is State.TRACK

    def braked(self) -> bool:
        """Whether the arm is on its brakes, for a person to look after."""
        return bool(self.telemetry) and self.telemetry[-1].state is State.FAULT

    def at_rest_since(self) -> float | None:
        """When the arm's last motion ended [s]; None: it moves, or has not moved yet."""
        tick, moved = self.parameters.drive.tick, False
        for one in reversed(list(self.telemetry)):
            if one.state in (State.TRACK, State.STOPPING):
                return one.tick * tick if moved else None
            moved = True
        return None

    def ended(self, since: float, *states: State) -> float | None:
        """When the arm left the last of some states that it has been in after a plant time [s]; None: it is in one."""
        tick = self.parameters.drive.tick
        told = [one for one in list(self.telemetry) if one.tick * tick >= since]
        within = [k for k, one in enumerate(told) if one.state in states]
        if not told or (within and within[-1] == len(told) - 1):
            return None
        return told[within[-1] + 1 if within else 0].tick * tick


@contextmanager
def hand_scene(seed: int, person: HandSettings | None) -> Iterator[HandScene]:
    """A scene that is ended afterwards; see ``HandScene``."""
    with tempfile.TemporaryDirectory(prefix="touchmove-") as folder:
        scene = HandScene(Path(folder) / "run", seed, person)
        with scene.rig:
            yield scene


class Follower:
    """Asks the referee again and again where the hand is, in a thread of its own, while plant time runs.

    Attributes:
        looks: plant time [s], and where the fingertips are and how the hand is turned, as in ``Truth.hand``.
        touches: plant time [s], and the largest force of the robot on the hand until then [N].
    """

    def __init__(self, scene: HandScene) -> None:
        self.looks: list[tuple[float, tuple[float, float, float, float]]] = []
        self.touches: list[tuple[float, float]] = []
        self._scene, self._referee = scene, SimReferee(scene.run_dir)
        edge = 4.0 * scene.table.square
        self._board, self._tick = (edge, edge), scene.parameters.drive.tick
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._follow, name="hand follower")
        self._thread.start()

    def _follow(self) -> None:
        asked = -math.inf
        while not self._done.wait(_GLANCE):
            now = self._scene.history.newest
            if now < asked + _EVERY:
                continue
            asked = now
            truth, _ = self._referee.look(reset_peak=not self.looks)
            assert truth.hand is not None
            if not self.looks or truth.tick * self._tick > self.looks[-1][0]:
                self.looks.append((truth.tick * self._tick, truth.hand))
                self.touches.append((truth.tick * self._tick, truth.hand_force))

    def crossings(self, half: tuple[float, float] | None = None) -> list[float]:
        """When parts of hand or arm began to be over the board and the last one ceased to be, by turns, plant time [s].

        Seen from above, and between the last look before and the first one after by a straight line; ``half``: half
        sizes along x and y, to ask of another part of the table [m].
        """
        found = []
        outside = [(when, _outside(hand, half or self._board)) for when, hand in list(self.looks)]
        for (t0, d0), (t1, d1) in pairwise(outside):
            if (d0 > 0.0) != (d1 > 0.0):
                found.append(t0 + (t1 - t0) * d0 / (d0 - d1))
        return found

    def close(self) -> None:
        """End the thread."""
        self._done.set()
        self._thread.join()
        self._referee.close()


def _outside(hand: tuple[float, float, float, float], half: tuple[float, float]) -> float:
    """How far a hand is outside of such half sizes; negative: over what is within [m]."""
    x, y, _, yaw = hand
    centres, radii = seen_from_above(x, y, yaw)
    return float(((np.abs(centres) - half).max(axis=1) - radii).min())


def until(ask: Callable[[], _T | None], what: str) -> _T:
    """Wait for an answer that is neither None nor empty.

    Raises:
        UserError: it does not come.
    """
    deadline = time.monotonic() + TIMEOUT
    while time.monotonic() < deadline:
        if answer := ask():
            return answer
        time.sleep(0.005)
    raise UserError(f"the bench was cut short: {what} did not come within {TIMEOUT:g} s")
