"""One frame's fit of all expected pieces: colours learnt, places searched, outlines laid under the picture's edges."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

import cv2
import numpy as np

from hardware.interfaces import Frame
from hardware.piece_set import PIECE_SHAPES, Colour
from hardware.table import PieceSpec, Place
from vision.arrays import Array, Field, Mask, Whole
from vision.board.view import BoardView
from vision.pieces.colours import MOST, colour_bins, evidence, looked_up, shares
from vision.pieces.edges import ACROSS, Edges, along, edges_on_lines, slopes
from vision.pieces.outline import CONTOUR_POINTS, Shapes, Silhouettes, labels
from vision.pieces.surface import GROUNDS, Surface, heights, surface

SEARCH: Final = 0.010  # so far around its square's centre a piece is looked for; only least squares go further [m]
_GRIDS: Final = ((0.0025, 4), (0.001, 2))  # searches: step between places tried [m], and how many on either side
_RING: Final = 2.5  # outside an outline by so much there should be no piece [px]
_CONTRAST: Final = 12.0  # difference of brightness over a pixel at which an edge is clear [levels of 255]
_BY_REGION, _BY_CONTRAST, _BY_PLACE = 0.3, 0.5, 0.1
"""What the silhouette's inside, plain brightness and nearness to the square's centre weigh in the search, compared with
the step of evidence across the outline."""
_ROUNDS: Final = (3, 3)  # of least squares, before and after colours are learnt again from the outlines found
_ROBUST: Final = 1.2  # edges further than this from where the fitted outline has them count less [px]
_FAR: Final = 0.004  # so far from its centre, a piece's place is doubted [m]
_LONGEST: Final = 0.004  # move of one round [m]
_FIRM: Final = 1e3  # keeps a piece with no edges where it is [px²/m²]
TALL, FLAT = 0.012, 0.004  # what is higher than the first is no board; what is lower than the second may be [m]
LEAST_SUPPORT: Final = 0.15
LEAST_AGREEMENT: Final = 0.45
"""A piece that stands where it was found has more than both (measured: at least 0.31 and 0.55; where none stands, at
most -0.05 and 0.38 with depth, 0.59 and 0.50 without)."""
_SUPPORTED: Final = 0.3
_AGREED: Final = 0.55
"""With less of either a piece is in doubt (measured: of those that stand, as above; 0.24 and 0.49 of a pawn that leant
on a bishop before it)."""
_TOP: Final = 0.9  # of the points of a piece, this share is below what counts as its top: single points fly
_HIGHEST: Final = 0.08  # no piece is as high [m]
_BLUR: Final = 0.005  # depth of a standing piece is at most so much too high (measured: 4 mm of a pawn's 34) [m]
_ENOUGH: Final = 25  # with fewer points of known height a piece's is not known
_CLEAR_EDGE: Final = 0.1
_AGREES: Final = 1.5
"""An edge so near to the fitted outline agrees with it [px]."""


class Fit:
    """One frame's fit of pieces that are expected on squares, or places of trays, in a window that holds so much beside
    the board, along x and along y [m]. ``use_depth`` False: by colour alone.

    Attributes:
        part: window of the picture.
        stands: where the pieces should, in the order of all arrays.
        kinds: of the pieces.
        places: found, (n, 2) [m].
        spread: expected error of either coordinate by the scatter of edges alone, (n,) [m].
        edges: across the outlines as found.
        rises: height above the board of each pixel [m], NaN where unknown; None without depth.
        maps: how much rather each pixel is a white piece, or a black one, than ground; natural logarithm, two (h, w).
    """

    def __init__(
        self, frame: Frame, view: BoardView, expected: Mapping[Place, PieceSpec], *, use_depth: bool,
        around: tuple[float, float] = (0.0, 0.0),
    ) -> None:  # fmt: skip
        self.part: Surface = surface(view, around)
        self.stands = list(expected)
        pieces = list(expected.values())
        self._nominal = np.array([view.table.xy(place) for place in self.stands]).reshape(-1, 2)
        self.places = self._nominal.copy()
        self.kinds = [piece.kind for piece in pieces]
        self._white = np.array([piece.colour is Colour.WHITE for piece in pieces], dtype=bool)
        self._shapes = Shapes(view, self.kinds, self._nominal, self.part)
        window = frame.colour[self.part.rows, self.part.columns]
        self._bins = colour_bins(window)
        self._contrast = slopes(cv2.cvtColor(window, cv2.COLOR_RGB2GRAY).astype(np.float32))
        self.rises = heights(frame.depth, self.part) if use_depth and frame.depth is not None else None
        self.maps: tuple[Field, Field]
        none = np.zeros((0, CONTOUR_POINTS))
        self.spread, self.edges = np.zeros(0), Edges(none, none, none.astype(bool))
        self._solve()

    def _solve(self) -> None:
        if not self.stands:
            self._learn(self.silhouettes(), 0, 0)
            return
        for step, count in _GRIDS:
            seen = self.silhouettes()
            self._learn(seen, 8, 0)
            self._search(seen, step, count)
        self._refine(_ROUNDS[0])
        self._learn(self.silhouettes(), 4, 1)
        lost = (self.agreement() < LEAST_AGREEMENT) | (self.support() < LEAST_SUPPORT)
        if lost.any():  # colours are known better now
            self._search_again(lost)
        self._refine(_ROUNDS[1])
        far = np.linalg.norm(self.places - self._nominal, axis=1) > _FAR
        if far.any():
            self._start_from_centre(far)

    def _start_from_centre(self, far: Mask) -> None:
        """What was found far off may be another edge that took the outline: fit these from their centres, too.

        The place that looks more like the piece is kept. A piece that is far off does so where it stands.
        """
        found, likeness = self.places, self.likeness()
        self.places = np.where(far[:, None], self._nominal, found)
        self._refine(sum(_ROUNDS))
        better = far & (self.likeness() > likeness)
        self.places = np.where(better[:, None], self.places, found)
        self._refine(1)

    def _search_again(self, lost: Mask) -> None:
        """Look for these pieces once more, from their places' centres; the others stay."""
        kept = self.places.copy()
        self.places = np.where(lost[:, None], self._nominal, kept)
        for step, count in _GRIDS:
            self._search(self.silhouettes(), step, count)
            self.places = np.where(lost[:, None], self.places, kept)
        self._refine(_ROUNDS[0])
        self.places = np.where(lost[:, None], self.places, kept)

    def silhouettes(self) -> Silhouettes:
        """As the pieces are believed to stand now."""
        return self._shapes.at(self.places)

    def _learn(self, seen: Silhouettes, margin: int, inner: int) -> None:
        """Colours of the two sides and of the ground, from the outlines as they are believed to lie.

        Nothing is learnt about the ground within ``margin`` of them, nor about pieces within ``inner`` of their edges
        [px].
        """
        self.owner = labels(seen, self.part.ground.shape)
        taken = (self.owner > 0).astype(np.uint8)
        around = np.ones((margin + margin // 2 + 1, margin + 1), dtype=np.uint8)
        flat = cv2.dilate(taken, around) == 0
        core = (cv2.erode(taken, np.ones((2 * inner + 1, 2 * inner + 1), dtype=np.uint8)) if inner else taken) > 0
        if self.rises is not None:
            flat &= ~(self.rises > TALL)  # unknown heights are compared as false
            core &= ~(self.rises < FLAT)
        ground, bins = self.part.ground, self._bins
        grounds = [shares(bins[flat & (ground == kind)]) for kind in range(GROUNDS)]
        white = np.concatenate([[False], self._white])[self.owner]
        light, dark = shares(bins[core & white]), shares(bins[core & ~white])
        tables = evidence(light, dark, grounds), evidence(dark, light, grounds)
        self.maps = looked_up(tables[0], ground, bins), looked_up(tables[1], ground, bins)

    def _search(self, seen: Silhouettes, step: float, count: int) -> None:
        """Move each piece to the best of places in a grid around where it is believed to be."""
        ticks = step * np.arange(-count, count + 1)
        tried = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
        shift = np.einsum("nij,tj->nti", seen.jacobian, tried).astype(np.float32)

        def moved(points: Array) -> Whole:
            at = points[:, None].astype(np.float32) + shift[:, :, None]
            return np.asarray(np.rint(at).astype(np.int32))

        score = _BY_REGION * self._inside_out(seen, moved) + self._across(seen, moved)
        off = self.places[:, None] + tried - self._nominal[:, None]
        score -= _BY_PLACE * (off**2).sum(axis=2) / SEARCH**2
        self.places = self.places + tried[score.argmax(axis=1)]

    def _inside_out(self, seen: Silhouettes, moved: Callable[[Array], Whole]) -> Array:
        """Evidence inside each silhouette less that around it, (n, tried)."""
        inner = self.sampled(moved(seen.inside), self.maps).mean(axis=2)
        outer = self.sampled(moved(seen.contour + _RING * seen.normal), self.maps).mean(axis=2)
        return np.asarray((inner - outer).astype(float))

    def _across(self, seen: Silhouettes, moved: Callable[[Array], Whole]) -> Array:
        """How steeply evidence falls, and brightness changes, across each outline where it is in sight, (n, tried)."""
        at = moved(seen.contour)
        flat, counted = self._flat(at)
        normal = seen.normal[:, None].astype(np.float32)
        free = counted * self._shapes.weight[:, None].astype(np.float32)
        fall = np.empty(at.shape[:3], dtype=np.float32)
        for side, mine in enumerate((self._white, ~self._white)):
            fall[mine] = -along(slopes(self.maps[side]), flat[mine], normal[mine])
        contrast = np.abs(along(self._contrast, flat, normal)) / np.float32(_CONTRAST)
        edge = np.clip(fall, 0.0, 1.0) + np.float32(_BY_CONTRAST) * np.clip(contrast, 0.0, 1.0)
        least = 8.0  # with less of the outline in sight it says little
        return np.asarray((edge * free).sum(axis=2) / np.maximum(free.sum(axis=2), least))

    def _flat(self, at: Whole) -> tuple[Whole, Mask]:
        """Indices into the window of pixels (n, …, 2), and whether they count: within it, and of no other piece."""
        h, w = self.part.ground.shape
        u, v = at[..., 0], at[..., 1]
        within = (u >= 0) & (u < w) & (v >= 0) & (v < h)
        flat = np.where(within, v * w + u, 0)
        mine = np.arange(1, len(self.stands) + 1, dtype=np.int16).reshape((-1,) + (1,) * (flat.ndim - 1))
        owner = self.owner.ravel().take(flat)
        return flat, within & ((owner == 0) | (owner == mine))

    def sampled(self, at: Whole, maps: tuple[Field, Field]) -> Field:
        """Values of each piece's own map at whole pixels (n, …, 2); 0 on other pieces and out of the window."""
        flat, counted = self._flat(at)
        found = np.empty(flat.shape, dtype=np.float32)
        for side, mine in enumerate((self._white, ~self._white)):
            found[mine] = maps[side].ravel().take(flat[mine])
        return found * counted

    def _refine(self, rounds: int) -> None:
        """Least squares over lines across the outlines."""
        smooth = [np.asarray(cv2.GaussianBlur(one, (0, 0), 0.6), dtype=np.float32) for one in self.maps]
        for _round in range(rounds):
            seen = self.silhouettes()
            self.owner = labels(seen, self.part.ground.shape)
            self.edges = self._find_edges(seen, smooth)
            self._step(seen)

    def _find_edges(self, seen: Silhouettes, smooth: list[Field]) -> Edges:
        """Where on a line across the outline evidence falls the most."""
        at = seen.contour[:, :, None].astype(np.float32) + ACROSS[:, None] * seen.normal[:, :, None].astype(np.float32)
        value = np.empty(at.shape[:3], dtype=np.float32)
        for side, mine in enumerate((self._white, ~self._white)):
            lines = at[mine].reshape(-1, len(ACROSS), 2)
            if len(lines):
                read = cv2.remap(smooth[side], lines, None, cv2.INTER_LINEAR)  # type: ignore[call-overload]
                value[mine] = np.asarray(read).reshape(value[mine].shape)
        _, counted = self._flat(np.rint(at).astype(np.int32))
        value *= counted
        return edges_on_lines(value, counted)

    def _step(self, seen: Silhouettes) -> None:
        """One weighted Gauss-Newton step of all pieces."""
        edges = self.edges
        rows = np.einsum("nki,nij->nkj", seen.normal, seen.jacobian)
        move = np.zeros_like(self.places)
        residual = edges.offset
        for _again in range(3):
            weight = edges.sure * self._shapes.weight / (1.0 + (residual / _ROBUST) ** 2)
            weighted = weight[..., None] * rows
            normal = np.einsum("nki,nkj->nij", weighted, rows) + _FIRM * np.eye(2)
            right = np.einsum("nki,nk->ni", weighted, edges.offset)
            move = np.linalg.solve(normal, right[..., None])[..., 0]
            residual = edges.offset - np.einsum("nkj,nj->nk", rows, move)
        self.places = self.places + move / np.maximum(1.0, np.linalg.norm(move, axis=1, keepdims=True) / _LONGEST)
        variance = (weight * residual**2).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-3)
        self.spread = np.sqrt(0.5 * np.trace(np.linalg.inv(normal), axis1=1, axis2=2) * variance)

    def likeness(self) -> Array:
        """How well each piece looks like itself where it was found, support and agreement together, (n,)."""
        return np.asarray(self.support() + self.agreement())

    def support(self) -> Array:
        """Evidence over each silhouette, from -1, surely not the piece, to 1; 0 where nothing is in sight, (n,)."""
        at = np.rint(self.silhouettes().inside).astype(np.int32)
        _, counted = self._flat(at)
        mean: Array = self.sampled(at, self.maps).sum(axis=1) / np.maximum(counted.sum(axis=1), 1) / MOST
        return mean.astype(float)

    def agreement(self) -> Array:
        """Share of each outline in sight where the picture has an edge just there, (n,)."""
        edges = self.edges
        good = (edges.sure > _CLEAR_EDGE * self._shapes.weight) & (np.abs(edges.offset) < _AGREES) & edges.open
        return np.asarray(good.sum(axis=1) / np.maximum(edges.open.sum(axis=1), 1))

    def in_sight(self) -> Array:
        """Share of each outline that no other piece hides or touches, (n,)."""
        return np.asarray(self.edges.open.mean(axis=1))

    def too_low(self, support: Array, agreement: Array) -> Mask:
        """Whether depth shows each piece's silhouette, and nothing in it as high as if the piece stood, (n,).

        Half way between what stands and what lies; false where there is no depth, or too little of the piece. Of one
        that is in doubt, by its support and agreement, what is higher than the piece itself does not count: it belongs
        to what stands before it.
        """
        low = np.zeros(len(self.stands), dtype=bool)
        if self.rises is None or not self.stands:
            return low
        within = (self.owner > 0) & (self.rises > FLAT) & (self.rises < _HIGHEST)
        # heights are far below 1 m: sorted with their piece's number before the point, each piece's are together
        heights = np.sort(self.owner[within] + self.rises[within].astype(float))
        doubted = (support < _SUPPORTED) | (agreement < _AGREED)
        highest = np.array([PIECE_SHAPES[kind].height + _BLUR for kind in self.kinds])
        numbers = np.arange(1, len(self.stands) + 1)
        starts = np.searchsorted(heights, numbers)
        ends = np.searchsorted(heights, numbers + np.where(doubted, highest, 1.0))
        for index, kind in enumerate(self.kinds):
            first, count = starts[index], ends[index] - starts[index]
            if count >= _ENOUGH:
                below, part = divmod(_TOP * (count - 1), 1.0)
                lower, upper = heights[first + int(below)], heights[first + min(int(below) + 1, count - 1)]
                shape, top = PIECE_SHAPES[kind], lower + part * (upper - lower) - (index + 1)
                low[index] = top < 0.5 * (shape.height + 2.0 * shape.foot_radius)
        return low
