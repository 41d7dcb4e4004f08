"""Pieces are lost on their way, knocked aside or taken off; the game sees it, has it mended, and only then goes on.

The table here is paper: an arm that moves inventories and loses pieces where it is told, and eyes that see the truth.
"""

from __future__ import annotations

import math
import random
import sys
from collections.abc import Sequence, Set
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import chess
import numpy as np
import pytest

from app import UserError
from app.execution.fallen import MOST_TRIES, SWUNG_AFTER
from app.execution.interruption import BoardTouched, CarryFailed, Loss
from app.execution.recovery import FRUITLESS, Recovery
from app.execution.repair import BoardObservation, Whereabouts
from app.execution.repair.attempts import MOST_ROUNDS
from app.execution.state import AwaitedReply, Carried, Devices, Job, Position, Told
from app.execution.table import Table
from app.game.person import NeedsHand, UnattendedAsker
from app.game.set_down import shows_after
from app.motion import MotionSettings
from app.motion.obstacles import Obstacle
from app.motion.plan import InTheWay, PlanRefused
from app.pieces.inventory import Inventory, Transfer
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.records import EVENTS_FILE, GameRecord, GameSetup, read_history
from app.records.events import TaskEvent, TroubleEvent
from app.records.history import Unfinished
from app.rig.arm import Outcome
from app.rig.board import BoardRig
from app.terminal.game_display import UserInterface
from hardware.parameters import load_parameters
from hardware.table import Captured, PieceSpec, Place, TableSettings, square_place
from vision.pieces.lying_or_standing import MisplacedPiece
from vision.pieces.placement_faults import Fault, FaultKind
from vision.pieces.poses import Pose
from vision.reading.appearance import BLACK, EMPTY, WHITE
from vision.reading.outcome import LOOKS

TABLE = TableSettings()
START = Inventory.of(start_layout(chess.Board(), TABLE), TABLE)


class Paper:
    """What really stands where; and an arm and eyes for it."""

    def __init__(self, inventory: Inventory) -> None:
        self.truth = inventory
        self.losses: dict[int, Place | None] = {}
        """By number of the transfer, from 0: where its piece ends up; None: gone."""
        self.falls: dict[int, Place] = {}
        """The same, of pieces that lie near such a square."""
        self.bounces: dict[int, Place] = {}
        """The same, of pieces that come out of their boxes again, and nobody notices."""
        self.lying: dict[str, tuple[PieceSpec, Place]] = {}
        self.hidden = self.in_box = False
        """Something hides the square of what is gone; something is in the box that was not."""
        self.blind = 0
        """In so many looks nothing is found that lies or stands elsewhere."""
        self.narrow: set[tuple[str, str]] = set()
        """This piece is in the way of the fingers on this square."""
        self.crowded: str | None = None
        """This piece is in the way of the fingers, unless it alone is carried."""
        self.beside: str | None = None
        """Where this piece belongs, what lies is in the way of the fingers."""
        self.wedged: str | None = None
        """This piece leans on another, which is in the way of the fingers, until it is pushed."""
        self.hemmed_in: str | None = None
        """This piece is in the way, and the fingers do not get at it either."""
        self.immovable = False
        self.packed: str | None = None
        """There is no room for a push until this piece has gone from where it did stand."""
        self.off = 0.0
        """What was lost over a tray stands so far from the middle of its place [m]."""
        self.shifts: list[tuple[float, float]] = []
        """By so much the arm misses the middles of squares, each time that it sets a piece down; then no more [m]."""
        self.missed: dict[str, tuple[float, float]] = {}
        self.stood_up = self.pushed = 0
        self.carried = 0
        self.asked: list[str] = []
        self.answer: chess.Move | None = None
        """A person makes it while the arm goes home."""
        self.heap: set[str] = set()
        """A piece that lies leans on these: nobody can say how it lies until they have gone, or it was pushed over."""
        self.against: str | None = None
        """Only as long as this piece stands where it did is seen what lies beside it."""
        self.stirred = 0
        self.prop_off = 0.025
        self.prop: str | None = None
        self.loosened = 9
        """After so many pushes it leans on nothing any more."""
        """This piece is off its place, and what lies leans on it."""
        self.visits: list[tuple[str, Place | None]] = []
        """So often a hand comes before the arm begins: which piece it puts where."""

    # an arm

    untouched = True
    midway = False
    permission = SimpleNamespace(stopped=False)

    def carry(self, job: Job, inventory: Inventory, begun: Any = None, seen: Any = None) -> Carried:
        done = inventory
        self.visit()
        if self.crowded is not None and [one.name for one in job.transfers] != [self.crowded]:
            piece, self.crowded = inventory.find(self.crowded), None
            raise InTheWay("the fingers would touch it", Obstacle.at(piece.name, piece.place, piece.kind, TABLE))
        if any(one.name == self.beside and one.target == inventory.find(one.name).place for one in job.transfers):
            (piece, place), one = next(iter(self.lying.values())), inventory.find(job.transfers[0].name)
            lies = Obstacle.at(piece.name, place, piece.kind, TABLE)
            raise InTheWay("the fingers would touch it", lies, Obstacle.at(one.name, one.place, one.kind, TABLE))
        if self.wedged is not None:
            pieces = [self.truth.find(name) for name in ("white-pawn-c", self.wedged)]
            pawn, around = (Obstacle.at(piece.name, piece.place, piece.kind, TABLE) for piece in pieces)
            raise InTheWay("the fingers would touch the pawn", pawn, around)
        for number, transfer in enumerate(job.transfers):
            if self.carried in self.losses:
                where = self.losses.pop(self.carried)
                self.carried += 1
                self.put(transfer.name, where)
                raise CarryFailed(Loss.LOST, transfer, number, done, f"the {transfer.kind} was lost")
            if self.carried in self.falls:
                self.lying[transfer.name] = self.truth.find(transfer.name), self.falls.pop(self.carried)
                self.carried += 1
                self.put(transfer.name, None)
                raise CarryFailed(Loss.LOST, transfer, number, done, f"the {transfer.kind} was lost")
            self.put(transfer.name, transfer.target)
            self.missed[transfer.name] = self.shifts.pop(0) if self.shifts else (0.0, 0.0)
            if self.carried in self.bounces:
                self.lying[transfer.name] = self.truth.find(transfer.name), self.bounces.pop(self.carried)
                self.put(transfer.name, None)
            self.carried += 1
            done = done.moved(transfer)
        if self.answer is not None:
            answer, self.answer = self.answer, None
            moved = self.truth.at(square_place(answer.from_square))
            assert moved is not None
            self.put(moved.name, square_place(answer.to_square))
        return Carried(1.0, Outcome(1.0, 1.0, 1.0, 100), False)

    def put(self, name: str, place: Place | None) -> None:
        rest = [piece for piece in self.truth if piece.name != name]
        piece = next((piece for piece in self.truth if piece.name == name), None)
        if place is not None:
            assert piece is not None, f"{name} is gone and cannot be carried"
            assert all(other.place != place for other in rest), f"{name} was put on {place}, where another piece stands"
            rest.append(PieceSpec(piece.name, piece.kind, piece.colour, place))
        self.truth = Inventory.of(rest, TABLE)
        self.prop = None if self.prop == name else self.prop

    def visit(self) -> None:
        if self.visits:
            self.put(*self.visits.pop(0))
            raise BoardTouched

    def stand_up(self, one: MisplacedPiece, misplaced: Any, stands: Inventory, seen: Any) -> float | None:
        self.visit()
        in_the_way = next((piece for piece in self.truth if (piece.name, str(piece.place)) in self.narrow), None)
        if in_the_way is not None:
            at = Obstacle.at(in_the_way.name, in_the_way.place, in_the_way.kind, TABLE)
            raise InTheWay("the rook is in the way", at)
        if self.hemmed_in is not None:
            piece = stands.find(self.hemmed_in)
            raise InTheWay("the rook is in the way", Obstacle.at(piece.name, piece.place, piece.kind, TABLE))
        if self.prop is not None:
            return None
        piece, place = self.lying.pop(one.piece.name)
        self.truth = Inventory.of([*self.truth, PieceSpec(piece.name, piece.kind, piece.colour, place)], TABLE)
        self.stood_up += 1
        return 2.0

    def push_for(self, blocked: Any, misplaced: Any, stands: Inventory, seen: Any) -> Any:
        if self.immovable or (self.packed and self.truth.find(self.packed) == START.find(self.packed)):
            raise PlanRefused("no push helps")
        self.visit()
        return SimpleNamespace(name=blocked[0].by)

    def stir_for(self, spot: Any, heap: Any, stands: Inventory, seen: Any) -> Any:
        return SimpleNamespace(name="heap")

    def push_aside(self, push: Any, stands: Inventory) -> None:
        if push.name == "heap":
            self.stirred += 1
            self.wedged = None
            self.prop = None if self.stirred >= self.loosened else self.prop
            self.heap.clear()
            return
        self.pushed += 1
        self.hemmed_in = self.against = None

    def way_for(self, blocks: str, misplaced: Any, stands: Inventory, but: Set[Place] = frozenset()) -> Transfer:
        if self.hemmed_in == blocks or self.immovable or blocks in self.lying:
            raise PlanRefused("the fingers would touch what lies there")
        squares = (place for place in map(square_place, range(63, -1, -1)) if place not in but)
        free = next(place for place in squares if stands.at(place) is None)
        return Transfer.of(stands.find(blocks), free)

    def be_ready(self, inventory: Inventory) -> None:
        """Nobody pushes it."""

    def bring_home(self, inventory: Inventory) -> None:
        pass

    # eyes

    def whereabouts(self, stands: Inventory) -> Whereabouts | None:
        """As without depth; with boxes, what lies in none."""
        if not TABLE.boxes():
            return None
        standing = {piece.name: TABLE.xy(piece.place) for piece in self.truth if not piece.place.in_box}
        gone = (piece for piece in stands if piece.place.on_board and piece.name not in standing)
        moved = {piece.name for piece in self.truth if piece.name in standing and stands.find(piece.name) != piece}
        return Whereabouts(standing, frozenset(moved), tuple(piece for piece in gone if not self.hidden))

    def has_fallen_in(self, place: Place) -> bool:
        return self.in_box

    def strange(self, stands: Inventory) -> tuple[tuple[float, float], ...]:
        return tuple(TABLE.xy(place) for name, (_, place) in self.lying.items() if stands.find(name).place.in_box)

    def misplaced(self, stands: Inventory, besides: Sequence[PieceSpec] = (), seen: Any = None) -> list[MisplacedPiece]:
        if self.blind:
            self.blind -= 1
            return []
        beside = [
            MisplacedPiece(stands.find(piece.name), stands.find(piece.name).place, Pose(*self.at(piece.place)))
            for piece in self.truth
            if piece.place.in_tray and stands.find(piece.name).place != piece.place
        ]
        if self.prop is not None:
            leant_on = stands.find(self.prop)
            x, y = TABLE.xy(leant_on.place)
            beside.append(MisplacedPiece(leant_on, leant_on.place, Pose(x + 0.009, y - self.prop_off)))
        if self.leans or (self.against and self.truth.find(self.against) != START.find(self.against)):
            return beside
        return beside + [
            MisplacedPiece(stands.find(name), stands.find(name).place, Pose(*TABLE.xy(place), yaw=1.0))
            for name, (_, place) in self.lying.items()
        ]

    @property
    def leans(self) -> bool:
        """Whether all that it leans on stands where it did."""
        places = {piece.name: piece.place for piece in START}
        return bool(self.heap) and all(self.truth.find(name).place == places[name] for name in self.heap)

    def at(self, place: Place) -> tuple[float, float]:
        x, y = TABLE.xy(place)
        return x + self.off, y

    last = None
    deep = True
    looked_at = math.inf

    def verify(self, stands: Inventory, righted: Set[str] = frozenset()) -> BoardObservation:
        faults, states = [], np.full(64, EMPTY)
        for square in range(64):
            there, should = self.truth.at(square_place(square)), stands.at(square_place(square))
            if there is not None:
                states[square] = WHITE if there.colour == "white" else BLACK
            if should is not None and there is None and self.leans and should.name in self.lying:
                faults.append(Fault(FaultKind.FALLEN, square, f"something lies on {square_place(square)}", None))
            elif should is not None and there is None:
                faults.append(Fault(FaultKind.MISSING, square, f"{square_place(square)} is empty", None))
            if should is not None and there == should and math.hypot(*self.missed.get(there.name, (0.0, 0.0))) > 0.005:
                x, y = np.add(TABLE.xy(there.place), self.missed[there.name]).tolist()
                sentence = f"the {there.colour} {there.kind} on {there.place} stands off"
                faults.append(Fault(FaultKind.OFF_CENTRE, square, sentence, (x, y)))
            if should is None and there is not None:
                faults.append(Fault(FaultKind.FOREIGN, square, f"something is on {square_place(square)}", (0, 0)))
        return BoardObservation.of(stands, states, faults)

    def places(self, believed: Inventory) -> dict[int, tuple[float, float]]:
        on_board = [piece for piece in believed if piece.place.on_board]
        at = {one: np.add(TABLE.xy(one.place), self.missed.get(one.name, (0.0, 0.0))).tolist() for one in on_board}
        return {piece.place.index: (x, y) for piece, (x, y) in at.items()}

    def begin(self, board: chess.Board) -> None:
        pass

    def confirm(self, board: chess.Board, look: Any = None) -> None:
        self.confirmed = board.fen()

    def note_not_there(self, name: str) -> None: ...

    def forget_likeness(self) -> None:
        pass

    def tell(self, told: Told) -> None: ...

    seen = None

    def answered(self, reply: AwaitedReply) -> bool:
        if not reply.possible(None):
            return False
        board = reply.position
        after = [board.copy(), *(board.copy() for _ in board.legal_moves)]
        for one, move in zip(after[1:], board.legal_moves, strict=True):
            one.push(move)
        shown = {piece.place.index for piece in self.truth if piece.place.on_board}
        return any(shown == set(one.piece_map()) for one in after[1:])


class Unattended(UnattendedAsker):
    def __init__(self, paper: Paper) -> None:
        self._paper = paper

    def mend(self, sentence: str, squares: tuple[str, ...], stands: Inventory) -> Told:
        self._paper.asked.append(sentence)
        return super().mend(sentence, squares, stands)


def table_of(
    folder: Path, fen: str = chess.STARTING_FEN, *, begun: bool = False, unfinished: Unfinished | None = None
) -> tuple[Table, Paper, GameRecord]:
    board = chess.Board(fen)
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    paper: Any = Paper(inventory)
    record = GameRecord.begin(folder, GameSetup("a", "b", 1, "fast"), board, inventory, 0.0)
    rig = BoardRig(MotionSettings().home, load_parameters())
    recovery = Recovery(paper, paper, Unattended(paper), record, UserInterface(), rig.clock)
    devices = Devices(rig.arm, rig.clock, None, None)
    return (
        Table(Position(board, inventory, begun, unfinished), devices, paper, recovery, record, UserInterface()),
        paper,
        record,
    )


def same(one: Inventory, other: Inventory) -> bool:
    return dict(one.standing) == dict(other.standing)


@pytest.mark.parametrize("seed", range(6))
def test_lost_pieces_are_found_and_carried_again_and_the_record_is_right(tmp_path: Path, seed: int) -> None:
    """Each piece may fall onto any free square near its way; history advances only once it stands."""
    draw = random.Random(seed)
    table, paper, record = table_of(tmp_path / "game")
    lost = 0
    with record:
        for _ in range(20):
            free = [square_place(s) for s in range(64) if paper.truth.at(square_place(s)) is None]
            if draw.random() < 0.4:
                paper.losses[paper.carried + draw.randrange(2)] = draw.choice(free)
            before = len(table.board.move_stack)
            waiting = len(paper.losses)
            assert table.arm_ply(draw.choice(list(table.board.legal_moves)))
            lost += waiting - len(paper.losses)
            paper.losses.clear()
            assert len(table.board.move_stack) == before + 1
            assert same(paper.truth, table.inventory)
            assert paper.confirmed == table.board.fen(), "the eyes learn what stands there"
    history = read_history(tmp_path / "game" / EVENTS_FILE, TABLE)
    assert same(history.inventory, paper.truth)
    assert len(history.plies) == 20
    assert not any(ply.resumed for ply in history.plies), "nobody else has gone on with any"
    assert all((ply.real_s, ply.planned_s) == ((None, None) if ply.mended else (1.0, 1.0)) for ply in history.plies)
    assert any(ply.mended for ply in history.plies)
    assert lost, "this seed has lost nothing: it shows nothing"
    troubles = [event for event in history.events if isinstance(event, TroubleEvent)]
    assert sum(trouble.kind == Loss.LOST for trouble in troubles) == lost


@pytest.mark.parametrize("blocked", [[], ["d2"], ["d2", "h6", "g6"]])
def test_a_piece_that_fell_is_stood_up_and_carried_to_where_it_belongs(tmp_path: Path, blocked: list[str]) -> None:
    """Where another piece is in the way of the fingers, wherever it goes, that one makes way and comes back."""
    table, paper, record = table_of(tmp_path / "game")
    paper.falls[0] = Place.parse("d5")
    paper.narrow = {("white-pawn-d", square) for square in blocked}
    with record:
        assert table.arm_ply(chess.Move.from_uci("e2e4"))
    assert (paper.stood_up, paper.asked) == (1, [])
    assert same(paper.truth, table.inventory)
    history = read_history(tmp_path / "game" / EVENTS_FILE, TABLE)
    assert same(history.inventory, paper.truth)
    kinds = [event.kind for event in history.events if isinstance(event, TroubleEvent)]
    assert kinds[0] == "lost"
    assert "fallen" in kinds


@pytest.mark.parametrize("captured", list(Captured))
def test_what_lies_is_stood_up_before_what_made_way_for_it_comes_back(
    tmp_path: Path, captured: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether or not it is found once more: or else its neighbour would come, go and come without end."""
    monkeypatch.setattr(sys.modules[__name__], "TABLE", TableSettings(captured=captured))
    table, paper, record = table_of(tmp_path / "game")
    paper.falls[0] = Place.parse("d5")
    paper.narrow, paper.against = {("white-pawn-d", "d2")}, "white-pawn-d"
    with record:
        assert table.arm_ply(chess.Move.from_uci("e2e4"))
    assert (paper.stood_up, paper.asked) == (1, [])
    assert same(paper.truth, table.inventory)
    moved = [task.transfers for task in read_history(tmp_path / "game" / EVENTS_FILE, TABLE).events
             if isinstance(task, TaskEvent)]  # fmt: skip
    assert len(moved) <= 3, "the neighbour goes and comes back once"


@pytest.mark.parametrize("immovable", [False, True])
def test_where_two_pieces_are_in_each_others_way_one_is_pushed(tmp_path: Path, immovable: bool) -> None:
    """And where no push helps, a person is asked."""
    table, paper, record = table_of(tmp_path / "game")
    paper.falls[0] = Place.parse("d5")
    paper.hemmed_in, paper.immovable = "white-pawn-d", immovable
    with record:
        if immovable:
            with pytest.raises(
                NeedsHand, match="the white pawn of e2 lies on d5, and the rook is in the way: stand it on e2"
            ):
                table.arm_ply(chess.Move.from_uci("e2e4"))
            return
        assert table.arm_ply(chess.Move.from_uci("e2e4"))
    assert (paper.pushed, paper.stood_up, paper.asked) == (1, 1, [])
    assert same(paper.truth, table.inventory)


def test_what_makes_room_for_a_push_stays_away_until_then(tmp_path: Path) -> None:
    """Even if what lies is not found without it."""
    table, paper, record = table_of(tmp_path / "game")
    paper.falls[0] = Place.parse("d5")
    paper.hemmed_in, paper.packed, paper.against = "white-pawn-d", "white-pawn-c", "white-pawn-c"
    with record:
        assert table.arm_ply(chess.Move.from_uci("e2e4"))
    assert (paper.pushed, paper.stood_up, paper.asked) == (1, 1, [])
    assert same(paper.truth, table.inventory)


@pytest.mark.parametrize("stirred", [False, True])
def test_what_leans_on_its_neighbours_is_parted_from_them_or_pushed_over(tmp_path: Path, stirred: bool) -> None:
    """Nobody can say how it lies until then; what went aside comes back."""
    table, paper, record = table_of(tmp_path / "game")
    piece = paper.truth.find("white-bishop-c")
    paper.lying[piece.name] = piece, piece.place
    paper.put(piece.name, None)
    paper.heap, paper.immovable = {"white-pawn-c"}, stirred
    with record:
        assert table.repair()
    assert (paper.stirred, paper.stood_up, paper.asked) == (int(stirred), 1, [])
    assert same(paper.truth, table.inventory)


def test_a_person_who_is_asked_in_vain_hears_what_is_seen_and_how_to_leave(tmp_path: Path) -> None:
    table, paper, record = table_of(tmp_path / "game")
    paper.put("white-bishop-c", None)
    said: list[str] = []

    class Idle(Exception):
        pass

    class Answers:
        def mend(self, sentence: str, squares: tuple[str, ...], stands: Inventory) -> Told:
            said.append(sentence)
            if len(said) > FRUITLESS:
                raise Idle
            return {}

    assert table._recovery is not None
    table._recovery._asker = Answers()
    with record, pytest.raises(Idle):
        table.repair()
    assert "still see" not in said[FRUITLESS - 1]
    assert "I have looked 3 times since then, and still see that c1 is empty" in said[FRUITLESS]
    assert "'touchmove resume'" in said[FRUITLESS]
    assert "'keep'" in said[FRUITLESS]


@pytest.mark.parametrize(
    ("prop", "loosened", "asked"), [("black-pawn-d", 9, False), ("white-rook-h", 9, True), ("white-rook-h", 2, False)]
)
def test_what_a_piece_leans_on_goes_to_its_place_first(tmp_path: Path, prop: str, loosened: int, asked: bool) -> None:
    """One that is far away does not: the piece is pushed, so that it lies otherwise, and at last a person is asked."""
    table, paper, record = table_of(tmp_path / "game", "rnbqkbnr/ppp1pppp/8/3p4/8/8/PPPPPPPP/RNBQKBNR w KQkq - 0 1")
    paper.falls[0], paper.prop, paper.loosened = Place.parse("d4"), prop, loosened
    with record:
        if asked:
            with pytest.raises(NeedsHand, match=f"could not be stood up in {MOST_TRIES} attempts"):
                table.arm_ply(chess.Move.from_uci("e2e4"))
            assert paper.stirred == (MOST_TRIES - 1) // SWUNG_AFTER
            return
        assert table.arm_ply(chess.Move.from_uci("e2e4"))
    assert (paper.stood_up, paper.asked) == (1, [])
    assert paper.stirred == (loosened if prop == "white-rook-h" else 0)
    assert same(paper.truth, table.inventory)


def test_what_a_piece_leans_on_moves_away_where_the_fingers_cannot_set_it_right(tmp_path: Path) -> None:
    """They would touch what leans on it; that is stood up before the other comes back."""
    table, paper, record = table_of(tmp_path / "game", "rnbqkbnr/ppp1pppp/8/3p4/8/8/PPPPPPPP/RNBQKBNR w KQkq - 0 1")
    paper.falls[0], paper.prop, paper.beside = Place.parse("d4"), "black-pawn-d", "black-pawn-d"
    with record:
        assert table.arm_ply(chess.Move.from_uci("e2e4"))
    assert (paper.stood_up, paper.stirred, paper.asked) == (1, 0, [])
    assert same(paper.truth, table.inventory)


@pytest.mark.parametrize(("in_the_way", "pushed"), [("black-queen", 1), ("black-rook-a", 0)])
def test_of_what_lies_and_what_it_leans_on_one_is_pushed_where_the_first_keeps_the_fingers_from_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_the_way: str, pushed: int
) -> None:
    """As a queen lay with her foot on that of a pawn: turned at her head, she would lie there for ever."""
    table, paper, _ = table_of(tmp_path / "game")
    queen, (x, y) = paper.truth.find("black-queen"), TABLE.xy(Place.parse("d7"))
    lies = MisplacedPiece(queen, queen.place, Pose(x - 0.02, y, yaw=math.radians(-60.0)))

    def refuse(name: str, misplaced: Any, stands: Inventory) -> Transfer:
        assert name == "black-pawn-d"
        piece = stands.find(in_the_way)
        raise InTheWay("the fingers would touch it", Obstacle.at(piece.name, piece.place, piece.kind, TABLE))

    monkeypatch.setattr(paper, "way_for", refuse)
    assert table._recovery is not None
    assert table._recovery._clearing.prop(lies, [lies], paper.truth) is bool(pushed)
    assert paper.pushed == pushed


@pytest.mark.parametrize("visits", [1, 3])
def test_what_a_hand_does_before_the_arm_begins_is_seen_first(tmp_path: Path, visits: int) -> None:
    """The ply is made all the same, once, and what the hand has moved is put back."""
    table, paper, record = table_of(tmp_path / "game")
    paper.visits = [("white-knight-b", Place.parse(square)) for square in ("c4", "c5", "c6")[:visits]]
    with record:
        assert table.arm_ply(chess.Move.from_uci("e2e4"))
    assert not paper.visits
    assert not paper.asked
    assert same(paper.truth, table.inventory)
    assert [move.uci() for move in table.board.move_stack] == ["e2e4"]
    history = read_history(tmp_path / "game" / EVENTS_FILE, TABLE)
    assert same(history.inventory, paper.truth)
    assert len(history.plies) == 1


@pytest.mark.parametrize(("losses", "held"), [(MOST_ROUNDS, True), (MOST_ROUNDS + 1, False)])
def test_the_arm_tries_as_often_as_it_says(tmp_path: Path, losses: int, held: bool) -> None:
    table, paper, record = table_of(tmp_path / "game")
    paper.losses = {number: Place.parse("e3" if number % 2 else "d3") for number in range(losses)}
    with record:
        if held:
            assert table.arm_ply(chess.Move.from_uci("e2e4"))
        else:
            with pytest.raises(UserError, match=f"still not right after {MOST_ROUNDS} attempts"):
                table.arm_ply(chess.Move.from_uci("e2e4"))


@pytest.mark.parametrize("turned", [False, True])
def test_what_stands_off_wherever_the_arm_sets_it_down_is_no_piece_to_put_right(tmp_path: Path, turned: bool) -> None:
    """Not even forty times: a board that lies elsewhere than is believed misses each time alike."""
    table, paper, record = table_of(tmp_path / "game")
    paper.shifts = [(0.0055, (-1) ** number * 0.002 if turned else 0.0005 * number) for number in range(4)]
    with record:
        if turned:
            assert table.arm_ply(chess.Move.from_uci("e2e4")), "an arm that errs otherwise each time tries on"
            assert not paper.asked
            return
        with pytest.raises(NeedsHand, match=r"the white pawn on e4 stands off, each time .* 'touchmove calibrate'"):
            table.arm_ply(chess.Move.from_uci("e2e4"))
    assert (paper.carried, len(paper.asked)) == (3, 1)


CAPTURE = "4k3/8/8/3p4/4P3/8/8/4K3 w - - 0 1"


@pytest.mark.parametrize(("off", "carried"), [(0.002, 2), (0.007, 3)])
def test_a_captured_piece_that_was_lost_over_a_tray_is_seen_there(tmp_path: Path, off: float, carried: int) -> None:
    """Where it stands right, nobody has to touch it again; a little off its place, it is carried there."""
    table, paper, record = table_of(tmp_path / "game", CAPTURE)
    pawn = table.inventory.at(Place.parse("d5"))
    assert pawn is not None
    with record:
        before = table.inventory
        paper.off = off
        paper.losses[0] = _first_tray(table, chess.Move.from_uci("e4d5"))
        assert table.arm_ply(chess.Move.from_uci("e4d5"))
    assert (paper.carried, paper.asked) == (carried, [])
    assert same(paper.truth, table.inventory)
    assert table.inventory.find(pawn.name).place.in_tray
    assert before.find(pawn.name).place.on_board


@pytest.mark.parametrize("blind", [LOOKS - 1, LOOKS])
def test_nobody_is_asked_before_several_looks_agree(tmp_path: Path, blind: int) -> None:
    table, paper, record = table_of(tmp_path / "game")
    paper.falls[0], paper.blind = Place.parse("d5"), blind
    asked = blind == LOOKS
    with record, pytest.raises(NeedsHand) if asked else nullcontext():
        table.arm_ply(chess.Move.from_uci("e2e4"))
    assert (paper.stood_up, len(paper.asked)) == ((0, 1) if asked else (1, 0))


def _first_tray(table: Table, move: chess.Move) -> Place:
    """Where the piece goes that a move captures."""
    return transfers(table.board, move, table.inventory).transfers[0].target


@pytest.mark.parametrize("hidden", [False, True])
@pytest.mark.parametrize("in_box", [False, True])
def test_what_was_lost_before_it_was_over_its_box_may_be_in_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_box: bool, hidden: bool
) -> None:
    monkeypatch.setattr(sys.modules[__name__], "TABLE", TableSettings(captured=Captured.BOX))
    table, paper, record = table_of(tmp_path / "game", "4k3/8/8/3p4/4P3/8/8/4K3 w - - 0 1")
    capture = chess.Move.from_uci("e4d5")
    goal = _first_tray(table, capture)
    paper.losses[0], paper.in_box = goal if in_box else None, in_box
    where = "black pawn on d5" if hidden else "black pawn into its box"
    with record, nullcontext() if in_box else pytest.raises(NeedsHand, match=where):
        assert table.repair(), "what was right before is known"
        paper.hidden = hidden
        table.arm_ply(capture)
        assert same(paper.truth, table.inventory)


@pytest.mark.parametrize(("blind", "stirred"), [(0, 0), (1, 0), (LOOKS, 1), (99, 6)])
def test_what_bounces_out_of_its_box_is_found_where_it_lies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, blind: int, stirred: int
) -> None:
    """The arm let it go where it should: all squares are as they should be, and only that something lies tells. What
    cannot be told is pushed, and only then asked for."""
    monkeypatch.setattr(sys.modules[__name__], "TABLE", TableSettings(captured=Captured.BOX))
    table, paper, record = table_of(tmp_path / "game", "4k3/8/8/3p4/4P3/8/8/4K3 w - - 0 1")
    capture = chess.Move.from_uci("e4d5")
    paper.bounces[0], paper.blind = Place.parse("h4"), blind
    asked = pytest.raises(NeedsHand, match="lies on h4 that may have bounced out of a box: if so, put the black pawn")
    with record, asked if stirred > 1 else nullcontext():
        table.arm_ply(capture)
        assert same(paper.truth, table.inventory)
    assert (paper.stood_up, paper.stirred) == (0 if stirred > 1 else 1, stirred)


def test_nobody_is_asked_twice_for_what_they_say_is_in_its_box(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Something else may lie there, which is no piece; whatever is captured later."""
    monkeypatch.setattr(sys.modules[__name__], "TABLE", TableSettings(captured=Captured.BOX))
    table, paper, record = table_of(tmp_path / "game", "4k3/8/8/3pp3/4PP2/8/8/4KR2 w - - 0 1")
    monkeypatch.setattr(Unattended, "mend", lambda self, sentence, squares, stands: paper.asked.append(sentence) or {})
    lies = [TABLE.xy(Place.parse("h4"))]
    monkeypatch.setattr(paper, "strange", lambda stands: tuple(lies))
    with record:
        assert table.arm_ply(chess.Move.from_uci("e4d5"))
        lies[0] = (lies[0][0] + 0.01, lies[0][1])
        assert table.arm_ply(chess.Move.from_uci("e5f4"))
        assert len(paper.asked) == 1
        lies.append(TABLE.xy(Place.parse("h6")))
        assert table.arm_ply(chess.Move.from_uci("f1f4"))
    assert len(paper.asked) == 2
    assert "h4" not in paper.asked[1]
    assert "h6" in paper.asked[1]


def test_what_was_lost_beside_its_box_is_asked_for_whatever_else_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.modules[__name__], "TABLE", TableSettings(captured=Captured.BOX))
    table, paper, record = table_of(tmp_path / "game", "r3k3/8/8/3p4/4P3/8/8/4K3 w - - 0 1")
    paper.losses[0] = None
    paper.put("black-rook-a", None)
    with record, pytest.raises(NeedsHand, match=r"black rook on a8; and .* black pawn into its box"):
        table.arm_ply(chess.Move.from_uci("e4d5"))


def test_a_piece_is_asked_for_only_after_all_else_is_right(tmp_path: Path) -> None:
    """What was missing is still known after a piece was lost while another one was: nothing drops out of the books."""
    table, paper, record = table_of(tmp_path / "game")
    with record:
        paper.put("white-knight-b", Place.parse("c4"))
        paper.put("black-knight-b", None)
        paper.losses[0] = Place.parse("b4")
        with pytest.raises(NeedsHand, match="put the black knight on b8"):
            table.repair()
    assert len(list(table.inventory)) == len(list(paper.truth)) + 1


def test_a_piece_that_is_gone_is_asked_for_and_no_ply_is_recorded(tmp_path: Path) -> None:
    table, paper, record = table_of(tmp_path / "game")
    paper.losses[0] = None
    with record, pytest.raises(NeedsHand, match="a piece is missing: put the white pawn on e2"):
        table.arm_ply(chess.Move.from_uci("e2e4"))
    history = read_history(tmp_path / "game" / EVENTS_FILE, TABLE)
    assert history.board.fen() == chess.STARTING_FEN
    assert len(paper.asked) == 1


def test_a_piece_moved_by_nobody_is_put_back(tmp_path: Path) -> None:
    table, paper, record = table_of(tmp_path / "game")
    with record:
        paper.put("white-knight-b", Place.parse("c4"))
        assert table.repair()
        assert same(paper.truth, table.inventory)
        assert not table.board.move_stack
        history = read_history(tmp_path / "game" / EVENTS_FILE, TABLE)
        assert history.unfinished is None
        assert same(history.inventory, paper.truth)


def test_an_answer_that_comes_before_the_arm_is_home_is_no_fault(tmp_path: Path) -> None:
    table, paper, record = table_of(tmp_path / "game")
    paper.answer = chess.Move.from_uci("g8f6")
    with record:
        assert table.arm_ply(chess.Move.from_uci("e2e4"), answers=True)
    assert paper.carried == 1, "the knight stays where the person has put it"
    assert not hasattr(paper, "confirmed"), "the eyes do not take the picture for the position before the answer"
    history = read_history(tmp_path / "game" / EVENTS_FILE, TABLE)
    assert [ply.uci for ply in history.plies] == ["e2e4"]
    assert not any(isinstance(event, TroubleEvent) for event in history.events)


@pytest.mark.parametrize("plays", [chess.WHITE, chess.BLACK])
def test_a_move_that_a_person_made_while_nobody_looked_is_theirs(tmp_path: Path, plays: chess.Color) -> None:
    table, paper, record = table_of(tmp_path / "game", begun=True)
    paper.put("white-pawn-e", Place.parse("e4"))
    with record:
        assert table.begin(frozenset({plays}))
    if plays is chess.WHITE:
        assert table.replied
        assert paper.carried == 0
        assert not hasattr(paper, "confirmed"), "the eyes know the position before the move"
    else:
        assert not table.replied
        assert paper.truth.at(Place.parse("e2")) is not None, "whoever plays here leaves the pieces to the arm"
        assert paper.confirmed == table.board.fen()
    assert not paper.asked


@pytest.mark.parametrize("unfinished", [Unfinished(uci="e2e4"), Unfinished(uci="e2e4", repair=())])
def test_an_answer_to_what_was_under_way_when_the_program_died_is_no_fault(
    tmp_path: Path, unfinished: Unfinished
) -> None:
    table, paper, record = table_of(tmp_path / "game", begun=True, unfinished=unfinished)
    if unfinished.repair is None:
        paper.answer = chess.Move.from_uci("e7e5")
    else:
        paper.put("white-pawn-e", Place.parse("e4"))
        table.inventory = paper.truth  # as it was found before the repair
        paper.put("black-pawn-e", Place.parse("e5"))
    with record:
        assert table.begin(frozenset({chess.BLACK}))
    assert table.replied
    assert table.board.peek() == chess.Move.from_uci("e2e4")
    assert paper.truth.at(Place.parse("e5")) is not None
    assert not paper.asked


@pytest.mark.parametrize(("answer", "answers"), [("g8f6", False), ("g8g5", True)])
def test_what_nobody_may_have_played_is_put_back(tmp_path: Path, answer: str, answers: bool) -> None:
    """A piece that the arm may have taken along, and one that went where it must not."""
    table, paper, record = table_of(tmp_path / "game")
    paper.answer = chess.Move.from_uci(answer)
    with record:
        assert table.arm_ply(chess.Move.from_uci("e2e4"), answers=answers)
    assert same(paper.truth, table.inventory)


@pytest.mark.parametrize("moves_itself", [False, True])
def test_a_piece_that_is_in_the_way_of_the_fingers_goes_first(tmp_path: Path, moves_itself: bool) -> None:
    """To where it has to go, or aside and back."""
    table, paper, record = table_of(tmp_path / "game")
    with record:
        paper.put("black-knight-b", Place.parse("c4"))
        paper.crowded = "white-bishop-c"
        if moves_itself:
            paper.put("white-bishop-c", Place.parse("d4"))
        assert table.repair()
        assert same(paper.truth, table.inventory)
    assert (paper.carried, paper.asked, paper.crowded) == (2 if moves_itself else 3, [], None)


def test_a_piece_at_which_the_fingers_do_not_get_is_pushed_before_anybody_is_asked(tmp_path: Path) -> None:
    """It leans on a pawn that cannot make way for it, and seems to stand."""
    table, paper, record = table_of(tmp_path / "game")
    with record:
        paper.put("black-knight-b", Place.parse("c4"))
        paper.wedged, paper.immovable = "black-knight-b", True
        assert table.repair()
    assert same(paper.truth, table.inventory)
    assert (paper.stirred, paper.asked) == (1, [])


def test_the_board_is_looked_at_again_before_the_arm_moves_after_a_while(tmp_path: Path) -> None:
    """What somebody has knocked aside while a player thought is put back before, and not after it was run into."""
    table, paper, record = table_of(tmp_path / "game")
    paper.looked_at = -1.0
    with record:
        paper.put("black-knight-b", Place.parse("c4"))
        assert table.arm_ply(chess.Move.from_uci("e2e4"))
    history = read_history(tmp_path / "game" / EVENTS_FILE, TABLE)
    order = [event.event for event in history.events if event.event in ("task_done", "ply")]
    assert order == ["task_done", "ply"]


def test_what_cannot_be_mended_ends_with_a_sentence(tmp_path: Path) -> None:
    table, paper, record = table_of(tmp_path / "game")
    for number in range(50):
        paper.losses[number] = Place.parse("e3") if number % 2 == 0 else Place.parse("d3")
    with record, pytest.raises(UserError, match="still not right after 40 attempts"):
        table.arm_ply(chess.Move.from_uci("e2e4"))
    assert read_history(tmp_path / "game" / EVENTS_FILE, TABLE).board.fen() == chess.STARTING_FEN


def test_the_record_of_a_game_killed_while_it_mends_can_be_read(tmp_path: Path) -> None:
    """Cut after each line: it tells what was under way, and never contradicts itself."""
    table, paper, record = table_of(tmp_path / "game")
    paper.losses[1] = Place.parse("e6")
    with record:
        for uci in ("e2e4", "d7d5", "e4d5"):
            table.arm_ply(chess.Move.from_uci(uci))
        table.take_back(2)
        paper.put("white-knight-b", Place.parse("c4"))
        table.repair()
    lines = (tmp_path / "game" / EVENTS_FILE).read_text().splitlines(keepends=True)
    (tmp_path / "cut").mkdir()
    for cut in range(1, len(lines) + 1):
        (tmp_path / "cut" / EVENTS_FILE).write_text("".join(lines[:cut]))
        history = read_history(tmp_path / "cut" / EVENTS_FILE, TABLE)
        if history.unfinished is None:
            history.inventory.check_against(history.board)
    assert history.board.fen() == table.board.fen()
    assert same(history.inventory, paper.truth)


@pytest.mark.parametrize(("x", "shown"), [(0.2, True), (0.1, False)])
def test_a_spare_beside_its_place_shows_a_move_all_the_same_but_none_on_the_board(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, x: float, shown: bool
) -> None:
    table, paper, _ = table_of(tmp_path / "game")
    spare = next(piece for piece in START if piece.place.in_tray)
    standing = {piece.name: TABLE.xy(piece.place) for piece in START} | {spare.name: (x, 0.0)}
    seen = Whereabouts(standing, frozenset({spare.name}), ())
    monkeypatch.setattr(paper, "whereabouts", lambda stands: seen)
    assert shows_after(table, chess.Move.from_uci("e2e4")) == shown
