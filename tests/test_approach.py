"""The room before and behind a thread: the manual's formula, the machine's, and the simulated machine."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.conftest import Command, assert_one_line
from threadpitch.approach import ApproachError, Machine, Start, fanuc_room, highest_speed

LEAD = 1.5e-3  # m
RPM = math.pi / 30.0


def test_the_manual_s_example() -> None:
    room = fanuc_room(LEAD, 500.0 * RPM, 0.01)
    assert room.approach * 1e3 == pytest.approx(1.506, abs=5e-4)
    assert room.run_out * 1e3 == pytest.approx(0.417, abs=5e-4)


def integrated(start: Start, step: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """(time, error of the tool), the command's profile and the drive's lag stepped by the trapezoidal rule."""
    time = step * np.arange(count)
    over = start.feed / math.sqrt(2.0)
    peak = (start.feed + over) / start.acceleration
    velocity = np.where(time < peak, start.acceleration * time,
                        np.maximum(start.feed, start.feed + over - start.acceleration * (time - peak)))
    if not start.catches_up:
        velocity = start.feed * -np.expm1(-time / start.start_lag)
    command = np.concatenate(([0.0], np.cumsum(0.5 * step * (velocity[1:] + velocity[:-1]))))
    tool = np.zeros(count)
    half = 0.5 * step / start.drive_lag
    for i in range(1, count):
        tool[i] = ((1.0 - half) * tool[i - 1] + half * (command[i] + command[i - 1])) / (1.0 + half)
    return time, tool - start.feed * (time - start.lag)


@pytest.mark.parametrize("catches_up", [True, False])
def test_the_error_is_that_of_the_profile_and_the_lag(catches_up: bool) -> None:
    start = Start(LEAD, 900.0 * RPM, 1.0 / 30.0, 0.02, 2.0, catches_up)
    time, error = integrated(start, 2e-5, 15000)
    assert np.max(np.abs(error - start.error(time))) < 2e-9
    assert abs(start.error(time)[0] - start.feed * start.lag) < 1e-12


def test_without_a_drive_the_turn_from_the_approach_on_errs_by_the_limit() -> None:
    start = Start(LEAD, 500.0 * RPM, 1.0 / 30.0, 0.0, 2.0, catches_up=False)
    limit = 10e-6
    lag = start.feed * start.start_lag
    # z = V T1 e^(-t/T1): z(t) - z(t + turn) = limit
    moment = start.start_lag * math.log(lag * -math.expm1(-start.turn / start.start_lag) / limit)
    expected = start.feed * (moment - start.start_lag) + lag * math.exp(-moment / start.start_lag)
    assert start.room(limit).approach == pytest.approx(expected, abs=1e-9)


@given(st.floats(50.0, 3000.0), st.floats(0.002, 0.05), st.floats(0.2, 20.0), st.booleans(), st.floats(1e-7, 1e-4))
def test_from_the_approach_on_every_turn_keeps_within_the_limit(
        speed: float, drive_lag: float, acceleration: float, catches_up: bool, limit: float) -> None:
    start = Start(LEAD, speed * RPM, 1.0 / 30.0, drive_lag, acceleration, catches_up)
    room = start.room(limit)
    assert 0.0 <= room.approach < 1.0
    assert room.run_out > 0.0
    time = np.linspace(0.0, start.on_line + 30.0 * start.lag, 4001)
    moved = start.feed * (time - start.lag) + start.error(time)
    turn = np.abs(start.error(time + start.turn) - start.error(time))
    assert np.all(turn[moved > room.approach + 1e-6] <= limit * (1.0 + 1e-3) + 1e-12)
    assert start.room(2.0 * limit).approach <= room.approach + 1e-9


def test_a_smaller_limit_or_a_faster_spindle_needs_more_room() -> None:
    for catches_up in (True, False):
        start = Start(LEAD, 500.0 * RPM, 1.0 / 30.0, 0.02, 2.0, catches_up)
        rooms = [start.room(limit).approach for limit in (20e-6, 5e-6, 1e-6)]
        assert rooms == sorted(rooms)
        faster = Start(LEAD, 900.0 * RPM, 1.0 / 30.0, 0.02, 2.0, catches_up)
        assert faster.room(5e-6).approach > rooms[1]


def test_the_highest_speed_has_the_approach_that_there_is() -> None:
    def approach_at(speed: float) -> float:
        return fanuc_room(LEAD, speed, 0.01).approach

    found = highest_speed(approach_at, 1.506e-3, 1e4)
    assert found / RPM == pytest.approx(500.0, rel=0.011)
    assert approach_at(found) <= 1.506e-3
    assert highest_speed(approach_at, 1.506e-3, 100.0 * RPM) == 100.0 * RPM
    with pytest.raises(ApproachError, match="too short"):
        highest_speed(approach_at, 1e-9, 1e4)


@pytest.mark.parametrize("mode", ["exponential", "catch_up"])
def test_the_simulated_machine_needs_what_the_formula_says(mode: str) -> None:
    # Backlash and screw errors of the machine are no part of the formula
    machine = Machine("models/threading_lathe", {
        "z_drive.backlash": 0.0, "z_drive.lead_amplitude": 0.0, "z_drive.lead_slope": 0.0,
        "controller.start_mode": mode, "controller.lead": LEAD, "controller.commanded_speed": 500.0 * RPM})
    by_formula, simulated = machine.start.room(10e-6), machine.simulated_room(10e-6)
    assert simulated.approach == pytest.approx(by_formula.approach, rel=0.25)
    # the last turns that are whole begin before the stop, which takes little of them
    assert 0.3 * by_formula.run_out < simulated.run_out < by_formula.run_out
    print(f"\n{mode}: approach {by_formula.approach * 1e3:.3f} mm by formula, {simulated.approach * 1e3:.3f} simulated")


QUESTION = ("approach", "--lead", "1.5mm", "--pitch-limit", "10um")


def test_the_command_answers_both_questions(threadpitch: Command) -> None:
    done = threadpitch(*QUESTION, "--speed", "500rpm", "--json")
    assert (done.status, done.err) == (0, "")
    found = json.loads(done.out)
    assert found["manual"]["run_out_mm"] == pytest.approx(0.4167, abs=1e-4)
    assert found["formula"]["approach_mm"] == pytest.approx(found["simulation"]["approach_mm"], rel=0.3)
    table = threadpitch(*QUESTION, "--speed", "500rpm").out
    assert f"{found['simulation']['approach_mm']:.3f}" in table
    back = json.loads(threadpitch(*QUESTION, "--approach", f"{found['simulation']['approach_mm']:.6f}mm", "--json").out)
    assert back["simulation"]["speed_rpm"] == pytest.approx(500.0, rel=0.1)


@pytest.mark.parametrize(("arguments", "message"), [
    (QUESTION, "give either --speed"),
    ((*QUESTION, "--speed", "500"), "is not a number with a unit"),
    ((*QUESTION, "--speed", "500mm"), "cannot be converted"),
    ((*QUESTION, "--speed", "-5rpm"), "not positive"),
    (("approach", "--lead", "1.5mm", "--pitch-limit", "2mm", "--speed", "500rpm"), "give less than the lead"),
    ((*QUESTION, "--speed", "500rpm", "--set", "z_drive.position_gein=3"), "position_gein"),
    (("approach", "--lead", "1.5mm", "--pitch-limit", "0.2um", "--speed", "500rpm"), "errs by up to"),
])
def test_bad_questions_are_one_line(arguments: tuple[str, ...], message: str, threadpitch: Command) -> None:
    done = threadpitch(*arguments)
    assert (done.status, done.out) == (2, "")
    assert_one_line(done.err, message)
