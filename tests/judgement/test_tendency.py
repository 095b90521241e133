"""Intervals hold what they say, and the permutation test does not take two smooth curves for related."""

from __future__ import annotations

import math

import numpy as np
import pytest

from threadpitch.judgement import tendency

SIZE = 30
TURNS = np.arange(1.0, SIZE + 1.0)
NOTHING = np.zeros((SIZE, 0))


def test_the_gains_interval_covers_the_gain() -> None:
    covered = 0
    for seed in range(300):
        draw = np.random.default_rng(seed)
        x = np.cumsum(draw.normal(size=SIZE))
        found = tendency.gain(x, 0.8 * x + draw.normal(size=SIZE), NOTHING, (1.0, 0.0))
        assert found is not None
        covered += found[1] <= 0.8 <= found[2]
    assert covered >= 0.92 * 300


def test_jitter_of_the_nominal_values_does_not_lower_the_gain() -> None:
    gains = []
    for seed in range(200):
        draw = np.random.default_rng(seed)
        x = 3.0 * np.sin(0.7 * TURNS)
        found = tendency.gain(x + draw.normal(size=SIZE), x + 0.3 * draw.normal(size=SIZE), NOTHING, (0.09, 1.0))
        assert found is not None
        gains.append(found[0])
    assert np.mean(gains) == pytest.approx(1.0, abs=0.04)  # without the correction 1 / (1 + 1 / 4.5) = 0.82


def test_no_gain_of_what_does_not_fluctuate() -> None:
    assert tendency.gain(0.0 * TURNS, TURNS, NOTHING, (1.0, 0.0)) is None
    assert tendency.correlation(0.0 * TURNS, TURNS) is None
    assert tendency.permutation_p(TURNS, 0.0 * TURNS, TURNS) is None


def test_the_permutation_test_keeps_its_level_for_smooth_curves() -> None:
    """Shuffled turns would call a quarter of these pairs of unrelated waves related."""
    false = 0
    for seed in range(500):
        phases = np.random.default_rng(seed).uniform(0.0, 2.0 * math.pi, 4)
        x, y = (np.sin(2.0 * math.pi * TURNS / SIZE + phases[2 * i]) + np.sin(4.0 * math.pi * TURNS / SIZE
                                                                                + phases[2 * i + 1]) for i in (0, 1))
        p = tendency.permutation_p(TURNS, x, y)
        assert p is not None
        false += p < 0.05
    assert false <= 0.08 * 500


def test_what_belongs_together_passes_the_permutation_test() -> None:
    draw = np.random.default_rng(1)
    x = np.exp(-TURNS / 4.0) + 0.5 * np.sin(1.9 * TURNS)
    p = tendency.permutation_p(TURNS, x, x + 0.1 * draw.normal(size=SIZE))
    assert p is not None
    assert p < 0.005


def test_the_correlations_interval_is_wider_for_curves_that_follow_themselves() -> None:
    draw = np.random.default_rng(2)
    rough = draw.normal(size=(2, SIZE))
    spread = []
    for one, other in (rough, np.cumsum(rough, axis=1)):
        found = tendency.correlation(one, other)
        assert found is not None
        assert found[0] == pytest.approx(float(np.corrcoef(one, other)[0, 1]))
        spread.append(math.atanh(found[2]) - math.atanh(found[1]))
    assert spread[1] > spread[0]


def test_signs_are_compared_as_the_patent_does() -> None:
    nominal, measured = np.array([-1.0, -2.0, -1.0, 3.0, 1.0]), np.array([-2.0, -1.0, -3.0, 1.0, 0.5])
    assert tendency.sign_agreement(nominal, measured) == 1.0
    assert tendency.sign_agreement(nominal, -measured) == 0.0
    assert tendency.sign_agreement(nominal, 0.0 * measured) is None
