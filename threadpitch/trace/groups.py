"""Pieces of a log -> conditioned pieces -> one ``Trace`` per group."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from threadpitch.trace.choice import Chosen
from threadpitch.trace.passes import Piece
from threadpitch.trace.recording import Trace, TraceError
from threadpitch.trace.signals import Clock, Continuous, Signals, estimated_latency, without_latency, without_outliers
from threadpitch.trace.soundness import TURN, FloatArray

_HALF_A_TURN = 0.5 * TURN
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
        self._angle = Continuous("angle", signals.angle_wrap, turn, chosen.angle_unit == "count")
        self._position = Continuous("position", signals.position_wrap, math.inf)
        self._position_factor = signals.position_factor(chosen.position_unit)
        self._clock = Clock()
        self._first: float | None = None
        self._sign = 0.0  # of the angle's first half turn
        self._waiting: list[Piece] = []

    @property
    def resolution(self) -> float:
        """One count of the spindle's encoder, rad; 0 = not known."""
        return self.chosen.angle_factor if self.chosen.angle_unit == "count" else 0.0

    def add(self, raw: Piece) -> list[Piece]:
        """The pieces that are ready; those before the first half turn wait until the turning direction is known."""
        with np.errstate(over="ignore", invalid="ignore"):  # the trace refuses what becomes infinite
            piece = replace(
                raw,
                angle=self._angle.add(raw.angle) * self.chosen.angle_factor,
                position=self._position.add(raw.position) * self._position_factor,
                time=None if raw.time is None else raw.time * self.chosen.time_factor,
            )
            piece = self._without_duplicates(piece)
        self._waiting.append(piece)
        if self._sign == 0.0:
            self._find_direction(piece.angle)
        return self.rest() if self._sign != 0.0 else []

    def rest(self) -> list[Piece]:
        """The pieces that wait."""
        ready, self._waiting = self._waiting, []
        return [replace(piece, angle=-piece.angle) for piece in ready] if self._sign < 0.0 else ready

    def all_notes(self) -> tuple[str, ...]:
        """What was done to the signals."""
        found = [*self.chosen.notes, *self.signals.notes(self.chosen), self._angle.note(), self._position.note(),
                 *self._clock.notes()]
        if self._sign < 0.0:
            found.append("the angle counts down: turned around, so that it counts up in the turning direction")
        return tuple(note for note in [*found, *self.notes] if note)

    def _without_duplicates(self, piece: Piece) -> Piece:
        if piece.time is None:
            return piece
        kept = self._clock.add(piece.time, piece.angle, piece.position)
        if kept is None:
            return piece
        lines = None if piece.lines is None else piece.lines[kept]
        return replace(piece, angle=piece.angle[kept], position=piece.position[kept], time=piece.time[kept],
                       lines=lines)

    def _find_direction(self, angle: FloatArray) -> None:
        if angle.size == 0:
            return
        if self._first is None:
            self._first = float(angle[0])
        with np.errstate(invalid="ignore"):
            far = np.flatnonzero(np.abs(angle - self._first) > _HALF_A_TURN)
        if far.size:
            self._sign = -1.0 if angle[far[0]] < self._first else 1.0


def grouped(pieces: Iterable[Piece], source: str, chosen: Chosen, signals: Signals) -> Iterator[tuple[Group, Piece]]:
    """Every piece, conditioned, with its group; a group's pieces follow one another.

    Where a label comes again after other rows, a new group begins, called ``true (2)``.
    """
    seen: dict[str, int] = {}
    group: Group | None = None
    for raw in pieces:
        if group is None or raw.opens:
            if group is not None:
                yield from ((group, piece) for piece in group.rest())
            seen[raw.label] = seen.get(raw.label, 0) + 1
            times = seen[raw.label]
            group = Group(raw.label if times == 1 else f"{raw.label} ({times})", source, chosen, signals)
        yield from ((group, piece) for piece in group.add(raw))
    if group is not None:
        yield from ((group, piece) for piece in group.rest())


def traces(pieces: Iterable[tuple[Group, Piece]]) -> Iterator[Trace]:
    """One trace per group.

    Raises:
        TraceError: all that ``Trace`` refuses; more turns than samples.
    """
    group: Group | None = None
    parts: list[Piece] = []
    for owner, piece in pieces:
        if group is not None and owner is not group:
            yield _trace(group, parts)
            parts = []
        group = owner
        parts.append(piece)
    if group is not None:
        yield _trace(group, parts)


def _trace(group: Group, parts: list[Piece]) -> Trace:
    times = [part.time for part in parts if part.time is not None]
    lines = [part.lines for part in parts if part.lines is not None]
    trace = Trace(
        angle=np.concatenate([part.angle for part in parts]),
        position=np.concatenate([part.position for part in parts]),
        time=np.concatenate(times) if times else None,
        name=group.label,
        source=group.source,
        lines=np.concatenate(lines) if lines else None,
        resolution=group.resolution,
        notes=group.all_notes(),
    )
    turns = (trace.angle[-1] - trace.angle[0]) / TURN
    if turns > trace.angle.size:
        raise TraceError(f"{trace.whole()}: {turns:.0f} turns in {trace.angle.size} samples; "
                         f"is the unit of the angle really {group.chosen.angle_unit}?")
    return _without_latency(_without_outliers(trace, group), group)


def _without_outliers(trace: Trace, group: Group) -> Trace:
    if group.signals.outlier is None:
        return trace
    position, count = without_outliers(trace.position, group.signals.outlier)
    note = f"{count} positions stuck out by more than {1e3 * group.signals.outlier:g} mm: put between their neighbours"
    return replace(trace, position=position, notes=(*trace.notes, note)) if count else trace


def _without_latency(trace: Trace, group: Group) -> Trace:
    latency = group.signals.latency
    if latency == 0.0:
        return trace
    if trace.time is None:
        raise TraceError(f"{trace.whole()}: a latency needs the time of the samples; name the time column")
    estimated = math.isnan(latency)
    if estimated:
        try:
            latency = estimated_latency(trace.time, trace.angle, trace.position)
        except TraceError as error:
            raise TraceError(f"{trace.whole()}: {error}") from None
    note = f"the position is taken {1e3 * latency:.4g} ms later than recorded with the angle" + (
        ", as estimated from the spindle's speed (a feed that follows late looks the same)" if estimated else "")
    return replace(trace, position=without_latency(trace.time, trace.position, latency), notes=(*trace.notes, note))
