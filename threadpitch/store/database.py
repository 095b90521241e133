"""The connection to the database: transactions that several processes may have at once, and the schema's version.

A writing transaction is the only one of its store: SQLite's BEGIN IMMEDIATE, in PostgreSQL an advisory lock. So what
is read in it stays true until it ends, files of traces included, and the sequence of events has no gaps. Readers are
never kept waiting. A commit is on the disk when it returns (SQLite: WAL with synchronous=FULL).
"""

from __future__ import annotations

import contextlib
import random
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import alembic.command
from alembic.config import Config
from filelock import FileLock
from sqlalchemy import Connection, Engine, create_engine, event, inspect, text
from sqlalchemy.exc import DBAPIError, InterfaceError, OperationalError

from threadpitch.store import schema
from threadpitch.store.address import Address
from threadpitch.store.errors import StoreError

BUSY = 60.0  # s that a writer waits for the others
_TRIES = 5
_PAUSE = 0.2  # s before the second try, doubled before every other
_LOCK = 0x7468_7265_6164  # "thread": the advisory lock of this store within its database
_WRITING = "threadpitch_writing"
_LOST = ("08", "57P", "40001", "40P01")  # SQLSTATE: no connection, shut down, serialisation, deadlock

_Value = TypeVar("_Value")


class Database:
    """An SQLite file or a PostgreSQL database with the newest schema.

    Raises (the class itself):
        StoreError: it cannot be reached, or is of a newer version.
    """

    def __init__(self, address: Address) -> None:
        self.address = address
        self._engine = _engine(address)
        try:
            self._bring_up_to_date()
        except BaseException:
            self._engine.dispose()
            raise

    def close(self) -> None:
        """Close all connections."""
        self._engine.dispose()

    def read(self, asked: Callable[[Connection], _Value]) -> _Value:
        """What a transaction that changes nothing finds; all of it is of one instant.

        Raises:
            StoreError: the database cannot be reached, or is damaged.
        """
        return self._repeated(asked, writing=False)

    def write(self, change: Callable[[Connection], _Value]) -> _Value:
        """A change that is made whole or not at all; when this returns it is on the disk.

        It may be called again where the connection was lost, so it must come to the same when it was made already.

        Raises:
            StoreError: the database cannot be reached or written.
        """
        return self._repeated(change, writing=True)

    def _repeated(self, work: Callable[[Connection], _Value], writing: bool) -> _Value:
        for attempt in range(_TRIES):
            try:
                with self._transaction(writing) as connection:
                    return work(connection)
            except DBAPIError as error:
                if attempt == _TRIES - 1 or not _passing(error):
                    raise self._refusal(error) from error
                time.sleep(_PAUSE * 2.0**attempt * random.uniform(0.5, 1.0))
        raise AssertionError("the last try returns or raises")

    @contextlib.contextmanager
    def _transaction(self, writing: bool) -> Iterator[Connection]:
        # PostgreSQL: what a reader sees is of one instant; a writer must see what came before it got the lock.
        level = {} if self.address.file else {"isolation_level": "READ COMMITTED" if writing else "REPEATABLE READ"}
        with self._engine.connect() as connection:
            connection.execution_options(**{_WRITING: writing}, **level)
            with connection.begin():
                if writing and self.address.file is None:
                    connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": _LOCK})
                yield connection

    def _bring_up_to_date(self) -> None:
        if self.read(_version) == schema.NEWEST:
            return
        with self._alone():
            self.write(self._migrate)

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        """Several processes may make a store at once; the switch to WAL does not wait for others by itself."""
        file = self.address.file
        if file is None:
            yield
            return
        with FileLock(f"{file}.lock", timeout=BUSY):
            with self._engine.connect() as connection:
                raw = connection.connection.cursor()
                raw.execute("PRAGMA journal_mode=WAL")
                raw.close()
            yield

    def _migrate(self, connection: Connection) -> None:
        found = _version(connection)
        if found == schema.NEWEST:
            return  # another process was first
        if found is not None and (not found.isdecimal() or int(found) > int(schema.NEWEST)):
            raise StoreError(f"{self.address}: has the schema {found} of a newer threadpitch, this one knows "
                             f"{schema.NEWEST}; install the newer one")
        if found is None and (others := set(inspect(connection).get_table_names()) & set(schema.metadata.tables)):
            raise StoreError(f"{self.address}: holds tables of something else ({', '.join(sorted(others))}); choose "
                             "another store")
        config = Config()
        config.set_main_option("script_location", (Path(__file__).parent / "migrations").as_posix().replace("%", "%%"))
        config.attributes["connection"] = connection
        alembic.command.upgrade(config, "head")

    def _refusal(self, error: DBAPIError) -> StoreError:
        reason = " ".join(str(error.orig).split())
        return StoreError(f"{self.address}: {reason}; {_mend(reason)}")


def _engine(address: Address) -> Engine:
    file = address.file
    if file is None:
        try:
            return _with_begin(create_engine(address.url, pool_pre_ping=True, connect_args={"connect_timeout": 10}))
        except ModuleNotFoundError:
            raise StoreError("PostgreSQL needs psycopg, which is not installed; pip install "
                             "'threadpitch[postgresql]'") from None
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(f"{file.parent}: cannot be made ({error.strerror}); choose another place for the "
                         "store") from None
    return _with_begin(create_engine(address.url, connect_args={"timeout": BUSY}))


def _with_begin(engine: Engine) -> Engine:
    """SQLite's driver begins transactions when it likes; here they begin as they are meant to."""
    if engine.dialect.name == "sqlite":
        event.listen(engine, "connect", _prepare_sqlite)
        event.listen(engine, "begin", _begin_sqlite)
    return engine


def _prepare_sqlite(connection: Any, _: object) -> None:
    connection.isolation_level = None
    for pragma in ("synchronous=FULL", "foreign_keys=ON"):
        connection.execute(f"PRAGMA {pragma}")


def _begin_sqlite(connection: Connection) -> None:
    writing = connection.get_execution_options().get(_WRITING, False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writing else "BEGIN")


def _version(connection: Connection) -> str | None:
    """The version of the schema; None in an empty database."""
    if not inspect(connection).has_table("alembic_version"):
        return None
    return connection.execute(text("SELECT version_num FROM alembic_version")).scalar_one_or_none()


def _passing(error: DBAPIError) -> bool:
    """Whether the same may succeed a moment later."""
    state = str(getattr(error.orig, "sqlstate", None) or "")
    if state:
        return state.startswith(_LOST)
    name = getattr(error.orig, "sqlite_errorname", "")
    if name:
        return name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED"))
    return error.connection_invalidated and isinstance(error, OperationalError | InterfaceError)


def _mend(reason: str) -> str:
    if "unable to open" in reason or "readonly" in reason:
        return "may it be written?"
    if any(words in reason for words in ("malformed", "not a database", "no such", "does not exist")):
        return "it is damaged or no store; restore it from a copy, or choose another"
    if "locked" in reason:
        return "another program holds it; try again"
    return "is the server running, and are name, user and password right?"
