"""Conditioned samples of groups -> one ``Trace`` per group, in memory."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from threadpitch.trace.conditioned import Samples, joined
from threadpitch.trace.groups import Group
from threadpitch.trace.mended import Latency
from threadpitch.trace.recording import Trace, TraceError
from threadpitch.trace.signals import estimated_latency
from threadpitch.trace.soundness import TURN


def traces(owned: Iterable[tuple[Group, Samples]]) -> Iterator[Trace]:
    """One trace per group.

    Raises:
        TraceError: all that ``Trace`` refuses; more turns than samples; a latency that cannot be estimated.
    """
    group: Group | None = None
    parts: list[Samples] = []
    for owner, samples in owned:
        if group is not None and owner is not group:
            yield _finished(group, joined(parts))
            parts = []
        group = owner
        parts.append(samples)
    if group is not None:
        yield _finished(group, joined(parts))


def _finished(group: Group, whole: Samples) -> Trace:
    trace = _trace(group, whole)
    turns = max((trace.angle[-1] - trace.angle[0]) / TURN, group.went_round)
    seconds = 0.0 if trace.time is None else float(trace.time[-1] - trace.time[0])
    if doubt := group.chosen.angle_unit_doubt(turns, trace.angle.size, seconds):
        raise TraceError(f"{trace.whole()}: {doubt}")
    if not math.isnan(group.signals.latency):
        return trace
    if trace.time is None:
        raise TraceError(f"{trace.whole()}: a latency needs the time of the samples; name the time column")
    try:
        latency, uncertainty = estimated_latency(trace.time, trace.angle, trace.position)
    except TraceError as error:
        raise TraceError(f"{trace.whole()}: {error}") from None
    step = Latency(group, latency, f", as estimated from the spindle's speed with a standard uncertainty of "
                                   f"{1e3 * uncertainty:.2g} ms (a feed that follows late looks the same)")
    ready, rest = step.add(whole), step.end()
    return _trace(group, ready if rest is None else joined([ready, rest]))


def _trace(group: Group, whole: Samples) -> Trace:
    return Trace(whole.angle, whole.position, whole.time, name=group.label, source=group.source, lines=whole.lines,
                 resolution=group.resolution, notes=group.all_notes(), margin=group.margin)
