"""What a study shows: main effects, Sobol indices with their confidence, and the yield with its interval."""

from __future__ import annotations

import math
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
Columns = Mapping[str, Sequence[Any]]  # of the study's table

CONFIDENCE = 0.95
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
    what chance would explain), ``rank`` Spearman's
    rank correlation; NaN where it has no order. ``places`` are levels, or the means of the parameter in bins.
    """

    outcome: str
    parameter: str
    places: tuple[Any, ...]
    mean: FloatArray  # (places,)
    spread: FloatArray  # (places,)
    share: float
    rank: float


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
    of every limit in ``yields``, and do not count in the rest.
    """

    rows: int
    failed: int
    outcomes: Mapping[str, tuple[float, float, float]]  # least, mean, greatest
    yields: Mapping[str, Interval]
    responses: tuple[Response, ...]
    indices: tuple[Indices, ...]


def analyze(study: Study, columns: Columns) -> Analysis:
    """Look at the rows that are done; ``columns`` are those of the study's table."""
    good = np.array([status == OK for status in columns["status"]], np.bool_)
    numeric = {name: values for name in study.outcomes if (values := _numbers(columns[name])) is not None}
    known = {name: values[good & np.isfinite(values)] for name, values in numeric.items()}
    responses = [_response(study, name, parameter, columns, good & np.isfinite(values))
                 for name, values in numeric.items() for parameter in (one.name for one in study.parameters)
                 if np.count_nonzero(good & np.isfinite(values)) > 1]
    return Analysis(
        rows=good.size, failed=int(np.count_nonzero(~good)),
        outcomes={name: (float(values.min()), float(values.mean()), float(values.max()))
                  for name, values in known.items() if values.size},
        yields=_yields(study, numeric, good), responses=tuple(responses), indices=tuple(_all_indices(study, columns)))


def clopper_pearson(good: int, count: int, confidence: float = CONFIDENCE) -> Interval:
    """k of n with the exact interval of a proportion: P(X >= k | low) = P(X <= k | high) = (1 - confidence) / 2."""
    found = scipy.stats.binomtest(good, count).proportion_ci(confidence, "exact")
    return Interval(good / count, float(found.low), float(found.high))


def _yields(study: Study, numeric: Mapping[str, FloatArray], good: NDArray[np.bool_]) -> dict[str, Interval]:
    """|outcome| <= limit; of designs that are no samples there is a share, but no interval."""
    inside = {name: good & (np.abs(numeric[name]) <= limit) for name, limit in study.limits.items() if name in numeric}
    if not inside or not good.size:
        return {}
    everything = {**inside, "all": np.logical_and.reduce(list(inside.values()))}
    if study.design.kind in (GRID, ONE_AT_A_TIME, SENSITIVITY):
        return {name: Interval(float(np.mean(which)), math.nan, math.nan) for name, which in everything.items()}
    return {name: clopper_pearson(int(np.count_nonzero(which)), which.size) for name, which in everything.items()}


def _numbers(values: Iterable[Any]) -> FloatArray | None:
    """An outcome's numbers and truth values, NaN for none; None for texts."""
    listed = list(values)
    if any(isinstance(value, str) for value in listed):
        return None
    return np.array([math.nan if value is None else float(value) for value in listed])


def _response(study: Study, outcome: str, name: str, columns: Columns, which: NDArray[np.bool_]) -> Response:
    parameter = next(one for one in study.parameters if one.name == name)
    rows = np.flatnonzero(which).tolist()
    results = np.array([float(columns[outcome][row]) for row in rows])
    values = [columns[name][row] for row in rows]
    ordered = all(isinstance(value, float) for value in values)
    if parameter.values or study.design.kind in (GRID, ONE_AT_A_TIME):
        places = [place for place in parameter.levels if place in values]
        if ordered and study.design.kind == ONE_AT_A_TIME:
            places = sorted({*places, *values})
        groups = [np.array([value == place for value in values]) for place in places]
    else:
        edges = np.quantile(np.array(values), np.linspace(0.0, 1.0, BINS + 1)[1:-1])
        bins = np.searchsorted(edges, np.array(values))
        groups = [bins == one for one in range(BINS) if np.any(bins == one)]
        places = [float(np.mean(np.array(values)[group])) for group in groups]
    mean = np.array([results[group].mean() for group in groups])
    spread = np.array([results[group].std() for group in groups])
    weight = np.array([np.count_nonzero(group) for group in groups])
    whole = float(results.var())
    share = float(np.average((mean - results.mean()) ** 2, weights=weight)) / whole if whole > 0.0 else 0.0
    if whole > 0.0 and study.design.kind in DRAWN and results.size > len(groups):
        # epsilon squared: groups drawn at random differ in their means even where the parameter does nothing
        share = max(0.0, 1.0 - (1.0 - share) * (results.size - 1) / (results.size - len(groups)))
    varies = ordered and whole > 0.0 and len(set(values)) > 1
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


def analysis_document(found: Analysis) -> dict[str, Any]:
    """As a JSON document, SI; null for what is not known or infinite."""
    def plain(value: Any) -> Any:
        return None if isinstance(value, float) and not math.isfinite(value) else value

    def interval(one: Interval) -> dict[str, Any]:
        return {"value": plain(one.value), "low": plain(one.low), "high": plain(one.high)}

    return {
        "rows": found.rows, "failed": found.failed, "confidence": CONFIDENCE,
        "outcomes": {name: dict(zip(("min", "mean", "max"), values, strict=True))
                     for name, values in found.outcomes.items()},
        "yields": {name: interval(one) for name, one in found.yields.items()},
        "responses": [{"outcome": one.outcome, "parameter": one.parameter, "places": list(one.places),
                       "mean": one.mean.tolist(), "spread": one.spread.tolist(), "share": one.share,
                       "rank_correlation": plain(one.rank)} for one in found.responses],
        "sobol_indices": [{"outcome": one.outcome, "parameters": {
            name: {"first": interval(first), "total": interval(total)}
            for name, first, total in zip(one.parameters, one.first, one.total, strict=True)}}
            for one in found.indices],
    }
