"""Crossings by the edges of counts with an honest uncertainty; positions stored at an interval."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.benchmarks.bench_edges import by_class, outcome, share
from tests.synthetic_logs import LEAD
from threadpitch.pitch import PitchError, PitchStream, edge_pitch_table, thread_pitch
from threadpitch.pitch.stored import grid, stored
from threadpitch.trace import TURN, Trace


def test_the_stated_interval_holds_the_truth_in_95_percent_of_the_turns_of_every_class() -> None:
    found = by_class([outcome(seed) for seed in range(1000)])
    of_all = found.pop(("all", 0.0))
    inside, _ = share(of_all)
    error, linear = (np.concatenate([getattr(one, name) for one in of_all]) for name in ("error", "linear"))
    gain = np.sqrt(np.mean(linear**2) / np.mean(error**2))
    print(f"\n{error.size} turns: {100.0 * inside:.1f} % inside; error 1/{gain:.1f} of linear crossings")
    assert 0.94 <= inside <= 0.96
    assert gain > 1.5
    for name, of_class in found.items():
        inside, deviation = share(of_class)  # of few logs the share itself is uncertain
        assert 0.93 - deviation <= inside <= 0.97 + deviation, f"{name}: {inside:.3f} +- {deviation:.3f}"


@pytest.mark.parametrize("per_sample", [0.4, 0.55, 0.69, 0.71, 0.85])
def test_windows_of_edges_and_of_samples_give_the_same_crossing(per_sample: float) -> None:
    """Of an uneven speed some windows hold more counts than others; both know where the counts lie."""
    counts = 360.0
    turns = np.arange(0.0, 8.0, per_sample / counts)
    revs = 0.1 + turns + 0.02 * np.sin(TURN * 0.7 * turns)
    angle = TURN * np.floor(revs * counts) / counts
    table = edge_pitch_table(Trace(angle, LEAD * revs, resolution=TURN / counts))
    assert table.uncertainty is not None
    error = table.crossings[0] - LEAD * np.arange(table.crossings.shape[1])
    assert np.nanmax(abs(error)) < 0.25 * LEAD / counts  # half a count lay between them otherwise
    assert (abs(np.diff(error)) <= 3.0 * table.uncertainty[0])[~np.isnan(np.diff(error))].all()


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), counts=st.sampled_from([0.0, 48.0, 100.0, 5000.0]))
def test_any_motion_gives_a_table_or_a_clear_refusal(seed: int, counts: float) -> None:
    """Standing still, jumps of many counts, a feed that stands: no warning, no uncertainty without its pitch."""
    random = np.random.default_rng(seed)
    steps = random.choice([0.0, 0.0, 0.001, 0.01, 0.3], random.integers(50, 800)) * random.uniform(0.5, 1.5)
    revs = np.cumsum(steps)
    position = LEAD * revs * random.choice([0.0, 1.0]) + random.choice([0.0, 1e-6]) * random.normal(size=revs.size)
    try:
        trace = Trace(TURN * (np.floor(revs * counts) / counts if counts else revs), position)
        table = edge_pitch_table(trace, (0.0, 1.0))
    except PitchError:
        return
    assert table.uncertainty is not None
    np.testing.assert_array_equal(np.isnan(table.pitch), np.isnan(table.uncertainty))
    assert (table.uncertainty[~np.isnan(table.uncertainty)] >= 0.0).all()


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
