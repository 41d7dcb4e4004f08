"""The page's own files, out of memory: packed once, known again by the browser, none of them looked up by a request."""

from __future__ import annotations

import asyncio
import gzip
import hashlib
import posixpath
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

STATIC: Final = Path(__file__).parents[1] / "static"
ENTRY: Final = "app.js"
KINDS: Final = {
    ".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8", ".svg": "image/svg+xml",
    ".html": "text/html; charset=utf-8", ".json": "application/json",
}  # fmt: skip
"""Media types by the ends of names."""
PLAIN: Final = "text/plain; charset=utf-8"
LEVEL: Final = 6
"""Of packing, as gzip counts it: three's 2.1 MB become 0.4 MB within 0.1 s."""
PRELOADS: Final = "<!-- modules that the page begins with -->"
"""Stands in the page for links that have the browser fetch them all at once."""
STYLES: Final = "page.css"
"""All that the page links to as style sheets, in that order, in one: each request costs a browser some milliseconds."""
_STYLE: Final = re.compile(r"""^ *<link rel="stylesheet" href="/static/([^"]+)">\n""", re.MULTILINE)
_IMPORT: Final = re.compile(r"""^(?:import|export)\b[^'"();]*?['"](\.[^'"]+)['"]""", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class StaticFile:
    """A file as it is sent."""

    content: bytes
    packed: bytes
    """By gzip."""
    kind: str
    """Its media type."""
    tag: str
    """Changes with its content."""

    @classmethod
    def of(cls, content: bytes, kind: str) -> Self:
        """Of what a file holds."""
        tag = hashlib.blake2b(content, digest_size=12).hexdigest()
        return cls(content, gzip.compress(content, LEVEL, mtime=0), kind, f'"{tag}"')

    def answer(self, headers: Headers) -> Response:
        """To a request with headers: nothing where the browser has it already, packed where it unpacks it."""
        told = {"ETag": self.tag, "Vary": "Accept-Encoding"}
        if self.tag in [one.strip().removeprefix("W/") for one in headers.get("if-none-match", "").split(",")]:
            return Response(status_code=304, headers=told)
        if "gzip" in headers.get("accept-encoding", ""):
            return Response(self.packed, media_type=self.kind, headers={**told, "Content-Encoding": "gzip"})
        return Response(self.content, media_type=self.kind, headers=told)


class StaticFiles:
    """All files of a folder, each read when it is first asked for."""

    def __init__(self, folder: Path = STATIC) -> None:
        self._folder = folder
        self._paths = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
        self._paths[STYLES] = self._paths["index.html"]  # it is made of what that says
        self._files: dict[str, StaticFile] = {}

    async def page(self, request: Request) -> Response:
        """The page, with links to all modules that it begins with."""
        return (await self._file("index.html")).answer(request.headers)

    async def file(self, request: Request) -> Response:
        """A file by its name below the folder."""
        name = request.path_params["name"]
        if name not in self._paths:
            raise HTTPException(404, "there is no such file of the page")
        return (await self._file(name)).answer(request.headers)

    async def _file(self, name: str) -> StaticFile:
        if (known := self._files.get(name)) is not None:
            return known
        path = self._paths[name]
        small = path.stat().st_size <= SMALL  # a thread takes longer to come to it than that does
        made = self._files[name] = self._made(name) if small else await asyncio.to_thread(self._made, name)
        return made

    def _made(self, name: str) -> StaticFile:
        content = self._paths[name].read_bytes()
        if name == "index.html":
            links = "\n  ".join(f'<link rel="modulepreload" href="/static/{one}">' for one in self.modules())
            page = _STYLE.sub("", content.decode()).replace(PRELOADS, f"{links}\n  {_STYLES_LINK}")
            content = page.encode()
        elif name == STYLES:
            content = b"\n".join(self._paths[one].read_bytes() for one in _STYLE.findall(content.decode()))
        return StaticFile.of(content, KINDS.get(Path(name).suffix, PLAIN))

    def modules(self) -> tuple[str, ...]:
        """Names of all modules that are loaded with the page: its entry, and what modules import as they are loaded."""
        found = [ENTRY]
        for name in found:  # and so on, of those that are found
            text = self._paths[name].read_text(encoding="utf-8")
            for other in _IMPORT.findall(text):
                named = posixpath.normpath(posixpath.join(posixpath.dirname(name), other))
                if named not in found:
                    found.append(named)
        return tuple(found)


_STYLES_LINK: Final = f'<link rel="stylesheet" href="/static/{STYLES}">'
SMALL: Final = 1 << 16
"""A file that is read and packed within a few milliseconds [bytes]."""
