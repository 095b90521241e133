"""Outliers and latency, piece by piece: the same bits, however the samples are cut into pieces."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Protocol

import numpy as np

from threadpitch.trace.conditioned import Samples, joined
from threadpitch.trace.groups import Group
from threadpitch.trace.recording import TraceError, time_fault
from threadpitch.trace.signals import without_outliers
from threadpitch.trace.soundness import LARGEST, damage_text

_AROUND = 2  # samples on either side by which an outlier is told


def mended(owned: Iterable[tuple[Group, Samples]]) -> Iterator[tuple[Group, Samples]]:
    """The samples without the outliers and the latency that their signals tell; what was done, the group tells.

    Raises:
        TraceError: a latency without the time of the samples, or longer than the recording; time that runs back.
    """
    group: Group | None = None
    steps: list[_Step] = []
    for owner, samples in owned:
        if owner is not group:
            if group is not None:
                yield from ((group, rest) for rest in _ended(steps))
            group, steps = owner, _steps_of(owner)
        yield owner, _through(steps, samples)
    if group is not None:
        yield from ((group, rest) for rest in _ended(steps))


class _Step(Protocol):
    """Something that is done to the samples of one group; it may hold some of them until more have come."""

    def add(self, coming: Samples) -> Samples:
        """Those that are ready."""

    def end(self) -> Samples | None:
        """The rest."""


def _steps_of(group: Group) -> list[_Step]:
    steps: list[_Step] = []
    if group.signals.outlier is not None:
        steps.append(_Outliers(group, group.signals.outlier))
    if group.signals.latency != 0.0 and not math.isnan(group.signals.latency):
        steps.append(Latency(group, group.signals.latency))
    return [_Sound(group), *steps] if steps else []


def _through(steps: list[_Step], samples: Samples) -> Samples:
    for step in steps:
        samples = step.add(samples)
    return samples


def _ended(steps: list[_Step]) -> Iterator[Samples]:
    """What the steps still hold; that of the first goes through all others."""
    for k, step in enumerate(steps):
        rest = step.end()
        if rest is not None:
            yield _through(steps[k + 1 :], rest)


class _Sound:
    """Refuses damage where it stands, before it spreads to the neighbours."""

    def __init__(self, group: Group) -> None:
        self._group = group
        self._size, self._end = 0, -math.inf

    def add(self, coming: Samples) -> Samples:
        fault = None
        if coming.time is not None and coming.size:
            fault = time_fault(coming.time, self._end)
            self._end = float(coming.time[-1])
        sound = np.abs(coming.position) <= LARGEST
        if fault is None and not sound.all():
            sample = int(np.argmin(sound))
            fault = sample, damage_text("position", coming.position[sample])
        if fault is not None:
            raise TraceError(f"{self._group.place(coming.lines, fault[0], self._size)}: {fault[1]}")
        self._size += coming.size
        return coming

    def end(self) -> None:
        return None


class _Outliers:
    """``without_outliers``; two samples are held until the next ones have come."""

    def __init__(self, group: Group, limit: float) -> None:
        self._group, self._limit = group, limit
        self._held: list[Samples] = []
        self._given = 0  # how many of those that are held were given on
        self._count = 0

    def add(self, coming: Samples) -> Samples:
        return self._ready([*self._held, coming], _AROUND)

    def end(self) -> Samples | None:
        rest = self._ready(self._held, 0) if self._held else None
        if self._count:
            self._group.tell(f"{self._count} positions stuck out by more than {1e3 * self._limit:g} mm: put between "
                             "their neighbours")
        return rest

    def _ready(self, parts: list[Samples], wait: int) -> Samples:
        whole = joined(parts)
        first, last = self._given, max(self._given, whole.size - wait)
        position, out = without_outliers(whole.position, self._limit)
        self._count += int(np.count_nonzero((out >= first) & (out < last)))
        seen = max(last - _AROUND, 0)
        self._held, self._given = [whole.part(slice(seen, None))], last - seen
        return replace(whole, position_values=position, position_factor=1.0).part(slice(first, last))


class Latency:
    """xi(t) = recorded(t + latency), interpolated linearly; what one of the signals lacks at the ends is left out."""

    def __init__(self, group: Group, latency: float, remark: str = "") -> None:
        self._group, self._latency, self._remark = group, latency, remark
        self._held: list[Samples] = []
        self._given = 0  # how many of those that are held were given on
        self._taken = 0  # samples that were given on
        self._begin, self._end = math.inf, -math.inf  # s, of the recording

    def add(self, coming: Samples) -> Samples:
        """The samples whose position is known; they wait for that."""
        if coming.size == 0:
            return coming
        if coming.time is None:
            raise TraceError(f"{self._group.named}: a latency needs the time of the samples; name the time column")
        self._begin, self._end = min(self._begin, float(coming.time[0])), float(coming.time[-1])
        whole = joined([*self._held, coming])
        assert whole.time is not None
        return self._ready(whole, int(np.searchsorted(whole.time + self._latency, self._end)))

    def end(self) -> Samples | None:
        """Those that had to wait for the end.

        Raises:
            TraceError: the latency is longer than the recording.
        """
        if not self._held:
            return None
        whole = joined(self._held)
        assert whole.time is not None
        rest = self._ready(whole, int(np.searchsorted(whole.time + self._latency, self._end, side="right")))
        if self._taken < 2:
            raise TraceError(f"{self._group.named}: the latency of {1e3 * self._latency:.4g} ms is longer than the "
                             f"recording, {1e3 * (self._end - self._begin):.4g} ms; give it in ms")
        self._group.tell(f"the position is taken {1e3 * self._latency:.4g} ms later than recorded with the angle"
                         f"{self._remark}")
        return rest

    def _ready(self, whole: Samples, last: int) -> Samples:
        """Those up to the sample ``last`` that were not given on yet."""
        assert whole.time is not None
        instants = whole.time + self._latency
        last = max(last, self._given)
        part = slice(max(int(np.searchsorted(instants, self._begin)), self._given), last)
        position = np.interp(instants[part], whole.time, whole.position) if part.start < last else np.empty(0)
        ready = replace(whole.part(slice(min(part.start, last), last)), position_values=position, position_factor=1.0)
        self._taken += ready.size
        needed = float(instants[last]) if last < whole.size else self._end + self._latency
        kept = max(min(last, int(np.searchsorted(whole.time, needed, side="right")) - 1), 0)
        self._held, self._given = [whole.part(slice(kept, None))], last - kept
        return ready
