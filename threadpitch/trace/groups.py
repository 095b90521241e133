"""Pieces of a log -> conditioned samples of its groups."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from threadpitch.compiled import compiled
from threadpitch.trace.choice import Chosen
from threadpitch.trace.conditioned import Samples, scaled
from threadpitch.trace.passes import Piece
from threadpitch.trace.quadrature import LevelError, Quadrature
from threadpitch.trace.recording import IntArray, TraceError
from threadpitch.trace.signals import NEVER, Clock, Continuous, Signals
from threadpitch.trace.soundness import TURN, FloatArray
from threadpitch.trace.standing import Standing

_HALF_A_TURN = 0.5 * TURN
_WITHIN = 0.999
_LOST = 0.5  # periods; a wrapped angle that goes further between two samples cannot be made continuous
_INDEX_WITHIN = 1.5 * TURN  # rad, in which the first index must have come


@dataclass
class Group:
    """A group while its pieces come: rad, m and s, the angle continuous and counted up."""

    label: str
    source: str
    chosen: Chosen
    signals: Signals
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        chosen, signals = self.chosen, self.signals
        turn = TURN / chosen.angle_factor
        wrap = signals.angle_wrap if chosen.angle_b is None else NEVER  # what is counted here does not wrap
        self._angle = Continuous("angle", wrap, turn, chosen.angle_unit == "count")
        self._position = Continuous("position", signals.position_wrap, math.inf)
        self._position_factor = signals.position_factor(chosen.position_unit)
        self._clock = Clock()
        self._standing = Standing()
        self._levels = None if chosen.angle_b is None else Quadrature(chosen.counts_per_turn or turn)
        self._first: float | None = None
        self._sign = 0.0  # of the angle's first half turn
        self._zero: float | None = None if chosen.index is not None else 0.0  # rad, the angle at the first index
        self.margin: float | None = None
        self.lead: float | None = None  # m per turn with its sign, of the passes where it was found
        self.movement: float | None = None  # m per turn, of a pass that was found
        self._closed: tuple[str, ...] | None = None
        self._told: tuple[str, ...] = ()  # after all others
        self._waiting: list[Samples] = []

    @property
    def resolution(self) -> float:
        """One count of the spindle's encoder, rad; 0 = not known. Of an angle in degrees too it may be told."""
        counts = self.chosen.counts_per_turn
        return 0.0 if counts is None else TURN / counts

    @property
    def went_round(self) -> float:
        """Turns that were added to a wrapped angle; 0 for passes by motion, which lie somewhere in the recording.

        Where they are nearly as many as the samples, the angle is no wrapped one, but one in another unit.
        """
        if self._found_by_motion or not self._angle.period:
            return 0.0
        return self._angle.went_round * self._angle.period * self.chosen.angle_factor / TURN

    @property
    def named(self) -> str:
        """What to call it in a message."""
        return f"{self.source}, group {self.label!r}"

    def place(self, lines: IntArray | None, sample: int, before: int) -> str:
        """Where a sample of a piece stands: its line, or its number when so many came ``before`` the piece."""
        return f"{self.named}: sample {before + sample}" if lines is None else f"{self.source}:{lines[sample]}"

    @property
    def parted(self) -> bool:
        """The recording has passes: their turns are counted from where each begins."""
        return self.chosen.group is not None or self.chosen.index_enable is not None or self.signals.synchronous

    @property
    def _found_by_motion(self) -> bool:
        """Passes are looked for in the recording, which may have stopped between them."""
        return self.chosen.index_enable is not None or self.signals.synchronous

    def add(self, raw: Piece) -> list[Samples]:
        """The samples that are ready; the first wait until the turning direction and angle zero are known."""
        if self._levels is not None:
            assert raw.angle_b is not None
            raw = replace(raw, angle=self._counted(raw), angle_b=None, index=None)
        with np.errstate(over="ignore", invalid="ignore"):  # the trace refuses what becomes infinite
            time = None if raw.time is None else scaled(raw.time, self.chosen.time_factor)
            coming = self._without_duplicates(
                Samples(self._angle.add(raw.angle), self.chosen.angle_factor, self._position.add(raw.position),
                        self._position_factor, time, raw.lines))
            self._refuse_lost_turns()
            self._standing.add(coming)
            self._waiting.append(coming)
            if self._sign == 0.0:
                self._find_direction(coming)
            if self._zero is None:
                self._find_zero(coming)
            return self.rest() if self._sign != 0.0 and self._zero is not None else []

    def rest(self) -> list[Samples]:
        """The samples that wait."""
        ready, self._waiting = self._waiting, []
        if self._zero:
            ready = [replace(one, angle_values=one.angle - self._zero, angle_factor=1.0) for one in ready]
        if self._sign < 0.0:
            ready = [replace(one, angle_factor=-one.angle_factor) for one in ready]
        if self.parted and self.margin is None and ready:
            self.margin = first_step(np.concatenate([one.angle for one in ready]))
        return ready

    def close(self, more: Iterable[str] = ()) -> None:
        """A pass that was found is over: what comes later of the signals is not told of it."""
        self._closed = (*(self._closed or self._notes()), *more)

    def tell(self, note: str) -> None:
        """What was done to the samples after they were conditioned."""
        self._told = (*self._told, note)

    def all_notes(self) -> tuple[str, ...]:
        """What was done to the signals."""
        return (*(self._notes() if self._closed is None else self._closed), *self._told)

    def _notes(self) -> tuple[str, ...]:
        levels = "" if self._levels is None else self._levels.note()
        counted = not self._found_by_motion  # else more may be read than the pass, by as much as a piece holds
        found = [*self.chosen.notes, *self.signals.notes(self.chosen), levels, self._angle.note(counted),
                 self._position.note(counted), *self._clock.notes()]
        if self._sign < 0.0:
            found.append("the angle counts down: turned around, so that it counts up in the turning direction")
        if not self._found_by_motion:
            found += self._standing.notes()
        if self.movement is not None:
            found.append(f"taken is the part in which the feed moves {1e3 * abs(self.movement):.4g} mm per turn")
        return tuple(note for note in [*found, *self.notes] if note)

    def _without_duplicates(self, coming: Samples) -> Samples:
        kept = self._clock.add(coming)
        return coming if kept is None else coming.part(kept)

    def _refuse_lost_turns(self) -> None:
        """A wrapped angle does not tell how often it went round where samples are missing."""
        period = self._angle.period
        if not self._angle.wraps or not period or self._found_by_motion:
            return
        periods = self._clock.turned / (period * self.chosen.angle_factor)
        if periods > _LOST:
            raise TraceError(f"{self.named}: samples are missing for "
                             f"{self._clock.longest:.4g} s, in which the angle, that wraps at {period:.12g}, "
                             f"went round about {periods:.1f} times: part the recording there by a group (--group)")

    def _counted(self, raw: Piece) -> FloatArray:
        assert self._levels is not None
        assert raw.angle_b is not None
        try:
            return self._levels.add(raw.angle, raw.angle_b, raw.index)
        except LevelError as error:
            place = f"sample {error.sample}" if raw.lines is None else f"{raw.lines[error.sample]}"
            raise TraceError(f"{self.source}:{place}: {error}") from None

    def _find_zero(self, coming: Samples) -> None:
        """The angle at the first index; angle zero stays at the first sample where none comes."""
        assert self._levels is not None
        if self._levels.zero is not None:
            self._zero = self._levels.zero * self.chosen.angle_factor
        elif self._first is not None and np.any(np.abs(coming.angle - self._first) > _INDEX_WITHIN):
            self._zero = 0.0

    def _find_direction(self, coming: Samples) -> None:
        if coming.size == 0:
            return
        if self._first is None:
            self._first = float(coming.angle_values[0]) * coming.angle_factor
        far = _first_far(coming.angle_values, coming.angle_factor, self._first, _HALF_A_TURN)
        if far < coming.size:
            self._sign = -1.0 if coming.angle_values[far] * coming.angle_factor < self._first else 1.0


@compiled(nogil=True)
def _first_far(values: FloatArray, factor: float, origin: float, distance: float) -> int:
    """The first sample whose ``factor value`` is farther than that from the origin; their number if there is none."""
    for i in range(values.size):
        if abs(values[i] * factor - origin) > distance:
            return i
    return values.size


def grouped(pieces: Iterable[Piece], source: str, chosen: Chosen, signals: Signals) -> Iterator[tuple[Group, Samples]]:
    """The samples of every piece, conditioned, with their group; those of a group follow one another.

    Where a label comes again after other rows, a new group begins, called ``true (2)``.
    """
    seen: dict[str, int] = {}
    group: Group | None = None
    for raw in pieces:
        if group is None or raw.opens:
            if group is not None:
                yield from ((group, ready) for ready in group.rest())
            seen[raw.label] = seen.get(raw.label, 0) + 1
            times = seen[raw.label]
            group = Group(raw.label if times == 1 else f"{raw.label} ({times})", source, chosen, signals)
        yield from ((group, ready) for ready in group.add(raw))
    if group is not None:
        yield from ((group, ready) for ready in group.rest())


def first_step(angle: FloatArray) -> float:
    """A little less than the first sample is below the next one that is above it, rad: what may be extrapolated."""
    above = np.flatnonzero(angle > angle[:1])
    return _WITHIN * float(angle[above[0]] - angle[0]) if above.size else 0.0
