"""Step a whole system of FMUs with FMPy where threadpitch cannot be imported: the script of a process of its own.

usage: whole_pass_alone.py JOB.json ROWS.bin

The job tells components in their order, values, links and steps; the rows are what every component calculates, after
initialisation and after each step.
"""

from __future__ import annotations

import json
import struct
import sys
import tempfile
from pathlib import Path
from typing import Any

OURS = ("threadpitch", "fmu_src", "tests")


class NotInstalled:
    """An import hook in front of all others that knows nothing of ours."""

    def find_spec(self, name: str, *_: Any) -> None:
        if name.split(".")[0] in OURS:
            raise ModuleNotFoundError(f"{name} is not installed here")


sys.meta_path.insert(0, NotInstalled())


class Slave:
    """One FMU, with what is got from it."""

    def __init__(self, component: dict[str, Any], folder: Path) -> None:
        from fmpy import extract, read_model_description
        from fmpy.fmi2 import FMU2Slave

        description = read_model_description(component["fmu"])
        self.references = {variable.name: variable.valueReference for variable in description.modelVariables}
        self.fmu = FMU2Slave(guid=description.guid, unzipDirectory=extract(component["fmu"], str(folder)),
                             modelIdentifier=description.coSimulation.modelIdentifier, instanceName=component["name"])
        self.fmu.instantiate()
        self.setters = {"Real": self.fmu.setReal, "Integer": self.fmu.setInteger, "Boolean": self.fmu.setBoolean}
        self.getters = {"Real": self.fmu.getReal, "Integer": self.fmu.getInteger, "Boolean": self.fmu.getBoolean}
        self.wanted = [(self.getters[kind], [self.references[name] for name in names])
                       for kind, names in component["names"].items() if names]
        self.struct = struct.Struct(component["struct"])

    def put(self, kind: str, name: str, value: Any) -> None:
        self.setters[kind]([self.references[name]], [value])

    def get(self, kind: str, name: str) -> Any:
        return self.getters[kind]([self.references[name]])[0]

    def row(self) -> bytes:
        return self.struct.pack(*(value for getter, references in self.wanted for value in getter(references)))


def main(job_path: str, rows_path: str) -> None:
    job = json.loads(Path(job_path).read_text(encoding="utf-8"))
    folder = Path(tempfile.mkdtemp(dir=Path(job_path).resolve().parent))
    slaves = {component["name"]: Slave(component, folder / component["name"]) for component in job["components"]}
    incoming = {name: [link for link in job["links"] if link["target"][0] == name] for name in slaves}

    def receive(name: str) -> None:
        for link in incoming[name]:
            giver, variable = link["source"]
            slaves[name].put(link["kind"], link["target"][1], slaves[giver].get(link["kind"], variable))

    for component, kind, variable, value in job["settings"]:
        slaves[component].put(kind, variable, value)
    for slave in slaves.values():
        slave.fmu.setupExperiment(startTime=0.0)
        slave.fmu.enterInitializationMode()
    for _ in range(len(slaves) + 1):
        for name in slaves:
            receive(name)
    for slave in slaves.values():
        slave.fmu.exitInitializationMode()
    with open(rows_path, "wb") as stream:
        stream.writelines(slave.row() for slave in slaves.values())
        for step in range(job["steps"]):
            for name, slave in slaves.items():
                receive(name)
                slave.fmu.doStep(step * job["step_size"], job["step_size"])
            stream.writelines(slave.row() for slave in slaves.values())
    for slave in slaves.values():
        slave.fmu.terminate()
    for slave in slaves.values():
        slave.fmu.freeInstance()
    loaded = sorted(name for name in sys.modules if name.split(".")[0] in OURS)
    print(json.dumps({"modules_of_ours": loaded, "isolated": sys.flags.isolated}))


if __name__ == "__main__":
    main(*sys.argv[1:])
