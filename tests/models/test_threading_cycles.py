"""Threading cycles: all passes on one helix, depths and points of the words, starts, chains, run-out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.plain_control import COUNTS, TURN, Commands, commanded, controller_of
from threadpitch.cycles import G76Cycle, Helix, Infeed, Point, passes
from threadpitch.cycles.dialect import Clamping, Finishing

LEAD = 1.5e-3
COUNT = TURN / COUNTS
SHORT = {"z_start": 3e-3, "z_end": -3e-3}
G76 = {"cycle": 1, **SHORT, "thread_height": 0.92e-3, "first_cut": 0.4e-3, "least_cut": 0.05e-3, "allowance": 0.05e-3,
       "finishing_passes": 2, "tool_angle": math.radians(60.0)}


def phase_of(one: Commands, lead: float = LEAD) -> tuple[float, float]:
    """Least and greatest angle (rad, near the first) at which the helix of a pass crosses z_start, flank shift off."""
    start = one.controller.z_start - one["cut_depth"][0] * one.controller.flank
    angle = one["angle"][1:] - (start - one["z_command"][1:]) / lead * TURN
    near = np.array([math.remainder(value - angle[0], TURN) for value in angle])
    return math.remainder(angle[0], TURN) + near.min(), math.remainder(angle[0], TURN) + near.max()


@settings(deadline=None, max_examples=12)
@given(rpm=st.sampled_from([60.0, 300.0, 500.0, 900.0, 2400.0]) | st.floats(60.0, 3000.0), start=st.floats(0.0, 6.28))
def test_all_passes_lie_on_one_helix_within_a_nanometre(rpm: float, start: float) -> None:
    run = commanded(controller_of(**G76, first_start_angle=start, commanded_speed=rpm / 60.0 * TURN))
    assert len(run.passes) == run.controller.pass_number >= 5
    for one in run.passes:
        if one["angle"].size < 2:
            continue  # at 3000 rpm a pass may hold few periods
        for angle in phase_of(one):
            assert abs(math.remainder(angle - start, TURN)) / TURN * LEAD < 1e-9


def test_all_passes_lie_on_one_helix_of_counts() -> None:
    """The pulse generator's angle is whole counts: to these the command is exact, to the true angle within one."""
    run = commanded(controller_of(**G76, detector=1, first_start_angle=2.0))
    for one in run.passes:
        counted = np.floor(one["angle"] / COUNT) * COUNT
        start = one.controller.z_start - one["cut_depth"][0] * one.controller.flank
        error = [math.remainder(value, LEAD) for value in
                 (counted[1:] - one["start_angle"][0]) / TURN * LEAD - (start - one["z_command"][1:])]
        assert np.abs(error).max() < 1e-9
        assert abs(math.remainder(one["start_angle"][0] - 2.0, TURN)) <= 0.5 * COUNT


@settings(deadline=None, max_examples=15)
@given(start=st.floats(0.0, 6.28) | st.integers(-3, 3).map(lambda counts: counts % COUNTS * COUNT),
       rpm=st.floats(60.0, 900.0))
def test_the_helix_starts_at_the_commanded_angle_within_one_count(start: float, rpm: float) -> None:
    """Half a count by rounding the start, half by reading the angle; just before or after the index it is the same."""
    run = commanded(controller_of(detector=1, first_start_angle=start, commanded_speed=rpm / 60.0 * TURN, **SHORT))
    (one,) = run.passes
    turned = one["angle"][1:-1] - (3e-3 - one["z_command"][1:-1]) / LEAD * TURN - start
    errors = [math.remainder(value, TURN) for value in turned]
    assert abs(np.mean(errors)) <= 1.05 * COUNT  # the mean over few periods is not quite that over all counts
    assert max(map(abs, errors)) <= 1.5 * COUNT + 1e-9


@settings(deadline=None, max_examples=40)
@given(height=st.integers(200, 2000), first=st.integers(50, 900), least=st.integers(0, 120),
       allowance=st.integers(0, 150), finishing_passes=st.integers(0, 4), clamping=st.sampled_from([0, 1]),
       finishing=st.sampled_from([0, 1]), taper=st.integers(-500, 500), outside=st.booleans())
def test_passes_are_those_of_the_words(height: int, first: int, least: int, allowance: int, finishing_passes: int,
                                       clamping: int, finishing: int, taper: int, outside: bool) -> None:
    """Number, kind, depth, start and end point of every pass as threadpitch.cycles expands the same words."""
    sign = 1.0 if outside else -1.0
    infeed = Infeed(first * 1e-6, least * 1e-6, allowance * 1e-6, finishing_passes,
                    (Clamping.NO_MEMORY, Clamping.STICKY)[clamping],
                    (Finishing.EQUAL_PARTS, Finishing.FIRST_TAKES_ALL)[finishing])
    cycle = G76Cycle(Point(10e-3 + sign * 4e-3, 6e-3), Point(10e-3, -20e-3), Helix(LEAD, taper * 1e-6), height * 1e-6,
                     math.radians(60.0), infeed)
    wanted = passes(cycle)
    control = controller_of(
        cycle=1, z_start=6e-3, z_end=-20e-3, x_clear=cycle.start.x, x_thread=10e-3, taper=taper * 1e-6,
        thread_height=cycle.height, first_cut=infeed.first_cut, least_cut=infeed.least_cut, clamping=clamping,
        allowance=infeed.allowance, finishing=finishing, finishing_passes=finishing_passes, tool_angle=cycle.tool_angle)
    if not wanted:
        assert control.check() == 6
        return
    assert control.check() == 0
    control.initialize()
    for number, one in enumerate(wanted):
        assert number == 0 or control._plan_next()
        assert ("rough", "finish", "spring")[control.pass_kind] == one.kind
        assert control.planned_depth == pytest.approx(one.depth, abs=1e-12)
        assert (control.chain_z[0], control.chain_x[0]) == pytest.approx((one.start.z, one.start.x), abs=1e-12)
        assert (control.chain_z[1], control.chain_x[1]) == pytest.approx((one.end.z, one.end.x), abs=1e-12)
    assert not control._plan_next()


@pytest.mark.parametrize("starts", [2, 3, 10])
@pytest.mark.parametrize("order", [0, 1])
def test_starts_are_a_share_of_a_turn_apart_within_one_count(starts: int, order: int) -> None:
    run = commanded(controller_of(cycle=2, pass_count=2, depth=[0.3e-3, 0.5e-3], thread_height=0.5e-3, starts=starts,
                                  start_order=order, detector=1, first_start_angle=6.0, **SHORT))
    cut = [(int(one["start_number"][0]), round(float(one["cut_depth"][0]) * 1e6)) for one in run.passes]
    by_start = [(start + 1, depth) for start in range(starts) for depth in (300, 500)]
    assert cut == (by_start if order == 0 else sorted(by_start, key=lambda pair: pair[1]))
    for one in run.passes:
        turned = TURN * (one["start_number"][0] - 1.0) / starts
        error = math.remainder(one["start_angle"][0] - 6.0 - turned, TURN)
        assert abs(error) <= COUNT
        for angle in phase_of(one):
            assert abs(math.remainder(angle - one["start_angle"][0], TURN)) <= 1.01 * COUNT


def test_one_start_alone_is_cut_where_it_is_named() -> None:
    run = commanded(controller_of(starts=3, start=2, **SHORT))
    assert [one["start_number"][0] for one in run.passes] == [2.0]
    assert run["start_angle"][-1] == pytest.approx(TURN / 3.0)


def test_each_pass_approaches_feeds_in_retracts_and_returns() -> None:
    run = commanded(controller_of(**G76, acceleration_limit=2.0, rapid_speed=0.2))
    changes = np.flatnonzero(np.diff(run["phase"]))
    order = run["phase"][np.append(changes, changes[-1] + 1)].astype(int).tolist()
    one = [4, 5, 6, 7]
    assert [phase for phase in order if phase in one] == one * run.controller.pass_number
    for cut in run.passes:
        deep = 0.0097 + 0.92e-3 - cut["cut_depth"][0]
        np.testing.assert_allclose(cut["x_command"], deep, rtol=0.0, atol=1e-12)
        assert cut["z_command"].min() >= -3e-3
    moving = np.abs(np.diff(run["z_command"])) > 0.0
    clear = run["x_command"][1:] == 0.012
    synchronous = (run["phase"][1:] == 4) | (run["phase"][1:] == 5)
    assert not (moving & ~clear & ~synchronous & (run["phase"][1:] != 6)).any()  # Z moves in the air or in step


@pytest.mark.parametrize(("taper", "clear"), [(0.0, 0.012), (-0.4e-3, 0.012), (0.3e-3, 0.005)])
def test_run_out_leaves_at_its_angle_while_z_stays_in_step(taper: float, clear: float) -> None:
    run = commanded(controller_of(**SHORT, taper=taper, x_clear=clear, run_out_length=2e-3, run_out_height=1e-3),
                    rpm=60.0)
    (one,) = run.passes
    z, x = one["z_command"][1:], one["x_command"][1:]
    np.testing.assert_allclose(np.diff(z) / np.diff(one["angle"][1:]), -LEAD / TURN, rtol=1e-9)
    out = 1.0 if clear > 0.0097 else -1.0
    expected = 0.0097 + taper * (z + 3e-3) / 6e-3 + out * 0.5 * np.maximum(0.0, -1e-3 - z)
    np.testing.assert_allclose(x, expected, rtol=0.0, atol=1e-12)
    stopped = run["phase"] == 6
    assert run["z_command"][stopped][0] == -3e-3
    assert abs(x[-1] - (0.0097 + out * 1e-3)) < 2e-6


def test_lead_grows_turn_by_turn() -> None:
    run = commanded(controller_of(z_start=0.0, z_end=-0.03, lead=2e-3, lead_change=0.5e-3), rpm=60.0)
    (one,) = run.passes
    turns = (one["angle"] - one["angle"][0]) / TURN
    at = np.interp(np.arange(0.0, turns[-1]), turns, one["z_command"])
    np.testing.assert_allclose(-np.diff(at), 2e-3 + 0.5e-3 * (np.arange(at.size - 1) + 0.5), rtol=0.0, atol=2e-6)


def test_a_chain_goes_on_without_waiting() -> None:
    """Straight, then a cone, then another lead: one wait for 1P, positions as functions of the angle."""
    run = commanded(controller_of(z_start=3e-3, z_end=-3e-3, further_blocks=2, further_z=[-5e-3, -8e-3],
                                  further_x=[0.0107, 0.0107], further_lead=[1.5e-3, 3e-3],
                                  further_start_angle=[1.0, 2.0], first_start_angle=1.0, detector=1), rpm=60.0)
    (one,) = run.passes
    turns = (np.floor(one["angle"] / COUNT) * COUNT - one["angle"][0]) / TURN
    turns -= turns[0] - (3e-3 - one["z_command"][0]) / LEAD
    expected = np.interp(turns, [0.0, 4.0, 4.0 + 4.0 / 3.0, 4.0 + 4.0 / 3.0 + 1.0], [3e-3, -3e-3, -5e-3, -8e-3])
    np.testing.assert_allclose(one["z_command"], expected, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(one["x_command"], np.interp(-one["z_command"], [3e-3, 5e-3], [0.0097, 0.0107]),
                               rtol=0.0, atol=1e-12)
    assert one["gate"].all()
    assert one["coincidence"].sum() == 3  # where a block begins
    assert sorted(set(one["block"])) == [1.0, 2.0, 3.0]


SPECIAL = {"z_start": 0.0, "z_end": -2e-3, "lead": 4e-3, "further_blocks": 3, "further_z": [-3e-3, -3e-3, -5e-3],
           "further_x": [0.0097] * 3, "further_lead": [4e-3, 0.0, 4e-3], "start_each_block": True,
           "further_start_angle": [1.5 * math.pi, 0.5 * math.pi, math.pi]}
# Fig. 3 of the seed: Z over the spindle's angle. Half a turn inclined; zero inclination to 270 degrees; a quarter
# inclined; zero through 90 (a block without movement holds) to 180 degrees of the next turn; half a turn inclined.
FIGURE = ([0.0, 0.5, 0.75, 1.0, 1.5, 2.0], [0.0, -2e-3, -2e-3, -3e-3, -3e-3, -5e-3])


@pytest.mark.parametrize("overflow", [False, True])
def test_special_groove_of_the_seed(overflow: bool) -> None:
    run = commanded(controller_of(**SPECIAL, detector=1, counter_overflow=overflow), rpm=60.0)
    (one,) = run.passes
    zero = math.floor(one["angle"][0] / TURN) * TURN
    turns = (np.floor(one["angle"] / COUNT) * COUNT - zero) / TURN
    np.testing.assert_allclose(one["z_command"], np.interp(turns, *FIGURE), rtol=0.0, atol=1e-9)
    held = ((turns > 0.5) & (turns < 0.75)) | ((turns > 1.0) & (turns < 1.5))
    inside = np.abs(turns[:, None] - np.array([0.5, 0.75, 1.0, 1.25, 1.5])).min(axis=1) > 0.01
    np.testing.assert_array_equal(one["gate"][inside], ~held[inside])
    counts = np.floor(one["angle"] / COUNT) - zero / COUNT
    np.testing.assert_array_equal(one["counter"], np.mod(counts, COUNTS) if overflow else counts)  # reset once
    met = np.mod(counts[one["coincidence"] == 1.0], COUNTS)
    np.testing.assert_allclose(met, [0, 3072, 1024, 2048], atol=5)  # 4.1 counts a period at 60 rpm


def test_special_groove_at_a_limited_acceleration_stops_where_the_gate_shuts() -> None:
    run = commanded(controller_of(**{**SPECIAL, "acceleration_limit": 0.5}), rpm=60.0)
    (one,) = run.passes
    z = one["z_command"]
    assert np.abs(np.diff(z, 2)).max() <= 0.5 * 1e-6 * 1.01
    zero = math.floor(one["angle"][0] / TURN) * TURN
    turns = (one["angle"] - zero) / TURN
    for begin, end, at in ((0.55, 0.74, -2e-3), (1.05, 1.49, -3e-3)):
        np.testing.assert_allclose(z[(turns > begin) & (turns < end)], at, rtol=0.0, atol=1e-12)
    assert np.diff(z).max() <= 1e-15  # never back: no overshoot
    np.testing.assert_allclose(z[(turns > 0.85) & (turns < 0.95)],
                               np.interp(turns[(turns > 0.85) & (turns < 0.95)], *FIGURE), rtol=0.0, atol=1e-6)


def test_s_shaped_start_is_on_the_line_with_less_jerk() -> None:
    def run(mode: int) -> Commands:
        return commanded(controller_of(start_mode=mode, acceleration_limit=0.5, smoothing_periods=20, z_end=-0.012))

    linear, smooth = run(1).passes[0], run(2).passes[0]

    def jerk(one: Commands) -> float:
        return float(np.abs(np.diff(one["z_command"], 3)).max() / 1e-9)

    assert jerk(smooth) < 0.2 * jerk(linear)
    for one in (linear, smooth):
        late = one["z_command"] < 0.0
        line = 0.006 - (one["angle"][late] - one["start_angle"][0]) / TURN * LEAD
        np.testing.assert_allclose([math.remainder(value, LEAD) for value in one["z_command"][late] - line], 0.0,
                                   atol=1e-11)
        assert run(2).controller.z_command == 0.006


@pytest.mark.parametrize(("parameters", "error"), [
    ({"further_blocks": 1, "further_z": [-5e-3], "further_x": [0.0097]}, 4),
    ({"lead_change": -0.2e-3}, 4),
    ({**G76, "thread_height": 0.0}, 5),
    ({**G76, "allowance": 1e-3}, 5),
    ({**G76, "least_cut": 1e-3}, 5),
    ({**G76, "first_cut": 1e-9}, 6),
    ({**G76, "allowance": 0.92e-3, "finishing_passes": 0}, 6),
    ({**G76, "z_start": -2.5e-3}, 7),
    ({"run_out_length": 0.037}, 7),
    ({"run_out_length": 5.6e-3, **G76}, 7),
])
def test_parameters_that_make_no_cycle_are_refused(parameters: dict[str, Any], error: int) -> None:
    assert controller_of(**parameters).check() == error
