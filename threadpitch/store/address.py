"""Where a store is: its database, and the folder of its traces."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from threadpitch.store.errors import StoreError

if TYPE_CHECKING:
    from sqlalchemy.engine import URL

DEFAULT = "default"
ENVIRONMENT = "THREADPITCH_STORE"
FILE_NAME = "runs.db"
_TRACES = "traces"  # in the query of a URL
_MEND = "give a file like runs.db, sqlite:///runs.db, or postgresql://user@host/name"


@dataclass(frozen=True)
class Address:
    """A database, and the folder where the traces of its runs lie."""

    url: URL
    traces: Path

    def __str__(self) -> str:
        return self.file.as_posix() if self.file else self.url.render_as_string(hide_password=True)

    @property
    def file(self) -> Path | None:
        """The file of an SQLite database."""
        return Path(self.url.database or "") if self.url.get_backend_name() == "sqlite" else None


def read_address(given: str | None) -> Address:
    """The address that a text states; None or "default" takes the environment's or the user's own store.

    Raises:
        StoreError: it is no address.
    """
    from sqlalchemy.engine import make_url
    from sqlalchemy.exc import ArgumentError

    text = given if given not in (None, "", DEFAULT) else os.environ.get(ENVIRONMENT) or str(_own_folder() / FILE_NAME)
    assert text is not None  # the line above
    if "://" not in text:
        return _sqlite(Path(text))
    try:
        url = make_url(text)
    except (ArgumentError, ValueError):  # the latter: a port that is no number
        raise StoreError(f"the store's address cannot be read; {_MEND}") from None
    if url.get_backend_name() == "sqlite":
        if not url.database or url.database == ":memory:" or url.query:
            raise StoreError(f"{text}: names no file; {_MEND}")
        return _sqlite(Path(url.database))
    if url.get_backend_name() != "postgresql" or not url.database:
        raise StoreError(f"{url.render_as_string(hide_password=True)}: is neither SQLite nor PostgreSQL with a "
                         f"database's name; {_MEND}")
    folder = url.query.get(_TRACES, "")
    traces = Path(str(folder)) if folder else _own_folder() / "traces" / _as_folder(url.database)
    return Address(url.difference_update_query([_TRACES]).set(drivername="postgresql+psycopg"), traces)


def _sqlite(file: Path) -> Address:
    from sqlalchemy.engine import URL

    file = file.expanduser().absolute()
    if file.is_dir():
        raise StoreError(f"{file}: is a folder; {_MEND}")
    return Address(URL.create("sqlite", database=str(file)), file.with_name(f"{file.stem}-traces"))


def _own_folder() -> Path:
    from platformdirs import user_data_path

    return user_data_path("threadpitch", appauthor=False)


def _as_folder(database: str) -> str:
    """A database's name may hold what a file's name may not; letters of digests never do."""
    if database.isascii() and database.isalnum():
        return database
    import hashlib

    return hashlib.sha256(database.encode()).hexdigest()[:16]
