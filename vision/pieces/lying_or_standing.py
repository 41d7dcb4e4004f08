"""The search for pieces in a picture that do not stand where they should: poses of silhouettes, lying or standing.

What looks like a piece, by its colours and by depth where there is any, is explained by the silhouettes of the missing
ones: the pose that takes up the most evidence, with the least that speaks against it, is the one. With depth, the
points that a pose covers have to be on the piece's surface. What standing pieces hide says nothing.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np

from hardware.piece_set import PIECE_SHAPES, Colour, Kind
from hardware.table import PieceSpec, Place
from vision.arrays import Field, Mask
from vision.board.view import BoardView
from vision.pieces.fit import FLAT, Fit
from vision.pieces.poses import Pose, PoseTrial, apart, drawn, middles, moved, neighbours, off_surface

_RISEN: Final = 0.006  # what rises higher above the board is no board [m]
_BY_DEPTH: Final = 2.0  # evidence of a pixel's height, either way (natural logarithm of the ratio)
_FAT: Final = 9  # depth pictures are fat at edges: so wide around pieces that stand, depth may be theirs [px]
_OFF: Final = 0.006  # a point so far from a piece's surface speaks neither for it nor against it [m]
_FAR: Final = 1.25
"""… and one that is far off speaks against it by this share of the evidence of its height, less that evidence: edges of
depth pictures err by centimetres."""
_HIGH: Final = 25  # so many pixels that are higher than a lying piece decide that it stands, if that explains anything
_BLUR: Final = 2.5  # … or so many times as far where poses are tried that are far apart
_LEAST_AREA: Final = 60  # smaller spots are noise [px]
_LIKELY: Final = 0.6  # evidence, on average over some pixels, of what is worth a closer look
_COARSE_YAWS: Final = 12
_COARSE_STEP: Final = 0.010
"""Places are tried so far apart around a spot [m] …"""
_COARSE: Final = 2  # … so many on either side …
_KEPT, _CLOSER = 6, 2  # … and so many of the best are looked at more closely, then so many of those again …
_STEPS: Final = ((0.004, 0.20), (0.002, 0.10), (0.001, 0.05), (0.0005, 0.025))
"""Finer and finer steps of place [m] and direction [rad]."""
_LEAST_SUPPORT: Final = 0.30  # mean evidence over a silhouette, as a share of the most, by which a piece is there
_LEAST_SEEN: Final = 0.35  # with less of its silhouette in sight a pose is a guess
_ALIKE: Final = 60.0  # neighbouring pixels err alike: so many count as one (measured over rendered tables)
_MOST: Final = 2.5
_STAYED: Final = 150.0
"""Evidence that a piece is where it was before; …"""
_STRAYED: Final = 0.06  # … less and less of it up to so far from there [m]
_AT_HOME: Final = 100.0
"""Evidence that what stands no further from where a piece was than ``_NEAR_HOME`` [m] is that piece: pieces are shifted
more often than another one comes to stand in their place (assumed). Rook and knight differ by 100 to 200."""
_NEAR_HOME: Final = 0.012
_FLOOR: Final = 0.0005  # nothing is known better than this: shapes are not exact [m]
"""Nothing is known better than this: shapes are not exact [m, rad]."""


@dataclass(frozen=True, slots=True)
class MisplacedPiece:
    """A piece that is not where it should stand."""

    piece: PieceSpec  # which of the missing ones; of several alike, the first
    target: Place  # where it should stand
    pose: Pose  # how it is there
    std: float = 0.0  # expected error of its place, as a standard deviation, each of x and y [m]
    support: float = 0.0  # mean evidence over its silhouette, of the most there can be, -1 to 1
    seen: float = 0.0  # share of its silhouette that nothing hides
    lead: float = 0.0
    """Evidence by which this piece in this way, lying or standing, explains more than the next best of the missing ones
    would in any, as a share of its own; 0 where another one does as well."""

    @property
    def lies(self) -> bool:
        """Whether it has fallen."""
        return self.pose.yaw is not None


class PoseSearch:
    """Explains what one frame shows beside the pieces that stand as expected, to which ``fit`` and the pixels ``taken``
    of its window belong.

    Pieces are looked for so far ``around`` the board, along x and along y [m]. ``points``: that pixels show, board
    frame (h, w, 3) [m]; None without depth.
    """

    def __init__(
        self, fit: Fit, view: BoardView, taken: Mask, around: tuple[float, float], points: Field | None
    ) -> None:
        self._made_of = fit, view, taken, around, points
        self._ways: dict[tuple[Kind, Colour], list[PoseTrial]] = {}  # the best ways that were found, by kind and colour
        self._view, self._part = view, fit.part
        self._shape = fit.part.ground.shape[0], fit.part.ground.shape[1]
        self._origin = int(fit.part.columns.start), int(fit.part.rows.start)
        self._half = tuple(4.0 * view.table.square + beside for beside in around)
        beyond = (np.abs(fit.part.place) > self._half).any(axis=-1)
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
        hidden = cv2.dilate(taken.astype(np.uint8), kernel) > 0
        self._open = ~(hidden | beyond | _boxes(view, self._shape, self._origin))
        self._maps: dict[Colour, Field] = {}
        for colour, by_colour in zip((Colour.WHITE, Colour.BLACK), fit.maps, strict=True):
            evidence = by_colour.astype(np.float32)
            if fit.rises is not None:
                risen = np.where(fit.rises > _RISEN, np.float32(_BY_DEPTH), np.float32(0.0))
                flat = np.where(fit.rises < FLAT, np.float32(-_BY_DEPTH), np.float32(0.0))
                evidence = 0.5 * evidence + risen + flat
            self._maps[colour] = np.clip(evidence, -_MOST, _MOST) * self._open
        self._rises = fit.rises
        self._below = fit.part.place
        """The point of the board straight below what each pixel shows, as far as that is known [m]."""
        if fit.rises is not None and points is not None:
            self._points = points
            self._below = np.where(np.isfinite(self._points[..., :2]), self._points[..., :2], self._below)
            fat = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_FAT, _FAT))
            self._solid = self._open & (fit.rises > _RISEN) & (cv2.dilate(taken.astype(np.uint8), fat) == 0)
        self._felt: Field = np.maximum(*self._maps.values())

    def best(
        self, missing: Sequence[tuple[Place, PieceSpec]], before: Mapping[Place, tuple[float, float]]
    ) -> MisplacedPiece | None:
        """The missing piece that explains the most, and is likely to be there, or None if none explains anything.

        Larger pieces explain more: what looks most like a rook in a pawn's place is likelier that pawn.
        """
        alike = {(piece.kind, piece.colour): (place, piece) for place, piece in reversed(missing)}
        for key, (_, piece) in alike.items():
            if key not in self._ways:
                self._ways[key] = self._of_piece(piece)
        likely = {
            (key, way.pose): way.score + max(
                self._likely(place, way.pose, before) for place, piece in missing if (piece.kind, piece.colour) == key
            )
            for key in alike for way in self._ways[key]
        }  # fmt: skip
        trials = [(key, self._ways[key]) for key in alike if self._ways[key]]
        ranked = sorted(trials, key=lambda t: -likely[t[0], t[1][0].pose])
        for key, ways in ranked:
            best = ways[0]
            if not _is_there(best):
                continue
            others = [likely[other, way.pose] for other, more in ranked for way in more[: 1 if other != key else 2]
                      if way is not best]  # fmt: skip
            lead = max(0.0, 1.0 - max([0.0, *others]) / likely[key, best.pose])
            place, piece = alike[key]
            best, std = self._spread(piece, best)
            return MisplacedPiece(piece, place, best.pose, std, best.support, best.seen, lead)
        return None

    def standing_about(self, piece: PieceSpec, place: Place, at: tuple[float, float]) -> MisplacedPiece | None:
        """A piece of a place as it stands near a point [m], if depth shows it so; not compared with other ways."""
        way = self._near(piece, Pose(*at))
        if not (_is_there(way) and self._is_high(piece, way.pose)):
            return None
        way, std = self._spread(piece, way)
        return MisplacedPiece(piece, place, way.pose, std, way.support, way.seen, 1.0)

    def again(self) -> PoseSearch:
        """The same with nothing taken out."""
        return PoseSearch(*self._made_of)

    def told_apart(
        self, found: list[MisplacedPiece], before: Mapping[Place, tuple[float, float]]
    ) -> list[MisplacedPiece]:
        """Of pieces of one side that were found one after the other, each might as well be the other: both are tried.

        The greedy search takes first whatever explains the most, and a larger piece explains more. Together, two pieces
        explain the most where each is itself. A piece that was not far from there before is likely to be the one.
        """
        found = list(found)
        for i, j in itertools.combinations(range(len(found)), 2):
            one, other = found[i], found[j]
            if one.piece.colour is not other.piece.colour:
                continue
            if one.piece.kind is other.piece.kind:
                if self._far(one, other, before) + self._far(other, one, before) < (
                    self._far(one, one, before) + self._far(other, other, before)
                ):
                    found[i] = replace(one, piece=other.piece, target=other.target)
                    found[j] = replace(other, piece=one.piece, target=one.target)
                continue
            as_is = self._near(one.piece, one.pose), self._near(other.piece, other.pose)
            swapped = self._near(one.piece, other.pose), self._near(other.piece, one.pose)
            pair = one.piece, other.piece
            gain = self._together(pair, swapped) - self._together(pair, as_is)
            gain += sum(self._likely(stray.target, other.pose, before) - self._likely(stray.target, stray.pose, before)
                        for stray, other in ((one, other), (other, one)))  # fmt: skip
            lead = abs(gain) / max(1.0, *(trial.score for trial in (*as_is, *swapped)))
            ways = swapped if gain > 0.0 else as_is
            for at, stray, trial in ((i, one, ways[0]), (j, other, ways[1])):
                best, std = self._spread(stray.piece, trial) if gain > 0.0 else (trial, stray.std)
                pose = best.pose if gain > 0.0 else stray.pose
                found[at] = replace(
                    stray, pose=pose, std=std, support=best.support, seen=best.seen, lead=min(stray.lead, lead)
                )
        return found

    def _far(self, piece: MisplacedPiece, at: MisplacedPiece, before: Mapping[Place, tuple[float, float]]) -> float:
        """From where a piece was before, or should stand, to where another was found [m]."""
        return math.dist(before.get(piece.target, self._view.table.xy(piece.target)), (at.pose.x, at.pose.y))

    def _likely(self, target: Place, pose: Pose, before: Mapping[Place, tuple[float, float]]) -> float:
        """Evidence for a pose by where the piece of a place was before, or where it should stand."""
        was = before.get(target, self._view.table.xy(target))
        away = math.dist(was, (pose.x, pose.y))
        at_home = _AT_HOME if pose.yaw is None and away <= _NEAR_HOME else 0.0
        return at_home + _STAYED * max(0.0, 1.0 - away / _STRAYED)

    def _near(self, piece: PieceSpec, pose: Pose) -> PoseTrial:
        """The best way for a piece to be about there, lying or standing as in a pose."""
        return self._climb(piece, self._try(piece, pose), _STEPS)

    def take_out(self, stray: MisplacedPiece) -> None:
        """What this one explains is explained."""
        seen = drawn(stray.piece.kind, stray.pose, self._view, self._shape, self._origin)
        fat = cv2.dilate(seen.mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        for field in (*self._maps.values(), self._felt, self._open):
            field[seen.rows, seen.columns][fat] = 0
        if self._rises is not None:
            self._solid &= self._open
        gone = np.zeros(self._shape, dtype=bool)
        gone[seen.rows, seen.columns] = fat
        # what else was found stays as it is where nothing of it is gone
        self._ways = {key: ways for key, ways in self._ways.items() if not self._meets(key[0], ways, gone)}

    def _meets(self, kind: Kind, ways: list[PoseTrial], gone: Mask) -> bool:
        drawings = (drawn(kind, way.pose, self._view, self._shape, self._origin) for way in ways)
        return any(bool((gone[one.rows, one.columns] & one.mask).any()) for one in drawings)

    def _of_piece(self, piece: PieceSpec) -> list[PoseTrial]:
        """The best way for it to lie and to stand, the better one first; none where nothing looks like its side."""
        spots = self._spots(piece.colour)
        lying, standing = list[PoseTrial](), list[PoseTrial]()
        reach = 0.5 * PIECE_SHAPES[piece.kind].height
        grid = [_COARSE_STEP * i for i in range(-_COARSE, _COARSE + 1)]
        # what stands before it may have left but its foot or its head in sight: any part of it may be at the spot
        parts = math.ceil(reach / _COARSE_STEP)
        along = [_COARSE_STEP * i for i in range(-parts, parts + 1)]
        for x, y in spots:
            standing += [self._try(piece, Pose(x + dx, y + dy), _BLUR) for dx, dy in itertools.product(grid, grid)]
            for number in range(_COARSE_YAWS):
                yaw = 2.0 * math.pi * number / _COARSE_YAWS
                cos, sin = math.cos(yaw), math.sin(yaw)
                lying += [
                    self._try(
                        piece,
                        Pose(x + a * cos - b * sin - reach * cos, y + a * sin + b * cos - reach * sin, yaw),
                        _BLUR,
                    )
                    for a, b in itertools.product(along, grid[1:-1])
                ]
        ways = [self._climbed(piece, some) for some in (lying, standing) if some]
        ways.sort(key=_rank, reverse=True)
        if len(ways) > 1 and ways[1].pose.yaw is None:
            (lies, stands), height = (way.pose for way in ways), PIECE_SHAPES[piece.kind].height
            # what is high elsewhere is something else
            if math.dist((lies.x, lies.y), (stands.x, stands.y)) <= height and self._is_high(piece, stands):
                ways.reverse()
        return ways

    def _is_high(self, piece: PieceSpec, pose: Pose) -> bool:
        """Whether depth shows what would be the upper half of a piece that stands, higher than any that lies."""
        if self._rises is None:
            return False
        rows, columns, mask, _ = drawn(piece.kind, pose, self._view, self._shape, self._origin)
        rises = self._rises[rows, columns][mask & self._solid[rows, columns]]
        shape = PIECE_SHAPES[piece.kind]
        high = np.count_nonzero((rises > 2.0 * shape.foot_radius + _RISEN) & (rises < shape.height + _RISEN))
        return bool(high >= _HIGH)

    def _climbed(self, piece: PieceSpec, trials: list[PoseTrial]) -> PoseTrial:
        """From the best of some, step by step to the best near them."""
        near = [self._climb(piece, self._try(piece, one.pose), _STEPS[:2]) for one in apart(trials, _KEPT)]
        return max((self._climb(piece, one, _STEPS) for one in apart(near, _CLOSER)), key=_rank)

    def _climb(self, piece: PieceSpec, trial: PoseTrial, steps: Sequence[tuple[float, float]]) -> PoseTrial:
        for step, turn in steps:
            for _ in range(20):
                around = (self._try(piece, pose) for pose in neighbours(trial.pose, step, turn))
                better = max(around, key=lambda one: one.score)
                if better.score <= trial.score:
                    break
                trial = better
        return trial

    def _try(self, piece: PieceSpec, pose: Pose, blur: float = 1.0) -> PoseTrial:
        """How well a pose explains the picture; ``blur``: points may be so many times further off the surface."""
        rows, columns, mask, evidence = self._evidence(piece, pose, blur)
        count = int(np.count_nonzero(mask))
        if not count:
            return PoseTrial(-math.inf, pose, -1.0, 0.0)
        total = float(evidence[mask].sum())
        seen = int(np.count_nonzero(self._open[rows, columns] & mask))
        return PoseTrial(total, pose, total / (_MOST * max(seen, 1)), seen / count)

    def _together(self, pieces: tuple[PieceSpec, PieceSpec], ways: tuple[PoseTrial, PoseTrial]) -> float:
        """What two explain: each pixel that both would cover is of the one that explains it better; -inf where one is
        out of the picture.
        """
        if min(way.score for way in ways) == -math.inf:
            return -math.inf
        best = np.full(self._shape, np.nan, dtype=np.float32)
        for piece, way in zip(pieces, ways, strict=True):
            rows, columns, mask, evidence = self._evidence(piece, way.pose)
            best[rows, columns] = np.fmax(best[rows, columns], np.where(mask, evidence, np.nan))
        return float(np.nansum(best))

    def _evidence(self, piece: PieceSpec, pose: Pose, blur: float = 1.0) -> tuple[slice, slice, Mask, Field]:
        """What speaks for a pose, and against it, at each pixel of its silhouette, in rows and columns around that."""
        rows, columns, mask, felt = drawn(piece.kind, pose, self._view, self._shape, self._origin)
        evidence: Field = np.where(felt, self._felt[rows, columns], self._maps[piece.colour][rows, columns])
        if self._rises is not None:
            shape, rises = PIECE_SHAPES[piece.kind], self._rises[rows, columns]
            seen_at = mask & self._solid[rows, columns]
            off = off_surface(self._points[rows, columns][seen_at], piece.kind, pose)
            evidence[seen_at] -= _BY_DEPTH * np.minimum((off / (blur * _OFF)) ** 2, _FAR)
            if pose.yaw is not None:  # nothing of what lies is as high as this
                evidence[seen_at & (rises > 2.0 * shape.foot_radius + _RISEN)] = -_MOST
        return rows, columns, mask, evidence

    def _spread(self, piece: PieceSpec, best: PoseTrial) -> tuple[PoseTrial, float]:
        """The mean pose around the best one, weighted by how well each explains the picture; its place's spread [m]."""
        pose = best.pose
        ticks = (-0.003, -0.0015, 0.0, 0.0015, 0.003)
        turns = (0.0,) if pose.yaw is None else (-0.12, -0.06, 0.0, 0.06, 0.12)
        offsets = np.array(list(itertools.product(ticks, ticks, turns)))
        scores = np.array([self._try(piece, moved(pose, *offset)).score for offset in offsets.tolist()])
        weight = np.exp((scores - scores.max()) / _ALIKE)
        weight /= weight.sum()
        mean = weight @ offsets
        spread = np.sqrt(weight @ (offsets - mean) ** 2)
        settled = self._try(piece, moved(pose, *mean.tolist()))
        std = float(np.hypot(np.sqrt(0.5 * (spread[0] ** 2 + spread[1] ** 2)), _FLOOR))
        return settled, std

    def _spots(self, colour: Colour) -> list[tuple[float, float]]:
        """Where something looks like a piece of a side: middles of spots in the board frame [m]."""
        mean = np.asarray(cv2.boxFilter(self._maps[colour], cv2.CV_32F, (5, 5)))
        likely = ((mean > _LIKELY) & self._open).astype(np.uint8)
        count, numbers, stats, _ = cv2.connectedComponentsWithStats(likely, connectivity=8)
        spots = []
        for number in range(1, count):
            if stats[number, cv2.CC_STAT_AREA] < _LEAST_AREA:
                continue
            places = self._below[numbers == number].astype(float)
            for x, y in middles(places):
                if abs(x) < self._half[0] and abs(y) < self._half[1]:
                    spots.append((x, y))
        return spots


def _is_there(way: PoseTrial) -> bool:
    """Whether enough speaks for a piece in this way, and enough of it would be in sight."""
    return way.support >= _LEAST_SUPPORT and way.seen >= _LEAST_SEEN


def _rank(way: PoseTrial) -> tuple[bool, float]:
    """The greater, the better a way explains the picture; rather than what is hardly in sight, one that is there."""
    return _is_there(way), way.score


def _boxes(view: BoardView, shape: tuple[int, int], origin: tuple[int, int]) -> Mask:
    """Where boxes are in a part of the picture, with all that may lie in them."""
    seen = np.zeros(shape, dtype=np.uint8)
    for box in view.table.boxes():
        half_x, half_y, top = box.half_x + box.wall, box.half_y + box.wall, max(box.height, view.table.box_fill)
        corners = [(box.x + i * half_x, box.y + j * half_y, h) for i in (-1, 1) for j in (-1, 1) for h in (0.0, top)]
        pixels = np.rint(view.project(corners) - np.array(origin, dtype=float)).astype(np.int32)
        cv2.fillConvexPoly(seen, cv2.convexHull(pixels), 1)
    return seen.astype(bool)
