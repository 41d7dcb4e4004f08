"""What the camera says of the board: whether it stands as the game wants it, and what a person played.

The view of the board follows it: a camera or a board that was moved is found again. Every frame asked for here is
exposed after the asking, with the arm at home.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Set
from dataclasses import replace
from typing import Final

import chess

from app.execution.board_view import Reading, find_view, look_shown
from app.execution.fresh_frames import FreshFrames
from app.execution.repair import BoardObservation, Whereabouts, exchanged, known_better, toppled, whereabouts
from app.execution.repair.behind import behind_another
from app.execution.repair.observed import HEIGHTS, kinds_on_squares, on_board, shown_position
from app.execution.state import AwaitedReply, CannotSee, Devices, Told
from app.execution.unseen_reply import pieces_of, reply_shown
from app.pieces.inventory import Inventory
from app.pieces.layout import KINDS
from app.terminal.shown import LookShown
from hardware.interfaces import Frame, Intrinsics
from hardware.piece_set import Colour, Kind, Look
from hardware.table import PieceSpec, Place, TableSettings, square_place
from vision.board.moved import Anchor
from vision.board.view import BoardNotFound, BoardView, playing_area
from vision.pieces.boxes import holds_more
from vision.pieces.centres import piece_centres
from vision.pieces.lying_or_standing import MisplacedPiece
from vision.pieces.misplaced import around_board, find_misplaced
from vision.pieces.placement_faults import Examination, Fault, FaultKind, examine_board
from vision.pieces.swapped import SHIFTED, UNLIKE, KnownPicture, looked_closer
from vision.reading.appearance import BLACK, WHITE
from vision.reading.diagnosis import explain
from vision.reading.observer import Observation, Observer
from vision.reading.outcome import LOOKS, ReadingOutcome, Situation
from vision.reading.rectified_view import sight_of_frame
from vision.standing.recognise import recognise
from vision.standing.recognised_set import RecognisedSet
from vision.standing.sightings import Sightings, sightings_of, together

_ANSWERS: Final = frozenset({Situation.LEGAL, Situation.UNFINISHED})


class GameObserver(FreshFrames):
    """Follows one game by one camera, from ``begin`` on.

    Args:
        devices: of the rig; it has a camera.
        table: board and trays.
        view: where the board should be in the pictures of a camera, by calibration; None: nobody knows, so it is
            searched for.
        show: told what each look came to.
    """

    def __init__(
        self, devices: Devices, table: TableSettings, view: Callable[[Intrinsics], BoardView | None],
        show: Callable[[LookShown], None] = lambda _: None,
    ) -> None:  # fmt: skip
        super().__init__(devices)
        self._show = show
        self._table, self._believed = table, view
        self._observer: Observer | None = None
        self._shows_known: KnownPicture | None = None
        """A picture of the known position, if there is one."""
        self._boxes_known: KnownPicture | None = None
        """The newest picture of a known position, also while an answer may have been played."""
        self._likeness: dict[int, tuple[str, float, tuple[float, float]]] = {}
        """Of pieces when the board was last as it should be, by square: name, how well it looked like itself, and
        where its centre was [m]."""
        self._untouched: frozenset[int] = frozenset()
        """Squares whose pieces look just as they did then, in the frame that was verified last."""
        self._sighted: tuple[tuple[Frame, BoardView, Inventory], Sightings] | None = None
        """What was asked for last, and what was seen: one look answers several questions."""
        self._told: Told = {}
        self._not_there = set[str]()
        """Pieces that were not where they were taken to be, since the board was last right."""
        self._doubted: frozenset[int] = frozenset()
        self._assumed = False
        """Nobody has seen yet that the board shows the position that was believed to stand there."""
        self._wrong: frozenset[int] = frozenset()
        """Squares on which something was wrong when the board was last examined, but for pieces off their centres."""
        self._strayed: dict[str, tuple[float, float]] = {}
        """Where pieces were that did not stand where they should, by name, since the board was last right [m]."""

    def begin(self, board: chess.Board) -> None:
        """Find the board, and learn the set from a position that stands there, with the arm at home.

        Raises:
            CannotSee: there is no board in the picture.
            HardwareError: the camera failed.
        """
        frame = self.frame()
        self._hold(frame, find_view(frame, board, self._table, self._believed(frame.intrinsics)))
        self._observer = Observer(board, sight_of_frame(frame, self.view))
        self._shows_known = self._boxes_known = KnownPicture(frame, self.view)

    def recognise(self, held: Mapping[Look, int]) -> RecognisedSet:
        """What stands on the table, of which nothing is known, in new frames; ``held`` says how many there are of each.

        Raises:
            CannotSee: the board is not in the picture, nobody knows which side of it is White's, or there is no depth.
            HardwareError: the camera failed.
        """
        frames = [self.frame() for _ in range(LOOKS)]
        if not self.deep:
            raise CannotSee(
                "the camera has no depth, which is needed to identify pieces: give the position with --fen instead"
            )
        return recognise(frames, find_view(frames[0], None, self._table, self._believed(frames[0].intrinsics)), held)

    @property
    def _known(self) -> Observer:
        assert self._observer is not None, "begin first"
        return self._observer

    def verify(self, stands: Inventory, righted: Set[str] = frozenset()) -> BoardObservation:
        """Whether the board is as it should be, in a new frame; ``stands`` says what should stand where.

        ``righted`` are names of pieces that have just been stood up: they are held against depth besides, as one that
        lies in its place may look from afar as if it stood.

        Raises:
            CannotSee: the board is not in the picture.
            HardwareError: the camera failed.
        """
        if self._observer is None:
            self.begin(shown_position(stands))
            self._assumed = True
        self._follow(frame := self.frame())
        expected, examined = on_board(stands), self._examine(stands)
        faults = examined.faults
        if self.deep and not righted.isdisjoint(piece.name for piece in expected.values()):
            low = {fault.square: fault for fault in toppled(stands, self._sightings(stands))}
            faults += tuple(low[square] for square in low.keys() - {fault.square for fault in faults}
                            if expected[square].name in righted)  # fmt: skip
        self._doubted = frozenset(fault.square for fault in faults if fault.kind is FaultKind.FALLEN)
        self._wrong |= self._doubted
        if not faults:
            self._strayed, self._assumed = {}, False
            self._not_there.clear()
            self._remember(expected, examined)
            return BoardObservation({})
        look = self._known.look(sight_of_frame(frame, self.view))
        sentence = " and ".join(fault.sentence for fault in faults)
        self._publish(ReadingOutcome.DOUBT, sentence, (fault.square for fault in faults), look)
        states = look.evidence.read(self._known.pictured)
        for square in examined.likeness.keys() - self._wrong:  # a piece's outline says more than its square's colours
            states[square] = WHITE if expected[square].colour is Colour.WHITE else BLACK
        for place, (colour, _) in self._told.items():
            states[place.index] = WHITE if colour is Colour.WHITE else BLACK
        top = None if look.solids is None else look.solids.top
        kinds = kinds_on_squares(stands, states, top, self._heights())
        kinds |= {place.index: {kind: 1.0} for place, (_, kind) in self._told.items()}
        return BoardObservation.of(stands, states, faults, kinds=kinds)

    def _examine(self, stands: Inventory) -> Examination:
        """Hold the newest frame against what should stand on the squares, and how the same pieces looked before."""
        expected = on_board(stands)
        known = {square: likeness for square, (name, likeness, _) in self._likeness.items()
                 if square in expected and expected[square].name == name}  # fmt: skip
        examined = examine_board(self.last, self.view, expected, known)
        self._untouched = frozenset(
            square for square, was in known.items()
            if square in examined.likeness and was - examined.likeness[square] < UNLIKE
            and math.dist(self._likeness[square][2], examined.centres[square]) < SHIFTED
        )  # fmt: skip
        if examined.faults and self.deep:
            faults = known_better(examined.faults, stands, self._sightings(stands), self._heights())
            examined = replace(examined, faults=faults)
        self._wrong = frozenset(fault.square for fault in examined.faults if fault.kind is not FaultKind.OFF_CENTRE)
        return examined

    def remember(self, stands: Inventory) -> None:
        """How pieces look that stand where they should, in the newest frame: the next look is held against that."""
        examined = self._examine(stands)
        if not examined.faults:
            self._remember(on_board(stands), examined)

    def _remember(self, expected: Mapping[int, PieceSpec], examined: Examination) -> None:
        self._likeness = {
            square: (expected[square].name, one, examined.centres[square]) for square, one in examined.likeness.items()
        }

    def _heights(self) -> dict[Kind, float]:
        """Of the kinds as this camera sees them [m]; as the settings say, where it has not."""
        seen = self._known.heights
        return {kind: seen.get(piece_type, HEIGHTS[kind]) for piece_type, kind in KINDS.items()}

    def whereabouts(self, stands: Inventory) -> Whereabouts | None:
        """What stands where in the newest frame, and some more while that is not sure, or outlines belie it; None: it
        is not sure, or there is no depth.
        """
        looks = list[Sightings]()
        while self.deep and len(looks) < LOOKS:
            if looks:
                self.frame()
            looks.append(self._sightings(stands))
            found = whereabouts(stands, together(looks), self._heights(), self._untouched, self._told)
            if found is not None and (len(looks) == LOOKS or not self._belied(found)):
                found = behind_another(found, stands, self.last, self.view, self._not_there)
                return found if not found.nudged else self._nudged_twice(found, stands)
        return None

    def _belied(self, found: Whereabouts) -> bool:
        """Whether depth has a piece of the board lie where by outlines all stand: in a hundred looks once or so what
        stands is too wide for depth.
        """
        return bool(found.lying and found.missing) and not self._wrong

    def note_not_there(self, name: str) -> None:
        """The arm has not found a piece where it was taken to be."""
        self._not_there.add(name)

    def _nudged_twice(self, found: Whereabouts, stands: Inventory) -> Whereabouts:
        """At a picture's edge depth errs now and then: what was nudged is so in another frame, too."""
        self.frame()
        again = whereabouts(stands, self._sightings(stands), self._heights(), self._untouched, self._told)
        return replace(found, nudged=found.nudged & (frozenset() if again is None else again.nudged))

    def _sightings(self, stands: Inventory) -> Sightings:
        """What stands and lies in the newest frame, which has depth."""
        asked = self.last, self.view, stands
        if self._sighted is None or any(one is not other for one, other in zip(asked, self._sighted[0], strict=True)):
            expected = {piece.place: piece for piece in stands if not piece.place.in_box}
            self._sighted = asked, sightings_of(*asked[:2], expected, around_board(self.view, trays=True))
        return self._sighted[1]

    def strange(self, stands: Inventory) -> tuple[tuple[float, float], ...]:
        """Where something is in the newest frame that no piece explains, board frame [m]; nothing without depth."""
        return self._sightings(stands).strange if self.deep else ()

    def has_fallen_in(self, place: Place) -> bool:
        """Whether something has come into the box of a place since the position was last known, as far as is seen."""
        known, now = self._boxes_known, KnownPicture(self.last, self.view)
        if known is None or known.view is not self.view or known.frame.depth is None or not self.deep or self._assumed:
            return False
        return holds_more(known, now, self._table.box_of(place))

    def faults(self, stands: Inventory, *, beyond: float, exchanges: bool = True) -> tuple[Fault, ...]:
        """What is not as it should be in the newest frame; without depth nobody can tell what lies, so nothing.

        Args:
            stands: what should stand where.
            beyond: pieces that stand, but further off the centres of their squares, count as well [m].
            exchanges: so do pieces that look alike and stand on each other's squares.
        """
        if not self.deep:
            return ()
        faults = tuple(toppled(stands, self._sightings(stands)))
        low = {fault.square for fault in faults}
        faults += tuple(fault for fault in self._examine(stands).faults if fault.square not in low)
        if exchanges and not faults and (seen := self.whereabouts(stands)) is not None and not seen.lying:
            faults = tuple(exchanged(stands, seen))
        return tuple(fault for fault in faults if fault.astray(stands.table) >= beyond)

    def forget_likeness(self) -> None:
        """Pieces were touched: how they looked before says nothing any more, nor what a person has said of them."""
        self._likeness, self._told = {}, {}

    def tell(self, told: Told) -> None:
        """What a person says stands on squares; it counts until something is touched."""
        self._told = dict(told)

    def places(self, believed: Inventory) -> dict[int, tuple[float, float]]:
        """Where pieces stand in the newest frame, board frame (x, y) [m], by square; those alone that can be seen.

        ``believed`` says what stands where.
        """
        centres = piece_centres(self.last, self.view, on_board(believed))
        return {square: (one.x, one.y) for square, one in centres.items() if one.upright}

    def misplaced(
        self, stands: Inventory, besides: Collection[PieceSpec] = (), seen: Whereabouts | None = None
    ) -> list[MisplacedPiece]:
        """Pieces in the newest frame that lie or stand elsewhere than they should; also of some that nobody sees.

        ``seen``: what stands where, if that is known already.
        """
        # of several alike, what is found is rather the one that is missing on the board
        rows = sorted(stands, key=lambda piece: not piece.place.on_board)
        expected = {piece.place: piece for piece in rows if not piece.place.in_box}
        doubted = {square_place(square) for square in self._doubted}
        before = {place: self._strayed[piece.name] for place, piece in expected.items() if piece.name in self._strayed}
        seen = seen or self.whereabouts(stands)
        standing = {} if seen is None else {stands.find(name).place: at for name, at in seen.standing.items()}
        misplaced = find_misplaced(self.last, self.view, expected, doubted=doubted, trays=True, before=before,
                                   standing=standing, besides=besides)  # fmt: skip
        self._strayed |= {one.piece.name: (one.pose.x, one.pose.y) for one in misplaced}
        return list(misplaced)

    def read(self) -> Reading:
        """What was played since the known position, in a new frame.

        Raises:
            CannotSee: the board is not in the picture.
            HardwareError: the camera failed.
        """
        frame = self.frame()
        self._follow(frame)
        return self._read(frame)

    def _read(self, frame: Frame) -> Reading:
        look = self._known.look(sight_of_frame(frame, self.view))
        decision = self._known.decide(look)
        known = self._known.pictured  # what ``board`` had before a move that nobody has looked at since
        states, altered = look.evidence.read(known), look.evidence.altered(known)
        finding = explain(states, self._known.board, altered, decision.move, look.evidence.unsure(known))
        if self._shows_known is not None:
            now, pieces = KnownPicture(frame, self.view), pieces_of(self._known.board)
            finding = looked_closer(finding, states, self._known.board, self._shows_known, now, pieces)
        sure = decision.verdict is ReadingOutcome.MOVE
        text = f"{self._known.board.variation_san(decision.moves)} was played" if sure else finding.sentence
        self._publish(decision.verdict, text, finding.squares, look)
        return Reading(decision, finding, look)

    def _publish(self, outcome: ReadingOutcome, text: str, squares: Iterable[int], look: Observation) -> None:
        """Show what the newest frame came to, to whom it concerns."""
        likelihood = look.evidence.likelihood(self._known.pictured)
        self._show(look_shown(self.last, self.view, outcome, text, squares, likelihood))

    def answered(self, reply: AwaitedReply) -> bool:
        """Whether the newest frame shows that somebody has made the next move already, or has begun to.

        The position that it follows is known from now on, if a hand can have made it.
        """
        if not reply.possible(self._guard):
            return False
        board = reply.position
        if self._assumed and not self._learn_from_reply(board):
            return False
        self._known.stand(board)
        self._shows_known = None
        reading = self._read(self.last)
        return reading.decision.verdict is ReadingOutcome.MOVE or reading.finding.situation in _ANSWERS

    def _learn_from_reply(self, board: chess.Board) -> bool:
        """What was learnt from a position that does not stand there is learnt again, from one move later."""
        move = reply_shown(self.last, self.view, board, self._wrong)
        if move is None:
            return False
        after = board.copy()
        after.push(move)
        self._observer = Observer(after, sight_of_frame(self.last, self.view))
        self._assumed = False
        return True

    def confirm(self, board: chess.Board, look: Observation | None = None) -> None:
        """The position is known: by the rules, a person, or since the arm has made it; shown by a look, or the newest
        frame.
        """
        if look is None:
            look = self._known.look(sight_of_frame(self.last, self.view))
            self._publish(ReadingOutcome.NOTHING, "the board is as the game says", (), look)
        self._known.confirm(look, board)
        self._assumed = False
        self._shows_known = self._boxes_known = KnownPicture(self.last, self.view)

    def _follow(self, frame: Frame) -> None:
        check = self._anchor.follow(frame.colour)
        if check.moved is None:
            raise CannotSee(
                "the board cannot be found in the camera's picture: clear the view of its edges and squares"
            )
        if check.moved:
            try:
                view = BoardView.from_corners(frame.intrinsics, check.corners, self._table)
            except BoardNotFound as error:
                raise CannotSee(f"camera or board have moved: {error}") from error
            self._hold(frame, view)

    def _hold(self, frame: Frame, view: BoardView) -> None:
        try:
            anchor = Anchor(frame.colour, view.project(playing_area(self._table)))
        except BoardNotFound as error:
            raise CannotSee(f"the camera does not see the board: {error}") from error
        self.view = view
        """Where the board is in the pictures."""
        self._likeness = {}
        if self._guard is not None:
            self._guard.look(view)
        self._anchor = anchor
