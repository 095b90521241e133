"""Old schemas come up to the newest with all they hold; addresses and what is no store are told."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import alembic.command
import numpy as np
import pytest
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from sqlalchemy import Connection, create_engine, text

import threadpitch.store
from threadpitch.store import NewEvent, NewRun, Store, StoreError, open_store, schema
from threadpitch.store.address import read_address
from threadpitch.store.database import Database

MakeRun = Callable[..., NewRun]
VERSION_1_ROWS = (
    "INSERT INTO runs (uid, recorded_at, kind, source, machine, program, thread, serial_number, note, provenance) "
    "VALUES ('old', '2025-01-31T12:00:00.000000Z', 'log', 'log.csv', 'Lathe 1', '', 'M20x1.5', 'S-7', '', '{}')",
    "INSERT INTO passes (run, place, calculator, label, target, revolutions, turns_before, told, notes) "
    "VALUES (1, 0, 'log', '1', 0.0015, 3, 0, '{}', '[]')",
    "INSERT INTO series (\"pass\", place, start_angle, extrapolated, turns, minimum, maximum, mean) "
    "VALUES (1, 0, 0.0, false, 2, 0.0015, 0.0016, 0.00155)",
    "INSERT INTO pitches (series, n, pitch) VALUES (1, 1, 0.0015), (1, 3, 0.0016)",
)


def make_version_1(address: str) -> None:
    """A store as version 1 wrote it."""
    place = read_address(address)
    engine = create_engine(place.url)
    config = Config()
    config.set_main_option("script_location", str(Path(threadpitch.store.__file__).parent / "migrations"))
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        alembic.command.upgrade(config, "1")
        for row in VERSION_1_ROWS:
            connection.execute(text(row))
    engine.dispose()


def test_version_1_comes_up_to_the_newest_with_all_it_holds(address: str, make_run: MakeRun) -> None:
    make_version_1(address)
    with open_store(address) as store:
        run = store.run(1)
        assert (run.summary.serial_number, run.summary.recorded_at.year) == ("S-7", 2025)
        np.testing.assert_array_equal(run.passes[0].table.pitch, [[0.0015, np.nan, 0.0016]])
        assert store.append([NewEvent("begin", {})]) == 1
        assert len(store.identity()) == 32
        assert store.add(make_run()) == 2
        assert store.verify() == []


def test_migrations_make_the_schema_that_is_used(store: Store, address: str) -> None:
    def differences(connection: Connection) -> list[object]:
        return list(compare_metadata(MigrationContext.configure(connection), schema.metadata))

    database = Database(read_address(address))
    assert database.read(differences) == []
    database.close()


def test_a_newer_schema_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "runs.db"
    open_store(str(path)).close()
    with sqlite3.connect(path) as connection:
        connection.execute("UPDATE alembic_version SET version_num = '3'")
    connection.close()
    with pytest.raises(StoreError, match="has the schema 3 of a newer threadpitch, this one knows 2"):
        open_store(str(path))


def test_tables_of_another_program_are_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "other.db"
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE runs (mine TEXT)")
    connection.close()
    with pytest.raises(StoreError, match=r"holds tables of something else \(runs\); choose another"):
        open_store(str(path))


@pytest.mark.parametrize(("given", "message"), [
    ("mysql://host/name", "is neither SQLite nor PostgreSQL"),
    ("postgresql://host", "is neither SQLite nor PostgreSQL with a database's name"),
    ("sqlite://", "names no file"),
    ("postgresql://a:secret@127.0.0.1:1/x", r"postgresql\+psycopg://a:\*\*\*@127.0.0.1:1/x: .*is the server running"),
    ("postgresql://host:port/x", "the store's address cannot be read"),
    (".", "is a folder"),
])
def test_addresses_that_are_none(given: str, message: str) -> None:
    with pytest.raises(StoreError, match=message) as error:
        open_store(given)
    assert "secret" not in str(error.value)
    assert "\n" not in str(error.value)


def test_a_file_that_is_no_store(tmp_path: Path) -> None:
    (tmp_path / "runs.db").write_bytes(b"not a database, but long enough to be taken for one" * 20)
    with pytest.raises(StoreError, match="it is damaged or no store"):
        open_store(str(tmp_path / "runs.db"))


def test_the_environment_names_the_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("THREADPITCH_STORE", str(tmp_path / "mine.db"))
    with open_store() as store:
        assert store.address == (tmp_path / "mine.db").as_posix()
    monkeypatch.delenv("THREADPITCH_STORE")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    if sys.platform == "linux":
        assert read_address("default").file == tmp_path / "threadpitch" / "runs.db"


def test_several_processes_make_one_store(tmp_path: Path) -> None:
    """All of them begin with no file."""
    code = f"from threadpitch.store import open_store; open_store({str(tmp_path / 'runs.db')!r}).identity()"
    processes = [subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE) for _ in range(3)]
    for process in processes:
        assert process.communicate(timeout=60.0)[1] == b""


def test_an_extra_that_is_missing_is_named() -> None:
    code = ("import sys; sys.modules['sqlalchemy'] = None\nfrom threadpitch.store import open_store, StoreError\n"
            "try: open_store('runs.db')\nexcept StoreError as error: print(error)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True,
                          env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])})
    assert done.stdout == "the store needs sqlalchemy, which is not installed; pip install 'threadpitch[store]'\n"
