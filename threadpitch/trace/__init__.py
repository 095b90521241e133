"""Recordings: the ``Trace`` of spindle angle and feed position, and the readers that make one from a log."""

from threadpitch.trace.csv_log import ColumnChoice, read_groups
from threadpitch.trace.recording import REVERSAL_LIMIT, IntArray, Trace, TraceError, samples
from threadpitch.trace.soundness import LARGEST, TURN, FloatArray

__all__ = [
    "LARGEST",
    "REVERSAL_LIMIT",
    "TURN",
    "ColumnChoice",
    "FloatArray",
    "IntArray",
    "Trace",
    "TraceError",
    "read_groups",
    "samples",
]
