"""What a person does, part by part: each part is planned from what is seen when it begins.

A routine yields motor programs; whoever runs it asks for the next one when the last has been carried out. So a piece
that was missed is grasped again, and one that fell is noticed.
"""

import math
from collections.abc import Callable, Iterator
from typing import Final

import numpy as np

from hardware.sim.bodies.hand import TIP_RADIUS, HandPose, parked
from hardware.sim.bodies.scene import deck_half_size
from hardware.sim.hand import actions as act
from hardware.sim.hand.motion import Program, Sketch
from hardware.sim.hand.paths import LEAST_LIFT
from hardware.sim.hand.plan import Held, Person, held_now, tips_for
from hardware.sim.hand.sight import SeenPiece, TableView
from hardware.table import TableSettings

NEAR: Final = 0.020
"""A piece is meant if it stands no further from the point than this [m]: half a square."""
_ATTEMPTS: Final = 3
_SWEEP: Final = 0.030
"""A knock goes on so far behind the piece [m]."""
_RUN_UPS: Final = (0.030, 0.022, 0.015, 0.008)
"""… and begins so far before it, less where another piece stands there [m]."""
_SWEEP_SPEED: Final = 0.45
_SLIDE_SPEED: Final = 0.25
_SETTLING_SPEED: Final = 0.08
_GAP_CLOSED: Final = 0.0005


class HandFailed(Exception):
    """The hand cannot do what it is asked; the message is one sentence."""


class Routines:
    """What a person does with the hand; ``rng`` draws what is human about it, ``held`` is between the fingertips."""

    def __init__(
        self, look: Callable[[], TableView], pose: Callable[[], HandPose], settings: act.HandSettings,
        table: TableSettings, rng: np.random.Generator,
    ) -> None:  # fmt: skip
        self.held: Held | None = None
        self._look, self._pose = look, pose
        self._settings, self._table, self._rng = settings, table, rng
        self._person = Person(settings.side, settings.speed)

    def do(self, actions: tuple[act.Action, ...]) -> Iterator[Program]:
        """The programs of some actions; raises ``HandFailed`` as soon as one of them is impossible."""
        for action in actions:
            yield from self._one(action)

    def leave_off(self) -> Iterator[Program]:
        """Something was interrupted: find out by looking whether the fingers hold a piece, and withdraw."""
        pose, sight = self._pose(), self._look()
        near = [p for p in sight.pieces if p.distance(pose.x, pose.y) < 0.008 and p.z <= pose.z <= p.top]
        closed = near and pose.gap < near[0].shape.stem_radius
        self.held = held_now(near[0], pose) if closed else None
        yield from self._withdraw()

    def _one(self, action: act.Action) -> Iterator[Program]:
        match action:
            case act.Take():
                yield from self._take(action.at)
            case act.Put():
                yield from self._put(action.at)
            case act.Move():
                self._check_free(self._look(), self._standing_piece(action.start), action.to)
                yield from self._take(action.start)
                yield from self._put(action.to)
            case act.Slide():
                yield from self._slide(action)
            case act.Knock():
                yield from self._knock(action)
            case act.Hover():
                x, y = action.at
                sketch = self._person.over(self._look(), self._pose(), x, y, action.height, self.held)
                yield sketch.wait(action.duration).done()
            case act.Hesitate():
                yield self._hesitate(action)
            case act.Rest():
                yield from self._rest(action)
            case act.Withdraw():
                yield from self._withdraw()

    # pieces

    def _standing_piece(self, at: act.Point) -> SeenPiece:
        x, y = at
        piece = self._look().nearest(x, y)
        if piece is None or piece.distance(x, y) > NEAR:
            raise HandFailed(
                f"no piece stands within {1e3 * NEAR:.0f} mm of ({x:.3f}, {y:.3f}) m: give a point nearer to one"
            )
        if not piece.standing:
            raise HandFailed(f"the piece near ({x:.3f}, {y:.3f}) m lies on its side: the hand takes standing ones only")
        return piece

    def _grasp(self, at: act.Point) -> Iterator[Program]:
        """Fingers about a piece and closed."""
        if self.held is not None:
            raise HandFailed("the hand holds a piece already: put it down first")
        piece = self._standing_piece(at)
        program, _ = self._person.reach(self._look(), self._pose(), piece)
        yield program
        self.held = held_now(self._look().find(piece.name), self._pose())

    def _take(self, at: act.Point) -> Iterator[Program]:
        for _ in range(_ATTEMPTS):
            yield from self._grasp(at)
            assert self.held is not None
            before = self._look().find(self.held.name)
            yield self._person.lift(self._pose(), LEAST_LIFT)
            now = self._look().find(self.held.name)
            if now.z - before.z > LEAST_LIFT / 2.0:
                self.held = held_now(now, self._pose())
                return
            yield self._person.let_go(self._look(), self._pose(), self.held)
            self.held, at = None, (now.x, now.y)
        raise HandFailed(f"the piece near ({at[0]:.3f}, {at[1]:.3f}) m slipped {_ATTEMPTS} times: look at it")

    def _put(self, at: act.Point) -> Iterator[Program]:
        if self.held is None:
            raise HandFailed("the hand holds nothing to put down: take a piece first")
        sight = self._look()
        held = self._still_held(sight, self.held)
        self._check_free(sight, held, at)
        x, y = np.add(at, self._slip()).tolist()
        turn = float(self._rng.uniform(-1.0, 1.0)) * self._settings.turning
        yaw = self._person.natural_yaw(x, y) + turn
        yield self._person.place(sight, self._pose(), held, x, y, yaw)
        yield from self._release()

    def _still_held(self, sight: TableView, before: Held) -> Held:
        """How it is held by now, after whatever happened on the way."""
        self.held = held_now(sight.find(before.name), self._pose())
        if math.hypot(*self.held.forward) > NEAR or abs(self.held.below - before.below) > NEAR:
            self.held = None
            raise HandFailed("the piece fell out of the hand on its way: look where it lies")
        return self.held

    def _release(self) -> Iterator[Program]:
        assert self.held is not None
        yield self._person.let_go(self._look(), self._pose(), self.held)
        self.held = None

    def _slip(self) -> tuple[float, float]:
        """By how much a person misses, x and y [m]."""
        limit = self._settings.placement_limit
        dx, dy = self._rng.normal(0.0, self._settings.placement_sigma, 2).clip(-limit, limit).tolist()
        return dx, dy

    def _check_free(self, sight: TableView, piece: Held | SeenPiece, at: act.Point) -> None:
        x, y = at
        wide, deep = deck_half_size(self._table)
        if abs(x) > wide - piece.shape.foot_radius or abs(y) > deep - piece.shape.foot_radius:
            raise HandFailed(
                f"({x:.3f}, {y:.3f}) m is not on the board or its trays, which end at ±{wide:.3f} m and ±{deep:.3f} m"
            )
        if not self._is_free(sight, piece, at):
            raise HandFailed(f"another piece stands at ({x:.3f}, {y:.3f}) m: take it away first")

    @staticmethod
    def _is_free(sight: TableView, piece: Held | SeenPiece, at: act.Point) -> bool:
        others = sight.without(piece.name).pieces
        return all(p.distance(*at) > p.shape.foot_radius + piece.shape.foot_radius for p in others)

    def _slide(self, action: act.Slide) -> Iterator[Program]:
        yield from self._grasp(action.start)
        assert self.held is not None
        pose, held = self._pose(), self.held
        dx, dy = np.subtract(action.to, (pose.x, pose.y))
        x, y = tips_for(pose.x + float(dx), pose.y + float(dy), pose.yaw, held.forward)
        yield Sketch(pose, self._settings.speed).to(x=x, y=y, speed=_SLIDE_SPEED).wait(0.1).done()
        yield from self._release()

    def _knock(self, action: act.Knock) -> Iterator[Program]:
        if self.held is not None:
            raise HandFailed("the hand holds a piece: put it down before it knocks another one over")
        piece, sight = self._standing_piece(action.at), self._look()
        dx, dy = math.cos(action.direction), math.sin(action.direction)
        z = piece.z + piece.shape.height - 0.001
        in_the_way = [other for other in sight.without(piece.name).pieces if other.top > z]

        def starts() -> Iterator[act.Point]:
            for run_up in _RUN_UPS:
                before = piece.shape.stem_radius + TIP_RADIUS + run_up
                yield piece.x - before * dx, piece.y - before * dy

        def is_free(at: act.Point) -> bool:  # two fingertips side by side
            return all(other.distance(*at) > other.shape.stem_radius + 2.0 * TIP_RADIUS for other in in_the_way)

        x, y = next(filter(is_free, starts()), [*starts()][-1])
        end = piece.x + _SWEEP * dx, piece.y + _SWEEP * dy
        # with closed fingers all the way down: open ones would pinch the head of what stands there
        sketch = self._person.over(sight, self._pose(), x, y, z, then=end, gap=_GAP_CLOSED)
        sketch.to(x=end[0], y=end[1], speed=_SWEEP_SPEED)
        yield sketch.to(z=0.10, overlap=0.1).done()

    # being in the way

    def _hesitate(self, action: act.Hesitate) -> Program:
        x, y = action.at
        sight = self._look()
        below = TIP_RADIUS if self.held is None else self.held.below
        low = sight.highest((x, y), (x, y), width=0.04) + below + 0.012
        sketch = self._person.over(sight, self._pose(), x, y, low, self.held)
        pose = sketch.pose
        back = math.sin(pose.yaw), -math.cos(pose.yaw)
        sketch.wait(0.3 * action.duration).to(x=x + 0.07 * back[0], y=y + 0.07 * back[1], z=low + 0.03)
        return sketch.wait(0.3 * action.duration).to(x=x, y=y, z=low + 0.01).wait(0.4 * action.duration).done()

    def _rest(self, action: act.Rest) -> Iterator[Program]:
        if self.held is not None:
            raise HandFailed("the hand holds a piece: put it down before the hand rests")
        x, y = action.at
        sketch = self._person.over(self._look(), self._pose(), x, y, 0.03)
        sketch.to(z=TIP_RADIUS - 0.003, speed=_SETTLING_SPEED).wait(action.duration)
        yield sketch.to(z=0.03, speed=0.15).done()

    def _withdraw(self) -> Iterator[Program]:
        if self.held is not None:
            yield from self._put_anywhere(self.held)
        pose, home = self._pose(), parked(self._settings.side)
        yield self._person.home(self._look(), pose, home)

    def _put_anywhere(self, held: Held) -> Iterator[Program]:
        """Where there is room next to where the piece is."""
        sight, pose = self._look(), self._pose()
        wide, deep = (side - held.shape.foot_radius for side in deck_half_size(self._table))
        here = min(max(pose.x, -wide), wide), min(max(pose.y, -deep), deep)
        places = [(x, y) for x in np.arange(-wide, wide, 0.02).tolist() for y in np.arange(-deep, deep, 0.02).tolist()]
        near = sorted([here, *places], key=lambda at: math.dist(at, here))
        at = next((at for at in near if self._is_free(sight, held, at)), here)
        yield self._person.place(sight, pose, held, at[0], at[1], pose.yaw)
        yield from self._release()
