"""Crossings of a quantised angle by its edges, with a standard uncertainty for every P(n).

Around every crossing xi is fitted to the angle,

    xi_i = a + b (theta_i - level) + c (theta_i - level)^2 + e_i,     xi(level) = a = sum of w_i xi_i

by least squares over the observations within a sixteenth of a turn. Observations are the samples, with the middle of
their counts as angle. Where there are fewer counts than samples, they are the edges of the counts instead: there the
angle is known, and xi is taken halfway between the samples before and after.

    u^2(a) = d^2 R(w) + g^2 R_g(w) + s^2 sum of v_i^2,     u^2(P) = u^2(a_n) + u^2(a_(n-1))

d is the movement in a count (of samples) or from sample to sample (of edges), g the count of the position, R the
variance of a sum of values that are rounded to whole counts (``rounding``), v the weights of the samples. The phases
in R are those of the smooth motion, a cubic in time; their scatter is the jitter of the instants, for the position
with the noise. Both are found from the whole recording, so that what rounding explains and they add up to what is
seen: the jitter from the residuals of the cubics, the noise s^2 from those of the fits above, divided by the degrees
of freedom less 2 (the variance of Student's t).
A crossing whose residuals are far greater than is usual lies where the feed sets off or stops, in the middle of its
window: there u holds what a parabola misses at a corner, and its residuals tell nothing of the noise of the others.
The windows of two crossings of a start angle have no sample in common.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are loaded when they are used

from threadpitch.pitch.rounding import Rounding, count_of, of_rest, of_sum, waves
from threadpitch.trace import TURN, FloatArray, IntArray

WINDOW = TURN / 16.0  # rad on either side of a crossing; the feed's error is nearly a parabola in there
LEAST = 6  # observations in a window
MOST = 2000  # samples on either side
_EDGES_BELOW = 0.7  # counts per sample, from which on edges tell less than samples
_SMALLEST_ANGLE = 1e-5  # rad, of a count that matters
_SMALLEST_MOVEMENT = 1e-9  # m, likewise
_ANY_ANGLE, _ANY_MOVEMENT = 1e-9, 1e-14  # rad and m, counts of what is not rounded: too small to matter
_UNUSUAL = 20.0  # medians of the mean square of the residuals: the feed's error is no parabola there
_KINK = 2.6  # of the parabola through |x|, -1..1: error at the corner, 3/16, by the rms of its residuals, 0.072
_SINGULAR = 1e-9  # of the largest, a diagonal element of a fit without a solution


@dataclass(frozen=True)
class Counts:
    """What one count of the signals is."""

    angle: float  # rad
    position: float  # m

    @classmethod
    def of(cls, angle: FloatArray, position: FloatArray, resolution: float) -> Counts:
        """As the signals show; ``resolution`` of the angle, rad, 0 = not known."""
        return cls(resolution or count_of(angle, _SMALLEST_ANGLE) or _ANY_ANGLE,
                   count_of(position, _SMALLEST_MOVEMENT) or _ANY_MOVEMENT)


@dataclass(frozen=True, eq=False)
class _Observations:
    """Angles with the samples between which the position belongs to them."""

    angle: FloatArray  # (observations,) rad, from the level
    before: IntArray  # (observations,) sample of the window
    after: IntArray  # (observations,) the same sample, or the next
    edges: bool

    @property
    def place(self) -> FloatArray:
        """(observations,) samples from the first of the window."""
        return self.before + 0.5 * (self.after - self.before).astype(np.float64)

    @property
    def rate(self) -> float:
        """rad from sample to sample, on average; 0 where the angle comes in one step."""
        first, *_, last = self.place
        return float((self.angle[-1] - self.angle[0]) / (last - first)) if last > first else 0.0


@dataclass(frozen=True, eq=False)
class _Smooth:
    """A cubic through values."""

    basis: FloatArray  # (values, 4) orthonormal
    values: FloatArray
    squares: float  # of the residuals


@dataclass(frozen=True, eq=False)
class Crossing:
    """xi at a level, and what its uncertainty and that of the whole recording are made of."""

    position: float  # m
    step: float  # m, movement from sample to sample
    lasts: float  # samples, that one count lasts; 1 for edges, which lie between two samples
    weight: float  # variance of the position by noise of the samples of variance 1
    squares: float  # m2, of the residuals
    freedom: int  # of the fit
    noise_left: float  # expected squares of residuals, for noise of variance 1
    scatter: float  # samples2, squares of what lies beside the smooth motion
    scatter_freedom: int
    by_angle: Rounding  # of the position
    angle_left: Rounding  # of ``squares``
    angle_scatter: Rounding  # of ``scatter``
    by_position: Rounding
    position_left: Rounding

    def row(self) -> FloatArray:
        """All of it as numbers, (NUMBERS,)."""
        scalars = [getattr(self, name) for name in _SCALARS]
        return np.concatenate((scalars, *(getattr(self, name).row() for name in _ROUNDINGS)))


_SCALARS = ("position", "step", "lasts", "weight", "squares", "freedom", "noise_left", "scatter", "scatter_freedom")
_ROUNDINGS = ("by_angle", "angle_left", "angle_scatter", "by_position", "position_left")
NUMBERS = len(_SCALARS) + len(_ROUNDINGS) * Rounding.NUMBERS


@dataclass(frozen=True, eq=False)
class Window:
    """The samples that are kept."""

    angle: FloatArray  # (samples,) rad
    position: FloatArray  # (samples,) m
    rising: FloatArray  # (samples,) rad, greatest angle so far

    def longer(self, angle: FloatArray, position: FloatArray) -> Window:
        """With the next samples."""
        if self.angle.size == 0:
            return Window(angle, position, np.maximum.accumulate(angle))
        rising = np.maximum.accumulate(np.concatenate((self.rising[-1:], angle)))[1:]
        return Window(np.concatenate((self.angle, angle)), np.concatenate((self.position, position)),
                       np.concatenate((self.rising, rising)))

    def since(self, sample: int) -> Window:
        """From a sample on."""
        part = slice(max(sample, 0), None)
        return Window(self.angle[part].copy(), self.position[part].copy(), self.rising[part].copy())

    def reaching(self, level: float) -> int:
        """The first sample that reaches a level; their number if there is none."""
        return int(np.searchsorted(self.rising, level))


def variances_of(rows: FloatArray, counts: Counts) -> FloatArray:
    """u^2(a) of the crossings of one recording, (crossings,) m2, by their rows."""
    def each(name: str) -> FloatArray:
        return rows[:, _SCALARS.index(name)]

    def rounding(name: str) -> Rounding:
        first = len(_SCALARS) + _ROUNDINGS.index(name) * Rounding.NUMBERS
        return Rounding.of_rows(rows[:, first : first + Rounding.NUMBERS])

    lasts, step = each("lasts"), each("step")
    angle_scatter, angle_left, position_left = (
        rounding(name) for name in ("angle_scatter", "angle_left", "position_left"))
    per_angle, per_position = (lasts * step) ** 2, counts.position**2  # m2 of a count
    jitter = _explaining(  # samples2
        float(each("scatter").sum()), float(each("scatter_freedom").sum()),
        lambda variance: float(lasts**2 @ angle_scatter.variance(variance / lasts**2)))
    phases = jitter / lasts**2
    rest = each("squares") / each("freedom")  # m2
    rounded = per_angle * angle_left.variance(phases) + per_position * position_left.variance(
        jitter * step**2 / per_position)
    usual = rest <= _UNUSUAL * (np.median(rest) + rounded / each("freedom"))
    by_angle = float(per_angle[usual] @ angle_left.variance(phases)[usual])
    freedom = each("freedom")[usual].sum()
    noise = _explaining(  # m2
        float(each("squares")[usual].sum() * freedom / (freedom - 2.0)), float(each("noise_left")[usual].sum()),
        lambda variance: by_angle + per_position * float(
            position_left.variance((variance + jitter * step**2) / per_position)[usual].sum()))
    variances: FloatArray = np.where(usual, 0.0, _KINK**2 * rest) + (
        noise * each("weight") + per_angle * rounding("by_angle").variance(phases)
        + per_position * rounding("by_position").variance((noise + jitter * step**2) / per_position))
    return variances


def _explaining(squares: float, freedom: float, by_rounding: Callable[[float], float]) -> float:
    """The variance with which freedom variance + by_rounding(variance) = squares; 0 where rounding explains all."""
    def missing(variance: float) -> float:
        return freedom * variance + by_rounding(variance) - squares

    if missing(0.0) >= 0.0:
        return 0.0
    most = 2.0 * squares / freedom
    return float(scipy.optimize.brentq(missing, 0.0, most, xtol=1e-9 * most, rtol=1e-6))


def crossing_in(window: Window, level: float, counts: Counts) -> Crossing | None:
    """xi at a level (rad); None where there are too few observations around it, or on one side only."""
    middle, first, last = (window.reaching(level + side * WINDOW) for side in (0.0, -1.0, 1.0))
    part = slice(max(first, middle - MOST), min(last, middle + MOST))
    if part.stop - part.start < LEAST:
        return None
    theta, xi = window.angle[part] - level, window.position[part]
    seen = _observed(theta, counts.angle)
    if seen.angle.size < LEAST or seen.rate <= 0.0:
        return None
    if not seen.angle[0] - 0.5 * counts.angle <= 0.0 <= seen.angle[-1]:
        return None
    scale = float(np.abs(seen.angle).max())
    basis, triangle = np.linalg.qr(np.vander(seen.angle / scale, 3, increasing=True))
    size = np.abs(np.diag(triangle))
    if size.min() <= _SINGULAR * size.max():
        return None
    return _weighed(xi, seen, (basis, triangle, scale), counts)


def _observed(theta: FloatArray, count: float) -> _Observations:
    """The samples; or, where there are fewer counts, the edges at which the angle rises above its peak."""
    peak = np.maximum.accumulate(theta)
    if peak[-1] - peak[0] >= _EDGES_BELOW * count * (theta.size - 1):
        every = np.arange(theta.size)
        return _Observations(theta + 0.5 * count, every, every, edges=False)
    rises = np.diff(peak)
    steps = np.flatnonzero(rises > 0.0)
    number = np.maximum(1, np.rint(rises[steps] / count).astype(np.int64))  # edges between two samples
    before = np.repeat(steps, number)
    nth = 1 + np.arange(before.size) - np.repeat(np.cumsum(number) - number, number)
    return _Observations(peak[before] + rises[before] * nth / np.repeat(number, number), before, before + 1, edges=True)


def _weighed(xi: FloatArray, seen: _Observations, fit: tuple[FloatArray, FloatArray, float],
             counts: Counts) -> Crossing:
    """The crossing of a fit: orthonormal basis, its triangle, and the angle of 1 in there, rad."""
    basis, triangle, scale = fit
    origin = float(xi[0])
    position = 0.5 * (xi[seen.before] + xi[seen.after]) - origin
    terms = basis.T @ position
    value, slope, _ = np.linalg.solve(triangle, terms)
    parts = np.linalg.solve(triangle.T, np.array([1.0, 0.0, 0.0]))  # the weights of the observations are basis @ parts
    residuals = position - basis @ terms
    of_samples = np.zeros((xi.size, 3))  # basis of the samples, of which the observations are means
    np.add.at(of_samples, seen.before, 0.5 * basis)
    np.add.at(of_samples, seen.after, 0.5 * basis)
    noise_left = (0.5 if seen.edges else 1.0) * position.size - float(np.sum(of_samples**2))
    weight = float(np.sum((of_samples @ parts) ** 2))

    place, rate = seen.place, seen.rate
    lasts = 1.0 if seen.edges else counts.angle / rate
    motion = _smooth(seen.angle, place) if seen.edges else _smooth(place, seen.angle / rate)
    turning = waves(motion.values / lasts)
    feeding = waves(_smooth(np.arange(xi.size, dtype=np.float64), xi - origin).values / counts.position)
    feeding = 0.5 * (feeding[seen.before] + feeding[seen.after])
    turned, fed = basis.T @ turning, basis.T @ feeding
    size = position.size
    return Crossing(
        position=origin + float(value), step=float(slope) / scale * rate, lasts=lasts, weight=weight,
        squares=float(residuals @ residuals), freedom=size - 3, noise_left=noise_left,
        scatter=motion.squares, scatter_freedom=size - 4,
        by_angle=of_sum(parts, turned, float(parts @ parts)), angle_left=of_rest(turning, turned, size - 3),
        angle_scatter=of_rest(turning, motion.basis.T @ turning, size - 4),
        by_position=of_sum(parts, fed, weight), position_left=of_rest(feeding, fed, noise_left))


def _smooth(at: FloatArray, values: FloatArray) -> _Smooth:
    middle = 0.5 * (at[0] + at[-1])
    basis, _ = np.linalg.qr(np.vander((at - middle) / (at[-1] - middle), 4, increasing=True))
    smooth = basis @ (basis.T @ values)
    return _Smooth(basis, smooth, float(np.sum((values - smooth) ** 2)))
