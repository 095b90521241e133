"""Channels that were sampled by different clocks -> rows at the instants of the first of them.

Between its samples a channel of floating numbers is interpolated linearly, what counts or names something holds until
it changes. Rows where one of the channels was not recorded are left out. Everything is read in parts, in order, and
the result is the same however long they are.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from threadpitch.trace.array_log import Chunk, lengths_differ
from threadpitch.trace.choice import Chosen, brief
from threadpitch.trace.passes import Array
from threadpitch.trace.recording import TraceError
from threadpitch.trace.soundness import FloatArray

OWN_CLOCK = "the position has a clock of its own: it is interpolated at the instants of the angle"


@dataclass(frozen=True)
class Channel:
    """A signal of its own length; ``read(first, last)`` gives its samples, ``instants`` their time, s."""

    name: str
    size: int
    read: Callable[[int, int], Array]
    clock: Hashable = None  # channels of one clock have the same instants
    instants: Callable[[int, int], FloatArray] | None = None


def clock_notes(clocks: Sequence[Hashable]) -> Callable[[Chosen], tuple[str, ...]]:
    """What is to be said when angle and position have different clocks."""
    return lambda chosen: (OWN_CLOCK,) if clocks[chosen.angle] != clocks[chosen.position] else ()


def aligned(channels: Sequence[Channel], step: int) -> Generator[Chunk]:
    """The channels, (rows,) each, at the instants of the first, ``step`` samples of it at a time.

    Raises:
        TraceError: channels of different clocks without their time; a time that runs back; nothing in common.
    """
    first = channels[0]
    foreign = [one for one in channels if one.clock != first.clock]
    if any(one.size != first.size for one in channels if one.clock == first.clock) or any(
            one.instants is None or first.instants is None for one in foreign):
        lengths = {i: np.broadcast_to(0, one.size) for i, one in enumerate(channels)}
        differ = lengths_differ([one.name for one in channels], lengths)
        raise TraceError(f"{differ}; record the time of each beside it")
    followers = {one.name: _Follower(one, step) for one in foreign}
    begin, end = _common(channels) if foreign else (-np.inf, np.inf)
    for start in range(0, first.size, step):
        stop = min(start + step, first.size)
        part = slice(0, stop - start)
        instants = np.empty(0)
        if foreign:
            assert first.instants is not None
            instants = _rising(first.instants(start, stop), first.name)
            part = slice(int(np.searchsorted(instants, begin)), int(np.searchsorted(instants, end, side="right")))
        if part.start < part.stop:
            yield Chunk([followers[one.name].at(instants[part]) if one.name in followers
                         else one.read(start + part.start, start + part.stop) for one in channels], stop / first.size)


def _common(channels: Sequence[Channel]) -> tuple[float, float]:
    """(begin, end) s of what all channels have recorded."""
    begin, end = -np.inf, np.inf
    for one in channels:
        if one.size == 0:
            raise TraceError(f"{brief(one.name)} has no samples; choose another column")
        assert one.instants is not None
        begin, end = max(begin, float(one.instants(0, 1)[0])), min(end, float(one.instants(one.size - 1, one.size)[0]))
    if not begin < end:
        raise TraceError(f"{', '.join(brief(one.name) for one in channels)} have no time in common; are their clocks "
                         "the same?")
    return begin, end


class _Follower:
    """A channel at instants that come in order."""

    def __init__(self, channel: Channel, step: int) -> None:
        self._channel, self._step = channel, step
        self._next = 0
        self._time: FloatArray = np.empty(0)
        self._values: Array = channel.read(0, 0)

    def at(self, instants: FloatArray) -> Array:
        """The values at these instants, none of which is before those asked for earlier."""
        channel = self._channel
        assert channel.instants is not None
        while self._next < channel.size and (self._time.size == 0 or self._time[-1] < instants[-1]):
            stop = min(self._next + self._step, channel.size)
            self._time = _rising(np.concatenate((self._time, channel.instants(self._next, stop))), channel.name)
            self._values = np.concatenate((self._values, channel.read(self._next, stop)))
            self._next = stop
        found = _interpolated(instants, self._time, self._values)
        kept = max(int(np.searchsorted(self._time, instants[-1], side="right")) - 1, 0)
        self._time, self._values = self._time[kept:], self._values[kept:]
        return found


def _interpolated(instants: FloatArray, time: FloatArray, values: Array) -> Array:
    if values.dtype.kind == "f":
        return np.interp(instants, time, values)
    return values[np.maximum(np.searchsorted(time, instants, side="right") - 1, 0)]


def _rising(time: FloatArray, name: str) -> FloatArray:
    if not np.isfinite(time).all() or np.any(time[1:] < time[:-1]):
        raise TraceError(f"the time of {brief(name)} runs back or is not finite; sort its samples")
    return time
