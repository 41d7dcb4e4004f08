"""Games whose program is killed while the arm moves, and resumed by another one, as a person would.

The program runs in a process of its own (``python -m app.campaign.tasks.kills FOLDER``), which leaves beside the record
what it was told. When it is killed, the seed decides: in which ply, and after how much of the arm's motion there.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

import chess
import numpy as np

from app.campaign.task import CampaignTask
from app.campaign.tasks.mishaps import ListeningPerson
from app.campaign.tasks.playing import asked_for, interface, line_of, note_end, prepared
from app.campaign.tasks.rows import TaskStory
from app.execution.state import EXPECTED_FAILURES
from app.play.launch import resume_games, run_games
from app.records import EVENTS_FILE, PlyEvent
from app.records.files import GAME, write_atomically
from controller.protocol.key import KeyFileError
from controller.protocol.messages import Telemetry
from controller.protocol.states import State
from controller.settings import CONTROLLER_FILE
from controller.wire.address import find_controller
from controller.wire.errors import ControllerError
from controller.wire.listener import TelemetryWatch
from engine.errors import EngineProblem
from engine.process import dying_with_parent
from hardware.parameters import load_parameters

LATEST: Final = 1.6
"""A victim is killed within so much of the arm's motion since it was waited for, at random [s, plant]."""
TASK_FILE: Final = "task.json"
TOLD_FILE: Final = "told.json"
LOG: Final = "program.log"
_GLANCE: Final = 0.0005
_LOOK: Final = 0.01
"""So often the record is looked at for the ply in which somebody dies [s, wall]."""


class KilledWithLog(Exception):
    """The program of a game ended by a fault of its own; the text is its log."""


def play_with_kills(task: CampaignTask, folder: Path, film: bool) -> TaskStory:
    """Play a task whose program dies now and then.

    Raises:
        KilledWithLog: it ended otherwise than it should.
        KeyboardInterrupt: it was broken off; nothing is left running.
    """
    with prepared(task, folder, film) as (settings, relay):
        played = task.model_copy(update={"settings": settings})
        (folder / TASK_FILE).write_text(played.model_dump_json(), encoding="utf-8")
        story = TaskStory(asked_for=asked_for(task, settings), line=line_of(settings))
        moments = _moments(task)
        program = _Program(folder)
        try:
            story.resumed = sum(1 for _ in iter(lambda: program.die_and_go_on(next(moments, None)), False))
            program.wait()
        finally:
            program.end()
        told = json.loads((folder / TOLD_FILE).read_text(encoding="utf-8"))
        story.completed, story.reason = bool(told["completed"]), str(told["reason"])
        story.said, story.asked = told["said"], int(told["asked"])
        story.mishaps = int(told["mishaps"]) + story.resumed
        story.datagrams_lost = 0 if relay is None else relay.lost
        return story


def _moments(task: CampaignTask) -> Iterator[tuple[int, float]]:
    """After how many plies, and after how much motion then [s, plant]."""
    rng = np.random.default_rng([task.seed, 10])
    most = max(1, task.settings.game.plies - 1)
    for ply in sorted(rng.integers(0, most, task.faults.kills).tolist()):
        yield int(ply), float(rng.uniform(0.0, LATEST))


class _Program:
    """The program of a game, in a process of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._game, self._tick = folder, folder / GAME, load_parameters().drive.tick
        self._start()

    def _start(self) -> None:
        with (self._folder / LOG).open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", __name__, str(self._folder)],
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True,
                preexec_fn=dying_with_parent(signal.SIGTERM),  # noqa: PLW1509 - takes no lock; a killed worker ends nothing
            )  # fmt: skip
        self._begun = _lines(self._game)

    def die_and_go_on(self, moment: tuple[int, float] | None) -> bool:
        """Kill it at a moment, and start another one; False: there is none, or the game is over before."""
        if moment is None or not self._reach(*moment):
            return False
        self._process.kill()
        self._process.wait()
        self._start()
        return True

    def _reach(self, plies: int, moved: float) -> bool:
        """Wait for a ply, and for so much motion then; False where the game is over before."""
        controller = self._game / "run" / CONTROLLER_FILE
        while not (controller.exists() and _lines(self._game) > self._begun and _plies(self._game) >= plies):
            if self._process.poll() is not None:
                return False
            time.sleep(_LOOK)
        seen: list[Telemetry] = []
        with suppress(ControllerError, KeyFileError), TelemetryWatch(*find_controller(controller.parent), seen.append):
            return await_motion(seen, round(moved / self._tick), lambda: self._process.poll() is None)
        return False

    def wait(self) -> None:
        """Wait for its end, which is a good one."""
        if self._process.wait() != 0:
            raise KilledWithLog((self._folder / LOG).read_text(encoding="utf-8", errors="replace"))

    def end(self) -> None:
        """Nothing of it is left running."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)
            try:
                self._process.wait(30.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()


def heard(seen: list[Telemetry], first: int, goes_on: Callable[[], bool]) -> Iterator[Telemetry]:
    """Telemetry from an index on, as it comes."""
    while goes_on():
        while first < len(seen):
            yield seen[first]
            first += 1
        time.sleep(_GLANCE)


def await_motion(seen: list[Telemetry], moved: int, goes_on: Callable[[], bool]) -> bool:
    """Wait until the arm has moved for so many ticks, and moves; False where something ends before."""
    before, done = None, 0
    for now in heard(seen, 0, goes_on):
        if now.state is State.TRACK and before is not None:
            done += now.tick - before
        before = now.tick
        if done >= moved and now.state is State.TRACK and now is seen[-1]:
            return True
    return False


def _lines(game: Path) -> int:
    return _count(game, b"\n")


def _plies(game: Path) -> int:
    return _count(game, b'"event":"ply"')


def _count(game: Path, what: bytes) -> int:
    events = game / EVENTS_FILE
    return events.read_bytes().count(what) if events.exists() else 0


class _Kept(ListeningPerson):
    """What the program was told, on the disk after each ply: it may be killed at any moment."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path
        before = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        self.said, self.asked, self._mishaps = before.get("said"), before.get("asked", 0), before.get("mishaps", 0)
        self.mishaps: Callable[[], int] = lambda: 0

    def ply(self, event: PlyEvent, board: chess.Board) -> None:
        """See ``UserInterface.ply``."""
        self.keep(TaskStory())

    def keep(self, story: TaskStory) -> None:
        """Write it down."""
        content = {
            "said": self.said, "asked": self.asked, "mishaps": self._mishaps + self.mishaps(),
            "completed": story.completed, "reason": story.reason,
        }  # fmt: skip
        write_atomically(self._path, json.dumps(content) + "\n")


def run_program(folder: Path) -> int:
    """Play the task of a folder, or go on with it; exit status."""
    task = CampaignTask.model_validate_json((folder / TASK_FILE).read_bytes())
    kept, story = _Kept(folder / TOLD_FILE), TaskStory()
    with interface(task, task.settings, kept) as (ui, mishaps):
        kept.mishaps = mishaps
        try:
            if (folder / GAME / EVENTS_FILE).exists():
                result = resume_games(folder / GAME, ui)
            else:
                result = run_games(task.settings, ui)
            note_end(story, result)
        except (*EXPECTED_FAILURES, EngineProblem) as error:
            story.reason = str(error)
        kept.keep(story)
    return 0


if __name__ == "__main__":
    # not SIGINT, which workers ignore: what starts inherits that
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    sys.exit(run_program(Path(sys.argv[1])))
