"""Spindle motor, speed loop and the detectors of the angle."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fmu_src.spindle_drive import SpindleDrive
from tests.plain_lathe import TURN

RPM = TURN / 60.0


def spun(stop_time: float, speed: float = 500 * RPM, step_size: float = 1e-3, **parameters: Any) -> SpindleDrive:
    """A spindle after `stop_time` at a commanded speed."""
    spindle = SpindleDrive(**parameters)
    assert spindle.check() == 0
    spindle.initialize()
    spindle.speed_command = speed
    for n in range(round(stop_time / step_size)):
        assert spindle.step(n * step_size, step_size) == 0
    return spindle


def test_runs_up_at_the_torque_limit() -> None:
    """J omega = (T_limit - T_friction) t while the torque is limited."""
    spindle = spun(0.05, friction_torque=0.0, viscous_friction=0.0)
    assert spindle.torque == 70.0
    assert spindle.speed == pytest.approx(70.0 / 0.15 * 0.05, rel=1e-9)


def test_power_limit_bends_the_run_up() -> None:
    """J omega^2 / 2 = P t once the power is limited, from rest on with a large torque limit."""
    spindle = spun(0.4, speed=5000 * RPM, torque_limit=1e5, power_limit=5e3, friction_torque=0.0,
                   viscous_friction=0.0, internal_step=5e-5, loop_period=5e-5)
    assert 0.5 * 0.15 * spindle.speed**2 == pytest.approx(5e3 * 0.4, rel=0.01)


def test_reaches_the_speed_without_windup() -> None:
    spindle = SpindleDrive()
    spindle.initialize()
    spindle.speed_command = 500 * RPM
    highest = 0.0
    for n in range(1000):
        assert spindle.step(n * 1e-3, 1e-3) == 0
        highest = max(highest, spindle.speed)
    assert highest < 1.1 * 500 * RPM
    assert spindle.speed == pytest.approx(500 * RPM, rel=1e-6)


def test_load_torque_dips_the_speed_by_its_impulse_response() -> None:
    """After a step of load the integral carries it: speed returns, torque has grown by the load."""
    spindle = spun(1.0)
    before = spindle.torque
    spindle.load_torque = 10.0
    lowest = spindle.speed
    for n in range(1000, 2500):
        assert spindle.step(n * 1e-3, 1e-3) == 0
        lowest = min(lowest, spindle.speed)
    assert 500 * RPM - lowest > 0.3
    assert spindle.speed == pytest.approx(500 * RPM, rel=1e-5)
    assert spindle.torque - before == pytest.approx(10.0, rel=1e-3)


@pytest.mark.parametrize("step_size", [2.5e-4, 7e-4, 1e-3, 3.3e-3])
def test_sampled_loop_is_the_same_for_any_communication_step(step_size: float) -> None:
    """The loop runs at k * loop_period whatever the communication steps are: equal trajectories to rounding."""
    stop = 0.231
    fine = spun(stop, step_size=1e-3, loop_period=1e-3, internal_step=1e-4)
    other = spun(stop, step_size=step_size, loop_period=1e-3, internal_step=1e-4)
    assert other.angle == pytest.approx(fine.angle, rel=1e-7)
    assert other.torque == pytest.approx(fine.torque, rel=1e-6)


def test_ripple_swings_the_speed_at_its_order() -> None:
    """A torque A sin(w t) on the closed loop: amplitude of the speed A / |J j w + Kp + Ki / (j w)|."""
    spindle = SpindleDrive(initial_speed=500 * RPM, ripple_amplitude=[1.0, 0.0, 0.0, 0.0],
                           ripple_order=[5.0, 1.0, 1.0, 1.0])
    spindle.initialize()
    spindle.speed_command = 500 * RPM
    speeds = []
    for n in range(2000):
        assert spindle.step(n * 1e-3, 1e-3) == 0
        speeds.append(spindle.speed)
    frequency = 5 * 500 * RPM
    expected = 1.0 / abs(complex(spindle.speed_gain, spindle.inertia * frequency - spindle.integral_gain / frequency))
    assert np.ptp(speeds[-600:]) / 2 == pytest.approx(expected, rel=0.05)


def test_encoder_counts_and_one_turn_pulse() -> None:
    """4 counts a line from power on; 1P latches the count at its own line, once per turn."""
    spindle = SpindleDrive(initial_angle=1.0, index_angle=2.0)
    spindle.initialize()
    spindle.speed_command = 500 * RPM
    n_turn = 4096
    index_line = math.floor(2.0 / TURN * n_turn + 0.5)
    latches = []
    for n in range(1500):
        before = spindle.index_count
        assert spindle.step(n * 1e-3, 1e-3) == 0
        line = math.floor(spindle.angle / TURN * n_turn)
        assert spindle.encoder_count == line - math.floor(1.0 / TURN * n_turn)
        assert spindle.encoder_angle == (line - index_line) / n_turn * TURN
        if spindle.index_count > before:
            latches.append(spindle.index_latch)
    assert len(latches) == spindle.index_count == 12
    assert latches[0] == index_line - math.floor(1.0 / TURN * n_turn)
    assert set(np.diff(latches)) == {4096.0}


def test_one_turn_pulses_of_a_long_step_are_all_counted() -> None:
    spindle = spun(3.0, step_size=0.5)
    assert spindle.index_count == math.floor(spindle.angle / TURN)
    assert spindle.index_latch == spindle.index_count * 4096.0


@pytest.mark.parametrize(("detector", "counts"), [(1, 4096), (2, 256 * 16), (3, 1048576)])
def test_detected_angle_is_within_one_count(detector: int, counts: int) -> None:
    spindle = spun(1.0, detector=detector)
    error = spindle.angle - spindle.encoder_angle
    assert 0.0 <= error < TURN / counts


def test_ideal_detector_sees_the_angle_itself() -> None:
    spindle = spun(1.0, detector=0)
    assert spindle.encoder_angle == spindle.angle


def test_absolute_encoder_counts_from_the_one_turn_place() -> None:
    spindle = SpindleDrive(detector=3, initial_angle=1.0)
    spindle.initialize()
    assert spindle.encoder_count == math.floor(1.0 / TURN * 1048576)
    assert spindle.encoder_angle == pytest.approx(1.0, abs=TURN / 1048576)


def test_hall_error_repeats_with_its_periods() -> None:
    clean, bent = spun(1.0, detector=2), spun(1.0, detector=2, hall_error=math.radians(0.05))
    assert abs(bent.encoder_angle - clean.encoder_angle) <= math.radians(0.05) + TURN / 4096


def test_period_shorter_than_the_integration_step_is_refused() -> None:
    assert SpindleDrive(internal_step=1e-3, loop_period=5e-4).check() == 2


def test_runaway_is_an_error_not_an_infinity() -> None:
    spindle = SpindleDrive(inertia=1e-6, viscous_friction=1e6, initial_speed=100.0, internal_step=5e-4)
    spindle.initialize()
    assert spindle.step(0.0, 1e-3) == 1


@pytest.mark.parametrize("missed", [12, -3])
def test_missed_counts_are_lost_between_the_one_turn_pulses(missed: int) -> None:
    """4096 - missed counts from pulse to pulse; the pulse itself stays where it is on the shaft."""
    spindle = SpindleDrive(missed_counts=missed, initial_speed=500 * RPM, initial_angle=2.0)
    spindle.initialize()
    spindle.speed_command = 500 * RPM
    latches, pulses = [], 0
    for n in range(1500):
        assert spindle.step(n * 1e-3, 1e-3) == 0
        if spindle.index_count > pulses:
            pulses = spindle.index_count
            latches.append(spindle.index_latch)
            assert 0.0 <= spindle.angle - TURN * pulses < 500 * RPM * 1.01e-3
            assert 0.0 <= spindle.encoder_count - spindle.index_latch < 4096 * 500 / 60 * 1.01e-3 + 1.0
    assert pulses == 12
    assert np.all(np.diff(latches) == 4096 - missed)
