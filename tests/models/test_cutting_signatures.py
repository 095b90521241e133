"""What the workpiece does to the groove, against closed formulae, with the tool exactly on its helix."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fmu_src._workpiece import hump
from fmu_src.thread_cutting import ThreadCutting
from tests.models.cutting_passes import (
    APPROACH,
    EXAMPLE,
    LEAD,
    RADIUS,
    RIGID,
    STEP_SIZE,
    TURN,
    Cut,
    cut_passes,
    in_metal,
    pitches,
)

HALF = math.radians(30.0)
FIRST = 6.0  # turns since the pass began: the first of them in the metal
COUNT = 13
FLANK = [Cut(depth, -depth * math.tan(HALF)) for depth in (0.3e-3, 0.45e-3, 0.55e-3)]


def test_a_flank_moves_by_the_deflection_normal_to_it() -> None:
    """u = (F_axial + F_radial tan(e / 2)) / K, of a chip on this flank alone q F / K / cos(e / 2)."""
    stiffness, length, place = 5e6, 0.006, -0.010
    cutting = ThreadCutting(**EXAMPLE, thin_length=length, thin_position=place, thin_stiffness=stiffness)
    last = cut_passes(cutting, FLANK)[-1]
    shape = np.array([hump(float(z) - place, length) for z in last["tool_z"]])
    expected = -(last["axial_force"] + last["radial_force"] * math.tan(HALF)) / stiffness * shape
    flank = last["flank_position"][:, 0]
    metal = in_metal(last)
    rigid = last["tool_z"] - FLANK[-1].depth * math.tan(HALF)
    assert (flank - rigid)[metal] == pytest.approx(expected[metal], abs=1e-9)
    alone = 0.5 * float(last["cutting_force"][-1]) / stiffness / math.cos(HALF)
    assert expected.max() == pytest.approx(alone, rel=0.2)
    marks = np.interp((FIRST + np.arange(COUNT + 1)) * TURN, last["angle"], expected)
    assert pitches(last, flank, FIRST, COUNT) - LEAD == pytest.approx(-np.diff(marks), abs=2e-9)


def test_a_bending_bar_turns_its_surface_under_the_tool() -> None:
    """Radial infeed: the groove's middle is off by 3/2 a^2 / L^3 F_r / K r, towards the chuck."""
    bar = {**EXAMPLE, "bending_stiffness": 2e6, "chuck_position": -0.030}
    record = cut_passes(ThreadCutting(**bar), [Cut(0.3e-3)])[0]
    metal = in_metal(record)
    share = (record["tool_z"] + 0.030) / 0.030
    slope = 1.5 * share**2 / 0.030 * -record["radial_force"] / 2e6
    found = (record["groove_position"] - record["tool_z"])[metal]
    assert found == pytest.approx(-(slope * RADIUS)[metal], rel=0.01)
    assert np.abs(found).max() > 5e-6
    deflection = -record["radial_force"] * share**3 / 2e6
    assert record["radial_shift"][metal] == pytest.approx(deflection[metal], rel=1e-3, abs=1e-9)


def test_a_warm_workpiece_is_short_when_cold() -> None:
    growth = 11.5e-6 * 50.0
    record = cut_passes(ThreadCutting(**EXAMPLE, temperature_rise=50.0), [Cut(0.3e-3)])[0]
    found = pitches(record, record["groove_position"], FIRST, COUNT)
    assert found == pytest.approx(LEAD / (1.0 + growth), abs=1e-12)


def test_a_workpiece_that_warms_up_drifts() -> None:
    """z_w = z - (z - z_chuck) alpha dT / (1 + alpha dT), dT = T (1 - exp(-t / tau)), at every crossing."""
    cutting = ThreadCutting(**EXAMPLE, temperature_rise=50.0, thermal_time_constant=1.5)
    record = cut_passes(cutting, [Cut(0.3e-3)], degrees=3.0)[0]
    turns = FIRST + np.arange(COUNT + 1)
    time = (turns * 120.0 + 1.0) * STEP_SIZE  # 120 steps a turn
    growth = 11.5e-6 * 50.0 * (1.0 - np.exp(-time / 1.5))
    z = LEAD * (APPROACH - turns)
    expected = -np.diff(z - (z + 0.060) * growth / (1.0 + growth))
    assert pitches(record, record["groove_position"], FIRST, COUNT) == pytest.approx(expected, abs=1e-11)
    assert np.ptp(expected) > 0.3e-6


def test_a_hard_spot_multiplies_the_force_where_it_is() -> None:
    """F (1 + (factor - 1) hump hump): a tip of factor in one place, half as much on average over its width."""
    width = math.radians(40.0)
    cutting = ThreadCutting(**EXAMPLE, spot_length=1.2e-3, spot_width=width, spot_position=-0.009,
                            spot_angle=math.radians(90.0), spot_factor=3.0)
    record = cut_passes(cutting, [Cut(0.3e-3)], degrees=1.0)[0]
    force = record["cutting_force"] / record["cutting_force"][-1]
    hard = np.flatnonzero((force > 1.001) & in_metal(record))
    assert record["angle"][hard] % TURN == pytest.approx(np.full(hard.size, math.radians(90.0)), abs=0.5 * width)
    place = np.array([hump(float(z) + 0.009, 1.2e-3) for z in record["tool_z"][hard]])
    beside = np.array([hump(float(angle) % TURN - math.radians(90.0), width) for angle in record["angle"][hard]])
    assert force[hard] == pytest.approx(1.0 + 2.0 * place * beside, rel=1e-9)
    assert np.ptp(record["angle"][hard]) < width


def test_the_probed_flank_is_the_groove_position() -> None:
    for number, flank in ((1, 0), (2, 1)):
        record = cut_passes(ThreadCutting(**RIGID, probed_flank=number), FLANK)[-1]
        assert np.all(record["groove_position"] == record["flank_position"][:, flank])
        entry = np.abs(np.diff(record["groove_position"] - record["tool_z"]))
        assert entry.max() < 1e-9  # of a rigid tool: no jump where it enters
