"""What runs in a worker process: rows in, outcomes out; the study's FMUs stay loaded from call to call."""

from __future__ import annotations

import atexit
import tempfile
import threading
from collections.abc import Sequence
from typing import Any

from threadpitch.studies.definition import Document, study_of
from threadpitch.studies.design import Row
from threadpitch.studies.errors import StudyError
from threadpitch.studies.evaluation import Evaluator, Outcome

_here = threading.local()  # of every thread: instances of FMUs are stepped by the thread that made them


def compute(document: Document, digest: str, components: Any, rows: Sequence[int]) -> list[Outcome]:
    """The outcomes of these rows of the study that the document describes.

    ``components`` are the FMUs by content that the client has: a worker elsewhere must have the same.

    Raises:
        StudyError: this machine draws other rows, or has other FMUs.
    """
    return list(_evaluator(document, digest, components).outcomes(rows))


def evaluate(document: Document, digest: str, components: Any, row: Row) -> Outcome:
    """The outcomes for parameters that are no row of the study; as ``compute``."""
    return _evaluator(document, digest, components).outcome(0, row)


def _evaluator(document: Document, digest: str, components: Any) -> Evaluator:
    """That of this thread, with the FMUs loaded."""
    evaluator: Evaluator | None = getattr(_here, "evaluator", None)
    if evaluator is None or evaluator.study.digest != digest:
        if evaluator is not None:
            evaluator.close()
        evaluator = _here.evaluator = _new(document, digest, components)
        atexit.register(evaluator.close)
    return evaluator


def _unpack_into_own_folder() -> None:
    """FMUs are unpacked into the folder of Dask's worker, which Dask removes when the worker was killed."""
    from distributed import get_worker

    tempfile.tempdir = get_worker().local_directory


def _new(document: Document, digest: str, components: Any) -> Evaluator:
    _unpack_into_own_folder()
    study = study_of(document)
    evaluator = Evaluator(study)
    if study.digest != digest:
        raise StudyError("a worker draws other rows from the same seed; give it the same versions of NumPy and SciPy")
    if evaluator.describe().get("components") != components:
        raise StudyError("a worker has other FMUs than the client; let both use the same threadpitch, system and "
                         "compiler (or an .ssp that holds the FMUs)")
    return evaluator

