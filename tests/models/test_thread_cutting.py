"""Chip, forces and groove against closed formulae and against a groove on a fine grid."""

from __future__ import annotations

import itertools
import math
import random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmu_src._materials import catalogue_exponent, catalogue_force
from fmu_src.thread_cutting import ThreadCutting
from tests.models.cutting_passes import (
    APPROACH,
    DEPTHS,
    EXAMPLE,
    LEAD,
    RADIUS,
    RIGID,
    TURN,
    Array,
    Cut,
    PassRecord,
    cut_passes,
    in_metal,
)

HALF = math.radians(30.0)
HEIGHT = DEPTHS[-1]
M20_FORCES = [125, 156, 167, 174, 180, 184, 188, 192, 195, 100]  # N: M20x1.5, radial, k_c1 1500 N/mm2, m_c 0.25


def radial(depths: list[float], **options: Any) -> list[Cut]:
    return [Cut(depth, **options) for depth in depths]


def along_flank(depths: list[float], **options: Any) -> list[Cut]:
    return [Cut(depth, -depth * math.tan(HALF), **options) for depth in depths]


def alternating(depths: list[float], **options: Any) -> list[Cut]:
    """Infeed along one flank of the thread, then along the other, in turns."""
    return [Cut(depth, (1 - 2 * (number % 2)) * (HEIGHT - depth) * math.tan(HALF), **options)
            for number, depth in enumerate(depths)]


@pytest.mark.parametrize("degrees", [3.0, 11.0, 25.0])
def test_the_ten_forces_of_m20x1_5(degrees: float) -> None:
    records = cut_passes(ThreadCutting(**EXAMPLE), radial(DEPTHS), degrees=degrees)
    forces = [record["cutting_force"][in_metal(record)] for record in records]
    assert [(one.min(), one.max()) for one in forces] == [
        (pytest.approx(force, abs=1.0), pytest.approx(force, abs=1.0)) for force in M20_FORCES]
    torques = [record["torque"][in_metal(record)].mean() for record in records]
    assert min(torques[:9]) > 1.2
    assert max(torques) < 1.95
    for record in records:
        assert np.abs(record["axial_force"]).max() < 1e-6  # both flanks take the same
        assert record["radial_force"] == pytest.approx(-0.5 * math.sin(HALF) * record["cutting_force"], abs=1e-9)
    shown = [round(float(one.mean()), 1) for one in forces]
    print(f"\nforces in N of the ten passes, seen every {degrees:g} degrees: {shown}")


@pytest.mark.parametrize("infeed", [radial, along_flank, alternating])
def test_torque_over_a_pass_is_volume_times_specific_force(infeed: Any) -> None:
    """Volume of a pass: (A(after) - A(before)) 2 pi r per turn from the face on; the ends of the V make up for it."""
    cutting = ThreadCutting(**RIGID, material=0, specific_cutting_force=1500e6, chip_exponent=0.0)
    turns = 10.25
    cuts = infeed(DEPTHS, turns=turns)
    energies = [float(np.trapezoid(record["torque"], record["angle"])) for record in cut_passes(cutting, cuts)]
    tip = np.array([cut.shift for cut in cuts])
    volumes = [removed_volume(tip[:i + 1], np.array(DEPTHS[:i + 1]), turns) for i in range(len(cuts))]
    volumes = [after - before for before, after in zip([0.0, *volumes], volumes, strict=False)]
    # the shift of the tip makes the way in the metal longer or shorter by a part of a turn
    for energy, volume in zip(energies, volumes, strict=True):
        assert energy == pytest.approx(1500e6 * volume, rel=0.01, abs=0.01)
    total = sum(volumes)
    assert sum(energies) == pytest.approx(1500e6 * total, rel=0.005)
    print(f"\n{infeed.__name__}: {sum(energies):.3f} J over ten passes, volume times k_c1 {1500e6 * total:.3f} J")


def removed_volume(tip: Array, depth: Array, turns: float) -> float:
    """2 pi times the integral of (r dr) over the turns that the tool makes in the metal, on a fine grid.

    z along the helix is unrolled: at every angle the groove is the union of the V of all passes, cut off at the face.
    """
    angle = np.linspace(0.0, APPROACH + turns, 4001)[:, None]  # turns
    offset = np.linspace(-1.2e-3, 1.2e-3, 1201)[None, :]  # m, beside the helix without shift
    groove = np.zeros((angle.size, offset.size))
    for shift, deep in zip(tip, depth, strict=True):
        groove = np.maximum(groove, deep - np.abs(offset - shift) / math.tan(HALF))
    groove = np.where(LEAD * (APPROACH - angle) + offset <= 0.0, groove, 0.0)
    ring = 0.5 * (RADIUS**2 - (RADIUS - groove) ** 2)
    per_angle = np.trapezoid(ring, offset[0], axis=1)
    return float(np.trapezoid(per_angle, TURN * angle[:, 0]))


def test_flank_infeed_cuts_on_one_flank() -> None:
    """One chip of 2 dh sin(e / 2), axial share q cos(e / 2); the other flank stays as the first pass left it."""
    records = cut_passes(ThreadCutting(**EXAMPLE), along_flank(DEPTHS))
    for depth, former, record in zip(DEPTHS[1:], DEPTHS, records[1:], strict=False):
        metal = in_metal(record)
        chips = record["chip_thickness"][metal]  # (points, 2): the flank towards -Z is that towards the feed
        assert chips[:, 0] == pytest.approx(2.0 * (depth - former) * math.sin(HALF), rel=1e-6)
        assert np.abs(chips[:, 1]).max() < 1e-12
        share = record["axial_force"][metal] / record["cutting_force"][metal]
        assert share == pytest.approx(-0.5 * math.cos(HALF))
        assert 0.3 < abs(share[0]) < 0.5
        stays = record["flank_position"][metal][:, 1] - record["tool_z"][metal]
        assert stays == pytest.approx(depth * math.tan(HALF), abs=1e-12)


def test_alternating_infeed_takes_every_bit_once() -> None:
    records = cut_passes(ThreadCutting(**EXAMPLE), alternating(DEPTHS))
    areas = [record["chip_area"][in_metal(record)].mean() for record in records]
    assert areas[:2] == pytest.approx([depth**2 * math.tan(HALF) for depth in DEPTHS[:2]])  # beside each other
    assert sum(areas) == pytest.approx(HEIGHT**2 * math.tan(HALF), rel=1e-9)
    side = [np.sign(np.diff(record["chip_thickness"][in_metal(record)].mean(axis=0)))[0] for record in records[2:]]
    assert side[:6] == [-1, 1] * 3


@pytest.mark.parametrize(("starts", "lead"), [(2, 3e-3), (3, 4.5e-3)])
def test_every_start_has_its_own_groove(starts: int, lead: float) -> None:
    cutting = ThreadCutting(**EXAMPLE, starts=starts)
    cuts = [Cut(depth, -depth * math.tan(HALF), start, turns=6.0) for depth in DEPTHS for start in range(starts)]
    records = cut_passes(cutting, cuts, starts=starts, lead=lead)
    single = cut_passes(ThreadCutting(**EXAMPLE), along_flank(DEPTHS))
    for number, record in enumerate(records):
        assert record["helix"][-1] == number % starts
        expected = single[number // starts]["cutting_force"][-1]
        assert record["cutting_force"][in_metal(record)] == pytest.approx(expected, rel=1e-6)


def test_a_groove_is_the_outermost_flank_of_all_passes() -> None:
    """A last pass 20 um beside the others, not deeper: it cuts one flank, a former pass has left the other."""
    cuts = [Cut(0.5e-3), Cut(0.8e-3), Cut(0.8e-3, -20e-6)]
    last = cut_passes(ThreadCutting(**EXAMPLE), cuts)[-1]
    metal = in_metal(last)
    chips = last["chip_thickness"][metal]
    assert chips[:, 0] == pytest.approx(20e-6 * math.cos(HALF), rel=1e-6)
    assert np.all(chips[:, 1] == 0.0)
    middle = last["tool_z"][metal] + 10e-6
    assert last["groove_position"][metal] == pytest.approx(middle, abs=1e-12)
    width = np.diff(last["flank_position"][metal])[:, 0]
    assert width == pytest.approx(2 * 0.8e-3 * math.tan(HALF) + 20e-6, abs=1e-12)
    assert last["chip_area"][metal] == pytest.approx(20e-6 * 0.8e-3 - 20e-6**2 / 4 / math.tan(HALF), rel=1e-6)


def test_spring_passes_take_what_deflection_has_left() -> None:
    cutting = ThreadCutting(material=2)
    records = cut_passes(cutting, radial([0.3e-3, 0.5e-3, *[0.6e-3] * 4]))
    missing = [float(np.mean(0.6e-3 - record["groove_depth"][in_metal(record)])) for record in records[2:]]
    assert missing[0] > 0.5e-6
    assert all(after < 0.5 * before for before, after in itertools.pairwise(missing))
    for record in records:
        metal = in_metal(record)
        radial_force = -record["radial_force"][metal]
        share = (record["tool_z"][metal] + 0.060) / 0.060
        softness = 1 / 80e6 + 1 / 60e6 + share**3 / 23e6
        assert record["radial_shift"][metal] == pytest.approx(radial_force * softness, rel=1e-4)


@pytest.mark.parametrize("name", ["c15", "c45", "42crmo4", "x5crni18_10", "gjl_250", "almgsi1", "ti6al4v"])
def test_materials_are_chosen_by_name(name: str) -> None:
    variable = next(one for one in ThreadCutting.__dataclass_fields__.values() if one.name == "material")
    number = variable.metadata["threadpitch"].choices[name]
    force = cut_passes(ThreadCutting(**RIGID, material=number), [Cut(0.4e-3)])[0]["cutting_force"][-1]
    chip = 0.4 * math.sin(HALF)  # mm
    area = 0.4**2 * math.tan(HALF)  # mm2
    expected = catalogue_force(number) * 1e-6 * chip ** -catalogue_exponent(number) * area
    assert force == pytest.approx(expected, rel=1e-8)


def test_an_internal_thread_pushes_the_other_way() -> None:
    def run(side: int, x: float) -> ThreadCutting:
        cutting = ThreadCutting(**EXAMPLE, thread_side=side)
        cutting.tool_z = 0.006
        cutting.initialize()
        for i in range(1, 1200):
            cutting.spindle_angle, cutting.threading, cutting.tool_x = math.radians(3.0 * i), True, x
            cutting.tool_z = LEAD * (APPROACH - 3.0 * i / 360.0)
            assert cutting.step(i * 1e-3, 1e-3) == 0
        return cutting

    external, internal = run(0, RADIUS - 0.4e-3), run(1, RADIUS + 0.4e-3)
    assert internal.cutting_force == pytest.approx(external.cutting_force)
    assert internal.radial_force == pytest.approx(-external.radial_force)
    assert external.radial_force < 0.0 < internal.radial_force
    assert external.chip_radius == pytest.approx(RADIUS - 0.4e-3 / 3)
    assert internal.chip_radius == pytest.approx(RADIUS + 0.4e-3 / 3)


def test_a_taper_thread_keeps_its_chip_on_the_conical_surface() -> None:
    taper = -1.0 / 32.0
    cutting = ThreadCutting(**EXAMPLE, taper=taper)
    cutting.tool_z, cutting.tool_x = 0.006, 1.0
    cutting.initialize()
    forces = []
    for i in range(1, 1500):
        cutting.spindle_angle, cutting.threading = math.radians(3.0 * i), True
        cutting.tool_z = LEAD * (APPROACH - 3.0 * i / 360.0)
        cutting.tool_x = RADIUS + taper * cutting.tool_z - 0.3e-3
        assert cutting.step(i * 1e-3, 1e-3) == 0
        forces.append(cutting.cutting_force)
    assert forces[-700:] == pytest.approx([M20_FORCES[0]] * 700, abs=1.0)


def test_no_force_outside_of_the_metal() -> None:
    record = cut_passes(ThreadCutting(**EXAMPLE, shoulder=-0.012), [Cut(0.4e-3)])[0]
    half = 0.4e-3 * math.tan(HALF)
    outside = (record["tool_z"] > half) | (record["tool_z"] < -0.012 - half)
    assert np.all(record["torque"][outside] == 0.0)
    assert record["groove_position"][outside] == pytest.approx(record["tool_z"][outside], abs=1e-15)
    assert record["torque"][(record["tool_z"] < -half) & (record["tool_z"] > -0.012 + half)].min() > 1.0
    assert np.abs(np.diff(record["torque"])).max() < 0.2  # the V enters and leaves the material without a jump


def test_no_material_is_refused() -> None:
    assert ThreadCutting(shoulder=0.0).check() == 1


@pytest.mark.parametrize("turns", [22.5, 45.0, 100.0])
def test_long_threads_have_room(turns: float) -> None:
    """288 points at 10 degrees are 8 turns; every second point is given up until the thread has room."""
    cutting = ThreadCutting(**EXAMPLE, groove_interval=math.radians(10.0))
    records = cut_passes(cutting, along_flank(DEPTHS[:4], turns=turns), degrees=30.0)
    assert cutting.interval >= TURN * turns / 288
    short = cut_passes(ThreadCutting(**EXAMPLE), along_flank(DEPTHS[:4]))
    for record, expected in zip(records, short, strict=True):
        assert record["cutting_force"][in_metal(record)] == pytest.approx(expected["cutting_force"][-1], rel=1e-6)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32))
def test_chips_of_many_passes_are_those_of_a_groove_on_a_grid(seed: int) -> None:
    """Radial, flank and alternating infeed, each pass a little beside where it should be.

    Slivers of that width beside the flanks (2 um by 0.6 mm) are what two V grooves may miss of the union of more.
    """
    chance = random.Random(seed)
    first = chance.uniform(0.15e-3, 0.4e-3)
    depths = [first * math.sqrt(n) for n in range(1, 6)]
    cuts = [Cut(cut.depth + chance.uniform(0.0, 2e-6), cut.shift + chance.uniform(-2e-6, 2e-6), turns=4.0)
            for cut in chance.choice([radial, along_flank, alternating])(depths)]
    records = cut_passes(ThreadCutting(**EXAMPLE), cuts, degrees=15.0)
    offset = np.linspace(-1.3e-3, 1.3e-3, 26001)
    groove = np.zeros(offset.size)
    for cut, record in zip(cuts, records, strict=True):
        after = np.maximum(groove, cut.depth - np.abs(offset - cut.shift) / math.tan(HALF))
        expected = float(np.trapezoid(after - groove, offset))
        assert record["chip_area"][in_metal(record)] == pytest.approx(expected, rel=1e-2, abs=1.2e-9)
        edges = offset[after > 0.0][[0, -1]]
        flanks = (record["flank_position"] - record["tool_z"][:, None])[in_metal(record)] + cut.shift
        if np.all(after[(offset > edges[0]) & (offset < edges[1])] > 0.0):
            assert flanks == pytest.approx(np.tile(edges, (flanks.shape[0], 1)), abs=2e-7)
        groove = after


def steady(record: PassRecord, name: str) -> float:
    return float(record[name][in_metal(record)].mean())


def test_soft_tools_settle() -> None:
    """Where the cutting force's own stiffness comes near to the tool's, the iteration still finds u = F / K."""
    cutting = ThreadCutting(**{**EXAMPLE, "tool_radial_stiffness": 2e5, "tool_axial_stiffness": 2e5})
    for record in cut_passes(cutting, along_flank(DEPTHS[:4])):
        metal = in_metal(record)
        assert record["radial_shift"][metal] == pytest.approx(-record["radial_force"][metal] / 2e5, rel=1e-6)
        assert record["axial_shift"][metal] == pytest.approx(-record["axial_force"][metal] / 2e5, rel=1e-6, abs=1e-12)
    assert steady(record, "radial_shift") > 50e-6
