"""Recordings: the ``Trace`` of spindle angle and feed position, and the readers that make one from a log."""

from threadpitch.trace.csv_log import ColumnChoice, read_groups
from threadpitch.trace.recording import REVERSAL_LIMIT, TURN, FloatArray, IntArray, Trace, TraceError

__all__ = [
    "REVERSAL_LIMIT",
    "TURN",
    "ColumnChoice",
    "FloatArray",
    "IntArray",
    "Trace",
    "TraceError",
    "read_groups",
]
