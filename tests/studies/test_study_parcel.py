"""Workers that see nothing of the client's disk compute the same rows: what they need is sent to them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import dask
import pytest

from tests.benchmarks.bench_killed_workers import definition, own_workers
from threadpitch.studies import Place, StudyError, study, study_of
from threadpitch.studies.cluster import connected
from threadpitch.studies.evaluation import Evaluator, Outcome
from threadpitch.studies.execution import OnDask, sent
from threadpitch.studies.parcel import Parcel
from threadpitch.system_archive import FmuKind, build_system

ROWS = 12


def test_workers_without_the_clients_files_compute_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither the .ssp nor a cache of FMUs is there when workers begin; one begins in the place of a killed one."""
    system = build_system("models/threading_lathe", tmp_path / "packed", FmuKind("native"))
    document = definition(ROWS, 0.2)
    document["study"]["system"] = str(system)
    with Evaluator(study_of(document)) as evaluator:
        here = list(evaluator.outcomes(range(ROWS)))
        parcel = Parcel.of(evaluator, with_fmus=True)
    assert len(parcel.fmus) == 5  # of seven components: two drives and two calculators are the same
    system.unlink()
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.setenv("THREADPITCH_CACHE", str(elsewhere / "cache"))
    monkeypatch.chdir(elsewhere)
    there: list[Outcome] = []
    written: set[str] = set()
    with (dask.config.set({"temporary-directory": str(elsewhere)}), connected(1, None, {}) as client,
          sent(client, parcel) as name):
        for outcomes in OnDask(client, name).outcomes(range(ROWS)):
            if not there:
                own_workers()[0].kill()
            there += outcomes
            written |= {path.parent.name for path in elsewhere.rglob("*.fmu") if path.is_file()}
    assert sorted(there, key=lambda one: one.row) == here
    assert written == set(parcel.fmus)
    assert not (elsewhere / "cache").exists()


def test_a_scheduler_without_the_clients_files(tmp_path: Path) -> None:
    """The same by the public way; the scheduler keeps no parcel afterwards."""
    with connected(1, None, {}) as client:
        cluster = client.cluster
        found = study(definition(4, 0.2), output=tmp_path / "there", place=Place(scheduler=cluster.scheduler_address))
        assert not [name for name in cluster.scheduler.worker_plugins if name.startswith("threadpitch")]
        with Evaluator(study_of(definition(4, 0.2))) as evaluator:
            damaged = replace(Parcel.of(evaluator, with_fmus=True), fmus={"0": b""})
        with pytest.raises(StudyError, match="a worker cannot take the study"), sent(client, damaged):
            pass
    quiet = study(definition(4, 0.2), output=tmp_path / "here", place=Place(workers=0))
    assert found.table.equals(quiet.table, check_metadata=True)
