"""Games against an opponent elsewhere: their moves are made here, ours are told at once, and their end holds."""

from __future__ import annotations

import json
import time
from collections.abc import Collection, Sequence
from pathlib import Path

import chess
import chess.pgn
import pytest

from app import UserError
from app.execution.table import Table
from app.game import GameEnd
from app.play.remote_launch import resume_remote_games, run_remote_games
from app.play.session import SessionResult
from app.players.remote import (
    GameOver,
    Notice,
    Offer,
    OfferAnswered,
    Offered,
    OpponentClock,
    RemoteEvent,
    RemoteMove,
    TakenBack,
)
from app.settings.defaults import Settings
from app.settings.files import settings_of
from app.terminal.game_display import UserInterface
from app.terminal.shown import ClockShown, RemoteShown, SessionShown
from hardware.interfaces import HardwareError
from hardware.piece_set import Colour
from tests.app.game.scripted_opponent import Script, ScriptedOpponent, Source, ends_when_asked, line_of

CLOCK = OpponentClock(60.0, 60.0, running=chess.WHITE, at=0.0)
MATE = ("f3", "e5", "g4", "Qh4#")


class Told(UserInterface):
    def __init__(self) -> None:
        self.said: list[str] = []
        self.phases: list[str] = []
        self.persons: list[Colour | None] = []
        self.clocks: list[ClockShown | None] = []
        self.remotes: list[RemoteShown] = []

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        self.said.append(sentence)

    def session(self, shown: SessionShown) -> None:
        self.persons.append(shown.person)

    def phase(self, text: str) -> None:
        self.phases.append(text)

    def clock(self, shown: ClockShown | None) -> None:
        self.clocks.append(shown)

    def remote(self, shown: RemoteShown) -> None:
        self.remotes.append(shown)


class TypedWhenAsked:
    """``Lines`` of a script: each is typed as soon as somebody would hear it."""

    accompanied = False

    def __init__(self, *lines: str) -> None:
        self.lines = list(lines)

    def next(self, timeout: float) -> str | None:
        if self.lines:
            return self.lines.pop(0)
        time.sleep(min(timeout, 0.01))
        return None

    def forget(self, word: str) -> None:
        """Nothing is forgotten."""


def at(told: str, *events: RemoteEvent) -> Script:
    """These events when that was told."""
    return lambda _, heard: events if heard == told else ()


def made(ply: int, uci: str) -> RemoteMove:
    return RemoteMove(ply, chess.Move.from_uci(uci))


def settings(folder: Path, person: bool = True, **more: object) -> Settings:
    sides = {"white.player": "human"} if person else {"engine.nodes": 200}
    return settings_of({"rig.name": "board", "rig.video": False, "out": folder, **sides, **more})


def play(folder: Path, opponent: ScriptedOpponent, *lines: str, person: bool = True) -> tuple[SessionResult, Told]:
    ui = Told()
    return run_remote_games(settings(folder, person), ui, TypedWhenAsked(*lines), Source(opponent)), ui


def pgn(folder: Path) -> chess.pgn.Game:
    with (folder / "game.pgn").open() as file:
        game = chess.pgn.read_game(file)
    assert game is not None
    return game


def sans(folder: Path) -> str:
    game = pgn(folder)
    return game.board().variation_san(game.mainline_moves())


def ended(result: str, reason: str, plies: int | None = None) -> GameOver:
    return GameOver(GameEnd(result, reason, complete=True), plies)  # type: ignore[arg-type]


def test_a_person_plays_and_the_arm_makes_the_other_moves(tmp_path: Path) -> None:
    opponent = ScriptedOpponent(
        chess.BLACK,
        [line_of(*MATE), at("stands 4", ended("0-1", "White is mated"))],
        time=CLOCK,
    )
    done, ui = play(tmp_path, opponent, "f3", "g4")
    assert (done.holds, done.report.result, done.report.exit_reason) == (True, "0-1", "White is mated")
    assert sans(tmp_path) == "1. f3 e5 2. g4 Qh4#"
    headers = pgn(tmp_path).headers
    assert [headers[tag] for tag in ("White", "Black", "Site", "TimeControl")] == [
        "Bob", "Ada", "https://chess.example/abc", "600+5",
    ]  # fmt: skip
    assert opponent.told == [
        "stands 0", "play f2f3 0", "stands 1", "stands 2", "play g2g4 2", "stands 3", "stands 4",
    ]  # fmt: skip
    by = [json.loads(line).get("by") for line in (tmp_path / "events.jsonl").read_text().splitlines()]
    assert [one for one in by if one] == ["hand", "arm", "hand", "arm"]
    assert any(shown is not None and shown.running is True for shown in ui.clocks)


def test_an_engine_plays_and_its_move_is_told_before_the_arm_has_made_it(tmp_path: Path) -> None:
    opponent = ScriptedOpponent(
        chess.WHITE,
        [line_of("e4"), at("stands 2", ended("1-0", "Black resigns"))],
        time=CLOCK,
    )
    done, _ = play(tmp_path, opponent, person=False)
    assert (done.report.plies, done.report.result) == (2, "1-0")
    heard = [told.split()[0] for told in opponent.told]
    assert heard == ["stands", "stands", "play", "stands"]
    assert pgn(tmp_path).headers["White"] == "Ada"


def test_what_cannot_be_had_against_somebody_elsewhere_is_refused_in_a_sentence_each(tmp_path: Path) -> None:
    opponent = ScriptedOpponent(chess.BLACK, [ends_when_asked])
    done, ui = play(tmp_path, opponent, "hint", "side", "new clock 5+3", "pause", "keep", "decline", "resign")
    assert done.report.exit_reason == "they resign"
    assert len(ui.said) == 6
    assert "no hints" in ui.said[0]
    assert done.report.plies == 0


def test_nothing_of_that_is_known_in_a_game_against_the_robot(tmp_path: Path) -> None:
    from app.play.launch import run_games

    ui = Told()
    plain = settings(tmp_path, **{"engine.nodes": 100})
    done = run_games(plain, ui, TypedWhenAsked("abort", "claim", "decline", "resign"))
    assert done.report.result == "0-1"
    assert len([said for said in ui.said if "somebody elsewhere" in said]) == 3


def test_words_are_heard_while_they_think(tmp_path: Path) -> None:
    opponent = ScriptedOpponent(chess.WHITE, [ends_when_asked])
    done, ui = play(tmp_path, opponent, "hint", "e5", "takeback", "draw")
    assert done.report.exit_reason == "draw agreed"
    assert opponent.told == ["stands 0", "offer draw"]
    assert "no hints" in ui.said[0]
    assert ui.said[1].startswith("it is Ada's move")
    assert ui.persons[-1] is Colour.BLACK, "the page is told where they sit"
    assert ui.said[2] == "there is nothing of yours to take back yet"


@pytest.mark.parametrize(("word", "told"), [("abort", "aborted"), ("draw", "draw agreed"), ("resign", "they resign")])
def test_the_end_is_theirs_to_confirm(tmp_path: Path, word: str, told: str) -> None:
    done, _ = play(tmp_path, ScriptedOpponent(chess.BLACK, [ends_when_asked]), word)
    assert done.report.exit_reason == told


def test_a_game_that_is_left_goes_on_with_what_has_happened_since(tmp_path: Path) -> None:
    first = ScriptedOpponent(chess.BLACK, [line_of(*MATE)])
    done, _ = play(tmp_path, first, "f3", "quit")
    assert (done.report.plies, done.resumable) == (2, True)
    # our next move was told, and never made here; theirs came after it
    moves = at("stands 2", made(2, "g2g4"), made(3, "d8h4"))
    second = ScriptedOpponent(chess.BLACK, [moves, at("stands 4", ended("0-1", "White is mated", 4))])
    again = resume_remote_games(tmp_path, Told(), TypedWhenAsked(), Source(second))
    assert again.report.result == "0-1"
    assert sans(tmp_path) == "1. f3 e5 2. g4 Qh4#"
    assert pgn(tmp_path).headers["Site"] == "https://chess.example/abc"
    with pytest.raises(UserError, match="is over after 4 plies"):
        resume_remote_games(tmp_path, Told(), TypedWhenAsked(), Source(second))


def test_what_came_too_late_is_taken_back(tmp_path: Path) -> None:
    late = at("play g2g4 2", ended("0-1", "White's time has run out", 2))
    done, _ = play(tmp_path, ScriptedOpponent(chess.BLACK, [line_of(*MATE[:2]), late]), "f3", "g4")
    assert (done.holds, done.report.exit_reason) == (True, "White's time has run out")
    assert sans(tmp_path) == "1. f3 e5"


@pytest.mark.parametrize("running", [chess.WHITE, chess.BLACK], ids=["ours", "theirs"])
@pytest.mark.parametrize("person", [True, False], ids=["person", "engine"])
def test_a_clock_that_has_run_out_here_ends_no_game_before_they_say_so(
    tmp_path: Path, person: bool, running: chess.Color
) -> None:
    out = OpponentClock(0.0, 0.0, running, at=0.0)
    over = at("stands 3", ended("1-0", "Black's time has run out", 3))
    opponent = ScriptedOpponent(chess.BLACK, [lambda _, told: [made(1, "e7e5")] if told == "stands 1" else (), over],
                                time=out)  # fmt: skip
    done, ui = play(tmp_path, opponent, "f3", "g4", person=person)
    assert (done.report.plies, done.report.exit_reason) == (3, "Black's time has run out")
    assert [told.split()[0] for told in opponent.told] == ["stands", "play", "stands", "stands", "play", "stands"]
    assert not [said for said in ui.said if "time" in said]


def test_a_flag_that_falls_while_the_arm_moves_counts_once_the_arm_is_done(tmp_path: Path) -> None:
    flag = ended("0-1", "White's time has run out", 2)
    opponent = ScriptedOpponent(chess.BLACK, [at("stands 1", made(1, "e7e5"), flag)], time=CLOCK)
    done, _ = play(tmp_path, opponent, "f3", "g4")
    assert (done.holds, done.report.exit_reason) == (True, "White's time has run out")
    assert sans(tmp_path) == "1. f3 e5"
    assert opponent.told == ["stands 0", "play f2f3 0", "stands 1", "stands 2"]


def test_a_mate_that_came_after_the_flag_is_none(tmp_path: Path) -> None:
    late = at("play d8h4 3", ended("1-0", "Black's time has run out", 3))
    opponent = ScriptedOpponent(chess.WHITE, [line_of(*MATE), late], time=CLOCK)
    done, _ = play(tmp_path, opponent, "e5", "Qh4")
    assert (done.holds, done.report.result) == (True, "1-0")
    assert done.report.exit_reason == "Black's time has run out"
    assert sans(tmp_path) == "1. f3 e5 2. g4"


def test_both_sides_take_back_and_offer_draws(tmp_path: Path) -> None:
    def agree(opponent: ScriptedOpponent, told: str) -> Sequence[RemoteEvent]:
        match told:
            case "stands 2" if "offer take back" not in opponent.told:
                return [Offered(Offer.TAKE_BACK, 1)]
            case "offer take back":
                return [TakenBack(1), made(1, "c7c5")]
            case "stands 4":
                return [Offered(Offer.DRAW), Notice("the link was lost and is back")]
            case "offer draw":
                return [ended("1/2-1/2", "draw agreed")]
            case _:
                return []

    opponent = ScriptedOpponent(chess.BLACK, [line_of("f3", "e5"), at("stands 3", made(3, "d7d6")), agree])
    done, ui = play(tmp_path, opponent, "f3", "takeback", "e4", "draw")
    assert done.report.exit_reason == "draw agreed"
    assert sans(tmp_path) == "1. f3 c5 2. e4 d6"
    assert "Ada proposes to take back: say 'takeback' to accept, or 'decline'" in ui.said
    assert "the link was lost and is back" in ui.said


def test_an_engine_answers_offers_by_itself(tmp_path: Path) -> None:
    offers = at("stands 2", Offered(Offer.DRAW), Offered(Offer.TAKE_BACK, 1))
    opponent = ScriptedOpponent(
        chess.WHITE, [line_of("e4"), offers, at("offer take back", TakenBack(0), ended("*", "aborted", 0))]
    )
    done, _ = play(tmp_path, opponent, person=False)
    assert done.report.exit_reason == "aborted"
    assert done.report.plies == 0
    assert "decline draw" in opponent.told  # too early for this engine


class LateOpponent(ScriptedOpponent):
    """Changes its first move while the engine thinks about it."""

    late = 0

    def next(self, timeout: float) -> RemoteEvent | None:
        if self.late == 1:
            self.late = 2
            return None
        return super().next(timeout)

    def stands(self, board: chess.Board) -> None:
        super().stands(board)
        if len(board.move_stack) == 1 and not self.late:
            self.late = 1
            self.events += [TakenBack(0), made(0, "d2d4")]


def test_an_engine_thinks_again_where_the_position_has_changed_and_not_the_number_of_plies(tmp_path: Path) -> None:
    first = [at("stands 0", made(0, "e2e4")), at("stands 2", ended("1-0", "Black resigns"))]
    opponent = LateOpponent(chess.WHITE, first)
    opponent.scripts = [lambda one, told: () if one.late else first[0](one, told), first[1]]  # type: ignore[attr-defined]
    done, ui = play(tmp_path, opponent, person=False)
    assert done.holds
    assert sans(tmp_path).startswith("1. d4")
    assert len([phase for phase in ui.phases if phase.startswith("Black thinks")]) == 2
    assert len([told for told in opponent.told if told.startswith("play")]) == 1


def test_their_word_on_the_end_counts_and_the_rules_where_they_are_silent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.game.remote_turn.CONFIRMATION", 0.05)
    done, _ = play(tmp_path, ScriptedOpponent(chess.BLACK, [line_of(*MATE)]), "f3", "g4")
    assert (done.report.result, done.report.exit_reason) == ("0-1", "checkmate")


@pytest.mark.parametrize("stays", [True, False])
def test_a_game_is_not_over_here_before_the_last_move_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stays: bool
) -> None:
    """Who mates while the link is down waits until it is back, or leaves and has it sent by 'touchmove resume'."""
    monkeypatch.setattr("app.game.remote_turn.CONFIRMATION", 0.05)
    opponent = ScriptedOpponent(chess.WHITE, [line_of(*MATE)])

    class Waits(TypedWhenAsked):
        def next(self, timeout: float) -> str | None:
            if not self.lines and opponent.unsaid:  # the mate is made, and they do not have it
                if not stays:
                    return "quit"
                opponent.unsaid = False
            return super().next(timeout)

    def cut(one: ScriptedOpponent, told: str) -> tuple[RemoteEvent, ...]:
        one.unsaid = one.unsaid or told.startswith("play d8h4")
        return ()

    opponent.scripts = [*opponent.scripts, cut]
    ui = Told()
    done = run_remote_games(settings(tmp_path), ui, Waits("e5", "Qh4"), Source(opponent))
    assert any("Ada does not have the last move yet" in said for said in ui.said)
    if stays:
        assert (done.report.result, done.report.exit_reason) == ("0-1", "checkmate")
    else:
        assert done.resumable
        assert done.report.result == "*"


def test_fix_in_their_turn_that_cannot_be_done_ends_no_game(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looks = list[object]()

    def blind(self: Table, reply: object = None) -> bool:
        looks.append(reply)
        if len(looks) > 1:  # the first one comes after the person's move
            raise HardwareError("the camera gave no new picture")
        return True

    monkeypatch.setattr(Table, "repair", blind)
    opponent = ScriptedOpponent(chess.BLACK, [at("offer draw", ended("1/2-1/2", "draw agreed"))])
    done, ui = play(tmp_path, opponent, "e4", "fix", "draw")
    assert "the camera gave no new picture" in ui.said
    assert (done.report.result, done.report.failures) == ("1/2-1/2", ())


def test_a_move_that_cannot_be_is_told_in_one_sentence(tmp_path: Path) -> None:
    done, _ = play(tmp_path, ScriptedOpponent(chess.WHITE, [at("stands 0", made(1, "e7e5"))]))
    assert [one.reason for one in done.report.failures] == [
        "Ada has e7e5 as ply 2, and 0 plies stand on this board, after which that cannot be: look at the game where it "
        "is played, and resume it"
    ]


def test_one_game_after_the_other_with_the_pieces_set_up_first(tmp_path: Path) -> None:
    over = at("stands 2", ended("1-0", "Black resigns"))
    games = [
        ScriptedOpponent(chess.BLACK, [line_of(*MATE), over]),
        ScriptedOpponent(chess.WHITE, [line_of("d4", "d5"), over]),
    ]
    ui = Told()
    done = run_remote_games(settings(tmp_path), ui, TypedWhenAsked("e3", "d5"), Source(*games))
    assert [folder.name for folder in (done.folder, *(one.folder for one in done.before[1:]))] == ["game-2", "set-up-2"]
    assert sans(tmp_path / "game-2") == "1. d4 d5"
    assert pgn(tmp_path / "game-2").headers["Black"] == "Bob"
    assert [pgn(tmp_path / "set-up-2").headers[side] for side in ("White", "Black")] == ["Human", "?"]
    assert [one.name for one in ui.remotes if one.words == ("quit",)] == [None, "Ada", None, "Ada"]


def test_the_clock_that_counts_is_theirs(tmp_path: Path) -> None:
    clock = OpponentClock(30.0, 20.0, chess.WHITE, at=100.0, increment=2.0)
    assert (clock.left(chess.WHITE, 104.0), clock.left(chess.BLACK, 104.0)) == (26.0, 20.0)
    assert clock.left(chess.WHITE, 500.0) == 0.0
    from app.game.remote_timing import RemoteTiming

    shown = list[ClockShown | None]()
    timing = RemoteTiming(ScriptedOpponent(chess.WHITE, [], time=clock), lambda: 0.0, lambda: 104.0, shown.append)
    timing.show()
    assert shown == [ClockShown({chess.WHITE: 26.0, chess.BLACK: 20.0}, chess.WHITE)]
    limit = timing.limit(chess.BLACK)
    assert limit is not None
    assert limit.black_clock is not None
    assert limit.black_clock < 20.0 - 0.05
    assert limit.black_inc == 0.0, "the arm takes as long as the increment"
    assert limit.white_inc == 2.0
    assert timing.fallen(chess.Board()) is None


def test_declined_offers_are_told(tmp_path: Path) -> None:
    opponent = ScriptedOpponent(
        chess.BLACK,
        [
            at("stands 0", Offered(Offer.DRAW)),
            at("decline draw", OfferAnswered(Offer.TAKE_BACK, accepted=False)),
            ends_when_asked,
        ],
    )
    _, ui = play(tmp_path, opponent, "decline", "resign")
    assert "decline draw" in opponent.told
    assert ui.said[:2] == ["Ada proposes a draw: say 'draw' to accept, or 'decline'", "you have declined a draw"]
