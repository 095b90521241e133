"""Stores of the tests: SQLite, and PostgreSQL where it is installed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy import create_engine, text

from tests.store import postgres
from threadpitch.pitch import PitchTable
from threadpitch.store import NewRun, Store, StoredPass, open_store


@pytest.fixture(scope="session")
def server() -> Iterator[postgres.Server]:
    """A PostgreSQL server of the tests' own."""
    if postgres.installed() is None:
        pytest.skip(postgres.WHY_NOT)
    with postgres.server() as one:
        yield one


@pytest.fixture(params=["sqlite", "postgresql"])
def address(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """An empty store of each kind."""
    if request.param == "sqlite":
        return str(tmp_path / "runs.db")
    url: str = request.getfixturevalue("server").url
    engine = create_engine(url.replace("postgresql:", "postgresql+psycopg:").partition("&traces")[0])
    with engine.begin() as connection:
        connection.execute(text("DROP SCHEMA public CASCADE"))
        connection.execute(text("CREATE SCHEMA public"))
    engine.dispose()
    return url.partition("&traces")[0] + f"&traces={tmp_path / 'traces'}"


@pytest.fixture
def store(address: str) -> Iterator[Store]:
    """An empty store, open."""
    with open_store(address) as one:
        yield one


@pytest.fixture
def make_run(tmp_path: Path) -> Callable[..., NewRun]:
    """A run with two start angles, a missing turn and a trace; keywords change it."""
    def make(**changes: object) -> NewRun:
        pitch = 1.5e-3 + 1e-6 * np.random.default_rng(1).normal(size=(2, 12))
        pitch[1, 11] = np.nan
        table = PitchTable.of_pitches(pitch, [0.0, np.pi / 2.0])
        in_metal = np.ones(pitch.shape, dtype=np.bool_)
        in_metal[:, :3] = False
        trace = tmp_path / "trace.parquet"
        trace.write_bytes(b"a trace")
        return NewRun(**{  # type: ignore[arg-type] # keywords of the tests' choice
            "kind": "simulation", "source": "models/threading_lathe", "machine": "Lathe 3", "program": "O1234",
            "thread": "M20x1.5", "serial_number": "S-1", "trace": trace, "provenance": {"threadpitch": "0.1.0"},
            "passes": (StoredPass("nominal_pitch", "1", table, 1.5e-3, in_metal, {"kind": "finish", "lead": 1.5e-3}),),
            "verdict": {"cause": "control", "sentence": "The control did it."}} | changes)

    return make
