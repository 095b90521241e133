"""What runs in a worker process: rows in, outcomes out; the study's FMUs stay loaded from call to call."""

from __future__ import annotations

import atexit
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path

from threadpitch.studies.definition import study_of
from threadpitch.studies.design import Row
from threadpitch.studies.errors import StudyError
from threadpitch.studies.evaluation import Evaluator, Outcome
from threadpitch.studies.parcel import Parcel

_here = threading.local()  # of every thread: instances of FMUs are stepped by the thread that made them
_parcels: dict[str, Parcel] = {}  # of this process, by the names under which they were sent


def put(name: str, parcel: Parcel, folder: Path) -> None:
    """Keep a parcel under this name, its FMUs in the folder.

    Raises:
        OSError: the folder cannot be written.
    """
    _parcels[name] = parcel.unpacked(folder)


def forget(name: str) -> None:
    """Forget the parcel of this name."""
    _parcels.pop(name, None)


def compute(name: str, rows: Sequence[int]) -> list[Outcome]:
    """The outcomes of these rows of the study in the parcel of this name.

    Raises:
        StudyError: this machine draws other rows, or its FMUs are not those of the client.
    """
    return list(_evaluator(name).outcomes(rows))


def evaluate(name: str, row: Row) -> Outcome:
    """The outcomes for parameters that are no row of the study; as ``compute``."""
    return _evaluator(name).outcome(0, row)


def _evaluator(name: str) -> Evaluator:
    """That of this thread, with the FMUs loaded."""
    known: tuple[str, Evaluator] | None = getattr(_here, "known", None)
    if known is not None and known[0] == name:
        return known[1]
    if known is not None:
        known[1].close()
    evaluator = _new(name)
    _here.known = name, evaluator
    atexit.register(evaluator.close)
    return evaluator


def _unpack_into_own_folder() -> None:
    """FMUs are unpacked into the folder of Dask's worker, which its nanny removes when the worker was killed.

    A worker without one may share its process with others, and with the client: their temporary files are not its own.
    """
    from distributed import get_worker

    if get_worker().nanny is not None:
        tempfile.tempdir = get_worker().local_directory


def _new(name: str) -> Evaluator:
    if name not in _parcels:
        raise StudyError("a worker did not get the study; look for the reason in the worker's log")
    parcel = _parcels[name]
    _unpack_into_own_folder()
    study = study_of(parcel.document, system_at_hand=True)
    evaluator = Evaluator(study, parcel.system)
    if study.digest != parcel.digest:
        raise StudyError("a worker draws other rows from the same seed; give it the same versions of NumPy and SciPy")
    if evaluator.describe().get("components") != parcel.components:
        raise StudyError("a worker has other FMUs than the client: they were changed meanwhile; begin once more")
    return evaluator
