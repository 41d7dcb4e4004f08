"""What a game stands on and where it stands: devices, position, jobs and their outcome, whom to ask, and the end."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Protocol

import chess
import chess.engine

from app import UserError
from app.pieces.inventory import Inventory, Transfer
from app.players.game_end import GameEnd
from app.records import History, PlyOutcome
from app.records.history import Unfinished
from app.rig.arm import Arm, Outcome
from controller.wire.errors import ControllerError
from hardware.interfaces import Camera, Clock, HardwareError
from hardware.piece_set import Look
from hardware.referee import Referee
from hardware.table import Place

if TYPE_CHECKING:
    from app.guard.game_guard import GameGuard
    from app.motion import Plan
    from vision.pieces.lying_or_standing import MisplacedPiece


@dataclass(frozen=True, slots=True)
class Devices:
    """What a game runs on; camera, referee and who watches for hands may be missing."""

    arm: Arm
    clock: Clock
    camera: Camera | None
    referee: Referee | None
    guard: GameGuard | None = None


@dataclass(frozen=True, slots=True)
class Position:
    """Where a game stands.

    Attributes:
        board: with its moves.
        inventory: what stands where.
        begun: whether another program has begun it.
        unfinished: what that had begun and not finished.
    """

    board: chess.Board
    inventory: Inventory
    begun: bool = False
    unfinished: Unfinished | None = None

    @classmethod
    def of(cls, history: History) -> Position:
        """Of a game that was broken off."""
        return cls(history.board, history.inventory, True, history.unfinished)

    def from_the_start(self) -> Position:
        """The same, where what was under way is done from its beginning."""
        if self.unfinished is None:
            return self
        return replace(self, unfinished=replace(self.unfinished, transfer=None, stage=None))


@dataclass(frozen=True, slots=True)
class Clearance:
    """Whether what a picture shows is still so.

    Attributes:
        arrivals: how often a hand had come when the picture was asked for; None: one may be in it.
    """

    arrivals: int | None

    def holds(self, guard: GameGuard | None) -> bool:
        """Whether no hand was over the board since; where nobody watches for hands, nobody can tell."""
        return guard is None or (self.arrivals is not None and guard.arrivals == self.arrivals)


@dataclass(frozen=True, slots=True)
class AwaitedReply:
    """A person may make the next move before anybody looks again.

    Attributes:
        position: after which it is.
        hands: how many hands had come and gone before; None: it may have been made at any time, as nobody watched.
    """

    position: chess.Board
    hands: int | None = None

    def possible(self, guard: GameGuard | None) -> bool:
        """Whether a hand has come and gone since that may have made it, as far as anybody can tell."""
        return self.hands is None or guard is None or guard.hands != self.hands


LEFT: Final = GameEnd("*", "left by the person at the board", complete=True)
"""They may go on with it another time."""
KEPT: Final = GameEnd("*", "the board is kept as it stands", complete=True, kept=True)


@dataclass(frozen=True, slots=True)
class Remark:
    """What is recorded with a ply: what the player thinks of it, a comment, and what the clocks show after it [s], to
    be asked for once the move stands on the board.
    """

    score: chess.engine.PovScore | None = None
    comment: str = ""
    clocks: Callable[[], dict[chess.Color, float] | None] = lambda: None


NO_REMARK: Final = Remark()


@dataclass(frozen=True, slots=True)
class PlannedPush:
    """The piece that is pushed aside, and how."""

    name: str
    plan: Plan


@dataclass(frozen=True, slots=True)
class Carried:
    """What a job came to.

    Attributes:
        planned: duration planned for its last part [s].
        done: that part.
        resumed: there was one before, of another program or before a pause.
    """

    planned: float
    done: Outcome
    resumed: bool

    @property
    def outcome(self) -> PlyOutcome:
        """What the record says of it."""
        done = self.done
        return PlyOutcome(
            planned=self.planned, real=done.duration, peak_torque=done.peak_torque, peak_force=done.peak_force,
            resumed=self.resumed,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class JobDone:
    """What stands where after a job, what is known of it, and whether a person has made the next move already."""

    inventory: Inventory
    outcome: PlyOutcome
    answered: bool = False


Told = Mapping[Place, Look]
"""What a person says stands on squares."""


class Asker(Protocol):
    """A person who can put the board right by hand."""

    def mend(self, sentence: str, squares: tuple[str, ...], stands: Inventory) -> Told:
        """Ask for what has to be done on some squares; returns when they say that it is done, or what stands on some.

        ``stands`` says what should stand where now, as far as is known.

        Raises:
            UserError: nobody is there.
        """


class Attendant(Protocol):
    """Who is asked whether an arm that somebody has stopped may move again."""

    def wait_for_go(self, sentence: str) -> None:
        """Return once they say so; ``sentence`` says what has happened, and to say 'go'.

        Raises:
            UserError: nobody is there, or they leave instead.
        """


@dataclass(frozen=True, slots=True)
class RecoveryResult:
    """What a recovery came to.

    Attributes:
        inventory: what stands where now.
        jobs: rounds in which something had to be moved, by the arm or by a person.
        duration: of what the arm did [s].
        answered: a person has made the next move already, or has begun to; the newest frame shows it.
    """

    inventory: Inventory
    jobs: int
    duration: float
    answered: bool = False


@dataclass(frozen=True, slots=True)
class Job:
    """Something the arm does from home to home.

    Attributes:
        label: what it is, for people.
        transfers: in order of execution.
        uci: the move, where it is one; None for a task.
        misplaced: pieces that lie or stand elsewhere than the inventory says, and that the arm has to keep clear of.
    """

    label: str
    transfers: tuple[Transfer, ...]
    uci: str | None = None
    misplaced: tuple[MisplacedPiece, ...] = ()


class CannotSee(UserError):
    """The camera shows no board where there should be one."""


WRONG: Final = GameEnd("*", "the board is not as the game says", False)
FRAME_AGE: Final = 10.0
"""A frame is no older than this: exposed when it was asked for, but drawn slowly by a busy machine [s]."""
EXPECTED_FAILURES: Final = (UserError, ControllerError, HardwareError)
"""What may go wrong in a running game without a bug: each says in one sentence what and what to do."""


def changed(before: Inventory, after: Inventory) -> dict[str, Place]:
    """Where the pieces stand that stand elsewhere, by name."""
    places = {piece.name: piece.place for piece in before}
    return {piece.name: piece.place for piece in after if places[piece.name] != piece.place}
