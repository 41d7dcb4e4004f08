"""Bench ``people``: games against a scripted person who errs, and how many of them end as they should.

From a random position on, the person moves by hand and says 'look'; or plays what is not allowed, knocks a piece over,
moves two at once, exchanges two, leaves one between squares, takes a move back by hand, and says 'look' or 'fix'. Light,
camera and how the pieces stand are drawn anew for each game. Asked for something, they do it; but what lies they leave
to the arm. Whether the board is right in the end is the referee's word.
"""

from __future__ import annotations

import math
import queue
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Final, TextIO, cast

import chess
import numpy as np

from app import UserError
from app.execution.state import EXPECTED_FAILURES
from app.measure.bench.report import BenchReport, Progress, row
from app.measure.bench.vision.games import random_game
from app.pieces.inventory import Inventory, InventoryError
from app.pieces.judging import UPRIGHT
from app.pieces.layout import KINDS, start_layout
from app.pieces.manipulation import transfers
from app.pieces.order import rearrange
from app.play.hand_moves import hand_transfers
from app.play.launch import run_games
from app.records import PlyEvent
from app.settings.tree import PlayerKind, Settings
from app.terminal.interface import UserInterface
from engine.errors import EngineProblem
from hardware.interfaces import HardwareError
from hardware.referee import PiecePose
from hardware.sim.clients.hand import SimHand
from hardware.sim.clients.referee import SimReferee
from hardware.sim.hand.actions import Action, Knock, Move, Withdraw
from hardware.table import Colour, TableSettings, square_place

SEED: Final = 9001
"""Of the first game."""
GAMES: Final = {True: 3, False: 300}
"""By ``quick``."""
ACTS: Final = 8
"""Of the person, in a game."""
OPENING: Final = (0, 60)
"""So many random plies are played before."""
BETWEEN: Final = (0.35, 0.65)
"""A piece that is put half on a square stands so far on the way to the next one [squares]."""
WORLD: Final = """
light_brightness = 0.3
light_colour = 0.15
light_direction = 3.1
light_radius = 0.1
exposure = 0.15
white_balance = 0.08
camera_shift = 0.01
camera_turn = 0.03
placement_sigma = 0.0015
placement_limit = 0.004
"""
"""How worlds differ: a `Randomisation`."""


class Act(StrEnum):
    """What a person does in one of their turns."""

    MOVE = "a legal move"
    ILLEGAL = "an illegal move"
    KNOCK = "a knock"
    TWO = "two illegal moves"
    SWAP = "an exchange"
    HALF = "half on a square"
    UNDONE = "a move made and undone"
    TAKE_BACK = "a take-back"


_OFTEN: Final = {
    Act.MOVE: 0.28, Act.ILLEGAL: 0.24, Act.KNOCK: 0.18, Act.TWO: 0.07, Act.SWAP: 0.06, Act.HALF: 0.05,
    Act.UNDONE: 0.05, Act.TAKE_BACK: 0.07,
}  # fmt: skip


class NoSuchAct(Exception):
    """The position, or the hand, does not allow it."""


@dataclass(frozen=True, slots=True)
class Mishap:
    """What went otherwise than it should.

    Attributes:
        what: wrong, asked, unnoticed, stuck or failed.
        act: after which.
        story: what was done and said.
    """

    what: str
    act: str
    story: str


class _Typed:
    """Lines as of a stream that never ends."""

    def __init__(self) -> None:
        self._lines = queue.Queue[str]()
        self.put = self._lines.put

    def __iter__(self) -> Iterator[str]:
        while True:
            yield self._lines.get() + "\n"


class ScriptedPerson(UserInterface):
    """Plays a game as the seed decides, and remembers what was said.

    Args:
        run_dir: of the world.
        seed: of the script.
        board: where the game begins; the person plays White.

    Attributes:
        typed: what they type.
        mishaps: what went otherwise than it should.
        acts: what they did, and how often.
    """

    def __init__(self, run_dir: Path, seed: int, board: chess.Board) -> None:
        self._run_dir, self._rng = run_dir, np.random.default_rng([seed, 11])
        self._board, self._table = board, TableSettings()
        self.typed = _Typed()
        self.mishaps: list[Mishap] = []
        self.acts = Counter[Act]()
        self._said: list[str] = []
        self._prompted = ""
        self._moved: list[str] = []
        self._meant: chess.Move | None = None
        self._act = "beginning"
        self._fallen = False
        self._script = self._session()

    # what is shown

    def say(self, sentence: str) -> None:
        """See ``UserInterface.say``."""
        self._said.append(sentence)

    def position(self, board: chess.Board) -> None:
        """See ``UserInterface.position``."""
        self._board = board.copy()

    def ply(self, event: PlyEvent, board: chess.Board) -> None:
        """See ``UserInterface.ply``."""
        self._board = board.copy()
        self._said.append(f"[{event.san} by {event.by}]")
        if event.by == "hand":
            self._moved.append(event.uci)

    def prompt(self, sentence: str) -> None:
        """See ``UserInterface.prompt``."""
        self._prompted = sentence
        self.typed.put(next(self._script, "quit"))

    # what is done

    def _session(self) -> Iterator[str]:
        while sum(self.acts.values()) < ACTS:
            act = Act(self._rng.choice(list(_OFTEN), p=list(_OFTEN.values())))
            self._said, self._moved, self._meant, self._fallen = [], [], None, False
            self._act = act
            try:
                words = self._do(act)
            except (NoSuchAct, HardwareError, InventoryError):
                words = ["fix"]  # whatever was half done
            else:
                self.acts[act] += 1
            for word in words:
                self._said.append(f"> {word}")
                yield word
                yield from self._answers(act)
            if self._prompted != "left":
                self._check(act)

    def _answers(self, act: Act) -> Iterator[str]:
        """What is asked is answered until it is the person's turn again."""
        for _ in range(6):
            if "your move" in self._prompted:
                return
            self._said.append(f"? {self._prompted}")
            if "become" in self._prompted:
                yield chess.piece_symbol(self._meant.promotion or chess.QUEEN) if self._meant is not None else "q"
            elif "yes or no" in self._prompted:
                self._note("asked")
                yield "yes" if self._meant is not None else "no"
            else:
                self._note("asked")
                if not self._put_right():
                    break
                yield "done"
        self._note("stuck")
        yield "quit"

    def _check(self, act: Act) -> None:
        """Whether what was made of it is what it was."""
        meant = [] if self._meant is None else [self._meant.uci()]
        if self._moved != meant:
            self._note("wrong" if self._moved else "unnoticed")
        elif (problem := self._amiss()) is not None:
            self._said.append(problem)
            self._note("unnoticed")

    def _note(self, what: str) -> None:
        self.mishaps.append(Mishap(what, self._act, " / ".join(self._said)))

    def failed(self, reason: str) -> None:
        """The game ended with an error."""
        self._said.append(reason)
        self._note("failed")

    def _do(self, act: Act) -> list[str]:
        """Do something at the board, and say what is typed then."""
        moves = self._acts(act)
        if act is Act.TAKE_BACK:
            return ["takeback"]
        self._said.append(f"({act}: {'; '.join(moves)})")
        self._perform(list(moves.values()))
        if act in (Act.MOVE, Act.UNDONE):
            return ["look"]
        return ["look", "fix"] if self._rng.random() < 0.5 else ["fix"]

    def _acts(self, act: Act) -> dict[str, Action]:
        """What the hand does, by what it is called."""
        rng, squares = self._rng, list(self._board.piece_map())
        free = [square for square in chess.SQUARES if self._board.piece_at(square) is None]
        if act is Act.TAKE_BACK:
            if len(self._board.move_stack) < 2:
                raise NoSuchAct
            return {}
        if act is Act.MOVE:
            self._meant = cast(chess.Move, rng.choice(np.array(list(self._board.legal_moves), dtype=object)))
            return self._named(self._legal(self._meant))
        if act is Act.UNDONE:
            there = self._legal(cast(chess.Move, rng.choice(np.array(list(self._board.legal_moves), dtype=object))))
            back = [Move(start=one.to, to=one.start) for one in reversed(there)]
            return self._named([*there, *back])
        if act is Act.KNOCK:
            square = int(rng.choice(squares))
            return {f"knock {chess.square_name(square)}": Knock(
                at=self._xy(square), direction=float(rng.uniform(-math.pi, math.pi)))}  # fmt: skip
        if act is Act.HALF:
            square, target = int(rng.choice(squares)), int(rng.choice(free))
            near = [n for n in free if n != target and chess.square_distance(n, target) == 1]
            if not near:
                raise NoSuchAct
            share = rng.uniform(*BETWEEN)
            (x, y), (u, v) = self._xy(target), self._xy(int(rng.choice(near)))
            return self._named([Move(start=self._xy(square), to=(x + share * (u - x), y + share * (v - y)))])
        if act is Act.SWAP:
            alike = rng.random() < 0.4
            one = int(rng.choice(squares))
            others = [s for s in squares if s != one and (self._board.piece_at(s) == self._board.piece_at(one)) is alike]
            if not others:
                raise NoSuchAct
            other, aside = int(rng.choice(others)), self._beside()
            return self._named([
                Move(start=self._xy(one), to=aside), Move(start=self._xy(other), to=self._xy(one)),
                Move(start=aside, to=self._xy(other)),
            ])  # fmt: skip
        return self._named(self._illegal(2 if act is Act.TWO else 1))

    def _illegal(self, count: int) -> list[Move]:
        """Pieces carried to empty squares, or onto others, which go beside the board; no legal move looks like that."""
        after, done = self._board.copy(stack=False), list[Move]()
        for _ in range(count):
            square = int(self._rng.choice(list(after.piece_map())))
            taken = [s for s, p in after.piece_map().items() if p.color != after.color_at(square)]
            free = [s for s in chess.SQUARES if after.piece_at(s) is None]
            target = int(self._rng.choice(taken if self._rng.random() < 0.2 else free))
            if after.piece_at(target) is not None:
                done.append(Move(start=self._xy(target), to=self._beside(len(done))))
            done.append(Move(start=self._xy(square), to=self._xy(target)))
            piece = after.remove_piece_at(square)
            assert piece is not None
            after.set_piece_at(target, piece)
        shown = after.board_fen()
        for move in self._board.legal_moves:
            then = self._board.copy(stack=False)
            then.push(move)
            if then.board_fen() == shown:
                raise NoSuchAct
        if shown == self._board.board_fen():
            raise NoSuchAct
        return done

    def _legal(self, move: chess.Move) -> list[Move]:
        ply = transfers(self._board, move, self._standing())
        return list(hand_transfers(ply.transfers, self._table))

    def _named(self, moves: Sequence[Move]) -> dict[str, Action]:
        return {f"{self._called(one.start)} to {self._called(one.to)}": one for one in moves}

    def _called(self, point: tuple[float, float]) -> str:
        column, line = (c / self._table.square + 4.0 for c in point)
        if not (0.0 <= column < 8.0 and 0.0 <= line < 8.0):
            return "aside"
        off = max(abs(column % 1.0 - 0.5), abs(line % 1.0 - 0.5))
        name = chess.square_name(chess.square(int(column), int(line)))
        return name if off < 0.1 else f"{name} ({column:.2f}, {line:.2f})"

    def _perform(self, actions: Sequence[Action]) -> None:
        if actions:
            with closing(SimHand(self._run_dir)) as hand:
                hand.do(*actions, Withdraw())

    def _put_right(self) -> bool:
        """Do what was asked for: everything back to where the game has it; False: something lies, or it is too hard."""
        if any(pose.tilt > UPRIGHT for pose in self._poses()):
            return False
        try:
            from app.pieces.position import set_up

            self._perform(hand_transfers(set_up(self._standing(), self._board), self._table))
        except (*EXPECTED_FAILURES, ValueError):
            return False
        return True

    # what is so

    def _poses(self) -> tuple[PiecePose, ...]:
        with closing(SimReferee(self._run_dir)) as referee:
            return referee.look()[0].pieces

    def _standing(self) -> Inventory:
        """What stands where, as a person sees it."""
        spots = {place: self._table.xy(place)
                 for place in (*map(square_place, range(64)), *self._table.tray_places())}  # fmt: skip
        specs = {piece.name: piece for piece in start_layout(chess.Board(), self._table)}
        found = [
            replace(specs[pose.name], place=min(spots, key=lambda at, p=pose: math.dist(spots[at], (p.x, p.y))))
            for pose in self._poses()
        ]
        return Inventory.of(found, self._table)

    def _amiss(self) -> str | None:
        """What does not stand on the board as the game has it."""
        specs = {piece.name: piece for piece in start_layout(chess.Board(), self._table)}
        left = {square: (KINDS[piece.piece_type], piece.color) for square, piece in self._board.piece_map().items()}
        half = 4.0 * self._table.square
        for pose in self._poses():
            spec = specs[pose.name]
            if max(abs(pose.x), abs(pose.y)) > half:
                continue
            square = chess.square(int((pose.x + half) / self._table.square), int((pose.y + half) / self._table.square))
            off = math.dist((pose.x, pose.y), self._xy(square))
            if left.pop(square, None) != (spec.kind, spec.colour is Colour.WHITE) or off > self._table.square / 4.0:
                return f"!! {pose.name} is on {chess.square_name(square)}, {1e3 * off:.0f} mm off"
            if pose.tilt > UPRIGHT:
                return f"!! {pose.name} lies on {chess.square_name(square)}"
        return f"!! nothing on {', '.join(map(chess.square_name, left))}" if left else None

    def _xy(self, square: int) -> tuple[float, float]:
        return self._table.xy(square_place(square))

    def _beside(self, number: int = 0) -> tuple[float, float]:
        """A free place of a tray."""
        standing = self._standing()
        free = [place for place in self._table.tray_places() if standing.at(place) is None]
        return self._table.xy(free[number])


def random_position(seed: int) -> chess.Board:
    """White to move, and not in check."""
    rng = np.random.default_rng([seed, 5])
    while True:
        board = chess.Board()
        for move in random_game(int(rng.integers(1 << 31)), int(rng.integers(*OPENING))):
            board.push(move)
        if board.turn is chess.WHITE and not board.is_check() and not board.is_game_over():
            return chess.Board(board.fen())


def play_one(seed: int, changes: Callable[[Settings], Settings] = lambda one: one) -> ScriptedPerson:
    """Play one game; ``changes`` of its settings are made last."""
    with tempfile.TemporaryDirectory(prefix="touchmove-") as name:
        folder, board = Path(name), random_position(seed)
        world = folder / "world.toml"
        world.write_text(WORLD, encoding="utf-8")
        settings = Settings().with_changes(
            {
                "rig.pace": "fast", "rig.seed": seed, "rig.video": False, "rig.randomise": world, "rig.linger": 2.0,
                "white.player": PlayerKind.HUMAN, "black.player": PlayerKind.ENGINE, "engine.nodes": 300,
                "game.fen": board.fen(), "out": folder / "game",
            }
        )  # fmt: skip
        person = ScriptedPerson(folder / "game" / "run", seed, board)
        try:
            result = run_games(changes(settings), person, cast(TextIO, person.typed))
        except (*EXPECTED_FAILURES, EngineProblem) as error:
            person.failed(str(error))
            return person
        for failure in result.report.failures:
            person.failed(failure.reason)
        return person


def people_bench(quick: bool, progress: Progress) -> BenchReport:
    """Play games and count those that went right.

    Raises:
        UserError: no game could be played.
    """
    games = GAMES[quick]
    counted, acts, right = Counter[str](), Counter[Act](), 0
    for number in range(games):
        person = play_one(SEED + number)
        acts += person.acts
        right += not person.mishaps
        counted.update({mishap.what for mishap in person.mishaps})
        for mishap in person.mishaps:
            progress(f"game {SEED + number}: {mishap.what} after {mishap.act}: {mishap.story}")
        progress(f"{number + 1} of {games} games, {right} went right")
    if not acts:
        raise UserError("in no game anything was done")
    rows = {
        "right": row([right / games], "1", 0.98, "least", n=games),
        "wrong": row([counted["wrong"] + counted["unnoticed"]], "games", 0.0, "max", n=games),
        "stuck": row([counted["stuck"]], "games", 0.0, "max", n=games),
        "failed": row([counted["failed"]], "games", n=games),
        "asked": row([counted["asked"]], "games", n=games),
        "acts": row([acts.total()], "1"),
    }
    return BenchReport.of("people", SEED, rows)
