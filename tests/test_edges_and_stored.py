"""Crossings by the edges of counts with an honest uncertainty; positions stored at an interval."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.synthetic_logs import LEAD, log_with_truth
from threadpitch.pitch import PitchError, PitchStream, edge_pitch_table, pitch_table, thread_pitch
from threadpitch.pitch.stored import grid, stored
from threadpitch.trace import TURN, Trace


def test_the_stated_interval_holds_the_truth_in_95_percent_of_the_turns() -> None:
    inside, errors, linear = [], [], []
    for seed in range(1000):
        trace, truth = log_with_truth(seed)
        table = edge_pitch_table(trace)
        assert table.uncertainty is not None
        known = ~np.isnan(table.pitch[0])
        error = table.pitch[0, known] - truth[: known.size][known]
        inside.append(abs(error) <= 1.96 * table.uncertainty[0, known])
        errors.append(error)
        linear.append((pitch_table(trace).pitch[0] - truth[: known.size])[known])
    share = np.concatenate(inside).mean()
    gain = np.sqrt(np.mean(np.concatenate(linear) ** 2) / np.mean(np.concatenate(errors) ** 2))
    count = np.concatenate(inside).size
    print(f"\n{count} turns: {100.0 * share:.1f} % inside; error 1/{gain:.1f} of linear crossings")
    assert 0.93 <= share <= 0.97
    assert gain > 1.5


@pytest.mark.parametrize("counts", [0.0, 4096.0])
def test_an_even_motion_gives_its_lead_within_the_uncertainty(counts: float) -> None:
    revs = np.arange(0.0, 10.0, 1.0 / 317.3)
    angle = TURN * (np.floor(revs * counts) / counts if counts else revs)
    table = edge_pitch_table(Trace(angle, -LEAD * revs))
    assert table.uncertainty is not None
    error = table.pitch[0] - LEAD
    known = ~np.isnan(error)
    assert known.sum() == 9
    assert (abs(error[known]) <= 3.0 * table.uncertainty[0, known] + 1e-15).all()
    assert table.uncertainty[0, known].max() < (1e-7 if counts else 1e-12)


def test_too_few_samples_for_edges_are_refused() -> None:
    revs = np.arange(0.0, 10.0, 0.2)
    with pytest.raises(PitchError, match="too few samples or counts per turn"):
        edge_pitch_table(Trace(TURN * revs, LEAD * revs))


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), interval=st.sampled_from([1.0, 5.0, 10.0, 45.0, 90.0, 7.0, 11.3]))
def test_stored_positions_give_the_pitches_of_the_whole(seed: int, interval: float) -> None:
    random = np.random.default_rng(seed)
    angle = random.uniform(-1.0, 1.0) + np.cumsum(random.uniform(0.001, 0.3, 1000))
    position = np.cumsum(random.normal(3e-5, 1e-5, 1000))
    starts, factor = grid(math.radians(interval))
    stream = PitchStream(starts)
    stream.add(factor * angle, position)
    points = stored(stream.table(), math.radians(interval))
    assert (np.diff(points.angle) > 0.0).all()
    np.testing.assert_allclose(points.angle / math.radians(interval), np.rint(points.angle / math.radians(interval)))
    if factor == 1.0:  # the start angles lie on the grid
        table, whole = points.pitch_table((0.0, starts[-1])), thread_pitch(angle, position, (0.0, starts[-1]))
        both = min(table.pitch.shape[1], whole.pitch.shape[1])
        assert both >= whole.pitch.shape[1] - 1
        np.testing.assert_allclose(table.pitch[:, :both], whole.pitch[:, :both], rtol=0.0, atol=1e-15)
        assert points.pitch_table().notes[-1].startswith(f"P(n) out of positions stored every {interval:g} degrees")


@pytest.mark.parametrize("interval", [0.0, -10.0, 361.0, math.nan])
def test_intervals_that_make_no_sense_are_refused(interval: float) -> None:
    with pytest.raises(PitchError, match=r"the sample interval is .* degrees; give 0\.01 to 360"):
        grid(math.radians(interval))
