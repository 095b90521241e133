"""Recordings: the ``Trace`` of spindle angle and feed position, and the readers that make one from a log."""

from threadpitch.trace.choice import ColumnChoice
from threadpitch.trace.conditioned import Samples, scaled
from threadpitch.trace.groups import Group
from threadpitch.trace.log import chosen_columns, read_groups, read_pieces, watch_pieces
from threadpitch.trace.recording import REVERSAL_LIMIT, IntArray, Trace, TraceError, reversal_limit, samples, time_fault
from threadpitch.trace.signals import Signals
from threadpitch.trace.soundness import LARGEST, TURN, FloatArray

__all__ = [
    "LARGEST",
    "REVERSAL_LIMIT",
    "TURN",
    "ColumnChoice",
    "FloatArray",
    "Group",
    "IntArray",
    "Samples",
    "Signals",
    "Trace",
    "TraceError",
    "chosen_columns",
    "read_groups",
    "read_pieces",
    "reversal_limit",
    "samples",
    "scaled",
    "time_fault",
    "watch_pieces",
]
