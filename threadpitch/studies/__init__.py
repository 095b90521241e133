"""Parameter studies of simulated threads: what is varied -> rows -> one table, with effects, indices and the yield.

    result = study("models/studies/gain.toml")
    result.table, result.analysis.yields

The way of a study is ``making.study``.
"""

from threadpitch.studies.analysis import Analysis, Indices, Interval, Response, YieldResponse
from threadpitch.studies.definition import Study, read_study, study_of
from threadpitch.studies.document import analysis_document
from threadpitch.studies.errors import StudyError
from threadpitch.studies.keeping import is_study
from threadpitch.studies.making import (
    DEFAULT_OUTPUT,
    Estimate,
    StudyResult,
    estimate,
    kept,
    row,
    study,
    units,
)
from threadpitch.studies.place import Place, read_shard
from threadpitch.studies.tuning import Tuning, tune

__all__ = [
    "DEFAULT_OUTPUT",
    "Analysis",
    "Estimate",
    "Indices",
    "Interval",
    "Place",
    "Response",
    "Study",
    "StudyError",
    "StudyResult",
    "Tuning",
    "YieldResponse",
    "analysis_document",
    "estimate",
    "is_study",
    "kept",
    "read_shard",
    "read_study",
    "row",
    "study",
    "study_of",
    "tune",
    "units",
]
