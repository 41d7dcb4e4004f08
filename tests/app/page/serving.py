"""A page that is really served on loopback, in a thread of the test's own; and browsers of one sort and another."""

from __future__ import annotations

import asyncio
import http.client
import json
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Self
from urllib.parse import urlsplit

from websockets.sync.client import ClientConnection, connect

from app.page.entrance import open_entrance
from app.page.news import AnyNews, AnySaid
from app.page.page_server import PageServer
from app.settings.defaults import PageSection
from tests.waiting import PATIENCE, until

TOKEN = "0123456789abcdef"


class ServedPage:
    """A page with the game's end in the test's hands."""

    def __init__(self, records: Path, settings: PageSection) -> None:
        self.said: list[AnySaid] = []
        self._records, self._settings = records, settings
        self._ready = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        assert self._ready.wait(PATIENCE)
        return self

    def __exit__(self, *_: object) -> None:
        self.do(self.page.stop)
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive(), "the page ends"

    async def _serve(self) -> None:
        entrance = open_entrance(self._settings)
        self.address = entrance.address
        self.port = entrance.socket.getsockname()[1]
        self._loop = asyncio.get_running_loop()
        self.page = PageServer(entrance, self._records, self.said.append)
        await self.page.serve(self._ready.set)

    def do(self, what: Callable[[], Any]) -> Any:
        """Do something in the page's own thread."""

        async def done() -> Any:
            return what()

        return asyncio.run_coroutine_threadsafe(done(), self._loop).result(PATIENCE)

    def take(self, news: AnyNews, jpeg: bytes = b"") -> None:
        """News of the game."""
        self.do(lambda: self.page.take(news, jpeg))

    # ---- browsers

    def get(
        self, path: str, headers: dict[str, str] | None = None, *, method: str = "GET", body: str | bytes | None = None
    ) -> http.client.HTTPResponse:
        """An answer, whole; its content is in ``content``."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        connection.request(method, path, body, headers or {})
        answer = connection.getresponse()
        answer.content = answer.read()  # type: ignore[attr-defined]
        connection.close()
        return answer

    def json(self, path: str) -> Any:
        """A JSON answer."""
        answer = self.get(path)
        assert answer.status == 200, answer.content  # type: ignore[attr-defined]
        return json.loads(answer.content)  # type: ignore[attr-defined]

    def raw(self, request: bytes, *, most: int = 1 << 20) -> bytes:
        """What a socket answers to some bytes until it is closed."""
        with socket.create_connection(("127.0.0.1", self.port), PATIENCE) as end:
            try:
                end.sendall(request)
                end.shutdown(socket.SHUT_WR)
                answer = b""
                while len(answer) < most and (part := end.recv(65536)):
                    answer += part
            except (ConnectionResetError, BrokenPipeError):
                return b""
        return answer

    def browser(
        self, token: str = TOKEN, *, held: str | None = None, again: int | None = None, cookie: str | None = None
    ) -> Browser:
        """A browser's WebSocket that has said hello."""
        return Browser(self.port, token, held, cookie, again)


class Browser:
    """A browser that keeps the state as it is told it."""

    def __init__(
        self, port: int, token: str, held: str | None = None, cookie: str | None = None, again: int | None = None
    ) -> None:
        self._open = ExitStack()
        self.socket: ClientConnection = self._open.enter_context(
            connect(
                f"ws://127.0.0.1:{port}/live", origin=f"http://127.0.0.1:{port}",  # type: ignore[arg-type]
                additional_headers={} if cookie is None else {"Cookie": cookie}, max_size=None, compression=None,
            )
        )  # fmt: skip
        self.state: dict[str, Any] = {}
        self.telemetry: list[dict[str, Any]] = []
        self.refusals: list[str] = []
        self.send({"type": "hello", "token": token, "held": held, "again": again})
        self.until(lambda: bool(self.state))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave; a second call does nothing."""
        self._open.close()

    def send(self, frame: dict[str, Any] | str) -> None:
        """Send a frame."""
        self.socket.send(frame if isinstance(frame, str) else json.dumps(frame))

    def read(self, timeout: float) -> bool:
        """Take the next frame in; false: there was none."""
        try:
            frame = json.loads(self.socket.recv(timeout))
        except TimeoutError:
            return False
        match frame["type"]:
            case "state":
                self.state.update(frame["changes"])
            case "telemetry":
                self.telemetry.append(frame)
            case "refused":
                self.refusals.append(frame["text"])
            case other:
                raise AssertionError(f"what is '{other}'?")
        return True

    def until(self, condition: Callable[[], Any]) -> Any:
        """Read until something is so."""

        def met() -> Any:
            return condition() or (self.read(0.05) and None)

        return until(met, "what the browser waits for")

    @property
    def controls(self) -> dict[str, Any]:
        """The section."""
        found: dict[str, Any] = self.state["controls"]
        return found

    @property
    def holds(self) -> bool:
        """Whether it holds the controls."""
        return bool(self.controls["you"] == self.controls["holder"])


@contextmanager
def served(records: Path, **settings: Any) -> Iterator[ServedPage]:
    """A page over the records of a folder."""
    with ServedPage(records, PageSection(port=0, **settings)) as page:
        yield page


FORBEARING = (
    "-c", "from controller.wire import listener; listener.SILENCE = 60.0; "
    "from app.page.process import main; raise SystemExit(main())",
)  # fmt: skip
"""The page's process, to which a controller in the process of a test that is held up has not fallen silent."""


class PageProcess:
    """The page's process as a game starts it, with the game's end of the socket in the test's hands."""

    def __init__(self, records: Path, *, forbearing: bool = False, **settings: Any) -> None:
        self.game, theirs = socket.socketpair()
        with theirs:
            self.process = subprocess.Popen(
                [
                    sys.executable, "-P", *(FORBEARING if forbearing else ("-m", "app.page.process")),
                    "--fd", str(theirs.fileno()),
                ],
                pass_fds=[theirs.fileno()], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                text=True, start_new_session=True,
            )  # fmt: skip
        assert self.process.stdin is not None
        wishes = {"records": str(records), "settings": PageSection(**{"port": 0, **settings}).model_dump(mode="json")}
        self.process.stdin.write(json.dumps(wishes) + "\n")
        self.process.stdin.flush()
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().strip()
        self.port = int(urlsplit(self.address).port or 0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.game.close()
        try:
            self.said = self.process.communicate(timeout=PATIENCE)[1]
        finally:
            self.process.kill()

    def tell(self, news: AnyNews, jpeg: bytes = b"") -> None:
        """News of the game."""
        self.game.sendall(news.model_dump_json().encode() + b"\n" + jpeg)

    @property
    def memory(self) -> float:
        """Resident [MiB]."""
        status = Path(f"/proc/{self.process.pid}/status").read_text(encoding="ascii")
        return int(status.split("VmRSS:")[1].split()[0]) / 1024.0

    @property
    def files(self) -> int:
        """How many files and sockets are open."""
        return len([*Path(f"/proc/{self.process.pid}/fd").iterdir()])

    @property
    def seconds(self) -> float:
        """Processor time used so far [s]."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
