"""A person of a simulated world who plays as a seed decides, and errs: what they do at the board, and what they say."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import chess
import numpy as np

from app.campaign.task import SessionPlan
from app.campaign.tasks.acts import Act
from app.execution.state import EXPECTED_FAILURES
from app.pieces.inventory import Inventory, InventoryError
from app.pieces.judging import UPRIGHT
from app.pieces.layout import KINDS, start_layout
from app.pieces.manipulation import transfers
from app.pieces.order import Point, rearrange
from app.pieces.position import arranged
from app.play.hand_moves import hand_transfers
from app.records import PlyEvent
from app.terminal.game_display import UserInterface
from app.terminal.typed_lines import TypedLines
from hardware.interfaces import HardwareError
from hardware.piece_set import Colour
from hardware.referee import PiecePose
from hardware.sim.clients.hand import SimHand
from hardware.sim.clients.referee import SimReferee
from hardware.sim.hand.actions import Action, Knock, Move, Withdraw
from hardware.table import PieceSpec, Place, TableSettings, square_place

BETWEEN: Final = (0.35, 0.65)  # a piece that is put half on a square stands so far on the way to the next one [squares]


class NoSuchAct(Exception):
    """The position, or the hand, does not allow it."""


@dataclass(frozen=True, slots=True)
class Mishap:
    """What went otherwise than it should."""

    what: str  # wrong, asked, unnoticed, stuck or failed
    act: str  # after which
    story: str  # what was done and said


class ScriptedPerson(UserInterface):
    """Plays White from a position on in the world of a run directory, as the seed decides, and remembers what was said.

    ``plan``: how many acts there are, and how likely each is; ``table``: as they see it.
    """

    def __init__(self, run_dir: Path, seed: int, board: chess.Board, plan: SessionPlan, table: TableSettings) -> None:
        self._often, self._most = plan.shares, plan.acts
        self._run_dir, self._rng = run_dir, np.random.default_rng([seed, 11])
        self._board, self._table = board, table
        self._specs = {piece.name: piece for piece in start_layout(chess.Board(), self._table)}
        self.typed = TypedLines(None, company=lambda: True)  # what they type
        self.mishaps: list[Mishap] = []  # what went otherwise than it should
        self.acts = Counter[Act]()  # what they did, and how often
        self.flawed: set[int] = set()  # numbers of the acts after which something did, from 1; 0 is before the first
        self.told: str | None = None  # the last sentence that they were told
        self._said: list[str] = []
        self._prompted = ""
        self._moved: list[str] = []
        self._meant: chess.Move | None = None
        self._act = "beginning"
        self._fallen = False
        self._script = self._session()

    # what is shown

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        """See ``UserInterface.say``."""
        self.told = sentence
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

    def prompt(
        self, sentence: str, answers: Collection[str] = (), squares: Collection[str] = (), *, turn: bool = False
    ) -> None:
        """See ``UserInterface.prompt``."""
        self._prompted = self.told = sentence
        self.typed.offer(next(self._script, "quit"))

    # what is done

    def _session(self) -> Iterator[str]:
        while sum(self.acts.values()) < self._most and not self._over:
            act = Act(self._rng.choice(list(self._often), p=list(self._often.values())))
            self._said, self._moved, self._meant, self._fallen = [], [], None, False
            self._act = act
            try:
                words = self._do(act)
            except (NoSuchAct, HardwareError, InventoryError):
                words = ["fix"]  # whatever was half done
            else:
                self.acts[act] += 1
            for word in words:
                if self._over:
                    break
                self._said.append(f"> {word}")
                yield word
                yield from self._answers(act)
            if self._prompted != "left":
                self._check(act)

    @property
    def _over(self) -> bool:
        """The game is over: they leave."""
        return "another game" in self._prompted

    def _answers(self, act: Act) -> Iterator[str]:
        """What is asked is answered until it is the person's turn again."""
        for _ in range(6):
            if "your move" in self._prompted or self._over:
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
        self.flawed.add(self.acts.total())
        self.mishaps.append(Mishap(what, self._act, " / ".join(self._said)))

    def failed(self, reason: str) -> None:
        """The game ended with an error."""
        self._said.append(reason)
        self._note("failed")

    def _do(self, act: Act) -> list[str]:
        """Do something at the board, and say what is typed then."""
        if act is Act.TAKE_BACK:
            if len(self._board.move_stack) < 2:
                raise NoSuchAct
            return ["takeback"]
        moves = self._acts(act)
        self._said.append(f"({act}: {'; '.join(moves)})")
        self._perform(list(moves.values()))
        if act in (Act.MOVE, Act.UNDONE):
            return ["look"]
        return ["look", "fix"] if self._rng.random() < 0.5 else ["fix"]

    def _acts(self, act: Act) -> dict[str, Action]:
        """What the hand does, by what it is called."""
        match act:
            case Act.KNOCK:
                square = self._any(self._board.piece_map())
                knock = Knock(at=self._xy(square), direction=float(self._rng.uniform(-math.pi, math.pi)))
                return {f"knock {chess.square_name(square)}": knock}
            case Act.MOVE:
                self._meant = self._any_legal()
                moves = self._legal(self._meant)
            case Act.UNDONE:
                there = self._legal(self._any_legal())
                moves = [*there, *(Move(start=one.to, to=one.start) for one in reversed(there))]
            case Act.HALF:
                moves = [self._between()]
            case Act.SWAP:
                moves = self._exchange()
            case _:
                moves = self._illegal(2 if act is Act.TWO else 1)
        return {f"{self._called(one.start)} to {self._called(one.to)}": one for one in moves}

    def _any(self, squares: Iterable[int]) -> int:
        return int(self._rng.choice(list(squares)))

    def _any_legal(self) -> chess.Move:
        moves = list(self._board.legal_moves)
        return moves[int(self._rng.integers(len(moves)))]

    def _between(self) -> Move:
        """Any piece put down between two squares."""
        free = [square for square in chess.SQUARES if self._board.piece_at(square) is None]
        square, target = self._any(self._board.piece_map()), self._any(free)
        near = [other for other in free if chess.square_distance(other, target) == 1]
        if not near:
            raise NoSuchAct
        share = self._rng.uniform(*BETWEEN)
        (x, y), (u, v) = self._xy(target), self._xy(self._any(near))
        return Move(start=self._xy(square), to=(x + share * (u - x), y + share * (v - y)))

    def _exchange(self) -> list[Move]:
        """Two pieces change places, alike ones or not."""
        pieces = self._board.piece_map()
        one, alike = self._any(pieces), self._rng.random() < 0.4
        others = [square for square in pieces if square != one and (pieces[square] == pieces[one]) is alike]
        if not others:
            raise NoSuchAct
        other, aside = self._any(others), self._beside()
        there, here = self._xy(other), self._xy(one)
        return [Move(start=here, to=aside), Move(start=there, to=here), Move(start=aside, to=there)]

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
        ply = transfers(self._board, move, self._standing()[0])
        return list(hand_transfers(ply.transfers, self._table))

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
            stands, beside = self._standing()
            moved = rearrange(stands, arranged(stands, self._board), seen=beside)
            self._perform(hand_transfers(moved, self._table))
        except (*EXPECTED_FAILURES, ValueError):
            return False
        return True

    # what is so

    def _poses(self) -> tuple[PiecePose, ...]:
        with closing(SimReferee(self._run_dir)) as referee:
            return referee.look()[0].pieces

    def _standing(self) -> tuple[Inventory, dict[str, Point]]:
        return standing_now(self._poses(), self._specs, self._table)

    def _amiss(self) -> str | None:
        """What does not stand on the board as the game has it."""
        left = {square: (KINDS[piece.piece_type], piece.color) for square, piece in self._board.piece_map().items()}
        half = 4.0 * self._table.square
        for pose in self._poses():
            spec = self._specs[pose.name]
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
        standing, _ = self._standing()
        free = [place for place in self._table.tray_places() if standing.at(place) is None]
        return self._table.xy(free[number])


def standing_now(
    poses: Sequence[PiecePose], specs: Mapping[str, PieceSpec], table: TableSettings
) -> tuple[Inventory, dict[str, Point]]:
    """What stands where, as a person sees it; and where those are, by name [m], that share a place with another.

    The one that is farther from the middle counts as on the nearest place that is free.
    """
    free = {place: table.xy(place) for place in (*map(square_place, range(64)), *table.tray_places())}
    nearest = {pose.name: _nearest((pose.x, pose.y), free) for pose in poses}
    found, beside = list[PieceSpec](), dict[str, Point]()
    for pose in sorted(poses, key=lambda one: math.dist((one.x, one.y), table.xy(nearest[one.name]))):
        place = _nearest((pose.x, pose.y), free)
        del free[place]
        found.append(replace(specs[pose.name], place=place))
        if place != nearest[pose.name]:
            beside[pose.name] = pose.x, pose.y
    return Inventory.of(found, table), beside


def _nearest(point: tuple[float, float], spots: Mapping[Place, tuple[float, float]]) -> Place:
    return min(spots, key=lambda place: math.dist(spots[place], point))
