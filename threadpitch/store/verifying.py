"""``verify``: whether all that was acknowledged is there, bit for bit, and what interrupted writers left behind."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from sqlalchemy import Connection, func, select, text

from threadpitch.store import schema
from threadpitch.store.database import Database
from threadpitch.store.records import Finding
from threadpitch.store.trace_folder import TraceFolder, sha256_of


def verify(database: Database, folder: TraceFolder) -> list[Finding]:
    """What is wrong with a store.

    Raises:
        StoreError: the database cannot be read at all.
    """
    found = [*database.read(lambda connection: list(_database_faults(connection))),
             *(fault for digest, size in sorted(database.read(_traces).items())
               if (fault := _trace_fault(database, folder, digest, size)) is not None)]
    # Within a writing transaction nobody is between giving a trace its name and its row.
    leftovers = database.write(lambda connection: list(_leftovers(connection, folder)))
    return [*found, *(Finding("leftover", f"{path}: no run has it; `threadpitch store verify --clean` removes it")
                      for path in leftovers)]


def remove_leftovers(database: Database, folder: TraceFolder) -> int:
    """Remove what interrupted writers left; how many files."""
    def removed(connection: Connection) -> int:
        paths = list(_leftovers(connection, folder))
        for path in paths:
            path.unlink(missing_ok=True)
        return len(paths)

    return database.write(removed)


def _traces(connection: Connection) -> dict[str, int]:
    return {row.sha256: row.bytes for row in connection.execute(select(schema.traces))}


def _leftovers(connection: Connection, folder: TraceFolder) -> Iterator[Path]:
    known = _traces(connection)
    yield from (folder.file(digest) for digest in folder.digests() if digest not in known)
    yield from folder.abandoned()


def _trace_fault(database: Database, folder: TraceFolder, digest: str, size: int) -> Finding | None:
    path = folder.file(digest)
    try:
        damaged = path.stat().st_size != size or sha256_of(path) != digest
    except FileNotFoundError:
        if digest not in database.read(_traces):
            return None  # its run was deleted meanwhile
        return Finding("missing", f"{path}: the trace of {_owners(database, digest)} is not there; restore it from a "
                                  "copy, or delete the run")
    except OSError as error:
        return Finding("damaged", f"{path}: the trace of {_owners(database, digest)} cannot be read ({error.strerror})")
    if damaged:
        return Finding("damaged", f"{path}: the trace of {_owners(database, digest)} is not what was written; restore "
                                  "it from a copy, or delete the run")
    return None


def _owners(database: Database, digest: str) -> str:
    asked = select(schema.runs.c.number).where(schema.runs.c.trace_sha256 == digest).order_by(schema.runs.c.number)
    numbers = database.read(lambda connection: list(connection.execute(asked).scalars()))
    return f"run{'s' if len(numbers) > 1 else ''} {', '.join(map(str, numbers))}"


def _database_faults(connection: Connection) -> Iterator[Finding]:
    if connection.dialect.name == "sqlite":
        for pragma in ("integrity_check", "foreign_key_check"):
            for row in connection.execute(text(f"PRAGMA {pragma}")):
                told = " ".join(map(str, row))
                if told != "ok":
                    yield Finding("database", f"{pragma}: {told}; restore the database from a copy")
    yield from _wrong_counts(connection)
    yield from _gaps(connection)


def _wrong_counts(connection: Connection) -> Iterator[Finding]:
    """Series that have not as many pitches as were written."""
    asked = (select(schema.passes.c.run, schema.series.c.turns, func.count(schema.pitches.c.n).label("found"))
             .select_from(schema.series.join(schema.passes).outerjoin(schema.pitches))
             .group_by(schema.passes.c.run, schema.series.c.id, schema.series.c.turns)
             .having(func.count(schema.pitches.c.n) != schema.series.c.turns))
    for row in connection.execute(asked):
        yield Finding("database", f"run {row.run}: {row.found} of {row.turns} pitches are there; restore the database "
                                  "from a copy")


def _gaps(connection: Connection) -> Iterator[Finding]:
    columns = schema.events.c
    count, first, last = connection.execute(
        select(func.count(), func.min(columns.sequence), func.max(columns.sequence))).one()
    if count and last - first + 1 != count:
        yield Finding("database", f"{last - first + 1 - count} events are missing between {first} and {last}; restore "
                                  "the database from a copy")
