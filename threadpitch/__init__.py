"""threadpitch: the movement of the feed per spindle revolution, from machine logs and from FMU co-simulation.

``thread_pitch(angle, position)`` gives P(n) of a recording, ``simulate(system)`` cuts a thread.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from threadpitch.lathe import Simulation, simulate
    from threadpitch.pitch import PitchTable, thread_pitch

__all__ = ["PitchTable", "Simulation", "__version__", "simulate", "thread_pitch"]

_HOMES = {"Simulation": "threadpitch.lathe", "simulate": "threadpitch.lathe", "PitchTable": "threadpitch.pitch",
          "thread_pitch": "threadpitch.pitch"}


def __getattr__(name: str) -> Any:
    """Public names are imported when they are first used: a log needs no FMUs, and a model no Numba."""
    if name not in _HOMES:
        raise AttributeError(f"module 'threadpitch' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
