"""Where pieces are that do not stand where they should: lying, or standing somewhere else; and which ones.

Which pieces stand as expected is known from ``vision.fit``. What else looks like a piece, by its colours and by depth
where there is any, is explained by the silhouettes of the missing ones, lying in any direction or standing: the pose
that takes up the most evidence, with the least that speaks against it, is the one. What standing pieces hide says
nothing.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from hardware.interfaces import Frame
from hardware.table import PIECE_SHAPES, Colour, square_place
from vision.board import BoardView
from vision.centres import centres_of, require_camera
from vision.fit import FLAT, Fit, PieceLike
from vision.lying import Pose, drawn
from vision.verify import TOLERANCE

Array = NDArray[np.float64]
Field = NDArray[np.float32]

_RISEN: Final = 0.006
"""What rises higher above the board is no board [m]."""
_BY_DEPTH: Final = 2.0
"""Evidence of a pixel's height, either way (natural logarithm of the ratio)."""
_BEYOND: Final = 0.014
"""Pieces are looked for up to so far beyond the playing area [m]."""
_LEANS: Final = 0.06
"""… and before the first rank and behind the last, where no trays are, so much further: pieces lie there with their
heads beyond the edge, and what is high looks further off than it is [m]."""
_LEAST_AREA: Final = 60
"""Smaller spots are noise [px]."""
_LIKELY: Final = 0.6
"""Evidence, on average over some pixels, of what is worth a closer look."""
_COARSE_YAWS: Final = 12
_COARSE_STEP: Final = 0.010
"""Places are tried so far apart around a spot [m] …"""
_COARSE: Final = 2
"""… so many on either side …"""
_KEPT: Final = 4
"""… and so many of the best are looked at more closely."""
_STEPS: Final = ((0.004, 0.20), (0.002, 0.10), (0.001, 0.05), (0.0005, 0.025))
"""Finer and finer steps of place [m] and direction [rad]."""
_LEAST_SUPPORT: Final = 0.30
"""Mean evidence over a silhouette, as a share of the most, by which a piece is there."""
_LEAST_SEEN: Final = 0.35
"""With less of its silhouette in sight a pose is a guess."""
_ALIKE: Final = 60.0
"""Neighbouring pixels err alike: so many count as one (measured over rendered tables)."""
_MOST: Final = 2.5
_FEW: Final = 20
"""From fewer points of known height nothing follows."""
_TOP: Final = 0.9
"""Share of a piece's points below what counts as its top."""
_FLOOR: Final = 0.0005, 0.02
"""Nothing is known better than this [m, rad]: shapes are not exact."""


@dataclass(frozen=True, slots=True)
class Stray:
    """A piece that is not where it should stand.

    Attributes:
        piece: which of the missing ones; of several alike, the first.
        square: where it should stand, 0 = a1 … 63 = h8; None: it was on its way.
        pose: how it is there.
        std: expected error of its place, as a standard deviation, each of x and y [m].
        yaw_std: of its direction [rad]; 0 for one that stands.
        support: mean evidence over its silhouette, of the most there can be, -1 to 1.
        seen: share of its silhouette that nothing hides.
        lead: evidence by which this piece in this way, lying or standing, explains more than the next best of the
            missing ones would in any, as a share of its own; 0 where another one does as well.
    """

    piece: PieceLike
    square: int | None
    pose: Pose
    std: float
    yaw_std: float
    support: float
    seen: float
    lead: float

    @property
    def lies(self) -> bool:
        """Whether it has fallen."""
        return self.pose.yaw is not None


class _Trial(NamedTuple):
    score: float
    pose: Pose
    support: float
    seen: float


def find_strays(
    frame: Frame, view: BoardView, expected: Mapping[int, PieceLike], lost: Sequence[PieceLike] = (), *,
    use_depth: bool = True, tolerance: float = TOLERANCE, doubted: Collection[int] = (),
) -> tuple[Stray, ...]:  # fmt: skip
    """Find the pieces on the board that do not stand where they should.

    Args:
        frame: by the camera of the view, without a hand or an arm over the board.
        view: of the board.
        expected: what should stand where, by square.
        lost: pieces that should be nowhere on the board, but may: what fell out of the fingers.
        use_depth: False: by colour alone, also where there is depth.
        tolerance: a piece that stands further from its square's centre is a stray [m].
        doubted: squares whose piece may lie, although it looks as if it stood.

    Returns:
        Those found, the surest first. A missing piece that is not among them is hidden or off the board.

    Raises:
        ValueError: the frame is by another camera, or the board is not in the picture.
    """
    require_camera(frame, view)
    fit = Fit(frame, view, expected, use_depth=use_depth)
    centres = centres_of(fit) if expected else {}
    off = {square: math.dist((one.x, one.y), view.table.xy(square_place(square))) for square, one in centres.items()}
    # by colour alone, what lies looks much like what stands off its centre: which it is, the search decides
    stands = {
        square: one.upright and square not in doubted and (off[square] <= tolerance or fit.rises is not None)
        for square, one in centres.items()
    }
    missing: list[tuple[int | None, PieceLike]] = [
        (square, expected[square]) for square in fit.squares if not (stands[square] or centres[square].hidden)
    ]
    missing += [(None, piece) for piece in lost]
    search = _Search(fit, view, np.array([False, *(stands[square] for square in fit.squares)])[fit.owner])
    found = [
        Stray(expected[square], square, Pose(one.x, one.y), one.std, 0.0, one.support, one.seen, 1.0)
        for square, one in centres.items()
        if stands[square] and off[square] > tolerance
    ]
    while missing:
        stray = search.best(missing)
        if stray is None:
            break
        found.append(stray)
        missing.remove((stray.square, stray.piece))
        search.take_out(stray)
    return tuple(sorted(found, key=lambda one: -one.support * one.seen))


class _Search:
    """Explains what one frame shows beside the pieces that stand as expected."""

    def __init__(self, fit: Fit, view: BoardView, taken: NDArray[np.bool_]) -> None:
        self._view, self._part = view, fit.part
        self._shape = fit.part.ground.shape[0], fit.part.ground.shape[1]
        self._origin = int(fit.part.columns.start), int(fit.part.rows.start)
        half = 4.0 * view.table.square + _BEYOND
        place = fit.part.place
        beyond = (np.abs(place[..., 0]) > half) | (np.abs(place[..., 1]) > half + _LEANS)
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
        hidden = cv2.dilate(taken.astype(np.uint8), kernel) > 0
        self._open = ~(hidden | beyond)
        self._maps: dict[Colour, Field] = {}
        for colour, by_colour in zip((Colour.WHITE, Colour.BLACK), fit.maps, strict=True):
            evidence = by_colour.astype(np.float32)
            if fit.rises is not None:
                risen = np.where(fit.rises > _RISEN, np.float32(_BY_DEPTH), np.float32(0.0))
                flat = np.where(fit.rises < FLAT, np.float32(-_BY_DEPTH), np.float32(0.0))
                evidence = 0.5 * evidence + risen + flat
            self._maps[colour] = np.clip(evidence, -_MOST, _MOST) * self._open
        self._rises = fit.rises
        self._felt: Field = np.maximum(*self._maps.values())

    def best(self, missing: Sequence[tuple[int | None, PieceLike]]) -> Stray | None:
        """The missing piece that explains the most, or None if none explains anything."""
        alike = {(piece.kind, piece.colour): (square, piece) for square, piece in reversed(missing)}
        trials = {key: self._of_piece(piece) for key, (_, piece) in alike.items()}
        ranked = sorted((t for t in trials.items() if t[1]), key=lambda t: -t[1][0].score)
        for key, ways in ranked:
            best = ways[0]
            if best.support < _LEAST_SUPPORT or best.seen < _LEAST_SEEN:
                continue
            others = [way.score for other, more in ranked for way in more[: 1 if other != key else 2]
                      if way is not best]  # fmt: skip
            lead = 1.0 - max([0.0, *others]) / best.score
            square, piece = alike[key]
            best, std, yaw_std = self._spread(piece, best)
            return Stray(piece, square, best.pose, std, yaw_std, best.support, best.seen, lead)
        return None

    def take_out(self, stray: Stray) -> None:
        """What this one explains is explained."""
        seen = drawn(stray.piece.kind, stray.pose, self._view, self._shape, self._origin)
        fat = cv2.dilate(seen.mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        for field in (*self._maps.values(), self._felt, self._open):
            field[seen.rows, seen.columns][fat] = 0

    def _of_piece(self, piece: PieceLike) -> list[_Trial]:
        """The best way for it to lie and to stand, the better one first; none where nothing looks like its side."""
        spots = self._spots(piece.colour)
        lying, standing = list[_Trial](), list[_Trial]()
        reach = 0.5 * PIECE_SHAPES[piece.kind].height
        grid = [_COARSE_STEP * i for i in range(-_COARSE, _COARSE + 1)]
        # what stands before it may have left but its foot or its head in sight: any part of it may be at the spot
        parts = math.ceil(reach / _COARSE_STEP)
        along = [_COARSE_STEP * i for i in range(-parts, parts + 1)]
        for x, y in spots:
            standing += [self._try(piece, Pose(x + dx, y + dy)) for dx, dy in itertools.product(grid, grid)]
            for number in range(_COARSE_YAWS):
                yaw = 2.0 * math.pi * number / _COARSE_YAWS
                cos, sin = math.cos(yaw), math.sin(yaw)
                lying += [
                    self._try(
                        piece, Pose(x + a * cos - b * sin - reach * cos, y + a * sin + b * cos - reach * sin, yaw)
                    )
                    for a, b in itertools.product(along, grid[1:-1])
                ]
        ways = [self._climbed(piece, some) for some in (lying, standing) if some]
        return sorted(ways, key=lambda one: -one.score)

    def _climbed(self, piece: PieceLike, trials: list[_Trial]) -> _Trial:
        """From the best of some, step by step to the best near them."""
        trials.sort(key=lambda one: -one.score)
        best = [self._climb(piece, one, _STEPS[:2]) for one in trials[:_KEPT]]
        return self._climb(piece, max(best, key=lambda one: one.score), _STEPS[2:])

    def _climb(self, piece: PieceLike, trial: _Trial, steps: Sequence[tuple[float, float]]) -> _Trial:
        for step, turn in steps:
            for _ in range(20):
                around = (self._try(piece, pose) for pose in _neighbours(trial.pose, step, turn))
                better = max(around, key=lambda one: one.score)
                if better.score <= trial.score:
                    break
                trial = better
        return trial

    def _try(self, piece: PieceLike, pose: Pose) -> _Trial:
        rows, columns, mask, felt = drawn(piece.kind, pose, self._view, self._shape, self._origin)
        count = int(np.count_nonzero(mask))
        if not count:
            return _Trial(-math.inf, pose, -1.0, 0.0)
        evidence = np.where(felt, self._felt[rows, columns], self._maps[piece.colour][rows, columns])
        if self._rises is not None:
            shape, rises = PIECE_SHAPES[piece.kind], self._rises[rows, columns]
            if pose.yaw is not None:  # nothing of what lies is as high as this
                evidence = np.where(rises > 2.0 * shape.foot_radius + _RISEN, np.float32(-_MOST), evidence)
            elif not _as_high(rises[mask & self._open[rows, columns]], 0.5 * shape.height + shape.foot_radius):
                return _Trial(-math.inf, pose, -1.0, 0.0)
        total = float(evidence[mask].sum())
        seen = int(np.count_nonzero(self._open[rows, columns] & mask))
        return _Trial(total, pose, total / (_MOST * max(seen, 1)), seen / count)

    def _spread(self, piece: PieceLike, best: _Trial) -> tuple[_Trial, float, float]:
        """The mean pose around the best one, weighted by how well each explains the picture, and its spread."""
        pose = best.pose
        ticks = (-0.003, -0.0015, 0.0, 0.0015, 0.003)
        turns = (0.0,) if pose.yaw is None else (-0.12, -0.06, 0.0, 0.06, 0.12)
        offsets = np.array(list(itertools.product(ticks, ticks, turns)))
        scores = np.array([self._try(piece, _moved(pose, *offset)).score for offset in offsets.tolist()])
        weight = np.exp((scores - scores.max()) / _ALIKE)
        weight /= weight.sum()
        mean = weight @ offsets
        spread = np.sqrt(weight @ (offsets - mean) ** 2)
        settled = self._try(piece, _moved(pose, *mean.tolist()))
        std = float(np.hypot(np.sqrt(0.5 * (spread[0] ** 2 + spread[1] ** 2)), _FLOOR[0]))
        yaw_std = 0.0 if pose.yaw is None else float(np.hypot(spread[2], _FLOOR[1]))
        return settled, std, yaw_std

    def _spots(self, colour: Colour) -> list[tuple[float, float]]:
        """Where something looks like a piece of a side: middles of spots in the board frame [m]."""
        mean = np.asarray(cv2.boxFilter(self._maps[colour], cv2.CV_32F, (5, 5)))
        likely = ((mean > _LIKELY) & self._open).astype(np.uint8)
        count, numbers, stats, _ = cv2.connectedComponentsWithStats(likely, connectivity=8)
        half = 4.0 * self._view.table.square + _BEYOND
        spots = []
        for number in range(1, count):
            if stats[number, cv2.CC_STAT_AREA] < _LEAST_AREA:
                continue
            places = self._part.place[numbers == number].astype(float)
            for x, y in _middles(places):
                if abs(x) < half and abs(y) < half + _LEANS:
                    spots.append((x, y))
        return spots


def _as_high(rises: Field, least: float) -> bool:
    """Whether depth shows some points as high as this [m], or shows none."""
    risen = rises[rises > FLAT]
    return risen.size < _FEW or float(np.quantile(risen, _TOP)) > least


def _middles(places: Array) -> list[tuple[float, float]]:
    """Of a spot: its middle; of a long one, several along it."""
    middle = places.mean(axis=0)
    off = places - middle
    long = np.linalg.svd(off[:: max(1, len(off) // 200)], full_matrices=False)[2][0]
    along = off @ long
    low, high = np.percentile(along, [5, 95]).tolist()
    parts = max(1, round((high - low) / 0.045))
    at = [low + (2 * i + 1) * (high - low) / (2 * parts) for i in range(parts)] if parts > 1 else [0.0]
    return [(float(middle[0] + t * long[0]), float(middle[1] + t * long[1])) for t in at]


def _moved(pose: Pose, dx: float, dy: float, turn: float) -> Pose:
    return Pose(pose.x + dx, pose.y + dy, None if pose.yaw is None else pose.yaw + turn)


def _neighbours(pose: Pose, step: float, turn: float) -> list[Pose]:
    """Around a pose, along and across it, and turned; a lying one about its middle as well as about its base."""
    around = [_moved(pose, a * step, b * step, 0.0) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b]
    if pose.yaw is not None:
        for sign in (-turn, turn):
            around.append(_moved(pose, 0.0, 0.0, sign))
            half = 0.02
            dx = half * (math.cos(pose.yaw) - math.cos(pose.yaw + sign))
            dy = half * (math.sin(pose.yaw) - math.sin(pose.yaw + sign))
            around.append(_moved(pose, dx, dy, sign))
    return around
