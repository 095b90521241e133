"""Indices, effects and yields against what is known of functions: Ishigami's, and dP = F dN / (60 Kv)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from threadpitch.studies import Indices, Place, StudyResult, study
from threadpitch.studies.analysis import clopper_pearson

HERE = Place(workers=0)
A, B = 7.0, 0.1


def made(path: Path, parameters: dict[str, Any], outcomes: dict[str, str], **tables: Any) -> StudyResult:
    limits = tables.pop("limits", {})
    return study({"study": {"system": "none", **tables}, "parameters": parameters, "outcomes": outcomes,
                  "limits": limits}, output=path, place=HERE)


def assert_within(found: Indices, first: tuple[float, ...], total: tuple[float, ...]) -> None:
    for intervals, expected in ((found.first, first), (found.total, total)):
        for interval, value in zip(intervals, expected, strict=True):
            assert interval.low <= value <= interval.high, (interval, value)
            assert interval.high - interval.low < 0.12


def test_sobol_indices_of_ishigami(tmp_path: Path) -> None:
    """Ishigami and Homma (1990): f = sin x1 + a sin^2 x2 + b x3^4 sin x1, x uniform in (-pi, pi)."""
    result = made(tmp_path, {name: {"from": -math.pi, "to": math.pi} for name in ("x1", "x2", "x3")},
                  {"f": f"sin(x1) + {A} * sin(x2) ** 2 + {B} * x3 ** 4 * sin(x1)"},
                  design="sensitivity", samples=2048, seed=2)
    first = 0.5 * (1.0 + B * math.pi**4 / 5.0) ** 2
    second, both = A * A / 8.0, B * B * math.pi**8 * 8.0 / 225.0
    whole = first + second + both
    assert_within(result.analysis.indices[0], (first / whole, second / whole, 0.0),
                  ((first + both) / whole, second / whole, both / whole))


def test_sobol_indices_of_the_pitch_error_of_a_speed_change(tmp_path: Path) -> None:
    """dP = F dN / (60 Kv), a product of independent factors:

    V = prod(1 + c_i^2) - 1 of the mean squared,  S_i V = c_i^2,  T_i V = c_i^2 prod_(j != i)(1 + c_j^2),
    c the coefficient of variation; of 1 / Kv, Kv uniform in (p, q): E = ln(q / p) / (q - p), E^2 = 1 / (p q)
    """
    result = made(tmp_path, {"lead": {"from": "1mm", "to": "3mm"}, "speed_change": {"from": 5, "to": 25},
                             "gain": {"from": 30, "to": 80}},
                  {"error": "lead * speed_change / (60 * gain)"}, design="sensitivity", samples=2048, seed=1)
    mean = math.log(80.0 / 30.0) / 50.0
    squares = np.array([2.0**2 / 12.0 / 2.0**2, 20.0**2 / 12.0 / 15.0**2, 1.0 / (80.0 * 30.0) / mean**2 - 1.0])
    whole = float(np.prod(1.0 + squares) - 1.0)
    total = squares * np.prod(1.0 + squares) / (1.0 + squares)
    assert_within(result.analysis.indices[0], tuple(squares / whole), tuple(total / whole))


def test_the_interval_of_a_yield_holds_the_truth_as_often_as_it_says() -> None:
    truth, rows = 0.9, 200
    chances = stats.binom(rows, truth)
    covered = sum(float(chances.pmf(good)) for good in range(rows + 1)
                  if clopper_pearson(good, rows).low <= truth <= clopper_pearson(good, rows).high)
    assert 0.95 <= covered < 0.98
    assert clopper_pearson(rows, rows).low == pytest.approx(0.025 ** (1.0 / rows))


def test_the_yield_of_a_normal_outcome(tmp_path: Path) -> None:
    result = made(tmp_path, {"a": {"distribution": "norm"}, "b": {"distribution": "norm"}}, {"x": "a", "y": "b"},
                  design="random", samples=2000, seed=1, limits={"x": 1.0, "y": 2.0})
    within_one, within_two = 0.6827, 0.9545
    for name, expected in (("x", within_one), ("y", within_two), ("all", within_one * within_two)):
        found = result.analysis.yields[name]
        assert found.low <= expected <= found.high
        assert found.high - found.low < 0.05


def test_main_effects_of_a_sum(tmp_path: Path) -> None:
    result = made(tmp_path, {"a": [0, 1, 2], "b": [0, 10], "c": ["one", "other"]}, {"y": "a - b", "word": "c"},
                  design="grid")
    found = {one.parameter: one for one in result.analysis.responses}
    variance = 2.0 / 3.0 + 25.0
    assert found["a"].share == pytest.approx(2.0 / 3.0 / variance)
    assert found["b"].share == pytest.approx(25.0 / variance)
    assert found["c"].share == pytest.approx(0.0)
    assert found["b"].rank < -0.8
    assert math.isnan(found["c"].rank)
    assert found["a"].mean.tolist() == pytest.approx([-5.0, -4.0, -3.0])
    assert set(result.analysis.outcomes) == {"y"}


def test_of_drawn_rows_a_parameter_that_does_nothing_explains_nothing(tmp_path: Path) -> None:
    result = made(tmp_path, {"a": {"from": 0, "to": 1}, "idle": {"from": 0, "to": 1}}, {"y": "a"},
                  design="latin_hypercube", samples=256, seed=1)
    share = {one.parameter: one.share for one in result.analysis.responses}
    assert share["a"] > 0.95
    assert share["idle"] < 0.05
