"""Where in the control: the lag of the formula is found in real logs and in the simulated lathe, parts add up."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.plain_lathe import TURN, Lathe
from threadpitch.judgement import ControlTrace, ExpectedLag, JudgementError, control_parts
from threadpitch.trace import ColumnChoice, Trace, read_groups

Array = NDArray[np.float64]
LOGS = Path(__file__).parents[2] / "models" / "logs" / "linuxcnc"
LEAD = 1.5e-3


def logged(name: str) -> ControlTrace:
    choice = ColumnChoice("spindle_revs_encoder", "z_fb_mm", group="pass")
    return ControlTrace(read_groups(LOGS / f"{name}.csv.gz", choice)[-1])


@pytest.mark.parametrize("name", ["H_droop_500", "C_ripple_500"])
def test_the_lag_of_a_real_controller_is_found(name: str) -> None:
    """Position gain 50 1/s without feedforward, 2 ms of delay: 22 ms."""
    found = control_parts(logged(name), LEAD, expected=ExpectedLag(50.0, delay=2e-3), first_turn=4)
    assert found.lag == pytest.approx(22e-3, rel=0.03)
    assert found.lag_interval is not None
    assert found.lag_interval[1] - found.lag_interval[0] < 2e-3
    assert found.lag_agrees
    assert found.shares["speed"] > 0.95
    assert "as expected (22.0 ms): raise Kv or the feedforward" in found.sentences()[0]


def test_another_gain_is_not_as_expected() -> None:
    found = control_parts(logged("H_droop_500"), LEAD, expected=ExpectedLag(100.0), first_turn=4)
    assert found.lag_agrees is False
    assert "not as expected (10.0 ms)" in found.sentences()[0]


def test_the_first_turns_of_a_real_log_are_its_start() -> None:
    found = control_parts(logged("A_ideal_500"), LEAD)
    assert found.shares["start"] > 0.99
    assert found.parts["start"][0] == pytest.approx(found.deviation[0], rel=0.01)
    assert found.lag is None


@pytest.mark.parametrize("gain", [30.0, 50.0, 80.0])
def test_the_spindles_dip_of_the_simulated_lathe_is_found(gain: float) -> None:
    lathe = Lathe({"drive": {"position_gain": gain}})

    def entry(one: Lathe, time: float) -> None:
        one.spindle.load_torque = 25.0 if time > 0.9 else 0.0

    run = lathe.run(2.0, before=entry)
    cut = run.threading
    trace = Trace(run.detected_angle[cut], run.measured[cut], run.time[cut])
    found = control_parts(ControlTrace(trace, run.speed[cut], (run.command - run.measured)[cut]), LEAD,
                          start_angle=math.ceil(trace.angle[0] / TURN) * TURN, expected=ExpectedLag(gain),
                          first_turn=4)
    assert found.lag == pytest.approx(1.0 / gain, rel=0.1)
    assert found.lag_agrees
    assert found.shares["speed"] > 0.5
    np.testing.assert_allclose(sum(found.parts.values()), found.deviation, atol=1e-15)
    assert sum(found.shares.values()) == pytest.approx(1.0)
    assert any("the spindle's speed changes" in text for text in found.sentences())


def even(turns: float = 20.0) -> tuple[Array, Array]:
    """(time, angle) at 500 rpm."""
    time = np.arange(0.0, turns * 0.12 + 1e-9, 1e-3)
    return time, time / 0.12 * TURN


def test_turns_at_the_torque_limit_are_saturation() -> None:
    time, angle = even()
    limited = (angle > 5.0 * TURN) & (angle < 7.0 * TURN)
    lost = np.clip(angle / TURN, 5.0, 7.0) * 10e-6  # 10 um a turn, and never made good
    trace = Trace(angle, LEAD * angle / TURN - lost, time)
    found = control_parts(ControlTrace(trace, saturated=limited, following_error=lost), LEAD)
    assert found.shares["saturation"] == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(found.parts["saturation"][5:7], -10e-6, rtol=1e-6)
    assert "torque limit" in found.sentences()[0]


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_what_the_following_error_does_besides_is_named(sense: float) -> None:
    time, angle = even()
    error = 4e-6 * np.sin(0.37 * angle)
    position = sense * LEAD * angle / TURN - error
    found = control_parts(ControlTrace(Trace(angle, position, time), following_error=error), LEAD)
    assert found.shares["following"] == pytest.approx(1.0, abs=0.02)
    assert "following error" in found.sentences()[0]
    blind = control_parts(ControlTrace(Trace(angle, position, time)), LEAD)
    assert blind.shares["other"] == pytest.approx(1.0, abs=0.02)


def test_what_cannot_be_split_is_refused() -> None:
    time, angle = even()
    with pytest.raises(JudgementError, match="give the time"):
        control_parts(ControlTrace(Trace(angle, angle)), LEAD)
    with pytest.raises(JudgementError, match="give equal lengths"):
        control_parts(ControlTrace(Trace(angle, angle, time), speed=angle[1:]), LEAD)
    with pytest.raises(JudgementError, match="splitting the control needs 5"):
        control_parts(ControlTrace(Trace(angle, angle, time)), LEAD, first_turn=17)
