"""A stand-in for Lichess's HTTP interface on loopback, made from its public specification, with a bad temper on demand.

It has one account, whose token it knows, and opponents of its own, who play random legal moves. Streams are chunked
lines of JSON with empty lines between them to keep them alive, as the specification says.
"""

from __future__ import annotations

import json
import queue
import random
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

import chess

TOKEN: Final = "lip_s3cretS3cretS3cret"
ME: Final = {"id": "robot", "name": "Robot", "username": "Robot"}
KEEP_ALIVE: Final = 0.5
"""Empty lines come as often, a little quicker than there [s]."""
CUT: Final = "cut"
END: Final = "end"


@dataclass
class Temper:
    """What goes wrong, each with a probability, drawn from a seed.

    Attributes:
        cut: a game's streams are cut after a move.
        lost: an answer is lost on its way, after the request was served or before.
        limit: a request is answered 429.
        broken: a request is answered 502.
        draw: the opponent offers a draw with a move; half of them where it is offered one.
        take_back: the opponent proposes to take back.
        gone: the opponent leaves for good.
        flag: somebody's time runs out, from the given ply on.
        resign: the opponent gives up, from the given ply on.
        abort: the opponent aborts before its second move.
        again: a state is said twice.
        chat: somebody says something.
    """

    seed: int = 0
    cut: float = 0.0
    lost: float = 0.0
    limit: float = 0.0
    broken: float = 0.0
    draw: float = 0.0
    take_back: float = 0.0
    gone: float = 0.0
    flag: float = 0.0
    resign: float = 0.0
    abort: float = 0.0
    again: float = 0.0
    chat: float = 0.0
    from_ply: int = 12
    always: bool = False
    """Of requests as many may fail in a row as it comes."""

    def __post_init__(self) -> None:
        self.random = random.Random(self.seed)
        self._in_row = 0
        self.happened: dict[str, int] = {}

    def strikes(self, what: str) -> bool:
        """Whether it goes wrong now."""
        struck = self.random.random() < getattr(self, what)
        if struck:
            self.happened[what] = self.happened.get(what, 0) + 1
        return struck

    def trouble(self) -> str | None:
        """What becomes of a request: never of three in a row, as nobody tries for ever."""
        for what in ("limit", "broken", "lost") if self._in_row < 2 or self.always else ():
            if self.strikes(what):
                self._in_row += 1
                return what if what != "lost" else self.random.choice(["lost before", "lost after"])
        self._in_row = 0
        return None


@dataclass
class FakeGame:
    """A game between the account and an opponent."""

    id: str
    me: chess.Color
    opponent: str
    limit: int
    increment: int
    days: int | None = None
    rated: bool = False
    board: chess.Board = field(default_factory=chess.Board)
    status: str = "started"
    winner: str | None = None
    draw: set[chess.Color] = field(default_factory=set)
    back: set[chess.Color] = field(default_factory=set)
    gone: bool = False
    left: dict[chess.Color, float] = field(default_factory=dict)
    streams: list[queue.Queue[Any]] = field(default_factory=list)
    posted: list[str] = field(default_factory=list)
    taken_back: int = 0

    def __post_init__(self) -> None:
        self.left = dict.fromkeys(chess.COLORS, float(self.limit))

    @property
    def over(self) -> bool:
        return self.status != "started"

    @property
    def result(self) -> str:
        if self.winner is not None:
            return "1-0" if self.winner == "white" else "0-1"
        return "*" if self.status == "aborted" else "1/2-1/2"

    @property
    def moves(self) -> list[str]:
        return [move.uci() for move in self.board.move_stack]

    def state(self) -> dict[str, Any]:
        said: dict[str, Any] = {
            "type": "gameState", "moves": " ".join(self.moves), "status": self.status,
            "wtime": int(1000 * self.left[True]), "btime": int(1000 * self.left[False]),
            "winc": 1000 * self.increment, "binc": 1000 * self.increment,
        }  # fmt: skip
        if self.winner is not None:
            said["winner"] = self.winner
        said |= {("w" if colour else "b") + "draw": True for colour in self.draw}
        said |= {("w" if colour else "b") + "takeback": True for colour in self.back}
        return said

    def full(self) -> dict[str, Any]:
        mine = {"id": ME["id"], "name": ME["name"], "title": None, "rating": 1500}
        theirs = {"id": self.opponent.lower(), "name": self.opponent, "title": None, "rating": 1600}
        said: dict[str, Any] = {
            "type": "gameFull", "id": self.id, "variant": {"key": "standard", "name": "Standard", "short": "Std"},
            "speed": "rapid", "perf": {"name": "Rapid"}, "rated": self.rated, "createdAt": 1_700_000_000_000,
            "white": mine if self.me else theirs, "black": theirs if self.me else mine,
            "initialFen": "startpos", "state": self.state(),
        }  # fmt: skip
        if self.days is None:
            said["clock"] = {"initial": 1000 * self.limit, "increment": 1000 * self.increment}
        else:
            said["daysPerTurn"] = self.days
        return said


class FakeLichess:
    """The server; a context manager. ``title`` is that of the account, "BOT" of a bot's."""

    def __init__(self, temper: Temper | None = None, title: str | None = None, token: str = TOKEN) -> None:
        self.temper = temper or Temper()
        self.title, self.token = title, token
        self.lock = threading.RLock()
        self.games: dict[str, FakeGame] = {}
        self.challenges: dict[str, dict[str, Any]] = {}
        self.declined: dict[str, str] = {}
        self.events: list[queue.Queue[Any]] = []
        self.requests: list[tuple[float, str]] = []
        self.limited_at: list[float] = []
        self.upgraded = 0
        self.now: Callable[[], float] = time.monotonic
        self.delay = 0.002
        self.next_color: chess.Color | None = None
        self.rematches = 0
        self.seeks = 0
        self.seeker = "Anna"
        self._number = 0
        self._jobs: queue.Queue[Callable[[], None] | None] = queue.Queue()
        self._server = _Server(("127.0.0.1", 0), _handler_of(self))
        self._threads = [
            threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True),
            threading.Thread(target=self._work, daemon=True),
        ]

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self._server.server_address[1]}"

    def __enter__(self) -> FakeLichess:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._jobs.put(None)
        with self.lock:
            for stream in [*self.events, *(one for game in self.games.values() for one in game.streams)]:
                stream.put(END)
        self._server.shutdown()
        self._server.server_close()
        for thread in self._threads:
            thread.join()

    # -------------------------------------------------------------------------------------------------------- games

    def begin(self, opponent: str, limit: int = 900, increment: int = 10, **more: Any) -> FakeGame:
        with self.lock:
            self._number += 1
            me = self.temper.random.random() < 0.5 if self.next_color is None else self.next_color
            game = FakeGame(more.pop("id", f"game{self._number:04d}"), me, opponent, limit, increment, **more)
            self.games[game.id] = game
            self._tell_account(self._started(game))
            self._later(lambda: self._opponent(game))
            return game

    def challenged_by(self, name: str, **more: Any) -> str:
        """Somebody challenges the account."""
        with self.lock:
            self._number += 1
            challenge = {
                "id": f"chal{self._number:04d}", "url": "", "status": "created", "destUser": ME,
                "challenger": {"id": name.lower(), "name": name, "title": more.pop("title", None)},
                "variant": {"key": more.pop("variant", "standard")}, "rated": False, "speed": "rapid",
                "timeControl": {"type": "clock", "limit": 900, "increment": 10}, "color": "random",
                "perf": {"icon": "", "name": "Rapid"}, **more,
            }  # fmt: skip
            self.challenges[challenge["id"]] = challenge
            self._tell_account({"type": "challenge", "challenge": challenge})
            return str(challenge["id"])

    def cut(self, game: FakeGame) -> None:
        with self.lock:
            for stream in game.streams:
                stream.put(CUT)
            game.streams.clear()

    def _started(self, game: FakeGame) -> dict[str, Any]:
        colour = "white" if game.me else "black"
        return {"type": "gameStart", "game": {"gameId": game.id, "fullId": game.id + "abcd", "color": colour}}

    def _tell_account(self, said: dict[str, Any]) -> None:
        for stream in self.events:
            stream.put(said)

    def _tell(self, game: FakeGame, said: dict[str, Any] | None = None) -> None:
        for stream in game.streams:
            stream.put(said or game.state())
            if said is None and self.temper.strikes("again"):
                stream.put(game.state())
        if game.over:
            for stream in game.streams:
                stream.put(END)
            game.streams.clear()

    def end(self, game: FakeGame, status: str, winner: chess.Color | None = None) -> None:
        with self.lock:
            if game.over:
                return
            game.status = status
            game.winner = None if winner is None else ("white" if winner else "black")
            game.draw.clear()
            game.back.clear()
            self._tell(game)
            self._tell_account({"type": "gameFinish", "game": {"gameId": game.id, "fullId": game.id}})
            if self.rematches > 0:
                self.rematches -= 1
                self._later(lambda: self.challenged_by(game.opponent, rematchOf=game.id) and None)

    def _push(self, game: FakeGame, move: chess.Move) -> None:
        mover = game.board.turn
        game.board.push(move)
        game.left[mover] += game.increment - 0.25
        game.draw.discard(not mover)
        game.back.clear()
        outcome = game.board.outcome()
        if outcome is None:
            self._tell(game)
            return
        names = {chess.Termination.CHECKMATE: "mate", chess.Termination.STALEMATE: "stalemate"}
        self.end(game, names.get(outcome.termination, "draw"), outcome.winner)

    # ------------------------------------------------------------------------------------------------- the opponents

    def _later(self, job: Callable[[], None]) -> None:
        self._jobs.put(job)

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            time.sleep(self.delay)
            with self.lock:
                job()

    def _opponent(self, game: FakeGame) -> None:
        """The opponent's turn, or what it does in ours; called under the lock whenever something has changed."""
        temper, theirs = self.temper, not game.me
        plies = len(game.board.move_stack)
        if game.over or game.gone:
            return
        if game.me in game.draw and theirs not in game.draw:
            if temper.random.random() < temper.draw and plies >= 2:
                self.end(game, "draw")
                return
            game.draw.discard(game.me)
            self._tell(game)
        if game.me in game.back:
            self._answer_take_back(game, agrees=temper.random.random() < 0.5)
            return
        if game.board.turn is not theirs:
            return
        if plies < 2 and temper.strikes("abort"):
            self.end(game, "aborted")
        elif plies >= temper.from_ply and temper.strikes("resign"):
            self.end(game, "resign", game.me)
        elif plies >= temper.from_ply and temper.strikes("flag"):
            game.left[theirs] = 0.0
            self.end(game, "outoftime", game.me)
        elif plies >= 2 and temper.strikes("gone"):
            game.gone = True
            self._tell(game, {"type": "opponentGone", "gone": True, "claimWinInSeconds": 0})
        else:
            self._move(game)

    def _move(self, game: FakeGame) -> None:
        temper, theirs = self.temper, not game.me
        offers = temper.strikes("draw") and len(game.board.move_stack) >= 2
        self._push(game, temper.random.choice(list(game.board.legal_moves)))
        if game.over:
            return
        if offers:
            game.draw.add(theirs)
            self._tell(game)
        if temper.strikes("chat"):
            self._tell(game, {"type": "chatLine", "room": "player", "username": game.opponent, "text": "good move"})
        if len(game.board.move_stack) >= 2 and temper.strikes("take_back"):
            game.back.add(theirs)
            self._tell(game)
        if len(game.board.move_stack) >= temper.from_ply and temper.strikes("flag"):
            game.left[game.me] = 0.0
            self.end(game, "outoftime", theirs)
        if temper.strikes("cut"):
            self.cut(game)

    def _answer_take_back(self, game: FakeGame, *, agrees: bool) -> None:
        """The opponent answers what the account has proposed, or the account what the opponent has."""
        asked = game.me if game.me in game.back else not game.me
        game.back.clear()
        plies = 1 if game.board.turn is not asked else 2
        if agrees and len(game.board.move_stack) >= plies:
            for _ in range(plies):
                game.board.pop()
            game.taken_back += plies
            game.draw.clear()
        self._tell(game)
        self._later(lambda: self._opponent(game))

    # -------------------------------------------------------------------------------------------------- the interface

    def act(self, game: FakeGame, what: list[str], query: dict[str, list[str]]) -> str | None:
        """Something is done in a game; an error, or None."""
        with self.lock:
            if what != ["claim-victory"] and game.over:
                return "This game is over"
            match what:
                case ["move", uci]:
                    return self._act_move(game, uci, offers="offeringDraw" in query)
                case ["draw", "yes"]:
                    if (not game.me) in game.draw:
                        self.end(game, "draw")
                        return None
                    game.draw.add(game.me)
                    self._tell(game)
                case ["draw", "no"]:
                    game.draw.discard(not game.me)
                    self._tell(game)
                case ["takeback", answer]:
                    if (not game.me) in game.back:
                        self._answer_take_back(game, agrees=answer == "yes")
                        return None
                    if answer == "no":
                        return "Nothing to decline"
                    game.back.add(game.me)
                    self._tell(game)
                case ["resign"]:
                    self.end(game, "resign", not game.me)
                case ["abort"]:
                    if len(game.board.move_stack) > 2:
                        return "This game can no longer be aborted"
                    self.end(game, "aborted")
                case ["claim-victory"]:
                    if not game.gone:
                        return "The opponent has not left"
                    self.end(game, "timeout", game.me)
                case _:
                    return "Not found"
            self._later(lambda: self._opponent(game))
            return None

    def _act_move(self, game: FakeGame, uci: str, *, offers: bool) -> str | None:
        if game.board.turn is not game.me:
            return "Not your turn"
        try:
            move = game.board.parse_uci(uci)
        except ValueError:
            return "Piece cannot move to that square"
        game.posted.append(uci)
        if offers:
            game.draw.add(game.me)
        self._push(game, move)
        self._later(lambda: self._opponent(game))
        if self.temper.strikes("cut"):
            self.cut(game)
        return None


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False


def _handler_of(lichess: FakeLichess) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def log_message(self, *_: Any) -> None:
            """Nobody reads it."""

        def do_GET(self) -> None:
            self._serve()

        def do_POST(self) -> None:
            self._serve()

        def _serve(self) -> None:
            length = int(self.headers.get("Content-Length") or 0)
            body = {key: values[0] for key, values in parse_qs(self.rfile.read(length).decode()).items()}
            parts = urlsplit(self.path)
            path, temper = parts.path.strip("/").split("/"), lichess.temper
            lichess.requests.append((lichess.now(), parts.path))
            if self.headers.get("Authorization") != f"Bearer {lichess.token}":
                return self._answer(401, {"error": "No such token"})
            with lichess.lock:
                trouble = temper.trouble()
            if trouble == "limit":
                lichess.limited_at.append(lichess.now())
                return self._answer(429, {"error": "Too many requests"})
            if trouble == "broken":
                return self._answer(502, {"error": "bad gateway"})
            if trouble == "lost before":
                return self._hang_up()
            self._lost = trouble == "lost after"
            return self._route(path, body, parse_qs(parts.query))

        def _route(self, path: list[str], body: dict[str, str], query: dict[str, list[str]]) -> None:
            match self.command, path:
                case "GET", ["api", "account"]:
                    self._answer(200, {**ME, "title": lichess.title})
                case "GET", ["api", "account", "playing"]:
                    games = [{"gameId": game.id} for game in lichess.games.values() if not game.over]
                    self._answer(200, {"nowPlaying": games, "nbMyTurn": 0})
                case "POST", ["api", "bot", "account", "upgrade"]:
                    lichess.upgraded += 1
                    lichess.title = "BOT"
                    self._answer(200, {"ok": True})
                case "GET", ["api", "stream", "event"]:
                    self._stream_events()
                case "POST", ["api", "board", "seek"]:
                    self._seek(body)
                case "POST", ["api", "challenge", name]:
                    self._challenge(name, body)
                case "POST", ["api", "challenge", number, verb]:
                    self._answer_challenge(number, verb, body)
                case "GET", ["api", "board" | "bot" as kind, "game", "stream", number]:
                    self._stream_game(kind, number)
                case "POST", ["api", "board" | "bot" as kind, "game", number, *what] if number in lichess.games:
                    if (kind == "bot") is not (lichess.title == "BOT"):
                        return self._answer(400, {"error": "This endpoint can only be used with the other API"})
                    error = lichess.act(lichess.games[number], what, query)
                    self._answer(200, {"ok": True}) if error is None else self._answer(400, {"error": error})
                case _:
                    self._answer(404, {"error": "Not found."})
            return None

        # parts

        def _answer(self, status: int, said: dict[str, Any]) -> None:
            if getattr(self, "_lost", False):
                return self._hang_up()
            body = json.dumps(said).encode()
            self.send_response(status)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)
            return None

        def _hang_up(self) -> None:
            self.close_connection = True
            try:
                self.connection.shutdown(socket.SHUT_RDWR)
            except OSError:
                return

        def _stream_events(self) -> None:
            stream: queue.Queue[Any] = queue.Queue()
            with lichess.lock:
                for game in lichess.games.values():
                    if not game.over:
                        stream.put(lichess._started(game))
                for challenge in lichess.challenges.values():
                    stream.put({"type": "challenge", "challenge": challenge})
                for other in lichess.events:
                    other.put(END)  # only one at a time
                lichess.events[:] = [stream]
            self._pour(stream)

        def _stream_game(self, kind: str, number: str) -> None:
            game = lichess.games.get(number)
            if game is None:
                return self._answer(404, {"error": "No such game"})
            stream: queue.Queue[Any] = queue.Queue()
            with lichess.lock:
                stream.put(game.full())
                if game.gone:
                    stream.put({"type": "opponentGone", "gone": True, "claimWinInSeconds": 0})
                if game.over:
                    stream.put(END)
                else:
                    game.streams.append(stream)
            return self._pour(stream)

        def _seek(self, body: dict[str, str]) -> None:
            lichess.seeks += 1
            stream: queue.Queue[Any] = queue.Queue()
            limit, increment = int(60 * float(body.get("time", 0))), int(body.get("increment", 0))
            days = int(body["days"]) if "days" in body else None

            def pair() -> None:
                lichess.begin(lichess.seeker, limit, increment, days=days, rated=body["rated"] == "true")
                stream.put(END)  # a seek ends once somebody is found

            lichess._later(pair)
            if days is None:
                self._pour(stream)
            else:
                self._answer(200, {"id": "seek0001"})

        def _challenge(self, name: str, body: dict[str, str]) -> None:
            if name == "nobody":
                return self._answer(400, {"error": "nobody is not a player"})
            with lichess.lock:
                lichess._number += 1
                number = f"mine{lichess._number:04d}"
            self._answer(200, {"id": number, "url": "", "status": "created"})
            if name == "refuser":
                said = {"type": "challengeDeclined", "challenge": {"id": number}}
                lichess._later(lambda: lichess._tell_account(said))
            else:
                times = int(body.get("clock.limit", 0)), int(body.get("clock.increment", 0))
                more = {"id": number, "days": int(body["days"]) if "days" in body else None}
                lichess._later(lambda: lichess.begin(name.capitalize(), *times, **more) and None)
            return None

        def _answer_challenge(self, number: str, verb: str, body: dict[str, str]) -> None:
            with lichess.lock:
                challenge = lichess.challenges.pop(number, None)
            if challenge is None:
                return self._answer(404, {"error": "No such challenge"})
            if verb == "decline":  # before it is answered: whoever asks may be asked about it at once
                lichess.declined[number] = body.get("reason", "")
            self._answer(200, {"ok": True})
            if verb == "accept":
                control = challenge["timeControl"]
                name, times = challenge["challenger"]["name"], (control.get("limit", 0), control.get("increment", 0))
                lichess._later(lambda: lichess.begin(name, *times, id=number) and None)
            return None

        def _pour(self, stream: queue.Queue[Any]) -> None:
            self.close_connection = True
            self.send_response(200)
            self.send_header("Content-Type", "application/x-ndjson")
            self.send_header("Transfer-Encoding", "chunked")
            self.end_headers()
            try:
                while True:
                    try:
                        said = stream.get(timeout=KEEP_ALIVE)
                    except queue.Empty:
                        self._chunk(b"\n")
                        continue
                    if said == CUT:
                        return self._hang_up()
                    if said == END:
                        return self._chunk(b"")
                    self._chunk(json.dumps(said).encode() + b"\n")
            except OSError:
                return None  # whoever listened has gone

        def _chunk(self, data: bytes) -> None:
            self.wfile.write(f"{len(data):x}\r\n".encode() + data + b"\r\n")
            self.wfile.flush()

    return Handler
