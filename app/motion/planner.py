"""Plans of whole plies: approach; then of each transfer grasp, carry, and release with the way to the next, or home.

A way goes up, over and down again: vertical where fingers or piece are beside others, as high as what it passes over,
with corners as wide as that leaves room for. Fingers move while the arm travels.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from app.motion.arcs import Arc, Workcell, homewards, over
from app.motion.fallen.lying import NO_LOOSE_PIECES, LoosePieces, standing_near
from app.motion.finger_opening import least_opening, open_beside, opening_at
from app.motion.gain_schedule import Softness
from app.motion.motions import loosened, motion_of
from app.motion.obstacles import Crowd, Obstacle, closed_position
from app.motion.path import Vector
from app.motion.plan import Motion, Plan
from app.motion.route import Route
from app.motion.settings import MotionSettings
from app.pieces.inventory import Inventory, PieceBoxed, Stage, Transfer
from hardware.parameters import Pads, RobotParameters
from hardware.piece_set import PIECE_SHAPES, Kind
from hardware.table import Place, TableSettings

GRAVITY: Final = 9.81
"""[m/s²]"""


@dataclass(frozen=True, slots=True)
class Planner:
    """Plans motions of an arm from where it rests."""

    cell: Workcell
    """What plans are made for."""
    start: Vector
    """The arm's present reference, base frame (3,) [m]."""
    finger: float
    """Present finger position [m]."""
    lead_ticks: int = 0
    """Pause between motions, for announcing the next one."""

    @classmethod
    def of(
        cls, settings: MotionSettings, parameters: RobotParameters, table: TableSettings, start: Vector, finger: float,
        lead_ticks: int = 0,
    ) -> Self:  # fmt: skip
        """For a robot at a table; ``settings`` are speeds, gains and heights."""
        return cls(Workcell.of(settings, parameters, table), start, finger, lead_ticks)

    def plan(self, label: str, motions: Sequence[Motion]) -> Plan:
        """Of motions that follow each other."""
        return Plan(label, tuple(motions), self.lead_ticks * self.cell.tick)

    def ply(
        self, label: str, transfers: Sequence[Transfer], inventory: Inventory, *, holding: bool = False,
        low: bool = False, loose: LoosePieces = NO_LOOSE_PIECES,
    ) -> Plan:  # fmt: skip
        """Plan all transfers of a ply, or what is left of them, from where the arm rests to home.

        A piece that a transfer says was seen elsewhere counts as standing there until it is carried; ``inventory`` is
        what stands where before the ply, on the cell's table, ``loose`` what is on the board besides. ``holding``: the
        first transfer's piece is in the fingers already. ``low``: the fingers may still be around a piece that stands,
        and open before the arm moves. Raises ``InTheWay`` if open fingers would touch a neighbour, ``PlanRefused`` if
        they would touch a box, or a way leads out of the workspace, and ``PieceBoxed`` if a piece would be taken out of
        a box.
        """
        cell, table, finger = self.cell, self.cell.table, self.finger
        for transfer in transfers:
            if transfer.source.in_box:
                raise PieceBoxed(transfer.name, transfer.source)
        motions: list[Motion] = []
        meanwhile = cell.settings.grip.closing_speed * self.lead_ticks * cell.tick  # so far the fingers close before
        point = np.asarray(self.start, dtype=float)
        stands = Crowd.before(transfers, inventory)
        if loose != NO_LOOSE_PIECES:
            stands = standing_near([*stands.pieces, *loose.standing], loose.lying, table)
        for index, transfer in enumerate(transfers):
            others = stands.without(transfer.name)
            if index == 0 and not holding:
                route = _approach(cell, transfer, stands, point, finger, low=low)
                motion, finger = motion_of(cell, f"to {transfer.source}", route, index, Stage.APPROACH)
                motions.append(motion)
                point = route.points[-1]
            if index > 0 or not holding:
                route = _grasp(cell, transfer, point, finger)
                motion, _ = motion_of(cell, f"grasp {transfer.kind} on {transfer.source}", route, index, Stage.GRASP)
                closed = closed_position(transfer.kind, cell.parameters.pads)
                motions.append(
                    replace(motion, expected=_grip_time(cell, transfer, finger - meanwhile), seats_at=closed)
                )
            route = _carry(cell, transfer, others, point, fresh=index > 0 or not holding)
            carried = f"{transfer.kind} {transfer.source} to {transfer.target}"
            motion, _ = motion_of(cell, carried, route, index, Stage.CARRY)
            motions.append(motion)
            point = cell.base([(*table.xy(transfer.target), _height(cell, transfer, transfer.target))])[0]
            moved = Obstacle.at(transfer.name, transfer.target, transfer.kind, table)
            stands = others if transfer.target.in_box else stands.with_moved(moved)
            following = transfers[index + 1] if index + 1 < len(transfers) else None
            route = _release(cell, transfer, following, stands, point)
            where = "home" if following is None else f"to {following.source}"
            motion, finger = motion_of(cell, f"release {transfer.kind}, {where}", route, index, Stage.RELEASE)
            motions.append(motion)
            point = route.points[-1]
        return self.plan(label, motions)

    def home(self, release: Kind | None = None, *, held_up_at: Vector | None = None) -> Plan:
        """From anywhere to home: straight up to a safe height first, then over.

        The fingers open before the arm moves from a piece that stands, of the kind ``release``; None: they stay. Where
        something holds the tool up, above its reference, base frame (3,) [m], the reference comes there first.
        """
        cell, finger = self.cell, self.finger
        point = np.asarray(self.start, dtype=float)
        before: tuple[Motion, ...] = ()
        if held_up_at is not None:
            before = (loosened(cell, point, np.asarray(held_up_at, dtype=float)),)
            point = before[0].samples["position"][-1].astype(float)
        opens = finger if release is None else max(finger, least_opening(cell, release))
        wait = (opens - finger) / cell.settings.grip.opening_speed
        low = 0.0 if release is None else PIECE_SHAPES[release].grip_height
        route = Route(
            *homewards(cell, point), contact=(low, 0.0), finger=finger, wait=wait,
            opens=opens, soft_start=Softness.STIFF if release is None else Softness.LASTS,
        )  # fmt: skip
        motion, _ = motion_of(cell, "home", route, 0, Stage.RETURN)
        return Plan("home", (*before, motion))


# fingers


def _height(cell: Workcell, transfer: Transfer, place: Place) -> float:
    """Of the tool over the board where it takes the piece from a place or lets go of it there [m]."""
    return cell.height(transfer.kind, place) + transfer.raised


def _grip_time(cell: Workcell, transfer: Transfer, finger: float) -> float:
    """From closing to the guard: the way, then the force, by the time constants of gripper and tactile sensor [s]."""
    gripper = cell.parameters.gripper
    rise = gripper.reflected_mass / gripper.velocity_gain + 1.0 / cell.parameters.tactile.bandwidth
    return (finger - closed_position(transfer.kind, cell.parameters.pads)) / cell.settings.grip.closing_speed + rise


def fall_time(kind: Kind, pads: Pads) -> float:
    """From let go in the air until all of a piece has fallen out of the fingers: s = g t² / 2 [s]."""
    shape = PIECE_SHAPES[kind]
    return math.sqrt(2.0 * (shape.height - shape.grip_height + pads.half_height) / GRAVITY)


# routes


def _approach(cell: Workcell, transfer: Transfer, stands: Crowd, point: Vector, finger: float, *, low: bool) -> Route:
    """Over to the piece with the fingers opening, then straight down to the grip height."""
    shape = transfer.shape
    there = transfer.grasped_at(cell.table)
    opening = opening_at(cell, transfer, transfer.source, there, stands.without(transfer.name))
    x, y, height = cell.board(point)
    wait = max(0.0, opening - finger) / cell.settings.grip.opening_speed if low else 0.0
    arc = Arc((x, y, height), (*there, shape.grip_height), 0.0, None, max(opening, finger))
    return Route(
        *over(cell, arc, stands), contact=(shape.grip_height, shape.grip_height), finger=finger, wait=wait,
        opens=max(opening, finger) if low else opening, then=opening if low else None,
        closes=open_beside(cell, transfer.kind),
    )  # fmt: skip


def _grasp(cell: Workcell, transfer: Transfer, point: Vector, finger: float) -> Route:
    """Close until both pads feel the piece."""
    height, grip = transfer.shape.grip_height, cell.settings.grip
    patience = _grip_time(cell, transfer, finger) + grip.patience
    way = finger - grip.within - closed_position(transfer.kind, cell.parameters.pads)
    return Route(
        np.array([point]), np.zeros(0), (), contact=(height, height), finger=finger, wait=patience,
        soft_start=Softness.BEGINS, grips=max(0.0, way / grip.closing_speed),
    )  # fmt: skip


def _carry(cell: Workcell, transfer: Transfer, others: Crowd, point: Vector, *, fresh: bool) -> Route:
    """Up from where it is, over, down, and slowly on until it stands; or to where it is dropped into a box."""
    settings, shape = cell.settings, transfer.shape
    x, y, height = cell.board(point)
    closed = closed_position(transfer.kind, cell.parameters.pads)
    there = cell.table.xy(transfer.target)
    opening_at(cell, transfer, transfer.target, there, others)
    low, drops = shape.grip_height, transfer.target.in_box
    end = _height(cell, transfer, transfer.target) + (0.0 if drops else settings.touch_height)
    arc = Arc((x, y, height), (*there, end), low + settings.clearance, shape, closed, drops)
    return Route(
        *over(cell, arc, others), contact=(low, low), finger=closed, wait=settings.grip.settle,
        soft_start=Softness.LASTS if fresh else Softness.STIFF, touches=not drops, holds=True,
    )  # fmt: skip


def _release(cell: Workcell, transfer: Transfer, following: Transfer | None, stands: Crowd, point: Vector) -> Route:
    """Open, up from the piece, and over to the next one, or home; over a box, once the piece has fallen."""
    settings, table, shape = cell.settings, cell.table, transfer.shape
    pads = cell.parameters.pads
    beside, drops = stands.without(transfer.name), transfer.target.in_box
    place = table.xy(transfer.target)
    opening, closed = (opening_at(cell, transfer, transfer.target, place, beside), closed_position(transfer.kind, pads))
    wait = settings.release_wait + settings.grip.freed / settings.grip.opening_speed
    wait += cell.parameters.gripper.reflected_mass / cell.parameters.gripper.velocity_gain
    wait += fall_time(transfer.kind, pads) if drops else 0.0
    here = (*place, cell.board(point)[2])
    if following is None:
        end, low, then = cell.board(np.asarray(settings.home)), 0.0, None
    else:
        low = following.shape.grip_height
        there = following.grasped_at(table)
        then = opening_at(cell, following, following.source, there, stands.without(following.name))
        end = (*there, low)
    arc = Arc(here, end, 0.0, None, max(opening, then or 0.0))
    return Route(
        *over(cell, arc, stands), contact=(shape.grip_height, low), finger=closed, wait=wait, opens=opening,
        then=then, closes=None if following is None else open_beside(cell, following.kind),
        soft_start=Softness.STIFF if drops else Softness.BEGINS,
    )  # fmt: skip
