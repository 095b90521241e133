"""What moves the thread pitch, against closed formulae."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fmu_src.feed_drive import FeedDrive
from fmu_src.pitch_calculator import PitchCalculator
from fmu_src.spindle_drive import SpindleDrive
from tests.plain_lathe import IDEAL_DETECTORS, TURN, Array, Lathe, merged, start_angles

LEAD = 1.5e-3
INSTANT_START = {"controller": {"acceleration_limit": 1e6}}
IDEAL_DRIVE = {"drive": {"drive_type": 0}}
FOUR_ANGLES = {"calculator": start_angles(0.0, 90.0, 180.0, 270.0)}


def synchronised(drive: FeedDrive, angle: Array, step_size: float, ages: int = 0) -> tuple[Array, Array]:
    """(detected, true) positions of a drive that is commanded lead / 2 pi * angle, `ages` steps late."""
    drive.initialize()
    detected, true = [drive.measured_position], [drive.position]
    for n in range(angle.size - 1):
        drive.position_command = LEAD / TURN * angle[max(0, n + 1 - ages)]
        assert drive.step(n * step_size, step_size) == 0
        detected.append(drive.measured_position)
        true.append(drive.position)
    return np.array(detected), np.array(true)


def pitches(angle: Array, position: Array, first_turn: int) -> Array:
    """P(n) from turn first_turn on, by linear interpolation."""
    turns = np.arange(first_turn, math.floor(angle[-1] / TURN) + 1)
    return np.diff(np.interp(turns * TURN, angle, position))


def test_ideal_drive_gives_the_lead() -> None:
    lathe = Lathe(merged(IDEAL_DETECTORS, INSTANT_START, IDEAL_DRIVE, FOUR_ANGLES))
    run = lathe.run(2.0)
    for i in range(4):
        assert len(run.nominal[i]) >= 13
        assert np.abs(np.array(run.nominal[i]) - LEAD).max() < 1e-12
        assert np.abs(np.array(run.actual[i]) - LEAD).max() < 1e-12


@pytest.mark.parametrize(("model", "error"), [(FeedDrive, 6), (SpindleDrive, 3)])
def test_a_step_of_too_many_periods_is_refused(model: type[FeedDrive | SpindleDrive], error: int) -> None:
    drive = model()
    drive.initialize()
    assert drive.step(0.0, 1e-3) == 0
    assert drive.step(1e-3, 1e300) == error


def test_constant_lag_gives_no_pitch_error() -> None:
    angle: Array = np.arange(0, 4001, dtype=np.float64) * 1e-3 * 500.0 / 60.0 * TURN
    detected, true = synchronised(FeedDrive(encoder_counts=0.0, position_gain=30.0), angle, 1e-3)
    lag = LEAD / TURN * angle[-1] - detected[-1]
    assert lag == pytest.approx(LEAD * 500.0 / 60.0 / 30.0, rel=1e-3)  # v / Kv
    assert np.abs(pitches(angle, detected, 20) - LEAD).max() < 1e-10
    assert np.abs(pitches(angle, true, 20) - LEAD).max() < 1e-10


@pytest.mark.parametrize(("step_size", "ages", "options", "delay"), [
    (1e-3, 0, {}, 0.0),  # fine interpolation's period less the step that the command is ahead
    (1e-3, 1, {}, 1e-3),  # a command one step old: order of the co-simulation against the data
    (5e-4, 0, {}, 5e-4),
    (1e-3, 0, {"feedforward": 0.6}, 0.0),
    (1e-3, 2, {"feedforward": 1.0}, 2e-3),  # feedforward takes the lag away, never the age
    (1e-3, 0, {"fine_interpolation": False, "position_period": 1e-3}, -1e-3),
    (1e-3, 0, {"drive_type": 2, "detector": 2, "scale_resolution": 0.0, "position_gain": 150.0}, 0.0),
])
def test_speed_change_moves_the_pitch(step_size: float, ages: int, options: dict[str, Any], delay: float) -> None:
    """dP = -F dN / 60 ((1 - feedforward) / Kv + Td) for dN rpm in the turn."""
    drive = FeedDrive(encoder_counts=0.0, **options)
    time: Array = np.arange(0, round(2.5 / step_size) + 1, dtype=np.float64) * step_size
    rate = 40.0 / 60.0 * TURN  # rad/s2: 40 rpm per second
    speed = 400.0 / 60.0 * TURN + rate * time
    angle: Array = 400.0 / 60.0 * TURN * time + 0.5 * rate * time**2
    detected, _ = synchronised(drive, angle, step_size, ages)
    measured = pitches(angle, detected, 12) - LEAD
    crossings = np.interp(np.arange(12, measured.size + 13) * TURN, angle, speed) * 60.0 / TURN
    lag = (1.0 - drive.feedforward) / drive.position_gain + delay
    expected = -LEAD * np.diff(crossings) / 60.0 * lag
    assert abs(expected[0]) > 1e-8
    assert measured == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("slope_mm", [3.7, 10.0])
def test_periodic_screw_error_shows_by_its_sine(slope_mm: float) -> None:
    """Amplitude 2 A |sin(pi lead / p)| in the true pitch, nothing in the nominal pitch of a motor encoder."""
    amplitude, period = 3e-6, slope_mm * 1e-3
    drive = FeedDrive(encoder_counts=0.0, lead_amplitude=amplitude, lead_period=period)
    angle: Array = np.arange(0, 3601, dtype=np.float64) * 1e-3 * 500.0 / 60.0 * TURN
    detected, true = synchronised(drive, angle, 1e-3)
    actual = pitches(angle, true, 10) - LEAD
    expected = 2 * amplitude * abs(math.sin(math.pi * LEAD / period))
    assert sine_amplitude(actual, LEAD / period) == pytest.approx(expected, rel=0.02)
    assert np.abs(pitches(angle, detected, 10) - LEAD).max() < 0.01 * amplitude


def test_linear_scale_takes_the_screw_error_out() -> None:
    """With a linear scale the loop leaves |j w / (j w + Kv)| of it."""
    amplitude, period, gain = 3e-6, 5e-3, 40.0
    angle: Array = np.arange(0, 4001, dtype=np.float64) * 1e-3 * 500.0 / 60.0 * TURN
    drive = FeedDrive(detector=2, scale_resolution=0.0, lead_amplitude=amplitude, lead_period=period,
                      position_gain=gain)
    _, true = synchronised(drive, angle, 1e-3)
    frequency = TURN * LEAD * 500.0 / 60.0 / period
    left = frequency / math.hypot(frequency, gain)
    expected = 2 * amplitude * abs(math.sin(math.pi * LEAD / period)) * left
    assert sine_amplitude(pitches(angle, true, 15) - LEAD, LEAD / period) == pytest.approx(expected, rel=0.05)


def sine_amplitude(values: Array, cycles_per_turn: float) -> float:
    """Amplitude of the least-squares sine of known frequency."""
    n = np.arange(values.size)
    columns = np.column_stack([np.cos(TURN * cycles_per_turn * n), np.sin(TURN * cycles_per_turn * n),
                               np.ones(values.size)])
    cosine, sine, _ = np.linalg.lstsq(columns, values, rcond=None)[0]
    return math.hypot(cosine, sine)


def test_exponential_start_needs_fanucs_approach() -> None:
    """delta1 = F S / 1800 (-ln a - 1 + a): at this distance the lead error is a = 1 %."""
    parameters = merged(IDEAL_DETECTORS, IDEAL_DRIVE, {"controller": {
        "start_mode": 0, "start_time_constant": 1 / 30, "acceleration_limit": 1e3, "period": 2.5e-4}},
        {"spindle": {"initial_speed": 500 / 60 * TURN}})
    lathe = Lathe(parameters)
    run = lathe.run(1.2, 2.5e-4)
    moved = 0.006 - run.command
    turned = LEAD / TURN * (run.angle - run.angle[np.argmax(run.threading) - 1])
    speed_error = 1.0 - np.diff(moved) / np.diff(turned)
    reached = np.argmax((speed_error < 0.01) & run.threading[1:])
    expected = 1.5 * 500 / 1800 * (-math.log(0.01) - 1 + 0.01)
    assert expected == pytest.approx(1.506, abs=5e-4)
    assert moved[reached] * 1e3 == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("acceleration", [0.05, 0.5, 2.0])
def test_catch_up_keeps_the_phase(acceleration: float) -> None:
    """P(1) is short, later turns are long, the sum over whole turns of P(n) - lead is zero."""
    parameters = merged(IDEAL_DETECTORS, IDEAL_DRIVE, FOUR_ANGLES,
                        {"controller": {"acceleration_limit": acceleration, "first_start_angle": math.pi / 2}})
    run = Lathe(parameters).run(2.0)
    nominal = np.array(run.nominal[1][:12])  # the start angle at which threading began
    assert abs(nominal.sum() - 12 * LEAD) < 1e-12
    if acceleration < 0.1:
        assert nominal[0] < LEAD - 5e-5  # so slow that the first turn shows it
    step = np.diff(run.command, 2)[run.threading[2:]]
    assert np.abs(step[:-1]).max() < 1.001 * acceleration * 1e-6 + 1e-12


def test_missing_phase_of_the_exponential_start() -> None:
    """The lag of the start stays: over whole turns v T1 is missing."""
    parameters = merged(IDEAL_DETECTORS, IDEAL_DRIVE, FOUR_ANGLES, {"controller": {"start_mode": 0}})
    nominal = np.array(Lathe(parameters).run(2.0).nominal[0][:12])
    assert 12 * LEAD - nominal.sum() == pytest.approx(LEAD * 500 / 60 / 30, rel=1e-3)


def test_eccentric_encoder_leaves_every_pitch_alone() -> None:
    """It repeats with every turn: P(n) stays at every start angle, within the turn it shows."""
    amplitude = math.radians(0.5)
    parameters = merged(IDEAL_DETECTORS, FOUR_ANGLES, {"spindle": {
        "detector": 1, "encoder_lines": 5000000, "eccentricity": amplitude}})
    run = Lathe(parameters).run(3.0)
    settled = np.array([run.actual[i][12:19] for i in range(4)])
    assert np.abs(settled - LEAD).max() < 2e-9
    within = LEAD / TURN * run.angle + run.position
    last = run.threading & (run.angle > run.angle[-1] - 8 * TURN)
    swing = np.ptp(within[last])
    frequency = 500 / 60 * TURN
    assert swing == pytest.approx(2 * LEAD / TURN * amplitude * 50 / math.hypot(frequency, 50), rel=0.1)


def test_ripple_of_whole_order_cancels_and_of_broken_order_does_not() -> None:
    def largest(order: float) -> tuple[float, float]:
        parameters = merged(IDEAL_DETECTORS, FOUR_ANGLES, {"spindle": {
            "ripple_amplitude": [5.0, 0.0, 0.0, 0.0], "ripple_order": [order, 1.0, 1.0, 1.0]}})
        run = Lathe(parameters).run(3.0)
        settled = np.array([run.nominal[i][12:19] for i in range(4)])
        within = (LEAD / TURN * run.angle + run.measured)[run.threading][-480:]
        return float(np.abs(settled - LEAD).max()), float(np.ptp(within))

    whole, swing = largest(2.0)
    assert whole < 2e-9
    assert swing > 1e-6
    broken, _ = largest(1.5)
    assert broken > 1e-6


def test_backlash_and_thermal_growth_are_outside_of_the_nominal_pitch() -> None:
    angle: Array = np.arange(0, 2001, dtype=np.float64) * 1e-3 * 500.0 / 60.0 * TURN
    hot, true_hot = synchronised(FeedDrive(encoder_counts=0.0, temperature_rise=10.0), angle, 1e-3)
    assert np.abs(pitches(angle, hot, 12) - LEAD).max() < 1e-10
    assert pitches(angle, true_hot, 12) == pytest.approx(LEAD * (1 + 12e-6 * 10.0), rel=1e-7)
    drive = FeedDrive(encoder_counts=0.0, backlash=10e-6)
    detected, true = synchronised(drive, angle, 1e-3)
    assert np.abs(pitches(angle, true, 12) - LEAD).max() < 1e-9  # no signature in a feed that never turns back
    deflection = drive._friction(drive.velocity) / drive.axial_stiffness
    assert detected[-1] - true[-1] == pytest.approx(5e-6 + deflection, rel=1e-3)


def test_lead_table_is_followed() -> None:
    table = [1e-6 * (i % 3) for i in range(16)]
    drive = FeedDrive(lead_table=table, table_start=0.0, table_spacing=0.01)
    assert drive._screw_error(0.02) == pytest.approx(table[2])
    assert drive._screw_error(0.025) == pytest.approx(0.5 * (table[2] + table[3]))
    assert drive._screw_error(-1.0) == table[0]
    assert drive._screw_error(1.0) == table[15]


def test_torque_limit_holds_and_does_not_wind_up() -> None:
    drive = FeedDrive(encoder_counts=0.0, torque_limit=3.0, speed_limit=0.015)  # Kv v = 0.75 m/s2 can be braked
    drive.initialize()
    drive.position_command = 0.010
    torques, positions = [], []
    for n in range(1500):
        assert drive.step(n * 1e-3, 1e-3) == 0
        torques.append(abs(drive.torque))
        positions.append(drive.position)
    assert max(torques) <= 3.0 * (1 + 1e-9)
    assert max(torques) > 2.9
    assert max(positions) < 0.010 * 1.001
    assert positions[-1] == pytest.approx(0.010, abs=1e-6)


def test_load_is_extrapolated_inside_the_step() -> None:
    """F(t) = 800 sin(60 t): held for 1 ms it errs by first order, with two derivatives by third."""
    def positions(step_size: float, orders: int) -> Array:
        drive = FeedDrive(encoder_counts=0.0)
        drive.initialize()
        found = []
        for n in range(round(0.2 / step_size)):
            phase = 60.0 * n * step_size
            drive.load_force = 800.0 * math.sin(phase)
            drive.load_force_rate = 800.0 * 60.0 * math.cos(phase) if orders > 0 else 0.0
            drive.load_force_curvature = -800.0 * 3600.0 * math.sin(phase) if orders > 1 else 0.0
            assert drive.step(n * step_size, step_size) == 0
            found.append(drive.position)
        return np.array(found)[round(1e-3 / step_size) - 1::round(1e-3 / step_size)]

    reference = positions(1.25e-4, 2)
    errors = [float(np.abs(positions(1e-3, orders) - reference).max()) for orders in (0, 1, 2)]
    assert errors[1] < errors[0] / 20
    assert errors[2] < errors[1] / 20


def test_calculator_keeps_every_turn_of_a_large_step() -> None:
    calculator = PitchCalculator(**start_angles(0.0, 45.0), sample_interval=math.pi / 4)
    calculator.initialize()
    calculator.threading = True
    calculator.spindle_angle, calculator.feed_position = 5.5 * TURN, -5.5 * LEAD
    assert calculator.step(0.0, 0.1) == 0
    assert calculator.completed[:3] == [5, 5, 0]
    assert calculator.completed_pitch[:5] == pytest.approx([LEAD] * 5, abs=1e-15)
    assert calculator.completed_pitch[8:13] == pytest.approx([LEAD] * 5, abs=1e-15)
    assert calculator.step_samples == 45
    calculator.spindle_angle = 15.5 * TURN
    assert calculator.step(0.1, 0.1) == 1


def test_calculator_signs_by_the_first_turn_and_keeps_a_turn_back_negative() -> None:
    calculator = PitchCalculator(**start_angles(0.0))
    calculator.initialize()
    calculator.threading = True
    found = []
    for turn, position in enumerate([-1.5, -3.0, -2.5, -4.0], start=1):
        calculator.spindle_angle, calculator.feed_position = turn * TURN, position * 1e-3
        assert calculator.step(turn * 0.1, 0.1) == 0
        found.append(calculator.pitch[0] * 1e3)
    assert found == pytest.approx([1.5, 1.5, -0.5, 1.5])
    assert calculator.pitch_min[0] == pytest.approx(-0.5e-3)


def test_calculator_finds_where_threading_began_inside_the_step() -> None:
    calculator = PitchCalculator(**start_angles(0.0), use_threading_start=True)
    calculator.spindle_angle = 100.0
    calculator.initialize()
    edge = 100.3
    calculator.threading, calculator.threading_angle = True, math.fmod(edge, TURN)
    calculator.spindle_angle = 101.0
    assert calculator.step(0.0, 1e-3) == 0
    assert calculator.threading_start == pytest.approx(edge, abs=1e-12)
    assert calculator.crossing_time[0] == pytest.approx(3e-4)
    calculator.spindle_angle, calculator.feed_position = edge + TURN + 0.1, 1.0
    assert calculator.step(1e-3, 1e-3) == 0
    assert calculator.revolution[0] == 1
    share = (edge + TURN - 101.0) / (edge + TURN + 0.1 - 101.0)
    assert calculator.crossing_time[0] == pytest.approx(1e-3 + 1e-3 * share)


def test_calculator_ignores_jitter_backwards() -> None:
    """A count back and forth at the crossing: one crossing, and the same pitch."""
    calculator = PitchCalculator(**start_angles(0.0))
    calculator.initialize()
    calculator.threading = True
    for turn in range(1, 4):
        for offset in (-0.01, 0.002, -0.001, 0.002, 0.01):
            calculator.spindle_angle = turn * TURN + offset
            calculator.feed_position = LEAD * calculator.spindle_angle / TURN
            assert calculator.step(0.0, 1e-3) == 0
    assert calculator.revolution[0] == 3
    assert calculator.pitch_min[0] == pytest.approx(LEAD, abs=1e-15)
    assert calculator.pitch_max[0] == pytest.approx(LEAD, abs=1e-15)


def test_samples_at_every_ten_degrees_give_the_pitch_again() -> None:
    """The seed's storage: xi at every 10 degrees; P(n) from it when crossings lie on the grid."""
    calculator = PitchCalculator(**start_angles(0.0))
    calculator.initialize()
    calculator.threading = True
    stored: list[float] = []
    for n in range(1, 400):
        calculator.spindle_angle = 0.117 * n
        calculator.feed_position = LEAD * calculator.spindle_angle / TURN + 1e-6 * math.sin(calculator.spindle_angle)
        assert calculator.step(0.0, 1e-3) == 0
        stored += calculator.step_sample_position[:calculator.step_samples]
    assert len(stored) == calculator.sample_count
    assert calculator.sample_angle == pytest.approx(math.radians(10.0) * (len(stored) - 1))
    assert stored[36] - stored[0] == pytest.approx(calculator.pitch_min[0], abs=1e-9)
    turns = np.diff(np.array(stored)[::36])
    assert turns[-1] == pytest.approx(calculator.pitch[0], abs=1e-15)
