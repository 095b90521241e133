"""The server: its routes, and the socket on the loopback address."""

from __future__ import annotations

import secrets
import socket
from collections.abc import Callable

import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.routing import Route

from threadpitch.serve.errors import ServeError
from threadpitch.serve.guard import Access, Guard
from threadpitch.serve.pages import KNOWN_ERRORS, Pages
from threadpitch.store import Store

LOOPBACK = "127.0.0.1"
_ENDING = 1  # s that open connections get when the server ends


def application(store: Store, access: Access) -> Starlette:
    """All pages about a store."""
    pages = Pages(store, access)
    routes = [
        Route("/", pages.runs), Route("/run/{number:int}", pages.run), Route("/compare", pages.compare),
        Route("/control", pages.control), Route("/live", pages.live), Route("/live/events", pages.events),
        Route("/run/{number:int}/note", pages.note, methods=["POST"]),
        Route("/run/{number:int}/delete", pages.delete, methods=["POST"]),
        Route("/static/{name}", pages.script),
    ]
    refusals = dict.fromkeys((HTTPException, *KNOWN_ERRORS), pages.refused)
    return Starlette(routes=routes, exception_handlers=refusals,
                     middleware=[Middleware(Guard, access=access)])


def serve(store: Store, port: int, told: Callable[[str], None]) -> None:
    """Serve until Ctrl-C; ``told`` hears the address with the token as soon as it can be opened.

    Raises:
        ServeError: the port is taken.
    """
    with _bound(port) as listener:
        found = int(listener.getsockname()[1])
        access = Access(secrets.token_urlsafe(24), found)
        config = uvicorn.Config(application(store, access), log_level="warning", access_log=False, lifespan="off",
                                server_header=False, timeout_graceful_shutdown=_ENDING)
        told(f"http://{LOOPBACK}:{found}/?token={access.token}")
        uvicorn.Server(config).run(sockets=[listener])


def _bound(port: int) -> socket.socket:
    """A socket on the loopback address, which no other computer reaches."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((LOOPBACK, port))
        listener.listen()
    except (OSError, OverflowError) as error:
        listener.close()
        reason = error.strerror if isinstance(error, OSError) else "there is no such port"
        raise ServeError(f"port {port} cannot be served ({str(reason).lower()}); choose another with --port, or 0 for "
                         "any") from None
    return listener
