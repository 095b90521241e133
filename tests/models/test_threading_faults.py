"""Feed hold, alarms, and what the control shows of its work: pulses, gate, rotation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fmu_src.threading_controller import ThreadingController
from tests.plain_control import ALARMED, COUNTS, DONE, TURN, commanded, controller_of

LEAD = 1.5e-3
SHORT = {"z_start": 3e-3, "z_end": -3e-3, "acceleration_limit": 2.0}
COUNT = TURN / COUNTS


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_feed_hold_waits_for_the_end_of_the_thread(mode: int) -> None:
    def hold(controller: ThreadingController, n: int) -> None:
        controller.feed_hold = 500 <= n < 3000

    free = commanded(controller_of(**SHORT, start_mode=mode))
    run = commanded(controller_of(**SHORT, start_mode=mode), before=hold)
    assert run["phase"][499] == 4
    cut = run["phase"] == 4
    np.testing.assert_array_equal(run["z_command"][cut], free["z_command"][free["phase"] == 4])
    held = run["holding"] == 1.0
    first = int(np.argmax(held))
    assert 500 < first < 1000
    assert run["z_command"][first] == -3e-3
    assert run["x_command"][first] == 0.0097
    np.testing.assert_array_equal(run["x_command"][first:3000], 0.0097)  # still in its groove
    assert run["phase"][-1] == DONE
    assert run["angle"].size - 3000 == pytest.approx(free["angle"].size - first, abs=2)


def test_feed_hold_stops_rapid_traverse_at_the_acceleration_limit() -> None:
    def hold(controller: ThreadingController, n: int) -> None:
        controller.feed_hold = 30 <= n < 100

    control = controller_of(**SHORT)
    control.z_position = 0.1
    assert control.check() == 0
    run = commanded(control, before=hold)
    z = run["z_command"]
    assert np.abs(np.diff(z, 2))[:400].max() <= 2.0 * 1e-6 * 1.0001
    assert np.abs(np.diff(z[70:100])).max() == 0.0
    assert run["phase"][-1] == DONE


def test_a_start_position_that_passes_during_a_hold_is_waited_for_anew() -> None:
    """The helix is that of a run without hold: the gate never opens late."""
    def hold(controller: ThreadingController, n: int) -> None:
        controller.feed_hold = 30 <= n < 30 + length

    for length in (1, 40, 77, 119, 300):
        run = commanded(controller_of(**SHORT, first_start_angle=3.0, detector=1), before=hold)
        (one,) = run.passes
        late = one["z_command"] < 0.0
        turned = np.floor(one["angle"][late] / COUNT) * COUNT - one["start_angle"][0]
        line = 3e-3 - turned / TURN * LEAD
        error = [math.remainder(value, LEAD) for value in one["z_command"][late] - line]
        np.testing.assert_allclose(error, 0.0, atol=1e-9)
        assert one["angle"][0] - run["angle"][29 + length] < 2.1 * TURN


ALARMS: dict[str, tuple[dict[str, Any], float, int]] = {
    "speed that falls": ({"fluctuation_limit": 0.1}, 400.0, 1),
    "speed that rises": ({"fluctuation_limit": 0.1}, 600.0, 1),
    "too slow": ({"least_speed": 450.0 / 60.0 * TURN}, 400.0, 2),
}


@pytest.mark.parametrize(("parameters", "rpm", "alarm"), ALARMS.values(), ids=ALARMS.keys())
def test_an_alarm_ends_the_threading(parameters: dict[str, Any], rpm: float, alarm: int) -> None:
    """The feed brakes at its limit, X retracts, and the machine stands: no return, no further pass."""
    def disturb(controller: ThreadingController, n: int) -> float:
        return rpm if n >= 500 else 500.0

    run = commanded(controller_of(**SHORT, **parameters, cycle=2, pass_count=2, depth=[1e-4, 2e-4]), before=disturb)
    assert run["phase"][-1] == ALARMED
    assert run.controller.alarm == alarm
    assert run.controller.pass_number == 1
    assert not run.controller.gate
    assert not run.controller.threading
    assert run["x_command"][-1] == 0.012
    ended = int(np.argmax(run["alarm"] > 0.0))
    assert 500 < ended < 520  # the window of the speed: 16 periods
    z = run["z_command"]
    assert -3e-3 < z[-1] < z[500]
    assert np.abs(np.diff(z[ended - 1:], 2)).max() <= 2.0 * 1e-6 * 1.0001


@pytest.mark.parametrize("parameters", [{"fluctuation_limit": 0.25}, {"fluctuation_limit": 0.0},
                                        {"least_speed": 350.0 / 60.0 * TURN}])
def test_what_stays_within_its_limit_raises_no_alarm(parameters: dict[str, Any]) -> None:
    run = commanded(controller_of(**SHORT, **parameters), before=lambda _, n: 400.0 if n >= 500 else 500.0)
    assert run.controller.alarm == 0
    assert run["phase"][-1] == DONE


@pytest.mark.parametrize(("limit", "alarm"), [(12.4e-3, 3), (12.6e-3, 0)])
def test_a_feed_beyond_the_axis_raises_an_alarm_before_the_cut(limit: float, alarm: int) -> None:
    """lead * speed = 1.5 mm * 500 / min = 12.5 mm/s."""
    run = commanded(controller_of(**SHORT, feed_limit=limit))
    assert run.controller.alarm == alarm
    assert run.controller.pass_number == (0 if alarm else 1)
    assert run["phase"][-1] == (ALARMED if alarm else DONE)
    assert run["x_command"][-1] == 0.012


def test_the_fastest_block_of_a_chain_counts() -> None:
    chain = {"further_blocks": 1, "further_z": [-6e-3], "further_x": [0.0097], "further_lead": [3e-3]}
    assert commanded(controller_of(**SHORT, **chain, feed_limit=20e-3)).controller.alarm == 3
    assert commanded(controller_of(**SHORT, **chain, feed_limit=26e-3)).controller.alarm == 0
    growing = {"lead_change": 0.5e-3}
    assert commanded(controller_of(**SHORT, **growing, feed_limit=20e-3)).controller.alarm == 3


def test_distribution_pulses_are_the_movement() -> None:
    run = commanded(controller_of(**SHORT, pulse_weight=1e-6, run_out_length=1e-3, run_out_height=0.5e-3))
    for pulses, command in (("z_pulses", "z_command"), ("x_pulses", "x_command")):
        moved = np.floor(run[command] * 1e6 + 0.5)
        np.testing.assert_array_equal(run[pulses][1:], np.diff(moved))
    (one,) = run.passes
    per_pulse = one["z_pulses"][1:].sum() / ((one["angle"][-1] - one["angle"][0]) / COUNT)
    assert per_pulse == pytest.approx(-LEAD * 1e6 / COUNTS, rel=1e-2)  # the ratio of the distribution: lead / turn
    waiting = (run["phase"] == 2) | (run["phase"] == 3)
    assert waiting.sum() > 5
    assert not run["z_pulses"][waiting].any()


def test_the_rotation_per_period_is_what_the_distribution_is_fed_with() -> None:
    """An absolute detector gives no pulses: the amount of rotation per unit time is derived from its angle."""
    run = commanded(controller_of(**SHORT), rpm=480.0)
    np.testing.assert_allclose(run["rotation"][1:], np.diff(run["angle"]), rtol=0.0, atol=1e-9)
    (one,) = run.passes
    fed = np.cumsum(one["rotation"])
    start = one["z_command"][-1] + fed[-1] / TURN * LEAD
    late = one["z_command"] < 0.0
    np.testing.assert_allclose(one["z_command"][late], start - fed[late] / TURN * LEAD, rtol=0.0, atol=1e-9)


def test_later_passes_do_not_wait_for_the_speed_again_while_it_holds() -> None:
    control = controller_of(**SHORT, cycle=2, pass_count=3, depth=[1e-4, 2e-4, 3e-4], speed_settling=0.3)
    run = commanded(control)
    waits = np.flatnonzero(np.diff((run["phase"] == 1).astype(int)) == 1)
    lengths = [int(np.argmin(run["phase"][begin + 1:] == 1)) for begin in waits]
    assert run["phase"][:300].max() <= 1  # the first pass waits 0.3 s
    assert max(lengths[-2:]) < 60  # later ones for their infeed only
