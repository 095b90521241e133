"""Physics and identities of P(n) = xi(theta_S + 360 n) - xi(theta_S + 360 (n - 1))."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from threadpitch.pitch import PitchError, PitchTable, pitch_table, statistics, thread_pitch
from threadpitch.trace import FloatArray, Trace, TraceError

TURN = 2.0 * math.pi
LEAD = 1.5e-3
QUARTERS = tuple(math.radians(angle) for angle in (0.0, 90.0, 180.0, 270.0))


def helix(turns: float, samples_per_turn: float, lead: float = LEAD) -> tuple[FloatArray, FloatArray]:
    """An ideal thread that begins at angle zero."""
    angle = TURN * np.arange(0.0, turns, 1.0 / samples_per_turn)
    return angle, lead * angle / TURN


def plain_interpolation(angle: FloatArray, position: FloatArray, start_angle: float) -> FloatArray:
    """P(n) by numpy, for a rising angle that begins at or before the start angle."""
    turns = math.floor((angle[-1] - start_angle) / TURN)
    return np.diff(np.interp(start_angle + TURN * np.arange(turns + 1), angle, position))


@settings(deadline=None, max_examples=60)
@given(lead=st.floats(1e-4, 1e-2) | st.floats(-1e-2, -1e-4), samples=st.floats(3.0, 700.0), start=st.floats(0.0, TURN))
def test_an_ideal_drive_gives_the_lead_at_every_start_angle(lead: float, samples: float, start: float) -> None:
    angle, position = helix(12.0, samples, lead)
    table = thread_pitch(angle, position, (start,))
    turns = math.floor((angle[-1] - start) / TURN + 1e-9)
    assert table.pitch.shape == (1, turns)
    np.testing.assert_allclose(table.pitch, abs(lead), rtol=0.0, atol=1e-12)


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), start=st.floats(0.0, TURN))
def test_equals_plain_interpolation_of_a_rising_angle(seed: int, start: float) -> None:
    random = np.random.default_rng(seed)
    angle = np.concatenate(([0.0], np.cumsum(random.uniform(1e-3, 2.0, 200))))
    position = np.cumsum(random.normal(3e-5, 1e-5, 201))
    expected = plain_interpolation(angle, position, start)
    direction = math.copysign(1.0, position[-1] - position[0])
    np.testing.assert_allclose(thread_pitch(angle, position, (start,)).pitch[0], direction * expected, atol=1e-15)


@settings(deadline=None, max_examples=40)
@given(lag=st.floats(-1.0, 1.0), turned=st.integers(-50, 50))
def test_a_constant_lag_and_another_zero_of_the_angle_are_no_pitch_error(lag: float, turned: int) -> None:
    angle, position = helix(8.0, 36.5)
    wobbling = position + 2e-6 * np.sin(0.3 * angle)
    shifted = thread_pitch(angle + turned * TURN, wobbling + lag, turned * TURN + np.array(QUARTERS))
    np.testing.assert_allclose(shifted.pitch, thread_pitch(angle, wobbling, QUARTERS).pitch, rtol=0.0, atol=1e-12)


def test_pitches_add_up_to_the_movement_between_first_and_last_crossing() -> None:
    random = np.random.default_rng(7)
    angle = np.cumsum(random.uniform(0.0, 0.2, 3000))
    position = np.cumsum(random.normal(-1e-5, 1e-5, 3000))
    table = thread_pitch(angle, position, QUARTERS)
    for crossings, pitch in zip(table.crossings, table.pitch, strict=True):
        there = crossings[~np.isnan(crossings)]
        assert np.nansum(pitch) == pytest.approx(there[0] - there[-1], abs=1e-12)


def test_a_periodic_screw_error_has_the_amplitude_of_its_formula_by_sine_fit() -> None:
    """xi + A sin(2 pi xi / p) gives P(n) the amplitude 2 A |sin(pi lead / p)|."""
    error, screw_lead = 3e-6, 10e-3
    angle, position = helix(80.0, 2000.0)
    table = thread_pitch(angle, position + error * np.sin(TURN * position / screw_lead))
    phase = TURN * LEAD / screw_lead * np.arange(table.pitch.shape[1])
    basis = np.stack([np.sin(phase), np.cos(phase), np.ones_like(phase)], axis=1)
    sine, cosine, mean = np.linalg.lstsq(basis, table.pitch[0])[0]
    assert math.hypot(sine, cosine) == pytest.approx(2.0 * error * abs(math.sin(math.pi * LEAD / screw_lead)), rel=1e-4)
    assert mean == pytest.approx(LEAD, abs=1e-9)


def test_ripple_of_whole_order_cancels_at_every_start_angle_and_of_other_order_does_not() -> None:
    angle, position = helix(10.0, 3600.0)
    starts = np.radians(np.arange(0.0, 360.0, 30.0))
    whole = thread_pitch(angle, position + 5e-6 * np.sin(3.0 * angle), starts)
    np.testing.assert_allclose(whole.pitch, LEAD, rtol=0.0, atol=1e-11)
    within_turn = whole.crossings[:, 3] - LEAD * starts / TURN
    assert np.ptp(within_turn) == pytest.approx(2.0 * 5e-6, rel=1e-3)
    broken = thread_pitch(angle, position + 5e-6 * np.sin(3.25 * angle), starts)
    amplitude = 2.0 * 5e-6 * abs(math.sin(math.pi * 3.25))
    assert np.nanmax(np.abs(broken.pitch - LEAD)) == pytest.approx(amplitude, rel=1e-2)


def test_samples_on_the_grid_give_exactly_what_all_samples_give() -> None:
    """Storage of xi at every 10 degrees: P(n) comes out bit for bit."""
    degrees = np.arange(0, 360 * 9 + 1)
    position = 1.5e-3 / 360.0 * degrees + 1e-5 * np.random.default_rng(3).normal(size=degrees.size)
    full = thread_pitch(np.radians(degrees), position, QUARTERS)
    stored = thread_pitch(np.radians(degrees[::10]), position[::10], QUARTERS)
    np.testing.assert_array_equal(full.pitch, stored.pitch)
    np.testing.assert_array_equal(full.crossings[1, :-1], position[90::360])


@pytest.mark.parametrize("counts", [100, 1024, 4096])
def test_a_quantised_angle_stands_still_between_counts_and_costs_at_most_a_count(counts: int) -> None:
    angle, position = helix(12.0, 6.7 * counts)
    quantised = np.floor(angle / TURN * counts) * TURN / counts
    assert np.count_nonzero(np.diff(quantised) == 0.0) > angle.size / 2
    table = thread_pitch(quantised, position, QUARTERS)
    one_sample = LEAD / (6.7 * counts)
    np.testing.assert_allclose(table.pitch, LEAD, rtol=0.0, atol=1.01 * one_sample)


def test_a_crossing_on_a_count_is_taken_where_the_count_is_reached() -> None:
    quarter = 0.25 * TURN
    angle = quarter * np.array([0, 0, 1, 1, 2, 3, 4, 4, 4, 5, 5, 6, 7, 8, 8])
    position = np.arange(15.0)
    assert thread_pitch(angle, position).crossings.tolist() == [[0.0, 6.0, 13.0]]
    assert thread_pitch(angle, position, (quarter,)).crossings.tolist() == [[2.0, 9.0]]
    assert thread_pitch(angle, position, (1.5 * quarter,)).crossings.tolist() == [[3.5, 10.5]]


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_count_that_goes_back_and_comes_again_does_not_cross_twice(seed: int) -> None:
    counts = 360
    steady = np.repeat(np.arange(6 * counts + 1), 5)
    jitter = -np.random.default_rng(seed).integers(0, 2, steady.size)
    jitter[::5] = 0  # every count is reached at its time, and lost again
    position: FloatArray = np.linspace(0.0, 9e-3, steady.size)
    start_angles = np.radians(np.arange(0.0, 360.0, 7.0))
    calm = thread_pitch(steady * TURN / counts, position, start_angles)
    shaken = thread_pitch((steady + jitter) * TURN / counts, position, start_angles)
    np.testing.assert_array_equal(shaken.pitch, calm.pitch)
    assert not Trace((steady + jitter) * TURN / counts, position).rising


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_crossing_lies_between_the_first_sample_that_reaches_it_and_the_one_before(seed: int) -> None:
    random = np.random.default_rng(seed)
    count = math.radians(2.0)
    angle = count * (np.cumsum(random.integers(0, 30, 600)) - random.integers(0, 2, 600))
    position = random.normal(size=600)
    starts = random.uniform(0.0, TURN, 5) + angle[0]
    table = thread_pitch(angle, position, starts)
    for k, start in enumerate(starts):
        for n in range(table.crossings.shape[1]):
            level = start + n * TURN
            j = next((i for i in range(600) if angle[i] >= level), None)
            if j is None:
                assert math.isnan(table.crossings[k, n])
            else:
                share = (level - angle[j - 1]) / (angle[j] - angle[j - 1])
                expected = position[j - 1] + share * (position[j] - position[j - 1])
                assert table.crossings[k, n] == pytest.approx(expected, abs=1e-9)


def test_a_turn_in_which_the_tool_moves_back_is_negative() -> None:
    table = thread_pitch(TURN * np.arange(5), np.array([0.0, -2.0, -1.5, -4.0, -6.0]))
    assert table.pitch.tolist() == [[2.0, -0.5, 2.5, 2.0]]
    assert (table.minimum[0], table.maximum[0], table.mean[0]) == (-0.5, 2.5, 1.5)


def test_a_feed_that_stands_still_has_the_pitch_zero_without_a_sign() -> None:
    table = thread_pitch(TURN * np.arange(4), np.full(4, 3.0))
    assert [math.copysign(1.0, value) for value in table.pitch[0]] == [1.0, 1.0, 1.0]
    there_and_back = thread_pitch(TURN * np.arange(3), np.array([0.0, -1.0, 0.0]))
    assert there_and_back.pitch.tolist() == [[1.0, -1.0]]


def test_a_start_angle_just_before_the_first_sample_is_extrapolated_and_flagged() -> None:
    angle, position = helix(5.5, 36.0)
    late = slice(1, None)  # the first sample lies 10 degrees past zero, the next one at 20
    table = thread_pitch(angle[late] - math.radians(1.0), position[late], (0.0, math.radians(90.0)))
    assert table.extrapolated.tolist() == [True, False]
    np.testing.assert_allclose(table.pitch[:, :4], LEAD, rtol=0.0, atol=1e-15)
    assert table.crossings[0, 0] == pytest.approx(LEAD / 360.0, abs=1e-15)


def test_extrapolation_takes_two_different_angles() -> None:
    angle = np.array([0.1, 0.1, 0.1, 0.3, *(TURN * np.arange(1, 4))])
    position = np.array([1.0, 1.0, 1.0, 1.4, 8.0, 9.0, 10.0])
    table = thread_pitch(angle, position)
    assert table.extrapolated.tolist() == [True]
    assert table.crossings[0, 0] == pytest.approx(0.8)


def test_a_crossing_a_whole_sample_before_the_first_is_missing_and_the_numbers_stay() -> None:
    angle, position = helix(6.0, 36.0)
    table = thread_pitch(angle[1:], position[1:], QUARTERS)  # 10, 20, ... degrees
    assert table.extrapolated.tolist() == [False] * 4
    assert np.isnan(table.pitch).tolist() == [[True, False, False, False, False], [False] * 5, [False] * 5, [False] * 5]
    later = thread_pitch(angle[80:], position[80:])  # from 800 degrees on
    assert np.isnan(later.pitch[0]).tolist() == [True, True, True, False, False]
    assert later.turns_before == 0
    assert later.mean[0] == pytest.approx(LEAD)


def test_the_end_of_the_shorter_rows_is_missing() -> None:
    angle, position = helix(3.5, 360.0)
    table = thread_pitch(angle, position, (*QUARTERS, 5.0 * TURN))
    assert np.isnan(table.pitch).sum(axis=1).tolist() == [0, 0, 1, 1, 3]  # 180 degrees: half a sample too short
    assert math.isnan(table.mean[4])
    assert math.isnan(table.minimum[4])
    assert math.isnan(table.maximum[4])


def test_the_first_sample_is_the_start_angle_when_none_is_given() -> None:
    angle, position = helix(4.3, 77.7)
    table = thread_pitch(angle + 1234.5, position, None)
    assert table.start_angles[0] == angle[0] + 1234.5
    assert table.pitch.shape == (1, 4)
    assert table.turns_before == 0
    assert not table.extrapolated[0]
    np.testing.assert_allclose(table.pitch, LEAD, rtol=0.0, atol=1e-12)


def test_turns_before_angle_zero_are_left_out() -> None:
    angle, position = helix(10.0, 100.0)
    table = thread_pitch(angle - 3.3 * TURN, position)
    assert table.pitch.shape == (1, 6)
    assert table.crossings[0, 0] == pytest.approx(3.3 * LEAD)


@pytest.mark.parametrize("turned", [159.155, -159.155, 1e7 + 0.1])
def test_an_angle_that_begins_far_from_zero_is_numbered_from_its_first_turn(turned: float) -> None:
    angle, position = helix(8.0, 100.0)
    table = thread_pitch(angle + turned * TURN, position, QUARTERS)
    assert table.turns_before == math.floor(turned)
    assert table.pitch.shape[1] == 8
    begins = (table.start_angles / TURN + table.turns_before) - turned  # turns after the first sample
    assert np.isnan(table.pitch[:, 0]).tolist() == (begins < 0.0).tolist()
    np.testing.assert_allclose(table.pitch[:, 1:6], LEAD, rtol=0.0, atol=1e-9)


def test_a_step_of_several_turns_gives_each_its_share() -> None:
    table = thread_pitch(TURN * np.array([0.0, 3.0, 4.0]), np.array([0.0, 4.5, 6.0]))
    assert table.pitch.tolist() == [[1.5, 1.5, 1.5, 1.5]]


def test_statistics_of_a_part_of_the_thread() -> None:
    table = PitchTable.of_pitches([[1.0, 2.0, 3.0, math.nan]], [0.0])
    assert (table.minimum[0], table.maximum[0], table.mean[0]) == (1.0, 3.0, 2.0)
    effective = statistics(table.pitch[:, 1:])
    assert (effective.minimum[0], effective.maximum[0], effective.mean[0]) == (2.0, 3.0, 2.5)
    assert math.isnan(statistics(table.pitch[:, 3:]).mean[0])
    with pytest.raises(PitchError, match="1 rows of pitches, 2 start angles"):
        PitchTable.of_pitches([[1.0]], [0.0, 1.0])


def test_less_than_one_whole_turn_is_refused_and_exactly_one_is_not() -> None:
    with pytest.raises(PitchError, match=r"0\.9 of a turn"):
        thread_pitch([0.0, 0.9 * TURN], [0.0, 1.0])
    with pytest.raises(PitchError, match="0 of a turn"):
        thread_pitch(np.full(50, 2.0), np.arange(50.0))
    with pytest.raises(PitchError, match="no start angle has a whole turn"):
        thread_pitch([0.0, 1.1 * TURN], [0.0, 1.0], (math.pi,))
    assert thread_pitch([0.0, TURN], [0.0, 1.0]).pitch.tolist() == [[1.0]]


@pytest.mark.parametrize("start_angles", [(), (math.nan,), (math.inf,), [[0.0]], ("a",), (0.0, 1e6)])
def test_start_angles_that_make_no_sense_are_refused(start_angles: object) -> None:
    with pytest.raises(PitchError, match="start angle"):
        thread_pitch([0.0, 2.0 * TURN], [0.0, 1.0], start_angles)  # type: ignore[arg-type] # that is the point


def test_an_angle_in_another_unit_does_not_fill_the_memory() -> None:
    with pytest.raises(PitchError, match="is the unit of the angle right"):
        thread_pitch([0.0, 1e15], [0.0, 1.0])


def test_what_a_trace_refuses_is_refused() -> None:
    with pytest.raises(TraceError, match="sample 1: angle is NaN"):
        thread_pitch([0.0, math.nan, 9.0], [0.0, 1.0, 2.0])


def test_the_table_of_a_trace_carries_what_was_done_to_it() -> None:
    trace = Trace(np.array([0.0, 7.0]), np.array([0.0, 1.0]), notes=("turned around",))
    assert pitch_table(trace).notes == ("turned around",)
