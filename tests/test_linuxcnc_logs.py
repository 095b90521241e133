"""Logs of a LinuxCNC controller against independent pitches and against the angle before quantising; `pytest -s`."""

import csv
import gzip
import math
from collections import defaultdict
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from threadpitch.pitch import GroupPitch, pitch_tables
from threadpitch.trace import ColumnChoice, FloatArray, TraceError, read_groups

LOGS = Path(__file__).parents[1] / "models" / "logs" / "linuxcnc"
START_ANGLES_DEG = (0, 90, 180, 270)
ENCODER = ColumnChoice("spindle_revs_encoder", "z_fb_mm", group="pass")
TRUE_ANGLE = ColumnChoice("spindle_revs_true", "z_fb_mm", group="pass")
PASSES = {"A_ideal_500": 2, "C_ripple_500": 2, "H_droop_500": 2, "I_g76_ripple_400": 23, "J_twostart_400": 2}
TRUTH_LIMITS_UM = {"C_ripple_500": 0.35, "H_droop_500": 0.35, "I_g76_ripple_400": 0.35, "J_twostart_400": 0.6}


@cache
def expected_pitches() -> dict[tuple[str, str, int], dict[int, float]]:
    """(log, pass, start angle in degrees) -> n -> P(n) in mm."""
    table: dict[tuple[str, str, int], dict[int, float]] = defaultdict(dict)
    with gzip.open(LOGS / "expected_pitches.csv.gz", "rt", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            table[row["run"], row["pass"], int(row["start_angle_deg"])][int(row["n"])] = float(row["P_mm"])
    return table


@cache
def analysed(log: str, choice: ColumnChoice) -> list[GroupPitch]:
    return pitch_tables(LOGS / f"{log}.csv.gz", choice, np.radians(START_ANGLES_DEG))


def differences_um(groups: list[GroupPitch], log: str) -> FloatArray:
    """P(n) minus the expected one, um, for 2 <= n; every expected turn has to be there and no other."""
    found = []
    for group in groups:
        for k, start_angle in enumerate(START_ANGLES_DEG):
            expected = expected_pitches()[log, group.label, start_angle]
            pitch_mm = group.table.pitch[k] * 1e3
            assert max(expected) == np.count_nonzero(~np.isnan(pitch_mm))
            found += [1e3 * (pitch_mm[n - 1] - expected[n]) for n in expected if n >= 2]
    return np.array(found)


@pytest.mark.parametrize("log", PASSES)
def test_agrees_with_the_independent_pitches_within_a_hundredth_of_a_micrometre(log: str) -> None:
    groups = analysed(log, ENCODER)
    assert [group.label for group in groups] == [str(k + 1) for k in range(PASSES[log])]
    found = differences_um(groups, log)
    print(f"\n{log}: {found.size} pitches, largest difference {abs(found).max():.5f} um (limit 0.01)")
    assert abs(found).max() <= 0.01


@pytest.mark.parametrize("log", TRUTH_LIMITS_UM)
def test_encoder_pitches_agree_with_the_true_angle_within_a_count(log: str) -> None:
    largest = 0.0
    for seen, true in zip(analysed(log, ENCODER), analysed(log, TRUE_ANGLE), strict=True):
        turns = min(seen.table.pitch.shape[1], true.table.pitch.shape[1])
        difference = 1e6 * (seen.table.pitch[:, 1:turns] - true.table.pitch[:, 1:turns])
        largest = max(largest, float(np.nanmax(abs(difference))))
    print(f"\n{log}: largest difference from the true angle {largest:.3f} um (limit {TRUTH_LIMITS_UM[log]})")
    assert largest <= TRUTH_LIMITS_UM[log]


@pytest.mark.parametrize("log", TRUTH_LIMITS_UM)
def test_expected_pitches_and_the_true_angle_differ_no_more_than_the_encoder_allows(log: str) -> None:
    found = differences_um(analysed(log, TRUE_ANGLE), log)
    print(f"\n{log}: true angle against the expected pitches {abs(found).max():.3f} um")
    assert abs(found).max() <= TRUTH_LIMITS_UM[log]


@pytest.mark.parametrize("log", PASSES)
def test_only_a_crossing_before_the_first_sample_is_flagged_as_extrapolated(log: str) -> None:
    for group in analysed(log, ENCODER):
        past_the_index = group.trace.angle[0] > 0.0
        assert group.table.extrapolated.tolist() == [past_the_index, False, False, False]
        assert not np.isnan(group.table.pitch[:, 0]).any()


def test_feed_in_the_negative_direction_gives_positive_pitches() -> None:
    table = analysed("A_ideal_500", ENCODER)[0].table
    assert table.crossings[0, -1] < table.crossings[0, 0]
    one_digit = 1e-7  # m, the last decimal of the log
    np.testing.assert_allclose(table.pitch[:, 1:-1], 1.5e-3, rtol=0.0, atol=1.01 * one_digit)


def test_a_slow_speed_wave_moves_the_pitch_by_lead_times_speed_change_over_gain() -> None:
    """P(n) - lead = -lead/60 * dN * (1/Kv + Td): Kv 50 1/s, Td 2 ms of delay, dN the speed change per turn."""
    group = analysed("H_droop_500", ENCODER)[0]
    (true,) = (trace for trace in read_groups(LOGS / "H_droop_500.csv.gz", TRUE_ANGLE) if trace.name == group.label)
    assert true.time is not None
    turn = 2.0 * math.pi
    crossing_times = np.interp(turn * np.arange(0.0, 30.5, 0.5), true.angle, true.time)
    speed_rpm = 60.0 * 0.5 / np.diff(crossing_times)  # (half turns,), mean speed of each
    speed_at_turn = 0.5 * (speed_rpm[1:-1:2] + speed_rpm[2::2])  # at turn 1, 2, ...
    change = np.diff(speed_at_turn)  # (turns,) of turn 2, 3, ...
    fluctuation = group.table.pitch[0, 1 : 1 + change.size] - 1.5e-3
    steady = slice(2, None)  # the start has died away
    slope = float(np.polyfit(change[steady], fluctuation[steady], 1)[0])
    assert slope == pytest.approx(-1.5e-3 / 60.0 * (1.0 / 50.0 + 0.002), rel=0.02)


def test_without_the_group_column_the_restart_of_the_angle_is_named() -> None:
    with pytest.raises(TraceError, match=r"C_ripple_500\.csv\.gz:\d+: the spindle turns back .* group column"):
        pitch_tables(LOGS / "C_ripple_500.csv.gz", ColumnChoice("spindle_revs_encoder", "z_fb_mm"))
