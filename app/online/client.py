"""Requests to Lichess: by berserk, with a deadline each, one at a time, and as slowly as the server asks for."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import suppress
from typing import Any, Final, Protocol, Self
from urllib.parse import urlsplit

import berserk
import requests
from berserk.exceptions import ApiError, ResponseError
from berserk.formats import JsonHandler
from berserk.session import Requestor

from app import UserError
from app.online.messages import Account, account_of, games_of, id_of
from app.online.token import LOOPBACK, Token

CONNECTING: Final = 10.0
"""How long a connection may take [s, wall]."""
SILENCE: Final = 25.0
"""How long the server may say nothing: a stream is kept alive by an empty line each seven seconds [s, wall]."""
RATE_LIMIT: Final = 60.0
"""How long nothing is asked after an answer 429: a full minute, as the server's rules say [s, wall]."""
TRIES: Final = 4
"""So often a request is made that does not reach the server, or whose answer does not come back."""
AGAIN: Final = 1.0
"""What is waited in between [s, wall]."""
BACK_OFF: Final = (0.5, 1.0, 2.0, 5.0, 10.0, 30.0)
"""Waited before a cut link is tried again, the first time, the second, and so on [s, wall]."""
LONGEST_LINE: Final = 1 << 20
"""Of a stream [bytes]."""
_TOO_MANY: Final = 429
_SERVER_ERROR: Final = 500


class Cut(Exception):
    """The server did not answer, or the connection was lost: worth trying again."""


class RequestRefused(Exception):
    """The server does not do what was asked: trying again changes nothing.

    Attributes:
        status: of HTTP.
    """

    def __init__(self, status: int, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


class Waiting(Protocol):
    """How time passes for who waits for the server."""

    def now(self) -> float:
        """Monotonic [s]."""

    def wait(self, seconds: float, closed: threading.Event) -> bool:
        """Wait; True as soon as that is closed."""


class WallTime:
    """``Waiting`` by the wall clock."""

    def now(self) -> float:
        """See ``Waiting.now``."""
        return time.monotonic()

    def wait(self, seconds: float, closed: threading.Event) -> bool:
        """See ``Waiting.wait``."""
        return closed.wait(seconds)


class _Bearer:
    """Of requests: puts the token into a request, so that nothing else, such as a ``.netrc``, does."""

    def __init__(self, token: Token) -> None:
        self._token = token

    def __call__(self, request: requests.PreparedRequest) -> requests.PreparedRequest:
        request.headers["Authorization"] = f"Bearer {self._token.reveal()}"
        return request


class Stream:
    """Lines of an answer that goes on: of each the object, or None where it only keeps the connection alive.

    Iterating raises ``Cut`` where the connection is lost or silent, and ends where the server ends it. Who leaves
    off may go on with the next line.
    """

    def __init__(self, response: requests.Response) -> None:
        self._response = response
        self._closed = False
        self._lines = _lines_of(response)

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> Mapping[str, Any] | None:
        try:
            return next(self._lines)
        except ValueError as error:  # another thread is closing it
            raise Cut("closed") from error

    def close(self) -> None:
        """End it, from any thread: who reads from it sees its end, or a ``Cut``."""
        if not self._closed:
            self._closed = True
            connection = getattr(self._response.raw, "connection", None)
            if (sock := getattr(connection, "sock", None)) is not None:
                with suppress(OSError):  # it has ended by itself
                    sock.shutdown(socket.SHUT_RDWR)
            with suppress(ValueError):  # another thread is in the middle of a read: that ends now, and closes it
                self._lines.close()
                self._response.close()  # of a stream from which nothing was read yet


def _lines_of(response: requests.Response) -> Generator[Mapping[str, Any] | None, None, None]:
    """Of a stream; the response is closed at its end."""
    rest = b""
    try:
        for piece in response.iter_content(chunk_size=None):
            *lines, rest = (rest + piece).split(b"\n")
            if len(rest) > LONGEST_LINE:
                raise Cut(f"a line of more than {LONGEST_LINE} bytes")
            for line in lines:
                yield _object(line)
    except (requests.RequestException, OSError, ValueError, AttributeError) as error:
        # the last two: closed by another thread in the middle of a read
        raise Cut(type(error).__name__) from error
    finally:
        response.close()


def _object(line: bytes) -> Mapping[str, Any] | None:
    if not line.strip():
        return None
    try:
        said = json.loads(line)
    except (ValueError, RecursionError) as error:  # the latter: nested more deeply than Python reads
        raise Cut("a line that is no JSON") from error
    if not isinstance(said, dict):
        raise Cut("a line that is no object")
    return said


class _Streamed:
    """Of berserk, a ``FormatHandler``: an answer line by line, and one that can be closed."""

    headers: Final = {"Accept": "application/x-ndjson"}

    def handle(self, response: requests.Response, is_stream: bool, converter: Callable[[Any], Any]) -> Any:
        return Stream(response)


_JSON: Final = JsonHandler(mime_type="application/json")
_STREAMED: Final = _Streamed()


class LichessClient:
    """What can be asked of the server for one account.

    Every method raises ``Cut`` where the server cannot be reached, ``RequestRefused`` where it says no, and
    ``UserError`` where the token is not accepted. After an answer 429 all of them first wait a full minute.

    Args:
        server: its address.
        token: of the account.
        waiting: how time passes.
    """

    def __init__(self, server: str, token: Token, waiting: Waiting | None = None) -> None:
        self.server = server
        self.waiting = waiting or WallTime()
        self._token = token
        self._one_at_a_time = threading.Lock()
        self._requestor = self._new_requestor()
        self._free_at = 0.0
        self.closed = threading.Event()
        """Nobody waits for anything any more."""
        self.latency = 0.0
        """How long the last requests took [s]: their moving mean."""
        self.limited = 0
        """So many answers were 429."""
        self.slowed: Callable[[str], None] = lambda _: None
        """Told a sentence at each of them."""

    def _new_requestor(self) -> Requestor[Any]:
        session = requests.Session()
        session.auth = _Bearer(self._token)
        session.trust_env = urlsplit(self.server).hostname not in LOOPBACK  # no proxy on the way to this computer
        session.headers["Accept-Encoding"] = "identity"  # each line of a stream is there as soon as it was sent
        session.headers["User-Agent"] = f"touchmove, berserk {berserk.__version__}"
        return Requestor(session, self.server + "/", _JSON)

    # ---------------------------------------------------------------------------------------------------- the account

    def account(self) -> Account:
        """Whose token it is."""
        return account_of(self._ask("GET", "api/account"))

    def playing(self) -> frozenset[str]:
        """Ids of the games that the account plays now."""
        return games_of(self._ask("GET", "api/account/playing"))

    def upgrade(self) -> None:
        """Make the account a bot's, for ever."""
        self._ask("POST", "api/bot/account/upgrade")

    def events(self) -> Stream:
        """What reaches the account."""
        return self._stream("GET", "api/stream/event")

    # ----------------------------------------------------------------------------------------------- finding opponents

    def seek(self, terms: Mapping[str, str]) -> Stream:
        """Look for anybody; ends when somebody is found or it has expired, and closing it ends the search."""
        return self._stream("POST", "api/board/seek", terms)

    def seek_days(self, terms: Mapping[str, str]) -> None:
        """Look for anybody to play by correspondence; that goes on until somebody is found."""
        self._ask("POST", "api/board/seek", terms)

    def challenge(self, name: str, terms: Mapping[str, str]) -> str:
        """Challenge somebody; the id of the challenge, and of the game that it becomes. It is tried once."""
        return id_of(self._ask("POST", f"api/challenge/{name}", terms, tries=1))

    def accept(self, challenge: str) -> None:
        """Accept a challenge."""
        self._ask("POST", f"api/challenge/{challenge}/accept")

    def decline(self, challenge: str, reason: str) -> None:
        """Decline a challenge; the reason is a word of the specification."""
        self._ask("POST", f"api/challenge/{challenge}/decline", {"reason": reason})

    def cancel(self, challenge: str) -> None:
        """Take a challenge back."""
        self._ask("POST", f"api/challenge/{challenge}/cancel")

    # -------------------------------------------------------------------------------------------------------- one game

    def game(self, kind: str, game: str) -> Stream:
        """What happens in a game; ``kind``: board or bot."""
        return self._stream("GET", f"api/{kind}/game/stream/{game}")

    def act(self, kind: str, game: str, what: str) -> None:
        """Do something in a game, such as ``move/e2e4``, ``draw/yes``, ``takeback/no``, ``resign`` or ``abort``."""
        since = self.waiting.now()
        self._ask("POST", f"api/{kind}/game/{game}/{what}", tries=1)
        took = max(0.0, self.waiting.now() - since)
        self.latency = took if not self.latency else 0.8 * self.latency + 0.2 * took

    # ----------------------------------------------------------------------------------------------------------- parts

    def _ask(self, method: str, path: str, data: Mapping[str, str] | None = None, tries: int = TRIES) -> Any:
        for left in reversed(range(tries)):
            try:
                with self._one_at_a_time:
                    return self._request(self._requestor, _JSON, method, path, data, stream=False)
            except Cut:
                if not left or self.waiting.wait(AGAIN, self.closed):
                    raise
        raise AssertionError("the last try returns or raises")

    def _stream(self, method: str, path: str, data: Mapping[str, str] | None = None) -> Stream:
        stream = self._request(self._new_requestor(), _STREAMED, method, path, data, stream=True)
        assert isinstance(stream, Stream)
        return stream

    def _request(
        self, requestor: Requestor[Any], fmt: Any, method: str, path: str,
        data: Mapping[str, str] | None, *, stream: bool,
    ) -> Any:  # fmt: skip
        while True:
            if (left := self._free_at - self.waiting.now()) > 0.0 and self.waiting.wait(left, self.closed):
                raise Cut("closed")
            try:
                return requestor.request(
                    method, path, stream=stream, data=None if data is None else dict(data), fmt=fmt,
                    timeout=(CONNECTING, SILENCE), allow_redirects=False,
                )  # fmt: skip
            except ResponseError as error:
                if error.status_code == _TOO_MANY:
                    self._free_at = self.waiting.now() + RATE_LIMIT
                    self.limited += 1
                    self.slowed(f"{self.server} asks for fewer requests: nothing is asked for {RATE_LIMIT:.0f} s")
                    continue
                raise self._refusal(error) from None  # the error holds the request, and that the token
            except ApiError as error:
                raise Cut(type(error.error).__name__) from None
            except (ValueError, RecursionError) as error:  # no JSON, or nested more deeply than Python reads
                raise Cut(type(error).__name__) from None

    def _refusal(self, error: ResponseError) -> Exception:
        status = int(error.status_code)
        if status >= _SERVER_ERROR:
            return Cut(f"HTTP {status}")
        if status == requests.codes.unauthorized:
            return UserError(
                f"{self.server} does not accept the token: make a new one in your account's settings, under API access "
                "tokens"
            )
        cause = error.cause.get("error") if isinstance(error.cause, dict) else None
        said = "".join(char for char in str(cause or error.reason)[:200] if char.isprintable())
        return RequestRefused(status, said)
