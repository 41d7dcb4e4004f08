"""Where pieces are that do not stand where they should: lying, or standing somewhere else; and which ones.

Which pieces stand as expected is known from ``vision.pieces.fit``. What else looks like a piece is explained by the
missing ones (``vision.pieces.lying_or_standing``).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import numpy as np

from hardware.interfaces import Frame
from hardware.piece_set import PIECE_SHAPES
from hardware.table import PieceSpec, Place, TableSettings
from vision.arrays import Field, Mask
from vision.board.view import BoardView
from vision.pieces.centres import Centre, centres_of
from vision.pieces.fit import Fit
from vision.pieces.lying_or_standing import MisplacedPiece, PoseSearch
from vision.pieces.outline import labels
from vision.pieces.placement_faults import TOLERANCE
from vision.pieces.poses import Pose
from vision.pieces.surface import raised

_BEFORE: Final = 0.012  # a point further beyond a piece's foot than this, seen from above, is none of the piece's [m]
_BEYOND: Final = 0.014  # pieces are looked for up to so far beyond the playing area [m]
_LEANS: Final = 0.06
"""… and before the first rank and behind the last, where no trays are, so much further: pieces lie there with their
heads beyond the edge, and what is high looks further off than it is [m]."""
_SIGHTED: Final = 0.0015  # error of where a piece stands that was only sighted, as a standard deviation [m]
PUT_BY: Final = 0.012
"""What stands no further than this from its place on a tray is what was put there [m]: places are 30 mm apart."""
_MANY: Final = 8  # so many pieces off the middles of their squares were set up sloppily
_SAME: Final = 0.008  # a piece that stands was found twice when both places are no further apart [m]


def find_misplaced(
    frame: Frame, view: BoardView, expected: Mapping[Place, PieceSpec], *,
    use_depth: bool = True, tolerance: float = TOLERANCE, doubted: Collection[Place] = (), trays: bool = False,
    before: Mapping[Place, tuple[float, float]] = MappingProxyType({}),
    standing: Mapping[Place, tuple[float, float]] = MappingProxyType({}), besides: Collection[PieceSpec] = (),
) -> tuple[MisplacedPiece, ...]:  # fmt: skip
    """Find the pieces on the board, or beside it, that do not stand where they should.

    Args:
        frame: by the camera of the view, without a hand or an arm over the board.
        view: of the board.
        expected: what should stand where.
        use_depth: False: by colour alone, also where there is depth.
        tolerance: a piece that stands further from its place's centre is misplaced [m].
        doubted: places whose piece may lie, although it looks as if it stood.
        trays: pieces are looked for there, too; then all that should stand there is expected. What boxes hold, nobody
            can tell.
        before: where pieces were that did not stand where they should when they were seen last [m].
        standing: where pieces stand, of those of which that is known, by where they should [m].
        besides: pieces that should be out of sight, and may lie somewhere all the same.

    Returns:
        Those found, the surest first. A missing piece that is not among them is hidden or off the board. One that would
        stand only partly within the picture is not missed: too little can be said of it.

    Raises:
        ValueError: the frame is by another camera, or the board is not in the picture.
    """
    view.require_camera(frame)
    around = around_board(view, trays=trays)
    fit = Fit(frame, view, expected, use_depth=use_depth, around=around)
    centres = centres_of(fit) if expected else {}
    off = {place: math.dist((one.x, one.y), view.table.xy(place)) for place, one in centres.items()}
    # what lies can look much like what stands off its centre: which it is, the search decides
    stands = {place: one.upright and place not in doubted and off[place] <= tolerance for place, one in centres.items()}
    astray = [
        MisplacedPiece(expected[place], place, Pose(*standing[place]), _SIGHTED, 1.0, 1.0, 1.0)
        for place in fit.stands if place in standing and not stands[place]
    ]  # fmt: skip
    left = [
        (place, expected[place])
        for place in fit.stands
        if place not in standing
        and not (stands[place] or centres[place].hidden)
        and _is_in_picture(view, place, expected[place])
    ]
    points = None if fit.rises is None else raised(fit.part, fit.rises, view)
    search = PoseSearch(fit, view, _taken(fit, points, [stands[place] for place in fit.stands]), around, points)
    # a dozen reserves that are hardly told from the table by colour would each be sought at each other's places
    put_by = [] if points is None else [
        *_put_by(search, left, view.table, doubted), *_off_centre(search, left, centres, off, doubted)
    ]  # fmt: skip
    left = [(place, piece) for place, piece in left if all(one.target != place for one in put_by)]
    left += [(piece.place, piece) for piece in besides]
    known = [*astray, *put_by]
    for one in known:
        search.take_out(one)
    found = list[MisplacedPiece]()
    while left:
        stray = search.best(left, before)
        if stray is None:
            break
        found.append(stray)
        left.remove((stray.target, stray.piece))
        search.take_out(stray)
    if len(found) > 1:
        again = search.again()
        for one in known:
            again.take_out(one)
        found = again.told_apart(found, before)
    found += [one for one in astray if not one.target.in_tray or _off(one, view.table) > PUT_BY]
    found += [one for one in put_by if _off(one, view.table) > tolerance]
    found = [_sharper(stray, centres) for stray in found]
    return tuple(sorted(found, key=lambda one: -one.support * one.seen))


def _put_by(
    search: PoseSearch, missing: Sequence[tuple[Place, PieceSpec]], table: TableSettings, doubted: Collection[Place]
) -> list[MisplacedPiece]:
    """Pieces on trays that depth shows to stand about where they should, though their outlines were not found there."""
    asked = [(place, piece) for place, piece in missing if place.in_tray and place not in doubted]
    about = [search.standing_about(piece, place, table.xy(place)) for place, piece in asked]
    return [one for one in about if one is not None and _off(one, table) <= PUT_BY]


def _off_centre(
    search: PoseSearch, missing: Sequence[tuple[Place, PieceSpec]], centres: Mapping[Place, Centre],
    off: Mapping[Place, float], doubted: Collection[Place],
) -> list[MisplacedPiece]:  # fmt: skip
    """Of a sloppily set-up board the pieces that depth shows to stand where their outlines were found, off the middles
    of their squares; of a few the search says for sure which is which, of many it would take a minute.
    """
    asked = [
        (place, piece) for place, piece in missing
        if place.on_board and place not in doubted and centres[place].upright and off[place] <= PUT_BY
    ]  # fmt: skip
    if len(asked) < _MANY:
        return []
    at = {place: (centres[place].x, centres[place].y) for place, _ in asked}
    about = [search.standing_about(piece, place, at[place]) for place, piece in asked]
    return [
        one for one in about if one is not None and math.dist((one.pose.x, one.pose.y), at[one.target]) <= TOLERANCE
    ]


def _off(one: MisplacedPiece, table: TableSettings) -> float:
    """How far a piece is from where it should stand [m]."""
    return math.dist(table.xy(one.target), (one.pose.x, one.pose.y))


def _sharper(stray: MisplacedPiece, centres: Mapping[Place, Centre]) -> MisplacedPiece:
    """Where a standing piece's outline was found as well, its place is known better."""
    one = centres.get(stray.target)
    if one is None or stray.lies or not one.upright or math.dist((one.x, one.y), (stray.pose.x, stray.pose.y)) > _SAME:
        return stray
    return replace(stray, pose=Pose(one.x, one.y), std=one.std)


def _is_in_picture(view: BoardView, place: Place, piece: PieceSpec) -> bool:
    """Whether all of a piece that stands at a place would be seen."""
    shape, (x, y) = PIECE_SHAPES[piece.kind], view.table.xy(place)
    radius = shape.foot_radius
    corners = [(x + i * radius, y + j * radius, z) for i in (-1, 1) for j in (-1, 1) for z in (0.0, shape.height)]
    pixels = view.project(corners)
    size = np.array([view.intrinsics.width, view.intrinsics.height])
    return bool((pixels >= -0.5).all() and (pixels <= size - 0.5).all())


def around_board(view: BoardView, *, trays: bool) -> tuple[float, float]:
    """How far beyond the board pieces are looked for, along x and along y [m]."""
    ends = _BEYOND + _LEANS
    if not trays:
        return _BEYOND, ends
    furthest = max(view.table.xy(place)[0] for place in view.table.tray_places())
    return furthest - 4.0 * view.table.square + ends, ends


def _taken(fit: Fit, points: Field | None, stands: Sequence[bool]) -> Mask:
    """Pixels of pieces that stand as expected, but for those that depth shows to be of something before them.

    A missing piece's outline takes no pixel from them: it may have been found where another piece stands.
    """
    owner = labels(fit.silhouettes(), fit.part.ground.shape, np.array(stands, dtype=bool))
    taken: Mask = owner > 0
    if points is not None and fit.places.size:
        reach = np.array([0.0, *(PIECE_SHAPES[kind].foot_radius for kind in fit.kinds)])[owner] + _BEFORE
        off = points[..., :2] - np.vstack([np.zeros((1, 2)), fit.places])[owner]
        taken &= ~(np.hypot(off[..., 0], off[..., 1]) > reach)  # where depth is unknown that is false
    return taken
