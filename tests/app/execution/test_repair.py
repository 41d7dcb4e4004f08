"""Mending boards: whatever hands did, what the arm does is right in the world as it is, or people are asked."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping
from functools import cache

import chess
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.execution.repair import Ask, BoardObservation, Repair, kinds_by_height, mend, repair_towards
from app.execution.repair.observed import Chances
from app.motion import MotionSettings, Planner
from app.pieces.inventory import Inventory
from app.pieces.layout import colour_of, start_layout
from app.pieces.manipulation import NoSpare, transfers
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES, Colour, Kind
from hardware.table import PieceSpec, Place, TableSettings, square_place
from vision.pieces.centres import Centre
from vision.pieces.placement_faults import Fault, FaultKind

TABLE = TableSettings()
SEEDS = st.integers(min_value=0, max_value=2**32)
GAMES = st.integers(min_value=0, max_value=9)
GRASP = 0.008
"""Fingers close on pieces up to so far off [m]."""
LINES = (
    "e4 e5 Nf3 Nc6 Bc4 Bc5", "d4 d5 Nc3 Nf6 Bg5 e6 Qd3 Be7", "e4 a6 e5 d5", "e4 d5 exd5 Nf6 d4 c6 dxc6 Nxc6",
)  # fmt: skip


@cache
def position(seed: int) -> tuple[chess.Board, Inventory]:
    """Of a random game, or of one in which castling, en passant and captures are at hand."""
    draw, board = random.Random(seed), chess.Board()
    now = Inventory.of(start_layout(board, TABLE), TABLE)
    line = iter(LINES[seed // 2 % len(LINES)].split() if seed % 2 else [""] * draw.randrange(4, 120))
    for san in line:
        moves = [board.parse_san(san)] if san else list(board.legal_moves)
        try:
            ply = transfers(board, draw.choice(moves), now)
        except (IndexError, NoSpare):
            break
        now = now.after(ply)
        board.push_uci(ply.uci)
    return board, now


class World:
    """What really stands where, and hands that change it; places off the board are not told apart."""

    def __init__(self, game: int, seed: int) -> None:
        self.board, self.expected = position(game)
        self.draw = random.Random(seed)
        self.on = {p.place.index: p for p in self.expected if p.place.on_board}
        self.off = [p for p in self.expected if not p.place.on_board]
        self.at = {square: TABLE.xy(square_place(square)) for square in self.on}
        self.fallen: set[int] = set()

    def lift(self, square: int) -> PieceSpec:
        self.at.pop(square)
        return self.on.pop(square)

    def put(self, piece: PieceSpec, square: int, off: tuple[float, float] = (0.0, 0.0)) -> None:
        """Off by a little, as people put pieces down."""
        assert square not in self.on
        x, y = TABLE.xy(square_place(square))
        dx, dy = (self.draw.uniform(-0.004, 0.004) + d for d in off)
        self.on[square], self.at[square] = piece, (x + dx, y + dy)

    def carry(self, start: int, end: int) -> None:
        piece = self.lift(start)
        if end in self.on:
            self.off.append(self.lift(end))
        self.put(piece, end)

    def own(self, colour: chess.Color | None = None) -> list[int]:
        colour = self.draw.random() < 0.5 if colour is None else colour
        return sorted(square for square, piece in self.on.items() if piece.colour is colour_of(colour))

    def empty(self) -> list[int]:
        return [square for square in chess.SQUARES if square not in self.on]

    def pick(self, squares: list[int]) -> int:
        return self.draw.choice(squares)

    # what the camera sees

    def observation(self, *, heights: bool, places: bool) -> BoardObservation:
        looks = {square: self.on[square].colour if square in self.on else None for square in chess.SQUARES}
        kinds = {s: self.height(p) for s, p in self.on.items()} if heights else {}
        noise = self.draw.uniform
        seen = {s: (x + noise(-0.001, 0.001), y + noise(-0.001, 0.001)) for s, (x, y) in self.at.items()}
        return BoardObservation(looks, seen if places else {}, frozenset(self.fallen), kinds=kinds)

    def height(self, piece: PieceSpec) -> Chances:
        """Within what a median over a piece's head errs by; farther off, no rule could always tell 4 mm apart."""
        return kinds_by_height(PIECE_SHAPES[piece.kind].height + self.draw.uniform(-0.0008, 0.0008))

    @property
    def wanted(self) -> dict[int, tuple[Colour, Kind]]:
        return {p.place.index: (p.colour, p.kind) for p in self.expected if p.place.on_board}

    @property
    def wrong(self) -> set[int]:
        here, wanted = {s: (p.colour, p.kind) for s, p in self.on.items()}, self.wanted
        return {square for square in chess.SQUARES if here.get(square) != wanted.get(square)}

    @property
    def looks_wrong(self) -> set[int]:
        wanted = {square: colour for square, (colour, _) in self.wanted.items()}
        return {s for s in chess.SQUARES if (self.on[s].colour if s in self.on else None) != wanted.get(s)}


def _illegal(w: World) -> None:
    w.carry(w.pick(w.own(w.board.turn)), w.pick(w.empty()))


def _wrong_side(w: World) -> None:
    w.carry(w.pick(w.own(not w.board.turn)), w.pick(w.empty()))


def _illegal_capture(w: World) -> None:
    w.carry(w.pick(w.own(True)), w.pick(w.own(False)))


def _own_piece_taken(w: World) -> None:
    start = w.pick(w.own())
    colour = w.on[start].colour
    others = [s for s, piece in w.on.items() if s != start and piece.colour is colour]
    w.carry(start, w.pick(others or w.own(colour is Colour.BLACK)))


def _missing(w: World) -> None:
    w.off.append(w.lift(w.pick(w.own())))


def _extra(w: World) -> None:
    w.put(w.draw.choice(w.off), w.pick(w.empty()))


def _recoloured(w: World) -> None:
    square = w.pick(w.own())
    other = [piece for piece in w.off if piece.colour is not w.on[square].colour]
    w.lift(square)
    w.put(w.draw.choice(other), square)


def _two_moved(w: World) -> None:
    """Of any sides, to anywhere."""
    for _ in range(2):
        w.carry(w.pick(w.own()), w.pick(w.empty()))


def _swapped(w: World) -> None:
    one, other = w.draw.sample(sorted(w.on), 2)
    first, second = w.lift(one), w.lift(other)
    w.put(first, other)
    w.put(second, one)


def _twice(w: World) -> None:
    """Two legal moves of a side, also over squares of each other."""
    board = w.board.copy(stack=False)
    for _ in range(2):
        moves = [m for m in board.legal_moves if not m.promotion and not board.is_castling(m)]
        moves = [m for m in moves if not board.is_en_passant(m) and m.from_square in w.on]
        if not moves:
            return
        move = w.draw.choice(moves)
        w.carry(move.from_square, move.to_square)
        board.push(move)
        board.turn, board.ep_square = w.board.turn, None


def _castled(w: World) -> None:
    rank = 0 if w.board.turn else 7
    squares = [chess.square(file, rank) for file in (4, 6, 7, 5)]
    if squares[0] in w.on and squares[2] in w.on and not {squares[1], squares[3]} & set(w.on):
        w.carry(squares[0], squares[1])
        w.carry(squares[2], squares[3])
    else:
        _illegal(w)


def _promoted(w: World) -> None:
    """A pawn goes to the last rank as something else, where that is not allowed."""
    colour = w.draw.random() < 0.5
    pawns = [s for s in w.own(colour) if w.on[s].kind is Kind.PAWN]
    last = [s for s in w.empty() if s // 8 == (7 if colour else 0)]
    spares = [p for p in w.off if p.colour is colour_of(colour) and p.kind not in (Kind.PAWN, Kind.KING)]
    if not pawns or not last or not spares:
        _illegal(w)
        return
    w.off.append(w.lift(w.pick(pawns)))
    w.put(w.draw.choice(spares), w.pick(last))


def _put_back_wrong(w: World) -> None:
    """A piece is captured, and in putting it back set on another square."""
    taken = w.pick(w.own())
    piece = w.lift(taken)
    w.put(piece, w.pick(w.empty()))


def _slid(w: World) -> None:
    square = w.pick(w.own())
    angle, far = w.draw.uniform(0.0, 2.0 * math.pi), w.draw.uniform(0.006, 0.018)
    w.put(w.lift(square), square, (far * math.cos(angle), far * math.sin(angle)))


def _knocked_over(w: World) -> None:
    w.fallen.add(w.pick(w.own()))


def _swept(w: World) -> None:
    for square in w.own(True)[:4] + w.own(False)[:4]:
        w.off.append(w.lift(square))


SORTS: Mapping[str, Callable[[World], None]] = {
    "illegal move": _illegal, "wrong side": _wrong_side, "illegal capture": _illegal_capture,
    "own piece taken": _own_piece_taken, "missing": _missing, "extra": _extra, "recoloured": _recoloured,
    "two moved": _two_moved, "swapped": _swapped, "twice": _twice, "castled": _castled, "promoted": _promoted,
    "put back wrong": _put_back_wrong, "slid": _slid, "knocked over": _knocked_over, "swept off": _swept,
}  # fmt: skip


def carry_out(world: World, repair: Repair) -> None:
    """On the true board: the piece that is meant stands there, within reach of the fingers; the target is free."""
    for transfer in repair.transfers:
        source, target = transfer.source, transfer.target
        assert source.on_board
        assert target.on_board
        piece = world.on[source.index]
        assert (piece.colour, piece.kind) == (transfer.colour, transfer.kind)
        x, y = transfer.grasped_at(TABLE)
        there = world.at[source.index]
        assert math.hypot(x - there[0], y - there[1]) < GRASP
        world.lift(source.index)
        world.put(piece, target.index)


def check(world: World, result: Repair | Ask) -> None:
    """Nothing is done wrong, and nothing that looks wrong is passed over."""
    if isinstance(result, Ask):
        assert world.wrong or world.fallen
        assert result.squares
        for square in result.squares:
            assert chess.square_name(square) in result.sentence
        return
    assert not world.fallen
    carry_out(world, result)
    left = set() if result.rest is None else set(result.rest.squares)
    assert world.wrong == left
    assert not left & set(world.on)


@pytest.mark.parametrize("sort", SORTS)
@given(game=GAMES, seed=SEEDS)
@settings(max_examples=15)
def test_with_kinds_known_by_height_whatever_hands_did_is_mended_or_asked_about(
    sort: str, game: int, seed: int
) -> None:
    world = World(game, seed)
    SORTS[sort](world)
    check(world, mend(world.expected, world.observation(heights=True, places=True), world.board))


@pytest.mark.parametrize("sort", [sort for sort in SORTS if sort not in ("two moved", "slid")])
@given(game=GAMES, seed=SEEDS)
@settings(max_examples=15)
def test_by_colours_alone_as_well_wherever_they_show_that_something_is_wrong(sort: str, game: int, seed: int) -> None:
    world = World(game, seed)
    SORTS[sort](world)
    result = mend(world.expected, world.observation(heights=False, places=False), world.board)
    if world.looks_wrong:
        check(world, result)
    elif not world.fallen:
        assert isinstance(result, Repair)
        assert not result.transfers


@given(GAMES, SEEDS, st.booleans())
@settings(max_examples=12)
def test_a_board_that_is_right_is_left_alone(game: int, seed: int, heights: bool) -> None:
    world = World(game, seed)
    result = mend(world.expected, world.observation(heights=heights, places=True), world.board)
    assert result == Repair(world.expected, (), "the board is as it should be")


@given(GAMES, SEEDS)
@settings(max_examples=20)
def test_what_is_mended_by_a_person_as_asked_is_right_then(game: int, seed: int) -> None:
    """Who does what the sentence says, on the squares that it names, has nothing left to do but what the arm does."""
    world = World(game, seed)
    for _ in range(2):
        if min(len(world.own(colour)) for colour in chess.COLORS) > 2:
            SORTS[world.draw.choice(list(SORTS))](world)
    for _ in range(2):
        result = mend(world.expected, world.observation(heights=True, places=True), world.board)
        for square in result.squares if isinstance(result, Ask) else ():
            world.fallen.discard(square)
            piece = world.expected.at(square_place(square))
            if square in world.on:
                world.off.append(world.lift(square))
            if piece is not None:
                for other, same in list(world.on.items()):
                    if same.name == piece.name:
                        world.lift(other)
                world.put(piece, square)
    check(world, mend(world.expected, world.observation(heights=True, places=True), world.board))


@given(GAMES, SEEDS)
@settings(max_examples=12)
def test_a_repair_can_lead_on_to_what_is_wanted_next(game: int, seed: int) -> None:
    """A ply that is to be carried out, or finished, on a board on which something was carried off."""
    world = World(game, seed)
    moves = list(world.board.legal_moves)
    try:
        wanted = world.expected.after(transfers(world.board, world.draw.choice(moves), world.expected))
    except (IndexError, NoSpare):
        wanted = world.expected
    _put_back_wrong(world)
    observation = world.observation(heights=True, places=True)
    step = mend(world.expected, observation, world.board)
    if isinstance(step, Ask):
        return
    result = repair_towards(step.believed, wanted, observation)
    assert isinstance(result, Repair)
    assert result.believed == step.believed
    stands = {p.name: p.place for p in step.believed} | {t.name: t.target for t in result.transfers}
    assert stands == {piece.name: piece.place for piece in wanted}
    now = step.believed
    for transfer in result.transfers:
        now = now.moved(transfer)
        if transfer.source.on_board and transfer.source == step.believed.find(transfer.name).place:
            assert math.dist(transfer.grasped_at(TABLE), world.at[transfer.source.index]) < GRASP
    assert result.rest is None


def test_what_is_missing_is_asked_for_where_it_is_wanted() -> None:
    expected, _ = at(START)
    board = chess.Board()
    wanted = expected.after(transfers(board, board.parse_san("Nc3"), expected))
    gone = Inventory.of((p for p in expected if p.name != "white-knight-b"), TABLE)
    assert repair_towards(gone, wanted, BoardObservation({})) == Ask(
        "a piece is missing: put the white knight on c3", (chess.C3,), ("white-knight-b",)
    )
    lost = Inventory.of((p for p in expected if p.name != "white-queen-spare-1"), TABLE)
    place = expected.find("white-queen-spare-1").place
    assert repair_towards(lost, expected, BoardObservation({})) == Ask(
        f"a piece is missing: put the white queen on {place}", (), ("white-queen-spare-1",)
    )


def at(fen: str) -> tuple[Inventory, dict[int, Colour | None]]:
    board = chess.Board(fen)
    now = Inventory.of(start_layout(board, TABLE), TABLE)
    return now, {square: colour_of(piece.color) for square, piece in board.piece_map().items()}


START = chess.STARTING_FEN


def looks(**squares: Colour | None) -> BoardObservation:
    return BoardObservation({chess.parse_square(name): look for name, look in squares.items()})


W, B = Colour.WHITE, Colour.BLACK
HIGH = {kind: kinds_by_height(shape.height) for kind, shape in PIECE_SHAPES.items()}


@pytest.mark.parametrize(("observation", "done", "sentence"), [
    (looks(b1=None, b3=W), ["b1 b3 b1"], "the arm puts the white knight back from b3 on b1"),
    (looks(b1=None, d7=W), ["b1 d7 b1"], "the arm puts the white knight back from d7 on b1"),
    (looks(a2=None, b2=None, a3=W, b3=W), ["a2 a3 a2", "b2 b3 b2"],
     "the arm puts the white pawn back from b3 on b2 and puts the white pawn back from a3 on a2"),
    (looks(a2=None, a7=None, a3=B, a6=W), ["a2 a6 a2", "a7 a3 a7"],
     "the arm puts the black pawn back from a3 on a7 and puts the white pawn back from a6 on a2"),
])  # fmt: skip
def test_what_is_sure_the_arm_puts_right(observation: BoardObservation, done: list[str], sentence: str) -> None:
    expected, _ = at(START)
    result = mend(expected, observation, chess.Board())
    assert isinstance(result, Repair)
    homes = {piece.name: piece.place for piece in expected}
    assert sorted(f"{homes[t.name]} {t.source} {t.target}" for t in result.transfers) == done
    assert result.sentence == sentence
    if observation.looks.get(chess.D7) is W:
        assert result.rest == Ask("a piece is missing: put the black pawn on d7", (chess.D7,), ("black-pawn-d",))
        assert "black-pawn-d" not in {piece.name for piece in result.believed}
    else:
        assert result.rest is None


@pytest.mark.parametrize(("observation", "sentence"), [
    (looks(b1=None), "a piece is missing: put the white knight on b1"),
    (looks(b1=None, d7=None),
     "2 pieces are missing: put the white knight on b1 and the black pawn on d7"),
    (looks(e4=W), "a white piece stands on e4 that should not be on the board: take it off"),
    (looks(e4=W, d5=W), "white pieces stand on e4 and d5 that should not be on the board: take them off"),
    (looks(d7=W), "a white piece stands on d7 that should not be on the board: take it off; "
                  "a piece is missing: put the black pawn on d7"),
    (looks(b1=None, c1=None, d3=W, e3=W), "it is not clear which white pieces stand on d3 and e3: put the white knight "
                                          "on b1, the white bishop on c1 and nothing on d3 and e3, or "
                                          "say what stands there, as 'd3 white knight'"),
    (looks(b1=None, d3=W), "it is not clear which white pieces stand on d2 and d3: put the white knight on b1, the "
                           "white pawn on d2 and nothing on d3, or say what stands there, as 'd2 white knight'"),
    (looks(d1=None, e4=W), "it is not clear which white pieces stand on e2 and e4: put the white queen on d1, the "
                           "white pawn on e2 and nothing on e4, or say what stands there, as 'e2 white knight'"),
    (BoardObservation({}, fallen=frozenset({1})), "the white knight on b1 has fallen, and the arm cannot stand it up: "
                                                  "stand it on b1"),
    (BoardObservation({}, fallen=frozenset({28})), "a piece lies on e4, which the arm cannot stand up: take it off "
                                                   "the board"),
    (BoardObservation({}, unclear=frozenset({28})), "something lies on e4: take it away"),
    (BoardObservation({}, unclear=frozenset({1})), "it is not clear what stands on b1: put the white knight there"),
    (BoardObservation({1: None, 20: W}, fallen=frozenset({55})),
     "the black pawn on h7 has fallen, and the arm cannot stand it up: stand it on h7"),
])  # fmt: skip
def test_what_is_not_sure_is_asked_by_name(observation: BoardObservation, sentence: str) -> None:
    expected, _ = at(START)
    result = mend(expected, observation, chess.Board())
    assert isinstance(result, Ask)
    assert result.sentence == sentence


def test_a_pawn_on_the_last_rank_may_be_anything_until_it_is_measured() -> None:
    expected, _ = at("4k3/8/P7/8/8/8/8/4K3 w - - 0 1")
    carried = {chess.A6: None, chess.A8: W}
    result = mend(expected, BoardObservation(carried))
    assert isinstance(result, Ask)
    assert "not clear which white piece stands on a8" in result.sentence
    assert isinstance(mend(expected, BoardObservation(carried, kinds={chess.A8: HIGH[Kind.PAWN]})), Repair)
    result = mend(expected, BoardObservation(carried, kinds={chess.A8: HIGH[Kind.QUEEN]}))
    assert isinstance(result, Ask)
    assert result.sentence.startswith("a white piece stands on a8 that should not be on the board: take it off")


def test_heights_tell_which_of_two_pieces_is_which() -> None:
    expected, _ = at(START)
    swapped = {chess.D1: HIGH[Kind.PAWN], chess.A2: HIGH[Kind.QUEEN]}
    result = mend(expected, BoardObservation({}, kinds=swapped), chess.Board())
    assert isinstance(result, Repair)
    assert {(t.kind, t.target) for t in result.transfers[1:]} == {
        (Kind.PAWN, Place.parse("a2")), (Kind.QUEEN, Place.parse("d1"))
    }  # fmt: skip
    assert len(result.transfers) == 3, "one steps aside"
    alike = {chess.B1: HIGH[Kind.BISHOP], chess.C1: HIGH[Kind.KNIGHT]}
    result = mend(expected, BoardObservation({}, kinds=alike), chess.Board())
    assert isinstance(result, Ask), "heights of knight and bishop differ too little to act without asking"
    moved = {chess.B1: None, chess.C1: None, chess.D3: W, chess.E3: W}
    known = {chess.D3: HIGH[Kind.BISHOP], chess.E3: HIGH[Kind.KNIGHT]}
    result = mend(expected, BoardObservation(moved, kinds=known), chess.Board())
    assert isinstance(result, Repair)
    assert {(t.kind, str(t.source), str(t.target)) for t in result.transfers} == {
        (Kind.BISHOP, "d3", "c1"), (Kind.KNIGHT, "e3", "b1")
    }  # fmt: skip


def test_off_centre_pieces_are_set_right_beyond_the_tolerance_before_anything_is_carried() -> None:
    expected, _ = at(START)

    def off(name: str, dx: float) -> dict[int, tuple[float, float]]:
        x, y = TABLE.xy(Place.parse(name))
        return {chess.parse_square(name): (x + dx, y)}

    near = mend(expected, BoardObservation({}, off("e2", 0.004)))
    assert isinstance(near, Repair)
    assert near.transfers == ()
    observation = BoardObservation({chess.B1: None, chess.D3: W}, off("e2", 0.009) | off("d3", 0.003))
    result = mend(expected, observation)
    assert isinstance(result, Repair)
    assert [(str(t.source), str(t.target), t.seen) for t in result.transfers] == [
        ("e2", "e2", off("e2", 0.009)[chess.E2]), ("d3", "b1", off("d3", 0.003)[chess.D3])
    ]  # fmt: skip
    assert result.sentence.startswith("the arm sets the white pawn right on e2 and puts the white knight back")
    with pytest.raises(ValueError, match=r"what stands on e2 was seen \(50, 0\) mm from its centre"):
        mend(expected, BoardObservation({}, off("e2", 0.050)))


def test_faults_of_vision_count_for_the_piece_that_should_stand_there() -> None:
    expected, _ = at(START)
    states = np.zeros(64, dtype=np.intp)
    states[:16], states[48:] = 1, 2
    states[chess.D7], states[chess.B1], states[chess.A1] = 1, 0, 0
    faults = [
        Fault(FaultKind.FALLEN, chess.A1, "", (-0.14, -0.14)),
        Fault(FaultKind.MISSING, chess.B1, "", None),
        Fault(FaultKind.OFF_CENTRE, chess.C2, "", (-0.06, -0.092)),
        Fault(FaultKind.FALLEN, chess.D7, "", (-0.02, 0.1)),
        Fault(FaultKind.MISSING, chess.H8, "", None),
        Fault(FaultKind.FOREIGN, chess.E5, "", (0.02, 0.02)),
    ]
    centres = {chess.G2: Centre(0.1, -0.1, 0.001, 0.9, 0.9, 0.9), chess.H2: Centre(0.2, 0.0, 0.1, -1.0, 0.0, 0.9)}
    observation = BoardObservation.of(expected, states, faults, centres)
    assert observation.looks[chess.D7] is W
    assert (observation.looks[chess.B1], observation.looks[chess.H8]) == (None, B)
    assert observation.fallen == {chess.A1}
    assert observation.unclear == {chess.H8, chess.E5}
    taken = {chess.A1: HIGH[Kind.QUEEN], chess.H8: HIGH[Kind.KING], chess.C2: HIGH[Kind.BISHOP]}
    states[chess.A1] = 1
    known = BoardObservation.of(expected, states, faults, kinds=taken)
    assert (known.fallen, known.unclear, known.places) == (frozenset(), {chess.E5}, {})
    assert BoardObservation.of(expected, states, faults, kinds={chess.A1: kinds_by_height(0.024)}).fallen == {chess.A1}
    assert observation.places == {chess.C2: (-0.06, -0.092), chess.G2: (0.1, -0.1)}


@pytest.mark.parametrize("kind", Kind)
def test_kinds_by_height(kind: Kind) -> None:
    height = PIECE_SHAPES[kind].height
    chances = kinds_by_height(height)
    assert math.fsum(chances.values()) == pytest.approx(1.0)
    assert max(chances, key=lambda k: chances[k]) is kind
    assert min(chances.values()) >= 5e-4
    assert kinds_by_height(height + 0.1, {k: s.height + 0.1 for k, s in PIECE_SHAPES.items()}) == pytest.approx(chances)


def test_a_height_that_no_kind_has_says_nothing() -> None:
    for height in (0.022, 1.0):
        assert list(kinds_by_height(height).values()) == pytest.approx([1.0 / len(Kind)] * len(Kind))


def test_the_arm_can_do_what_mends() -> None:
    parameters, motion = load_parameters(), MotionSettings()
    done = 0
    for seed in range(8):
        world = World(seed, seed)
        _two_moved(world)
        _slid(world)
        result = mend(world.expected, world.observation(heights=True, places=True), world.board)
        if isinstance(result, Repair) and result.transfers:
            plan = Planner.of(motion, parameters, result.believed.table, np.array(motion.home), 0.008, 8).ply(
                "mend", result.transfers, result.believed
            )
            done += sum(m.grips for m in plan.motions)
    assert done >= 6
