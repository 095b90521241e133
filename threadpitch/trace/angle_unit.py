"""The unit of an angle that has none: told by its first samples, where only one is possible.

A wrapped angle tells it by where it begins again: at 1, 360 or 2 pi. A continuous one is in degrees where the spindle
would turn faster than 33,000 rpm in radians, and so in turns; slower, it may be in either. Counts are not told: whole
numbers may be those of any encoder.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain

import numpy as np

from threadpitch.trace.choice import FASTEST, Chosen, brief
from threadpitch.trace.passes import Piece
from threadpitch.trace.signals import Signals
from threadpitch.trace.soundness import TURN, FloatArray

PERIODS = {"rev": 1.0, "deg": 360.0, "rad": TURN}  # one turn in each unit
LOOKED_AT = 1 << 17  # samples of the first pass
_FEWEST_WRAPS = 2  # one fall may be a counter that was set
_BEYOND = 1e-3  # periods, by which the ends of a wrapped angle may be missed
_LARGEST_STEP = 0.25  # periods; a wrapped angle that goes farther in a sample does not tell where it begins again
_ALIASED = 0.5  # turns per sample
_SURELY = 1.1  # of the fastest speed: a rounded time and angle may exceed it a little
_ONWARD = 0.9  # of all movement; less is no spindle that turns, or the unit is another


def with_angle_unit(pieces: Iterable[Piece], chosen: Chosen, signals: Signals) -> tuple[Iterator[Piece], Chosen]:
    """The same pieces, and the columns with the unit of the angle, which is told by the first samples of the first
    pass where nothing else does.
    """
    coming = iter(pieces)
    if not chosen.angle_unit_is_assumed:
        return coming, chosen
    held: list[Piece] = []
    size = 0
    for piece in coming:
        if held and piece.opens:
            coming = chain([piece], coming)
            break
        held.append(piece)
        size += piece.angle.size
        if size >= LOOKED_AT:
            break
    return chain(held, coming), _told(held, chosen, signals)


def _told(first: list[Piece], chosen: Chosen, signals: Signals) -> Chosen:
    if not first:
        return chosen
    angle = np.concatenate([piece.angle for piece in first])[:LOOKED_AT]
    times = [piece.time for piece in first if piece.time is not None]
    time = np.concatenate(times)[: angle.size] * chosen.time_factor if times else None
    unit, why = angle_unit(angle, time)
    if not unit or signals.angle_wrap not in (None, PERIODS[unit]):
        return assumed(chosen)
    note = (f"angle: column {brief(chosen.angle_name)} has no unit: taken as {unit}, because {why}; --angle-unit "
            "overrules it")
    return replace(chosen, angle_unit=unit, angle_unit_is_assumed=False, notes=(*chosen.notes, note))


def assumed(chosen: Chosen) -> Chosen:
    """The same columns; that the unit of the angle is only assumed is noted."""
    note = chosen.assumed_unit_note()
    return replace(chosen, notes=(*chosen.notes, note)) if note else chosen


def angle_unit(angle: FloatArray, time: FloatArray | None) -> tuple[str, str]:
    """(unit of an angle (samples,) with its time (samples,) s, how it is told); ("", "") where that is not sure."""
    if angle.size < 2 or not np.isfinite(angle).all():
        return "", ""
    steps = np.diff(angle)
    seconds = _duration(time)
    found = []
    for unit, period in PERIODS.items():
        wrapped = _turned_between_wraps(angle, steps, period)
        if wrapped and (seconds == 0.0 or TURN * wrapped / seconds <= FASTEST):
            found.append((unit, f"it begins again at {period:.6g}"))
    if not found and seconds and _counts_on(angle, steps):
        moved = abs(float(angle[-1] - angle[0]))
        degrees = PERIODS["deg"]
        if (moved >= degrees and np.abs(steps).max() < _ALIASED * degrees and moved / seconds > _SURELY * FASTEST
                and TURN * moved / degrees / seconds <= FASTEST):
            return "deg", "the spindle would turn faster than 30,000 rpm in rev or rad"
    return found[0] if len(found) == 1 else ("", "")


def _duration(time: FloatArray | None) -> float:
    """s; 0 where the time is not known, or runs back."""
    if time is None or not np.isfinite(time).all() or np.any(np.diff(time) < 0.0):
        return 0.0
    return float(time[-1] - time[0])


def _turned_between_wraps(angle: FloatArray, steps: FloatArray, period: float) -> float:
    """Turns of an angle that is wrapped at this period; 0 where it is not."""
    low, high, slack = float(angle.min()), float(angle.max()), _BEYOND * period
    from_zero = -slack <= low and high <= period + slack
    about_zero = -0.5 * period - slack <= low and high <= 0.5 * period + slack
    jumps = np.abs(steps) > 0.5 * period
    count = int(np.count_nonzero(jumps))
    if not (from_zero or about_zero) or count < _FEWEST_WRAPS or count == steps.size:
        return 0.0
    direction = -math.copysign(1.0, float(steps[jumps][0]))
    onward = direction * steps
    usual = float(np.abs(onward[~jumps]).max())
    over = onward[jumps] + period  # the steps over the ends
    if usual > _LARGEST_STEP * period or np.any(onward[jumps] > 0.0) or np.any(np.abs(over) > 2.0 * usual + slack):
        return 0.0
    onward[jumps] = over
    return float(onward.sum()) / period if onward.sum() >= _ONWARD * np.abs(onward).sum() else 0.0


def _counts_on(angle: FloatArray, steps: FloatArray) -> bool:
    """Whether it is a continuous angle that goes on in one direction, and may be something else than counts."""
    path = float(np.abs(steps).sum())
    return abs(float(angle[-1] - angle[0])) >= _ONWARD * path > 0.0 and bool(np.any(angle != np.rint(angle)))
