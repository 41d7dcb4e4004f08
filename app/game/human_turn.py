"""A person's turn: they say something or move a piece; the camera, where there is one, says what was played.

Nothing is guessed. A move counts when the camera has seen it beyond doubt, or when the person has confirmed what it
believes; on a rig without camera, when they have said it. An illegal or half-made move is named with its squares; the
arm puts it right when asked to, or the person does.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import chess

from app import UserError
from app.execution.state import KEPT, WRONG, Remark
from app.execution.table import Table
from app.game.advising import Advising
from app.game.clock import side_name
from app.game.complaints import FORBEARANCE, Complaints
from app.game.person import ENDS_TURNS, HandNotice, PersonAttendant, end_of
from app.game.questions import Interjected, TurnQuestions
from app.game.remote_turn import ANY_TIME, RemoteTurn
from app.game.set_down import badly_set, shows_after
from app.game.timing import Timing
from app.pieces.manipulation import transfers
from app.players.game_end import GameEnd
from app.players.person import Human
from app.players.players import Players
from app.players.typed_commands import Command, MoveHand, NewGame, PlayMove, Word, help_text, parse_command
from app.rig.arm import ArmStopped
from app.settings.time_control import clock_text
from app.terminal.game_display import UserInterface
from engine.errors import EngineProblem
from hardware.interfaces import HardwareError
from vision.reading.outcome import LOOKS, ReadingOutcome, Situation

if TYPE_CHECKING:
    from app.execution.board_view import Reading

POLL: Final = 0.2
"""So often it is looked whether the person has done something by themselves [s, wall]."""

_HERE: Final = "that is for games against somebody elsewhere: here you play against the robot"


class HumanTurn:
    """Takes a person's turns; ``remote``: their opponent, where that sits somewhere else."""

    def __init__(
        self, human: Human, table: Table, players: Players, timing: Timing, ui: UserInterface,
        remote: RemoteTurn | None = None,
    ) -> None:  # fmt: skip
        self._human, self._table, self._players, self._ui = human, table, players, ui
        self._timing, self._questions, self._remote = timing, TurnQuestions(human, ui), remote
        self._advising = Advising(human, table, timing, ui)
        self._colour = human.colour
        # a simulated hand is only there when it was told to be, and is looked after then
        self._notice = HandNotice(table.guard if human.hands is None else None)
        self._complaints = Complaints(table, ui, watches=self._notice.watches)
        self._told, self._stopped = "", False
        self._unsaid: tuple[Reading, float, float] | None = None
        """What was seen when a hand had gone, when that was, and since when it has not been told [s, wall]."""

    def plays(self, colour: chess.Color) -> bool:
        """Whether the person plays this colour now."""
        return self._human.both or colour == self._colour

    def moves_pieces(self, colour: chess.Color) -> bool:
        """Whether the person plays this colour with hands of their own, and so whenever they please."""
        return self.plays(colour) and self._human.hands is None

    def take(self) -> GameEnd | None:
        """Until a ply was made or taken back, sides were changed, or the game has ended."""
        if self._human.both:
            self._colour = self._table.board.turn
        try:
            return self._take()
        finally:
            self._ui.answered()

    def _take(self) -> GameEnd | None:
        done = len(self._table.board.move_stack)
        self._unsaid = None
        if not self._table.replied:
            self._prompt()
        self._timing.start(self._colour)
        other: Command | None = None
        while self._is_to_move(done):
            end, line, unseen, command, other = None, None, self._table.replied, other, None
            if not unseen and command is None:
                before = self._table.board.move_stack.copy()
                if (end := self._heed()) is not None or self._table.board.move_stack != before:
                    return end
                line = self._listen()
            try:
                end = self._take_up() if unseen else self._heard(command, line)
            except ENDS_TURNS:
                raise
            except Interjected as instead:
                other = instead.command
                self._timing.start(self._colour)
            except (UserError, HardwareError, EngineProblem) as error:  # the game stands where it stood
                self._failed(error, done)
            if (end := end or self._flag()) is not None:
                return end
            if self._is_to_move(done) and other is None and (unseen or command is not None or line is not None):
                self._prompt()
        return None

    def _heard(self, command: Command | None, line: str | None) -> GameEnd | None:
        """Something was said, or nothing."""
        if command is None and line is None:
            return self._glance()
        return self._obey(command or parse_command(line or "", self._table.board, self._human.refusal))

    def _failed(self, error: Exception, done: int) -> None:
        """Something that was wanted could not be done; the game goes on unless a piece may be in the fingers."""
        if not self._table.give_up(str(error)):
            raise error
        if str(error) != self._told:  # a camera that is lost is not told of five times a second
            self._ui.say(str(error))
        self._told = str(error)
        if self._is_to_move(done):  # or else their move stands, and the look after it has failed
            self._timing.start(self._colour)

    def _is_to_move(self, done: int) -> bool:
        """Whether the ply after so many is still to be made, and by them."""
        return len(self._table.board.move_stack) == done and self.plays(self._table.board.turn)

    def _listen(self) -> str | None:
        if self._table.permission.stopped is not self._stopped:  # somebody has pressed STOP while nothing moved
            self._prompt()
        self._notice.wake(True)
        try:
            return self._human.lines.next(POLL)
        finally:
            self._notice.wake(False)

    def _heed(self) -> GameEnd | None:
        """What has come from an opponent elsewhere; how the game has ended, if it has."""
        if self._remote is None:
            return None
        spoken = self._remote.spoken
        end = self._remote.heed()
        if end is None and self._remote.spoken != spoken:
            self._prompt()
        return end

    def _flag(self) -> GameEnd | None:
        """The game's end by time; not while what a hand has left may be the move: it counts from when the hand went."""
        decided = self._unsaid is None and not self._notice.leaving() and not self._notice.untold
        return self._timing.fallen(self._table.board) if decided and self.plays(self._table.board.turn) else None

    def wait(self, sentence: str) -> None:
        """Until the person says 'go'; ``GameLeft`` is raised where they leave instead."""
        human = self._human
        PersonAttendant(human.lines, self._ui, require=human.require, refusal=human.refusal).wait(sentence)

    def left(self, word: Word, wish: NewGame | None = None) -> GameEnd:
        """How the game has ended for a person who said quit, resign, new or keep."""
        return end_of(word, wish, self._colour)

    def _prompt(self) -> None:
        left = self._timing.left()
        clocks = "" if left is None else f" ({clock_text(left[chess.WHITE])} - {clock_text(left[chess.BLACK])})"
        before, self._stopped = self._stopped, self._table.permission.stopped
        if self._stopped and not before:
            self._human.lines.forget(Word.GO)  # it was said before the STOP
        stopped = f"; {ArmStopped()}" if self._stopped else ""
        self._ui.prompt(f"{side_name(self._colour)} to move{clocks}: your move{stopped}", turn=True)

    def _obey(self, command: Command) -> GameEnd | None:
        self._unsaid, self._told = None, ""
        if isinstance(command, PlayMove):
            return self._play(command.move)
        if isinstance(command, MoveHand):
            return self._hand(command)
        if isinstance(command, NewGame):
            self._human.require(command)
            return self.left(Word.NEW, command)
        if self._remote is not None and command in ANY_TIME:
            return self._remote.obey(command)
        if command in (Word.RESIGN, Word.NEW, Word.QUIT):
            return self.left(command)
        words: dict[Word, Callable[[], GameEnd | None]] = {
            Word.LOOK: lambda: self._read(None, self._timing.now()),
            Word.FIX: lambda: None if self._table.repair() else WRONG,
            Word.TAKE_BACK: self._take_back,
            Word.HINT: self._hint,
            Word.HELP: lambda: self._ui.say(help_text()),
            Word.DRAW: self._draw,
            Word.PAUSE: self._pause,
            Word.GO: self._go,
            Word.SIDE: self._change_sides,
            Word.KEEP: self._keep,
            **dict.fromkeys((Word.DECLINE, Word.ABORT, Word.CLAIM), lambda: self._ui.say(_HERE)),
        }
        return words[command]()

    def _keep(self) -> GameEnd | None:
        if self._table.observer is not None:
            return KEPT
        self._ui.say("no camera sees this board: start from another position with 'touchmove play --fen'")
        return None

    def _pause(self) -> GameEnd | None:
        self._timing.pause()
        self._ui.say("the clocks are stopped; say 'go' to continue, or 'quit' to leave")
        self._questions.answer("go on?", (Word.GO.value,), self._table.board)
        self._timing.start(self._colour)
        return None

    def _go(self) -> None:
        stopped = self._table.permission.stopped
        if stopped:
            self._table.permission.go_on()
        self._ui.say("the arm may move again" if stopped else "nothing is paused: it is your move")

    def _change_sides(self) -> None:
        if self._human.both:
            self._ui.say("two people play: change seats")
            return
        self._timing.pause()
        self._colour = not self._colour
        self._table.note_sides(self._colour)
        self._ui.say(f"you play {side_name(self._colour)} now")

    def _draw(self) -> GameEnd | None:
        """A draw that can be claimed, or that the robot agrees to."""
        board = self._table.board
        if board.can_claim_draw():
            return GameEnd("1/2-1/2", f"{side_name(self._colour)} claims a draw", True)
        if self._questions.agrees(board) if self._human.both else self._players.accepts_draw(board, not self._colour):
            return GameEnd("1/2-1/2", "draw agreed", True)
        self._ui.say("the game goes on" if self._human.both else "I would like to play on")
        return None

    # moves

    def _glance(self) -> GameEnd | None:
        """Nothing was said: perhaps something was done. A hand that went may come again: what is wrong can wait."""
        there = self._notice.there()
        gone_at = self._notice.gone()
        if gone_at is None:
            if there:
                self._unsaid = None
            elif self._unsaid is not None and time.monotonic() > self._unsaid[2] + FORBEARANCE:
                (reading, then, _), self._unsaid = self._unsaid, None
                return self._judge(reading, None, then)
            return None
        seen = self._look()
        then = self._timing.at(max(gone_at, self._notice.last_gone or gone_at))  # it may have come again since
        if seen is None:
            return None
        verdict = seen.decision.verdict
        if verdict is ReadingOutcome.NOTHING and not self._table.disturbed(centres=False):
            return None
        if verdict is ReadingOutcome.MOVE and not seen.decision.promotion_unsure:
            return self._judge(seen, None, then)
        self._unsaid = seen, then, time.monotonic()
        return None

    def _take_up(self) -> GameEnd | None:
        """Something was played while nobody looked: the person says whether it was that."""
        self._table.replied = False
        seen = self._look()
        if seen is None or seen.decision.verdict is ReadingOutcome.NOTHING:
            return None
        if seen.decision.verdict is not ReadingOutcome.MOVE:
            return self._judge(seen, None, self._timing.now())
        (move,) = seen.decision.moves
        if seen.decision.promotion_unsure:
            move = chess.Move(move.from_square, move.to_square, self._promotion(None))
        self._ui.say("nobody watched the board for a while")
        return self._ask_move(move, None, self._timing.now(), seen, "this looks like {}: was that your move?")

    def _play(self, move: chess.Move) -> GameEnd | None:
        """A legal move was typed: the hand of a simulated world makes it; else the person has made it, or will."""
        if self._human.hands is not None:
            ply = transfers(self._table.board, move, self._table.inventory)
            self._ui.phase(f"your hand plays {ply.san}")
            with self._timing.motion(of_arm=False):
                self._human.hands.play(ply, self._table.inventory)
        done = self._timing.now()
        if self._table.observer is None:
            return self._accept(move, done)
        return self._read(move, done)

    def _hand(self, command: MoveHand) -> GameEnd | None:
        if self._human.hands is None:
            self._ui.say("only a simulated hand can be told what to do: move the piece yourself")
            return None
        with self._timing.motion(of_arm=False):
            self._human.hands.do(command, self._table.inventory)
        return self._read(None, self._timing.now())

    def _read(self, said: chess.Move | None, then: float) -> GameEnd | None:
        """What the camera says was played; ``said``: what the person says; ``then``: when their hand had left [s]."""
        reading = self._look()
        if reading is None:
            self._ui.say("this rig has no camera: type the move")
            return None
        if reading.decision.verdict is not ReadingOutcome.NOTHING:
            return self._judge(reading, said, then)
        if not self._complaints.of_disturbed(centres=True):
            self._ui.say("I see no change on the board" if said is None else f"I do not see {said.uci()} on the board")
        return None

    def _judge(self, reading: Reading, said: chess.Move | None, then: float) -> GameEnd | None:
        """Something has changed on the board; ``said`` and ``then`` as for ``_read``."""
        decision, finding = reading.decision, reading.finding
        if decision.verdict is ReadingOutcome.NOTHING:
            self._complaints.of_disturbed(centres=False)
            return None
        sure, move = decision.verdict is ReadingOutcome.MOVE, decision.move
        if move is not None and (sure or finding.situation is Situation.LEGAL):
            there = (move.from_square, move.to_square)  # what it promotes to is not always seen
            theirs = said is not None and (said.from_square, said.to_square) == there
            possible = (said,) if said is not None and theirs else decision.possible
            if faults := badly_set(self._table, possible, said=theirs):
                self._complaints.of_faults(faults)
                return None
            if decision.promotion_unsure:
                move = chess.Move(move.from_square, move.to_square, self._promotion(said if theirs else None))
            if not (sure or (move.promotion is None and shows_after(self._table, move))):
                return self._ask_move(move, said, then, reading)
            return self._accept(move, then, reading)
        if finding.situation not in (Situation.NOTHING, Situation.LEGAL):
            self._complaints.of_finding(finding)
        elif not self._complaints.of_disturbed(centres=True):
            self._ui.say("I am not sure what I see: make your move, or say 'fix' and the arm checks the board")
        return None

    def _look(self) -> Reading | None:
        """Again while in doubt."""
        observer = self._table.observer
        if observer is None:
            return None
        self._table.be_ready()
        reading = observer.read()
        for _ in range(LOOKS - 1):
            if reading.decision.verdict is not ReadingOutcome.DOUBT:
                break
            reading = observer.read()
        return reading

    def _ask_move(
        self, move: chess.Move, said: chess.Move | None, then: float, reading: Reading,
        question: str = "this looks like {}, but not clearly: was that it?",
    ) -> GameEnd | None:  # fmt: skip
        squares = [chess.square_name(square) for square in (move.from_square, move.to_square)]
        if said == move or self._questions.yes(
            question.format(self._table.board.san(move)), self._table.board, squares
        ):
            return self._accept(move, then, reading)
        self._ui.say("then put the pieces back as they were, or type the move you have made")
        return None

    def _accept(self, move: chess.Move, then: float, reading: Reading | None = None) -> GameEnd | None:
        if (fallen := self._timing.fallen(self._table.board, then)) is not None:
            return fallen
        self._timing.press(then)
        if self._table.observer is not None and reading is not None:
            after = self._table.board.copy()
            after.push(move)
            self._table.observer.confirm(after, reading.look)
        if self._remote is not None:
            self._remote.tell(move)
        well = self._table.hand_ply(move, Remark(clocks=self._timing.left), answers=self._human.both)
        if self._notice.untold:  # what a hand has done since is read as any other move
            self._table.replied = False
        if self._remote is not None:
            self._remote.stands()
        return self._advising.after_move() if well else WRONG

    def _promotion(self, said: chess.Move | None) -> chess.PieceType:
        if said is not None and said.promotion is not None:
            return said.promotion
        return self._questions.promotion(self._table.board)

    # words

    def _take_back(self) -> GameEnd | None:
        plies = 1 if self._human.both else 2
        if len(self._table.board.move_stack) < plies:
            self._ui.say("there is nothing of yours to take back yet")
            return None
        self._timing.pause()
        with self._timing.motion():
            well = self._table.take_back(plies)
        self._timing.take_back(plies)  # not before: it may be refused
        return None if well else WRONG

    def _hint(self) -> None:
        said = self._players.hint(self._table.board)
        assert said.move is not None, "who is asked has an answer, or says why not"
        squares = [chess.square_name(square) for square in (said.move.from_square, said.move.to_square)]
        self._ui.say(f"I would play {self._table.board.san(said.move)}", squares)
