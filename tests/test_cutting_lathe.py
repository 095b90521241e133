"""The cutting process in the whole lathe: what the drives receive, and what the thread looks like afterwards."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.plain_system import read_plan
from threadpitch import lathe
from threadpitch.cosim.values import Given

HALF = math.radians(30.0)
RADIUS = 0.010
Array = NDArray[np.float64]

pytestmark = pytest.mark.usefixtures("fmu_cache")

# Three passes to 0.5 mm by flank infeed; a specific force that does not depend on the chip
PASSES: Mapping[str, Given] = {
    "controller.cycle": "multiple", "controller.thread_height": "0.5mm", "controller.x_thread": "9.5mm",
    "controller.first_cut": "0.3mm", "controller.least_cut": 0.0, "controller.allowance": 0.0,
    "controller.finishing_passes": 0, "controller.z_end": "-15mm",
    "cutting.material": "custom", "cutting.chip_exponent": 0.0, "cutting.specific_cutting_force": "1500N/mm2",
}


@functools.cache
def run() -> lathe.Simulation:
    return lathe.simulate(parameters=PASSES, stop_time=8.0, start_angles=[0.0])


def of_pass(number: int) -> NDArray[np.bool_]:
    result = run()
    chosen = np.asarray(result["controller.pass_number"]) == number
    return np.asarray(chosen & (np.asarray(result["controller.threading"]) == 1))


def column(name: str) -> Array:
    return np.asarray(run()[name], dtype=np.float64)


@pytest.mark.parametrize("number", [1, 2, 3])
def test_the_spindle_gives_volume_times_specific_force(number: int) -> None:
    """Work of the load torque = k_c1 (V after - V before), V the integral of h^2 tan(e/2) (R - h/3) over the angle.

    The spindle receives the torque one communication step later, which its work contains.
    """
    turned = np.diff(column("spindle.angle"))
    received = column("cutting.torque")[:-1]
    work = float((received * turned)[of_pass(number)[1:]].sum())
    after = volume(number) - (volume(number - 1) if number > 1 else 0.0)
    assert work == pytest.approx(1500e6 * after, rel=0.01)
    print(f"\npass {number}: work on the spindle {work:.3f} J, volume of the groove times k_c1 {1500e6 * after:.3f} J")


def volume(number: int) -> float:
    """The groove after this pass, by the tool's true path from the face on."""
    rows = of_pass(number) & (column("cutting.groove_position") <= 0.0)
    depth, angle = column("cutting.groove_depth")[rows], column("spindle.angle")[rows]
    return float(np.trapezoid(depth**2 * math.tan(HALF) * (RADIUS - depth / 3.0), angle))


def test_forces_go_back_into_the_drives() -> None:
    """Flank infeed pushes against the feed, and X outwards; the spindle slows down by it."""
    links = {(link.source_component, link.source.name): (link.target_component, link.target.name)
             for link in read_plan().links if link.source_component == "cutting"}
    assert links["cutting", "torque"] == ("spindle", "load_torque")
    assert links["cutting", "axial_force"] == ("z_drive", "load_force")
    assert links["cutting", "radial_force"] == ("x_drive", "load_force")
    assert links["cutting", "groove_position"] == ("actual_pitch", "feed_position")
    steady = of_pass(3) & (column("z_drive.position") < -5e-3) & (column("z_drive.position") > -10e-3)
    assert column("cutting.axial_force")[steady].max() < -20.0
    assert column("cutting.radial_force")[steady].max() < -10.0
    slow = column("spindle.speed")[of_pass(1) & (column("z_drive.position") < 0.0)].min()
    fast = column("spindle.speed")[of_pass(1) & (column("z_drive.position") > 2e-3)].min()
    assert slow < fast - 0.02  # rad/s: the spindle feels the torque


def test_the_thread_follows_the_controllers_workpiece() -> None:
    """Another diameter and face of the program are those of the workpiece, where no other is given."""
    moved: dict[str, Given] = {"controller.x_surface": "12mm", "controller.x_thread": "11.7mm",
                               "controller.z_face": "3mm", "controller.z_end": "-5mm"}
    given = lathe.simulate(parameters=moved, stop_time=2.2, start_angles=[0.0])
    depth = np.asarray(given["cutting.groove_depth"])[np.asarray(given["cutting.torque"]) > 0.0]
    assert depth.size > 500
    assert depth == pytest.approx(0.3e-3, abs=5e-6)
    first = np.flatnonzero(np.asarray(given["cutting.torque"]) > 0.0)[0]
    assert np.asarray(given["z_drive.position"])[first] == pytest.approx(3e-3 + 0.3e-3 * math.tan(HALF), abs=3e-5)


def test_a_tapered_thread_has_a_tapered_workpiece() -> None:
    """As deep at its beginning as at its end: the surface follows the controller's taper."""
    tapered: dict[str, Given] = {"controller.taper": "-0.4mm", "controller.z_end": "-12mm"}
    given = lathe.simulate(parameters=tapered, stop_time=2.2, start_angles=[0.0])
    cutting = np.asarray(given["cutting.torque"]) > 0.0
    place, depth = np.asarray(given["z_drive.position"])[cutting], np.asarray(given["cutting.groove_depth"])[cutting]
    assert np.ptp(np.asarray(given["x_drive.position"])[cutting]) > 0.2e-3
    assert place.min() < -10e-3
    assert depth == pytest.approx(0.3e-3, abs=8e-6)
