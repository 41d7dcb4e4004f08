"""How wide the fingers open around a piece: as is useful, and as neighbours and boxes leave room for."""

from typing import Final

from app.motion.arcs import Workcell
from app.motion.obstacles import Crowd, Obstacle, blocking_neighbour, box_in_the_way, closed_position
from app.motion.plan import InTheWay, PlanRefused
from app.pieces.inventory import Transfer
from hardware.piece_set import Kind
from hardware.table import Place

_TRIED: Final = 4
"""So many openings are tried, from the widest to the least."""


def least_opening(cell: Workcell, kind: Kind) -> float:
    """So wide the fingers have to be to get down around a piece [m]; ``PlanRefused`` if the gripper opens less."""
    pads, gripper = cell.parameters.pads, cell.parameters.gripper
    position = closed_position(kind, pads) + cell.settings.grip.opening_margin
    if position > gripper.stroke:
        raise PlanRefused(
            f"a {kind} needs the fingers {position * 1e3:.1f} mm open, the gripper opens "
            f"{gripper.stroke * 1e3:.1f} mm: use thinner pieces or a wider gripper"
        )
    return position


def opening_at(cell: Workcell, transfer: Transfer, place: Place, point: tuple[float, float], others: Crowd) -> float:
    """As wide as is useful and as neighbours and boxes leave room for [m]; ``PlanRefused`` if that is too little."""
    grip, pads = cell.settings.grip, cell.parameters.pads
    x, y = point
    tip = cell.height(transfer.kind, place) + transfer.raised - pads.half_height
    least = least_opening(cell, transfer.kind)
    widest = min(closed_position(transfer.kind, pads) + grip.widest_margin, cell.parameters.gripper.stroke)
    for part in range(_TRIED):
        opening = widest + part / (_TRIED - 1) * (least - widest)
        neighbour = blocking_neighbour(x, y, opening, tip, others, pads)
        if neighbour is None and not box_in_the_way(x, y, opening, tip, others, pads):
            return opening
    if neighbour is None:
        raise PlanRefused(
            f"at {place} the fingers, {least * 1e3:.1f} mm open, would touch a box: enlarge box_gap of the table"
        )
    raise InTheWay(
        f"at {place} the fingers, {least * 1e3:.1f} mm open, would touch the {neighbour.kind} on "
        f"{neighbour.place}: move that piece first or use larger squares",
        neighbour,
        Obstacle(transfer.name, place, x, y, transfer.kind),
    )


def fits_around(piece: Obstacle, others: Crowd, cell: Workcell) -> bool:
    """Whether the fingers get down around a piece where it stands, as far open as they have to be."""
    pads, opening = cell.parameters.pads, least_opening(cell, piece.kind)
    tip = cell.height(piece.kind, piece.place) - pads.half_height
    blocked = blocking_neighbour(piece.x, piece.y, opening, tip, others, pads) is not None
    return not (blocked or box_in_the_way(piece.x, piece.y, opening, tip, others, pads))


def open_beside(cell: Workcell, kind: Kind) -> float:
    """Finger position beside a piece that may stand off its place, before the fingers close slowly [m]."""
    return closed_position(kind, cell.parameters.pads) + cell.settings.grip.beside
