"""STOP in whole games: at a person's turn, in the arm's ply, with leaving instead of going on, with nobody there."""

from __future__ import annotations

import io
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any, ClassVar

import chess
import pytest

from app.execution.pauses import STAYED, WENT_ON
from app.game.person import GameLeft, NeedsGo, PersonAttendant, UnattendedAttendant
from app.motion.plan import Motion, Plan
from app.pieces.inventory import Stage
from app.play.launch import resume_games, run_games
from app.play.session import SessionResult
from app.players.person import PersonGone
from app.players.typed_commands import NewGame, Word
from app.records import EVENTS_FILE, PlyEvent, StepEvent, read_events, read_history
from app.records.events import TroubleEvent
from app.rig.arm import ArmStopped, Outcome
from app.rig.board import BoardArm
from app.settings.files import settings_of
from app.terminal.game_display import UserInterface
from app.terminal.typed_lines import TypedLines
from hardware.table import TableSettings
from tests.waiting import until

TABLE = TableSettings()


class StoppableArm(BoardArm):
    """An arm of paper that somebody stops before it begins something, of the plies it is told."""

    made: ClassVar[list[StoppableArm]] = []

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.stopped = False
        self.released = 0
        self.stop_at: Callable[[Motion], bool] = lambda _: False
        StoppableArm.made.append(self)

    def release(self) -> None:
        assert self.stopped
        self.stopped, self.released = False, self.released + 1

    def execute(self, plan: Plan, begin: Callable[[Motion], None] | None = None) -> Outcome:
        def begins(motion: Motion) -> None:
            assert not self.stopped, "nobody has said 'go'"
            if begin is not None:
                begin(motion)
            if self.stop_at(motion):
                self.stopped = True
                raise ArmStopped

        return super().execute(plan, begins)


class Script:
    """What a person says: lines one after the other; what can be called happens instead, and they say nothing then."""

    def __init__(self, *said: str | Callable[[], None], accompanied: bool = False) -> None:
        self.left, self.accompanied = list(said), accompanied

    def forget(self, word: str) -> None:
        """What comes is said when it is asked for, never before."""

    def next(self, timeout: float) -> str | None:
        if not self.left:
            raise PersonGone
        one = self.left.pop(0)
        if isinstance(one, str):
            return one
        one()
        return None


class Told(UserInterface):
    """What the person is told and asked, in order."""

    def __init__(self) -> None:
        self.heard_of = list[str]()

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        self.heard_of.append(sentence)

    def prompt(
        self, sentence: str, answers: Collection[str] = (), squares: Collection[str] = (), *, turn: bool = False
    ) -> None:
        self.heard_of.append(f"{sentence} > {' '.join(answers)}".strip())


@pytest.fixture(autouse=True)
def arms(monkeypatch: pytest.MonkeyPatch) -> list[StoppableArm]:
    StoppableArm.made = []
    monkeypatch.setattr("app.rig.board.BoardArm", StoppableArm)
    return StoppableArm.made


def once(stage: Stage, transfer: int = 0) -> Callable[[Motion], bool]:
    """A STOP the first time that a stage of a transfer begins."""
    done = list[None]()

    def now(motion: Motion) -> bool:
        if done or motion.stage is not stage or motion.transfer != transfer:
            return False
        done.append(None)
        return True

    return now


def play(folder: Path, script: Script | None, ui: UserInterface, **changes: Any) -> SessionResult:
    named = {name.replace("__", "."): value for name, value in changes.items()}
    settings = settings_of({"rig.name": "board", "rig.video": False, "out": folder, "engine.nodes": 50, **named})
    return run_games(settings, ui, script)


def troubles(folder: Path) -> list[tuple[str, str]]:
    events = read_events(folder / EVENTS_FILE)
    assert all(event.mended_by is None for event in events if isinstance(event, TroubleEvent))
    return [(event.kind, event.sentence) for event in events if isinstance(event, TroubleEvent)]


SENTENCE = "somebody pressed STOP: say 'go' when the arm may move again"


def test_at_a_persons_turn_the_prompt_tells_of_a_stop_and_go_lifts_it(tmp_path: Path, arms: list[StoppableArm]) -> None:
    ui = Told()

    def press() -> None:
        arms[0].stopped = True

    script = Script("go", press, "go", "e4", press, "d4", "go", "resign")
    done = play(tmp_path / "game", script, ui, white__player="human")
    assert arms[0].released == 2
    first = ui.heard_of.index("nothing is paused: it is your move")
    assert ui.heard_of[first : first + 5] == [
        "nothing is paused: it is your move",
        "White to move: your move >",
        f"White to move: your move; {SENTENCE} >",
        "the arm may move again",
        "White to move: your move >",
    ]
    assert (SENTENCE, "go on? > go") in zip(ui.heard_of, ui.heard_of[1:], strict=False), "the arm was to move then"
    assert (done.report.result, done.report.plies) == ("0-1", 4)
    assert troubles(tmp_path / "game") == [("stopped", WENT_ON)] * 2


@pytest.mark.parametrize("stage", [Stage.APPROACH, Stage.GRASP, Stage.CARRY, Stage.RELEASE])
def test_the_ply_under_way_is_finished_once_the_person_says_go(
    tmp_path: Path, arms: list[StoppableArm], stage: Stage
) -> None:
    ui = Told()
    script = Script(lambda: setattr(arms[0], "stop_at", once(stage)), "e4", "what?", "go", "resign")
    done = play(tmp_path / "game", script, ui, white__player="human")
    assert (done.report.result, done.report.plies) == ("0-1", 2)
    asked = ui.heard_of.index(SENTENCE)
    assert ui.heard_of[asked + 1 : asked + 4] == [
        "go on? > go",
        "'what?' is not an answer: say go, or quit or resign",
        "go on? > go",
    ]
    history = read_history(tmp_path / "game" / EVENTS_FILE, TABLE)
    history.inventory.check_against(history.board)
    assert history.plies[1].resumed
    assert troubles(tmp_path / "game") == [("stopped", WENT_ON)]


def test_quit_at_a_stop_leaves_a_game_that_is_gone_on_with(tmp_path: Path, arms: list[StoppableArm]) -> None:
    script = Script(lambda: setattr(arms[0], "stop_at", once(Stage.CARRY)), "e4", "quit")
    left = play(tmp_path / "game", script, Told(), white__player="human")
    assert left.resumable
    assert (left.report.result, left.report.plies) == ("*", 1)
    assert arms[0].stopped
    assert arms[0].state().felt > 0.5, "the arm rests with the piece in its fingers"
    assert troubles(tmp_path / "game") == [("stopped", STAYED)]
    done = resume_games(tmp_path / "game", Told(), Script("resign"))
    assert (done.report.result, done.report.plies) == ("0-1", 2)


@pytest.mark.parametrize("word", ["resign", "new", "new black"])
def test_who_wants_something_else_than_to_go_on_is_served_once_the_piece_is_out_of_the_fingers(
    tmp_path: Path, arms: list[StoppableArm], word: str
) -> None:
    ui, folder = Told(), tmp_path / "game"
    end = () if word == "resign" else ("quit",)
    script = Script(lambda: setattr(arms[0], "stop_at", once(Stage.CARRY)), "e4", word, "go", *end)
    done = play(folder, script, ui, white__player="human")
    assert "the arm first finishes what it has begun" in ui.heard_of
    assert ui.heard_of.count(SENTENCE) == 2
    assert arms[0].state().felt < 0.5
    history = read_history(folder / EVENTS_FILE, TABLE)
    assert len(history.plies) == 2, "the ply under way is in the record of its game"
    assert history.unfinished is None
    history.inventory.check_against(history.board)
    if word == "resign":
        assert done.report.result == "0-1"
        return
    after = read_history(done.folder / EVENTS_FILE, TABLE)
    assert done.folder != folder
    after.inventory.check_against(after.board)


def test_who_wants_something_else_and_then_rather_leaves_may(tmp_path: Path, arms: list[StoppableArm]) -> None:
    script = Script(lambda: setattr(arms[0], "stop_at", once(Stage.CARRY)), "e4", "new", "quit")
    left = play(tmp_path / "game", script, Told(), white__player="human")
    assert left.resumable
    assert arms[0].stopped


def test_where_nobody_is_there_the_game_ends_and_resume_is_the_go(tmp_path: Path, arms: list[StoppableArm]) -> None:
    folder = tmp_path / "game"

    class Stopping(StoppableArm):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            self.stop_at = once(Stage.CARRY)

    class LeftStopped(StoppableArm):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            self.stopped = True

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("app.rig.board.BoardArm", Stopping)
        done = play(folder, None, Told(), game__moves="e4 d5 exd5")
    assert not done.holds
    assert done.resumable
    assert [failure.reason for failure in done.report.failures] == [
        f"{SENTENCE}; nobody is there to say so: make sure that the arm may move, then continue with 'touchmove resume'"
    ]
    assert arms[0].stopped
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("app.rig.board.BoardArm", LeftStopped)
        again = resume_games(folder, Told())
    assert arms[1].released == 1
    assert again.holds
    assert [ply.san for ply in read_history(folder / EVENTS_FILE, TABLE).plies] == ["e4", "d5", "exd5"]
    assert troubles(folder) == [("stopped", STAYED), ("stopped", WENT_ON)]


def test_a_game_against_a_person_that_is_resumed_after_a_stop_asks_for_go(
    tmp_path: Path, arms: list[StoppableArm]
) -> None:
    folder = tmp_path / "game"
    script = Script(lambda: setattr(arms[0], "stop_at", once(Stage.CARRY)), "e4", "quit")
    play(folder, script, Told(), white__player="human")

    class LeftStopped(StoppableArm):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            self.stopped = True

    ui = Told()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("app.rig.board.BoardArm", LeftStopped)
        done = resume_games(folder, ui, Script("go", "resign"))
    assert ui.heard_of[0] == SENTENCE
    assert arms[-1].released == 1
    assert done.report.plies == 2


def test_a_stop_while_the_pieces_are_set_up_is_gone_on_from(tmp_path: Path, arms: list[StoppableArm]) -> None:
    script = Script(
        "e4", lambda: setattr(arms[0], "stop_at", once(Stage.CARRY, transfer=1)), "new", "go", "quit"
    )  # fmt: skip
    done = play(tmp_path / "game", script, Told(), white__player="human")
    assert troubles(tmp_path / "game" / "set-up-2") == [("stopped", WENT_ON)]
    assert done.folder == tmp_path / "game" / "game-2"
    steps = [event for event in read_events(tmp_path / "game" / "set-up-2" / EVENTS_FILE)
             if isinstance(event, StepEvent | PlyEvent)]  # fmt: skip
    assert steps


@pytest.mark.parametrize("midway", [True, False])
def test_who_quits_one_of_several_games_begins_no_other(tmp_path: Path, arms: list[StoppableArm], midway: bool) -> None:
    """With a piece in the fingers or not: what was left is what another program goes on with."""
    stop = (lambda: setattr(arms[0], "stop_at", once(Stage.CARRY)),) if midway else ()
    left = play(tmp_path / "game", Script(*stop, "e4", "quit"), Told(), white__player="human", game__games=2)
    assert left.resumable
    assert left.folder == tmp_path / "game"
    assert {path.name for path in (tmp_path / "game").iterdir() if path.is_dir()} <= {"frames"}
    done = resume_games(tmp_path / "game", Told(), Script("resign", "quit"))
    assert done.before[0].report.result == "0-1"


def test_who_quits_while_the_pieces_are_set_up_plays_no_game_on_that_board(
    tmp_path: Path, arms: list[StoppableArm]
) -> None:
    script = Script("e4", lambda: setattr(arms[0], "stop_at", once(Stage.CARRY, transfer=1)), "new", "quit")
    left = play(tmp_path / "game", script, Told(), white__player="human")
    assert left.resumable
    assert left.folder == tmp_path / "game" / "set-up-2"
    assert not (tmp_path / "game" / "game-2").exists()
    done = resume_games(tmp_path / "game", Told(), Script("go", "resign"))
    assert done.folder == tmp_path / "game" / "game-2"
    assert done.report.result == "0-1"


# who is asked


@pytest.mark.parametrize(
    ("said", "accompanied", "error"),
    [
        (("go",), True, None),
        (("go",), False, NeedsGo),
        ((), True, NeedsGo),
        (("new", "resign", "go"), True, None),
        (("quit",), True, GameLeft),
    ],
)
def test_whoever_watches_a_demo_may_say_go_or_end_it(
    said: tuple[str, ...], accompanied: bool, error: type[Exception] | None
) -> None:
    attendant = UnattendedAttendant(Script(*said, accompanied=accompanied), Told())
    if error is None:
        attendant.wait_for_go(SENTENCE)
        return
    with pytest.raises(error, match="the person at the board said 'quit'" if error is GameLeft else "touchmove resume"):
        attendant.wait_for_go(SENTENCE)


def test_what_somebody_wants_another_game_to_be_like_is_checked_at_this_prompt_too() -> None:
    asked = list[NewGame]()
    attendant = PersonAttendant(Script("new black"), Told(), require=asked.append)
    with pytest.raises(GameLeft) as left:
        attendant.wait_for_go(SENTENCE)
    assert left.value.word is Word.NEW
    assert asked == [left.value.wish] == [NewGame(person=chess.BLACK)]


def test_a_demo_that_a_watcher_ends_at_a_stop_can_be_gone_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Stopping(StoppableArm):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            self.stop_at = once(Stage.CARRY)

    class Attended(UnattendedAttendant):
        def __init__(self, lines: Any, ui: UserInterface) -> None:
            super().__init__(Script("quit", accompanied=True), ui)

    monkeypatch.setattr("app.rig.board.BoardArm", Stopping)
    monkeypatch.setattr("app.play.table_setup.UnattendedAttendant", Attended)
    done = play(tmp_path / "game", None, Told(), game__moves="e4 d5")
    assert done.resumable
    assert (done.report.result, done.report.exit_reason) == ("*", "left by the person at the board")


def test_a_go_that_was_said_before_the_stop_does_not_lift_it() -> None:
    typed = TypedLines(io.StringIO("go\nE4\nGo\nquit\n"))
    until(lambda: typed._lines.qsize() == 5)
    attendant, ui = PersonAttendant(typed, Told()), Told()
    with pytest.raises(GameLeft) as left:
        attendant.wait_for_go(SENTENCE)
    assert left.value.word == "quit"
    with pytest.raises(PersonGone):
        typed.next(0.0)
    early = TypedLines(None)
    early.offer("go")
    PersonAttendant(early, ui).wait("the game is paused")
    assert ui.heard_of[0] == "the game is paused"


def test_at_a_persons_turn_too_a_go_lifts_no_stop_that_came_after_it(
    tmp_path: Path, arms: list[StoppableArm], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Pressing(TypedLines):
        """Somebody presses STOP just after a 'go' was said that nobody has taken yet."""

        def next(self, timeout: float) -> str | None:
            if not arms[0].stopped and not arms[0].released:
                arms[0].stopped = True
                self.offer("go")
                return None
            if self._lines.empty():
                self.offer("quit")
            return super().next(timeout)

    play(tmp_path / "game", Pressing(None), Told(), white__player="human")  # type: ignore[arg-type]
    assert arms[0].stopped
    assert not arms[0].released
