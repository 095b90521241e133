"""Samples that are scaled where they are used give the bits of samples that were scaled before."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.test_pitch_stream import STARTS, shaken, tables
from threadpitch.pitch import PitchStream, stream
from threadpitch.trace import ColumnChoice, FloatArray, TraceError, read_pieces, time_fault
from threadpitch.trace.ahead import AHEAD, ReadAhead
from threadpitch.trace.signals import _until_a_jump
from threadpitch.trace.soundness import BLOCK, even

REV = 2.0 * math.pi


@settings(deadline=None, max_examples=80)
@given(seed=st.integers(0, 2**32 - 1), size=st.integers(2, 9000), border=st.floats(0.0, 1.0),
       sign=st.sampled_from([-1.0, 1.0]))
def test_factors_give_the_bits_of_scaled_samples(seed: int, size: int, border: float, sign: float) -> None:
    angle, position = shaken(seed, size)
    angle, position = sign * angle / REV, 1e3 * position
    before, inside = PitchStream(STARTS), PitchStream(STARTS)
    cut = round(border * size)
    for part in (slice(0, cut), slice(cut, size)):
        before.add(angle[part] * (sign * REV), position[part] * 1e-3)
        inside.add(angle[part], position[part], factors=(sign * REV, 1e-3))
    np.testing.assert_array_equal(inside.completed, before.completed)
    both = tables(inside.table, before.table)
    if both is None:
        return
    table, whole = both
    np.testing.assert_array_equal(table.crossings, whole.crossings)
    np.testing.assert_array_equal(table.pitch, whole.pitch)


def test_two_threads_give_the_bits_of_scaled_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    angle, position = shaken(3, 40_000)
    whole = PitchStream(STARTS)
    whole.add(angle / REV * REV, position / 1e-3 * 1e-3)
    monkeypatch.setattr(stream, "TWO_THREADS_FROM", 2)
    halves = PitchStream(STARTS)
    halves.add(angle / REV, position / 1e-3, factors=(REV, 1e-3))
    np.testing.assert_array_equal(halves.table().crossings, whole.table().crossings)


@pytest.mark.parametrize("sample", [3, 5000, 20_000])
def test_a_sample_is_refused_by_its_number_in_rad_and_m(sample: int) -> None:
    turns, position = np.arange(30_000) / 100.0, np.arange(30_000.0)
    turns[sample:] -= 1.5
    pitches = PitchStream(label="log")
    with pytest.raises(TraceError, match=rf"^log: sample {sample}: .*"):
        pitches.add(turns, position, factors=(REV, 1e-3))


@settings(deadline=None, max_examples=200)
@given(seed=st.integers(0, 2**32 - 1), size=st.integers(1, 3 * BLOCK), kind=st.sampled_from(["up", "down", "both"]),
       odd=st.sampled_from([0.0, 0.7, -0.7, math.nan, math.inf, -math.inf]))
def test_a_jump_is_found_as_by_a_plain_loop(seed: int, size: int, kind: str, odd: float) -> None:
    random = np.random.default_rng(seed)
    signs = {"up": [1.0], "down": [-1.0], "both": [-1.0, 1.0]}[kind]
    steps = random.uniform(0.0, 0.4, size) * random.choice(signs, size)
    steps[random.integers(size)] += odd
    values = np.cumsum(steps)
    lowest, highest, before, jump = values[0], values[0], 0.0, size
    for i, value in enumerate(values):
        lowest, highest = min(lowest, value), max(highest, value)
        if not abs(value - before) <= 0.5:
            jump = i
            break
        before = value
    found = _until_a_jump(values, 0.0, 0.5)
    assert found[0] == jump
    if not math.isnan(values[0]):
        assert found[1:] == (lowest, highest)


@pytest.mark.parametrize(("values", "answer"), [
    ([1.0, 2.0, 3.0], True), ([1.0, 1.0], True), ([1.0, 0.5], False), ([1.0, math.nan, 2.0], False), ([], True),
    ([math.nan], False), ([1.0, 9.0], False), ([5.0, 6.0], False), ([-1.0], False),
])
def test_even_steps(values: list[float], answer: bool) -> None:
    assert even(np.array(values, dtype=np.float64), 0.0, 0.0, 4.0) is answer


@pytest.mark.parametrize(("time", "sample"), [
    ([0.0, 1.0, 1.0, 2.0], None), ([0.0, 2.0, 1.0], 2), ([0.0, math.nan], 1), ([0.0, math.inf], 1),
    ([-math.inf, 0.0], 0), ([math.inf, math.inf], 0), ([-2.0], 0), ([], None),
])
def test_faults_of_time(time: list[float], sample: int | None) -> None:
    fault = time_fault(np.array(time, dtype=np.float64), -1.0)
    assert (None if fault is None else fault[0]) == sample


def test_values_of_a_file_are_not_copied_and_have_their_units(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    revs: FloatArray = np.arange(3000) / 100.0
    parquet.write_table(pyarrow.table({"spindle_revs": -revs, "z_mm": 1.5 * revs}), tmp_path / "log.parquet")
    with read_pieces(tmp_path / "log.parquet", ColumnChoice()) as pieces:
        parts = [samples for _, samples in pieces]
    assert sum(part.size for part in parts) == revs.size
    assert not any(part.angle_values.flags.owndata for part in parts)
    np.testing.assert_array_equal(np.concatenate([part.angle for part in parts]), revs * REV)
    np.testing.assert_array_equal(np.concatenate([part.position for part in parts]), 1.5 * revs * 1e-3)


def test_no_more_is_read_ahead_than_said() -> None:
    read: list[int] = []
    closed: list[bool] = []

    def source() -> Iterator[int]:
        for number in range(20):
            read.append(number)
            yield number

    with ReadAhead(source(), lambda: closed.append(True)) as items:
        taken = 0
        for item in items:
            assert item == taken
            taken += 1
            assert len(read) <= taken + AHEAD
    assert taken == 20
    assert closed == [True]


def test_an_error_of_the_reader_comes_out_and_the_source_is_closed() -> None:
    closed: list[bool] = []

    def source() -> Iterator[int]:
        yield 1
        raise TraceError("damaged")

    with pytest.raises(TraceError, match="damaged"), ReadAhead(source(), lambda: closed.append(True)) as items:
        assert list(items) == [1]
    assert closed == [True]
