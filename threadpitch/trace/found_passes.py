"""Conditioned pieces of a log -> those of the passes in it that are found by the motion of the feed."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator, Sequence

from threadpitch.trace.conditioned import Samples, joined
from threadpitch.trace.groups import Group, first_step
from threadpitch.trace.recording import TraceError
from threadpitch.trace.synchronous import LEAST_TURNS, Part, Synchronism

_MANY = 1024  # pieces that are made one: a recording that grows comes row by row

Owned = tuple[Group, Samples]


def found_passes(owned: Iterable[Owned]) -> Iterator[Owned]:
    """The pieces of the passes, each with its pass as a group of its own; all others are left out.

    Raises:
        TraceError: no pass was found in the whole log.
    """
    finder: _Finder | None = None
    empty: list[str] = []  # groups without a pass since the last one
    found: Group | None = None
    for group, samples in owned:
        if finder is None or finder.group is not group:
            if finder is not None:
                yield from finder.end()
                found = finder.now or found
                empty += [finder.group.label] if finder.now is None else []
            finder = _Finder(group, empty)
        yield from finder.add(samples)
    if finder is None:
        return
    yield from finder.end()
    empty += [finder.group.label] if finder.now is None else []
    found = finder.now or found
    if found is None:
        raise _none_found(finder.group)
    found.close(_left_out(empty))


def with_chief_lead(owned: Iterable[Owned]) -> Iterator[Owned]:
    """The same samples, once the lead of each group is known: that in which the spindle makes most turns."""
    whole = list(owned)
    yield from with_leads(whole, chief_leads(whole))


def chief_leads(owned: Iterable[Owned]) -> list[float | None]:
    """The movement per turn in which the spindle makes most turns in each group, m, signed; None where there is none.

    Nothing of the samples is kept.
    """
    now: Group | None = None
    motions: list[Synchronism] = []
    for group, samples in owned:
        if group is not now:
            now = group
            motions.append(Synchronism())
        motions[-1].add(samples.angle, samples.position)
    for motion in motions:
        motion.end()
    return [motion.chief() for motion in motions]


def with_leads(owned: Iterable[Owned], leads: Sequence[float | None]) -> Iterator[Owned]:
    """The same samples; the groups know their leads, which are given in their order."""
    now: Group | None = None
    coming = iter(leads)
    for group, samples in owned:
        if group is not now:
            now, group.lead = group, next(coming, None)
        yield group, samples


class _Finder:
    """The passes in one group."""

    def __init__(self, group: Group, empty: list[str]) -> None:
        self.group = group
        self.now: Group | None = None  # the last pass
        self._empty = empty
        by_index = group.chosen.index_enable is not None
        given = group.signals.lead
        self._motion = Synchronism(group.lead if given is None else given, signed=given is None,
                                   from_the_start=by_index)
        self._numbered = group.chosen.group is None and not by_index
        self._count = 0
        self._held: list[Samples] = []
        self._first = 0  # number of the first sample that is held

    def add(self, samples: Samples) -> Iterator[Owned]:
        """The next samples of the group; what is known to belong to a pass."""
        self._held.append(samples)
        if len(self._held) > _MANY:
            self._held = [joined(self._held)]
        yield from self._taken(self._motion.add(samples.angle, samples.position))

    def end(self) -> Iterator[Owned]:
        """The group is over."""
        yield from self._taken(self._motion.end())
        if self.now is not None:
            self.now.close()

    def _taken(self, parts: list[Part]) -> Iterator[Owned]:
        for part in parts:
            samples = self._part(part)
            if part.opens:
                self._begin(samples)
            assert self.now is not None  # a part that does not open a pass goes on with one
            self.now.movement = part.movement
            yield self.now, samples
        self._forget(self._motion.needed)

    def _begin(self, samples: Samples) -> None:
        if self.now is not None:
            self.now.close()
        self._count += 1
        label = str(self._count) if self._numbered else self.group.label
        if self._count > 1 and not self._numbered:
            label = f"{label}-{self._count}"
        self.now = copy.copy(self.group)  # shares what makes the signals continuous
        self.now.label, self.now.margin = label, first_step(samples.angle)
        self.now.notes = [*self.group.notes, *_left_out(self._empty)]
        self._empty.clear()

    def _part(self, part: Part) -> Samples:
        """Samples that are held."""
        parts: list[Samples] = []
        first = self._first
        for samples in self._held:
            last = first + samples.size
            if first < part.last and last > part.first:
                parts.append(samples.part(slice(max(part.first - first, 0), min(part.last, last) - first)))
            first = last
        return parts[0] if len(parts) == 1 else joined(parts)

    def _forget(self, needed: int) -> None:
        kept = 0
        for samples in self._held:
            if self._first + samples.size > needed:
                break
            self._first += samples.size
            kept += 1
        del self._held[:kept]


def _left_out(labels: list[str]) -> list[str]:
    if not labels:
        return []
    shown = ", ".join(repr(label) for label in labels[:5]) + (" and others" if len(labels) > 5 else "")
    return [f"left out, because the feed does not move in step over {LEAST_TURNS:g} turns there: {shown}"]


def _none_found(group: Group) -> TraceError:
    lead = "" if group.signals.lead is None else f" of {1e3 * group.signals.lead:g} mm per turn"
    return TraceError(f"{group.source}, group {group.label!r}: no synchronous motion{lead} of the feed over "
                      f"{LEAST_TURNS:g} turns was found; are angle and position the right columns?")
