"""ThreadCutting over the passes of two starts by flank infeed: class, PythonFMU FMU and native FMUs, bit for bit."""

from __future__ import annotations

import functools
import math
from pathlib import Path

import pytest

from tests.fmu.driving import ROOT, Values, opened, opened3, read, run_fmu, run_python
from tests.fmu.native.building import built, needs_compiler
from threadpitch.fmu import build_python_fmu

MODEL = ROOT / "fmu_src" / "thread_cutting.py"
PARAMETERS: Values = {
    "starts": 2, "thin_length": 0.004, "thin_position": -0.004, "spot_length": 0.003, "spot_position": -0.006,
    "spot_angle": 1.0, "temperature_rise": 30.0, "thermal_time_constant": 2.0, "tool_axial_stiffness": 1e7,
    "taper": -0.03, "shoulder": -0.009, "material": 3,
}
STEPS = 150  # of a pass
STRIDE = math.radians(13.0)


def inputs_of_the_passes() -> list[Values]:
    rows: list[Values] = []
    for number in range(8):
        depth = 0.25e-3 * math.sqrt(1 + number // 2)
        for step in range(STEPS + 6):
            turns = STRIDE * step / (2.0 * math.pi)
            rows.append({
                "spindle_angle": 2.0 * math.pi * (40.0 * number + 0.5 * (number % 2) + turns),
                "tool_z": 0.004 - depth * math.tan(math.pi / 6) - 2.5e-3 * turns + 3e-6 * math.sin(5.3 * turns),
                "tool_x": 0.010 - depth + 2e-6 * math.sin(3.1 * turns), "threading": 0 < step < STEPS})
    return rows


@functools.cache
def rows_of_the_class() -> list[dict[str, str]]:
    model = read(MODEL)
    return run_python(model, model.model_class(), PARAMETERS, inputs_of_the_passes())


@pytest.mark.parametrize("kind", ["python", pytest.param("native2", marks=needs_compiler),
                                  pytest.param("native3", marks=needs_compiler)])
def test_all_flavours_have_the_bits_of_the_class(kind: str, tmp_path: Path) -> None:
    model, inputs, expected = read(MODEL), inputs_of_the_passes(), rows_of_the_class()
    path = {"python": lambda: build_python_fmu(model, tmp_path), "native2": lambda: built(MODEL),
            "native3": lambda: built(MODEL, 3)}[kind]()
    with opened3(path, model) if kind == "native3" else opened(path, model) as fmu:
        assert run_fmu(fmu, PARAMETERS, inputs) == expected
    cut = [row for row in expected if float.fromhex(row["cutting_force"]) > 0.0]
    assert len(cut) > 400
    kept = [float.fromhex(expected[-1][f"first_high[{i + 1}]"]) for i in range(288)]
    assert sum(value != 0.0 for value in kept[:144]) > 30  # both starts
    assert sum(value != 0.0 for value in kept[144:]) > 30
    two = sum(expected[-1][f"first_low[{i + 1}]"] != expected[-1][f"second_low[{i + 1}]"] for i in range(288))
    assert two > 5  # the union of two V
