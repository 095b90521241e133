"""Movement of the feed axis per revolution of the spindle: ``Trace`` -> ``PitchTable``.

    P(n) = xi(theta_S + 360 n) - xi(theta_S + 360 (n - 1))

xi(theta) is the feed position at the spindle angle theta, theta_S a start angle. Source: US 2016/0008901 A1, formulae
1 and 2. P(n) is the nominal thread pitch for control of a single-start thread; of a thread with several starts it is
the lead, and the pitch is lead / starts.
"""

from threadpitch.pitch.changing_lead import first_lead, leads_of_turns
from threadpitch.pitch.edge_stream import edge_pitch_table
from threadpitch.pitch.proper import thread_proper, usual
from threadpitch.pitch.recorded import GroupPitch, pitch_table, pitch_tables, thread_pitch
from threadpitch.pitch.stored import Stored
from threadpitch.pitch.stream import FARTHEST_ZERO, PitchStream
from threadpitch.pitch.streamed import GroupStream, StreamedPitch, stream_pitches
from threadpitch.pitch.table import BoolArray, PitchError, PitchTable, Statistics, statistics

__all__ = [
    "FARTHEST_ZERO",
    "BoolArray",
    "GroupPitch",
    "GroupStream",
    "PitchError",
    "PitchStream",
    "PitchTable",
    "Statistics",
    "Stored",
    "StreamedPitch",
    "edge_pitch_table",
    "first_lead",
    "leads_of_turns",
    "pitch_table",
    "pitch_tables",
    "statistics",
    "stream_pitches",
    "thread_pitch",
    "thread_proper",
    "usual",
]
