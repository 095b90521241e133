"""How true threads are: passes on one helix, start angles, starts, speeds.

Of the controller under ideal drives and a steady spindle (its class itself), then of the shipped lathe with its FMUs:
``python -m tests.benchmarks.bench_threading``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from tests.plain_control import COUNTS, TURN, Commands, commanded, controller_of
from threadpitch import lathe
from threadpitch.cosim.values import Given
from threadpitch.cycles import interpret, read_program
from threadpitch.program_parameters import operations

LEAD = 1.5e-3
COUNT = TURN / COUNTS
KV = 50.0  # 1/s, of the shipped drive
CYCLE: dict[str, Any] = {
    "cycle": 1, "z_start": 6e-3, "z_end": -6e-3, "thread_height": 0.92e-3, "first_cut": 0.4e-3, "least_cut": 0.05e-3,
    "allowance": 0.05e-3, "finishing_passes": 2, "tool_angle": math.radians(60.0)}
SINGLE: dict[str, Any] = {"z_start": 6e-3, "z_end": -6e-3, "detector": 1}
PROGRAM = "G97 S600 M3\nG0 X26. Z5.\nG76 P021060 Q50 R0.05\nG76 X18.16 Z-8. P920 Q500 F1.5\nM30\n"

FloatArray = NDArray[np.float64]


def phases(one: Commands) -> FloatArray:
    """Angle (rad, near 0) by which the helix of a pass is off its start angle in every period, flank shift off."""
    start = one.controller.z_start - one["cut_depth"][0] * one.controller.flank
    in_metal = one["z_command"] < 0.0
    helix = one["angle"] - (start - one["z_command"]) / LEAD * TURN - one["start_angle"]
    return np.array([math.remainder(value, TURN) for value in helix[in_metal]])


def repeatability(generator: np.random.Generator, tries: int, **machine: Any) -> float:
    """Largest distance along Z between the helices of all passes of a G76 over speeds and start angles, m."""
    worst = 0.0
    for _ in range(tries):
        speed, start = float(generator.uniform(60.0, 2400.0)), float(generator.uniform(0.0, TURN))
        run = commanded(controller_of(**CYCLE, **machine, first_start_angle=start, commanded_speed=speed / 60.0 * TURN))
        found = np.concatenate([phases(one) for one in run.passes])
        worst = max(worst, float(np.ptp(found)) / TURN * LEAD)
    return worst


def start_error(start: float, **parameters: Any) -> float:
    """By how many counts the helix of a pulse generator's thread lies off the start angle, mean of the pass."""
    run = commanded(controller_of(**SINGLE, first_start_angle=start, **parameters))
    off = run.controller.start_angle - start  # the start in whole counts
    return (float(np.mean(phases(run.passes[-1]))) + math.remainder(off, TURN)) / COUNT


def starts_error(starts: int) -> float:
    """Largest error of the angles between the starts of a thread, counts."""
    run = commanded(controller_of(**SINGLE, starts=starts))
    angles = [one["start_angle"][0] + float(np.mean(phases(one))) for one in run.passes]
    turned = (angle - angles[0] - TURN * k / starts for k, angle in enumerate(angles))
    return max(abs(math.remainder(one, TURN)) for one in turned) / COUNT


def shift_over_speeds(age: float) -> FloatArray:
    """z_command of the shipped lathe against the true spindle angle at 300, 500, 900 rpm, m; told an age of that, s."""
    shifts = []
    for rpm in (300.0, 500.0, 900.0):
        parameters: dict[str, Given] = {
            "controller.commanded_speed": rpm / 60.0 * TURN, "spindle.initial_speed": rpm / 60.0 * TURN,
            "spindle.ripple_amplitude": [0.0], "spindle.encoder_lines": 262144, "controller.counts_per_turn": 1048576.0,
            "controller.command_age": age}
        result = lathe.simulate(parameters=parameters, stop_time=2.5)
        rows = (result["controller.threading"] == 1) & (result["controller.z_command"] < 0.0)
        index = (result["spindle.angle"] - result["spindle.encoder_angle"])[rows][0]
        line = 6e-3 - (result["spindle.angle"][rows] - index) / TURN * LEAD
        error = np.remainder(result["controller.z_command"][rows] - line + 0.5 * LEAD, LEAD) - 0.5 * LEAD
        shifts.append(float(np.mean(error)))
    return np.array(shifts)


def drive_lag() -> tuple[float, float]:
    """Of a G76 on the shipped lathe: largest distance of a pass's mean lag from v / Kv, and between passes; m."""
    (operation,) = operations(interpret(read_program(PROGRAM)))
    result = lathe.simulate(parameters=operation.parameters, stop_time=operation.stop_time)
    off, means = [], []
    for one in operation.passes:
        rows = (result["controller.pass_number"] == one.number) & (result["controller.threading"] == 1)
        rows &= result["controller.z_command"] < 0.0
        line = one.start.z - result["spindle.encoder_angle"][rows] / TURN * LEAD
        lag = np.remainder(result["z_drive.measured_position"][rows] - line + 0.5 * LEAD, LEAD) - 0.5 * LEAD
        means.append(float(np.mean(lag)))
        off.append(abs(means[-1] - float(np.mean(LEAD / TURN * result["spindle.speed"][rows] / KV))))
    return max(off), float(np.ptp(means))


def figures(tries: int) -> list[tuple[str, str]]:
    """Lines of the table: what, and its figure."""
    generator = np.random.default_rng(5)
    ideal = repeatability(generator, tries)
    limited = repeatability(generator, tries, acceleration_limit=2.0)
    angles = [abs(start_error(float(generator.uniform(0.0, TURN)))) for _ in range(4 * tries)]
    near = [start_error((counts % COUNTS) * COUNT, commanded_speed=speed)
            for counts in range(-3, 4) for speed in (30.0, 52.0, 90.0)]
    off, apart = drive_lag()
    lines = [
        (f"passes on one helix, ideal drive, {tries} G76 at 60 to 2400 rpm from any angle", f"{ideal * 1e9:.1g} nm"),
        ("the same with the shipped acceleration of 2 m/s2, in the metal", f"{limited * 1e9:.1g} nm"),
        ("shipped drives: mean lag of a pass less v / Kv", f"{off * 1e6:.3f} um"),
        ("shipped drives: mean lag from pass to pass", f"{apart * 1e6:.3f} um"),
        (f"helix off its start angle, {len(angles)} angles, 4096 counts", f"{max(angles):.3f} counts"),
        ("Q from 3 counts before to 3 after the index, three speeds", f"{max(map(abs, near)):.3f} counts"),
    ]
    lines += [(f"{starts} starts, angle between them", f"{starts_error(starts):.3f} counts") for starts in (2, 3, 10)]
    for age in (0.0, 1e-3):
        shifts = ", ".join(f"{abs(shift) * 1e6:.4f}" for shift in shift_over_speeds(age))
        lines.append((f"start shift at 300, 500, 900 rpm, age told {age * 1e3:g} ms wrong", f"{shifts} um"))
    return lines


def main() -> None:
    """Prints the table."""
    table = Table(title="threads")
    table.add_column("what")
    table.add_column("largest", justify="right")
    for line in figures(40):
        table.add_row(*line)
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
