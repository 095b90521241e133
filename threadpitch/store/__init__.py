"""The store: runs with their pitches, kept in SQLite or PostgreSQL, their traces as Parquet beside it.

``open_store(address)`` gives a ``Store``. What has been acknowledged is on the disk; what was interrupted is not there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from threadpitch.store.address import DEFAULT, ENVIRONMENT, read_address
from threadpitch.store.errors import StoreError
from threadpitch.store.records import (
    Event,
    Finding,
    NewEvent,
    NewRun,
    RunFilter,
    RunSummary,
    SeriesSummary,
    StoredPass,
    StoredRun,
    TurnStatistics,
)

if TYPE_CHECKING:
    from threadpitch.store.run_store import Store

__all__ = ["DEFAULT", "ENVIRONMENT", "Event", "Finding", "NewEvent", "NewRun", "RunFilter", "RunSummary",
           "SeriesSummary", "Store", "StoreError", "StoredPass", "StoredRun", "TurnStatistics",
           "find_store", "open_store"]


def open_store(address: str | None = None) -> Store:
    """The store at an address, made where there is none, brought to the newest schema where it is older.

    ``address``: a file, ``sqlite:///runs.db``, ``postgresql://user@host/name?traces=FOLDER``; None or "default" is what
    the environment variable THREADPITCH_STORE says, else ``runs.db`` in the user's folder for application files.

    Raises:
        StoreError: the address cannot be read, the store cannot be reached or was written by a newer version, or
            SQLAlchemy is missing.
    """
    store: Store = _run_store().Store(address)
    return store


def find_store(address: str | None = None) -> Store:
    """The store at an address, as ``open_store`` gives it, which must be there already.

    Raises:
        StoreError: as of ``open_store``, or there is none.
    """
    stores = _run_store()  # where SQLAlchemy is missing, this says so
    file = read_address(address).file
    if file is not None and not file.exists():
        raise StoreError(f"{file}: is not there, so it holds no runs; keep one with --store, or name another store")
    store: Store = stores.Store(address)
    return store


def _run_store() -> Any:
    try:
        from threadpitch.store import run_store
    except ImportError as error:
        if (error.name or "").partition(".")[0] not in {"sqlalchemy", "alembic", "pyarrow", "platformdirs"}:
            raise
        raise StoreError(f"the store needs {error.name}, which is not installed; pip install "
                         "'threadpitch[store]'") from None
    return run_store


def __getattr__(name: str) -> Any:
    """``Store`` is imported when it is used: what keeps no runs needs no SQLAlchemy."""
    if name != "Store":
        raise AttributeError(f"module 'threadpitch.store' has no attribute {name!r}")
    return _run_store().Store
