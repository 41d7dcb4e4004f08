"""Which piece each of all that is seen to stand is: laws over drawn positions and acts, without a camera."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import permutations

import chess
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.execution.repair import (
    Ask,
    Repair,
    Whereabouts,
    exchanged,
    known_better,
    refuted,
    repair_by_sight,
    toppled,
    whereabouts,
)
from app.pieces.inventory import Inventory, Transfer
from app.pieces.layout import start_layout
from hardware.piece_set import PIECE_SHAPES, Colour, Kind
from hardware.table import Captured, PieceSpec, Place, TableSettings, square_place
from vision.pieces.placement_faults import Fault, FaultKind, off_centre
from vision.standing.sightings import Sighting, Sightings, together

TABLE = TableSettings()
START = Inventory.of(start_layout(chess.Board(), TABLE), TABLE)
PAWN, ROOK, KNIGHT, BISHOP, KING = (START.at(square_place(square)) for square in (12, 0, 1, 2, 4))


def sighted(piece: PieceSpec, at: tuple[float, float], noise: float = 0.0) -> Sighting:
    """As depth would show it: all looks 1.2 mm too high, and a height errs."""
    height = PIECE_SHAPES[piece.kind].height + 0.0012 + noise
    return Sighting(*at, height, True, 2.5 if piece.colour is Colour.WHITE else -2.5)


def shown(
    carried: dict[str, tuple[float, float]], gone: frozenset[str] = frozenset(), hidden: frozenset[Place] = frozenset(),
    seed: int = 0,
) -> Sightings:  # fmt: skip
    """The start position with some pieces elsewhere, each some millimetres off."""
    rng = np.random.default_rng(seed)
    found = []
    for piece in START:
        x, y = carried.get(piece.name, TABLE.xy(piece.place))
        if piece.name not in gone and piece.place not in hidden:
            dx, dy = rng.normal(0.0, 0.0012, 2).tolist()
            found.append(sighted(piece, (x + dx, y + dy), float(np.clip(rng.normal(0.0, 0.0006), -0.0015, 0.0015))))
    rng.shuffle(found)
    return Sightings(tuple(found), hidden)


def carried_to(found: Whereabouts) -> dict[str, tuple[float, float]]:
    return {name: found.standing[name] for name in found.moved}


def test_where_nothing_has_happened_nothing_has_moved():
    found = whereabouts(START, shown({}))
    assert found is not None
    assert not found.moved
    assert not found.missing
    assert found.standing.keys() == {piece.name for piece in START}


@settings(max_examples=60)
@given(st.data(), st.integers(0, 10**6))
def test_up_to_three_carried_pieces_are_known_wherever_they_stand_and_the_arm_brings_them_back(data, seed):
    """On empty squares, between them, or in a tray; two never so near each other that one square would have both."""
    pieces = data.draw(
        st.lists(st.sampled_from([p for p in START if p.place.on_board]), min_size=1, max_size=3, unique=True)
    )
    free = [TABLE.xy(square_place(square)) for square in range(16, 48)]
    trays = [TABLE.xy(place) for place in TABLE.tray_places() if START.at(place) is None]
    spots = data.draw(st.lists(st.sampled_from(free + trays), min_size=len(pieces), max_size=len(pieces), unique=True))
    spots = [(x + 0.02 * (abs(x) < 0.14 and math.dist((x, y), spots[0]) == 0.0), y) for x, y in spots]
    if any(math.dist(a, b) < 0.045 for i, a in enumerate(spots) for b in spots[:i]):
        return
    truth = {piece.name: spot for piece, spot in zip(pieces, spots, strict=True)}
    found = whereabouts(START, shown(truth, seed=seed))
    if found is None:  # rook and knight differ by two standard deviations: a doubt is allowed, an error is not
        return
    looks = {
        (p.kind, p.colour): [truth[q.name] for q in pieces if (q.kind, q.colour) == (p.kind, p.colour)] for p in pieces
    }
    for key, places in looks.items():
        carried = carried_to(found).items()
        seen = [at for name, at in carried if (START.find(name).kind, START.find(name).colour) == key]
        assert len(seen) == len(places)
        assert any(  # which of two alike is which, nobody can tell
            all(math.dist(at, place) < 0.01 for at, place in zip(one, places, strict=True))
            for one in permutations(seen)
        )
    step = repair_by_sight(START, START, found, {})
    assert isinstance(step, Repair)
    assert step.rest is None
    assert step.believed.after_all(step.transfers).standing == START.standing


def test_pieces_that_changed_places_are_known_where_their_heights_differ():
    truth = {PAWN.name: TABLE.xy(KING.place), KING.name: TABLE.xy(PAWN.place)}
    found = whereabouts(START, shown(truth))
    assert found is not None
    assert found.moved == {PAWN.name, KING.name}


@pytest.mark.parametrize("seed", range(20))
def test_rook_and_knight_that_changed_places_are_never_silently_taken_for_each_other(seed):
    truth = {ROOK.name: TABLE.xy(KNIGHT.place), KNIGHT.name: TABLE.xy(ROOK.place)}
    found = whereabouts(START, shown(truth, seed=seed))
    assert found is None or found.moved == {ROOK.name, KNIGHT.name}


def test_a_piece_that_is_nowhere_is_asked_for_and_one_that_may_be_hidden_is_not():
    found = whereabouts(START, shown({}, gone=frozenset({BISHOP.name})))
    assert found is not None
    assert found.missing == (BISHOP,)
    assert isinstance(ask := repair_by_sight(START, START, found, {}), Ask)
    assert "white bishop on c1" in ask.sentence
    found = whereabouts(START, shown({}, hidden=frozenset({BISHOP.place})))
    assert found is not None
    assert not found.missing


def test_a_piece_out_of_play_that_nobody_sees_is_not_asked_for():
    (spare, *_) = [piece for piece in START if piece.place.in_tray]
    found = whereabouts(START, shown({}, gone=frozenset({spare.name})))
    assert found is not None
    assert not found.missing
    assert not found.moved


def test_a_place_on_which_another_piece_stands_hides_nothing():
    truth = {PAWN.name: TABLE.xy(KING.place), KING.name: TABLE.xy(PAWN.place)}
    seen = Sightings(shown(truth).all, frozenset({PAWN.place}))
    found = whereabouts(START, seen)
    assert found is not None
    assert found.moved == {PAWN.name, KING.name}


def test_what_lies_is_one_of_those_that_do_not_stand_and_what_is_nobodys_is_not_explained():
    seen = shown({}, gone=frozenset({BISHOP.name}))
    lying = replace(seen.all[0], upright=False, height=0.02, x=0.0, y=0.0)
    found = whereabouts(START, Sightings((*seen.all, lying), frozenset()))
    assert found is not None
    assert (len(found.lying), found.missing, found.moved) == (1, (BISHOP,), frozenset())
    assert whereabouts(START, Sightings((*shown({}).all, sighted(PAWN, (0.0, 0.0))), frozenset())) is None


def test_pieces_of_one_side_that_changed_places_are_named_with_where_they_stand():
    truth = {PAWN.name: TABLE.xy(KING.place), KING.name: TABLE.xy(PAWN.place)}
    found = whereabouts(START, shown(truth))
    assert found is not None
    assert {fault.sentence for fault in exchanged(START, found)} == {
        "the white king of e1 stands on e2", "the white pawn of e2 stands on e1",
    }  # fmt: skip
    assert {fault.square for fault in exchanged(START, found)} == {4, 12}
    still = whereabouts(START, shown({}))
    assert still is not None
    assert not list(exchanged(START, still))


def test_what_looks_as_it_did_tells_a_knight_from_a_rook_where_heights_do_not():
    """The knight went, and looks as low as a rook; the rook, which nobody touched, looks almost as high as a knight."""
    away = TABLE.xy(square_place(28))
    seen = [one for one in shown({}).all if math.dist((one.x, one.y), TABLE.xy(KNIGHT.place)) > 0.01]
    seen = [one for one in seen if math.dist((one.x, one.y), TABLE.xy(ROOK.place)) > 0.01]
    odd = Sightings((*seen, sighted(KNIGHT, away, -0.0034), sighted(ROOK, TABLE.xy(ROOK.place), 0.0018)), frozenset())
    assert whereabouts(START, odd) is None
    found = whereabouts(START, odd, untouched=frozenset({0}))
    assert found is not None
    assert found.moved == {KNIGHT.name}


def test_heights_are_the_mean_of_several_looks_at_what_stands_in_the_same_place():
    looks = [shown({}, seed=seed) for seed in range(4)]
    mean = together(looks)
    for one in mean.all:
        same = [x.height for look in looks for x in look.all if math.dist((x.x, x.y), (one.x, one.y)) < 0.009]
        assert one.height == pytest.approx(sum(same) / len(same))
    assert mean.hidden == looks[-1].hidden


@pytest.mark.parametrize("turned", [False, True])
def test_a_rook_as_high_as_a_knight_is_known_by_its_broad_top(turned: bool) -> None:
    """Heights alone would say that nothing was exchanged, or nothing at all."""
    assert ROOK is not None
    assert KNIGHT is not None
    at = {ROOK.name: TABLE.xy(ROOK.place), KNIGHT.name: TABLE.xy(KNIGHT.place)}
    if turned:
        at = {ROOK.name: at[KNIGHT.name], KNIGHT.name: at[ROOK.name]}
    between = 0.5 * (PIECE_SHAPES[ROOK.kind].height + PIECE_SHAPES[KNIGHT.kind].height) + 0.0012
    seen = [one for one in shown(at).all
            if min(math.dist((one.x, one.y), spot) for spot in at.values()) > 0.02]  # fmt: skip
    seen.append(Sighting(*at[ROOK.name], between, True, 2.5, 0.0041))
    seen.append(Sighting(*at[KNIGHT.name], between, True, 2.5, 0.0017))
    found = whereabouts(START, Sightings(tuple(seen), frozenset()))
    assert found is not None
    assert found.moved == (set(at) if turned else set())


def test_what_was_nudged_in_a_tray_is_put_right_and_what_stands_beside_all_places_goes_home() -> None:
    spare = next(piece for piece in START if piece.place.in_tray)
    x, y = TABLE.xy(spare.place)
    nudged = whereabouts(START, shown({spare.name: (x + 0.011, y)}))
    assert nudged is not None
    assert (nudged.nudged, nudged.moved) == ({spare.name}, frozenset())
    repair = repair_by_sight(START, START, nudged, {})
    assert isinstance(repair, Repair)
    assert [(one.name, one.source, one.target) for one in repair.transfers] == [(spare.name, spare.place, spare.place)]
    slight = whereabouts(START, shown({spare.name: (x + 0.004, y)}))
    assert slight is not None
    assert not slight.nudged
    beyond = whereabouts(START, shown({spare.name: (0.20, -0.197)}))
    assert beyond is not None
    repair = repair_by_sight(START, START, beyond, {})
    assert isinstance(repair, Repair)
    assert [(one.name, one.target) for one in repair.transfers] == [(spare.name, spare.place)]
    assert repair.transfers[0].seen == pytest.approx((0.20, -0.197), abs=0.005)


@pytest.mark.parametrize("shares", [(0.0, 1.0), (0.45, 0.55)], ids=["told apart", "hardly"])
def test_a_light_pawn_in_a_dark_ones_place_is_not_that_one_whatever_the_light(shares: tuple[float, float]) -> None:
    """Colours alone tell sides apart where lightness does not; and where both do, they agree."""
    dark, light = (20.0 + 140.0 * share for share in shares)
    rng, told = np.random.default_rng(1), list[Sighting]()
    mine, other = (next(one for one in START if one.kind is Kind.PAWN and one.colour is side) for side in Colour)
    for one in shown({mine.name: TABLE.xy(other.place)}, gone=frozenset({other.name})).all:
        told.append(replace(one, lightness=(light if one.white > 0.0 else dark) + float(rng.normal(0.0, 8.0))))
    found = whereabouts(START, Sightings(tuple(told), frozenset()))
    assert found is not None
    assert found.moved == {mine.name}
    assert [piece.name for piece in found.missing] == [other.name]


@pytest.mark.parametrize(("bright", "dark", "spread"), [(160.0, 15.0, 5.0), (27.0, 3.0, 1.5)], ids=["day", "night"])
@pytest.mark.parametrize("side", list(Colour))
@pytest.mark.parametrize("seed", range(3))
def test_what_is_as_dark_as_its_own_side_is_not_taken_for_one_that_fell(
    side: Colour, seed: int, bright: float, dark: float, spread: float
) -> None:
    """Half behind a bishop, with a light rook beside it, a dark pawn has the rook's colours, but not its lightness."""
    rng = np.random.default_rng(seed)
    other = Colour.BLACK if side is Colour.WHITE else Colour.WHITE
    stays, fell = (
        rng.choice([one for one in START if one.kind is Kind.PAWN and one.colour is c]) for c in (side, other)
    )
    home, light = TABLE.xy(stays.place), {Colour.WHITE: bright, Colour.BLACK: dark}
    wrong, told = (0.97 if side is Colour.BLACK else -0.97), list[Sighting]()
    for one in shown({}, gone=frozenset({fell.name}), seed=seed).all:
        lightness = light[Colour.WHITE if one.white > 0.0 else Colour.BLACK] + float(rng.normal(0.0, spread))
        seen_as = wrong if math.dist((one.x, one.y), home) < 0.01 else one.white
        told.append(replace(one, white=seen_as, lightness=lightness))
    x, y = TABLE.xy(fell.place)
    told.append(Sighting(x, y + 0.02 * (1.0 if y < 0.0 else -1.0), 0.021, False, -3.0 * wrong))
    found = whereabouts(START, Sightings(tuple(told), frozenset()))
    assert found is not None
    assert not found.moved
    assert [piece.name for piece in found.missing] == [fell.name]


def test_what_lies_in_place_of_a_piece_is_no_piece_that_stands() -> None:
    """Lower than the piece would be, and nothing upright beside it; two that touch are as high as either."""
    assert PAWN is not None
    at = TABLE.xy(PAWN.place)
    rest = [one for one in shown({}).all if math.dist((one.x, one.y), at) > 0.02]

    def of(*low: Sighting) -> list[int]:
        return [fault.square for fault in toppled(START, Sightings((*rest, *low), frozenset()))]

    assert of(Sighting(at[0], at[1] + 0.016, 0.021, False, 2.0)) == [PAWN.place.index]
    assert of(Sighting(at[0], at[1] + 0.016, 0.034, False, 2.0)) == []
    assert of(Sighting(*at, 0.035, True, 2.0), Sighting(at[0], at[1] + 0.02, 0.021, False, 2.0)) == []
    assert of() == [], "nothing there is another fault"


@pytest.mark.parametrize("kind", [FaultKind.FALLEN, FaultKind.MISSING])
def test_a_piece_that_depth_sees_standing_neither_lies_nor_is_missing(kind: FaultKind) -> None:
    at, rest = TABLE.xy(KNIGHT.place), shown({}, gone=frozenset({KNIGHT.name})).all
    doubt = Fault(kind, KNIGHT.place.index, "light from the side", None)
    other = Fault(FaultKind.FOREIGN, chess.E4, "not a piece's square", None)

    def left(*there: Sighting) -> bool:
        """Whether the doubt remains."""
        wrong = refuted((doubt, other), START, Sightings((*rest, *there), frozenset()))
        assert wrong <= {doubt}
        return not wrong

    assert not left(sighted(KNIGHT, at))
    assert not left(sighted(KNIGHT, (at[0] + 0.003, at[1] - 0.004)))
    assert left(sighted(KNIGHT, (at[0] + 0.009, at[1]))), "further off than outlines are looked for"
    assert not left(replace(sighted(KNIGHT, at), white=-0.2)), "colours say nothing of it"
    assert left(), "nothing is there"
    assert left(replace(sighted(KNIGHT, at), upright=False))
    assert left(sighted(KNIGHT, (at[0], at[1] + 0.02))), "it stands between two squares"
    assert left(sighted(PAWN, at)), "another kind stands there"
    assert left(replace(sighted(KNIGHT, at), white=-2.0)), "the other side's"
    assert left(sighted(KNIGHT, at), Sighting(at[0] + 0.012, at[1] + 0.012, 0.015, False, 2.0)), (
        "something lies beside it"
    )


def test_an_outline_off_its_square_counts_unless_depth_sees_the_piece_nearer_to_the_centre() -> None:
    at, rest = TABLE.xy(KNIGHT.place), shown({}, gone=frozenset({KNIGHT.name})).all
    claimed = (at[0] + 0.007, at[1])
    fault = Fault(FaultKind.OFF_CENTRE, KNIGHT.place.index, "7 mm off", claimed)

    def counts(*there: Sighting) -> bool:
        return not refuted((fault,), START, Sightings((*rest, *there), frozenset()))

    assert counts(sighted(KNIGHT, claimed))
    assert counts(sighted(KNIGHT, (at[0] + 0.004, at[1] + 0.002)))
    assert counts(), "depth says nothing of it"
    assert not counts(sighted(KNIGHT, at))
    assert not counts(sighted(KNIGHT, (at[0] + 0.002, at[1] - 0.003)))


def test_where_outline_and_depth_disagree_about_a_piece_off_its_square_it_is_where_depth_shows_it() -> None:
    """A knight 16 mm off its square, half behind a pawn, was taken for centred, or would have been sought elsewhere."""
    at, rest = TABLE.xy(KNIGHT.place), shown({}, gone=frozenset({KNIGHT.name})).all
    fault = off_centre(KNIGHT.place.index, KNIGHT, TABLE, (at[0] - 0.0106, at[1] + 0.0115))

    def known(*there: tuple[float, float]) -> tuple[Fault, ...]:
        seen = Sightings((*rest, *(sighted(KNIGHT, place) for place in there)), frozenset())
        return known_better((fault,), START, seen)

    stands = at[0] - 0.0137, at[1] - 0.0074
    (found,) = known(stands)
    assert (found.kind, found.place) == (FaultKind.OFF_CENTRE, stands)
    assert found.sentence == "the white knight on b1 stands 15.6 mm off towards a and 1"
    assert known((at[0] - 0.0096, at[1] + 0.0125)) == (fault,), "they agree: the outline is the more exact"
    assert known() == (fault,), "depth says nothing of it"
    assert known(at) == (), "depth sees it centred"


@pytest.mark.parametrize("noise", [0.0002, -0.0002, 0.0])
def test_what_a_person_says_settles_what_heights_leave_open(noise: float) -> None:
    """A rook and a knight, both as high as the mean of the two, stand on two other squares than their own."""
    spots = {square: TABLE.xy(square_place(square)) for square in (chess.D4, chess.F5)}
    height = 0.5 * (PIECE_SHAPES[ROOK.kind].height + PIECE_SHAPES[KNIGHT.kind].height) + 0.0012
    rest = shown({}, gone=frozenset({ROOK.name, KNIGHT.name}))
    pairs = zip(spots.values(), (noise, -noise), strict=True)
    two = [Sighting(*at, height + err, True, 2.5) for at, err in pairs]
    seen = replace(rest, all=(*rest.all, *two))
    assert whereabouts(START, seen) is None
    for told, other in ((ROOK, KNIGHT), (KNIGHT, ROOK)):
        found = whereabouts(START, seen, told={square_place(chess.D4): (Colour.WHITE, told.kind)})
        assert found is not None
        assert math.dist(found.standing[told.name], spots[chess.D4]) < 1e-9
        assert math.dist(found.standing[other.name], spots[chess.F5]) < 1e-9


BOXES = TableSettings(captured=Captured.BOX)


def captured(square: str) -> tuple[Inventory, Inventory, PieceSpec]:
    """Before and after the piece of a square was dropped into a box; and the piece."""
    stands = Inventory.of(start_layout(chess.Board(), BOXES), BOXES)
    piece = stands.at(Place.parse(square))
    assert piece is not None
    return stands, stands.moved(Transfer.of(piece, stands.nearest_free(Place("BR", 0)))), piece


def seen_on(table: TableSettings, stands: Inventory, but: dict[str, tuple[float, float]]) -> Sightings:
    """All that stands where it should, or elsewhere; what is in boxes nobody sees."""
    at = {piece.name: table.xy(piece.place) for piece in stands if not piece.place.in_box} | but
    return Sightings(tuple(sighted(stands.find(name), spot) for name, spot in at.items()), frozenset())


@given(st.sampled_from([str(square_place(square)) for square in (*range(16), *range(48, 60))]))
def test_what_was_lost_over_its_box_and_is_nowhere_in_sight_is_in_it(square: str) -> None:
    stands, wanted, piece = captured(square)
    rest = Inventory.of((other for other in stands if other.name != piece.name), BOXES)
    found = whereabouts(stands, seen_on(BOXES, rest, {}))
    assert found is not None
    assert [one.name for one in found.missing] == [piece.name]
    step = repair_by_sight(stands, wanted, found, {}, {piece.name})
    assert isinstance(step, Repair)
    assert step.transfers == ()
    assert step.rest is None
    assert dict(step.believed.standing) == dict(wanted.standing)
    assert isinstance(repair_by_sight(stands, stands, found, {}, {piece.name}), Ask), "on the board it is missed"
    assert isinstance(repair_by_sight(stands, wanted, found, {}), Ask), "lost elsewhere, it may be behind something"


@given(
    st.sampled_from([str(square_place(square)) for square in (*range(16), *range(48, 60))]),
    st.sampled_from([square_place(square) for square in range(16, 48)]),
)
def test_what_bounces_out_of_a_box_goes_back_into_it(square: str, landed: Place) -> None:
    _, stands, piece = captured(square)
    found = whereabouts(stands, seen_on(BOXES, stands, {piece.name: BOXES.xy(landed)}))
    if found is None:  # a rook or a knight may be either
        assert piece.kind in (Kind.ROOK, Kind.KNIGHT)
        return
    assert found.moved == {piece.name}
    step = repair_by_sight(stands, stands, found, {})
    assert isinstance(step, Repair)
    (transfer,) = step.transfers
    assert (transfer.name, transfer.source, transfer.target) == (piece.name, landed, stands.find(piece.name).place)
