"""The routes of the page."""

from __future__ import annotations

import asyncio
import gzip
import html
import math
from collections.abc import Awaitable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, cast
from urllib.parse import parse_qs

from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, RedirectResponse, Response, StreamingResponse
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from app import UserError
from app.page.live.hub import encoded
from app.page.live.people import People
from app.page.live.state import VIEWS, PageState
from app.page.recorded.catalogue import Catalogue, RecordPlace, telemetry_file
from app.page.recorded.shower import JSON, Made, RecordShower, TooMuchWanted
from app.page.web.live_socket import Allowance, serve_watcher
from app.page.web.pictures import STREAM_TYPE, Pictures
from app.page.web.security import SEALED, Gatekeeper, Names
from app.page.web.sign_in import AGAIN, TRIES, SignIn
from app.page.web.static_files import STATIC, StaticFiles
from app.records.files import FILM_FILE
from app.records.game import FRAMES, PGN_FILE
from app.terminal.shown import View
from hardware.parameters import load_parameters

LARGEST_FORM: Final = 2048
"""Of what is sent to sign in [bytes]."""
FOREVER: Final = 1e9
"""No game is longer [s, plant]."""


@dataclass(slots=True)
class Site:
    """What the routes show."""

    people: People
    state: PageState
    pictures: Pictures
    catalogue: Catalogue
    shower: RecordShower
    sign_in: SignIn | None
    """None: there is no password."""


def site_app(site: Site, names: Names) -> ASGIApp:
    """The page as an ASGI application."""
    return Gatekeeper(_Routes(site).app(), names, site.sign_in)


class _Routes:
    def __init__(self, site: Site) -> None:
        self._site = site
        self._tries = Allowance(1.0 / AGAIN, TRIES)
        self._one_try = asyncio.Lock()
        self._static = StaticFiles()

    def app(self) -> Starlette:
        return Starlette(
            routes=[
                Route("/", self._static.page),
                Route("/login", self._form, methods=["GET"]),
                Route("/login", self._sign_in, methods=["POST"]),
                Route("/static/{name:path}", self._static.file),
                Route("/picture/{view}.jpg", self._picture),
                Route("/stream/{view}", self._stream),
                Route("/robot.json", self._robot),
                Route("/games", self._games),
                Route("/games/{id}/record.json", self._record),
                Route("/games/{id}/robot.json", self._robot_of_record),
                Route("/games/{id}/telemetry.json", self._telemetry),
                Route("/games/{id}/report.html", self._report),
                Route("/games/{id}/film", self._film),
                Route("/games/{id}/game.pgn", self._pgn),
                Route("/games/{id}/telemetry.mcap", self._mcap),
                Route("/games/{id}/frames/{name}", self._frame),
                WebSocketRoute("/live", self._live),
            ],
        )

    async def _live(self, socket: WebSocket) -> None:
        await serve_watcher(socket, self._site.people)

    # ---- pictures

    async def _picture(self, request: Request) -> Response:
        picture = self._site.pictures.newest(_view(request))
        if picture is None:
            raise HTTPException(404, "there is no picture of that yet")
        return Response(picture.jpeg, media_type="image/jpeg", headers={"Cache-Control": "no-store"})

    async def _stream(self, request: Request) -> Response:
        view = _view(request)
        if self._site.pictures.full:
            raise HTTPException(503, "too many streams are open already: close one of them")
        parts = self._site.pictures.stream(view)
        return StreamingResponse(parts, media_type=STREAM_TYPE, headers={"Cache-Control": "no-store"})

    # ---- records

    async def _games(self, request: Request) -> Response:
        games = await asyncio.to_thread(self._site.catalogue.games)
        return _answer(request, Made.of(encoded(games).encode(), JSON))

    async def _robot(self, request: Request) -> Response:
        state = self._site.state
        tick = load_parameters().drive.tick if state.session is None else state.session.tick
        return await _made(request, self._site.shower.robot(state.folder, tick))

    async def _robot_of_record(self, request: Request) -> Response:
        place = await self._place(request)
        return await _made(request, self._site.shower.robot(place.folder, load_parameters().drive.tick))

    async def _record(self, request: Request) -> Response:
        return await _made(request, self._site.shower.record(await self._place(request)))

    async def _telemetry(self, request: Request) -> Response:
        place = await self._place(request)
        since, until = _seconds(request, "from", 0.0), _seconds(request, "to", FOREVER)
        return await _made(request, self._site.shower.telemetry(place, since, until))

    async def _report(self, request: Request) -> Response:
        answer = await _made(request, self._site.shower.report(await self._place(request)))
        answer.headers["Content-Security-Policy"] = SEALED
        return answer

    async def _film(self, request: Request) -> Response:
        return _file((await self._place(request)).folder, FILM_FILE, "video/webm")

    async def _pgn(self, request: Request) -> Response:
        return _download((await self._place(request)).folder, PGN_FILE, "application/x-chess-pgn")

    async def _mcap(self, request: Request) -> Response:
        file = telemetry_file((await self._place(request)).folder)
        return _download(file.parent, file.name, "application/octet-stream")

    async def _frame(self, request: Request) -> Response:
        folder = (await self._place(request)).folder
        name = request.path_params["name"]
        if name not in await asyncio.to_thread(_pictures, folder / FRAMES):
            raise HTTPException(404, "there is no such picture")
        return _file(folder, f"{FRAMES}/{name}", "image/jpeg")

    async def _place(self, request: Request) -> RecordPlace:
        place = await asyncio.to_thread(self._site.catalogue.find, request.path_params["id"])
        if place is None:
            raise HTTPException(404, "there is no such recorded game: GET /games lists them")
        return place

    # ---- who may come in

    async def _form(self, _: Request) -> Response:
        return HTMLResponse(_form(""))

    async def _sign_in(self, request: Request) -> Response:
        sign_in = self._site.sign_in
        if sign_in is None:
            return RedirectResponse("/", 303)
        form = b""
        async for part in request.stream():
            form += part
            if len(form) > LARGEST_FORM:
                raise HTTPException(413, "that is not a form of this page")
        if not self._tries.take():
            wait = math.ceil(self._tries.wait)
            sentence = f"Too many wrong passwords: try again in {wait} s."
            return HTMLResponse(_form(sentence), 429, headers={"Retry-After": str(wait)})
        given = parse_qs(form.decode("latin-1"), encoding="utf-8", errors="replace").get("password", [""])[0]
        async with self._one_try:  # each takes memory and a processor for a moment
            right = await asyncio.to_thread(sign_in.accepts, given)
        if not right:
            return HTMLResponse(_form("That is not the password."), 403)
        self._tries.give_back()
        return RedirectResponse("/", 303, headers={"Set-Cookie": sign_in.cookie()})


def _view(request: Request) -> View:
    view = request.path_params["view"]
    if view not in VIEWS:
        raise HTTPException(404, f"there is no view of that name: {' and '.join(VIEWS)} are")
    return cast("View", view)


def _pictures(folder: Path) -> set[str]:
    return {one.name for one in folder.glob("*.jpg")}


def _file(folder: Path, name: str, kind: str) -> Response:
    """A file of a record with its parts (``Range``), or 404; a link that leads out of the record is none."""
    path = folder / name
    if not path.is_file() or not path.resolve().is_relative_to(folder.resolve()):
        raise HTTPException(404, "this game has none")
    return FileSoFar(path, media_type=kind)


class FileSoFar(FileResponse):
    """A file as long as it was when it was asked for: what a game still writes, such as its telemetry, grows."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """See ASGI."""
        left: int | None = None

        async def send_so_far(message: Message) -> None:
            nonlocal left
            if message["type"] == "http.response.start":
                left = int(Headers(raw=message["headers"])["content-length"])
            elif message["type"] == "http.response.body" and left is not None:
                body = message.get("body", b"")[:left]
                left -= len(body)
                message = {**message, "body": body, "more_body": bool(left) and message.get("more_body", False)}
                if not message["more_body"]:
                    left = None
            else:
                return  # more than was promised
            await send(message)

        await super().__call__(scope, receive, send_so_far)


async def _made(request: Request, making: Awaitable[Made]) -> Response:
    try:
        return _answer(request, await making)
    except TooMuchWanted as error:
        raise HTTPException(503, str(error)) from error
    except UserError as error:
        raise HTTPException(409, str(error)) from error


def _seconds(request: Request, name: str, otherwise: float) -> float:
    """A plant time of the address's question [s]."""
    try:
        value = float(request.query_params.get(name, otherwise))
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= FOREVER:
        raise HTTPException(400, f"'{name}' is not a plant time in seconds, such as 12.5")
    return value


def _download(folder: Path, name: str, kind: str) -> Response:
    """A file that is kept under its own name and that of its game, or 404."""
    answer = _file(folder, name, kind)
    answer.headers["Content-Disposition"] = f'attachment; filename="{_plain(folder.name)}-{name}"'
    return answer


def _plain(name: str) -> str:
    """A folder's name as a part of a file's: what could mean something in a header is left out."""
    return "".join(letter if letter.isascii() and (letter.isalnum() or letter in "-_.") else "_" for letter in name)


def _answer(request: Request, made: Made) -> Response:
    """What was made, packed where the browser unpacks it; nothing where it has that already."""
    headers = {"ETag": made.tag, "Vary": "Accept-Encoding"}
    if request.headers.get("if-none-match") == made.tag:
        return Response(status_code=304, headers=headers)
    if "gzip" in request.headers.get("accept-encoding", ""):
        return Response(made.packed, media_type=made.kind, headers={**headers, "Content-Encoding": "gzip"})
    return Response(gzip.decompress(made.packed), media_type=made.kind, headers=headers)


def _form(sentence: str) -> str:
    page = (STATIC / "login.html").read_text(encoding="utf-8")
    return page.replace("<!-- what is wrong -->", html.escape(sentence))
