"""A store with parts, one of them beyond the limits, and a simulated run; a server that gives it out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from tests.report.made import LEAD
from threadpitch import lathe
from threadpitch.pitch import PitchTable
from threadpitch.runs import Labels, RunEvents, simulation_run, simulation_trace
from threadpitch.store import NewRun, Store, StoredPass, open_store

HOSTILE = "<img src=x onerror=window.hacked=1></script><script>window.hacked=1</script>{{7*7}}'; DROP TABLE run;--"
PARTS = 9
SHIFTED = 7  # the part whose mean is beyond its limits


@dataclass(frozen=True)
class Stored:
    """The store, and the numbers of its runs."""

    store: Store
    address: str
    simulation: int
    hostile: int


def part(number: int) -> NewRun:
    rng = np.random.default_rng(number)
    shift = 3e-6 if number == SHIFTED else 0.0
    table = PitchTable.of_pitches(rng.normal(LEAD + shift, 1e-6, (1, 30)), [0.0])
    return NewRun(kind="log", source=f"part{number}.csv", serial_number=f"S{number:03d}", machine="Lathe 2",
                  program="O1234", thread="M20x1.5", passes=(StoredPass("log", "1", table, LEAD),))


@pytest.fixture(scope="session")
def stored(short_run: lathe.Simulation, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stored]:
    pytest.importorskip("starlette", reason="the extra serve is not installed")
    folder: Path = tmp_path_factory.mktemp("serve")
    address = str(folder / "runs.db")
    with open_store(address) as store:
        for number in range(1, PARTS + 1):
            store.add(part(number))
        simulation_trace(short_run, folder / "trace.parquet")
        labels = Labels("Lathe 1", "default", "M20x1.5", "SIM1", "a simulation")
        simulation = store.add(simulation_run(short_run, RunEvents("simulation", "lathe", labels),
                                              trace=folder / "trace.parquet"))
        wave = LEAD + 1e-6 * np.sin(np.arange(30.0))
        hostile = store.add(NewRun(
            kind="log", source=HOSTILE, machine=HOSTILE, program=HOSTILE, thread=HOSTILE, serial_number=HOSTILE,
            note=HOSTILE, passes=(StoredPass(HOSTILE, HOSTILE, PitchTable.of_pitches(wave, [0.0]), LEAD),)))
        yield Stored(store, address, simulation, hostile)
