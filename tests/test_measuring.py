"""The virtual measuring machine: what it probes is the groove, its errors have the size that was asked for."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.test_faults import run
from threadpitch import lathe
from threadpitch.judgement import MeasuredThread
from threadpitch.judgement.measured_file import read_measured
from threadpitch.judgement.within_turn import measured_drunkenness
from threadpitch.lathe import LatheError
from threadpitch.measuring import MeasuringPlan, measure, read_plan, write_measured

EXACT = MeasuringPlan(uncertainty=1e-15)


@pytest.fixture(scope="module")
def whole(fmu_cache: None) -> lathe.Simulation:
    return lathe.simulate()


def by_flank(threads: list[MeasuredThread], flank: str) -> list[MeasuredThread]:
    return [one for one in threads if one.flank == flank]


def test_without_errors_it_finds_the_calculators_pitches(whole: lathe.Simulation) -> None:
    """The middle of the groove, at the start angles of actual_pitch, in the metal."""
    actual = whole.passes_of(lathe.ACTUAL)[-1]
    threads = measure(whole, replace(EXACT, flanks="middle"))
    assert len(threads) == 4
    for row, one in enumerate(threads):
        assert one.start_angle == pytest.approx(row * math.pi / 2.0)
        expected = actual.table.pitch[row][actual.in_metal[row]]
        assert one.pitch == pytest.approx(expected[np.isfinite(expected)][:one.pitch.size], abs=2e-9)
        assert one.pitch.size >= 18


def test_both_flanks_are_their_own(whole: lathe.Simulation) -> None:
    """Two flanks at a distance of the groove's width; positions are those of the groove's middle."""
    threads = measure(whole, replace(EXACT, points=1))
    low, high = by_flank(threads, "negative_z")[0], by_flank(threads, "positive_z")[0]
    assert low.position == pytest.approx(high.position, abs=1e-12)
    assert np.all(np.diff(low.position) < -1.4e-3)
    assert 0.0 < np.abs(low.pitch - high.pitch).max() < 2e-6


def test_every_third_turn(whole: lathe.Simulation) -> None:
    all_turns = measure(whole, replace(EXACT, points=1, flanks="middle"))[0]
    third = measure(whole, replace(EXACT, points=1, flanks="middle", every=3))[0]
    assert third.pitch == pytest.approx(all_turns.pitch[::3], abs=1e-14)


def test_errors_have_their_size_and_share_grooves(whole: lathe.Simulation) -> None:
    """Standard deviation u; neighbours correlated by -1/2; the seed gives the same errors again."""
    plan = MeasuringPlan(uncertainty=2e-6, points=120, flanks="middle", seed=7)
    exact = measure(whole, replace(plan, uncertainty=1e-15))
    errors = np.array([(one.pitch - other.pitch)[:18] for one, other in zip(measure(whole, plan), exact, strict=True)])
    assert errors.std() == pytest.approx(2e-6, rel=0.05)
    assert np.mean(errors[:, 1:] * errors[:, :-1]) / errors.var() == pytest.approx(-0.5, abs=0.05)
    again = measure(whole, plan)[5].pitch
    assert np.all(again == measure(whole, plan)[5].pitch)
    assert np.any(again != measure(whole, replace(plan, seed=8))[5].pitch)


def test_a_written_measurement_is_read_again(whole: lathe.Simulation, tmp_path: Path) -> None:
    threads = measure(whole, MeasuringPlan(uncertainty=0.4e-6))
    write_measured(threads, tmp_path / "measured.csv")
    read = read_measured(tmp_path / "measured.csv")
    assert [one.flank for one in read] == [one.flank for one in threads]
    for one, other in zip(read, threads, strict=True):
        assert one.start_angle == pytest.approx(other.start_angle)
        assert one.pitch == pytest.approx(other.pitch, abs=1e-12)
        assert one.position == pytest.approx(other.position, abs=1e-9)
        assert one.uncertainty == pytest.approx(other.uncertainty)


@pytest.mark.parametrize(("name", "points"), [("encoder_eccentricity", 8), ("none", 4)])
def test_what_repeats_within_the_turn_is_measured_at_several_angles(name: str, points: int) -> None:
    """w = F / 360 deg e Kv / sqrt(Kv^2 + omega^2), 5 % more by the velocity loop; over 8 angles all but its peaks."""
    simulation = run(name)
    plan = MeasuringPlan(0.2e-6, points=points, flanks="middle", seed=2)
    found = measured_drunkenness(measure(simulation, plan), 1.5e-3)
    assert found is not None
    amplitude = 1.05 * 1.5e-3 * 0.3 / 360.0 * 50.0 / math.hypot(50.0, 500.0 / 60.0 * 2.0 * math.pi)
    expected = 2.0 * amplitude if name == "encoder_eccentricity" else 0.0
    assert found[0] == pytest.approx(expected, abs=0.08 * expected + 4.0 * found[1])
    assert found[1] < 0.08e-6


def test_words_make_a_plan() -> None:
    assert read_plan([]) == MeasuringPlan()
    assert read_plan(["uncertainty=0.5um", "every=2", "points=8", "flanks=middle", "seed=3"]) == MeasuringPlan(
        0.5e-6, 2, 8, "middle", 3)
    assert read_plan(["uncertainty=1e-6"]).uncertainty == 1e-6
    for words, text in ((["uncertainty=1kg"], "uncertainty=1um"), (["every=0"], "give turns and points from 1"),
                        (["every=x"], "every=2"), (["flanks=left"], "choose both, negative_z"),
                        (["force=1"], "there are uncertainty, every"), (["uncertainty=-1um"], "give one from 0")):
        with pytest.raises(LatheError, match=text):
            read_plan(words)


def test_a_groove_that_was_not_recorded_is_refused(fmu_cache: None) -> None:
    blind = lathe.simulate(stop_time=1.2, record=["spindle.speed", "controller.threading"])
    with pytest.raises(LatheError, match=r"spindle\.angle was not recorded"):
        measure(blind, EXACT)
