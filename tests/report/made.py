"""Threads that are made by formulae, for reports."""

from __future__ import annotations

import numpy as np

from threadpitch.pitch import thread_pitch, thread_proper
from threadpitch.report.content import Samples, Thread
from threadpitch.report.recorded_log import trace_samples
from threadpitch.trace import TURN, FloatArray, Trace

LEAD = 1.5e-3
SAMPLES_A_TURN = 144


def wobble(turn: FloatArray) -> FloatArray:
    """A drunken thread: 2 um once per revolution, and 1 um with every 6 2/3 turns."""
    return 2e-6 * np.sin(TURN * turn) + 1e-6 * np.sin(TURN * 0.15 * turn)


def made_thread(turns: int = 40, name: str = "made", *, back: bool = False) -> Thread:
    """A thread of so many turns, recorded with its time at 500 rpm; ``back``: the feed counts down."""
    turn = np.arange(turns * SAMPLES_A_TURN + 8) / SAMPLES_A_TURN
    position = LEAD * turn + wobble(turn)
    trace = Trace(TURN * turn, -position if back else position, turn / 500.0 * 60.0)
    table = thread_pitch(trace.angle, trace.position, (0.0, 0.5 * np.pi))
    return Thread(name, table, LEAD, thread_proper(table.pitch), samples=trace_samples(trace, table),
                  screw_lead=10e-3)


def samples_of(thread: Thread) -> Samples:
    """Its recording, which is there."""
    assert thread.samples is not None
    return thread.samples
