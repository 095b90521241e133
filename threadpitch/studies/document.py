"""What a study shows as one JSON document, in the units that people read it in; ``--json``, file, store and report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from threadpitch.studies.analysis import ALL, CONFIDENCE, Analysis, Indices, Interval, Response, YieldResponse
from threadpitch.studies.definition import Study
from threadpitch.studies.shown_units import Units, shown, shown_width


def analysis_document(study: Study, found: Analysis, units: Units) -> dict[str, Any]:
    """Every value beside its ``unit``; null for what is not known or infinite. Shares are numbers from 0 to 1."""
    return {
        "name": study.name, "design": study.design.kind, "seed": study.design.seed, "rows": found.rows,
        "failed": found.failed, "confidence": CONFIDENCE,
        "parameters": {name: {"unit": units.get(name)} for name in study.columns},
        "outcomes": {name: _outcome(name, study, found, units) for name in study.outcomes
                     if name in found.outcomes or name in found.infinite or name in found.words},
        "yields": {name: _interval(one) for name, one in found.yields.items()},
        "yield_responses": [_yield_response(one, units) for one in found.yield_responses],
        "responses": [_response(one, units) for one in found.responses],
        "sobol_indices": [_indices(one) for one in found.indices],
    }


def values_document(parameters: Mapping[str, Any], outcomes: Mapping[str, Any], units: Units) -> dict[str, Any]:
    """Parameters and outcomes of one row: the value as people read it, its unit, and the value in SI to the bit."""
    def told(values: Mapping[str, Any]) -> dict[str, Any]:
        return {name: {"value": _value(value, units.get(name)), "unit": units.get(name), "si": _exact(value)}
                for name, value in values.items()}

    return {"parameters": told(parameters), "outcomes": told(outcomes)}


def _outcome(name: str, study: Study, found: Analysis, units: Units) -> dict[str, Any]:
    if name in found.words:
        return {"expression": study.outcomes[name].text, "words": dict(found.words[name])}
    unit = units.get(name)
    least, mean, greatest = found.outcomes.get(name, (math.nan, math.nan, math.nan))
    limit = study.limits.get(name)
    return {"expression": study.outcomes[name].text, "unit": unit, "min": _value(least, unit),
            "mean": _value(mean, unit), "max": _value(greatest, unit),
            "limit": None if limit is None else _value(limit, unit), "infinite": found.infinite.get(name, 0)}


def _yield_response(one: YieldResponse, units: Units) -> dict[str, Any]:
    unit = units.get(one.parameter)
    return {"parameter": one.parameter, "unit": unit, "places": _values(one.places, unit),
            "ends": [_values(ends, unit) for ends in one.ends], "rows": list(one.rows),
            "yields": [_interval(share) for share in one.yields], "of": ALL}


def _response(one: Response, units: Units) -> dict[str, Any]:
    unit = units.get(one.outcome)
    return {"outcome": one.outcome, "parameter": one.parameter,
            "places": _values(one.places, units.get(one.parameter)), "mean": _values(one.mean.tolist(), unit),
            "spread": [shown_width(value, unit) for value in one.spread.tolist()], "share": _plain(one.share),
            "rank_correlation": _plain(one.rank)}


def _indices(one: Indices) -> dict[str, Any]:
    return {"outcome": one.outcome, "parameters": {
        name: {"first": _interval(first), "total": _interval(total)}
        for name, first, total in zip(one.parameters, one.first, one.total, strict=True)}}


def _interval(one: Interval) -> dict[str, Any]:
    return {"value": _plain(one.value), "low": _plain(one.low), "high": _plain(one.high)}


def _values(values: Sequence[Any], unit: str | None) -> list[Any]:
    return [_value(value, unit) for value in values]


def _value(value: Any, unit: str | None) -> Any:
    return _plain(shown(value, unit)) if isinstance(value, float) else value


def _exact(value: Any) -> Any:
    return _plain(value) if isinstance(value, float) else value


def _plain(value: float) -> float | None:
    return value if math.isfinite(value) else None
