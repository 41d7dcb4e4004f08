"""Plans of whole plies: each transfer is approach, grasp, and carry with set-down and retreat; the last ends at home.

Heights follow from what stands in the way. Fingers move while the arm travels. Between motions the arm rests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from app.manipulation import Inventory, Stage, Transfer
from app.motion.gains import scheduled
from app.motion.obstacles import Standing, blocking_neighbour, closed_position, standing, tallest_on_way
from app.motion.plan import Motion, Plan, PlanRefused
from app.motion.reference import Bounds, Segment, Vector, dwell, join, line, to_samples
from app.motion.settings import MotionSettings
from controller.protocol import Guard
from hardware.parameters import RobotParameters
from hardware.table import PIECE_SHAPES, Kind, PieceShape, Place, TableSettings


@dataclass(frozen=True, slots=True)
class _Rig:
    settings: MotionSettings
    parameters: RobotParameters
    table: TableSettings

    @property
    def tick(self) -> float:
        return self.parameters.drive.tick

    @property
    def tip(self) -> float:
        return self.parameters.pads.half_height

    def base(self, place: Place, height: float) -> Vector:
        """Tool point over a place with the pads' centre at a height over the board."""
        return self.table.base_from_board(np.array([*self.table.xy(place), height]))

    def height(self, point: Vector) -> float:
        return float(self.table.board_from_base(point)[2])

    def bounds(self, start: Vector, end: Vector) -> Bounds:
        """Bounds of a line; slower where it goes down near the board."""
        s, limits = self.settings, self.table.limits
        speed = min(s.speed, limits.tool_speed)
        way = end - start
        length = float(np.linalg.norm(way))
        down = way[2] / length if length > 0.0 else 0.0
        if down > 0.0 and self.height(end) < limits.near_height:
            speed = min(speed, limits.downward_speed / down)
        return Bounds(speed, s.acceleration, s.jerk)


@dataclass(slots=True)
class _Track:
    """A motion being put together: segments with the finger's velocity and the height the gains go by."""

    rig: _Rig
    point: Vector
    finger: float
    segments: list[Segment] = field(default_factory=list)
    fingers: list[Vector] = field(default_factory=list)
    contact: list[Vector] = field(default_factory=list)

    def start(self, lowest: float) -> None:
        """The first sample: rest at the present point. ``lowest``: pads' height at which something touches [m]."""
        self._add(dwell(self.point, 1), np.zeros(1), lowest)

    def _add(self, segment: Segment, finger_velocity: Vector, lowest: float) -> None:
        self.segments.append(segment)
        self.fingers.append(finger_velocity)
        centre = self.rig.table.centre_in_base[2]
        self.contact.append(centre - segment.position[:, 2] - lowest)

    def go(self, end: Vector, lowest: float, finger_target: float | None = None, bounds: Bounds | None = None) -> None:
        """Along a straight line, the fingers moving to a target on the way (None: they keep pressing)."""
        segment = line(self.point, end, bounds or self.rig.bounds(self.point, end), self.rig.tick)
        self._add(segment, self._finger_velocity(len(segment), finger_target), lowest)
        self.point = end

    def rest(self, duration: float, lowest: float, finger_target: float | None = None) -> None:
        """Stay for a while."""
        ticks = int(np.ceil(duration / self.rig.tick))
        self._add(dwell(self.point, ticks), self._finger_velocity(ticks, finger_target), lowest)

    def open(self, finger_target: float, lowest: float) -> None:
        """Stay until the fingers have opened to a target, which may be nearer than they are."""
        grip = self.rig.settings.grip
        self.rest(max(0.0, finger_target - self.finger) / grip.opening_speed, lowest, max(finger_target, self.finger))

    def _finger_velocity(self, ticks: int, target: float | None) -> Vector:
        grip = self.rig.settings.grip
        velocity = np.zeros(ticks)
        if target is None:
            velocity[:] = -grip.closing_speed
            return velocity
        way = target - self.finger
        needed = min(ticks, int(np.ceil(abs(way) / (grip.opening_speed * self.rig.tick))))
        if needed:
            speed = min(grip.opening_speed, abs(way) / (needed * self.rig.tick))
            velocity[:needed] = np.copysign(speed, way)
            self.finger += float(velocity.sum() * self.rig.tick)
        return velocity

    def motion(self, label: str) -> Motion:
        path = join(self.segments)
        stiffness, damping = scheduled(np.concatenate(self.contact), self.rig.settings.gains)
        samples = to_samples(path, stiffness, damping, np.concatenate(self.fingers))
        samples.flags.writeable = False
        return Motion(label, samples, (len(samples) - 1) * self.rig.tick)


def plan_ply(
    label: str,
    transfers: Sequence[Transfer],
    inventory: Inventory,
    start: Vector,
    finger: float,
    settings: MotionSettings,
    parameters: RobotParameters,
    lead_ticks: int = 0,
    *,
    holding: bool = False,
    low: bool = False,
) -> Plan:
    """Plan all transfers of a ply, or what is left of them, from where the arm rests to home.

    Args:
        label: the move, for people.
        transfers: in order of execution.
        inventory: what stands where before the ply.
        start: the arm's present reference, base frame (3,) [m].
        finger: present finger position [m].
        settings: speeds, gains, heights.
        parameters: robot.
        lead_ticks: pause between motions, for announcing the next one.
        holding: the first transfer's piece is in the fingers already.
        low: the fingers may still be around a piece that stands: they open before the arm moves.

    Raises:
        PlanRefused: open fingers would touch a neighbour.
    """
    rig = _Rig(settings, parameters, inventory.table)
    motions: list[Motion] = []
    point, now = np.asarray(start, dtype=float), finger
    for index, transfer in enumerate(transfers):
        others = standing(((p.place, p.kind) for p in inventory if p.name != transfer.name), inventory.table)
        if not (holding and index == 0):
            approach = _approach(rig, transfer, others, point, now, open_first=low and index == 0)
            grasp = _grasp(rig, transfer, approach)
            reach = approach.motion(f"to {transfer.source}")
            motions += [_part(reach, index, Stage.APPROACH), _part(_guarded(rig, grasp, transfer), index, Stage.GRASP)]
            point = grasp.point
        last = index == len(transfers) - 1
        carry = _carry(rig, transfer, others, point, last)
        done = carry.motion(f"{transfer.kind} {transfer.source} to {transfer.target}" + (", home" if last else ""))
        motions.append(_part(done, index, Stage.CARRY))
        point, now = carry.point, carry.finger
        inventory = inventory.moved(transfer)
    return Plan(label, tuple(motions), lead_ticks * rig.tick)


def _part(motion: Motion, transfer: int, stage: Stage) -> Motion:
    return replace(motion, transfer=transfer, stage=stage)


def plan_return(
    start: Vector,
    finger: float,
    settings: MotionSettings,
    parameters: RobotParameters,
    table: TableSettings,
    release: Kind | None = None,
) -> Plan:
    """From anywhere to home: straight up to a safe height first, then over.

    Args:
        start: the arm's present reference, base frame (3,) [m].
        finger: present finger position [m].
        settings: speeds, gains, heights.
        parameters: robot.
        table: board and trays.
        release: the fingers open from a piece of this kind, which stands, before the arm moves; None: they stay.
    """
    rig = _Rig(settings, parameters, table)
    point, home = np.asarray(start, dtype=float), np.asarray(settings.home, dtype=float)
    track = _Track(rig, point, finger)
    track.start(0.0)
    if release is not None:
        track.open(_opening(rig, release), 0.0)
        finger = track.finger
    above = np.array([point[0], point[1], min(point[2], home[2])])
    track.go(above, 0.0, finger)
    track.go(home, 0.0, finger)
    return Plan("home", (_part(track.motion("home"), 0, Stage.RETURN),))


def _opening(rig: _Rig, kind: Kind) -> float:
    pads, gripper = rig.parameters.pads, rig.parameters.gripper
    position = closed_position(kind, pads) + rig.settings.grip.opening_margin
    if position > gripper.stroke:
        raise PlanRefused(
            f"a {kind} needs the fingers {position * 1e3:.1f} mm open, the gripper opens "
            f"{gripper.stroke * 1e3:.1f} mm: use thinner pieces or a wider gripper"
        )
    return position


def _fits(rig: _Rig, transfer: Transfer, place: Place, others: Sequence[Standing], opening: float) -> None:
    x, y = rig.table.xy(place)
    tip = PIECE_SHAPES[transfer.kind].grip_height - rig.tip
    neighbour = blocking_neighbour(x, y, opening, tip, others, rig.parameters.pads)
    if neighbour is not None:
        raise PlanRefused(
            f"at {place} the fingers, {opening * 1e3:.1f} mm open, would touch the {neighbour.kind} on "
            f"{neighbour.place}: move that piece first or use larger squares"
        )


def _approach(
    rig: _Rig, transfer: Transfer, others: Sequence[Standing], point: Vector, finger: float, *, open_first: bool
) -> _Track:
    """Over to the piece with the fingers opening, then straight down to the grip height."""
    settings = rig.settings
    shape = PIECE_SHAPES[transfer.kind]
    opening = _opening(rig, transfer.kind)
    _fits(rig, transfer, transfer.source, others, opening)
    here = rig.table.board_from_base(point)
    passed = tallest_on_way((here[0], here[1]), rig.table.xy(transfer.source), others, settings.corridor)
    top = max(passed, shape.height) + rig.tip + settings.clearance
    track = _Track(rig, point, finger)
    track.start(shape.grip_height)
    if open_first:
        track.open(opening, shape.grip_height)
    if rig.height(point) < top - 1e-9:
        track.go(point + np.array([0.0, 0.0, rig.height(point) - top]), shape.grip_height, opening)
    track.go(rig.base(transfer.source, top), shape.grip_height, opening)
    track.go(rig.base(transfer.source, shape.grip_height), shape.grip_height, opening)
    return track


def _grasp(rig: _Rig, transfer: Transfer, approach: _Track) -> _Track:
    """Close until both pads feel the piece."""
    grip = rig.settings.grip
    way = approach.finger - closed_position(transfer.kind, rig.parameters.pads)
    track = _Track(rig, approach.point, approach.finger)
    track.start(PIECE_SHAPES[transfer.kind].grip_height)
    track.rest(way / grip.closing_speed + grip.patience, PIECE_SHAPES[transfer.kind].grip_height)
    return track


def _guarded(rig: _Rig, track: _Track, transfer: Transfer) -> Motion:
    grip = rig.settings.grip
    motion = track.motion(f"grasp {transfer.kind} on {transfer.source}")
    samples = motion.samples.copy()
    samples["guard"], samples["guard_level"] = Guard.GRIP, grip.guard_force
    samples.flags.writeable = False
    way = track.finger - closed_position(transfer.kind, rig.parameters.pads)
    # from contact the force grows with the gripper's and the tactile sensor's time constants
    gripper = rig.parameters.gripper
    rise = gripper.reflected_mass / gripper.velocity_gain + 1.0 / rig.parameters.tactile.bandwidth
    return Motion(motion.label, samples, way / grip.closing_speed + rise, grips=True)


def _carry(rig: _Rig, transfer: Transfer, others: Sequence[Standing], point: Vector, home_after: bool) -> _Track:
    """Lift from where it is, over, lower, touch down softly, open, retreat; and home, if it is the last of a ply."""
    s, shape = rig.settings, PIECE_SHAPES[transfer.kind]
    target = rig.table.xy(transfer.target)
    opening = _opening(rig, transfer.kind)
    _fits(rig, transfer, transfer.target, others, opening)
    here = rig.table.board_from_base(point)
    passed = tallest_on_way((here[0], here[1]), target, others, s.corridor)
    top = max(passed + s.clearance + shape.grip_height, passed + rig.tip + s.clearance, shape.grip_height + 0.01)
    low = shape.grip_height
    track = _Track(rig, point, closed_position(transfer.kind, rig.parameters.pads))
    track.start(low)
    track.fingers[-1][:] = -s.grip.closing_speed
    track.rest(s.grip.settle, low)
    top = max(top, rig.height(point))
    track.go(rig.table.base_from_board(np.array([here[0], here[1], top])), low)
    track.go(rig.base(transfer.target, top), low)
    track.go(rig.base(transfer.target, low + s.touch_height), low)
    touch = Bounds(s.touch_speed, s.acceleration, s.jerk)
    track.go(rig.base(transfer.target, low - s.touch_depth), low, bounds=touch)
    track.rest(s.release_wait, low)
    track.rest((opening - track.finger) / s.grip.opening_speed, low, opening)
    away = _retreat_height(rig, transfer, others, shape, home_after)
    track.go(rig.base(transfer.target, away), low, opening)
    if home_after:
        track.go(np.asarray(s.home, dtype=float), low, opening)
    return track


def _retreat_height(
    rig: _Rig, transfer: Transfer, others: Sequence[Standing], shape: PieceShape, home_after: bool
) -> float:
    """High enough to leave the piece and, on the way home, everything passed over."""
    passed = shape.height
    if home_after:
        home = rig.table.board_from_base(np.asarray(rig.settings.home))
        way = tallest_on_way(rig.table.xy(transfer.target), (home[0], home[1]), others, rig.settings.corridor)
        passed = max(passed, way)
    return passed + rig.tip + rig.settings.clearance
