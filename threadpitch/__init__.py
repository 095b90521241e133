"""threadpitch: the movement of the feed per spindle revolution, from machine logs and from FMU co-simulation.

``thread_pitch(angle, position)`` gives P(n) of a recording, ``simulate(system)`` cuts a thread, ``judge(nominal,
measured)`` tells where its pitches' fluctuation comes from.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from threadpitch.drive_fit import DriveFit, fit
    from threadpitch.judgement import Verdict, judge
    from threadpitch.lathe import Simulation, simulate
    from threadpitch.pitch import PitchTable, thread_pitch
    from threadpitch.studies import StudyResult, Tuning, study, tune

__all__ = ["DriveFit", "PitchTable", "Simulation", "StudyResult", "Tuning", "Verdict", "__version__", "fit", "judge",
           "simulate", "study", "thread_pitch", "tune"]

_HOMES = {"Simulation": "threadpitch.lathe", "simulate": "threadpitch.lathe", "PitchTable": "threadpitch.pitch",
          "thread_pitch": "threadpitch.pitch", "Verdict": "threadpitch.judgement", "judge": "threadpitch.judgement",
          "DriveFit": "threadpitch.drive_fit", "fit": "threadpitch.drive_fit", "StudyResult": "threadpitch.studies",
          "study": "threadpitch.studies", "Tuning": "threadpitch.studies", "tune": "threadpitch.studies"}


def __getattr__(name: str) -> Any:
    """Public names are imported when they are first used: a log needs no FMUs, and a model no Numba."""
    if name not in _HOMES:
        raise AttributeError(f"module 'threadpitch' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
