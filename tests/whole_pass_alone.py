"""Step a whole system of FMUs with FMPy where threadpitch cannot be imported: the script of a process of its own.

usage: whole_pass_alone.py JOB.json ROWS.bin

The job tells components in their order, values, links and steps; the rows are what every component calculates, after
initialisation and after each step.
"""

from __future__ import annotations

import itertools
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


class Slave2:
    """One FMU of FMI 2.0, with what is got from it."""

    def __init__(self, component: dict[str, Any], description: Any, folder: Path) -> None:
        from fmpy import extract
        from fmpy.fmi2 import FMU2Slave

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

    def enter_initialization(self) -> None:
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()


class Slave3:
    """One FMU of FMI 3.0, by the names of FMI 2.0: ``pitch[2]`` is the second value of the array ``pitch``."""

    def __init__(self, component: dict[str, Any], description: Any, folder: Path) -> None:
        from fmpy import extract
        from fmpy.fmi3 import FMU3Slave

        self.variables = {variable.name: variable for variable in description.modelVariables}
        self.fmu = FMU3Slave(guid=description.instantiationToken, unzipDirectory=extract(component["fmu"], str(folder)),
                             modelIdentifier=description.coSimulation.modelIdentifier, instanceName=component["name"])
        self.fmu.instantiate()
        self.places = [self.place(name) for names in component["names"].values() for name in names]
        self.wanted: dict[str, list[str]] = {}  # arrays that are got together, by their type
        for name in dict.fromkeys(array for array, _ in self.places):
            self.wanted.setdefault(self.variables[name].type, []).append(name)
        self.struct = struct.Struct(component["struct"])

    def put(self, _kind: str, name: str, value: Any) -> None:
        array, index = self.place(name)
        variable = self.variables[array]
        values = self.array(array) if variable.dimensions else [value]
        values[index] = value
        getattr(self.fmu, f"set{variable.type}")([variable.valueReference], values)

    def get(self, _kind: str, name: str) -> Any:
        array, index = self.place(name)
        return self.array(array)[index]

    def row(self) -> bytes:
        arrays: dict[str, list[Any]] = {}
        for kind, names in self.wanted.items():
            sizes = [self.size(name) for name in names]
            values = iter(getattr(self.fmu, f"get{kind}")([self.variables[name].valueReference for name in names],
                                                          nValues=sum(sizes)))
            arrays |= {name: list(itertools.islice(values, size)) for name, size in zip(names, sizes, strict=True)}
        return self.struct.pack(*(arrays[array][index] for array, index in self.places))

    def enter_initialization(self) -> None:
        self.fmu.enterInitializationMode(startTime=0.0)

    def place(self, name: str) -> tuple[str, int]:
        array, _, index = name.partition("[")
        return array, int(index.rstrip("]") or 1) - 1

    def array(self, name: str) -> list[Any]:
        variable = self.variables[name]
        return list(getattr(self.fmu, f"get{variable.type}")([variable.valueReference], nValues=self.size(name)))

    def size(self, name: str) -> int:
        dimensions = self.variables[name].dimensions
        return int(dimensions[0].start) if dimensions else 1


def slave(component: dict[str, Any], folder: Path) -> Slave2 | Slave3:
    """The component by the version of its FMU."""
    from fmpy import read_model_description

    description = read_model_description(component["fmu"])
    return (Slave3 if description.fmiVersion.startswith("3") else Slave2)(component, description, folder)


def main(job_path: str, rows_path: str) -> None:
    job = json.loads(Path(job_path).read_text(encoding="utf-8"))
    folder = Path(tempfile.mkdtemp(dir=Path(job_path).resolve().parent))
    slaves = {component["name"]: slave(component, folder / component["name"]) for component in job["components"]}
    incoming = {name: [link for link in job["links"] if link["target"][0] == name] for name in slaves}

    def receive(name: str) -> None:
        for link in incoming[name]:
            giver, variable = link["source"]
            slaves[name].put(link["kind"], link["target"][1], slaves[giver].get(link["kind"], variable))

    for component, kind, variable, value in job["settings"]:
        slaves[component].put(kind, variable, value)
    for one in slaves.values():
        one.enter_initialization()
    for _ in range(len(slaves) + 1):
        for name in slaves:
            receive(name)
    for one in slaves.values():
        one.fmu.exitInitializationMode()
    with open(rows_path, "wb") as stream:
        stream.writelines(one.row() for one in slaves.values())
        for step in range(job["steps"]):
            for name, one in slaves.items():
                receive(name)
                one.fmu.doStep(step * job["step_size"], job["step_size"])
            stream.writelines(one.row() for one in slaves.values())
    for one in slaves.values():
        one.fmu.terminate()
    for one in slaves.values():
        one.fmu.freeInstance()
    loaded = sorted(name for name in sys.modules if name.split(".")[0] in OURS)
    print(json.dumps({"modules_of_ours": loaded, "isolated": sys.flags.isolated}))


if __name__ == "__main__":
    main(*sys.argv[1:])
