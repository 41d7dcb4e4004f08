"""The game's end of the page, played by a script: for tests, and by hand to work on the browser's side.

    python -m tests.app.page.fake_game --port 8064

A person has White and says moves, or lets the script make them with --demo; the script answers with moves drawn by lot.
The record is real, written by the program's own recorder, as are publisher, supervisor and page; the robot is missing,
but its motions take a while, and its camera shows a picture that is drawn here.
"""

from __future__ import annotations

import argparse
import math
import random
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import chess
import chess.engine
import cv2
import numpy as np
from numpy.typing import NDArray

from app.page.publisher import PagePublisher
from app.page.supervisor import PageSupervisor
from app.pieces.inventory import Inventory, Stage
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.players.game_end import Result
from app.records.events import By, GameSetup, PlyOutcome, Purpose
from app.records.game import GameRecord
from app.settings.defaults import PageSection
from app.terminal.shown import ClockShown, LookShown, PathShown, SessionShown, View
from hardware.interfaces import Pace
from hardware.piece_set import Colour
from hardware.table import TableSettings
from tests.app.page.fake_controller import FakeController

TABLE = TableSettings()
TICK = 0.00088
WIDTH, HEIGHT = 640, 480
WORDS = ("resign", "draw", "hint", "takeback", "pause", "new", "quit", "look")
HOME = (0.0, 0.0, 0.36)


def grid() -> NDArray[np.float64]:
    """Where the corners of the squares are in the picture, as a camera sees a board before it, (81, 2) [px]."""
    points = []
    for rank in range(9):
        for file in range(9):
            nearness = 1.0 / (1.0 + 0.07 * rank)
            points.append((WIDTH / 2 + (file - 4) * 72.0 * nearness, HEIGHT - 20.0 - 1100.0 * (1.0 - nearness)))
    return np.array(points)


def picture(board: chess.Board, view: str, stamp: float) -> NDArray[np.uint8]:
    """The board in a position, RGB (480, 640, 3); the two views differ in their background."""
    shown = np.full((HEIGHT, WIDTH, 3), (58, 48, 40) if view == "film" else (40, 52, 58), np.uint8)
    corners = grid().reshape(9, 9, 2)
    for square in reversed(chess.SQUARES):
        file, rank = chess.square_file(square), chess.square_rank(square)
        quad = corners[[rank, rank, rank + 1, rank + 1], [file, file + 1, file + 1, file]].astype(np.int32)
        cv2.fillPoly(shown, [quad], (222, 203, 164) if (file + rank) % 2 else (150, 106, 70))
        piece = board.piece_at(square)
        if piece is not None:
            x, y = (int(along) for along in quad.mean(axis=0))
            size = 6 + 2 * piece.piece_type
            cv2.ellipse(
                shown, (x, y - size), (9, size), 0, 0, 360, (240, 236, 224) if piece.color else (38, 34, 32), -1
            )
            cv2.putText(shown, piece.symbol(), (x - 5, y - size + 5), 0, 0.4, (128, 90, 90), 1, cv2.LINE_AA)
    cv2.putText(shown, f"{view} {stamp:.2f} s", (10, 20), 0, 0.5, (230, 230, 230), 1, cv2.LINE_AA)
    return shown


def likelihood(board: chess.Board, unsure: Sequence[chess.Square]) -> NDArray[np.float64]:
    """What vision thinks of the squares, (64, 3): empty, white, black; it is not sure of some."""
    found = np.full((64, 3), 0.005)
    for square in chess.SQUARES:
        piece = board.piece_at(square)
        found[square, 0 if piece is None else 1 if piece.color else 2] = 0.99
        if square in unsure:
            found[square] = (0.3, 0.45, 0.25)
    return found


class DrawnFilm:
    """``FilmSource`` of pictures that are drawn."""

    def __init__(self, view: View, rate: float, draw: Callable[[str], tuple[NDArray[np.uint8], float]]) -> None:
        self._view, self._rate, self._draw = view, rate, draw
        self._over = threading.Event()

    def next(self) -> tuple[NDArray[np.uint8], int] | None:
        if self._over.wait(1.0 / self._rate):
            return None
        shown, stamp = self._draw(self._view)
        return shown, round(stamp / TICK)

    def cancel(self) -> None:
        self._over.set()

    def close(self) -> None:
        self._over.set()


@dataclass
class FakeGame:
    """A game against a person on the page.

    Attributes:
        folder: of its record.
        speed: motions take their time over so much.
        seed: of its own moves.
        controller: host, port and key file of a controller; None: there is none.
    """

    folder: Path
    speed: float = 1.0
    seed: int = 1
    controller: tuple[str, int, Path] | None = None
    lines: list[str] = field(default_factory=list)
    board: chess.Board = field(default_factory=chess.Board)

    def __post_init__(self) -> None:
        self.publisher = PagePublisher("play")
        self.publisher.subscribe(self._heard)
        self._lot = random.Random(self.seed)
        self._said = threading.Condition()
        self._began = time.monotonic()
        self._left = {chess.WHITE: 300.0, chess.BLACK: 300.0}
        self._over = False
        self._inventories = [Inventory.of(start_layout(self.board, TABLE), TABLE)]

    @property
    def inventory(self) -> Inventory:
        """What stands where."""
        return self._inventories[-1]

    @property
    def plant(self) -> float:
        """Plant time [s]."""
        return time.monotonic() - self._began

    def begin(self) -> None:
        """Session, round and record begin."""
        self.publisher.session(
            SessionShown(
                self.folder, "sim", Pace.REAL, TICK, Colour.WHITE, True, True, self.controller,
                lambda view, rate: DrawnFilm(view, rate, self._draw),
            )
        )  # fmt: skip
        for name, ok, text in (
            ("camera", True, "30 pictures a second, 61 ms old"), ("guard", True, "nobody near the board"),
            ("controller", True, "holds, no tick skipped"), ("engine", None, "not asked yet"),
        ):  # fmt: skip
            self.publisher.device(name, ok, text)
        setup = GameSetup("Human", "Stockfish 17", self.seed, "real", time_control="300+3")
        self.record = GameRecord.begin(self.folder, setup, self.board, self.inventory, self.plant)
        self.record.picture(0, picture(self.board, "camera", self.plant))
        self.publisher.round(self.folder, 1, sets_up=False)
        self.publisher.say("Welcome: you have White. Say a move, or make it on the board.")
        self.look(())

    def play(self, *, demo: bool = False, plies: int = 300) -> None:
        """The game, until it is over, somebody says quit, or so many plies are done."""
        while not (self._over or self.board.is_game_over() or len(self.board.move_stack) >= plies):
            if self.board.turn is chess.WHITE and not demo:
                self._persons_turn()
            else:
                self._own_turn()
        if not self._over:
            self.end("*" if self.board.result() == "*" else self._result(), "the game is over")

    def end(self, result: Result, reason: str) -> None:
        """The record ends, and so does the program."""
        self._over = True
        self.record.end(result, reason, self.plant)
        self.publisher.end(f"{reason}, result {result}")

    def _result(self) -> Result:
        outcome = self.board.outcome()
        assert outcome is not None
        return "1/2-1/2" if outcome.winner is None else "1-0" if outcome.winner else "0-1"

    def _persons_turn(self) -> None:
        self._clock(chess.WHITE)
        self.publisher.prompt("Your move.", WORDS, turn=True)
        line = self._line()
        self.publisher.answered()
        if line == "resign":
            self.end("0-1", "White resigns")
        elif line == "quit":
            self.end("*", "the person has left")
        elif line == "takeback":
            self.take_back()
        elif line == "look":
            self.look(())
        elif line == "hint":
            move = self._lot.choice([*self.board.legal_moves])
            squares = (chess.square_name(move.from_square), chess.square_name(move.to_square))
            self.publisher.say(f"I would play {self.board.san(move)}.", squares)
        elif (move := self._parsed(line)) is None:
            self.publisher.say(f"'{line}' is not a legal move here; {', '.join(WORDS)} are understood as well.")
        else:
            self.hand_moves(move)

    def _own_turn(self) -> None:
        self._clock(self.board.turn)
        self.publisher.phase("thinking")
        self._wait(0.6)
        move = self._lot.choice([*self.board.legal_moves])
        self._clock(None)
        self.arm_moves(move)

    def hand_moves(self, move: chess.Move) -> None:
        """The person's hand makes a move, which the camera sees; now and then it is not sure."""
        self.publisher.phase("watching your hand")
        self._wait(0.4)
        target = chess.square_name(move.to_square)
        after = self.board.copy()
        after.push(move)
        if self._lot.random() < 0.15:
            self.look((move.to_square,), after)
            self.publisher.prompt(f"Is that {self.board.san(move)}?", ("yes", "no"), (target,))
            answer = self._line()
            self.publisher.answered()
            if answer != "yes":
                self.publisher.say(f"Then put the piece on {target} back, please.", (target,))
                return
        self._clock(None)
        self._done(move, None, "hand")

    def arm_moves(self, move: chess.Move) -> None:
        """The arm makes a move, part by part."""
        began = self.plant
        ply = transfers(self.board, move, self.inventory)
        for number, carried in enumerate(ply.transfers):
            source, target = (TABLE.xy(place) for place in (carried.source, carried.target))
            ways = {Stage.APPROACH: (None, source), Stage.CARRY: (source, target), Stage.RETURN: (target, None)}
            for stage in Stage:
                if stage is Stage.RETURN and number < len(ply.transfers) - 1:
                    continue
                self.publisher.phase(f"{ply.san}: {stage.value} {carried.name}, {carried.source} to {carried.target}")
                self.record.step(ply.uci, number, stage, self.plant)
                if stage in ways:
                    self.path(stage.value, *ways[stage])
                self._wait(0.35)
        self._done(move, self.plant - began, "arm")

    def path(self, label: str, start: tuple[float, float] | None, end: tuple[float, float] | None) -> None:
        """A motion over the board, in an arc; None: home."""
        ends = [np.array(HOME) if at is None else TABLE.base_from_board(np.array([*at, 0.03])) for at in (start, end)]
        share = np.linspace(0.0, 1.0, 400)[:, None]
        along = ends[0] + share * (ends[1] - ends[0])
        along[:, 2] -= 0.06 * np.sin(math.pi * share[:, 0])
        self.publisher.path(PathShown(label, along, np.full((400, 3), 900.0), 7))

    def _done(self, move: chess.Move, seconds: float | None, by: By) -> None:
        ply = transfers(self.board, move, self.inventory)
        after = self.board.copy()
        after.push(move)
        frame = self.record.picture(len(after.move_stack), picture(after, "camera", self.plant))
        outcome = PlyOutcome(
            planned=seconds, real=seconds, by=by, frame=frame, physical_ok=True, clocks=dict(self._left),
            score=chess.engine.PovScore(chess.engine.Cp(self._lot.randrange(-80, 80)), chess.WHITE),
        )  # fmt: skip
        self.record.ply(ply, outcome, self.plant)
        self._inventories.append(self.inventory.after(ply))
        self.board.push(move)
        self.look(())

    def take_back(self) -> None:
        """The last moves of both sides."""
        count = min(2, len(self.board.move_stack))
        if not count:
            self.publisher.say("There is nothing to take back.")
            return
        self.record.task(Purpose.TAKE_BACK, "take back", (), self.plant, taken_back=count)
        for _ in range(count):
            self.board.pop()
            self._inventories.pop()
        self._wait(0.5)
        self.record.task_done(self.inventory, PlyOutcome(real=0.5, physical_ok=True), self.plant)
        self.publisher.say("Both moves are taken back.")
        self.look(())

    def look(self, unsure: Sequence[chess.Square], board: chess.Board | None = None) -> None:
        """The camera has looked."""
        seen = board or self.board
        self.publisher.look(
            LookShown(
                picture(seen, "camera", self.plant), self.plant, "unsure" if unsure else "as_expected",
                "I am not sure what stands there." if unsure else "All stands as it should.",
                likelihood(seen, unsure), grid(), tuple(chess.square_name(one) for one in unsure),
            )
        )  # fmt: skip

    def _draw(self, view: str) -> tuple[NDArray[np.uint8], float]:
        stamp = self.plant
        return picture(self.board, view, stamp), stamp

    def _clock(self, running: chess.Color | None) -> None:
        self.publisher.clock(ClockShown(dict(self._left), running))

    def _parsed(self, line: str) -> chess.Move | None:
        for parse in (self.board.parse_san, self.board.parse_uci):
            try:
                return parse(line)
            except ValueError:
                continue
        return None

    def _heard(self, line: str) -> None:
        with self._said:
            self.lines.append(line)
            self._said.notify_all()

    def _line(self) -> str:
        began = time.monotonic()
        with self._said:
            self._said.wait_for(lambda: bool(self.lines))
            line = self.lines.pop(0)
        self._left[chess.WHITE] -= time.monotonic() - began
        self.publisher.heard(line)
        return line

    def _wait(self, seconds: float) -> None:
        time.sleep(seconds / self.speed)


def main() -> None:
    """Play a game before a page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--port", type=int, default=8064)
    parser.add_argument("--password", type=Path, help="file with a password, as 'touchmove page' makes it")
    parser.add_argument("--demo", action="store_true", help="the script makes both sides' moves")
    parser.add_argument("--speed", type=float, default=1.0, help="of the arm and of thinking")
    parser.add_argument("--plies", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--robot", action="store_true", help="with a controller whose arm swings, and can be stopped")
    parser.add_argument("--games", type=Path, help="folder of the records; a new one, which is left, if not given")
    wishes = parser.parse_args()
    games = wishes.games or Path(tempfile.mkdtemp(prefix="fake-games-"))
    game = FakeGame(games / time.strftime("%Y-%m-%dT%H-%M-%SZ", time.gmtime()), wishes.speed, wishes.seed)
    settings = PageSection(port=wishes.port, password=wishes.password)
    with ExitStack() as stack:
        if wishes.robot:
            game.controller = stack.enter_context(FakeController(Path(tempfile.mkdtemp(prefix="fake-run-")))).address
        ready = lambda address: print("page at", address, flush=True)  # noqa: E731
        stack.enter_context(PageSupervisor(settings, game.publisher, games, ready, print))
        game.begin()
        game.play(demo=wishes.demo, plies=wishes.plies)


if __name__ == "__main__":
    main()
