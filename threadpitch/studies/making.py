"""The way of a study: read, check, compute what is missing, keep, put into one table, look at it."""

from __future__ import annotations

import contextlib
import json
import time as clock
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from threadpitch.fmu.cache import write_file
from threadpitch.studies.analysis import Analysis, analyze
from threadpitch.studies.cluster import connected
from threadpitch.studies.definition import Document, Study, read_study, study_of
from threadpitch.studies.document import analysis_document
from threadpitch.studies.errors import StudyError
from threadpitch.studies.evaluation import Evaluator, Outcome
from threadpitch.studies.execution import OnDask, in_this_process, sent
from threadpitch.studies.keeping import OWN, Folder, folder_size, kept_study
from threadpitch.studies.parcel import Parcel
from threadpitch.studies.place import Place
from threadpitch.studies.shown_units import Units

if TYPE_CHECKING:
    import pyarrow

Progress: TypeAlias = Callable[[int, int], None]  # (rows done, rows in all)
DEFAULT_OUTPUT = "threadpitch-study"
ANALYSIS = "analysis.json"
_MEASURED_ROWS, _MEASURED_TIME = 20, 1.0  # that an estimate computes at most: rows, s


@dataclass(frozen=True)
class StudyResult:
    """``table`` has a row for every run that is done: row, parameters (SI), outcomes (SI), status, reason.

    ``units`` are those that people read them in.
    """

    study: Study
    table: pyarrow.Table
    analysis: Analysis
    folder: Path
    missing: int
    units: Units

    @property
    def complete(self) -> bool:
        """Whether all rows are there."""
        return self.missing == 0

    @property
    def document(self) -> dict[str, Any]:
        """What it shows, as ``--json`` prints it."""
        return analysis_document(self.study, self.analysis, self.units)


@dataclass(frozen=True)
class Estimate:
    """What a study would take, as a few rows tell: seconds of one row and of all that are missing, and bytes."""

    rows: int
    missing: int
    row_time: float
    workers: int
    wall_time: float
    disk: int


def study(definition: str | Path | Document, *, output: str | Path = DEFAULT_OUTPUT, place: Place | None = None,
          retry_failed: bool = False, progress: Progress | None = None) -> StudyResult:
    """Make a study: a TOML file or its tables as a mapping. Rows that ``output`` holds already are not computed again.

    Raises:
        StudyError: the study, the folder or the cluster is wrong.
        cosim.CosimError: the system or a parameter is.
        KeyboardInterrupt: Ctrl-C; the rows that were done are kept.
    """
    place = place or Place()
    chosen = study_of(definition) if isinstance(definition, Mapping) else read_study(definition)
    place.check(chosen)
    with Evaluator(chosen) as evaluator:
        evaluator.check()
        folder = Folder(output, chosen, evaluator.describe())
        if retry_failed:
            folder.forget_failed()
        rows = [row for row in _of_shard(evaluator, place) if row not in folder.done]
        try:
            for outcomes in _computed(evaluator, place, rows):
                folder.add(outcomes)
                if progress is not None:
                    progress(len(folder.done), len(chosen.rows))
        finally:
            folder.flush()
        shown = evaluator.units
    table = folder.finish()
    result = StudyResult(chosen, table, analyze(chosen, table.to_pydict()), folder.path, len(folder.missing),
                         shown)
    if result.complete:
        write_file(folder.path / ANALYSIS, json.dumps(result.document, indent=1).encode())
    return result


def kept(path: str | Path) -> StudyResult:
    """The study that a folder holds, with the rows that are done; nothing is computed.

    Raises:
        StudyError: the folder holds none, or a file in it is damaged.
    """
    chosen, document = kept_study(Path(path))
    folder = Folder(path, chosen, {name: value for name, value in document.items() if name not in OWN})
    if not folder.done:
        raise StudyError(f"{path}: no row of the study is done yet")
    table = folder.table()
    return StudyResult(chosen, table, analyze(chosen, table.to_pydict()), folder.path, len(folder.missing),
                       document.get("units", {}))


def row(definition: str | Path | Document, number: int) -> tuple[Mapping[str, Any], Outcome]:
    """Parameters and outcomes of one row alone, SI, to the same bits as in the study.

    Raises:
        StudyError: there is no such row; and as ``study``.
    """
    chosen = study_of(definition) if isinstance(definition, Mapping) else read_study(definition)
    if not 0 <= number < len(chosen.rows):
        raise StudyError(f"there is no row {number}; the study has rows 0 to {len(chosen.rows) - 1}")
    with Evaluator(chosen) as evaluator:
        return chosen.rows[number], next(evaluator.outcomes([number]))


def units(definition: str | Path | Document) -> Units:
    """The units that people read a study's parameters and outcomes in.

    Raises:
        StudyError, cosim.CosimError: as ``study``.
    """
    chosen = study_of(definition) if isinstance(definition, Mapping) else read_study(definition)
    with Evaluator(chosen) as evaluator:
        return evaluator.units


def estimate(definition: str | Path | Document, *, output: str | Path = DEFAULT_OUTPUT,
             place: Place | None = None) -> Estimate:
    """What a study would take, without the start of workers: a few of its rows are computed, and nothing is kept.

    Raises:
        StudyError, cosim.CosimError: as ``study``.
    """
    place = place or Place()
    chosen = study_of(definition) if isinstance(definition, Mapping) else read_study(definition)
    with Evaluator(chosen) as evaluator:
        evaluator.check()
        rows = _of_shard(evaluator, place)
        done = Folder(output, chosen, evaluator.describe()).done if Path(output).is_dir() else {}
        count = sum(row not in done for row in rows)
        list(evaluator.outcomes(rows[:2]))  # loads, and compiles what the second row needs besides
        row_time = _row_time(evaluator, rows[len(rows) // 2:])
    workers = place.processes
    return Estimate(len(chosen.rows), count, row_time, workers, row_time * count / workers, folder_size(chosen))


def _row_time(evaluator: Evaluator, rows: Sequence[int]) -> float:
    """Seconds of a row, the mean of several that follow each other as in a study: they share beginnings."""
    ends = [clock.perf_counter()]
    for _ in evaluator.outcomes(rows[:_MEASURED_ROWS]):
        ends.append(clock.perf_counter())
        if ends[-1] - ends[0] > _MEASURED_TIME:
            break
    return (ends[-1] - ends[0]) / max(1, len(ends) - 1)


def _of_shard(evaluator: Evaluator, place: Place) -> list[int]:
    """The i-th of n parts of all rows, whatever is done of them: what every shard takes for its own."""
    rows = evaluator.ordered(range(len(evaluator.study.rows)))
    number, count = place.shard
    return rows[len(rows) * (number - 1) // count:len(rows) * number // count]


def _computed(evaluator: Evaluator, place: Place, rows: list[int]) -> Generator[list[Outcome], None, None]:
    """The outcomes as they come."""
    if not rows:
        return
    if place.alone:
        yield from in_this_process(evaluator, rows)
        return
    parcel = Parcel.of(evaluator, with_fmus=place.elsewhere)
    cluster = place.cluster(evaluator.study)
    with (connected(place.processes, place.scheduler, cluster) as client, sent(client, parcel) as name,
          contextlib.closing(OnDask(client, name).outcomes(rows)) as outcomes):
        yield from outcomes
