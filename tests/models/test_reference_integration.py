"""The stepped lathe against one tight reference integration of the same equations, sampled alike.

The reference integrates the plants with scipy's DOP853 at a tolerance of 1e-12 from one sampling instant to the next,
with the loops written down here a second time, and finds the crossings as roots of the dense solution.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from fmu_src.pitch_calculator import CUBIC, LINEAR
from tests.plain_lathe import IDEAL_DETECTORS, TURN, Array, Lathe, Recording, merged, start_angles
from threadpitch.cosim import Event, Method, simulate
from threadpitch.cosim.system import Component, Connection, System
from threadpitch.fmu import available_compiler, cached_fmu

LEAD = 1.5e-3
STOP = 1.1
PARAMETERS: dict[str, dict[str, Any]] = merged(IDEAL_DETECTORS, {
    "spindle": {"initial_speed": 500 / 60 * TURN, "initial_angle": 1.0,
                "ripple_amplitude": [2.0, 0.5, 0.0, 0.0], "ripple_order": [1.3, 4.0, 1.0, 1.0]},
    "controller": {"speed_settling": 0.0, "x_thread": 0.012, "speed_tolerance": 0.05},
    "calculator": start_angles(0.0, 90.0, 180.0, 270.0),
})


@dataclass
class Solution:
    """Dense pieces of a trajectory: piece i holds from times[i] to times[i + 1]."""

    times: list[float]
    pieces: list[Callable[[float], Array]]

    def __call__(self, time: float) -> Array:
        i = min(max(int(np.searchsorted(self.times, time, side="right")) - 1, 0), len(self.pieces) - 1)
        return self.pieces[i](time)


def piecewise(rates: Callable[..., list[float]], sample: Callable[[int, Array], float], period: float,
              start: list[float]) -> Solution:
    """Integrates `rates(t, y, held)`, held = sample(k, y) at t = k period."""
    solution, state = Solution([], []), np.array(start)
    for k in range(round(STOP / period)):
        held = sample(k, state)
        piece = solve_ivp(rates, (k * period, (k + 1) * period), state, method="DOP853", args=(held,),
                          dense_output=True, rtol=1e-12, atol=1e-14)
        assert piece.success
        solution.times.append(k * period)
        assert piece.sol is not None
        solution.pieces.append(piece.sol)
        state = piece.y[:, -1]
    return solution


@functools.cache
def spindle_reference() -> Solution:
    """theta' = omega, J omega' = T + ripple - friction - load, PI loop at 0.5 ms."""
    p = Lathe(PARAMETERS).spindle
    integral = p.speed_integral

    def sample(_k: int, y: Array) -> float:
        nonlocal integral
        error = 500 / 60 * TURN - y[1]
        torque = p.speed_gain * error + integral
        assert abs(torque) < p.torque_limit
        integral += p.integral_gain * p.loop_period * error
        return float(torque)

    def rates(_t: float, y: Array, torque: float) -> list[float]:
        ripple = sum(a * math.sin(q * y[0]) for a, q in zip(p.ripple_amplitude, p.ripple_order, strict=True))
        s = y[1] / p.friction_speed
        friction = p.friction_torque * s / math.sqrt(1 + s * s) + p.viscous_friction * y[1]
        return [y[1], (torque + ripple - friction) / p.inertia]

    return piecewise(rates, sample, p.loop_period, [p.initial_angle, p.initial_speed])


def commands(step_size: float) -> list[float]:
    """z command at k ms, read by the drive at that instant: the newest the controller has made by k ms + step_size."""
    spindle = spindle_reference()
    controller = Lathe(PARAMETERS).controller
    made = []
    for k in range(1, round(STOP / 1e-3) + 1):
        controller.spindle_angle = float(spindle(k * 1e-3)[0])
        assert controller.step((k - 1) * 1e-3, 1e-3) == 0
        made.append(controller.z_command)
    return made if step_size >= 1e-3 - 1e-9 else [made[0], *made[:-1]]


@functools.cache
def drive_reference(step_size: float) -> Solution:
    """Two masses, current loop, position and velocity loops sampled at 250 and 125 us, commands at 1 ms."""
    p = Lathe(PARAMETERS).drive
    read = commands(step_size)
    if step_size < 1e-3 - 1e-9:
        read[0] = p.initial_position
    r = p.screw_lead / TURN
    mass = p.table_mass + p.motor_inertia / r**2
    loop = {"start": p.initial_position, "end": p.initial_position, "velocity": 0.0, "integral": 0.0}

    def sample(k: int, y: Array) -> float:
        if k % 8 == 0:
            loop["start"], loop["end"] = loop["end"], read[k // 8]
        if k % 2 == 0:
            command = loop["start"] + (loop["end"] - loop["start"]) * (k % 8) / 8
            loop["velocity"] = p.position_gain * (command - r * y[0])
        error = loop["velocity"] - r * y[1]
        force = mass * p.velocity_gain * (error + loop["integral"])
        assert abs(force) < p.torque_limit / r
        loop["integral"] += p.velocity_period / p.integral_time * error
        return float(force)

    def rates(_t: float, y: Array, command: float) -> list[float]:
        angle, omega, x, v, force = y
        axial = p.axial_stiffness * (r * angle - x) + p.axial_damping * (r * omega - v)
        s = v / p.friction_speed
        dry = p.coulomb_friction + (p.static_friction - p.coulomb_friction) / (1 + (v / p.stribeck_speed) ** 2)
        friction = dry * s / math.sqrt(1 + s * s) + p.viscous_friction * v
        return [omega, (r * (force - axial) - p.motor_friction * omega) / p.motor_inertia, v,
                (axial - friction) / p.table_mass, (command - force) / p.torque_time_constant]

    return piecewise(rates, sample, p.velocity_period, [p.initial_position / r, 0.0, p.initial_position, 0.0, 0.0])


def reference_pitches(step_size: float, first: float, turns: int) -> tuple[Array, Array]:
    """(nominal, true) P(n) between exact crossings of first + 2 pi n."""
    spindle, drive = spindle_reference(), drive_reference(step_size)
    radius = 0.010 / TURN
    nominal, true = [], []
    for n in range(turns + 1):
        angle = first + n * TURN
        crossing = brentq(lambda t, angle=angle: float(spindle(t)[0]) - angle, 0.0, STOP, xtol=1e-15, rtol=1e-14)
        nominal.append(radius * float(drive(crossing)[0]))
        true.append(float(drive(crossing)[2]))
    return -np.diff(nominal), -np.diff(true)


def curvature_bound(run: Recording, step_size: float) -> float:
    """H^2 / 8 max|x''| after the start transient: of xi over theta, in time."""
    settled = slice(round(0.5 / step_size), None)
    line = run.measured - np.polyval(np.polyfit(run.angle, run.measured, 1), run.angle)
    return float(np.abs(np.diff(line[settled], 2)).max() / 8)


@functools.cache
def differences(step_size: float, estimate: int = LINEAR) -> tuple[Recording, float, float]:
    """(run, largest pitch difference of all turns, of the settled turns), nominal and true, four start angles."""
    lathe = Lathe(merged(PARAMETERS, {"calculator": {"crossing_estimate": estimate}}))
    run = lathe.run(STOP, step_size)
    everywhere, settled = 0.0, 0.0
    for i in range(4):
        found = (run.nominal[i], run.actual[i])
        turns = len(found[0])
        assert turns >= 6
        for values, expected in zip(found, reference_pitches(step_size, lathe.nominal.first_crossing[i], turns),
                                    strict=True):
            difference = np.abs(np.array(values) - expected)
            everywhere = max(everywhere, float(difference.max()))
            settled = max(settled, float(difference[3:].max()))
    return run, everywhere, settled


def test_settled_pitches_within_a_nanometre_of_the_reference() -> None:
    for step_size in (1e-3, 5e-4, 2.5e-4):
        run, everywhere, settled = differences(step_size)
        acceleration = np.abs(np.diff(run.position, 2)).max() / step_size**2
        start_bound = step_size**2 / 8 * acceleration
        print(f"H {step_size * 1e3:5.2f} ms: settled turns differ by {settled * 1e9:.4f} nm (bound of the linear "
              f"crossing {curvature_bound(run, step_size) * 1e9:.4f} nm), all turns by {everywhere * 1e9:.3f} nm "
              f"(bound H^2/8 max|x''| {start_bound * 1e9:.1f} nm)")
        assert settled < 1e-9
        assert everywhere < 2 * start_bound  # two crossings make a pitch


def test_difference_shrinks_with_the_square_of_the_step() -> None:
    coarse, fine = differences(1e-3)[2], differences(2.5e-4)[2]
    print(f"settled difference {coarse * 1e9:.4f} nm at 1 ms, {fine * 1e9:.4f} nm at 0.25 ms")
    assert fine < coarse / 4


def test_a_cubic_crossing_leaves_a_thousandth_of_a_nanometre() -> None:
    """The controller runs every millisecond, so that steps of a millisecond and less give the same control."""
    for step_size in (1e-3, 5e-4, 2.5e-4):
        everywhere, settled = differences(step_size, CUBIC)[1:]
        print(f"H {step_size * 1e3:5.2f} ms: settled turns differ by {settled * 1e9:.5f} nm, all turns by "
              f"{everywhere * 1e9:.4f} nm")
        assert settled < 1e-12
        assert everywhere < 2e-9


def test_a_cubic_crossing_converges_with_a_high_order() -> None:
    """While the drive accelerates: of order two by straight lines, of order three and more by the cubic."""
    for estimate, least in ((LINEAR, 1.2), (CUBIC, 3.0)):
        errors = [differences(step_size, estimate)[1] for step_size in (1e-3, 5e-4, 2.5e-4)]
        orders = [math.log2(coarse / fine) for coarse, fine in pairwise(errors)]
        print(f"estimate {estimate}: all turns by {', '.join(f'{one * 1e9:.4f}' for one in errors)} nm, "
              f"orders {orders[0]:.2f} {orders[1]:.2f}")
        assert min(orders) > least - 0.2


@pytest.mark.skipif(available_compiler() is None, reason="no C compiler and no ziglang")
@pytest.mark.parametrize("step_size", [0.01, 1e-3, 2.5e-4])
def test_a_crossing_is_located_to_a_nanosecond_whatever_the_step(step_size: float) -> None:
    """The master goes back and divides the step; the calculator knows the points alone, and is as good up to 1 ms."""
    reference = spindle_reference()
    levels = [1.0 + turn * TURN + 0.7 for turn in range(1, 8, 2)]
    times = [brentq(lambda t, level=level: float(reference(t)[0]) - level, 0.0, STOP, xtol=1e-15, rtol=1e-14)
             for level in levels]
    fmus = {"spindle": cached_fmu("fmu_src/spindle_drive.py", "native"),
            "calculator": cached_fmu("fmu_src/pitch_calculator.py", "native")}
    system = System("crossing", tuple(Component(name, fmu) for name, fmu in fmus.items()), (
        Connection("spindle", "encoder_angle", "calculator", "spindle_angle"),
        Connection("spindle", "angle", "calculator", "feed_position", convert_units=False)))
    given = {f"spindle.{name}": value for name, value in (PARAMETERS["spindle"] | {"detector": 0}).items()}
    given |= {"spindle.speed_command": 500 / 60 * TURN, "calculator.threading": True, "calculator.start_angle": [1.7],
              "calculator.crossing_estimate": "cubic"}
    method = Method(events=tuple(Event("spindle.angle", level, "rising") for level in levels))
    found = simulate(system, step_size=step_size, stop_time=1.0, method=method, parameters=given).events
    late = max(abs(event.time - time) for event, time in zip(found, times, strict=True))
    plain = simulate(system, step_size=step_size, stop_time=1.0, parameters=given)["calculator.crossing_time[1]"]
    estimated = max(float(np.abs(plain - time).min()) for time in times)
    print(f"H {step_size * 1e3:5.2f} ms: located within {late:.1e} s, estimated within {estimated:.1e} s")
    assert late < 1e-9
    assert estimated < (1e-9 if step_size <= 1e-3 else 1e-6)
