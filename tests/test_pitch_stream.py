"""The stream gives what the whole recording gives, bit for bit, however the samples are cut into pieces."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from threadpitch.pitch import PitchError, PitchStream, PitchTable, stream, thread_pitch
from threadpitch.trace import FloatArray, TraceError

TURN = 2.0 * math.pi
STARTS = (0.0, 1.0, 3.0, -TURN, 5.0)


def shaken(seed: int, size: int) -> tuple[FloatArray, FloatArray]:
    """A quantised angle with standstills, counts that go back, and a wobbling feed; (samples,) rad, m."""
    random = np.random.default_rng(seed)
    speed = random.uniform(1e-3, 0.4) * (1.0 + 0.5 * np.sin(np.arange(size) / random.uniform(2.0, 50.0)))
    speed[random.random(size) < 0.05] = 0.0
    count = TURN / random.choice([100, 1024, 4096])
    angle = np.floor((random.uniform(-2.0, 2.0) * TURN + np.cumsum(speed)) / count)
    angle[random.random(size) < 0.02] -= 1.0
    return angle * count, random.choice([-1.0, 1.0]) * np.cumsum(speed + random.normal(0.0, 0.01, size)) * 2e-4


def plain(angle: FloatArray, position: FloatArray, start: float) -> FloatArray:
    """xi at start + TURN n, by a loop over all samples."""
    found = []
    for level in start + TURN * np.arange(1000):
        j = int(np.argmax(np.maximum.accumulate(angle) >= level - 1e-12))
        if angle[j] < level - 1e-12:
            break
        if j > 0:
            share = (angle[j] - level) / (angle[j] - angle[j - 1])
            found.append(position[j] - share * (position[j] - position[j - 1]))
    return np.array(found)


def tables(one: Callable[[], PitchTable], other: Callable[[], PitchTable]) -> tuple[PitchTable, PitchTable] | None:
    """What two calls give; None where both refuse, for the same reason."""
    try:
        found = one()
    except PitchError as error:
        with pytest.raises(PitchError) as refused:
            other()
        assert str(refused.value) == str(error)  # noqa: PT017 -- two calls that fail alike
        return None
    return found, other()


@settings(deadline=None, max_examples=150)
@given(seed=st.integers(0, 2**32 - 1), size=st.integers(2, 9000), borders=st.lists(st.floats(0.0, 1.0), max_size=12))
def test_pieces_give_the_bits_of_the_whole(seed: int, size: int, borders: list[float]) -> None:
    angle, position = shaken(seed, size)
    pieces = PitchStream(STARTS)
    cuts = sorted(round(border * size) for border in borders)
    for first, last in zip([0, *cuts], [*cuts, size], strict=True):
        pieces.add(angle[first:last], position[first:last])
    both = tables(pieces.table, lambda: thread_pitch(angle, position, STARTS))
    if both is None:
        return
    table, whole = both
    np.testing.assert_array_equal(table.pitch, whole.pitch)
    np.testing.assert_array_equal(table.crossings, whole.crossings)
    np.testing.assert_array_equal(table.extrapolated, whole.extrapolated)
    assert table.turns_before == whole.turns_before
    for k, completed in enumerate(pieces.completed):
        if completed > 0:
            assert pieces.pitch_of(k, int(completed)) == whole.pitch[k, completed - 1]


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), start=st.floats(0.0, TURN))
def test_crossings_of_a_shaken_angle_are_those_of_a_plain_loop(seed: int, start: float) -> None:
    angle, position = shaken(seed, 6000)
    try:
        table = thread_pitch(angle, position, (start,))
    except PitchError:
        return
    expected = plain(angle, position, start)
    np.testing.assert_allclose(table.crossings[0, -expected.size:], expected, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("middle_goes_back", [False, True])
def test_two_threads_give_the_bits_of_one(monkeypatch: pytest.MonkeyPatch, middle_goes_back: bool) -> None:
    angle, position = shaken(7, 200_000)
    if middle_goes_back:
        angle[99_990:100_000] = angle[99_989] - 0.01
        angle[100_000:100_003] = angle[99_989] - 0.005
    one = thread_pitch(angle, position, STARTS)
    monkeypatch.setattr(stream, "TWO_THREADS_FROM", 1000)
    two = thread_pitch(angle, position, STARTS)
    np.testing.assert_array_equal(one.crossings, two.crossings)
    np.testing.assert_array_equal(one.pitch, two.pitch)


@pytest.mark.parametrize("threads_from", [1000, 10**9])
@pytest.mark.parametrize("sample", [0, 1, 2047, 2048, 4999, 5000, 9999])
@pytest.mark.parametrize("fault", [np.nan, np.inf, -np.inf, 1e200])
def test_every_sample_is_checked(monkeypatch: pytest.MonkeyPatch, threads_from: int, sample: int,
                                 fault: float) -> None:
    monkeypatch.setattr(stream, "TWO_THREADS_FROM", threads_from)
    for damaged in range(2):
        both = np.array([0.01 * np.arange(10_000.0), 1e-5 * np.arange(10_000.0)])
        both[damaged, sample] = fault
        with pytest.raises(TraceError, match=rf"sample {sample}: {('angle', 'position')[damaged]} is"):
            thread_pitch(both[0], both[1])


@pytest.mark.parametrize("sample", [1, 2048, 5000, 9999])
def test_a_reversal_is_found_in_a_later_piece(sample: int) -> None:
    angle = 0.01 * np.arange(10_000.0)
    angle[sample:] -= 0.2
    pieces = PitchStream(label="pipe")
    pieces.add(angle[: sample - 1], angle[: sample - 1])
    with pytest.raises(TraceError, match=rf"pipe: sample {sample}: the spindle turns back"):
        pieces.add(angle[sample - 1 :], angle[sample - 1 :])


def test_a_turn_is_complete_as_soon_as_its_last_sample_is_there() -> None:
    angle = TURN / 8.0 * np.arange(20.0)
    live = PitchStream((0.0,))
    completed = []
    for theta in angle:
        live.add([theta], [theta])
        completed.append(int(live.completed[0]))
    assert completed == [0] * 8 + [1] * 8 + [2] * 4
    assert live.pitch_of(0, 2) == pytest.approx(TURN)
    with pytest.raises(IndexError, match="turn 3 of start angle 0 is not complete"):
        live.pitch_of(0, 3)


def test_masked_and_complex_samples_are_refused() -> None:
    angle = np.arange(30.0)
    with pytest.raises(TraceError, match="position is masked at sample 3"):
        thread_pitch(angle, np.ma.masked_equal(angle, 3.0))
    assert thread_pitch(angle, np.ma.masked_equal(angle, 99.0)).pitch.shape == (1, 4)
    with pytest.raises(TraceError, match="angle is not an array of numbers, but of complex128"):
        thread_pitch(angle + 0j, angle)
