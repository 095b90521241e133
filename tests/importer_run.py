"""Run an .ssp in one importer and write what its pitch calculators show: the script of a process of its own.

usage: importer_run.py fmpy|libcosim|ecos SYSTEM.ssp STEPS RESULT.json
       importer_run.py ecos-fmi3 SYSTEM.json STEPS RESULT.json

The result maps ``component.variable`` to its values after each step of 1 ms. Nothing of threadpitch is used here: the
importers read the .ssp, find the FMUs, and wire and step them by themselves. SSP 1.0 has no place for FMUs of FMI 3.0
and their arrays, so a JSON file tells Ecos their system.
"""

from __future__ import annotations

import json
import sys
import zipfile
from pathlib import Path
from typing import Any

STEP_SIZE = 1e-3
STEP_NANOSECONDS = 1_000_000
PARAMETER_SET = "threading_lathe"
COMPONENTS = ("nominal_pitch", "actual_pitch")
START_ANGLES = (1, 2, 3, 4)
REALS = tuple(f"pitch[{i}]" for i in START_ANGLES)
INTEGERS = tuple(f"revolution[{i}]" for i in START_ANGLES)

Columns = dict[str, list[Any]]


def empty() -> Columns:
    return {f"{component}.{name}": [] for component in COMPONENTS for name in REALS + INTEGERS}


def run_fmpy(ssp: str, steps: int) -> Columns:
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import ParameterSet, read_ssv

    # FMPy sets one flat set, which the caller has to hand over, and no parameter bindings
    values = ParameterSet(name=PARAMETER_SET)
    with zipfile.ZipFile(ssp) as archive:
        sets = [Path(name) for name in archive.namelist() if name.endswith(".ssv")]
    for file in sets:
        for parameter in read_ssv(ssp, file.as_posix()).parameters:
            parameter.name = f"{file.stem}.{parameter.name}"
            values.parameters.append(parameter)
    # half a step less: it adds up the time
    result = simulate_ssp(ssp, stop_time=(steps - 0.5) * STEP_SIZE, step_size=STEP_SIZE, parameter_set=values)
    return {name: result[name].tolist() for name in empty()}


def run_libcosim(ssp: str, steps: int) -> Columns:
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.WARNING)
    execution = CosimExecution.from_ssp_file(ssp, STEP_NANOSECONDS)
    observer = CosimObserver.create_last_value()
    assert execution.add_observer(observer)
    index = {slave.name.decode(): slave.index for slave in execution.slave_infos()}
    references = {component: {one.name.decode(): one.reference for one in execution.slave_variables(index[component])}
                  for component in COMPONENTS}
    columns = empty()
    for _ in range(steps):
        assert execution.step(1), execution.status()
        for component in COMPONENTS:
            of = references[component]
            values = observer.last_real_values(index[component], [of[name] for name in REALS])
            values += observer.last_integer_values(index[component], [of[name] for name in INTEGERS])
            for name, value in zip(REALS + INTEGERS, values, strict=True):
                columns[f"{component}.{name}"].append(value)
    return columns


def run_ecos(ssp: str, steps: int) -> Columns:
    from ecospy import EcosSimulation

    columns = empty()
    with EcosSimulation(step_size=STEP_SIZE, ssp_path=ssp) as simulation:
        assert simulation.init(parameter_set=PARAMETER_SET)
        for _ in range(steps):
            simulation.step(1)
            for component in COMPONENTS:
                for name in REALS:
                    columns[f"{component}.{name}"].append(simulation.get_real(f"{component}::{name}"))
                for name in INTEGERS:
                    columns[f"{component}.{name}"].append(simulation.get_integer(f"{component}::{name}"))
        simulation.terminate()
    return columns


def run_ecos_fmi3(system: str, steps: int) -> Columns:
    from ecospy import EcosSimulation, EcosSimulationStructure

    job = json.loads(Path(system).read_text(encoding="utf-8"))
    columns: Columns = {name: [] for name in job["wanted"]}
    structure = EcosSimulationStructure()
    for name, fmu in job["fmus"].items():
        structure.add_model(name, fmu)
    connect = {"Real": structure.make_real_connection, "Integer": structure.make_int_connection,
               "Boolean": structure.make_bool_connection}
    for kind, source, target in job["links"]:
        connect[kind](source, target)
    structure.add_parameter_set(PARAMETER_SET, job["parameters"])
    with EcosSimulation(step_size=STEP_SIZE, structure=structure) as simulation:
        assert simulation.init(parameter_set=PARAMETER_SET)
        for _ in range(steps):
            simulation.step(1)
            for name, values in columns.items():
                values.append(simulation.get_real(name.replace(".", "::")))
        simulation.terminate()
    structure._handle = None  # Ecos 0.7.2 frees names of FMUs of FMI 3.0 twice when it frees the structure
    return columns


IMPORTERS = {"fmpy": run_fmpy, "libcosim": run_libcosim, "ecos": run_ecos, "ecos-fmi3": run_ecos_fmi3}

if __name__ == "__main__":
    _, importer, system, step_count, result_path = sys.argv
    Path(result_path).write_text(json.dumps(IMPORTERS[importer](system, int(step_count))), encoding="utf-8")
