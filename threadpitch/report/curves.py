"""The curves of a report, computed from its threads: no drawing, no units but SI and turns.

    e(theta) = xi(theta) - P_ref theta / 360        deviation from the ideal line, theta from the beginning of n = 1;
                                                    a parabola where the lead changes
    c(n)     = sum of P(i) - P_ref for i <= n       cumulative deviation from the first turn of the thread proper
    w(phi, n) = e less the straight line from the beginning to the end of turn n: the error within the turn

Dense curves are thinned for drawing by the least and greatest of every stretch; pitches never are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from threadpitch.report.content import Samples, Thread
from threadpitch.trace import FloatArray, IntArray

MOST_POINTS = 4000  # of a dense curve on a page
MOST_ROWS = 400  # turns of a map; of more, neighbours share a row
ANGLES = 72  # of a map, per turn: every 5 degrees
_SPECTRUM_POINTS = 128  # per turn
_HIGHEST_ORDER = 40.0  # per revolution
_FEWEST_TURNS = 4  # of a spectrum


@dataclass(frozen=True, eq=False)
class Curve:
    """y over x."""

    x: FloatArray  # (points,)
    y: FloatArray  # (points,)


@dataclass(frozen=True, eq=False)
class Map:
    """Values over angle and turn."""

    values: FloatArray  # (rows, angles) m
    first_turn: float
    last_turn: float
    turns_a_row: int  # of these the value that is farthest from zero is shown


def cumulative(thread: Thread) -> FloatArray:
    """c(n), (start_angles, revolutions) m; NaN outside of the thread proper and beyond a missing turn."""
    part = np.where(thread.chosen, thread.deviation, np.nan)
    total = np.full_like(part, np.nan)
    for row, values in enumerate(part):
        known = np.flatnonzero(~np.isnan(values))
        if known.size:
            total[row, known[0]:known[-1] + 1] = np.cumsum(values[known[0]:known[-1] + 1])
    return total


def ideal_deviation(thread: Thread, samples: Samples | None) -> Curve | None:
    """e over the turn, 0 where the thread proper begins; None without a recording."""
    if samples is None or samples.turn.size < 2:
        return None
    deviation = samples.position - thread.ideal(samples.turn)
    return Curve(samples.turn, deviation - np.interp(_span(thread, samples)[0], samples.turn, deviation))


def error_map(thread: Thread, samples: Samples | None, *, within_turn: bool) -> Map | None:
    """e, about its mean, or w, over angle and turn; whole turns of the thread proper that are recorded."""
    found = _turns(thread, samples)
    if found is None:
        return None
    first, turns = found
    grid = _within(turns) if within_turn else turns[:, :-1] - turns[:, :-1].mean()
    return Map(_fewer_rows(grid), float(first), float(first + len(turns)), -(-len(turns) // MOST_ROWS))


def mean_within_turn(thread: Thread, samples: Samples | None) -> Curve | None:
    """Mean of w over the turns, over the angle in turns (0 to 1): the drunken thread."""
    found = _turns(thread, samples)
    if found is None:
        return None
    mean = _within(found[1]).mean(axis=0)
    return Curve(np.arange(ANGLES + 1) / ANGLES, np.append(mean, mean[0]))


def spectrum(thread: Thread, samples: Samples | None) -> Curve | None:
    """Amplitude [m] of e over the order [1/revolution], by a Hann window over the thread proper."""
    curve = ideal_deviation(thread, samples)
    if curve is None or samples is None:
        return None
    begin, end = _span(thread, samples)
    count = int((end - begin) * _SPECTRUM_POINTS)
    if end - begin < _FEWEST_TURNS:
        return None
    at = begin + np.arange(count) / _SPECTRUM_POINTS
    values = np.interp(at, curve.x, curve.y)
    values = values - np.polyval(np.polyfit(at - begin, values, 1), at - begin)
    window = np.hanning(count)
    amplitude = np.asarray(2.0 * np.abs(np.fft.rfft(values * window)) / window.sum(), dtype=np.float64)
    order = np.asarray(np.fft.rfftfreq(count, 1.0 / _SPECTRUM_POINTS), dtype=np.float64)
    shown = (order > 0.0) & (order <= _HIGHEST_ORDER)
    return Curve(order[shown], amplitude[shown])


def of_the_thread(thread: Thread, curve: Curve) -> FloatArray:
    """The values over the thread proper."""
    first, last = thread.first_and_last
    return np.asarray(curve.y[(curve.x >= first - 1) & (curve.x <= last)])


def decimated(curve: Curve, most: int = MOST_POINTS) -> Curve:
    """At most so many points: of each stretch the least and the greatest, in their order, so that no peak is lost."""
    if curve.x.size <= most:
        return curve
    kept = extremes(curve.y, most // 2)
    return Curve(curve.x[kept], curve.y[kept])


def extremes(values: FloatArray, stretches: int) -> IntArray:
    """Indices of the least and the greatest value of every stretch, rising."""
    bounds = np.linspace(0, values.size, stretches + 1).astype(np.int64)
    found = {0, values.size - 1}
    for low, high in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        if high > low:
            part = values[low:high]
            found |= {low + int(np.argmin(part)), low + int(np.argmax(part))}
    return np.array(sorted(found), dtype=np.int64)


def _turns(thread: Thread, samples: Samples | None) -> tuple[int, FloatArray] | None:
    """(turns before the first, e (turns, angles + 1) m from its beginning to its end) of the whole turns."""
    curve = ideal_deviation(thread, samples)
    if curve is None or samples is None:
        return None
    first, last = _whole(_span(thread, samples))
    if last <= first:
        return None
    values = np.interp(first + np.arange((last - first) * ANGLES + 1) / ANGLES, curve.x, curve.y)
    return first, np.column_stack([values[:-1].reshape(-1, ANGLES), values[ANGLES::ANGLES]])


def _within(turns: FloatArray) -> FloatArray:
    """w (turns, angles) m of e (turns, angles + 1)."""
    share = np.arange(ANGLES) / ANGLES
    return np.asarray(turns[:, :-1] - turns[:, :1] - share * (turns[:, -1:] - turns[:, :1]))


def _span(thread: Thread, samples: Samples) -> tuple[float, float]:
    """Beginning and end of the thread proper in turns, as far as it is recorded."""
    first, last = thread.first_and_last
    return max(first - 1.0, float(samples.turn[0])), min(float(last), float(samples.turn[-1]))


def _whole(span: tuple[float, float]) -> tuple[int, int]:
    near = 1e-6  # of a turn: a recording that ends at the crossing itself
    return int(np.ceil(span[0] - near)), int(np.floor(span[1] + near))


def _fewer_rows(grid: FloatArray) -> FloatArray:
    """(rows, angles): of the turns that share a row the value that is farthest from zero."""
    each = -(-grid.shape[0] // MOST_ROWS)
    if each == 1:
        return grid
    rows = []
    for first in range(0, grid.shape[0], each):
        part = grid[first:first + each]
        rows.append(np.take_along_axis(part, np.abs(part).argmax(axis=0)[np.newaxis], axis=0)[0])
    return np.array(rows)
