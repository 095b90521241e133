"""What a pass waits for: speed, surface speed, axes in position, one-turn pulse; alarms of waits without end."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fmu_src.threading_controller import ThreadingController
from tests.plain_control import TURN, commanded, controller_of

SHORT = {"z_start": 3e-3, "z_end": -3e-3}
WAIT_SPEED, WAIT_INDEX, DONE, ALARMED = 1, 2, 8, 9


def test_threading_begins_when_both_axes_are_in_position() -> None:
    late = 700

    def lagging(controller: ThreadingController, n: int) -> None:
        controller.z_position = controller.z_command + (30e-6 if n < late else 10e-6)

    run = commanded(controller_of(**SHORT), before=lagging)
    began = int(np.argmax(run["threading"] > 0.0))
    assert late <= began < late + 125  # one turn at 500 rpm
    assert run["phase"][-1] == DONE
    anyway = commanded(controller_of(**SHORT, position_width=0.0), before=lagging)
    assert int(np.argmax(anyway["threading"] > 0.0)) < late


def axis_behind(controller: ThreadingController, _: int) -> None:
    """X stays 30 um behind."""
    controller.x_position = controller.x_command + 30e-6


def spindle_slow(_: ThreadingController, __: int) -> float:
    """480 of 500 rpm."""
    return 480.0


def spindle_stops(controller: ThreadingController, _: int) -> float:
    """While the one-turn pulse is waited for; its inertia lets it pass no pulse any more."""
    return 0.0 if controller.phase >= WAIT_INDEX else 500.0


def no_pulse(controller: ThreadingController, _: int) -> None:
    """The line of the one-turn pulse is broken: what it counts always looks as it did."""
    controller.seen_index = math.floor((controller.spindle_angle + 500.0 / 60.0 * TURN * 1e-3) / TURN)


# what goes wrong, phase in which the wait is, alarm, longest wait in periods
WAITS: dict[str, tuple[Any, int, int, int]] = {
    "a spindle that does not come to speed": (spindle_slow, WAIT_SPEED, 4, 500),
    "an axis that does not come into position": (axis_behind, WAIT_SPEED, 5, 500),
    "a spindle that stops while the pulse is waited for": (spindle_stops, WAIT_INDEX, 4, 740),
    "a one-turn pulse that does not come": (no_pulse, WAIT_INDEX, 6, 740),
}


@pytest.mark.parametrize(("fault", "phase", "alarm", "periods"), WAITS.values(), ids=WAITS.keys())
def test_a_wait_without_end_is_an_alarm(fault: Any, phase: int, alarm: int, periods: int) -> None:
    """After longest_wait, for the pulse two turns later; X retracts and the machine stands."""
    strict = {**SHORT, "detector": 1, "speed_tolerance": 0.02}
    run = commanded(controller_of(**strict, longest_wait=0.5), before=fault, periods=2000)
    assert run["phase"][-1] == ALARMED
    assert run.controller.alarm == alarm
    assert run.controller.pass_number == 0
    assert run["x_command"][-1] == run.controller.x_clear
    waited = int(np.argmax(run["alarm"] > 0.0)) - int(np.argmax(run["phase"] == phase))
    assert abs(waited - periods) <= 2
    patient = commanded(controller_of(**strict, longest_wait=0.0), before=fault, periods=2000)
    assert (patient.controller.alarm, patient["phase"][-1]) == (0, phase)


def test_waiting_in_a_feed_hold_is_no_fault() -> None:
    def hold(controller: ThreadingController, n: int) -> None:
        controller.feed_hold = 100 <= n < 2500

    run = commanded(controller_of(**SHORT, longest_wait=0.5), before=hold)
    assert run["phase"][-1] == DONE
    assert run.controller.alarm == 0


def test_constant_surface_speed_follows_x_up_to_its_limit() -> None:
    """omega = v / |x|: at the start of a pass, in a taper on the way, and not beyond highest_speed."""
    speed = 60.0 / 60.0
    taper = {"x_thread": 10e-3, "taper": -4e-3, "x_surface": 10.5e-3, "x_clear": 14e-3, "lead": 1e-3}
    run = commanded(controller_of(**SHORT, **taper, surface_speed=speed, fluctuation_limit=0.0),
                    before=lambda control, _: control.spindle_speed_command / TURN * 60.0)
    rows = run["threading"] == 1.0
    assert run["phase"][-1] == DONE
    turned = np.diff(run["angle"])[rows[1:]] / 1e-3
    x = run["x_command"][:-1][rows[1:]]
    np.testing.assert_allclose(turned[1:], speed / x[1:], rtol=5e-3)
    assert turned[0] / turned[-1] == pytest.approx(10.0 / 6.0, rel=0.02)
    limited = commanded(controller_of(**SHORT, **taper, surface_speed=speed, highest_speed=120.0),
                        before=lambda control, _: control.spindle_speed_command / TURN * 60.0)
    assert np.diff(limited["angle"]).max() == pytest.approx(0.120, rel=1e-9)
    at_centre = controller_of(**SHORT, surface_speed=speed, highest_speed=120.0, x_thread=0.0, x_surface=0.0)
    at_centre.initialize()
    at_centre._command_speed(0.0)
    assert at_centre.spindle_speed_command == 120.0


def test_threads_across_a_face_are_fed_in_and_left_along_z() -> None:
    """The tool never moves back through its groove: X goes back when Z is clear."""
    face = {"z_start": -1e-3, "z_end": -1e-3, "x_thread": 10e-3, "taper": 15e-3, "infeed_axis": 1, "z_clear": 2e-3,
            "x_clear": 25e-3, "x_surface": 9e-3, "lead": 2e-3}
    control = controller_of(**face, cycle=2, pass_count=2, depth=[0.5e-3, 0.5e-3], thread_height=0.5e-3)
    control.z_position = 5e-3
    run = commanded(control)
    assert run["phase"][-1] == DONE
    assert run.controller.pass_number == 2
    rapid = np.isin(run["phase"], (0, 6, 7))
    rapid &= np.roll(rapid, 1)  # X ends its thread in the period that begins the retraction
    moved_x = np.abs(np.diff(run["x_command"], prepend=run["x_command"][0])) > 0.0
    assert np.count_nonzero(rapid & moved_x) > 20
    assert np.all(run["z_command"][rapid & moved_x] == 2e-3)
    for one in run.passes:
        assert one["x_command"].min() < 10.05e-3
        assert one["x_command"][0] == pytest.approx(25e-3, abs=1e-4)
    assert math.isclose(run["x_command"][-1], 25e-3)
