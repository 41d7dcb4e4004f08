"""Which pieces stand where, when nobody knows anything yet: any position, put on the board by a person.

First roughly: what rises from the board, as high as which kind, of the lighter half or the darker. That is taken for
what should stand there, so that colours and places are learnt as in any other picture; and looked at once more. All
that is seen and all pieces of the set are then given to each other at once; where two would do nearly as well, outlines
decide. Needs depth, and a set whose shapes are known.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from types import MappingProxyType
from typing import Final

import numpy as np

from hardware.interfaces import Frame
from hardware.piece_set import Colour, Kind, Look
from hardware.table import PieceSpec, Place, square_place
from vision.arrays import Array, cheapest_pairs
from vision.board.view import BoardView
from vision.pieces.fit import TALL, Fit
from vision.pieces.misplaced import around_board
from vision.standing.hiding import hiding_places, pawns_at, pixels_of
from vision.standing.recognised_set import RecognisedPiece, RecognisedSet
from vision.standing.sightings import TOPS, Sighting, Sightings, kind_cost, rough_sightings, sightings_of, together

_BETWEEN: Final = 0.42
"""What stands further from the middle of its square, along either axis, may be meant for the next one [its sides]."""
_OTHER_SIDE: Final = 20.0  # of evidence for the other side, see ``Sighting.white``
_PAWN_AT_AN_END: Final = 4.0  # what it costs that a pawn stands on the first rank or the last
_NO_KING: Final = 10.0  # … that there is no king
_PROMOTED: Final = 2.0  # … that there is one more of a kind than at the start of a game
_NONE_LEFT: Final = 12.0  # … that something is no piece of the set: a ninth pawn
_SURE: Final = 3.5  # what is said is so much likelier than anything else, as a logarithm: 30 times
_ALONE: Final = 0.05  # of what colours say, where lightness says nothing
_BY_OUTLINE: Final = 40.0
"""What a piece costs less the more of its outline agrees with the picture (measured over 540 pieces: 0.03 to 0.12 more
agrees with the right kind than with the one next to it, with a standard deviation of 0.06)."""
_BY_INSIDE: Final = 5.0  # … and the more what is within looks like its side: by 1 or more with the right one
_HARDLY: Final = 0.6  # a piece of whose outline less is in sight may be another one than it looks
_SEEN_THROUGH: Final = 0.5  # of a pawn's silhouette so much shows what is behind: no pawn is there
_ASIDE: Final = 0.007  # along either axis, from the middle: pieces in trays stand up to a centimetre off [m]
_IMPOSSIBLE: Final = 1e6
_LEAST_GAP: Final = 0.4
"""Between the lightness of the sides, as a logarithm; nearer ones say less."""
_STEEP: Final = 4.0  # a quarter of the gap from the middle is as light as can be
_ROUNDS: Final = 3  # of learning how high all looks in this picture
_MOST_OFF: Final = 0.002  # all may look so much higher or lower than usual [m]


def recognise(frames: Sequence[Frame], view: BoardView, held: Mapping[Look, int]) -> RecognisedSet:
    """Find out what stands on the board and in the trays.

    The frames are taken one after the other, with depth and without a hand or an arm before the board. ``held``: how
    many there are of each in the set.

    Raises:
        ValueError: a frame has no depth, or is by another camera, or the board is not in the picture.
    """
    if any(frame.depth is None for frame in frames):
        raise ValueError("pieces are identified by their height, which needs a camera with depth")
    beside = around_board(view, trays=True)
    seen = Sightings(tuple(rough_sightings(frames[0], view, beside)), frozenset())
    given = _given(_with_halves(seen.all, view), view, held)
    for _again in range(2 if given else 0):  # colours are learnt better where most are right
        looks = [sightings_of(frame, view, _specs(given), beside) for frame in frames]
        seen = together(sorted(looks, key=lambda look: sum(one.upright for one in look.all)))
        before, given = given, _given(_with_halves(seen.all, view), view, held)
        if {one.place: one.look[0] for one in given} == {one.place: one.look[0] for one in before}:
            break
    fit = Fit(frames[-1], view, _specs(given), use_depth=True, around=beside)
    asked = _in_doubt(given, fit)
    if asked:
        outlines = _by_outlines(given, fit, asked, frames[-1], view, beside)
        given = _given(_with_halves(seen.all, view, hidden=asked.keys()), view, held, outlines)
        fit = Fit(frames[-1], view, _specs(given), use_depth=True, around=beside)
    return _sorted_out(given, seen, fit, view)


def _specs(given: Sequence[RecognisedPiece]) -> dict[Place, PieceSpec]:
    return {one.place: PieceSpec(f"{one.place}", one.look[1], one.look[0], one.place) for one in given}


def _in_doubt(given: Sequence[RecognisedPiece], fit: Fit) -> dict[Place, tuple[Look, ...]]:
    """What else pieces may be, by place: by what was seen, or since little of them is."""
    in_sight = dict(zip(fit.stands, fit.in_sight().tolist(), strict=True))
    doubts = dict[Place, tuple[Look, ...]]()
    for one in given:
        others = [one.instead] if one.instead is not None else []
        if one.place.on_board and in_sight[one.place] < _HARDLY:
            colour, kind = one.look
            order = sorted(Kind, key=lambda each: TOPS[each])
            at = order.index(kind)
            others += [(colour, each) for each in order[max(at - 1, 0) : at + 2]]
            others += [(side, kind) for side in Colour]
        if others:
            doubts[one.place] = tuple(look for look in dict.fromkeys(others) if look != one.look)
    return doubts


def _by_outlines(
    given: Sequence[RecognisedPiece], fit: Fit, asked: Mapping[Place, Sequence[Look]],
    frame: Frame, view: BoardView, beside: tuple[float, float],
) -> dict[tuple[Place, Look], float]:  # fmt: skip
    """What outlines, and colours within them, say of pieces in doubt: what each that they may be costs."""
    costs = _outline_costs(fit, _specs(given))
    for turn in range(max(len(others) for others in asked.values())):
        instead = [
            replace(one, look=asked[one.place][turn]) if turn < len(asked.get(one.place, ())) else one for one in given
        ]
        other = Fit(frame, view, _specs(instead), use_depth=True, around=beside)
        for key, cost in _outline_costs(other, _specs(instead)).items():
            costs.setdefault(key, cost)
    return {(place, look): cost for (place, look), cost in costs.items() if place in asked}


def _outline_costs(fit: Fit, specs: Mapping[Place, PieceSpec]) -> dict[tuple[Place, Look], float]:
    costs = dict[tuple[Place, Look], float]()
    for place, agrees, supported in zip(fit.stands, fit.agreement(), fit.support(), strict=True):
        look = specs[place].colour, specs[place].kind
        costs[place, look] = -_BY_OUTLINE * float(agrees) - _BY_INSIDE * float(supported)
    return costs


def _with_halves(seen: Sequence[Sighting], view: BoardView, hidden: Collection[Place] = ()) -> list[Sighting]:
    """With what lightness says of the side of each: whether it belongs to the light half of the board's pieces or to
    the dark one. What colours say alone is worth little, as it was learnt from what was taken to be there.
    """
    lightness = [math.nan if math.isnan(one.lightness) else math.log(max(one.lightness, 1.0)) for one in seen]
    parted = np.array(sorted(
        light for one, light in zip(seen, lightness, strict=True)
        if _nearest(one, view).on_board and not math.isnan(light)
    ))  # fmt: skip
    if parted.size < 2:
        return [replace(one, white=0.0) for one in seen]
    # the two groups that are tightest about their means
    spread = [parted[:cut].var() * cut + parted[cut:].var() * (parted.size - cut) for cut in range(1, parted.size)]
    cut = int(np.argmin(spread)) + 1
    dark, bright = float(parted[:cut].mean()), float(parted[cut:].mean())
    middle, gap = 0.5 * (dark + bright), max(bright - dark, _LEAST_GAP)
    both = []
    for one, light in zip(seen, lightness, strict=True):
        unknown = math.isnan(light) or _nearest(one, view) in hidden
        half = 0.0 if unknown else float(np.clip(_STEEP * (light - middle) / gap, -1.0, 1.0))
        both.append(replace(one, white=one.white + half if abs(half) == 1.0 else _ALONE * (one.white + half)))
    return both


def _given(
    seen: Sequence[Sighting], view: BoardView, held: Mapping[Look, int],
    outlines: Mapping[tuple[Place, Look], float] = MappingProxyType({}),
) -> list[RecognisedPiece]:  # fmt: skip
    """Each thing that stands is a piece of the set; those on the board first, since the picture's edges cut trays."""
    upright = [(one, _nearest(one, view)) for one in seen if one.upright]
    on_board = [each for each in upright if each[1].on_board]
    off = _usual(on_board)
    given = _matched(on_board, held, off, outlines)
    left = Counter(held)
    left.subtract(one.look for one in given)
    return given + _matched([each for each in upright if not each[1].on_board], left, off, outlines)


def _matched(
    seen: Sequence[tuple[Sighting, Place]], held: Mapping[Look, int], off: float,
    outlines: Mapping[tuple[Place, Look], float],
) -> list[RecognisedPiece]:  # fmt: skip
    looks = [look for look, count in held.items() for _ in range(count)]
    if not seen:
        return []
    cost = _costs(seen, looks, off)
    if seen[0][1].on_board:
        cost[:, : len(looks)] += [_rarity(look, looks[:i].count(look)) for i, look in enumerate(looks)]
    for (i, (_, place)), (j, look) in product(enumerate(seen), enumerate(looks)):
        cost[i, j] += outlines.get((place, look), 0.0)
    rows, columns = cheapest_pairs(cost)
    cheapest = float(cost[rows, columns].sum())
    matched = []
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        one, place = seen[row]
        if column >= len(looks):
            continue
        other = cost.copy()
        other[row, [i for i, look in enumerate(looks) if look == looks[column]]] = _IMPOSSIBLE
        others = cheapest_pairs(other)
        sure = float(other[others].sum()) - cheapest >= _SURE
        second = int(others[1][row])
        instead = None if sure or second >= len(looks) else looks[second]
        matched.append(RecognisedPiece(place, (one.x, one.y), looks[column], instead))
    return matched


def _rarity(look: Look, before: int) -> float:
    """What it costs that one more is on a board besides so many alike: kings are there, promoted pieces hardly ever."""
    kind = look[1]
    if kind is Kind.KING:
        return -_NO_KING
    usual = {Kind.PAWN: 8, Kind.QUEEN: 1}.get(kind, 2)
    return _PROMOTED if before >= usual else 0.0


def _usual(seen: Sequence[tuple[Sighting, Place]]) -> float:
    """By how much all looks higher than it does to most cameras [m]."""
    off = 0.0
    for _round in range(_ROUNDS):
        away = [one.height - TOPS[_likeliest(one, off)] for one, _ in seen]
        off = float(np.clip(np.median(away), -_MOST_OFF, _MOST_OFF)) if away else 0.0
    return off


def _likeliest(one: Sighting, off: float) -> Kind:
    return min(Kind, key=lambda kind: kind_cost(kind, one, TOPS[kind] + off))


def _costs(seen: Sequence[tuple[Sighting, Place]], looks: Sequence[Look], off: float) -> Array:
    """Rows: what stands. Columns: the pieces of the set, then nothing of it for each."""
    cost = np.full((len(seen), len(looks) + len(seen)), _NONE_LEFT)
    for (i, (one, place)), (j, (colour, kind)) in product(enumerate(seen), enumerate(looks)):
        other = max(0.0, -one.white if colour is Colour.WHITE else one.white)
        at_an_end = kind is Kind.PAWN and place.on_board and place.index // 8 in (0, 7)
        cost[i, j] = kind_cost(kind, one, TOPS[kind] + off) + _OTHER_SIDE * other + _PAWN_AT_AN_END * at_an_end
    return cost


def _nearest(one: Sighting, view: BoardView) -> Place:
    every = (*map(square_place, range(64)), *view.table.tray_places())
    return min(every, key=lambda place: math.dist((one.x, one.y), view.table.xy(place)))


def _sorted_out(given: Sequence[RecognisedPiece], seen: Sightings, fit: Fit, view: BoardView) -> RecognisedSet:
    pieces, lying, between = dict[Place, RecognisedPiece](), set[Place](), set[Place]()
    for one in given:
        off = np.abs(np.subtract(one.at, view.table.xy(one.place))).max() / view.table.square
        if one.place in pieces:
            lying.add(one.place)
        elif one.place.on_board and off > _BETWEEN:
            between.add(one.place)
        pieces.setdefault(one.place, one)
    standing, squares = {one.at for one in given}, list(map(square_place, range(64)))
    for other in seen.all:
        if (other.x, other.y) not in standing:  # of squares that it touches it may be the piece, or more than one
            reach = other.reach + _BETWEEN * view.table.square
            touched = (place for place in squares if math.dist((other.x, other.y), view.table.xy(place)) < reach)
            lying |= {_nearest(other, view), *(place for place in touched if place not in pieces)}
    # without a piece nothing hides another one, and nobody knows what they look like
    empty = [place for place in squares if pieces and place not in pieces and place not in lying]
    beside = [place for place in view.table.tray_places() if place not in pieces and place not in lying]
    return RecognisedSet(
        tuple(pieces.values()), frozenset(lying), frozenset(between), frozenset(hiding_places(empty, fit, view)),
        frozenset(_free(beside, fit, view)),
    )  # fmt: skip


def _free(places: Sequence[Place], fit: Fit, view: BoardView) -> Iterator[Place]:
    """Those of some places where the tray is seen through wherever about their middles a pawn might stand."""
    assert fit.rises is not None, "that there is depth was looked for first"
    share = np.ones(len(places))
    for shift in product((-_ASIDE, 0.0, _ASIDE), (-_ASIDE, 0.0, _ASIDE)):
        pixels, within = pixels_of(pawns_at(places, view, fit, shift).inside, fit)
        low = within & (fit.rises.ravel()[pixels] < TALL)  # unknown heights are compared as false
        share = np.minimum(share, low.mean(axis=1))
    return (place for place, least in zip(places, share.tolist(), strict=True) if least > _SEEN_THROUGH)
