"""Start of threading at any spindle angle: counter, one-turn pulse, comparison, gate; stop and retraction."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmu_src.threading_controller import ThreadingController
from tests.plain_lathe import IDEAL_DETECTORS, TURN, Lathe, merged

LEAD = 1.5e-3
COUNT = TURN / 4096
IDEAL_DRIVE = {"drive": {"drive_type": 0, "initial_position": 0.006}, "controller": {"acceleration_limit": 1e6}}


def helix(lathe: Lathe) -> float:
    """Spindle angle modulo a turn at which the synchronised line passes z_start, from the true angle."""
    moved = 0.006 - lathe.controller.z_command
    return math.remainder(lathe.spindle.angle - lathe.spindle.index_angle - moved / LEAD * TURN, TURN)


def threaded(lathe: Lathe, turns: float = 2.0) -> Lathe:
    """Stepped until it has been threading for some turns."""
    began = None
    for n in range(4000):
        lathe.step(n * 1e-3, 1e-3)
        if began is None and lathe.controller.threading:
            began = lathe.spindle.angle
        if began is not None and lathe.spindle.angle > began + turns * TURN:
            return lathe
    raise AssertionError("no threading")


@settings(deadline=None, max_examples=25)
@given(start=st.floats(0.0, 6.28), index=st.floats(-3.0, 3.0), initial=st.floats(-10.0, 10.0),
       rpm=st.sampled_from([100.0, 500.0, 1500.0]))
def test_helix_starts_at_the_commanded_angle_within_one_count(start: float, index: float, initial: float,
                                                             rpm: float) -> None:
    lathe = threaded(Lathe(merged(IDEAL_DRIVE, {
        "spindle": {"initial_angle": initial, "index_angle": index, "initial_speed": rpm / 60 * TURN},
        "controller": {"first_start_angle": start, "commanded_speed": rpm / 60 * TURN}})), 1.0)
    error = math.remainder(helix(lathe) - start, TURN)
    assert abs(error) <= 2 * COUNT  # half a count of rounding the start, half of the index, one of reading the angle


def test_starts_of_a_ten_start_thread_are_a_tenth_of_a_turn_apart() -> None:
    lines = []
    for start in range(1, 11):
        lathe = threaded(Lathe(merged(IDEAL_DRIVE, {"controller": {"starts": 10, "start": start}})), 1.0)
        lines.append(lathe.controller.start_angle / COUNT)
        assert abs(math.remainder(helix(lathe) - (start - 1) * TURN / 10, TURN)) <= 2 * COUNT
    # round(k N / starts): the rounding of the starts does not add up
    assert lines == pytest.approx([math.floor(k * 409.6 + 0.5) for k in range(10)], abs=1e-9)


@pytest.mark.parametrize("counts_past_index", [-1, 0, 1])
def test_start_just_before_or_after_the_index_gives_the_same_thread(counts_past_index: int) -> None:
    start = (counts_past_index % 4096) * COUNT
    lathe = threaded(Lathe(merged(IDEAL_DRIVE, {"controller": {"first_start_angle": start}})), 1.0)
    assert abs(math.remainder(helix(lathe) - start, TURN)) <= 2 * COUNT


def test_counter_is_reset_once_and_the_gate_opens_at_coincidence() -> None:
    lathe = Lathe(merged(IDEAL_DRIVE, {"controller": {"first_start_angle": math.pi}}))
    controller = lathe.controller
    zero = None
    for n in range(4000):
        was_open = controller.gate
        phase = controller.phase
        lathe.step(n * 1e-3, 1e-3)
        if phase < 3 <= controller.phase:
            zero = lathe.spindle.index_latch
        if phase < 3 and controller.phase < 3:
            assert controller.counter == 0.0
        if zero is not None and controller.phase >= 3:
            assert controller.counter == lathe.spindle.encoder_count - zero  # no further reset by 1P
        if controller.gate and not was_open:
            assert 2048 <= controller.counter < 2048 + 40
    assert zero is not None
    assert controller.phase == 8
    assert not controller.gate


def test_overflowing_counter_cuts_the_same_thread() -> None:
    def commands(overflow: bool) -> list[float]:
        lathe = Lathe(merged(IDEAL_DRIVE, {"controller": {"counter_overflow": overflow}}))
        found = []
        for n in range(1500):
            lathe.step(n * 1e-3, 1e-3)
            found.append(lathe.controller.z_command)
            if overflow:
                assert 0.0 <= lathe.controller.counter < 4096.0
        return found

    assert commands(True) == commands(False)


def test_absolute_detector_needs_no_index() -> None:
    lathe = Lathe(merged(IDEAL_DETECTORS, IDEAL_DRIVE, {"controller": {"first_start_angle": 1.0}}))
    threaded(lathe)
    assert math.remainder(helix(lathe) - 1.0, TURN) == pytest.approx(0.0, abs=1e-9)


def test_waits_for_the_speed() -> None:
    controller = ThreadingController(detector=0, z_position=0.006, x_position=0.012, position_width=0.0)
    controller.initialize()
    angle, speed = 0.0, 0.9 * controller.commanded_speed
    for n in range(600):
        if n == 500:
            speed = controller.commanded_speed
        angle += speed * 1e-3
        controller.spindle_angle = angle
        assert controller.step(n * 1e-3, 1e-3) == 0
        if n < 550:
            assert controller.phase == 1
    assert controller.phase > 1
    assert controller.spindle_speed == pytest.approx(speed)


def test_stops_at_the_end_then_retracts_then_returns() -> None:
    lathe = Lathe(merged(IDEAL_DRIVE, {"controller": {"acceleration_limit": 2.0}}))
    phases: list[int] = []
    ends: list[float] = []
    for n in range(4000):
        lathe.step(n * 1e-3, 1e-3)
        if not phases or phases[-1] != lathe.controller.phase:
            phases.append(lathe.controller.phase)
        if lathe.controller.phase in (5, 6):
            ends.append(lathe.controller.z_command)
        if lathe.controller.phase == 6:
            assert lathe.controller.z_command == -0.030
    assert phases == [1, 2, 3, 4, 5, 6, 7, 8] or phases == [1, 2, 4, 5, 6, 7, 8]
    assert min(ends) == pytest.approx(-0.030, abs=1e-12)  # never beyond
    assert lathe.controller.z_command == 0.006
    assert lathe.controller.x_command == pytest.approx(0.012)
    assert not lathe.controller.threading


def test_acceleration_limit_holds_all_the_way() -> None:
    lathe = Lathe(merged(IDEAL_DETECTORS, IDEAL_DRIVE, {"controller": {"acceleration_limit": 1.0},
                                                        "drive": {"initial_position": 0.010}}))
    run = lathe.run(4.2)
    # while the command is on the line it follows the spindle, whatever its acceleration
    acceleration = np.abs(np.diff(run.command, 2)) / 1e-6
    assert acceleration.max() <= 1.01


@pytest.mark.parametrize("rpm", [300.0, 500.0, 900.0])
def test_age_of_the_angle_is_compensated(rpm: float) -> None:
    """A controller that is handed the angle of one period ago starts 7.5 to 22.5 um late, with compensation not."""
    def shift(age: float, compensate: bool) -> float:
        controller = ThreadingController(detector=0, z_position=0.006, x_position=0.012, position_width=0.0,
                                         acceleration_limit=1e6, commanded_speed=rpm / 60 * TURN, command_age=age,
                                         age_compensation=compensate)
        controller.initialize()
        for n in range(2000):
            controller.spindle_angle = rpm / 60 * TURN * (n * 1e-3)  # the angle at the beginning of the step
            assert controller.step(n * 1e-3, 1e-3) == 0
            if controller.threading and controller.z_command < 0.0:
                break
        true_angle = rpm / 60 * TURN * (n + 1) * 1e-3
        return math.remainder(true_angle - (0.006 - controller.z_command) / LEAD * TURN, TURN) / TURN * LEAD

    assert shift(0.0, True) == pytest.approx(LEAD * rpm / 60 * 1e-3, abs=1e-9)
    assert shift(1e-3, False) == pytest.approx(LEAD * rpm / 60 * 1e-3, abs=1e-9)
    assert abs(shift(1e-3, True)) < 1e-9


def test_positive_direction_cuts_a_left_hand_thread_the_other_way() -> None:
    lathe = Lathe(merged(IDEAL_DETECTORS, {"drive": {"drive_type": 0, "initial_position": -0.03}, "controller": {
        "acceleration_limit": 1e6, "z_start": -0.03, "z_end": 0.006}}))
    run = lathe.run(2.0)
    assert np.abs(np.array(run.nominal[0]) - LEAD).max() < 1e-12  # positive in the direction of the cut


@pytest.mark.parametrize(("parameters", "error"), [({"z_start": 0.0, "z_end": 0.0}, 1), ({"starts": 2, "start": 3}, 2)])
def test_parameters_that_make_no_thread_are_refused(parameters: dict[str, Any], error: int) -> None:
    assert ThreadingController(**parameters).check() == error


def test_control_is_the_same_for_any_communication_step() -> None:
    """Instants k * period, inputs interpolated in between: equal commands at 0.5, 1 and 4 ms for a steady spindle."""
    def command(step_size: float) -> float:
        controller = ThreadingController(detector=0, z_position=0.006, x_position=0.012, position_width=0.0)
        controller.initialize()
        for n in range(round(1.2 / step_size)):
            controller.spindle_angle = controller.commanded_speed * (n + 1) * step_size
            assert controller.step(n * step_size, step_size) == 0
        assert controller.threading
        return controller.z_command

    assert command(5e-4) == pytest.approx(command(1e-3), abs=1e-12)
    assert command(4e-3) == pytest.approx(command(1e-3), abs=1e-12)
