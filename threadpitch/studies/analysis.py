"""What a study shows: main effects, Sobol indices with their confidence, and the yield with its interval."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # its parts are loaded when they are used
from numpy.typing import NDArray

from threadpitch.studies.definition import Study
from threadpitch.studies.design import DRAWN, GRID, ONE_AT_A_TIME, SENSITIVITY
from threadpitch.studies.evaluation import OK

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Columns = Mapping[str, Sequence[Any]]  # of the study's table

CONFIDENCE = 0.95
ALL = "all"  # limits
BINS = 8  # of a drawn parameter in a response
_RESAMPLES = 999


@dataclass(frozen=True)
class Interval:
    """An estimate with its confidence interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Response:
    """How an outcome goes with a parameter: mean and standard deviation of the rows at each of its places.

    ``share`` is the part of the outcome's variance that the means explain (correlation ratio; of drawn designs less
    what chance would explain; NaN of one at a time), ``rank`` Spearman's rank correlation; NaN where it has no order.
    ``places`` are levels, or the means of the parameter in bins.
    """

    outcome: str
    parameter: str
    places: tuple[Any, ...]
    mean: FloatArray  # (places,)
    spread: FloatArray  # (places,)
    share: float
    rank: float


@dataclass(frozen=True)
class YieldResponse:
    """How the share of rows within every limit goes with a parameter. ``ends`` are the least and the greatest value of
    the parameter in the rows at each place.
    """

    parameter: str
    places: tuple[Any, ...]
    ends: tuple[tuple[Any, Any], ...]
    rows: tuple[int, ...]
    yields: tuple[Interval, ...]


@dataclass(frozen=True)
class Indices:
    """Sobol indices of an outcome: parts of its variance, by parameter."""

    outcome: str
    parameters: tuple[str, ...]
    first: tuple[Interval, ...]  # of the parameter alone
    total: tuple[Interval, ...]  # with all in which it takes part


@dataclass(frozen=True)
class Analysis:
    """``yields`` are the parts of the rows within each limit; "all" within every limit. Rows that failed are outside
    of every limit in ``yields``, and do not count in the rest. ``outcomes`` tells the finite values of numeric ones,
    ``infinite`` how many are not; of texts ``words`` how often each came.
    """

    rows: int
    failed: int
    outcomes: Mapping[str, tuple[float, float, float]]  # least, mean, greatest
    infinite: Mapping[str, int]
    words: Mapping[str, Mapping[str, int]]
    yields: Mapping[str, Interval]
    yield_responses: tuple[YieldResponse, ...]
    responses: tuple[Response, ...]
    indices: tuple[Indices, ...]


def analyze(study: Study, columns: Columns) -> Analysis:
    """Look at the rows that are done; ``columns`` are those of the study's table."""
    good = np.array([status == OK for status in columns["status"]], np.bool_)
    if not good.size:
        return Analysis(0, 0, {}, {}, {}, {}, (), (), ())
    numeric = {name: values for name in study.outcomes if (values := _numbers(columns[name])) is not None}
    known = {name: values[good & np.isfinite(values)] for name, values in numeric.items()}
    responses = [_response(study, name, parameter, columns, good & np.isfinite(values))
                 for name, values in numeric.items() for parameter in (one.name for one in study.parameters)
                 if np.count_nonzero(good & np.isfinite(values)) > 1]
    inside = _inside(study, numeric, good)
    return Analysis(
        rows=good.size, failed=int(np.count_nonzero(~good)),
        outcomes={name: (float(values.min()), float(values.mean()), float(values.max()))
                  for name, values in known.items() if values.size},
        infinite={name: count for name, values in numeric.items() if (count := int(np.isinf(values[good]).sum()))},
        words={name: dict(Counter(str(value) for value in columns[name] if value is not None).most_common())
               for name in study.outcomes if name not in numeric},
        yields={name: _yield(study, which) for name, which in inside.items()},
        yield_responses=tuple(_yield_response(study, one.name, columns, inside[ALL])
                              for one in study.parameters) if inside else (),
        responses=tuple(responses), indices=tuple(_all_indices(study, columns)))


def clopper_pearson(good: int, count: int, confidence: float = CONFIDENCE) -> Interval:
    """k of n with the exact interval of a proportion: P(X >= k | low) = P(X <= k | high) = (1 - confidence) / 2."""
    found = scipy.stats.binomtest(good, count).proportion_ci(confidence, "exact")
    return Interval(good / count, float(found.low), float(found.high))


def _inside(study: Study, numeric: Mapping[str, FloatArray], good: BoolArray) -> dict[str, BoolArray]:
    """Which rows are within each limit, |outcome| <= limit, and ALL within every one; rows that failed are in none."""
    inside = {name: good & (np.abs(numeric[name]) <= limit) for name, limit in study.limits.items() if name in numeric}
    return {**inside, ALL: np.logical_and.reduce(list(inside.values()))} if inside else {}


def _yield(study: Study, which: BoolArray) -> Interval:
    """The share of rows; its interval, but of designs that are no samples."""
    if study.design.kind in (GRID, ONE_AT_A_TIME, SENSITIVITY):
        return Interval(float(np.mean(which)), math.nan, math.nan)
    return clopper_pearson(int(np.count_nonzero(which)), which.size)


def _yield_response(study: Study, name: str, columns: Columns, inside: BoolArray) -> YieldResponse:
    rows = _comparable(study, name, columns)
    values = [columns[name][row] for row in rows.tolist()]
    places, groups = _grouped(study, name, values)
    among = [[value for value, here in zip(values, group, strict=True) if here] for group in groups]
    ends = [(min(group), max(group)) for group in among]
    return YieldResponse(name, tuple(places), tuple(ends), tuple(len(group) for group in among),
                         tuple(_yield(study, inside[rows][group]) for group in groups))


def _comparable(study: Study, name: str, columns: Columns) -> NDArray[np.int64]:
    """The rows that tell of a parameter: all of them; of one at a time those where the others are as in the middle."""
    rows = np.arange(len(columns["status"]))
    if study.design.kind != ONE_AT_A_TIME:
        return rows
    others = [one for one in study.parameters if one.name != name]
    return rows[[all(columns[one.name][row] == one.middle for one in others) for row in rows.tolist()]]


def _grouped(study: Study, name: str, values: Sequence[Any]) -> tuple[list[Any], list[BoolArray]]:
    """The places of a parameter, levels or means in bins, and which of its values belong to each."""
    parameter = next(one for one in study.parameters if one.name == name)
    if parameter.values or study.design.kind in (GRID, ONE_AT_A_TIME):
        places = [place for place in parameter.levels if place in values]
        if study.design.kind == ONE_AT_A_TIME and all(isinstance(value, float) for value in values):
            places = sorted({*places, *values})
        return places, [np.array([value == place for value in values], np.bool_) for place in places]
    numbers = np.array(values)
    bins = np.searchsorted(np.quantile(numbers, np.linspace(0.0, 1.0, BINS + 1)[1:-1]), numbers)
    groups = [bins == one for one in range(BINS) if np.any(bins == one)]
    return [float(numbers[group].mean()) for group in groups], groups


def _numbers(values: Iterable[Any]) -> FloatArray | None:
    """An outcome's numbers and truth values, NaN for none; None for texts."""
    listed = list(values)
    if any(isinstance(value, str) for value in listed):
        return None
    return np.array([math.nan if value is None else float(value) for value in listed])


def _response(study: Study, outcome: str, name: str, columns: Columns, which: BoolArray) -> Response:
    comparable = _comparable(study, name, columns)
    rows = comparable[which[comparable]].tolist()
    results = np.array([float(columns[outcome][row]) for row in rows])
    values = [columns[name][row] for row in rows]
    places, groups = _grouped(study, name, values)
    mean = np.array([results[group].mean() for group in groups])
    spread = np.array([results[group].std() for group in groups])
    weight = np.array([np.count_nonzero(group) for group in groups])
    whole = float(results.var()) if results.size else 0.0
    share = float(np.average((mean - results.mean()) ** 2, weights=weight)) / whole if whole > 0.0 else 0.0
    if whole > 0.0 and study.design.kind in DRAWN and results.size > len(groups):
        # epsilon squared: groups drawn at random differ in their means even where the parameter does nothing
        share = max(0.0, 1.0 - (1.0 - share) * (results.size - 1) / (results.size - len(groups)))
    if study.design.kind == ONE_AT_A_TIME:
        share = math.nan  # of what varies alone it would be all
    varies = all(isinstance(value, float) for value in values) and whole > 0.0 and len(set(values)) > 1
    rank = float(scipy.stats.spearmanr(values, results).statistic) if varies else math.nan
    return Response(outcome, name, tuple(places), mean, spread, share, rank)


def _all_indices(study: Study, columns: Columns) -> Iterable[Indices]:
    """Sobol indices of the outcomes of a Saltelli design that has all its rows, with bootstrap intervals."""
    count, width = study.design.samples, len(study.parameters)
    if study.design.kind != SENSITIVITY or len(columns["status"]) != count * (width + 2):
        return
    for name in study.outcomes:
        values = _numbers(columns[name])
        if values is None or not np.isfinite(values).all() or np.ptp(values) == 0.0:
            continue
        both = values[:2 * count] - values[:2 * count].mean()  # without their mean, estimates scatter less
        rows = np.vstack([both.reshape(2, count), values[2 * count:].reshape(width, count) - values[:2 * count].mean()])
        # not by scipy's own bootstrap of indices: it draws without a seed, and every look would tell another interval
        spread = scipy.stats.bootstrap((np.arange(count),), lambda chosen, rows=rows: _saltelli(rows[:, chosen]),
                                 confidence_level=CONFIDENCE, n_resamples=_RESAMPLES, method="percentile",
                                 vectorized=False, rng=np.random.default_rng(study.design.seed)).confidence_interval
        found = _saltelli(rows)
        low, high = np.asarray(spread.low), np.asarray(spread.high)
        first, total = (tuple(Interval(*(float(ends[order, place]) for ends in (found, low, high)))
                              for place in range(width)) for order in (0, 1))
        yield Indices(name, tuple(one.name for one in study.parameters), first, total)


def _saltelli(rows: FloatArray) -> FloatArray:
    """S_i = mean(f_B (f_ABi - f_A)) / V, T_i = mean((f_A - f_ABi)^2) / (2 V) (Saltelli 2010, table 2, b and f).

    ``rows`` (2 + parameters, samples) are f_A, f_B, then f_ABi; -> (2, parameters).
    """
    first, second, mixed = rows[0], rows[1], rows[2:]
    variance = float(np.var(rows[:2]))
    return np.stack([np.mean(second * (mixed - first), axis=1), 0.5 * np.mean((first - mixed) ** 2, axis=1)]) / variance
