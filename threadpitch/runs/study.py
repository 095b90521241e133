"""A complete study -> a run that the store keeps."""

from __future__ import annotations

import hashlib
import json

from threadpitch.store import NewRun
from threadpitch.studies import StudyResult
from threadpitch.studies.keeping import METADATA, TABLE

STUDY = "study"  # kind of a run


def study_run(result: StudyResult, source: str) -> NewRun:
    """Its table in place of a trace, and what it shows; the same table is kept once.

    Raises:
        OSError: the table is not there: rows are missing.
    """
    table = result.folder / TABLE
    provenance = json.loads(result.table.schema.metadata[METADATA])
    return NewRun(kind=STUDY, source=source, passes=(), trace=table, note=result.study.name,
                  uid=hashlib.sha256(table.read_bytes()).hexdigest()[:32],
                  provenance=provenance | {"analysis": result.document})
