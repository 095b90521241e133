"""Go on from serialised bytes: the script of a new process.

usage: resume.py MODEL.py FMU STATE FIRST INPUTS.json     rows on standard output as JSON
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from tests.fmu.driving import Fmu3, advanced, opened, opened3, read


def main(model_path: str, fmu_path: str, state_path: str, first: str, inputs_path: str) -> None:
    model = read(Path(model_path))
    state = Path(state_path).read_bytes()
    path = Path(fmu_path)
    with (opened3 if path.parent.name == "fmi3" else opened)(path, model) as fmu:
        fmu.initialize()
        if isinstance(fmu, Fmu3):
            fmu.slave.setFMUState(fmu.slave.deserializeFMUState(state))
        else:
            fmu.slave.setFMUstate(fmu.slave.deSerializeFMUstate(state))
        rows = [fmu.everything()]
        done = int(first)
        for values in json.loads(Path(inputs_path).read_text()):
            done = advanced(fmu, done, values)
            rows.append(fmu.everything())
    print(json.dumps(rows))


if __name__ == "__main__":
    main(*sys.argv[1:])
