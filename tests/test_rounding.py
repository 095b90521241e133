"""The variance that rounding gives sums of samples, against sums of rounded values."""

from __future__ import annotations

import numpy as np
import pytest

from threadpitch.pitch.rounding import Rounding, count_of, of_rest, of_sum, waves
from threadpitch.trace import FloatArray

SAMPLES = 30
TRIALS = 4000


def trials(pattern: FloatArray, scatter: float) -> FloatArray:
    """Errors of rounding (TRIALS, samples) counts, of phases with the pattern, a common part and normal scatter."""
    random = np.random.default_rng(1)
    phases = pattern + random.uniform(0.0, 1.0, (TRIALS, 1)) + scatter * random.normal(size=(TRIALS, pattern.size))
    return np.floor(phases) + 0.5 - phases


def basis() -> FloatArray:
    orthonormal, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, SAMPLES), 3, increasing=True))
    return np.asarray(orthonormal, dtype=np.float64)


@pytest.mark.parametrize("scatter", [0.02, 0.05, 0.2, 1.0])
@pytest.mark.parametrize("step", [0.0, 0.01, 1.0 / 3.0, 0.48, 0.617, 16.02])
def test_the_variances_are_those_of_rounded_values(step: float, scatter: float) -> None:
    pattern, parts = step * np.arange(float(SAMPLES)), np.array([0.2, 0.1, -0.05])
    seen, terms = waves(pattern), basis().T @ waves(pattern)
    errors = trials(pattern, scatter)
    sums = errors @ (basis() @ parts)
    rest = np.sum(errors**2, axis=1) - np.sum((errors @ basis()) ** 2, axis=1)
    of_sums = of_sum(parts, terms, float(parts @ parts)).variance(np.array(scatter**2))
    of_rests = of_rest(seen, terms, SAMPLES - 3.0).variance(np.array(scatter**2))
    assert float(of_sums) == pytest.approx(np.mean(sums**2), rel=0.1, abs=0.01 * float(parts @ parts) / 12.0)
    assert float(of_rests) == pytest.approx(np.mean(rest), rel=0.05)


def test_errors_go_together_cancel_or_are_independent() -> None:
    parts = np.sqrt(SAMPLES) * np.array([1.0, 0.0, 0.0]) / SAMPLES  # the mean
    places = np.arange(float(SAMPLES))
    means = [of_sum(parts, basis().T @ waves(step * places), 1.0 / SAMPLES) for step in (7.0, 1.0 / 6.0)]
    both = Rounding.of_rows(np.array([mean.row() for mean in means]))
    together, cancelled = both.variance(np.zeros(2))
    independent = both.variance(np.full(2, 4.0))
    assert together == pytest.approx(1.0 / 12.0, rel=0.06)  # the harmonics above HARMONICS are taken as independent
    assert cancelled < 0.1 / 12.0
    np.testing.assert_allclose(independent, 1.0 / 12.0 / SAMPLES, rtol=1e-12)


def test_nothing_that_goes_together_is_the_variance_of_a_sawtooth() -> None:
    one = Rounding(np.zeros(12), np.array(1.0))
    assert float(one.variance(np.array(9.0))) == pytest.approx(1.0 / 12.0, rel=1e-12)


@pytest.mark.parametrize("count", [0.001, 0.0163, 0.0003835])
def test_the_count_of_rounded_values_is_found(count: float) -> None:
    values = np.cumsum(np.random.default_rng(2).uniform(0.0, 0.08, 3000))
    assert count_of(np.floor(values / count) * count, 1e-5) == pytest.approx(count, rel=1e-9)
    assert count_of(values, 1e-5) == 0.0
    assert count_of(np.full(10, 3.0), 1e-5) == 0.0
