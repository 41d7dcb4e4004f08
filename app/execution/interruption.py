"""What breaks a job of the arm off, and how far it got then: from the record of what was begun, and from the arm.

Every part of a transfer is recorded before it begins. Whether its piece stands at the source, is in the fingers or
stands at the target, the arm itself can tell: by what the pads feel, and by where they are, since what is begun after
a piece has touched the board is another part.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import chess

from app import UserError
from app.pieces.inventory import Inventory, Stage, Transfer
from app.records.history import Unfinished
from app.rig.arm import FELT, ArmAtRest
from hardware.table import TableSettings

ABOVE = 0.003
"""A tool this close to where it sets a piece down, in height and in the plane, is there [m]."""


class PieceLost(UserError):
    """The fingers lost a piece on its way: where it lies, only the camera can tell."""

    def __init__(self, transfer: Transfer) -> None:
        super().__init__(
            f"the arm lost the {transfer.colour} {transfer.kind} on the way from {transfer.source} to "
            f"{transfer.target}: set it on {transfer.source} by hand and start a new game from there"
        )


class Loss(StrEnum):
    """How a piece came not to be carried."""

    NOT_GRIPPED = "not gripped"
    """The fingers closed and felt nothing."""
    LOST = "lost"
    """It was in the fingers, and did not arrive."""


class CarryFailed(Exception):
    """A piece was not carried where it should; the arm is home again, with nothing in its fingers.

    Attributes:
        loss: how.
        transfer: of the piece.
        done: so many transfers of the job were done before.
        inventory: what stands where after those; where the piece is, only the camera can tell.
        over_box: it was lost over the box that it was for.
    """

    def __init__(
        self, loss: Loss, transfer: Transfer, done: int, inventory: Inventory, sentence: str, over_box: bool = False
    ) -> None:
        super().__init__(sentence)
        self.loss, self.transfer, self.done, self.inventory = loss, transfer, done, inventory
        self.over_box = over_box


class BoardTouched(Exception):
    """A hand was over the board after it was looked at, and before the arm began anything: what was planned may be no
    longer so. The arm is where it was, and may move.
    """


def goal_of(board: chess.Board, unfinished: Unfinished) -> chess.Board:
    """The position that was to be reached from one by what was begun and not finished."""
    goal = board.copy()
    if unfinished.uci is not None:
        goal.push_uci(unfinished.uci)
    elif unfinished.task is not None:
        for _ in range(unfinished.task.taken_back):
            goal.pop()
        if unfinished.task.fen is not None:
            goal = chess.Board(unfinished.task.fen, chess960=goal.chess960)
    return goal


@dataclass(frozen=True, slots=True)
class Begun:
    """Of a job's transfers: which was begun last, from 0, and which stage of it."""

    transfer: int
    stage: Stage


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a job is: so many transfers done; the next one's piece in the fingers, or not."""

    done: int
    holding: bool

    def explain(self, label: str, transfers: Sequence[Transfer]) -> str:
        """How a job of a label and with these transfers goes on, for people."""
        if self.done == len(transfers):
            return f"{label} was almost done: the arm goes home"
        piece = transfers[self.done]
        where = "is in the fingers" if self.holding else f"stands on {piece.source}"
        return f"continuing with {label}: the {piece.kind} for {piece.target} {where}"


def progress_of(
    transfers: Sequence[Transfer], transfer: int, stage: Stage, arm: ArmAtRest, table: TableSettings
) -> Progress:
    """What is done of a ply, or of another job, whose execution was broken off with the arm at rest.

    ``transfer`` is that of the job's transfers which was begun last, from 0, and ``stage`` the stage of it.

    Raises:
        PieceLost: the piece is neither in the fingers nor set down.
    """
    if stage in (Stage.APPROACH, Stage.RETURN):
        return Progress(transfer, holding=False)
    holding = arm.felt >= FELT
    carried = transfers[transfer]
    following = transfers[transfer + 1] if transfer + 1 < len(transfers) else None
    if stage is Stage.RELEASE:
        # at the next piece the fingers close already before they are said to grasp: then that stands between them
        held = holding and (following is None or not _is_down(following.grasped_at(table), following, arm, table))
        return Progress(transfer if held else transfer + 1, held)
    if stage is Stage.GRASP or holding:
        return Progress(transfer, holding)
    if _over(carried, arm, table):
        return Progress(transfer + 1, holding=False)
    raise PieceLost(carried)


def _is_down(at: tuple[float, float], transfer: Transfer, arm: ArmAtRest, table: TableSettings) -> bool:
    """Whether the tool is at a point of the board, as low as where it takes a piece or sets it down."""
    x, y, z = table.board_from_base(arm.reference).tolist()
    return math.hypot(x - at[0], y - at[1]) < ABOVE and z < transfer.shape.grip_height + ABOVE


def _over(transfer: Transfer, arm: ArmAtRest, table: TableSettings) -> bool:
    """Whether the tool is where it sets the piece down; or over the box, into which the piece falls from anywhere."""
    if transfer.target.in_box:
        return is_over_box(transfer, arm, table)
    return _is_down(table.xy(transfer.target), transfer, arm, table)


def is_over_box(transfer: Transfer, arm: ArmAtRest, table: TableSettings) -> bool:
    """Whether the tool is over the box that a piece is for; False: it is for none."""
    x, y, _ = table.board_from_base(arm.reference).tolist()
    return transfer.target.in_box and table.box_of(transfer.target).holds(x, y)
