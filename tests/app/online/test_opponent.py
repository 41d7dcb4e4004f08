"""The opponent of one game: what the server says becomes events, and what is said here reaches it once."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import chess
import pytest

from app.online.client import Cut, LichessClient
from app.online.endings import end_of_game
from app.online.messages import GameFull, GameState, MessageError, game_line
from app.online.opponent import LichessOpponent
from app.online.token import Token
from app.players.game_end import GameEnd
from app.players.remote import (
    GameOver,
    Notice,
    Offer,
    OfferAnswered,
    Offered,
    RemoteEvent,
    RemoteMove,
    TakenBack,
)
from tests.app.online.fake_lichess import TOKEN, FakeGame, FakeLichess, Temper
from tests.app.online.online_games import QuickTime
from tests.waiting import PATIENCE, until

E4, E5 = chess.Move.from_uci("e2e4"), chess.Move.from_uci("e7e5")


@contextmanager
def playing(
    colour: chess.Color = chess.WHITE, temper: Temper | None = None, **more: Any
) -> Iterator[tuple[FakeLichess, FakeGame, LichessOpponent]]:
    with FakeLichess(temper) as lichess:
        lichess.next_color = colour
        game = lichess.begin("Anna")
        client = LichessClient(lichess.address, Token(TOKEN), QuickTime())
        stream = client.game("board", game.id)
        lines = iter(stream)
        full = GameFull.model_validate(next(line for line in lines if line))
        opponent = LichessOpponent(client, "board", full, stream, "robot", **more)
        try:
            yield lichess, game, opponent
        finally:
            opponent.close()


def following(opponent: LichessOpponent, kind: type, seconds: float = PATIENCE) -> RemoteEvent:
    """The next event of a kind."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if isinstance(event := opponent.next(0.2), kind):
            return event
    raise AssertionError(f"no {kind.__name__} has come")


def silent(lichess: FakeLichess) -> None:
    """The opponent there does nothing any more."""
    lichess._opponent = lambda game: None  # type: ignore[method-assign]


def test_a_move_is_said_and_the_reply_arrives_once() -> None:
    with playing(temper=Temper(again=1.0)) as (_, game, opponent):
        assert (opponent.name, opponent.colour) == ("Anna", chess.BLACK)
        assert opponent.listing.here == "Robot"
        assert opponent.listing.time_control == "900+10"
        assert opponent.listing.site.endswith(f"/{game.id}")
        opponent.stands(chess.Board())
        opponent.play(0, E4)
        reply = following(opponent, RemoteMove)
        assert isinstance(reply, RemoteMove)
        assert (reply.ply, reply.move.uci()) == (1, game.moves[1])
        assert opponent.next(0.3) is None
        assert game.posted == ["e2e4"]
        clock = opponent.clock()
        assert clock is not None
        assert (clock.running, clock.increment) == (chess.WHITE, 10.0)
        assert clock.white_left == pytest.approx(909.75)


def test_a_table_that_is_ahead_or_behind_is_told_what_it_lacks() -> None:
    with playing(chess.BLACK) as (lichess, game, opponent):
        while not game.moves:
            time.sleep(0.005)
        silent(lichess)
        opponent.stands(chess.Board())
        assert following(opponent, RemoteMove) == RemoteMove(0, chess.Move.from_uci(game.moves[0]))
    board = chess.Board()
    board.push(E4)
    with playing(chess.WHITE) as (_, game, opponent):
        opponent.stands(board)  # the program before this one had said nothing of it
        reply = following(opponent, RemoteMove)
        assert isinstance(reply, RemoteMove)
        assert reply.ply == 1
        assert game.moves[0] == "e2e4"


def test_a_move_that_the_server_does_not_take_is_taken_back_after_it_was_said_twice() -> None:
    with playing() as (lichess, _, opponent):
        refused = list[str]()

        def refuse(game: FakeGame, uci: str, *, offers: bool) -> str:
            refused.append(uci)
            return "no"

        lichess._act_move = refuse  # type: ignore[method-assign]
        close = opponent._stream.close
        # the game is heard anew before the thread that speaks goes on
        opponent._stream.close = lambda: (close(), time.sleep(0.3))  # type: ignore[method-assign,func-returns-value]
        opponent.stands(chess.Board())
        opponent.play(0, E4)
        assert following(opponent, Notice) == Notice("the server does not take e2e4: it is taken back")
        assert following(opponent, TakenBack) == TakenBack(0)
        assert refused == ["e2e4", "e2e4"]


def test_a_move_of_a_position_that_is_no_more_is_not_said() -> None:
    with playing() as (lichess, game, opponent):
        opponent.stands(chess.Board())
        opponent.play(0, E4)
        following(opponent, RemoteMove)
        with lichess.lock:
            silent(lichess)
            game.board.pop()
            game.board.pop()
            lichess._tell(game)
        while not opponent._changes:
            time.sleep(0.005)
        opponent.play(2, chess.Move.from_uci("d2d3"))
        assert following(opponent, TakenBack) == TakenBack(0)
        opponent.play(0, E4)
        while len(game.posted) < 2:
            time.sleep(0.005)
        assert game.posted == ["e2e4", "e2e4"]


def test_offers_of_both_sides_are_told_and_answered() -> None:
    with playing() as (lichess, game, opponent):
        opponent.stands(chess.Board())
        opponent.play(0, E4)
        following(opponent, RemoteMove)
        silent(lichess)
        with lichess.lock:
            game.draw.add(chess.BLACK)
            lichess._tell(game)
        assert following(opponent, Offered) == Offered(Offer.DRAW)
        opponent.decline(Offer.DRAW)
        assert following(opponent, OfferAnswered) == OfferAnswered(Offer.DRAW, accepted=False, withdrawn=True)
        with lichess.lock:
            game.back.add(chess.BLACK)
            lichess._tell(game)
        assert following(opponent, Offered) == Offered(Offer.TAKE_BACK, 1)
        opponent.offer(Offer.TAKE_BACK)
        assert following(opponent, TakenBack) == TakenBack(1)
        opponent.offer(Offer.DRAW)
        while not game.draw:
            time.sleep(0.005)
        with lichess.lock:
            game.draw.clear()
            lichess._tell(game)
        assert following(opponent, OfferAnswered) == OfferAnswered(Offer.DRAW, accepted=False)


def test_an_engine_may_be_told_to_take_nothing_back() -> None:
    with playing(takes_back=False) as (lichess, game, opponent):
        opponent.stands(chess.Board())
        opponent.play(0, E4)
        following(opponent, RemoteMove)
        silent(lichess)
        with lichess.lock:
            game.back.add(chess.BLACK)
            lichess._tell(game)
        while game.back:
            time.sleep(0.005)
        assert len(game.moves) == 2


def test_who_has_left_can_be_claimed_against_and_chat_is_shown_without_control_characters() -> None:
    with playing(temper=Temper(gone=1.0)) as (lichess, game, opponent):
        opponent.stands(chess.Board())
        opponent.play(0, E4)
        following(opponent, RemoteMove)
        opponent.claim()
        assert "'claim-victory'" in str(following(opponent, Notice))
        with lichess.lock:
            said = {"type": "chatLine", "room": "player", "username": "Anna", "text": "hi\x1b[31m" + "x" * 500}
            lichess._tell(game, said)
        assert following(opponent, Notice) == Notice("Anna writes: hi[31m" + "x" * 133)
        assert not opponent.claimable
        opponent.play(2, chess.Move.from_uci("a2a3"))
        assert following(opponent, Notice) == Notice("Anna has left the game; say 'claim' to win it")
        assert opponent.claimable
        opponent.claim()
        over = following(opponent, GameOver)
        assert over == GameOver(GameEnd("1-0", "Black has left the game", complete=True), len(game.moves))


def test_who_has_left_can_be_claimed_against_only_in_time_and_while_away() -> None:
    with playing() as (lichess, game, opponent):
        silent(lichess)
        opponent.stands(chess.Board())
        with lichess.lock:
            lichess._tell(game, {"type": "opponentGone", "gone": True, "claimWinInSeconds": 45})
        assert following(opponent, Notice) == Notice("Anna has left the game; say 'claim' after 45 s to win it")
        assert not opponent.claimable
        opponent._client.waiting.wait(46.0, threading.Event())
        assert opponent.claimable
        with lichess.lock:
            lichess._tell(game, {"type": "opponentGone", "gone": False})
        assert following(opponent, Notice) == Notice("Anna is back")
        assert not opponent.claimable


def test_a_flag_falls_only_at_the_server_whatever_the_clock_here_shows() -> None:
    with playing() as (lichess, game, opponent):
        silent(lichess)
        opponent.stands(chess.Board())
        with lichess.lock:
            for move in (E4, E5):
                lichess._push(game, move)
            game.left = {chess.WHITE: 0.0, chess.BLACK: 0.0}
            lichess._tell(game)
        assert [following(opponent, RemoteMove) for _ in range(2)] == [RemoteMove(0, E4), RemoteMove(1, E5)]
        until(lambda: (clock := opponent.clock()) is not None and clock.left(chess.WHITE, 0.0) == 0.0)
        assert opponent.next(0.0) is None
        opponent.play(2, chess.Move.from_uci("g1f3"))  # within the grace that the server gives for the way there
        until(lambda: game.posted == ["g1f3"])
        assert opponent.next(0.0) is None
        with lichess.lock:
            lichess.end(game, "outoftime", chess.WHITE)
        over = following(opponent, GameOver)
        assert over == GameOver(GameEnd("1-0", "Black's time has run out", complete=True), 3)


def test_a_cut_link_is_told_of_when_it_lasts_and_when_it_is_back() -> None:
    with playing() as (lichess, game, opponent):
        opponent.stands(chess.Board())
        lichess.temper.broken, lichess.temper.always = 1.0, True
        lichess.cut(game)
        assert "is cut" in str(following(opponent, Notice))
        lichess.temper.broken = 0.0
        assert "is back" in str(following(opponent, Notice))
        lichess.end(game, "aborted")
        over = following(opponent, GameOver)
        assert over == GameOver(GameEnd("*", "aborted", complete=True), 0)


def test_a_move_of_ours_is_taken_back_where_the_opponent_agrees_and_not_said_again() -> None:
    with playing() as (lichess, game, opponent):
        silent(lichess)
        opponent.stands(chess.Board())
        opponent.play(0, E4)
        until(lambda: game.moves == ["e2e4"])
        until(lambda: not opponent.unsaid)
        opponent.offer(Offer.TAKE_BACK)
        until(lambda: bool(game.back))
        with lichess.lock:
            lichess._answer_take_back(game, agrees=True)
        assert following(opponent, TakenBack) == TakenBack(0)
        lichess.cut(game)
        opponent.play(0, chess.Move.from_uci("d2d4"))
        until(lambda: game.moves == ["d2d4"])
        assert game.posted == ["e2e4", "d2d4"]


def test_an_answer_whose_receipt_is_lost_does_not_become_a_proposal() -> None:
    with playing() as (lichess, game, opponent):
        silent(lichess)
        opponent.stands(chess.Board())
        opponent.play(0, E4)
        until(lambda: game.moves == ["e2e4"])
        with lichess.lock:
            lichess._push(game, E5)
            game.back.add(chess.BLACK)
            lichess._tell(game)
        following(opponent, Offered)
        act, answers = opponent._client.act, list[str]()

        def lossy(kind: str, game_id: str, what: str) -> None:
            act(kind, game_id, what)
            if what.startswith("takeback"):
                answers.append(what)
                raise Cut("the receipt is lost")

        opponent._client.act = lossy  # type: ignore[method-assign]
        opponent.offer(Offer.TAKE_BACK)
        following(opponent, TakenBack)
        until(lambda: not opponent._outbox)
        assert answers == ["takeback/yes"]
        assert not game.back, "nothing is proposed"


@pytest.mark.parametrize("moves", ["e2e5", "e2e4 e2e4"])
def test_moves_that_cannot_be_from_the_beginning_are_a_sentence_too(moves: str) -> None:
    with playing() as (_, _, opponent):
        opponent._state = opponent._state.model_copy(update={"moves": moves})
        opponent.stands(chess.Board())
        over = following(opponent, GameOver)
        assert isinstance(over, GameOver)
        assert "illegal" in over.end.reason


@pytest.mark.parametrize("moves", ["e2e5", "e2e4 e2e4", "e7e5"])
def test_moves_that_cannot_be_end_the_game_in_a_sentence(moves: str) -> None:
    with playing() as (lichess, game, opponent):
        opponent.stands(chess.Board())
        with lichess.lock:
            silent(lichess)
            for stream in game.streams:
                stream.put({**game.state(), "moves": moves})
        over = following(opponent, GameOver)
        assert isinstance(over, GameOver)
        assert not over.end.complete
        assert "illegal" in over.end.reason


STATE = {"type": "gameState", "moves": "", "wtime": 1, "btime": 1, "winc": 0, "binc": 0, "status": "started"}


@pytest.mark.parametrize(
    "wrong",
    [
        {"moves": "e2e4; rm"}, {"moves": 5}, {"moves": "a1a2 " * 20_000}, {"wtime": -1}, {"wtime": "x"},
        {"status": None}, {"winner": "nobody"},
    ],
)  # fmt: skip
def test_lines_that_are_not_as_specified_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(MessageError, match="something unexpected"):
        game_line({**STATE, **wrong})
    assert game_line({"type": "somethingNew"}) is None


@pytest.mark.parametrize(
    ("status", "winner", "end"),
    [
        ("mate", "white", ("1-0", "checkmate")),
        ("resign", "black", ("0-1", "White resigns")),
        ("outoftime", "white", ("1-0", "Black's time has run out")),
        ("outoftime", None, ("1/2-1/2", "time has run out, and the other side has too little material to mate")),
        ("timeout", "white", ("1-0", "Black has left the game")),
        ("draw", None, ("1/2-1/2", "draw")),
        ("stalemate", None, ("1/2-1/2", "stalemate")),
        ("aborted", None, ("*", "aborted")),
        ("noStart", "black", ("0-1", "White has not begun")),
        ("noStart", None, ("*", "nobody has begun")),
        ("somethingNew", "white", ("1-0", "White has won")),
    ],
)
def test_ends_are_named(status: str, winner: str | None, end: tuple[str, str]) -> None:
    state = GameState.model_validate({**STATE, "status": status, "winner": winner})
    assert state.over
    found = end_of_game(state)
    assert (found.result, found.reason) == end
