"""Where exactly each piece stands: its outline, known from the table settings, laid over the picture.

How: colours of pieces and board are learnt from the frame itself (``vision.colours``). Each piece's silhouette is
tried at places around its square's centre, then moved until the picture's outline lies under the known one, by least
squares over many short lines across the outline. What another piece hides does not count.

Depth, where there is any, helps to find the rough place. The last bit is by colour alone: depth pictures are fat at edges.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from hardware.interfaces import Frame
from hardware.table import Colour, Kind, square_place
from vision.colours import MOST, colour_bins, evidence, looked_up, shares
from vision.board import BoardView
from vision.silhouettes import Shapes, Silhouettes, labels
from vision.surface import GROUNDS, Surface, heights, surface

Array = NDArray[np.float64]
Field = NDArray[np.float32]

from typing import Any
import os
KG=float(os.environ.get('KG','0.5'))
KR=float(os.environ.get('KR','0.3'))
KD=float(os.environ.get('KD','0.3'))
KP=float(os.environ.get('KP','0.1'))
KE=float(os.environ.get('KE','0.0'))
STEPS=int(os.environ.get('STEPS','4'))
PEN=float(os.environ.get('PEN','0.05'))
VAR=int(os.environ.get('VAR','0'))
SEARCH: Final = 0.010
"""A piece is looked for so far around its square's centre [m], and found further away only by the last bit."""
_GRID: Final = 5
"""Places tried on either side of the centre."""
_RING: Final = 2.5
"""Outside an outline by so much there should be no piece [px]."""
_HALF_LINE: Final = 5.0
_LINE_STEP: Final = 0.5
"""Lines across the outline reach so far to both sides and are sampled so closely [px]."""
_ROUNDS: Final = 4
_ROBUST: Final = 1.2
"""Edges further than this from where the fitted outline has them count less [px]."""
_LEAST_SEEN: Final = 0.25
"""With less of its outline in sight, a piece's place is as good as unknown."""
_TALL: Final = 0.012
"""What is higher than this above the board is no board [m]."""
_FLAT: Final = 0.004
"""What is lower than this may be [m]."""
_BY_DEPTH: Final = 2.0
"""How much a pixel's height decides, like ``colours.MOST``."""
FLOOR: Final = 0.0002
"""No place is known better than this: shapes are not exact [m]."""


class PieceLike(Protocol):
    """What has to be known of a piece; ``hardware.table.PieceSpec`` is one."""

    @property
    def kind(self) -> Kind:
        """Its shape."""

    @property
    def colour(self) -> Colour:
        """Its side."""


@dataclass(frozen=True, slots=True)
class Centre:
    """Where a piece's foot stands.

    Attributes:
        x: of its centre in the board frame [m].
        y: of its centre in the board frame [m].
        std: expected error of either, as a standard deviation [m].
        support: how much of what is in sight of the silhouette looks like the piece, 0 to 1.
        seen: share of the outline that is in sight, 0 to 1.
        upright: whether a standing piece of this kind explains the picture; else it is missing, fallen or hidden.
    """

    x: float
    y: float
    std: float
    support: float
    seen: float
    upright: bool


def piece_centres(
    frame: Frame, view: BoardView, expected: Mapping[int, PieceLike], *, use_depth: bool = True
) -> dict[int, Centre]:
    """Centres of all expected pieces.

    Args:
        frame: by the camera of the view, without a hand or an arm over the board.
        view: of the board.
        expected: what stands where, by square (0 = a1 … 63 = h8). All pieces have to be named, since they hide each
            other and colours are learnt from them.
        use_depth: False: by colour alone, also where there is depth.

    Raises:
        ValueError: the frame is by another camera, or the board is not in the picture.
    """
    if frame.intrinsics != view.intrinsics:
        raise ValueError(f"the frame is by a camera with {frame.intrinsics}, this view is of {view.intrinsics}")
    if not expected:
        return {}
    return Fit(frame, view, expected, use_depth=use_depth).centres()


class Fit:
    """One frame's fit of all expected pieces.

    Attributes:
        part: window of the picture.
        squares: of the pieces, in the order of all arrays.
        places: (n, 2) [m].
        rises: height above the board of each pixel [m], NaN where unknown; None without depth.
    """

    def __init__(self, frame: Frame, view: BoardView, expected: Mapping[int, PieceLike], *, use_depth: bool) -> None:
        self.part: Surface = surface(view)
        self.squares = list(expected)
        pieces = [expected[square] for square in self.squares]
        self._nominal = np.array([view.table.xy(square_place(square)) for square in self.squares])
        self.places = self._nominal.copy()
        self._white = np.array([piece.colour is Colour.WHITE for piece in pieces])
        self._shapes = Shapes(view, [piece.kind for piece in pieces], self._nominal, self.part)
        self._bins = colour_bins(frame.colour[self.part.rows, self.part.columns])
        self._grey = cv2.cvtColor(frame.colour[self.part.rows, self.part.columns], cv2.COLOR_RGB2GRAY).astype(np.float32)
        self.rises = heights(frame.depth, self.part) if use_depth and frame.depth is not None else None
        self._solve()

    def _solve(self) -> None:
        seen = self._shapes.at(self.places)
        self._learn(seen)
        self._search(seen, SEARCH / _GRID, _GRID)
        seen = self._shapes.at(self.places)
        self._learn(seen)
        self._search(seen, SEARCH / _GRID / 2.0, 2)
        self._refine()
        self._learn(self._shapes.at(self.places), 5, 1)
        self._refine()

    # ------------------------------------------------------------------------------------------------- colours

    def _learn(self, seen: Silhouettes, margin: int = 9, erode: int = 0) -> None:
        """Colours of the two sides and of the ground, from the outlines as they are believed to lie."""
        owner = labels(seen, self.part.ground.shape)
        self._owner = owner
        near = cv2.dilate((owner > 0).astype(np.uint8), np.ones((margin + margin // 2, margin), dtype=np.uint8)) > 0
        flat = ~near
        core = owner > 0
        if erode:
            core = cv2.erode(core.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        if self.rises is not None:
            with np.errstate(invalid="ignore"):
                flat &= ~(self.rises > _TALL)
                core &= ~(self.rises < _FLAT)
        ground, bins = self.part.ground, self._bins
        grounds = [shares(bins[flat & (ground == kind)]) for kind in range(GROUNDS)]
        white = np.concatenate([[False], self._white])[owner]
        light, dark = shares(bins[core & white]), shares(bins[core & ~white])
        tables = evidence(light, dark, grounds), evidence(dark, light, grounds)
        self._maps: list[Field] = [looked_up(table, ground, bins) for table in tables]

    # -------------------------------------------------------------------------------------------------- search

    def _search(self, seen: Silhouettes, step: float, count: int) -> None:
        """Move each piece to the best of places in a grid around where it is believed to be."""
        ticks = step * np.arange(-count, count + 1)
        tried = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
        shift = np.einsum("nij,tj->nti", seen.jacobian, tried)

        def moved(points: Array) -> NDArray[np.int32]:
            return np.rint(points[:, None] + shift[:, :, None]).astype(np.int32)

        maps = np.stack(self._maps)
        region = self._sample(moved(seen.inside), maps).mean(axis=2)
        region -= self._sample(moved(seen.contour + _RING * seen.normal), maps).mean(axis=2)
        at = moved(seen.contour)
        slope = np.stack([self._along(at, self._slopes(one), seen.normal) for one in self._maps])
        slope = np.where(self._white[:, None, None], slope[0], slope[1])
        colour = np.abs(self._along(at, self._slopes(self._grey), seen.normal))
        free = self._sample(at, np.ones_like(maps)) * self._shapes.weight[:, None].astype(np.float32)
        edge = np.clip(-slope, 0.0, 1.0) + KG * np.clip(colour / 12.0, 0.0, 1.0)
        score = KR * region + (edge * free).sum(axis=2) / np.maximum(free.sum(axis=2), 8.0)
        if self.rises is not None and KD:
            score = score + KD * self._by_depth(moved, seen)
        off = self.places[:, None] + tried - self._nominal[:, None]
        score = score - KP * (off**2).sum(axis=2) / SEARCH**2
        self.places = self.places + tried[np.arange(len(score))[:, None], score.argmax(axis=1)[:, None]][:, 0] if False else self.places + tried[score.argmax(axis=1)]

    def _by_depth(self, moved: Any, seen: Silhouettes) -> Field:
        tall = np.clip((np.nan_to_num(self.rises, nan=0.010) - 0.010) / 0.004, -1.0, 1.0).astype(np.float32)
        both = np.stack([tall, tall])
        inner = self._sample(moved(seen.inside), both) * self._shapes.tall[:, None]
        outer = self._sample(moved(seen.contour + 6.0 * seen.normal), both)
        return inner.sum(axis=2) / np.maximum(self._shapes.tall.sum(axis=1)[:, None], 1) - outer.mean(axis=2)

    def _slopes(self, one: Field) -> tuple[Field, Field]:
        smooth = cv2.GaussianBlur(one, (0, 0), 0.8)
        return cv2.Sobel(smooth, cv2.CV_32F, 1, 0, scale=0.125), cv2.Sobel(smooth, cv2.CV_32F, 0, 1, scale=0.125)

    def _along(self, at: NDArray[np.int32], slopes: tuple[Field, Field], normal: Array) -> Field:
        h, w = self.part.ground.shape
        flat = np.clip(at[..., 1], 0, h - 1) * w + np.clip(at[..., 0], 0, w - 1)
        n = normal[:, None].astype(np.float32)
        return slopes[0].ravel().take(flat) * n[..., 0] + slopes[1].ravel().take(flat) * n[..., 1]

    def _sample(self, at: NDArray[np.int32], maps: Field) -> Field:
        """Values of each piece's own map at whole pixels (n, …, 2); 0 on other pieces and out of the window."""
        h, w = self.part.ground.shape
        u, v = at[..., 0], at[..., 1]
        within = (u >= 0) & (u < w) & (v >= 0) & (v < h)
        flat = np.where(within, v * w + u, 0)
        shape = (-1,) + (1,) * (flat.ndim - 1)
        side = (~self._white).astype(np.int32).reshape(shape)
        mine = np.arange(1, len(self.squares) + 1, dtype=np.int16).reshape(shape)
        owner = self._owner.ravel().take(flat)
        counted = within & ((owner == 0) | (owner == mine))
        found: Field = np.where(counted, maps.ravel().take(flat + side * (h * w)), np.float32(0.0))
        return found

    # -------------------------------------------------------------------------------------------------- refine

    def _refine(self) -> None:
        """Least squares over lines across the outlines, a few rounds."""
        reach = np.arange(-_HALF_LINE, _HALF_LINE + 1e-9, _LINE_STEP)
        self._blurred = [np.asarray(cv2.GaussianBlur(one, (0, 0), 0.6), dtype=np.float32) for one in self._maps]
        for _round in range(_ROUNDS):
            seen = self._shapes.at(self.places)
            self._owner = labels(seen, self.part.ground.shape)
            offset, sure = self._edges(seen, reach)
            self._step(seen, offset, sure)

    def _edges(self, seen: Silhouettes, reach: Array) -> tuple[Array, Array]:
        """How far outside of each contour point the picture's edge lies [px], and how sure that is: (n, points)."""
        at = seen.contour[:, :, None] + reach[:, None] * seen.normal[:, :, None]
        value = np.empty(at.shape[:3], dtype=np.float32)
        for side, pieces in enumerate((self._white, ~self._white)):
            u, v = at[pieces][..., 0].astype(np.float32), at[pieces][..., 1].astype(np.float32)
            count = len(u)
            if count:
                flat = (count * u.shape[1], u.shape[2])
                value[pieces] = np.asarray(
                    cv2.remap(self._blurred[side], u.reshape(flat), v.reshape(flat), cv2.INTER_LINEAR)
                ).reshape(u.shape)
        flat = (value.shape[0] * value.shape[1], value.shape[2])
        grey = cv2.remap(self._grey, at[..., 0].astype(np.float32).reshape(flat), at[..., 1].astype(np.float32).reshape(flat), cv2.INTER_LINEAR).reshape(value.shape)
        hidden = self._sample(np.rint(at).astype(np.int32), np.full((2, *self.part.ground.shape), 1.0, np.float32)) == 0
        value[hidden] = 0.0
        before = np.cumsum(value, axis=2)
        n = STEPS
        padded = np.concatenate([np.zeros_like(before[:, :, :1]), before], axis=2)
        inner = padded[:, :, n:-n] - padded[:, :, : -2 * n]
        outer = padded[:, :, 2 * n :] - padded[:, :, n:-n]
        g = np.cumsum(np.concatenate([np.zeros_like(grey[:, :, :1]), grey], axis=2), axis=2)
        contrast = np.abs(2.0 * g[:, :, n:-n] - g[:, :, : -2 * n] - g[:, :, 2 * n :]) / n
        split = (inner - outer) / n + KE * np.clip(contrast / 25.0, 0.0, 1.0) # edge between samples k-1 and k, k = n .. len-n
        place = reach[0] + _LINE_STEP * (np.arange(n, len(reach) - n + 1) - 0.5)
        score = split - PEN * place**2
        best = np.clip(score.argmax(axis=2), 1, score.shape[2] - 2)
        take = np.arange(len(value))[:, None], np.arange(value.shape[1])[None, :]
        low, top, high = score[*take, best - 1], score[*take, best], score[*take, best + 1]
        curve = low - 2.0 * top + high
        part = np.where(curve < -1e-6, 0.5 * (low - high) / np.where(curve < -1e-6, curve, 1.0), 0.0)
        offset = place[best] + _LINE_STEP * np.clip(part, -1.0, 1.0)
        sure = np.clip(split[*take, best] - 0.5, 0.0, 3.0) / 3.0
        self._sight = 1.0 - hidden.mean(axis=(1, 2))
        blocked = hidden[:, :, len(reach) // 2 - 3 : len(reach) // 2 + 4].any(axis=2)
        self._offset, self._sure, self._open = offset, sure, ~blocked
        return offset, np.where(blocked, 0.0, sure) * self._shapes.weight

    def _step(self, seen: Silhouettes, offset: Array, sure: Array) -> None:
        """One weighted Gauss-Newton step of all pieces."""
        rows = np.einsum("nki,nij->nkj", seen.normal, seen.jacobian)
        for _again in range(3):
            if _again == 0:
                residual = offset
            else:
                residual = offset - np.einsum("nkj,nj->nk", rows, move)
            weight = sure / (1.0 + (residual / _ROBUST) ** 2)
            normal = np.einsum("nk,nki,nkj->nij", weight, rows, rows) + np.eye(2) * 1e3
            right = np.einsum("nk,nki,nk->ni", weight, rows, offset)
            move = np.linalg.solve(normal, right[..., None])[..., 0]
        limit = np.maximum(1.0, np.linalg.norm(move, axis=1, keepdims=True) / 0.004)
        self.places = self.places + move / limit
        self._normal, self._residual, self._weight = normal, residual, weight

    def features(self):
        seen = self._shapes.at(self.places)
        at = np.rint(seen.inside).astype(np.int32)
        free = self._sample(at, np.ones((2, *self.part.ground.shape), np.float32))
        value = self._sample(at, np.stack(self._maps))
        region = value.sum(axis=1) / np.maximum(free.sum(axis=1), 1) / MOST
        if self.rises is not None:
            known = self._sample(at, np.stack([np.isfinite(self.rises)] * 2).astype(np.float32)) * self._shapes.tall
            tall = self._sample(at, np.stack([np.nan_to_num(self.rises) > 0.009] * 2).astype(np.float32)) * self._shapes.tall
            tallshare = tall.sum(axis=1) / np.maximum(known.sum(axis=1), 1); n = known.sum(axis=1)
        else:
            tallshare, n = np.full(len(region), np.nan), np.zeros(len(region))
        rows = np.einsum("nki,nij->nkj", seen.normal, seen.jacobian)
        good = (self._sure > 0.1 * self._shapes.weight) & (np.abs(self._offset) < 1.5) & self._open
        edges = good.sum(axis=1) / np.maximum(self._open.sum(axis=1), 1)
        cov = np.linalg.inv(self._normal)
        s2 = (self._weight * self._offset**2).sum(axis=1) / np.maximum(self._weight.sum(axis=1), 1e-3)
        std = np.sqrt(0.5 * np.trace(cov, axis1=1, axis2=2) * s2)
        return region, tallshare, n, edges, self._open.mean(axis=1), free.mean(axis=1), std, self._sure.mean(axis=1)

    def centres(self) -> dict[int, Centre]:
        return {
            square: Centre(float(x), float(y), 0.0, 1.0, float(s), True)
            for square, (x, y), s in zip(self.squares, self.places, self._sight, strict=True)
        }
