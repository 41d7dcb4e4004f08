"""Opponents are found as asked for; what server, account or arm do not allow is one sentence."""

from __future__ import annotations

import io
from collections.abc import Collection, Sequence
from pathlib import Path

import chess
import pytest

from app import UserError
from app.online import launch, lobby
from app.online.launch import account_here, client_of, run_online, upgrade
from app.play.session import SessionResult
from app.settings.defaults import OnlineUse
from app.terminal.game_display import UserInterface
from app.terminal.typed_lines import TypedLines
from tests.app.online.fake_lichess import FakeGame, FakeLichess, Temper
from tests.app.online.online_games import Person, QuickTime, recorded, settings, written_token
from tests.waiting import until


class Saying(Person):
    """A person who says these lines, one whenever somebody would hear it."""

    def __init__(self, *lines: str) -> None:
        super().__init__(0)
        self._typed = list(lines)


class Resigning(Person):
    """A person who resigns each game, and answers whatever else they are asked."""

    def __init__(self, *answers: str) -> None:
        super().__init__(0)
        self._answers = list(answers)
        self.asked: list[str] = []

    def prompt(
        self, sentence: str, answers: Collection[str] = (), squares: Collection[str] = (), *, turn: bool = False
    ) -> None:
        if turn:
            self._typed = ["resign"]
        else:
            self.asked.append(sentence)
            self._typed = [self._answers.pop(0)]


def online(
    lichess: FakeLichess, folder: Path, use: str = "person", lines: Sequence[str] = ("resign",), **more: object
) -> tuple[SessionResult, Saying]:
    person = Saying(*lines)
    with written_token(folder) as token:
        asked = settings(lichess, token, folder / "game", use, **more)
        return run_online(asked, person, person, waiting=QuickTime()), person


def test_anybody_is_sought_and_the_server_answer_time_is_said(tmp_path: Path) -> None:
    with FakeLichess() as lichess:
        lichess.next_color = True
        done, person = online(lichess, tmp_path, lines=("e4", "resign"))
        assert (lichess.seeks, len(lichess.games)) == (1, 1)
    assert done.report.exit_reason == "White resigns"
    assert "Robot plays Anna at http" in person.said[0]
    assert "the server answers in 0.0" in person.said[0]


def test_a_seek_that_expires_is_made_again(tmp_path: Path) -> None:
    with FakeLichess() as lichess:
        begin = lichess.begin

        def begin_at_last(*terms: object, **more: object) -> object:
            return begin(*terms, **more) if lichess.seeks > 1 else None  # type: ignore[arg-type]

        lichess.begin = begin_at_last  # type: ignore[assignment, method-assign]
        online(lichess, tmp_path, lines=("resign",))
        assert lichess.seeks == 2


def test_somebody_is_challenged_with_the_terms(tmp_path: Path) -> None:
    with FakeLichess() as lichess:
        online(lichess, tmp_path, **{"online.opponent": "berta", "clock.time": "5+3"})
        (game,) = lichess.games.values()
        assert (game.opponent, game.limit, game.increment) == ("Berta", 300, 3)
        assert ("mine" in game.id, lichess.seeks) == (True, 0)
    pgn = recorded(tmp_path / "game")
    assert pgn.headers["TimeControl"] == "300+3"


def test_correspondence_has_no_clock(tmp_path: Path) -> None:
    with FakeLichess() as lichess:
        _, person = online(lichess, tmp_path, **{"online.days": 3})
        (game,) = lichess.games.values()
        assert game.days == 3
    assert recorded(tmp_path / "game").headers["TimeControl"] == f"1/{3 * 86_400}"
    assert set(person.clocks) == {None}


def test_who_does_not_accept_or_does_not_exist_is_a_sentence(tmp_path: Path) -> None:
    with FakeLichess() as lichess:
        for number, (name, sentence) in enumerate([("refuser", "refuser does not accept"), ("nobody", "not a player")]):
            (tmp_path / str(number)).mkdir()
            with pytest.raises(UserError, match=sentence):
                online(lichess, tmp_path / str(number), **{"online.opponent": name})
    assert lichess.declined == {}


def test_who_never_answers_is_asked_three_times(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lobby, "EXPIRY", 0.05)
    monkeypatch.setattr(lobby, "POLL", 0.01)
    with FakeLichess() as lichess:
        lichess.begin = lambda *_, **__: None  # type: ignore[assignment, method-assign]
        with pytest.raises(UserError, match="berta has not answered"):
            online(lichess, tmp_path, lines=(), **{"online.opponent": "berta"})
        assert len([path for _, path in lichess.requests if path == "/api/challenge/berta"]) == 3


def test_whoever_waits_for_a_game_may_leave(tmp_path: Path) -> None:
    with FakeLichess() as lichess:
        with pytest.raises(UserError, match="no opponent was found"):
            online(lichess, tmp_path, lines=("e4", "quit"), **{"online.accept": True})
        assert not lichess.games


@pytest.mark.parametrize(
    ("use", "challenge", "reason"),
    [
        ("person", {"variant": "atomic"}, "standard"),
        ("person", {"rated": True}, "casual"),
        ("person", {"timeControl": {"type": "clock", "limit": 60, "increment": 0}}, "tooFast"),
        ("bot", {"timeControl": {"type": "clock", "limit": 60, "increment": 0}}, "tooFast"),
        ("person", {"title": "BOT"}, "noBot"),
        ("bot", {"initialFen": "8/8/8/8/8/8/8/8 w - - 0 1"}, "standard"),
    ],
)
def test_challenges_that_do_not_suit_are_declined_with_the_reason(
    tmp_path: Path, use: str, challenge: dict[str, object], reason: str
) -> None:
    with FakeLichess(Temper(resign=1.0, from_ply=0), "BOT" if use == "bot" else None) as lichess:
        number = lichess.challenged_by("Carl", **challenge)
        lichess.challenged_by("Dora", **({"title": "BOT"} if use == "bot" else {}))
        lichess.next_color = False
        done, person = online(
            lichess, tmp_path, use, lines=(), **{"online.accept": use == "person", "online.arm_seconds": 2.0}
        )
        assert lichess.declined == {number: reason}
        assert [game.opponent for game in lichess.games.values()] == ["Dora"]
    assert done.report.exit_reason == "White resigns"
    assert any("the challenge of" in said and reason in said for said in person.said)


def test_only_one_challenge_at_a_time_is_accepted(tmp_path: Path) -> None:
    with FakeLichess(Temper(resign=1.0, from_ply=0), "BOT") as lichess:
        lichess.next_color = False
        lichess.delay = 0.1
        for name in ("Carl", "Dora"):
            lichess.challenged_by(name)
        online(lichess, tmp_path, "bot", lines=())
        assert len(lichess.games) == 1
        assert list(lichess.declined.values()) == ["later"]


def test_a_rematch_is_played_whoever_proposes_it(tmp_path: Path) -> None:
    for theirs in (1, 0):
        with FakeLichess(Temper(resign=1.0, from_ply=0)) as lichess:
            lichess.next_color, lichess.rematches = False, theirs
            person = Person(0, rematches=1)
            folder = tmp_path / str(theirs)
            folder.mkdir()
            with written_token(folder) as token:
                done = run_online(settings(lichess, token, folder / "game", "person"), person, person,
                                  waiting=QuickTime())  # fmt: skip
            assert [game.opponent for game in lichess.games.values()] == ["Anna", "Anna"]
            assert lichess.seeks == 1
            assert done.report.exit_reason == "White resigns"
            assert len([one for one in (done, *done.before) if one.report.result == "0-1"]) == 2


def resigned(lichess: FakeLichess, folder: Path, *answers: str) -> tuple[SessionResult, Resigning]:
    person = Resigning(*answers)
    with written_token(folder) as token:
        asked = settings(lichess, token, folder / "game", "person")
        return run_online(asked, person, person, waiting=QuickTime()), person


def test_a_rematch_is_asked_for_at_the_terminal_too(tmp_path: Path) -> None:
    with FakeLichess() as lichess:
        lichess.next_color = True
        done, person = resigned(lichess, tmp_path, "rematch", "quit")
        assert [game.opponent for game in lichess.games.values()] == ["Anna", "Anna"]
        assert lichess.seeks == 1
    assert not person.accompanied
    assert [one.report.result for one in (*done.before, done)] == ["0-1", "0-1"]
    assert person.asked == ["White resigns, result 0-1: say 'rematch', 'new' for another opponent, or 'quit'"] * 2


@pytest.mark.parametrize(("answers", "games"), [(("rematch", "quit"), 1), (("rematch", "new", "quit"), 2)])
def test_a_refused_rematch_is_said_and_others_may_be_looked_for(
    tmp_path: Path, answers: tuple[str, ...], games: int
) -> None:
    with FakeLichess() as lichess:
        lichess.next_color = True
        lichess.seeker = "Refuser"
        done, person = resigned(lichess, tmp_path, *answers)
        assert len(lichess.games) == lichess.seeks == games
    assert done.holds
    assert person.asked[1] == (
        "refuser does not accept: the challenge was declined or taken back: say 'new' for another opponent, or 'quit'"
    )


@pytest.mark.parametrize("lines", ["resign\n", "resign\nrematch\n", "resign\nnew\n"])
def test_a_script_that_ends_before_another_game_begins_ends_well(
    tmp_path: Path, lines: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with FakeLichess() as lichess, written_token(tmp_path) as token:
        lichess.next_color = True
        begin = lichess.begin
        monkeypatch.setattr(lichess, "begin", lambda *terms, **more: None if lichess.games else begin(*terms, **more))
        asked = settings(lichess, token, tmp_path / "game", "person")
        done = run_online(asked, UserInterface(), TypedLines(io.StringIO(lines)), waiting=QuickTime())
    assert (done.holds, done.report.exit_reason, done.before) == (True, "White resigns", ())


def test_a_game_that_was_left_goes_on_without_a_ply_lost(tmp_path: Path) -> None:
    with FakeLichess() as lichess, written_token(tmp_path) as token:
        lichess.next_color = True
        first, push = Saying("e4"), lichess._push

        def pushed(game: FakeGame, move: chess.Move) -> None:
            first._typed.append("quit")  # not before: a move that is on its way then is left unsaid
            push(game, move)

        lichess._push = pushed  # type: ignore[method-assign]
        done = run_online(settings(lichess, token, tmp_path / "game", "person"), first, first, waiting=QuickTime())
        assert done.resumable
        (game,) = lichess.games.values()
        until(lambda: len(game.moves) == 2)
        second = Saying("hint", "resign")
        again = launch.resume_online(tmp_path / "game", second, second, waiting=QuickTime())
        assert (again.report.exit_reason, game.status) == ("White resigns", "resign")
        assert [move.uci() for move in recorded(tmp_path / "game").mainline_moves()] == game.moves
        assert any("no hints" in said for said in second.said)
        with pytest.raises(UserError, match="is over after"):
            launch.resume_online(tmp_path / "game", second, second, waiting=QuickTime())


def test_a_game_of_the_account_is_taken_up(tmp_path: Path) -> None:
    with FakeLichess() as lichess:
        lichess.next_color = False
        game = lichess.begin("Emil", id="emil1234")
        done, _ = online(lichess, tmp_path, **{"online.game": "emil1234"})
        assert (game.status, done.report.exit_reason, lichess.seeks) == ("resign", "Black resigns", 0)
        asked = [path for _, path in lichess.requests if path == "/api/board/game/stream/emil1234"]
        assert len(asked) == 1, "whoever plays goes on with the stream that told of the game"


def test_accounts_play_only_as_the_server_allows(tmp_path: Path) -> None:
    with written_token(tmp_path) as token, FakeLichess() as lichess:
        client = client_of(settings(lichess, token, tmp_path / "game", "bot"))
        with pytest.raises(UserError, match=r"Robot is a person's account, .* --upgrade"):
            account_here(client, OnlineUse.BOT)
        lichess.title = "BOT"
        with pytest.raises(UserError, match="with which no person may play: use --bot"):
            account_here(client, OnlineUse.PERSON)


@pytest.mark.parametrize(
    ("answers", "upgraded"),
    [(("upgrade", "Robot"), 1), (("upgrade", "yes"), 0), (("yes", "Robot"), 0), (("", ""), 0)],
)
def test_an_account_is_upgraded_only_by_two_right_answers(
    tmp_path: Path, answers: tuple[str, str], upgraded: int
) -> None:
    questions = list[str]()
    left = list(answers)

    def asked(question: str) -> str:
        questions.append(question)
        return left.pop(0)

    with written_token(tmp_path) as token, FakeLichess() as lichess:
        client = client_of(settings(lichess, token, tmp_path / "game", "bot"))
        if upgraded:
            upgrade(client, asked)
            assert len(questions) == 2
            upgrade(client, asked)  # it is one already: nothing is asked
        else:
            with pytest.raises(UserError, match="was not upgraded"):
                upgrade(client, asked)
        assert lichess.upgraded == upgraded
    assert "cannot be undone" in questions[0]
