"""Follow a game in settled pictures: read each, ask where in doubt, keep score where the truth is known."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final

import chess
import chess.pgn
import numpy as np
from rich.console import Group, RenderableType

from app.measure.photographs.labels import FrameLabel, Labels
from app.measure.photographs.pictures import Picture
from app.terminal.report_table import rows_table
from hardware.frozen import Frozen
from vision.arrays import Array
from vision.board.view import BoardNotFound
from vision.reading.evidence import codes_of, states_of
from vision.reading.moves import MoveReading
from vision.reading.observer import Observation, Observer
from vision.reading.outcome import ReadingOutcome
from vision.reading.rectified_view import sight_of_picture

PLIES: Final = 2  # a settled view may be two plies after the one before: the other player answered at once

Line = tuple[chess.Move, ...]
CornerSource = Callable[[Picture], Array]
"""Gives the outer corners of the playing area a1, h1, h8, a8 in a picture, shape (4, 2) [px].

Raises BoardNotFound where that cannot be said.
"""


class VisionEvent(Frozen):
    """One picture, or one settled view of a video."""

    frame: str  # name of its file; of a video, its number
    moves: tuple[str, ...]  # played since the one before, in UCI; where it was asked, what the answer was
    confidence: float  # probability of the moves by what was seen, before anybody was asked
    asked: bool  # whether a person had to say what was played
    said: str = ""  # what there is to say about it, in words


class Score(Frozen):
    """How it compares with what is known."""

    plies: int  # that were played by the labels
    right: int  # of them, seen and accepted as played
    wrong: int  # accepted as something else, or overlooked
    asked: int  # left to a person
    square_accuracy: float | None
    """Share of squares whose state (empty, white, black) was read right, before the rules and any answer counted; the
    first picture left out. None where no position is known."""


class VisionReport(Frozen):
    """A game followed: ``score`` is None where the truth is not known.

    ``failed`` says why it could not be followed to the end.
    """

    events: tuple[VisionEvent, ...]
    score: Score | None
    pgn: str
    failed: str | None = None

    @property
    def holds(self) -> bool:
        """Followed to the end, and nothing wrong where that is known."""
        return self.failed is None and (self.score is None or self.score.wrong == 0)

    def table(self) -> RenderableType:
        """For people: the game, and how sure its moves were."""
        rows = [
            (one.frame, " ".join(one.moves) or "-", f"{one.confidence:.4f}", "asked" if one.asked else one.said)
            for one in self.events
        ]
        title = self.failed or self.pgn
        return Group(rows_table(("frame", "moves", ">confidence", ""), rows, title), self._summary())

    def _summary(self) -> str:
        asked = sum(event.asked for event in self.events)
        if self.score is None:
            return f"{len(self.events)} views, asked at {asked}"
        one = self.score
        squares = "" if one.square_accuracy is None else f", {100 * one.square_accuracy:.2f} % of squares read right"
        return f"{one.plies} plies: {one.right} right, {one.wrong} wrong, {one.asked} asked{squares}"


@dataclass(slots=True)
class _FollowedGame:
    """A game as it is followed: position, moves, events, and its score where the truth is known."""

    labels: Labels | None
    start: chess.Board
    played: list[chess.Move] = field(default_factory=list)
    events: list[VisionEvent] = field(default_factory=list)
    observer: Observer | None = None
    failed: str | None = None
    plies: int = 0
    right: int = 0
    wrong: int = 0
    asked: int = 0
    squares_read: list[bool] = field(default_factory=list)
    """Of each square of each picture whose position is known: whether it was read right."""

    def report(self) -> VisionReport:
        if self.labels is not None and self.labels.video is not None:
            self._score_video(self.labels.moves_uci)
        score = None
        if self.labels is not None:
            accuracy = float(np.mean(self.squares_read)) if self.squares_read else None
            score = Score(
                plies=self.plies, right=self.right, wrong=self.wrong, asked=self.asked, square_accuracy=accuracy
            )
        board = self.start.copy()
        for move in self.played:
            board.push(move)
        pgn = chess.pgn.Game.from_board(board).accept(chess.pgn.StringExporter(headers=False, columns=None))
        return VisionReport(events=tuple(self.events), score=score, pgn=pgn, failed=self.failed)

    def _score_video(self, truth: tuple[str, ...]) -> None:
        """A video's views are not people's to choose: what counts is the game in the end."""
        asked = [event.asked for event in self.events for _ in event.moves]
        played = [move for event in self.events for move in event.moves]
        self.plies, self.asked = len(truth), sum(asked)
        self.right = sum(
            one == other and not by_a_person for one, other, by_a_person in zip(played, truth, asked, strict=False)
        )
        self.wrong = max(len(truth), len(played)) - self.right - self.asked

    def take(self, picture: Picture, corners: CornerSource) -> bool:
        """Take the next settled view in; false where the game cannot be followed."""
        label = self.labels.of_view(picture.name, len(self.played)) if self.labels is not None else None
        try:
            sight = sight_of_picture(picture.colour, corners(picture), picture.stamp)
        except BoardNotFound as error:
            if self.observer is None:
                self.failed = f"{picture.name}: {error}"
                return False
            unread = MoveReading(ReadingOutcome.DOUBT, (), 0.0, -np.inf, ())
            self._ask(self.observer, picture, None, label, unread, str(error))
            return True
        if self.observer is None:
            self.observer = Observer(self.start, sight)
            self.events.append(VisionEvent(frame=picture.name, moves=(), confidence=1.0, asked=False, said="start"))
        else:
            self._read(self.observer, picture, self.observer.look(sight), label)
        return True

    def _read(self, observer: Observer, picture: Picture, look: Observation, label: FrameLabel | None) -> None:
        if label is not None and label.fen is not None:
            truth = states_of(codes_of(chess.Board(label.fen)))
            self.squares_read += (look.evidence.read(codes_of(observer.board)) == truth).tolist()
        decision = observer.decide(look, PLIES)
        if decision.verdict is ReadingOutcome.DOUBT or decision.promotion_unsure:
            self._ask(observer, picture, look, label, decision, _doubt(decision))
            return
        board = observer.board.copy()
        for move in decision.moves:
            board.push(move)
        moves = tuple(move.uci() for move in decision.moves)
        if label is not None:
            truth_moves = label.moves_since_previous
            self.plies += len(truth_moves)
            if moves == truth_moves:
                self.right += len(truth_moves)
            else:
                self.wrong += max(len(truth_moves), len(moves))
        self._go_on(observer, look, board, decision.moves)
        self.events.append(VisionEvent(frame=picture.name, moves=moves, confidence=decision.confidence, asked=False))

    def _ask(
        self, observer: Observer, picture: Picture, look: Observation | None, label: FrameLabel | None,
        decision: MoveReading, said: str,
    ) -> None:  # fmt: skip
        """A person says what was played, where there is one; the position stays what it was where there is none."""
        answer: Line = ()
        if label is not None:
            answer = tuple(chess.Move.from_uci(move) for move in label.moves_since_previous)
            self.plies += len(answer)
            self.asked += len(answer)
        elif decision.promotion_unsure:
            answer = decision.moves
        if label is not None or decision.promotion_unsure:
            self._go_on(observer, look, _after(observer.board, answer, label), answer)
        moves = tuple(move.uci() for move in answer)
        self.events.append(
            VisionEvent(frame=picture.name, moves=moves, confidence=decision.confidence, asked=True, said=said)
        )

    def _go_on(self, observer: Observer, look: Observation | None, board: chess.Board, moves: Line) -> None:
        if look is None:
            observer.board = board.copy()
        else:
            observer.confirm(look, board)
        if board.move_stack:
            self.played.extend(moves)
        elif board.fen() != self.start.fen():  # a person set the position: the game goes on from there
            self.start, self.played = board.copy(), []


def follow(
    pictures: Iterable[Picture], labels: Labels | None, corners: CornerSource, progress: Callable[[str], None],
    start: chess.Board,
) -> VisionReport:  # fmt: skip
    """Follow a game in settled views from the position ``start``.

    The first picture is taken to show that; it is how the set is learnt. A wrong
    move that was accepted is never corrected by the labels; where the game asks, they answer. Without labels
    it stays at its last known position until a view is clear again.
    """
    game = _FollowedGame(labels, start.copy(stack=False))
    for number, picture in enumerate(pictures):
        progress(f"picture {number + 1}: {picture.name}")
        if not game.take(picture, corners):
            break
    return game.report()


def _after(board: chess.Board, moves: Line, label: FrameLabel | None) -> chess.Board:
    """The position after an answer; the answer's own one where its moves are not legal in ours."""
    after = board.copy()
    for move in moves:
        if move not in after.legal_moves:
            return chess.Board(label.fen) if label is not None and label.fen is not None else board
        after.push(move)
    return after


def _doubt(decision: MoveReading) -> str:
    if decision.promotion_unsure:
        return "which piece was the pawn promoted to?"
    squares = ", ".join(chess.square_name(square) for square in decision.squares[:4])
    return f"what stands on {squares}?" if squares else "no move explains this picture well enough"
