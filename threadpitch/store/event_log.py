"""Events in one order: what the live page shows, and what receivers outside are sent (their outbox).

Sequences count up by one without gaps, because only one transaction writes at a time; a receiver that has taken a
sequence has taken all before it.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from sqlalchemy import Connection, delete, func, insert, select, update

from threadpitch.store import schema
from threadpitch.store.records import Event, NewEvent
from threadpitch.store.texts import instant, json_text, storable, utc_text

KEPT = timedelta(days=30)  # that events stay after every receiver has taken them


def append(connection: Connection, events: Sequence[NewEvent]) -> int:
    """Add events at the end; those whose uid is there already are left out. The sequence of the last event."""
    last = last_sequence(connection)
    there = set(connection.execute(select(schema.events.c.uid).where(
        schema.events.c.uid.in_([one.uid for one in events]))).scalars())
    now = utc_text(datetime.now(UTC))
    new = [one for one in events if one.uid not in there]
    if new:
        connection.execute(insert(schema.events), [
            {"sequence": last + place, "uid": one.uid, "run": one.run, "kind": storable(one.kind), "at": now,
             "document": json_text(one.document)} for place, one in enumerate(new, start=1)])
    return last + len(new)


def last_sequence(connection: Connection) -> int:
    """The sequence of the newest event; 0 where there is none."""
    return connection.execute(select(func.max(schema.events.c.sequence))).scalar_one() or 0


def events(connection: Connection, after: int, limit: int, run: str | None) -> list[Event]:
    """The events behind a sequence, in their order."""
    asked = select(schema.events).where(schema.events.c.sequence > after)
    if run is not None:
        asked = asked.where(schema.events.c.run == run)
    found = connection.execute(asked.order_by(schema.events.c.sequence).limit(limit)).mappings()
    return [Event(row["sequence"], row["uid"], row["run"], row["kind"], instant(row["at"]),
                  json.loads(row["document"])) for row in found]


def register(connection: Connection, receiver: str, after: int | None) -> int:
    """The last sequence that a receiver has taken. A new one begins ``after`` this sequence; None = with the next."""
    taken = taken_by(connection, receiver)
    if taken is None:
        taken = last_sequence(connection) if after is None else after
        connection.execute(insert(schema.receivers), {"name": storable(receiver), "sequence": taken})
    return taken


def acknowledge(connection: Connection, receiver: str, sequence: int) -> None:
    """A receiver has taken all events up to this sequence."""
    columns = schema.receivers.c
    connection.execute(update(schema.receivers).where(columns.name == storable(receiver), columns.sequence < sequence)
                       .values(sequence=sequence))


def rewind(connection: Connection, receiver: str, sequence: int) -> None:
    """A receiver asks for all events behind this sequence once more."""
    connection.execute(update(schema.receivers).where(schema.receivers.c.name == storable(receiver))
                       .values(sequence=sequence))


def forget(connection: Connection, before: datetime) -> int:
    """Remove events older than this that every receiver has taken; how many. The newest stays, for its sequence."""
    columns = schema.events.c
    slowest = connection.execute(select(func.min(schema.receivers.c.sequence))).scalar_one()
    last = last_sequence(connection)
    bound = last - 1 if slowest is None else min(slowest, last - 1)
    gone = connection.execute(delete(schema.events).where(columns.sequence <= bound, columns.at < utc_text(before)))
    return gone.rowcount


def taken_by(connection: Connection, receiver: str) -> int | None:
    """The last sequence that a receiver has taken; None where it is not registered."""
    return connection.execute(select(schema.receivers.c.sequence).where(
        schema.receivers.c.name == storable(receiver))).scalar_one_or_none()
