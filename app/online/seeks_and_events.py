"""Streams that are kept open by a thread each: what reaches the account, and a seek."""

from __future__ import annotations

import queue
import threading

from app import UserError
from app.online.client import BACK_OFF, Cut, LichessClient, RequestRefused, Stream
from app.online.messages import EventLine, event_line
from app.online.terms import Terms


class EventFeed:
    """The account's event stream, read by a thread of its own and taken up again where it is cut."""

    def __init__(self, client: LichessClient) -> None:
        self._client = client
        self._lines: queue.Queue[EventLine | UserError] = queue.Queue()
        self._closed = threading.Event()
        self._stream: Stream | None = None
        self.open = threading.Event()
        """It has been opened once."""
        self._thread = threading.Thread(target=self._read, name="lichess events", daemon=True)
        self._thread.start()

    def next(self, timeout: float) -> EventLine | None:
        """The next one; None: there was none.

        Raises:
            UserError: no more will come.
        """
        try:
            line = self._lines.get(timeout=timeout)
        except queue.Empty:
            return None
        if isinstance(line, UserError):
            raise line
        return line

    def close(self) -> None:
        """End the thread."""
        self._closed.set()
        if self._stream is not None:
            self._stream.close()
        self._thread.join(timeout=2.0)

    def _read(self) -> None:
        tries = 0
        while not self._closed.is_set():
            try:
                self._stream = self._client.events()
                self.open.set()
                for said in self._stream:
                    tries = 0
                    if said is not None and (line := event_line(said)) is not None:
                        self._lines.put(line)
            except Cut:
                pass  # taken up again below
            except RequestRefused as refusal:
                self._lines.put(UserError(f"{self._client.server} does not show what reaches this account: {refusal}"))
                return
            except UserError as error:
                self._lines.put(error)
                return
            if self._client.waiting.wait(BACK_OFF[min(tries, len(BACK_OFF) - 1)], self._closed):
                return
            tries += 1


class Seek:
    """A seek, kept alive by a thread of its own and made anew where it expires; ``known``: games found before it."""

    def __init__(self, client: LichessClient, terms: Terms, known: frozenset[str]) -> None:
        self._client, self._terms, self._known = client, terms, known
        self._closed = threading.Event()
        self._error: UserError | None = None
        self._stream: Stream | None = None
        self._thread = threading.Thread(target=self._run, name="lichess seek", daemon=True)
        self._thread.start()

    def trouble(self) -> None:
        """Raises what the server has against it."""
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """End it, and the thread."""
        self._closed.set()
        if self._stream is not None:
            self._stream.close()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        tries = 0
        while not self._closed.is_set():
            try:
                if self._client.playing() - self._known:
                    return  # it has found somebody
                self._stream = self._client.seek(self._terms.for_seek())
                for _ in self._stream:
                    tries = 0
            except Cut:
                pass  # made anew below
            except RequestRefused as refusal:
                self._error = UserError(f"{self._client.server} refuses the seek: {refusal}")
                return
            except UserError as error:
                self._error = error
                return
            if self._client.waiting.wait(BACK_OFF[min(tries + 2, len(BACK_OFF) - 1)], self._closed):
                return
            tries += 1
