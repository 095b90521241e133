"""``Store``: runs, events and traces behind one door."""

from __future__ import annotations

import contextlib
import functools
import json
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType

from sqlalchemy import Connection, delete, func, select, update

from threadpitch.store import event_log, reading, schema, writing
from threadpitch.store.address import read_address
from threadpitch.store.database import Database
from threadpitch.store.errors import StoreError
from threadpitch.store.export import export
from threadpitch.store.records import Event, Finding, NewEvent, NewRun, RunFilter, RunSummary, StoredRun
from threadpitch.store.texts import storable
from threadpitch.store.trace_folder import TraceFolder
from threadpitch.store.verifying import remove_leftovers, verify


class Store:
    """Runs that are kept. Several threads and processes may use one store at once.

    Every method raises ``StoreError`` where the database cannot be reached, read or written.
    """

    def __init__(self, address: str | None = None) -> None:
        found = read_address(address)
        self.address = str(found)  # for people; without a password
        self.traces = TraceFolder(found.traces)
        self._database = Database(found)

    def __enter__(self) -> Store:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._database.close()

    def add(self, run: NewRun) -> int:
        """Keep a run: its number. When this returns, all of it is on the disk; before, nothing of it is to be seen.

        Raises:
            StoreError: the run cannot be stored.
        """
        writing.check(run)
        with contextlib.ExitStack() as stack:
            trace = None if run.trace is None else stack.enter_context(self.traces.copied(run.trace))

            def added(connection: Connection) -> int:
                if trace is not None:
                    self.traces.name(trace)  # before its row, so that no row is without its trace
                return writing.add_run(connection, run, trace)

            return self._database.write(added)

    def runs(self, wanted: RunFilter | None = None) -> list[RunSummary]:
        """The runs, newest first."""
        return self._database.read(lambda connection: reading.find_runs(connection, wanted or RunFilter()))

    def count(self, wanted: RunFilter | None = None) -> int:
        """How many runs there are of this kind, whatever the limit of the filter."""
        return self._database.read(lambda connection: reading.count_runs(connection, wanted or RunFilter()))

    def choices(self) -> dict[str, list[str]]:
        """The machines, programs, threads and causes that there are."""
        return self._database.read(reading.choices)

    def run(self, number: int) -> StoredRun:
        """A run with its pitches.

        Raises:
            StoreError: there is none of this number.
        """
        def found(connection: Connection) -> StoredRun:
            summary, row = reading.find_run(connection, number)
            trace = None if summary.trace_sha256 is None else self.traces.file(summary.trace_sha256)
            verdict = None if row["verdict"] is None else json.loads(row["verdict"])
            return StoredRun(summary, reading.passes_of(connection, number), verdict, json.loads(row["provenance"]),
                             trace)

        return self._database.read(found)

    def find(self, uid: str) -> RunSummary | None:
        """The run of this uid; None where there is none."""
        return self._database.read(lambda connection: reading.run_of_uid(connection, uid))

    def set_note(self, number: int, text: str) -> None:
        """Change the operator's note of a run.

        Raises:
            StoreError: there is none of this number.
        """
        change = update(schema.runs).where(schema.runs.c.number == number).values(note=storable(text))
        if number > reading.GREATEST or not self._database.write(
                lambda connection: connection.execute(change).rowcount):
            raise StoreError(reading.no_run(number))

    def delete(self, numbers: Iterable[int]) -> None:
        """Remove runs, and the traces that no other run has: all of them or, where one is not there, none.

        Raises:
            StoreError: there is none of one of these numbers.
        """
        digests = self._database.write(functools.partial(_delete, numbers=list(numbers)))
        # The rows first: a trace without a row is a leftover, a row without its trace is a loss.
        self._database.write(functools.partial(self._remove_unused, digests=digests))

    def export(self, number: int, folder: str | Path, form: str) -> list[Path]:
        """Write a run into a folder as "csv", "json" or "parquet" (with its trace): the files.

        Raises:
            StoreError: there is none of this number, or the format is not known.
            OSError: the folder cannot be written.
        """
        return export(self.run(number), Path(folder), form)

    def verify(self) -> list[Finding]:
        """What is damaged or missing, and what interrupted writers left. Reads every trace.

        Raises:
            StoreError: the database cannot be read at all.
        """
        return verify(self._database, self.traces)

    def remove_leftovers(self) -> int:
        """Remove what interrupted writers left; how many files."""
        return remove_leftovers(self._database, self.traces)

    def append(self, events: Sequence[NewEvent]) -> int:
        """Add events at the end of all: the sequence of the last one. They are on the disk when this returns."""
        return self._database.write(lambda connection: event_log.append(connection, events))

    def events(self, after: int = 0, limit: int = 1000, run: str | None = None) -> list[Event]:
        """The events behind a sequence, in their order; of one run (its uid) where it is named."""
        return self._database.read(lambda connection: event_log.events(connection, after, limit, run))

    def last_sequence(self) -> int:
        """The sequence of the newest event; 0 where there is none."""
        return self._database.read(event_log.last_sequence)

    def identity(self) -> str:
        """The name of this store; sequences of events are its own."""
        asked = select(schema.identity.c.uid)
        return str(self._database.read(lambda connection: connection.execute(asked).scalar_one()))

    def register(self, receiver: str, after: int | None = None) -> int:
        """The last sequence that a receiver has taken; a new one begins ``after`` this one, or with the next event."""
        return self._database.write(lambda connection: event_log.register(connection, receiver, after))

    def taken(self, receiver: str) -> int:
        """The last sequence that a registered receiver has taken."""
        return self._database.read(lambda connection: event_log.taken_by(connection, receiver)) or 0

    def acknowledge(self, receiver: str, sequence: int) -> None:
        """A receiver has taken all events up to this sequence."""
        self._database.write(lambda connection: event_log.acknowledge(connection, receiver, sequence))

    def rewind(self, receiver: str, sequence: int) -> None:
        """A receiver asks for all events behind this sequence once more."""
        self._database.write(lambda connection: event_log.rewind(connection, receiver, sequence))

    def forget(self, before: datetime | None = None) -> int:
        """Remove events that every receiver has taken and that are older than this, or than 30 days; how many."""
        instant = datetime.now(UTC) - event_log.KEPT if before is None else before
        return self._database.write(lambda connection: event_log.forget(connection, instant))

    def _remove_unused(self, connection: Connection, digests: Sequence[str]) -> None:
        for digest in digests:
            if not connection.execute(select(schema.traces.c.sha256).where(schema.traces.c.sha256 == digest)).first():
                self.traces.remove(digest)


def _delete(connection: Connection, numbers: Sequence[int]) -> list[str]:
    """The digests of traces that no run has any more."""
    digests = set()
    for number in numbers:
        summary, _ = reading.find_run(connection, number)
        if summary.trace_sha256 is not None:
            digests.add(summary.trace_sha256)
    connection.execute(delete(schema.runs).where(schema.runs.c.number.in_(numbers)))
    unused = [digest for digest in sorted(digests) if not connection.execute(
        select(func.count()).select_from(schema.runs).where(schema.runs.c.trace_sha256 == digest)).scalar_one()]
    connection.execute(delete(schema.traces).where(schema.traces.c.sha256.in_(unused)))
    return unused
