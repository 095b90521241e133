"""The dataclass, the plain module and the FMU calculate the same bits."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fmu.driving import MODEL_PATHS, names, plain_class, random_inputs, random_parameters, read, run_python
from threadpitch.fmu import build_python_fmu

ALONE = Path(__file__).with_name("run_alone.py")
STEPS = 60


@pytest.mark.parametrize("path", MODEL_PATHS, ids=names(MODEL_PATHS))
@pytest.mark.parametrize("seed", range(4))
def test_plain_module_equals_dataclass(path: Path, seed: int) -> None:
    model = read(path)
    generator = random.Random(seed)
    parameters = random_parameters(model, generator)
    inputs = random_inputs(model, STEPS, generator)
    expected = run_python(model, model.model_class(), parameters, inputs)
    assert run_python(model, plain_class(model)(), parameters, inputs) == expected
    moved = {name for row in expected for name, value in row.items() if value != expected[0][name]}
    outputs = {variable.name for variable in model.variables if variable.causality == "output"}
    assert moved & outputs, "no output moved: the inputs drive nothing"


@pytest.mark.parametrize("path", MODEL_PATHS, ids=names(MODEL_PATHS))
def test_fmu_equals_dataclass_where_threadpitch_is_not_installed(path: Path, tmp_path: Path) -> None:
    model = read(path)
    assert model.experiment is not None
    generator = random.Random(path.stem)
    parameters = random_parameters(model, generator)
    inputs = random_inputs(model, STEPS, generator)
    job, result = tmp_path / "job.json", tmp_path / "result.json"
    job.write_text(json.dumps({"parameters": parameters, "inputs": inputs, "step_size": model.experiment.step_size}))
    fmu = build_python_fmu(model, tmp_path)
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run([sys.executable, "-P", str(ALONE), str(fmu), str(job), str(result)], cwd=tmp_path,
                          env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(result.read_text())
    assert found["threadpitch_modules"] == []
    assert found["rows"] == run_python(model, model.model_class(), parameters, inputs)


@pytest.mark.parametrize("path", MODEL_PATHS, ids=names(MODEL_PATHS))
def test_initialize_can_be_repeated(path: Path) -> None:
    model = read(path)
    generator = random.Random(5)
    parameters = random_parameters(model, generator)
    first = random_inputs(model, 3, generator)[-1]
    once, twice = model.model_class(), model.model_class()
    once_rows = run_python(model, once, parameters | first, [])
    twice.initialize()
    assert run_python(model, twice, parameters | first, []) == once_rows
