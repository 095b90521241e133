"""sin, cos, exp and log of the models against the correctly rounded values of the C library."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from threadpitch.fmu import elementary


def units_in_the_last_place(found: float, expected: float) -> float:
    return abs(found - expected) / math.ulp(expected) if expected else abs(found) / math.ulp(1.0)


@pytest.mark.parametrize(("function", "reference", "least", "greatest", "bound"), [
    (elementary.sin, math.sin, -1.0, 1.0, 1.0), (elementary.sin, math.sin, -1e6, 1e6, 2.0),
    (elementary.cos, math.cos, -1.0, 1.0, 1.0), (elementary.cos, math.cos, -1e6, 1e6, 2.0),
    (elementary.exp, math.exp, -1.0, 1.0, 1.0), (elementary.exp, math.exp, -700.0, 709.0, 1.0),
    (elementary.log, math.log, 0.5, 2.0, 2.0), (elementary.log, math.log, 1e-300, 1e300, 1.0),
])
def test_error_in_units_of_the_last_place(function: Callable[[float], float], reference: Callable[[float], float],
                                          least: float, greatest: float, bound: float) -> None:
    @settings(deadline=None, max_examples=2000)
    @given(st.floats(least, greatest))
    def check(x: float) -> None:
        assert units_in_the_last_place(function(x), reference(x)) <= bound or abs(function(x) - reference(x)) < 1e-300

    check()


def test_what_is_out_of_range_stays_finite() -> None:
    """In C an infinity or a NaN would go on silently, in Python floor() would raise: neither may happen."""
    for x in (math.inf, -math.inf, math.nan, 1e300, -1e300, 0.0, -1.0):
        for function in (elementary.sin, elementary.cos, elementary.exp):
            assert math.isfinite(function(x))
    assert [elementary.log(x) for x in (0.0, -1.0)] == [-745.0, -745.0]
    assert elementary.exp(-800.0) == 0.0
