"""A piece that stands behind another, where the camera sees no more than a corner of it."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace

from app.execution.repair.by_sight import Whereabouts, placed
from app.pieces.inventory import Inventory
from hardware.interfaces import Frame
from hardware.table import square_place
from vision.board.view import BoardView
from vision.pieces.fit import Fit
from vision.pieces.misplaced import around_board
from vision.standing.hiding import hiding_places


def behind_another(
    found: Whereabouts, stands: Inventory, frame: Frame, view: BoardView, not_there: Set[str]
) -> Whereabouts:
    """A piece that is nowhere in sight, where one of its side peeps out behind another: that is where it is.

    Args:
        found: what stands where, but for that piece.
        stands: what should.
        frame: that shows it; has depth.
        view: where the board is in it.
        not_there: names of pieces that the arm has looked for in such a place in vain.
    """
    believed = placed(stands, found)
    if believed is None or found.lying or len(found.missing) != 1 or found.missing[0].name in not_there:
        return found
    (gone,) = found.missing
    expected = {piece.place: piece for piece in believed if not piece.place.in_box}
    fit = Fit(frame, view, expected, use_depth=True, around=around_board(view, trays=True))
    # rather on the board: in a tray about one free place in a hundred looks so, and most places there are free
    for places in (map(square_place, range(64)), stands.table.tray_places()):
        hiding = hiding_places([place for place in places if place not in expected], fit, view)
        peeps = [place for place, side in hiding.items() if side is gone.colour]
        if len(peeps) == 1:
            standing = {**found.standing, gone.name: stands.table.xy(peeps[0])}
            return replace(found, standing=standing, moved=found.moved | {gone.name}, missing=())
        if peeps:
            break
    return found
