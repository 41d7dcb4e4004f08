"""Hands tasks to an executor, a few at a time, and has done again what its workers could not carry.

What a worker died of, or a machine had no room for, is no result of a game. Who was there at two deaths is tried once
more alone, since somebody else may have been the cause; who dies alone as well has crashed.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from dataclasses import dataclass, field
from typing import Final

from app import UserError
from app.campaign.schema import TaskResult
from app.campaign.task import CampaignTask
from app.campaign.troubles import DEATHS, TROUBLES, BrokenOff, EnvironmentDiffers, GameDied, MachineTrouble

GLANCE: Final = 0.25
"""So often somebody is told that time goes by [s, wall]."""


class CampaignStopped(UserError):
    """A campaign cannot go on as it is; what was played is in its ledger."""


@dataclass(frozen=True, slots=True)
class Scheduling:
    """How tasks are handed out.

    Attributes:
        executor: plays them.
        order: of a task, as the executor's workers take it.
        play: what a worker calls with it; gives a ``TaskResult`` as JSON.
        window: so many tasks are handed out at a time; asked again and again, as workers come and go.
        deaths: further exceptions that tell that a worker has died.
        pause: after a machine had no room, times the number of troubles of that task [s, wall].
        idle: called now and then while nothing comes in.
    """

    executor: Executor
    order: Callable[[CampaignTask], str]
    play: Callable[[str], str]
    window: Callable[[], int]
    deaths: tuple[type[BaseException], ...] = ()
    pause: float = 10.0
    idle: Callable[[], None] = lambda: None

    @property
    def fatal(self) -> tuple[type[BaseException], ...]:
        """All that tells that a worker, or a game's processes, have died, or that somebody else has ended them."""
        return BrokenExecutor, GameDied, BrokenOff, *self.deaths


@dataclass(slots=True)
class HandedOut:
    """What is under way, and what is to be done again."""

    running: dict[Future[str], CampaignTask] = field(default_factory=dict)
    again: deque[CampaignTask] = field(default_factory=deque)
    suspects: deque[CampaignTask] = field(default_factory=deque)
    begun: Counter[int] = field(default_factory=Counter)
    died: Counter[int] = field(default_factory=Counter)
    troubles: Counter[int] = field(default_factory=Counter)
    not_before: float = 0.0
    alone: int | None = None
    words: dict[int, list[str]] = field(default_factory=dict)

    def finished(self) -> Iterator[TaskResult]:
        """What has been played, and nobody has taken any more."""
        for future, task in self.running.items():
            if future.done() and not future.cancelled() and future.exception() is None:
                yield _counted(TaskResult.model_validate_json(future.result()), self.begun[task.index])


def results_of(
    tasks: Iterator[CampaignTask], scheduling: Scheduling, crashed: Callable[[CampaignTask, str, str], TaskResult],
    state: HandedOut,
) -> Iterator[TaskResult]:  # fmt: skip
    """Play tasks, and give their results as they come in.

    Args:
        tasks: what is to be played.
        scheduling: how it is handed out.
        crashed: the result of a task that killed its worker each time, of a reason and a log.
        state: nothing yet; whoever ends before the end finds there what was not taken.

    Raises:
        CampaignStopped: a worker is no such as the others, a machine has no room for long, or the scheduler is gone.
    """
    while True:
        _fill(state, tasks, scheduling)
        if not state.running:
            if not (state.again or state.suspects):
                return
            _idle(scheduling, GLANCE)
            continue
        done, _ = wait(state.running, GLANCE, FIRST_COMPLETED)
        for future in done:
            task = state.running.pop(future)
            result = _taken(state, task, future, scheduling, crashed)
            if result is not None:
                yield _counted(result, state.begun[task.index])
        if not done:
            scheduling.idle()


def _counted(result: TaskResult, attempts: int) -> TaskResult:
    return result.model_copy(update={"game": result.game.model_copy(update={"attempts": attempts})})


def _fill(state: HandedOut, tasks: Iterator[CampaignTask], scheduling: Scheduling) -> None:
    """Hand out as many as there is room for; a suspect only where nothing else is under way."""
    if state.suspects and not state.running:
        task = state.suspects.popleft()
        state.alone = task.index
        _submit(state, task, scheduling)
        return
    if state.suspects or state.alone is not None or time.monotonic() < state.not_before:
        return
    while len(state.running) < max(1, scheduling.window()):
        task_or_none = state.again.popleft() if state.again else next(tasks, None)
        if task_or_none is None:
            return
        _submit(state, task_or_none, scheduling)


def _submit(state: HandedOut, task: CampaignTask, scheduling: Scheduling) -> None:
    state.begun[task.index] += 1
    try:
        future = scheduling.executor.submit(scheduling.play, scheduling.order(task))
    except RuntimeError as error:  # it has ended meanwhile
        raise gone(str(error)) from error
    state.running[future] = task


def _taken(
    state: HandedOut, task: CampaignTask, future: Future[str], scheduling: Scheduling,
    crashed: Callable[[CampaignTask, str, str], TaskResult],
) -> TaskResult | None:  # fmt: skip
    """The result of a task that is over; None: it is done again."""
    alone, state.alone = state.alone == task.index, None
    try:
        return TaskResult.model_validate_json(future.result())
    except CancelledError as error:
        raise gone("it has let go of what it was to play") from error
    except EnvironmentDiffers as error:
        raise unlike(str(error)) from error
    except MachineTrouble as error:
        _trouble(state, task, str(error), scheduling)
    except scheduling.fatal as error:
        state.died[task.index] += 1
        words = state.words.setdefault(task.index, [])
        words.append(f"attempt {state.begun[task.index]}: {error}")
        if alone:
            return crashed(task, f"its worker or its world died {len(words)} times", "\n".join(words))
        (state.again if state.died[task.index] < DEATHS else state.suspects).append(task)
    return None


def _trouble(state: HandedOut, task: CampaignTask, reason: str, scheduling: Scheduling) -> None:
    state.troubles[task.index] += 1
    if state.troubles[task.index] >= TROUBLES:
        raise no_room(reason)
    state.not_before = time.monotonic() + scheduling.pause * state.troubles[task.index]
    state.again.append(task)


def unlike(what: str) -> CampaignStopped:
    """Some would draw or play other games than others."""
    return CampaignStopped(
        f"a worker is not as the others are: {what}: give all of them the same, and the same command goes on"
    )


def no_room(reason: str) -> CampaignStopped:
    """No machine carries a game."""
    return CampaignStopped(f"no game can be played: {reason}: mend that, and the same command goes on")


def gone(why: str) -> CampaignStopped:
    """Nobody is there any more to hand tasks to."""
    return CampaignStopped(f"the scheduler is gone ({why}): start it again, and the same command goes on")


def _idle(scheduling: Scheduling, seconds: float) -> None:
    time.sleep(seconds)
    scheduling.idle()
