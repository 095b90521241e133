"""FMU states of native FMUs: what runs on from a saved state has the same bits, in a new process too."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
from pathlib import Path
from typing import Any

from tests.fmu.driving import ROOT, Fmu, Fmu3, advanced, opened, opened3, random_inputs, random_parameters, read
from tests.fmu.native.building import both_versions, built, every_model, needs_compiler

pytestmark = needs_compiler
STEPS = 40
RESUME = Path(__file__).with_name("resume.py")


def _save(fmu: Fmu | Fmu3) -> Any:
    return fmu.slave.getFMUState() if isinstance(fmu, Fmu3) else fmu.slave.getFMUstate()


def _restore(fmu: Fmu | Fmu3, state: Any) -> None:
    if isinstance(fmu, Fmu3):
        fmu.slave.setFMUState(state)
        fmu.slave.freeFMUState(state)
    else:
        fmu.slave.setFMUstate(state)
        fmu.slave.freeFMUstate(state)


def _bytes_of(fmu: Fmu | Fmu3) -> bytes:
    if isinstance(fmu, Fmu3):
        return bytes(fmu.slave.serializeFMUState(fmu.slave.getFMUState()))
    return bytes(fmu.slave.serializeFMUstate(fmu.slave.getFMUstate()))


@every_model
@both_versions
def test_what_runs_on_from_a_state_has_the_same_bits(path: Path, fmi: int, tmp_path: Path) -> None:
    model = read(path)
    generator = random.Random(f"{path.stem} {fmi}")
    parameters = random_parameters(model, generator)
    inputs = random_inputs(model, STEPS, generator)
    place = generator.randrange(1, STEPS - 1)
    with opened(built(path), model) if fmi == 2 else opened3(built(path, 3), model) as fmu:
        fmu.initialize(parameters)
        done = 0
        for values in inputs[:place]:
            done = advanced(fmu, done, values)
        saved, serialised, first = _save(fmu), _bytes_of(fmu), done
        here = fmu.everything()

        def on() -> list[dict[str, str]]:
            rows, number = [fmu.everything()], first
            for values in inputs[place:]:
                number = advanced(fmu, number, values)
                rows.append(fmu.everything())
            return rows

        expected = on()
        assert expected[-1] != here
        _restore(fmu, saved)
        assert on() == expected
    (tmp_path / "state").write_bytes(serialised)
    (tmp_path / "inputs.json").write_text(json.dumps(inputs[place:]))
    done_process = subprocess.run(
        [sys.executable, str(RESUME), str(path), str(built(path, fmi)), str(tmp_path / "state"), str(first),
         str(tmp_path / "inputs.json")],
        capture_output=True, text=True, check=False, env=os.environ | {"PYTHONPATH": str(ROOT)}, cwd=tmp_path)
    assert done_process.returncode == 0, done_process.stderr
    assert json.loads(done_process.stdout) == expected
