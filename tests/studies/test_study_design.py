"""Designs: the rows that were asked for, their distributions and correlations, the same for the same seed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from threadpitch.studies import Study, StudyError, study_of
from threadpitch.studies.design import row_seed


def made(parameters: dict[str, Any], **about: Any) -> Study:
    correlations = about.pop("correlations", [])
    return study_of({"study": {"system": "none", **about}, "parameters": parameters, "correlations": correlations,
                     "outcomes": {"sum": "+".join(parameters)}})


def drawn(study: Study) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array([list(row.values()) for row in study.rows], np.float64)


def test_a_grid_has_every_combination() -> None:
    study = made({"a": [1, 2], "b": {"from": "0mm", "to": "10mm", "count": 3},
                  "c": {"distribution": "norm", "levels": 3}}, design="grid")
    assert len(study.rows) == 18
    assert {row["b"] for row in study.rows} == {0.0, 0.005, 0.01}
    assert sorted({row["c"] for row in study.rows}) == pytest.approx(stats.norm.ppf([1 / 6, 0.5, 5 / 6]))


def test_one_at_a_time_leaves_the_others_in_the_middle() -> None:
    study = made({"a": [1, 2, 3], "b": {"from": 0, "to": 10}}, design="one_at_a_time")
    assert study.rows[0] == {"a": 2.0, "b": 5.0}
    assert len(study.rows) == study.design.count(study.parameters) == 1 + 2 + 4
    assert all(row["a"] == 2.0 or row["b"] == 5.0 for row in study.rows)


@pytest.mark.parametrize("design", ["latin_hypercube", "sobol", "random"])
def test_drawn_rows_have_their_distributions(design: str) -> None:
    study = made({"a": {"distribution": "norm", "loc": "10mm", "scale": "1mm"},
                  "b": {"from": 1, "to": 100, "log": True}, "c": {"distribution": "randint", "low": 1, "high": 4}},
                 design=design, samples=512, seed=3)
    a, b, c = drawn(study).T
    assert stats.kstest(a, stats.norm(0.01, 0.001).cdf).pvalue > 0.01
    assert stats.kstest(b, stats.loguniform(1, 100).cdf).pvalue > 0.01
    assert set(c) == {1.0, 2.0, 3.0}
    if design == "latin_hypercube":
        places = np.sort(stats.norm(0.01, 0.001).cdf(a)) * 512
        assert np.array_equal(places.astype(int), np.arange(512))  # one in each of 512 equal parts


def test_correlations_are_those_of_the_normal_scores() -> None:
    study = made({"a": {"distribution": "norm"}, "b": {"distribution": "norm", "loc": 5}, "c": {"from": 0, "to": 1}},
                 design="sobol", samples=1024, seed=1,
                 correlations=[{"between": ["a", "b"], "value": 0.8}, {"between": ["c", "b"], "value": -0.3}])
    found = np.corrcoef(np.stack([drawn(study)[:, 0], drawn(study)[:, 1], stats.norm.ppf(drawn(study)[:, 2])]))
    assert found[0, 1] == pytest.approx(0.8, abs=0.03)
    assert found[1, 2] == pytest.approx(-0.3, abs=0.03)
    assert found[0, 2] == pytest.approx(0.0, abs=0.03)


@pytest.mark.parametrize("design", ["latin_hypercube", "sobol", "random", "sensitivity"])
def test_equal_seeds_draw_equal_rows(design: str) -> None:
    parameters = {"a": {"from": 0, "to": 1}, "b": {"distribution": "gamma", "a": 2}}
    one, same, other = (made(parameters, design=design, samples=16, seed=seed) for seed in (5, 5, 6))
    assert np.array_equal(drawn(one), drawn(same))
    assert one.digest == same.digest != other.digest
    assert not np.array_equal(drawn(one), drawn(other))


def test_a_sensitivity_design_exchanges_one_column_at_a_time() -> None:
    study = made({name: {"from": 0, "to": 1} for name in "abc"}, design="sensitivity", samples=8)
    rows = drawn(study).reshape(5, 8, 3)
    for column in range(3):
        assert np.array_equal(rows[2 + column][:, column], rows[1][:, column])
        others = [other for other in range(3) if other != column]
        assert np.array_equal(rows[2 + column][:, others], rows[0][:, others])


def test_seeds_of_rows_stay_whatever_else_is_computed() -> None:
    study = made({"a": [1, 2, 3]}, design="grid", seed=7, noise_seeds=["n"])
    assert [row["n"] for row in study.rows] == [float(row_seed(7, row)) for row in range(3)]
    assert len({row["n"] for row in study.rows}) == 3


@pytest.mark.parametrize(("parameters", "about", "why"), [
    ({"a": {"distribution": "normal"}}, {}, "did you mean norm"),
    ({"a": {"distribution": "norm", "scale": -1}}, {}, "does not exist"),
    ({"a": {"distribution": "gamma"}}, {}, "needs 'a'"),
    ({"a": {"distribution": "norm", "width": 1}}, {}, "takes loc, scale"),
    ({"a": {"from": 2, "to": 1}}, {}, "less than 'to'"),
    ({"a": {"from": 0, "to": 1, "log": True}}, {}, "positive"),
    ({"a": [1, "x"]}, {}, "mixes"),
    ({"a": [1, 1]}, {}, "twice"),
    ({"a": []}, {}, "no values"),
    ({"a": ["1 foo"]}, {}, "unit 'foo' is not known"),
    ({"a": 3}, {}, "write a list"),
    ({}, {}, "is empty"),
    ({"a": [1]}, {"design": "gird"}, "did you mean grid"),
    ({"a": [1]}, {"design": "grid", "samples": 4}, "takes all levels"),
    ({"a": [1]}, {"design": "sobol"}, "needs 'samples'"),
    ({"a": [1]}, {"design": "sobol", "samples": 100}, "such as 128"),
    ({"a": [1]}, {"design": "random", "samples": -1}, "no whole number"),
    ({"a": [1]}, {"nonsense": 1}, "'nonsense' is not known"),
    ({"a": [1]}, {"noise_seeds": ["a"]}, "stands twice"),
    ({"sin": [1]}, {}, "a meaning of its own"),
    ({"a": {"from": 0, "to": 1}, "b": {"from": 0, "to": 1}},
     {"design": "random", "samples": 4, "correlations": [{"between": ["a", "c"], "value": 0.5}]}, "no parameter 'c'"),
    ({"a": {"from": 0, "to": 1}, "b": {"from": 0, "to": 1}},
     {"design": "random", "samples": 4, "correlations": [{"between": ["a", "b"], "value": 1.5}]}, "between -1 and 1"),
    ({"a": {"from": 0, "to": 1}, "b": {"from": 0, "to": 1}, "c": {"from": 0, "to": 1}},
     {"design": "random", "samples": 4, "correlations": [
         {"between": ["a", "b"], "value": 0.9}, {"between": ["b", "c"], "value": 0.9},
         {"between": ["a", "c"], "value": -0.9}]}, "contradict each other"),
])
def test_what_makes_no_design_is_refused(parameters: dict[str, Any], about: dict[str, Any], why: str) -> None:
    with pytest.raises(StudyError, match=why):
        made(parameters, **about)
