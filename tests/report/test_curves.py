"""The curves of a report against the formulae that the thread was made by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.report.made import LEAD, made_thread, samples_of, wobble
from threadpitch.pitch import thread_proper
from threadpitch.report import curves
from threadpitch.report.charts import charts
from threadpitch.report.content import Report, ReportError
from threadpitch.report.curves import Curve
from threadpitch.trace import TURN


@pytest.mark.parametrize("back", [False, True])
def test_the_recording_begins_where_the_first_turn_does_and_counts_in_the_direction_of_the_cut(back: bool) -> None:
    thread = made_thread(back=back)
    samples = samples_of(thread)
    at = np.interp(np.arange(41.0), samples.turn, samples.position)
    assert np.diff(at) == pytest.approx(thread.nominal.pitch[0, :40], abs=1e-12)
    assert samples.speed == pytest.approx(500.0 / 60.0 * TURN)


def test_deviation_from_the_ideal_line_is_what_was_put_into_the_thread() -> None:
    thread = made_thread()
    found = curves.ideal_deviation(thread, thread.samples)
    assert found is not None
    assert found.y == pytest.approx(wobble(found.x), abs=1e-12)


def test_cumulative_deviation_ends_where_the_ideal_line_does() -> None:
    thread = made_thread()
    total = curves.cumulative(thread)
    ends = wobble(np.arange(1.0, 41.0)) - wobble(np.zeros(1))
    assert total[0, :40] == pytest.approx(ends, abs=1e-11)


def test_cumulative_deviation_stops_at_a_turn_that_is_missing() -> None:
    thread = made_thread()
    pitch = thread.nominal.pitch.copy()
    pitch[0, 20] = np.nan
    broken = replace(thread, nominal=replace(thread.nominal, pitch=pitch), chosen=thread_proper(pitch))
    total = curves.cumulative(broken)[0]
    assert np.isfinite(total[:20]).all()
    assert np.isnan(total[20:]).all()


def test_the_map_shows_the_drunken_thread_upright_and_the_mean_is_its_wave() -> None:
    thread = made_thread()
    found = curves.error_map(thread, thread.samples, within_turn=True)
    assert found is not None
    assert found.values.shape == (40, curves.ANGLES)
    angle = np.arange(curves.ANGLES) / curves.ANGLES
    assert np.abs(found.values - 2e-6 * np.sin(TURN * angle)).max() < 0.35e-6  # of the slow wave its curvature
    mean = curves.mean_within_turn(thread, thread.samples)
    assert mean is not None
    assert mean.y[:-1] == pytest.approx(2e-6 * np.sin(TURN * angle), abs=0.05e-6)


def test_a_displaced_turn_is_a_row_of_the_map() -> None:
    thread = made_thread()
    samples = samples_of(thread)
    shifted = samples.position + 30e-6 * ((samples.turn >= 17.0) & (samples.turn < 18.0))
    found = curves.error_map(thread, replace(samples, position=shifted), within_turn=False)
    assert found is not None
    assert int(np.argmax(found.values.mean(axis=1))) == 17


def test_the_spectrum_has_the_waves_at_their_orders() -> None:
    thread = made_thread(turns=200)
    found = curves.spectrum(thread, thread.samples)
    assert found is not None
    for order, amplitude in ((1.0, 2e-6), (0.15, 1e-6)):
        near = np.abs(found.x - order) < 0.02
        assert found.y[near].max() == pytest.approx(amplitude, rel=0.02)
    assert found.y[(found.x > 1.1)].max() < 0.01e-6


def test_a_long_map_keeps_its_peaks() -> None:
    thread = made_thread(turns=2 * curves.MOST_ROWS + 1)
    samples = samples_of(thread)
    struck = samples.position + 50e-6 * (np.abs(samples.turn - 555.5) < 0.02)
    found = curves.error_map(thread, replace(samples, position=struck), within_turn=True)
    assert found is not None
    assert found.values.shape[0] <= curves.MOST_ROWS
    assert found.turns_a_row == 3
    assert found.values.max() > 45e-6


@settings(deadline=None)
@given(st.integers(10, 3000), st.integers(0, 2**32 - 1))
def test_thinning_keeps_order_and_extremes(size: int, seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=size)
    found = curves.decimated(Curve(np.arange(size, dtype=np.float64), values), most=100)
    assert found.x.size <= max(size if size <= 100 else 102, 10)
    assert (np.diff(found.x) > 0).all()
    assert (found.y.min(), found.y.max()) == (values.min(), values.max())
    assert found.x[-1] == size - 1


def test_the_thread_proper_leaves_out_the_ends_only() -> None:
    pitch = LEAD + 1e-6 * np.sin(np.arange(60.0))[np.newaxis]
    pitch[0, 0], pitch[0, 30], pitch[0, 59] = 1.2e-3, 1.6e-3, 0.9e-3
    chosen = thread_proper(pitch)
    assert not chosen[0, 0]
    assert not chosen[0, 59]
    assert chosen[0, 1:59].all()


def test_without_a_recording_there_are_no_curves_of_one() -> None:
    thread = replace(made_thread(), samples=None)
    assert curves.ideal_deviation(thread, None) is None
    assert curves.error_map(thread, None, within_turn=True) is None
    assert curves.mean_within_turn(thread, None) is None
    assert curves.spectrum(thread, None) is None


def test_a_steady_thread_does_not_cut_off_the_curves_of_others() -> None:
    uneven, steady = made_thread(), made_thread(turns=400)
    turn = samples_of(steady).turn
    pitch = LEAD + 1e-9 * np.sin(np.arange(steady.nominal.pitch.size)).reshape(steady.nominal.pitch.shape)
    steady = replace(steady, samples=replace(samples_of(steady), position=LEAD * turn + 1e-9 * np.sin(turn)),
                     nominal=replace(steady.nominal, pitch=pitch), chosen=thread_proper(pitch))
    report = Report("both", (uneven, steady))
    figures = {chart.name: chart.figure for chart in charts(report)}
    ideal = curves.ideal_deviation(uneven, uneven.samples)
    assert ideal is not None
    for name, values in (("cumulative", curves.cumulative(uneven)), ("ideal", ideal.y)):
        figure = figures[name]
        assert figure is not None
        assert figure.y_range.start < 1e6 * np.nanmin(values), name
        assert figure.y_range.end > 1e6 * np.nanmax(values), name


def test_a_report_needs_a_thread() -> None:
    with pytest.raises(ReportError, match="no thread"):
        Report("empty", ())
