"""Plain Python class = PythonFMU FMU = native FMU of FMI 2.0 and 3.0, bit for bit, over whole passes and programs.

The FMUs run in a process without threadpitch.
"""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.fmu.native.building import needs_compiler
from tests.plain_system import PlainSystem, read_plan
from threadpitch import lathe
from threadpitch.cosim.values import Given
from threadpitch.cycles import Setup, interpret, read_program
from threadpitch.fmu import cached_fmu
from threadpitch.program_parameters import operations

ALONE = Path(__file__).parent / "whole_pass_alone.py"
STEP_SIZE = 1e-3
STEPS = 4000

# a tapered thread of two starts, lead 3 and pitch 1.5, in three passes each, with run-out
PROGRAM = """G97 S1500 M3
G0 X24. Z4.
G76 P011060 Q50 R0.05
G76 X18.16 Z-6. R-0.2 P920 Q900 F3.
M30
"""


def of_program() -> dict[str, Given]:
    """The parameters of the program's one operation."""
    (operation,) = operations(interpret(read_program(PROGRAM), Setup(starts=2)))
    assert [(one.start_number, one.kind) for one in operation.passes] == [
        (1, "rough"), (1, "finish"), (2, "rough"), (2, "finish")]
    return dict(operation.parameters)


PARAMETERS: dict[str, dict[str, Given]] = {
    "shipped": {},  # with ripple, backlash, screw errors, quantised detectors
    "at_its_limits": {
        "spindle.torque_limit": 20.0, "spindle.eccentricity": 1e-3, "spindle.detector": "hall_element",
        "spindle.hall_error": 2e-4, "controller.start_mode": "exponential", "controller.counter_overflow": True,
        "controller.first_start_angle": 2.0, "controller.z_end": -0.026,
        "z_drive.torque_limit": 0.9, "z_drive.detector": "linear_scale", "z_drive.scale_resolution": 1e-6,
        "z_drive.backlash": 2e-5, "z_drive.temperature_rise": 8.0, "z_drive.table_spacing": 0.02,
        "z_drive.lead_table": [0.0, 2e-6, -1e-6, 3e-6, 1e-6, -2e-6, 4e-6, 0.0, 1e-6],
        "nominal_pitch.use_threading_start": True, "actual_pitch.feed_direction": -1,
    },
    "g76_program": of_program() | {
        "controller.start_mode": "s_shaped", "controller.acceleration_limit": 5.0, "controller.start_order": 1,
        "controller.infeed_axis": "z", "controller.z_clear": 6e-3, "controller.surface_speed": 1.6,
        "controller.highest_speed": 157.0,
        "x_drive.backlash": 1e-5, "x_drive.detector": "linear_scale",
    },
    "special_groove": {
        "controller.start_each_block": True, "controller.further_blocks": 3, "controller.lead": 4e-3,
        "controller.z_end": 0.004, "controller.further_z": [0.003, 0.003, -0.03],
        "controller.further_x": [0.0097, 0.0097, 0.0107], "controller.further_lead": [4e-3, 0.0, 3e-3],
        "controller.further_lead_change": [0.0, 0.0, 1e-4], "controller.further_start_angle": [4.7, 1.5, 3.1],
        "controller.run_out_length": 2e-3, "controller.run_out_height": 1e-3, "controller.surface_speed": 0.5,
    },
}


class PlainRun:
    """The whole pass with plain objects: rows as bits, and what happened in it."""

    def __init__(self, parameters: dict[str, Given]) -> None:
        self.plan = read_plan(parameters=parameters)
        system = PlainSystem(self.plan)
        system.settle()
        self.layouts = system.layouts
        spindle, drive, controller = (system.components[name].model for name in ("spindle", "z_drive", "controller"))
        self.models = spindle, drive, controller
        self.seen: list[tuple[float, ...]] = []
        rows = [system.row()]
        for step in range(STEPS):
            system.gauss_seidel_step(step * STEP_SIZE, STEP_SIZE)
            rows.append(system.row())
            radius = drive.screw_lead / (2.0 * np.pi)
            screw = radius * drive.motor_angle
            self.seen.append((controller.phase, spindle.torque_command, drive.force_command * radius,
                              screw + drive._screw_error(screw) - drive.position,
                              spindle.encoder_angle, drive.measured_position))
        self.rows = b"".join(rows)


@pytest.fixture(scope="module")
def plain_run() -> Callable[[str], PlainRun]:
    """One run per set of parameters."""
    runs: dict[str, PlainRun] = {}

    def run(name: str) -> PlainRun:
        if name not in runs:
            runs[name] = PlainRun(PARAMETERS[name])
        return runs[name]

    return run


def job(run: PlainRun, flavor: str, fmi: int) -> dict[str, Any]:
    plan = run.plan
    fmus = {name: cached_fmu(lathe.model_file(plan.descriptions[name].path.stem), flavor, fmi=fmi)
            for name in plan.order}
    return {
        "components": [{"name": layout.component, "fmu": str(fmus[layout.component]),
                        "names": layout.names, "struct": layout.struct} for layout in run.layouts],
        "settings": [(one.component, one.variable.kind, one.variable.name, one.value) for one in plan.settings],
        "links": [{"source": (link.source_component, link.source.name),
                   "target": (link.target_component, link.target.name), "kind": link.source.kind}
                  for link in plan.links],
        "steps": STEPS, "step_size": STEP_SIZE,
    }


def columns(run: PlainRun, rows: bytes) -> dict[str, list[float | int]]:
    """``component.variable`` -> its value in every row."""
    row = struct.Struct("<" + "".join(layout.struct.lstrip("<") for layout in run.layouts))
    names = [name for layout in run.layouts for name in layout.flat]
    return dict(zip(names, map(list, zip(*row.iter_unpack(rows), strict=True)), strict=True))


def first_difference(run: PlainRun, other: bytes) -> str:
    if len(other) != len(run.rows):
        return f"{len(other)} bytes instead of {len(run.rows)}"
    mine, theirs = columns(run, run.rows), columns(run, other)
    found = [(step, name, a, b) for name in mine
             for step, (a, b) in enumerate(zip(mine[name], theirs[name], strict=True))
             if struct.pack("<d", a) != struct.pack("<d", b)]
    step, name, a, b = min(found)
    return f"{len(found)} values differ, first {name} in row {step}: {float(a).hex()} and {float(b).hex()}"


@pytest.mark.parametrize(("flavor", "fmi"), [("python", 2), pytest.param("native", 2, marks=needs_compiler),
                                             pytest.param("native", 3, marks=needs_compiler)])
@pytest.mark.parametrize("name", PARAMETERS)
def test_fmus_without_the_library_have_the_bits_of_the_classes(
        name: str, flavor: str, fmi: int, plain_run: Callable[[str], PlainRun], tmp_path: Path) -> None:
    run = plain_run(name)
    (tmp_path / "job.json").write_text(json.dumps(job(run, flavor, fmi)), encoding="utf-8")
    # -I: neither this directory nor PYTHONPATH; the script's import hook keeps an installed threadpitch away
    done = subprocess.run([sys.executable, "-I", str(ALONE), "job.json", "rows.bin"], cwd=tmp_path, check=False,
                          capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.splitlines()[-1]) == {"modules_of_ours": [], "isolated": 1}
    rows = (tmp_path / "rows.bin").read_bytes()
    assert rows == run.rows, first_difference(run, rows)
    names = sum(len(layout.flat) for layout in run.layouts)
    print(f"\n{name}, {flavor} FMI {fmi}.0: {names} outputs and states of {len(run.layouts)} components "
          f"in {STEPS + 1} rows, {names * (STEPS + 1)} values equal bit for bit")


@pytest.mark.parametrize("name", PARAMETERS)
def test_the_pass_is_whole_and_reaches_what_makes_bits_differ(
        name: str, plain_run: Callable[[str], PlainRun]) -> None:
    run = plain_run(name)
    spindle, drive, _ = run.models
    phase, spindle_torque, drive_torque, wind_up, angle, position = np.array(run.seen).T
    assert phase[-1] == 8  # done
    assert set(phase) >= {1, 2, 4, 5, 6, 7, 8}
    assert run.models[2].pass_number == (4 if name == "g76_program" else 1)
    assert np.count_nonzero(wind_up > 0.5 * drive.backlash) > 100  # the screw pushes on either flank
    assert np.count_nonzero(wind_up < -0.5 * drive.backlash) > 100
    assert share_at(np.abs(spindle_torque), spindle.torque_limit) > 0.02
    increment = drive.scale_resolution if drive.detector == 2 else drive.screw_lead / drive.encoder_counts
    for quantised, unit in ((angle, 2.0 * np.pi / spindle.counts_per_turn), (position, increment)):
        counts = quantised / unit
        assert np.max(np.abs(counts - np.round(counts))) < 1e-5
        assert np.unique(np.round(counts)).size > 1000
    if name == "at_its_limits":
        assert 3 in phase  # the start position lies behind the one-turn pulse
        assert share_at(np.abs(drive_torque), drive.torque_limit) > 0.02
        assert np.count_nonzero(np.abs(wind_up) < 0.5 * drive.backlash) > 0  # seen inside the play


def share_at(values: NDArray[np.float64], limit: float) -> float:
    return float(np.mean(np.isclose(values, limit, rtol=1e-12)))


def test_the_master_has_the_bits_of_the_classes_too(plain_run: Callable[[str], PlainRun]) -> None:
    run = plain_run("shipped")
    result = lathe.simulate(stop_time=STEPS * STEP_SIZE, step_size=STEP_SIZE)
    plain = columns(run, run.rows)
    recorded = [name for name in result if name in plain]
    assert {name.split(".")[0] for name in recorded} == set(run.plan.order)
    for name in recorded:
        assert np.asarray(result[name], dtype=np.float64).tobytes() == np.array(plain[name], np.float64).tobytes(), name
    print(f"\nmaster: {len(recorded)} variables in {STEPS + 1} rows equal bit for bit")
