"""Run an FMU where threadpitch cannot be imported: the script of a process of its own.

usage: run_alone.py FMU JOB.json RESULT.json
"""

from __future__ import annotations

import json
import sys
from typing import Any


class NoThreadpitch:
    """An import hook in front of all others that knows no threadpitch."""

    def find_spec(self, name: str, *_: Any) -> None:
        if name.split(".")[0] == "threadpitch":
            raise ModuleNotFoundError(f"{name} is not installed here")


sys.meta_path.insert(0, NoThreadpitch())


def main(fmu_path: str, job_path: str, result_path: str) -> None:
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave

    with open(job_path, encoding="utf-8") as stream:
        job = json.load(stream)
    description = read_model_description(fmu_path)
    slave = FMU2Slave(guid=description.guid, unzipDirectory=extract(fmu_path),
                      modelIdentifier=description.coSimulation.modelIdentifier, instanceName="alone")
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    variables = {variable.name: variable for variable in description.modelVariables}
    setters = {"Real": slave.setReal, "Integer": slave.setInteger, "Boolean": slave.setBoolean}
    getters = {"Real": slave.getReal, "Integer": slave.getInteger, "Boolean": slave.getBoolean}

    def put(values: dict[str, Any]) -> None:
        for name, value in values.items():
            setters[variables[name].type]([variables[name].valueReference], [value])

    def everything() -> dict[str, str]:
        row = {}
        for name, variable in variables.items():
            value = getters[variable.type]([variable.valueReference])[0]
            row[name] = value.hex() if variable.type == "Real" else repr(
                bool(value) if variable.type == "Boolean" else value)
        return row

    put(job["parameters"])
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    rows = [everything()]
    done = 0  # a step that is refused does not advance time
    for values in job["inputs"]:
        put(values)
        try:
            slave.doStep(done * job["step_size"], job["step_size"])
            done += 1
        except Exception as error:
            if "discard" not in str(error):
                raise
        rows.append(everything())
    slave.terminate()
    slave.freeInstance()
    modules = [name for name in sys.modules if name.split(".")[0] == "threadpitch"]
    with open(result_path, "w", encoding="utf-8") as stream:
        json.dump({"rows": rows, "threadpitch_modules": modules}, stream)


if __name__ == "__main__":
    main(*sys.argv[1:])
