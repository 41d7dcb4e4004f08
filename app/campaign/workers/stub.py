"""A worker's function that plays nothing: by it the cost of scheduling is measured, and what deaths do to results."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Final

from pydantic import Field

from app.campaign.schema import GameRow, PlyRow, TaskOutcome, TaskResult
from app.campaign.troubles import MachineTrouble
from app.campaign.workers.order import TaskOrder
from hardware.frozen import Frozen

PLIES: Final = 40
"""Rows of plies of each, as many as of a game of some length."""


class StubPlan(Frozen):
    """What stubs do: a task's seed decides."""

    marks: Path | None = None
    """Folder in which each remembers what has happened to it."""
    seconds: float = 0.0
    """Each takes so long."""
    deaths: dict[int, int] = Field(default_factory=dict)
    """So often a seed kills its worker."""
    full: tuple[int, ...] = ()
    """Seeds that find the disk full, once."""


def play_stub(plan: StubPlan, text: str) -> str:
    """A worker's function, as ``play_task``, that plays nothing."""
    order = TaskOrder.model_validate_json(text)
    task = order.task
    if happens(plan, f"death {task.seed}", plan.deaths.get(task.seed, 0)):
        os.kill(os.getpid(), signal.SIGKILL)
    if happens(plan, f"full {task.seed}", int(task.seed in plan.full)):
        raise MachineTrouble("no space left on the device")
    time.sleep(plan.seconds)
    ply = {"index": task.index, "seed": task.seed, "san": "e4", "uci": "e2e4", "kind": "quiet", "by": "arm",
           "piece": "P", "planned_s": 1.0, "real_s": 1.0, "error_mm": 0.1, "peak_torque_Nm": 1.0, "peak_force_N": 1.0,
           "physical_ok": True, "transfers": 1, "repairs": 0}  # fmt: skip
    game = GameRow(
        index=task.index, seed=task.seed, kind=task.kind, outcome=TaskOutcome.RIGHT, reason="a stub", plies=PLIES,
        environment=order.environment.digest, host="", cpu="", drawn=task.drawn,
    )  # fmt: skip
    plies = tuple(PlyRow.model_validate({**ply, "ply": number}) for number in range(1, PLIES + 1))
    return TaskResult(game=game, plies=plies).model_dump_json()


def happens(plan: StubPlan, what: str, times: int) -> bool:
    """Whether something that happens so often happens now."""
    if plan.marks is None or not times:
        return False
    for number in range(times):
        try:
            (plan.marks / f"{what} {number}").touch(exist_ok=False)
        except FileExistsError:
            continue
        return True
    return False
