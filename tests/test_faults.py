"""Every fault of the library against the closed formula of its signature, on the whole simulated lathe."""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.conftest import Command
from tests.models.test_drive_physics import sine_amplitude
from threadpitch import faults, lathe

TURN = 2.0 * math.pi
LEAD = 1.5e-3
OMEGA = 500.0 / 60.0 * TURN
KV = 50.0
FIRST = 8  # turns from here on are in the metal and steady
Array = NDArray[np.float64]

pytestmark = pytest.mark.usefixtures("fmu_cache")


@functools.cache
def run(name: str) -> lathe.Simulation:
    fault = faults.read_fault(name)
    return lathe.simulate(parameters=fault.parameters, stop_time=fault.stop_time)


def deviations(name: str, calculator: str = "actual_pitch", angle: int = 0) -> Array:
    """P(n) - lead of the last pass, m."""
    row = run(name).passes_of(calculator)[-1].deviation[angle]
    return np.asarray(row[np.isfinite(row)])


def at_the_crossings(name: str, variable: str) -> Array:
    """A variable where P(1), P(2), ... of the first start angle end, beginning where P(1) begins."""
    result = run(name)
    threading = np.asarray(result["controller.threading"], dtype=bool)
    angle = np.asarray(result["spindle.angle"])
    begin = math.floor(angle[np.flatnonzero(threading)[0]] / TURN + 0.5)
    turns = begin + np.arange(deviations(name).size + 1)
    found: Array = np.interp(turns * TURN, angle, np.asarray(result[variable], dtype=np.float64))
    return found


def test_each_fault_says_what_it_is() -> None:
    names = faults.fault_names()
    assert set(names) == {
        "none", "spindle_dip", "belt_ripple", "low_gain", "saturation", "short_start", "screw_lead_error",
        "periodic_screw_error", "backlash", "loose_nut", "thin_section", "hard_spot", "thermal_growth",
        "encoder_eccentricity", "missed_counts"}
    text = (lathe.shipped("models") / "faults" / "README.md").read_text(encoding="utf-8")
    for name in names:
        fault = faults.read_fault(name)
        assert fault.cause in {"control", "mechanical", "none"}
        signature = fault.signature.replace("|", r"\|")
        assert f"| `{name}` | {fault.cause} | {signature} |" in text, f"models/faults/README.md: {name}"
        assert set(faults.read_fault("none").parameters) <= set(fault.parameters)


@pytest.mark.parametrize("name", faults.fault_names())
def test_the_cause_is_what_the_two_pitches_show(name: str) -> None:
    """Control: both fluctuate alike; mechanical: the actual pitches alone; none: neither."""
    nominal, actual = deviations(name, "nominal_pitch"), deviations(name)
    shown = slice(1, None)
    clean_nominal, clean_actual = deviations("none", "nominal_pitch"), deviations("none")
    if name == "low_gain":  # its own lag at the start
        shown = slice(FIRST, None)
    size = min(one.size for one in (nominal, actual, clean_nominal, clean_actual))
    from_control = np.abs(nominal[:size] - clean_nominal[:size])[shown].max()
    beside = np.abs((actual[:size] - clean_actual[:size]) - (nominal[:size] - clean_nominal[:size]))[shown].max()
    cause = faults.read_fault(name).cause
    assert (from_control > 1.2e-6) == (cause == "control"), from_control
    assert (beside > 1.2e-6) == (cause == "mechanical"), beside


def test_without_a_fault_there_is_jitter_only() -> None:
    for calculator in ("nominal_pitch", "actual_pitch"):
        assert np.abs(deviations("none", calculator)[FIRST:]).max() < 0.15e-6


@pytest.mark.parametrize(("name", "torque", "order", "gain"), [
    ("belt_ripple", 8.0, 0.61, KV), ("low_gain", 4.0, 0.23, 12.0)])
def test_ripple_of_a_broken_order(name: str, torque: float, order: float, gain: float) -> None:
    """2 |sin(pi q)| F / (2 pi) Omega / sqrt(Kv^2 + (q omega)^2), Omega = A / |Kp + j (J w - Ki / w)|, w = q omega."""
    frequency = order * OMEGA
    ripple = torque / math.hypot(14.0, 0.15 * frequency - 260.0 / frequency)
    expected = 2 * math.sin(math.pi * order) * LEAD / TURN * ripple / math.hypot(gain, frequency)
    assert expected > 2e-6
    for calculator in ("nominal_pitch", "actual_pitch"):
        assert sine_amplitude(deviations(name, calculator)[FIRST:], order) == pytest.approx(expected, rel=0.05)


def test_spindle_dip() -> None:
    """dP = -F dN / (60 Kv); the speed falls by no more than T / Kp."""
    speed = at_the_crossings("spindle_dip", "spindle.speed") * 60.0 / TURN  # rpm
    found = deviations("spindle_dip")
    expected = -LEAD * np.diff(speed) / 60.0 / KV
    assert np.abs(found - expected)[3:].max() < 0.12 * np.abs(expected).max()
    dip = 500.0 - speed.min()
    torque = float(np.max(run("spindle_dip")["cutting.torque"]))
    assert 0.5 * torque / 0.4 < dip * TURN / 60.0 < torque / 0.4


def test_saturation() -> None:
    """The motor gives its limit until the lag is v / Kv: what the first turns lose, later ones gain but for that."""
    found = deviations("saturation", "nominal_pitch")
    assert found[0] < -1e-3
    assert found.sum() == pytest.approx(-LEAD * OMEGA / TURN / KV, rel=0.01)
    torque = np.abs(at_the_crossings("saturation", "z_drive.torque"))
    behind = int(np.flatnonzero(found > 50e-6).max())
    assert torque[1:behind] == pytest.approx([0.45] * (behind - 1), rel=1e-3)


def test_short_start() -> None:
    """Two lags in series: e = v (T + s) - v (T^2 exp(-t / T) - s^2 exp(-t / s)) / (T - s), P(n) = F - e(n) + e(n-1)."""
    lag, loop, velocity = 0.1, 1.0 / KV, LEAD * OMEGA / TURN
    found = deviations("short_start", "nominal_pitch")
    time = np.arange(found.size + 1) * TURN / OMEGA
    decay = (lag**2 * np.exp(-time / lag) - loop**2 * np.exp(-time / loop)) / (lag - loop)
    expected = -np.diff(velocity * (lag + loop) - velocity * decay)
    assert found == pytest.approx(expected, rel=0.01, abs=0.3e-6)


def test_progressive_errors() -> None:
    """F slope; -F alpha dT / (1 + alpha dT); -F missed / counts."""
    growth = 11.5e-6 * 80.0
    for name, expected in (("screw_lead_error", LEAD * 1e-3), ("thermal_growth", -LEAD * growth / (1 + growth)),
                           ("missed_counts", -LEAD * 12 / 4096)):
        for angle in range(2):
            assert deviations(name, angle=angle)[FIRST:] == pytest.approx(expected, abs=0.06e-6), name
        assert np.abs(deviations(name, "nominal_pitch")[FIRST:]).max() < 0.15e-6


def test_periodic_screw_error() -> None:
    """2 A |sin(pi F / p)|, once per screw turn."""
    expected = 2 * 8e-6 * math.sin(math.pi * 0.15)
    assert sine_amplitude(deviations("periodic_screw_error")[FIRST:], 0.15) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("name", "lost", "stiffness"), [("backlash", 30e-6, 120e6), ("loose_nut", 0.0, 4e6)])
@pytest.mark.parametrize("angle", range(4))
def test_the_table_gives_way_at_the_entry(name: str, lost: float, stiffness: float, angle: int) -> None:
    """The axial force of the last pass pulls it ahead by backlash + F (1 / K + 1 / K_tool), in a turn or two."""
    simulation = run(name)
    force = np.asarray(simulation["cutting.axial_force"])
    last = np.asarray(simulation["controller.pass_number"]) == 2
    last &= np.asarray(simulation["z_drive.position"]) < -5e-3
    steady = float(force[last & (np.asarray(simulation["controller.threading"]) == 1)].mean())
    assert steady > 50.0
    seen, shown = (deviations(name, calculator, angle) for calculator in ("nominal_pitch", "actual_pitch"))
    beside = (shown - seen)[2:]  # without the start of the feed
    assert beside[:FIRST].sum() == pytest.approx(lost + steady * (1 / stiffness + 1 / 50e6), abs=0.3e-6)
    assert np.sort(beside)[-2:].sum() > 0.9 * beside.sum()
    assert np.abs(beside[FIRST - 2:]).max() < 0.1e-6
    (metal,) = (one.in_metal[angle] for one in simulation.passes if one.number == 2)
    assert np.abs(seen[metal[:seen.size]]).max() < 1.2e-6


def test_thin_section() -> None:
    """u = F_r / K tan(e / 2) hump; P(n) = F - (u(n) - u(n - 1)) on the flank towards -Z."""
    place = at_the_crossings("thin_section", "z_drive.position")
    force = -at_the_crossings("thin_section", "cutting.radial_force")
    shape = np.where(np.abs(place + 0.015) < 0.003, 0.5 + 0.5 * np.cos(TURN * (place + 0.015) / 0.006), 0.0)
    expected = -np.diff(force / 1e6 * math.tan(math.pi / 6) * shape)
    assert np.abs(expected).max() > 8e-6
    assert deviations("thin_section")[FIRST:] == pytest.approx(expected[FIRST:], abs=0.4e-6)


def test_hard_spot() -> None:
    """One event: P(n) and P(n + 1) off by dF_r (1 / K_tool + 1 / K_workpiece) tan(e / 2), nothing half a turn away."""
    found = deviations("hard_spot")
    worst = int(np.argmin(found[FIRST:])) + FIRST
    force = -at_the_crossings("hard_spot", "cutting.radial_force")
    rise = force[worst + 1] - 0.5 * (force[worst] + force[worst + 2])
    share = (at_the_crossings("hard_spot", "z_drive.position")[worst + 1] + 0.060) / 0.060
    yielding = 1 / 20e6 + 1 / 60e6 + share**3 / 23e6
    assert found[worst] == pytest.approx(-rise * yielding * math.tan(math.pi / 6), rel=0.1)
    assert found[worst + 1] == pytest.approx(-found[worst], rel=0.05)
    assert abs(found[worst]) > 4e-6
    assert np.abs(deviations("hard_spot", angle=2)[FIRST:]).max() < 0.1e-6


def test_eccentric_encoder_shows_within_the_turn_only() -> None:
    """w = F / 360 deg e Kv / sqrt(Kv^2 + omega^2), nothing in P(n); the velocity loop adds 5 % at 500 rpm."""
    for angle in range(2):
        assert np.abs(deviations("encoder_eccentricity", angle=angle)[FIRST:]).max() < 0.1e-6
    simulation = run("encoder_eccentricity")
    turned = np.asarray(simulation["spindle.angle"])
    within = np.asarray(simulation["cutting.groove_position"]) + LEAD / TURN * turned
    metal = (np.asarray(simulation["controller.threading"]) == 1) & (np.asarray(simulation["z_drive.position"]) < -5e-3)
    columns = np.column_stack([np.sin(turned), np.cos(turned), np.ones(turned.size), turned])[metal]
    sine, cosine, *_ = np.linalg.lstsq(columns, within[metal], rcond=None)[0]
    expected = LEAD * 0.3 / 360.0 * KV / math.hypot(KV, OMEGA)
    assert math.hypot(sine, cosine) == pytest.approx(expected, rel=0.06)


def test_run_takes_a_fault_by_its_name(threadpitch: Command, workplace: Any) -> None:
    outcome = threadpitch("run", "--fault", "screw_lead_error", "--set", "controller.z_end=-12mm", "--start-angle", 0)
    assert outcome.status == 0, outcome.err
    assert "Fault screw_lead_error (mechanical)" in outcome.out
    assert "Signature: P(n) = F (1 + slope)" in outcome.out


def test_an_unknown_fault_is_refused(threadpitch: Command) -> None:
    outcome = threadpitch("run", "--fault", "hard_spt")
    assert outcome.status == 2
    assert "no fault 'hard_spt'; there are backlash, belt_ripple" in outcome.err
    assert outcome.err.count("\n") == 1
