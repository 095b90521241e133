"""Shewhart's control charts of the mean and the spread of P(n) over parts.

    centre = weighted mean of the means          s_bar = sqrt(sum (n - 1) s^2 / sum (n - 1))      n turns of a part
    within:   mean +- 3 s_bar / sqrt(n),   spread c4 s_bar +- 3 s_bar sqrt(1 - c4^2)              X-bar and s chart
    between:  mean +- 3 MR_bar / d2,       spread of neighbouring parts 0 to D4 MR_bar            X and MR chart
    c4(n) = sqrt(2 / (n - 1)) Gamma(n / 2) / Gamma((n - 1) / 2),   d2 = 2 / sqrt(pi),   D4 = 1 + 3 d3 / d2 for pairs

``within`` asks whether parts differ by more than their turns do, ``between`` whether one part differs from the others
by more than neighbours do. Source: ISO 7870-2:2023; W. A. Shewhart, Economic Control of Quality (1931).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from threadpitch.trace import FloatArray

WITHIN, BETWEEN = "within", "between"
PAIR_MEAN = 2.0 / math.sqrt(math.pi)  # d2: mean range of two values, in their standard deviation
PAIR_SPREAD = math.sqrt(2.0 - 4.0 / math.pi)  # d3: standard deviation of that range
FEWEST_PARTS = 2
_SIGMAS = 3.0


class ControlChartError(ValueError):
    """No control chart can be made of these parts: why, and how to mend it."""


@dataclass(frozen=True)
class Part:
    """Pitches of one part."""

    name: str
    turns: int
    mean: float  # m
    spread: float  # m, standard deviation of one turn; NaN below two turns


@dataclass(frozen=True, eq=False)
class Chart:
    """Values of the parts with centre and limits; NaN where there is none."""

    values: FloatArray  # (parts,) m
    centre: FloatArray  # (parts,) m
    lower: FloatArray  # (parts,) m
    upper: FloatArray  # (parts,) m

    @property
    def outside(self) -> list[int]:
        """Parts beyond a limit, from 0."""
        with np.errstate(invalid="ignore"):
            return np.flatnonzero((self.values > self.upper) | (self.values < self.lower)).tolist()


@dataclass(frozen=True, eq=False)
class ControlCharts:
    """The chart of the mean, and that of the spread."""

    parts: tuple[Part, ...]
    limits: str  # within | between
    mean: Chart
    spread: Chart


def c4(turns: int) -> float:
    """Mean of the standard deviation of so many normal values, in theirs."""
    return math.sqrt(2.0 / (turns - 1)) * math.exp(math.lgamma(turns / 2.0) - math.lgamma((turns - 1) / 2.0))


def control_charts(parts: Sequence[Part], limits: str = WITHIN) -> ControlCharts:
    """Charts of parts in the order in which they were made.

    Raises:
        ControlChartError: fewer than two parts with two turns, or limits of no known kind.
    """
    if limits not in (WITHIN, BETWEEN):
        raise ControlChartError(f"limits {limits!r} are not known; choose {WITHIN} or {BETWEEN}")
    known = tuple(part for part in parts if part.turns >= 2 and math.isfinite(part.mean) and math.isfinite(part.spread))
    if len(known) < FEWEST_PARTS:
        raise ControlChartError(f"{len(known)} parts with two turns or more; a control chart needs {FEWEST_PARTS}")
    make = _within if limits == WITHIN else _between
    return ControlCharts(known, limits, *make(known))


def _within(parts: Sequence[Part]) -> tuple[Chart, Chart]:
    """X-bar and s, with limits by the number of turns of every part."""
    turns = np.array([part.turns for part in parts], dtype=np.float64)
    means, spreads = _columns(parts)
    pooled = math.sqrt(float(np.sum((turns - 1.0) * spreads**2) / np.sum(turns - 1.0)))
    centre = np.full(means.shape, float(np.average(means, weights=turns)))
    wide = _SIGMAS * pooled / np.sqrt(turns)
    share = np.array([c4(part.turns) for part in parts])
    swing = _SIGMAS * pooled * np.sqrt(1.0 - share**2)
    return (Chart(means, centre, centre - wide, centre + wide),
            Chart(spreads, share * pooled, np.maximum(share * pooled - swing, 0.0), share * pooled + swing))


def _between(parts: Sequence[Part]) -> tuple[Chart, Chart]:
    """X and moving range."""
    means, _ = _columns(parts)
    ranges = np.concatenate(([np.nan], np.abs(np.diff(means))))
    typical = float(np.nanmean(ranges))
    centre, middle = np.full(means.shape, float(means.mean())), np.full(means.shape, typical)
    wide = _SIGMAS * typical / PAIR_MEAN
    return (Chart(means, centre, centre - wide, centre + wide),
            Chart(ranges, middle, np.zeros(means.shape), middle * (1.0 + _SIGMAS * PAIR_SPREAD / PAIR_MEAN)))


def _columns(parts: Sequence[Part]) -> tuple[FloatArray, FloatArray]:
    return np.array([part.mean for part in parts]), np.array([part.spread for part in parts])
