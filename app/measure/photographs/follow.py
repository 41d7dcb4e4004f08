"""Follow a game in settled pictures: read each, ask where in doubt, keep score where the truth is known."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final

import chess
import chess.pgn
import numpy as np

from app.measure.photographs.labels import FrameLabel, Labels
from app.measure.photographs.pictures import Array, Picture
from app.measure.photographs.report import Score, VisionEvent, VisionReport
from vision.board.view import BoardNotFound
from vision.reading.evidence import codes_of, states_of
from vision.reading.moves import MoveReading
from vision.reading.observer import Observation, Observer
from vision.reading.outcome import ReadingOutcome
from vision.reading.rectified_view import sight_of_picture

PLIES: Final = 2
"""A settled view may be a move and its answer away from the one before: the other player answered at once."""

Line = tuple[chess.Move, ...]
CornerSource = Callable[[Picture], Array]
"""Gives the outer corners of the playing area a1, h1, h8, a8 in a picture, shape (4, 2) [px].

Raises BoardNotFound where nobody can say.
"""


@dataclass(slots=True)
class _Tally:
    plies: int = 0
    right: int = 0
    wrong: int = 0
    asked: int = 0
    squares: int = 0
    squares_right: int = 0

    def score(self) -> Score:
        accuracy = self.squares_right / self.squares if self.squares else None
        return Score(plies=self.plies, right=self.right, wrong=self.wrong, asked=self.asked, square_accuracy=accuracy)


@dataclass(slots=True)
class _FollowedGame:
    """A game as it is followed: position, moves, events, score."""

    labels: Labels | None
    start: chess.Board
    played: list[chess.Move] = field(default_factory=list)
    events: list[VisionEvent] = field(default_factory=list)
    tally: _Tally = field(default_factory=_Tally)
    observer: Observer | None = None
    failed: str | None = None

    def report(self) -> VisionReport:
        if self.labels is not None and self.labels.video is not None:
            self._score_video(self.labels.moves_uci)
        score = self.tally.score() if self.labels is not None else None
        return VisionReport(events=tuple(self.events), score=score, pgn=self._pgn(), failed=self.failed)

    def _score_video(self, truth: tuple[str, ...]) -> None:
        """A video's views are not people's to choose: what counts is the game in the end."""
        asked = [event.asked for event in self.events for _ in event.moves]
        played = [move for event in self.events for move in event.moves]
        tally = self.tally
        tally.plies, tally.asked = len(truth), sum(asked)
        tally.right = sum(
            one == other and not by_a_person for one, other, by_a_person in zip(played, truth, asked, strict=False)
        )
        tally.wrong = max(len(truth), len(played)) - tally.right - tally.asked

    def _pgn(self) -> str:
        board = self.start.copy()
        for move in self.played:
            board.push(move)
        return chess.pgn.Game.from_board(board).accept(chess.pgn.StringExporter(headers=False, columns=None))


def follow(
    pictures: Iterable[Picture], labels: Labels | None, corners: CornerSource, progress: Callable[[str], None]
) -> VisionReport:
    """Follow a game from its start position.

    The first picture is taken to show the start position (or ``initial_fen``); it is how the set is learnt. A wrong
    move that was accepted is never corrected by the labels; where the game asks, they answer.

    Args:
        pictures: settled views in their order.
        labels: what is known; None: nobody answers, and the game stays at its last known position until a view is
            clear again.
        corners: says where the board is in each picture.
        progress: told what is being done.
    """
    game = _FollowedGame(labels, chess.Board(labels.initial_fen) if labels is not None else chess.Board())
    for number, picture in enumerate(pictures):
        progress(f"picture {number + 1}: {picture.name}")
        label = labels.of_view(picture.name, len(game.played)) if labels is not None else None
        try:
            sight = sight_of_picture(picture.colour, corners(picture), picture.stamp)
        except BoardNotFound as error:
            if game.observer is None:
                game.failed = f"{picture.name}: {error}"
                break
            _ask(game, picture, None, label, MoveReading(ReadingOutcome.DOUBT, (), 0.0, -np.inf, ()), str(error))
            continue
        if game.observer is None:
            game.observer = Observer(game.start, sight)
            game.events.append(VisionEvent(frame=picture.name, moves=(), confidence=1.0, asked=False, said="start"))
        else:
            _read(game, picture, game.observer.look(sight), label)
    return game.report()


def _read(game: _FollowedGame, picture: Picture, look: Observation, label: FrameLabel | None) -> None:
    assert game.observer is not None
    before = codes_of(game.observer.board)
    if label is not None and label.fen is not None:
        truth = states_of(codes_of(chess.Board(label.fen)))
        game.tally.squares += 64
        game.tally.squares_right += int((look.evidence.read(before) == truth).sum())
    decision = game.observer.decide(look, PLIES)
    if decision.verdict is ReadingOutcome.DOUBT or decision.promotion_unsure:
        _ask(game, picture, look, label, decision, _doubt(decision))
        return
    board = game.observer.board.copy()
    for move in decision.moves:
        board.push(move)
    _count(game.tally, label, decision.moves)
    _go_on(game, look, board, decision.moves)
    moves = tuple(move.uci() for move in decision.moves)
    game.events.append(VisionEvent(frame=picture.name, moves=moves, confidence=decision.confidence, asked=False))


def _ask(
    game: _FollowedGame,
    picture: Picture,
    look: Observation | None,
    label: FrameLabel | None,
    decision: MoveReading,
    said: str,
) -> None:
    """A person says what was played, where there is one; the position stays what it was where there is none."""
    assert game.observer is not None
    answer: Line = ()
    if label is not None:
        answer = tuple(chess.Move.from_uci(move) for move in label.moves_since_previous)
        game.tally.plies += len(answer)
        game.tally.asked += len(answer)
        _go_on(game, look, _after(game.observer.board, answer, label), answer)
    elif decision.promotion_unsure:
        answer = decision.moves
        _go_on(game, look, _after(game.observer.board, answer, None), answer)
    moves = tuple(move.uci() for move in answer)
    game.events.append(
        VisionEvent(frame=picture.name, moves=moves, confidence=decision.confidence, asked=True, said=said)
    )


def _after(board: chess.Board, moves: Line, label: FrameLabel | None) -> chess.Board:
    """The position after an answer; the answer's own one where its moves are not legal in ours."""
    after = board.copy()
    for move in moves:
        if move not in after.legal_moves:
            return chess.Board(label.fen) if label is not None and label.fen is not None else board
        after.push(move)
    return after


def _go_on(game: _FollowedGame, look: Observation | None, board: chess.Board, moves: Line) -> None:
    assert game.observer is not None
    if look is None:
        game.observer.board = board.copy()
    else:
        game.observer.confirm(look, board)
    if board.move_stack:
        game.played.extend(moves)
    elif board.fen() != game.start.fen():  # somebody set the position: the game goes on from there
        game.start, game.played = board.copy(), []


def _count(tally: _Tally, label: FrameLabel | None, moves: Line) -> None:
    if label is None:
        return
    truth = label.moves_since_previous
    tally.plies += len(truth)
    if tuple(move.uci() for move in moves) == truth:
        tally.right += len(truth)
    else:
        tally.wrong += max(len(truth), len(moves))


def _doubt(decision: MoveReading) -> str:
    if decision.promotion_unsure:
        return "which piece was the pawn promoted to?"
    squares = ", ".join(chess.square_name(square) for square in decision.squares[:4])
    return f"what stands on {squares}?" if squares else "no move explains this picture well enough"
