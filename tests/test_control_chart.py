"""Shewhart's limits against the printed constants and against what they promise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from threadpitch.control_chart import (
    BETWEEN,
    PAIR_MEAN,
    PAIR_SPREAD,
    WITHIN,
    ControlChartError,
    Part,
    c4,
    control_charts,
)


def parts(means: list[float], spread: float = 1e-6, turns: int = 5) -> list[Part]:
    return [Part(f"part {number}", turns, mean, spread) for number, mean in enumerate(means)]


@pytest.mark.parametrize(("turns", "printed"), [(2, 0.7979), (5, 0.9400), (10, 0.9727), (25, 0.9896)])
def test_c4_is_that_of_the_tables(turns: int, printed: float) -> None:
    """ISO 7870-2, table of factors."""
    assert c4(turns) == pytest.approx(printed, abs=5e-5)


def test_limits_within_are_those_of_the_tables() -> None:
    """A3 = 3 / (c4 sqrt n) = 1.427, B3 = 0, B4 = 2.089 for n = 5; s_bar of equal spreads is their c4-th part."""
    found = control_charts(parts([1.5e-3, 1.5e-3]))
    sigma = 1e-6
    assert found.mean.upper[0] - 1.5e-3 == pytest.approx(1.427 * c4(5) * sigma, rel=1e-3)
    assert found.spread.upper[0] == pytest.approx(2.089 * c4(5) * sigma, rel=1e-3)
    assert found.spread.lower[0] == 0.0


def test_limits_between_are_those_of_the_tables() -> None:
    """E2 = 3 / d2 = 2.660, D4 = 3.267 for moving ranges of two."""
    e2, d4 = 3.0 / PAIR_MEAN, 1.0 + 3.0 * PAIR_SPREAD / PAIR_MEAN
    assert [e2, d4] == pytest.approx([2.660, 3.267], abs=2e-3)  # the tables round d2 to 1.128
    found = control_charts(parts([1.0, 3.0, 1.0, 3.0]), BETWEEN)
    assert found.mean.centre[0] == 2.0
    assert found.mean.upper[0] == pytest.approx(2.0 + 2.660 * 2.0, abs=4e-3)
    assert math.isnan(found.spread.values[0])
    assert found.spread.upper[1] == pytest.approx(3.267 * 2.0, abs=4e-3)


def test_parts_of_unequal_length_have_limits_of_their_own() -> None:
    found = control_charts([Part("a", 4, 1.0, 0.1), Part("b", 64, 1.0, 0.1)])
    wide, narrow = (found.mean.upper - found.mean.centre).tolist()
    assert wide == pytest.approx(4.0 * narrow)
    assert found.spread.centre[1] > found.spread.centre[0]


def test_about_three_in_a_thousand_parts_in_control_are_beyond_the_limits_and_a_shifted_one_is() -> None:
    rng = np.random.default_rng(8)
    turns = rng.normal(1.5e-3, 1e-6, (4000, 20))
    made = [Part(f"{number}", 20, float(row.mean()), float(row.std(ddof=1))) for number, row in enumerate(turns)]
    found = control_charts(made)
    assert 2 <= len(found.mean.outside) <= 25
    shifted = [*made[:100], Part("shifted", 20, 1.5e-3 + 2e-6, 1e-6)]
    assert 100 in control_charts(shifted).mean.outside
    restless = [*made[:100], Part("restless", 20, 1.5e-3, 3e-6)]
    assert control_charts(restless, WITHIN).spread.outside[-1] == 100


def test_too_few_parts_and_other_limits_are_refused() -> None:
    with pytest.raises(ControlChartError, match="1 parts with two turns or more; a control chart needs 2"):
        control_charts([*parts([1.0]), Part("short", 1, 1.0, math.nan)])
    with pytest.raises(ControlChartError, match="limits 'sigma' are not known; choose within or between"):
        control_charts(parts([1.0, 2.0]), "sigma")
