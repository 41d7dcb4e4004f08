"""Who may come in, and what a browser is told to refuse: Host, Origin, sign-in, and the headers of every answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.page.web.sign_in import SignIn

POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; media-src 'self' blob:; "
    "font-src 'self'; connect-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'self'; "
    "frame-ancestors 'none'"
)
"""The Content-Security-Policy: nothing from elsewhere, no inline script or style; chessground's pieces are data."""
SEALED: Final = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox"
"""Of a page that stands for itself, such as a report: it may show itself and do nothing."""
HEADERS: Final = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",  # by no-referrer a browser says no Origin where its own form is sent
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
    "Cache-Control": "no-cache",
}
OWN_PORTS: Final = {"http": 80, "https": 443}
"""Of the schemes that an address may have."""
OPEN_PATHS: Final = frozenset({"/login", "/static/login.css"})
"""What is shown to who has not signed in."""


@dataclass(frozen=True, slots=True)
class Names:
    """What the page is called, as browsers say it in Host and Origin."""

    hosts: frozenset[str]
    """With port, where it is not the scheme's own."""
    origins: frozenset[str]
    """Scheme and host."""

    @classmethod
    def of(cls, host: str, port: int, address: str | None = None) -> Names:
        """Of a page that listens at an IPv4 address and port, maybe behind a proxy with an address of its own."""
        hosts = {f"{name}:{port}" for name in {host, "127.0.0.1", "localhost"}}
        if port == 80:
            hosts |= {name.removesuffix(":80") for name in hosts}
        origins = {f"http://{name}" for name in hosts}
        if address is not None:
            parts = urlsplit(address)
            name = parts.netloc.lower().removesuffix(f":{OWN_PORTS[parts.scheme]}")  # which browsers leave out
            hosts.add(name)
            origins.add(f"{parts.scheme}://{name}")
        return cls(frozenset(hosts), frozenset(origins))


class Gatekeeper:
    """Middleware before everything else: what is foreign is refused, and every answer carries the headers.

    Args:
        app: what is guarded.
        names: of the page.
        sign_in: who knows the password; None: there is none.
    """

    def __init__(self, app: ASGIApp, names: Names, sign_in: SignIn | None) -> None:
        self._app, self._names, self._sign_in = app, names, sign_in

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """See ASGI."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] in ("http.response.start", "websocket.http.response.start"):
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        headers = Headers(scope=scope)
        refusal = self._foreign(scope, headers)
        if refusal is None and not self._known(scope, headers):
            if scope["type"] == "http" and scope["method"] == "GET" and "text/html" in headers.get("accept", ""):
                await RedirectResponse("/login", 303)(scope, receive, send_guarded)
                return
            refusal = PlainTextResponse("sign in at /login first\n", 401)
        if refusal is None:
            await self._app(scope, receive, send_guarded)
        else:
            await refusal(scope, receive, send_guarded)

    def _foreign(self, scope: Scope, headers: Headers) -> PlainTextResponse | None:
        hosts, origins = headers.getlist("host"), headers.getlist("origin")
        if len(hosts) != 1 or hosts[0].lower() not in self._names.hosts:
            return PlainTextResponse(
                "this page does not have that address: use the one that the program printed\n", 421
            )
        if len(origins) > 1 or (origins and origins[0].lower() not in self._names.origins):
            return PlainTextResponse("another page may not use this one\n", 403)
        navigates = headers.get("sec-fetch-mode") == "navigate" and headers.get("sec-fetch-dest") == "document"
        if headers.get("sec-fetch-site") in ("cross-site", "same-site") and not (
            navigates and scope["type"] == "http" and scope["method"] == "GET"
        ):
            return PlainTextResponse("another page may not use this one\n", 403)
        return None

    def _known(self, scope: Scope, headers: Headers) -> bool:
        return self._sign_in is None or scope["path"] in OPEN_PATHS or self._sign_in.knows(headers.get("cookie", ""))
