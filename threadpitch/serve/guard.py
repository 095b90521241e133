"""Who may ask the server, and for what: this computer's browser, its own pages, and changes with the token only.

A page of another site can make a browser ask 127.0.0.1: its ``Origin`` gives it away. A name of another site can be
made to mean 127.0.0.1 (DNS rebinding): the ``Host`` gives it away.
"""

from __future__ import annotations

import hmac
from collections.abc import Mapping
from dataclasses import dataclass

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

COOKIE = "threadpitch"
READING = ("GET", "HEAD")
_NAMES = ("127.0.0.1", "localhost", "[::1]")
_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'unsafe-inline'; img-src data: blob:; "
                               "connect-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff", "Referrer-Policy": "same-origin", "X-Frame-Options": "DENY",
    "Cross-Origin-Resource-Policy": "same-origin", "Cross-Origin-Opener-Policy": "same-origin",
}


@dataclass(frozen=True)
class Access:
    """What a request must bring."""

    token: str
    port: int

    @property
    def hosts(self) -> frozenset[str]:
        """The names under which this server is asked."""
        return frozenset(f"{name}:{self.port}" for name in _NAMES) | (frozenset(_NAMES) if self.port == 80 else set())

    def refusal(self, request: Request) -> str:
        """Why the request is refused; empty where it is not."""
        if request.headers.get("host", "").lower() not in self.hosts:
            return "this server answers to localhost and 127.0.0.1 only"
        origin = request.headers.get("origin")
        if origin is not None and origin.lower() not in {f"http://{host}" for host in self.hosts}:
            return "the request comes from a page of another site"
        if request.method not in READING and not self.trusted(request.headers, request.cookies):
            return "changes need the token: open the address that threadpitch serve printed"
        return ""

    def trusted(self, headers: Mapping[str, str], cookies: Mapping[str, str]) -> bool:
        """Whether the request brings the token, as a cookie or as ``Authorization: Bearer``."""
        given = (cookies.get(COOKIE, ""), headers.get("authorization", "").removeprefix("Bearer "))
        return any(self.is_token(one) for one in given)

    def is_token(self, text: str) -> bool:
        """Compared in a time that does not tell how much of it is right."""
        return hmac.compare_digest(text.encode(), self.token.encode())


class Guard:
    """Refuses what ``Access`` does not allow before anything else sees it, and adds a careful server's headers."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app, self._access = app, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope)
        refusal = self._access.refusal(request)
        response: ASGIApp = PlainTextResponse(f"refused: {refusal}\n", status_code=403) if refusal else self._app

        async def careful(message: dict[str, object]) -> None:
            if message["type"] == "http.response.start":
                headers = list(message["headers"])  # type: ignore[call-overload] # ASGI: pairs of bytes
                headers += [(name.lower().encode(), value.encode()) for name, value in _HEADERS.items()]
                message = {**message, "headers": headers}
            await send(message)

        await response(scope, receive, careful)  # type: ignore[arg-type] # ASGI's messages are mappings


def with_token(response: Response, access: Access) -> Response:
    """The response, which leaves the token in the browser: for this site's requests only, and no script reads it."""
    response.set_cookie(COOKIE, access.token, httponly=True, samesite="strict", path="/")
    return response
