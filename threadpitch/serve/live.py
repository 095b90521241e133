"""Events of the store as they are appended: server-sent events, which a browser goes on with after an outage."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator

import anyio
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request

from threadpitch.store import Event, Store

PAUSE = 0.5  # s between two looks into the store
_QUIET = 15.0  # s after which a comment keeps the connection open
_BACK = 2000  # events among which the beginning of the newest run is looked for


async def event_stream(store: Store, request: Request) -> AsyncIterator[str]:
    """From the beginning of the newest run on, or after what the browser has: text of server-sent events."""
    after = await run_in_threadpool(_beginning, store, request.headers.get("last-event-id", ""))
    quiet = 0.0
    yield "retry: 1000\n\n"
    while not await request.is_disconnected():
        found = await run_in_threadpool(store.events, after, 500)
        for event in found:
            yield event_text(event)
            after = event.sequence
        quiet = 0.0 if found else quiet + PAUSE
        if quiet >= _QUIET:
            quiet = 0.0
            yield ": nothing new\n\n"
        if len(found) < 500:
            await anyio.sleep(PAUSE)


def event_text(event: Event) -> str:
    """One event; its JSON has no line breaks, so that nothing in it can begin another field."""
    document = {"run": event.run, "at": event.at.isoformat(), **event.document}
    return f"id: {event.sequence}\nevent: {event.kind if event.kind.isalnum() else 'other'}\n" \
           f"data: {json.dumps(document)}\n\n"


def _beginning(store: Store, last_event_id: str) -> int:
    """The sequence after which is sent."""
    if last_event_id.isdecimal() and len(last_event_id) < 16:
        return int(last_event_id)
    last = store.last_sequence()
    recent = store.events(max(last - _BACK, 0), _BACK)
    return next((event.sequence - 1 for event in reversed(recent) if event.kind == "begin"), last)
