"""What a co-simulation master costs: ours beside Ecos, libcosim and FMPy, on the same FMUs and connections.

    LD_LIBRARY_PATH=$(python -c 'import sys; print(sys.prefix)')/lib python -m tests.benchmarks.bench_master

(Ecos looks for the TBB library there.) Three small native FMUs of FMI 2.0, decay -> feedthrough -> feedthrough, with
four connections, in one .ssp that every master reads. All run in this process, one after the other, several times; the
shortest time of each is taken, because other work on the machine only makes a run slower. The masters' last values
must be equal, but for the steps by which each delays a connection.
"""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from time import perf_counter, thread_time

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.ssp.simulation import simulate_ssp
from rich.console import Console
from rich.table import Table

from threadpitch import cosim
from threadpitch.cosim import master
from threadpitch.cosim.engine import choose_engine
from threadpitch.cosim.network import Network
from threadpitch.cosim.recording import Recorder
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.selection import choose_channels
from threadpitch.cosim.simulation import instantiate
from threadpitch.cosim.system import Component, Connection, System
from threadpitch.fmu import cached_fmu

MODELS = Path(__file__).parents[1] / "cosim" / "models"
STEP_SIZE = 1e-3  # s
NANOSECONDS = 1_000_000
ROUNDS = 5
CHAIN = ("decay", "first", "second")
OUTPUTS = ("x", "rate")
COMPONENTS = (3, 10, 30, 100, 300)
LENGTHS = (10_000, 100_000, 1_000_000)


@dataclass(frozen=True)
class Run:
    """Seconds that the steps took, and the last values of ``second.x`` and ``second.rate``."""

    seconds: float
    last: tuple[float, float]


Master = Callable[[Path, int], Run]  # (the .ssp, steps)


def system(components: int) -> System:
    """decay -> feedthrough -> feedthrough -> ...: two connections between neighbours."""
    decay, feedthrough = (cached_fmu(MODELS / f"{name}.py", "native") for name in ("decay", "feedthrough"))
    names = ["decay", *(CHAIN[1:] if components == len(CHAIN) else (f"f{n}" for n in range(1, components)))]
    fmus = [decay, *([feedthrough] * (components - 1))]
    connections = [Connection(giver, name, taker, f"{name}_in")
                   for giver, taker in pairwise(names) for name in OUTPUTS]
    return System("chain", tuple(map(Component, names, fmus)), tuple(connections))


def write_ssp(path: Path) -> Path:
    """The chain of three as an .ssp of SSP 1.0."""
    chain = system(len(CHAIN))
    components, connections = "", ""
    for component in chain.components:
        inputs = [f"{name}_in" for name in OUTPUTS] if component.name != "decay" else []
        connectors = [("input", name) for name in inputs] + [("output", name) for name in OUTPUTS]
        components += (f'<ssd:Component name="{component.name}" type="application/x-fmu-sharedlibrary" '
                       f'source="resources/{component.fmu.name}"><ssd:Connectors>')
        components += "".join(f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real/></ssd:Connector>'
                              for kind, name in connectors)
        components += "</ssd:Connectors></ssd:Component>"
    for found in chain.connections:
        connections += (f'<ssd:Connection startElement="{found.start_component}" '
                        f'startConnector="{found.start_variable}" endElement="{found.end_component}" '
                        f'endConnector="{found.end_variable}"/>')
    namespaces = " ".join(f'xmlns:{short}="http://ssp-standard.org/SSP1/SystemStructure{name}"' for short, name in (
        ("ssd", "Description"), ("ssc", "Common"), ("ssv", "ParameterValues")))
    text = (f'<?xml version="1.0" encoding="UTF-8"?><ssd:SystemStructureDescription {namespaces} version="1.0" '
            f'name="chain"><ssd:System name="chain"><ssd:Elements>{components}</ssd:Elements>'
            f"<ssd:Connections>{connections}</ssd:Connections></ssd:System></ssd:SystemStructureDescription>")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
        for fmu in sorted({component.fmu for component in chain.components}):
            archive.write(fmu, f"resources/{fmu.name}")
    return path


def ours(structure: System, steps: int, record: Sequence[str], engine: str = "kernel",
         coupling: str = "jacobi", clock: Callable[[], float] = perf_counter) -> Run:
    """Seconds of ``master.run``; the last values are read from the network's memory, recorded or not."""
    schedule = Schedule(0.0, STEP_SIZE, steps)
    method = cosim.Method(coupling)
    with cosim.prepare(structure) as plan, instantiate(plan) as instances:
        recorder = Recorder(choose_channels(plan, record), schedule)
        network = Network(instances, plan.links, recorder, method)
        algorithm = choose_engine(network, engine)
        master.initialize(network, schedule, plan.settings)
        begin = clock()
        master.run(network, schedule, algorithm)
        seconds = clock() - begin
        last = np.zeros(2)
        references = [plan.descriptions[plan.order[-1]].variables[name].reference for name in OUTPUTS]
        instances[-1].getter("fmi2Real", np.array(references, np.uint32), last)()
    return Run(seconds, (float(last[0]), float(last[1])))


def our_master(record: Sequence[str], engine: str = "kernel", coupling: str = "jacobi") -> Master:
    """Ours, reading the .ssp."""
    def run(ssp: Path, steps: int) -> Run:
        with cosim.read_system(ssp) as structure:
            return ours(structure, steps, record, engine, coupling)

    return run


def ecos_master(recording: bool) -> Master:
    """Ecos; it records to a CSV file."""
    def run(ssp: Path, steps: int) -> Run:
        from ecospy import EcosSimulation

        with EcosSimulation(step_size=STEP_SIZE, ssp_path=str(ssp)) as simulation:
            if recording:
                simulation.add_csv_writer(str(ssp.with_suffix(".csv")))
            simulation.init()
            begin = perf_counter()
            simulation.step(steps)
            seconds = perf_counter() - begin
            last = tuple(float(simulation.get_real(f"second::{name}")) for name in OUTPUTS)
            simulation.terminate()
        return Run(seconds, (last[0], last[1]))

    return run


def libcosim_master(recording: bool) -> Master:
    """libcosim; it records to a time series in memory, or keeps the last values only."""
    def run(ssp: Path, steps: int) -> Run:
        from libcosimpy.CosimEnums import CosimVariableType
        from libcosimpy.CosimExecution import CosimExecution
        from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
        from libcosimpy.CosimObserver import CosimObserver

        log_output_level(CosimLogLevel.WARNING)
        execution = CosimExecution.from_ssp_file(str(ssp), NANOSECONDS)
        last_values = CosimObserver.create_last_value()
        assert execution.add_observer(last_values)
        index = {slave.name.decode(): slave.index for slave in execution.slave_infos()}
        references = {name: {one.name.decode(): one.reference for one in execution.slave_variables(index[name])}
                      for name in CHAIN}
        if recording:
            series = CosimObserver.create_time_series()
            assert execution.add_observer(series)
            for name in CHAIN:
                for output in OUTPUTS:
                    assert series.start_time_series(index[name], references[name][output], CosimVariableType.REAL)
        begin = perf_counter()
        assert execution.step(steps), execution.status()
        seconds = perf_counter() - begin
        found = last_values.last_real_values(index["second"], [references["second"][name] for name in OUTPUTS])
        return Run(seconds, (float(found[0]), float(found[1])))

    return run


def fmpy_ssp(ssp: Path, steps: int) -> Run:
    """FMPy's simulator of .ssp files, which always records all outputs; half a step less, as it adds up the time.

    Its set-up is part of the call: what a run of one step takes is left out.
    """
    begin = perf_counter()
    simulate_ssp(str(ssp), stop_time=0.5 * STEP_SIZE, step_size=STEP_SIZE)
    middle = perf_counter()
    result = simulate_ssp(str(ssp), stop_time=(steps - 0.5) * STEP_SIZE, step_size=STEP_SIZE)
    seconds = perf_counter() - middle - (middle - begin)
    return Run(seconds, (float(result["second.x"][-1]), float(result["second.rate"][-1])))


def fmpy_wrappers(ssp: Path, steps: int) -> Run:
    """A loop over FMPy's own wrappers in bulk, Jacobi, all outputs kept in lists."""
    folder = Path(extract(str(ssp)))
    slaves, names = [], {"decay": "Decay", "first": "Feedthrough", "second": "Feedthrough"}
    for name, model in names.items():
        unzipped = extract(str(folder / "resources" / f"{model}.fmu"))
        description = read_model_description(unzipped)
        slave = FMU2Slave(guid=description.guid, modelIdentifier=model, unzipDirectory=unzipped, instanceName=name)
        slave.instantiate()
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        references = {one.name: one.valueReference for one in description.modelVariables}
        slaves.append((slave, [references[name] for name in OUTPUTS],
                       [references[f"{name}_in"] for name in OUTPUTS if f"{name}_in" in references]))
    rows = []
    values = [slave.getReal(outputs) for slave, outputs, _ in slaves]
    begin = perf_counter()
    for step in range(steps):
        for (slave, _, inputs), given in zip(slaves[1:], values, strict=False):
            slave.setReal(inputs, given)
        for slave, _, _ in slaves:
            slave.doStep(step * STEP_SIZE, STEP_SIZE)
        values = [slave.getReal(outputs) for slave, outputs, _ in slaves]
        rows.append(values)
    seconds = perf_counter() - begin
    for slave, _, _ in slaves:
        slave.terminate()
        slave.freeInstance()
    return Run(seconds, (values[2][0], values[2][1]))


RECORDING: dict[str, Master] = {
    "threadpitch, kernel, Gauss-Seidel": our_master(("outputs",), coupling="gauss-seidel"),
    "threadpitch, kernel, Jacobi": our_master(("outputs",)),
    "threadpitch, plain Python, Jacobi": our_master(("outputs",), "python"),
    "Ecos": ecos_master(recording=True),
    "libcosim": libcosim_master(recording=True),
    "FMPy simulate_ssp": fmpy_ssp,
    "FMPy wrappers": fmpy_wrappers,
}
WITHOUT: dict[str, Master] = {
    "threadpitch, kernel, Gauss-Seidel": our_master((), coupling="gauss-seidel"),
    "threadpitch, kernel, Jacobi": our_master(()),
    "Ecos": ecos_master(recording=False),
    "libcosim": libcosim_master(recording=False),
}
STEPS = {"threadpitch, kernel, Gauss-Seidel": 500_000, "threadpitch, kernel, Jacobi": 500_000, "Ecos": 50_000}
FEWER = 20_000  # steps of the others


def compare(ssp: Path, masters: dict[str, Master]) -> dict[str, float]:
    """Microseconds per step: every master in turn, round by round.

    Raises:
        AssertionError: a master's last value is not that of the decay after the steps less its delays.
    """
    best = dict.fromkeys(masters, np.inf)
    for _ in range(ROUNDS):
        for name, run in masters.items():
            steps = STEPS.get(name, FEWER)
            done = run(ssp, steps)
            check_last(name, done.last, steps)
            best[name] = min(best[name], done.seconds / steps * 1e6)
    return best


def check_last(name: str, last: tuple[float, float], steps: int) -> None:
    """x after n steps is (1 - h)^n; a delay is at most one step at each of the two connections in a row.

    libcosim's steps, made of nanoseconds, differ from 1e-3 s in the last bit.
    """
    x = 1.0
    values = [x]
    for _ in range(steps):
        x = x + STEP_SIZE * (-1.0 * x)
        values.append(x)
    nearest = min(values[-3:], key=lambda value: abs(value - last[0]))
    assert abs(last[0] / nearest - 1.0) < 1e-12, f"{name}: {last} is not among {values[-3:]}"
    assert abs(last[1] / nearest + 1.0) < 1e-12, f"{name}: {last} is not among {values[-3:]}"


def main() -> None:
    """Prints the tables."""
    console = Console(width=100)
    with tempfile.TemporaryDirectory() as folder:
        ssp = write_ssp(Path(folder) / "chain.ssp")
        recording, without = compare(ssp, RECORDING), compare(ssp, WITHOUT)
    table = Table("master", "recording all, us per step", "without, us per step",
                  title="Three native FMUs, four connections")
    for name, figure in recording.items():
        table.add_row(name, f"{figure:.2f}", f"{without[name]:.2f}" if name in without else "")
    console.print(table)
    for title, figures in (("recording", recording), ("without recording", without)):
        mine = figures["threadpitch, kernel, Jacobi"]
        name, fastest = min(((name, one) for name, one in figures.items() if not name.startswith("threadpitch")),
                            key=lambda pair: pair[1])
        console.print(f"{title}: {fastest / mine:.0f} times less than {name}, the fastest of the others")
    console.print(scaling())


def scaling() -> Table:
    """The kernel's cost by number of components, and by length of the run, in processor time."""
    table = Table("components", "steps", "us per step", "us per step and component", "us per component more",
                  title="Kernel, recording all")
    before = (0, 0.0)
    cases = [(components, max(3_000, 1_000_000 // components)) for components in COMPONENTS]
    cases += [(len(CHAIN), steps) for steps in LENGTHS]
    for components, steps in cases:
        structure = system(components)
        best = min(ours(structure, steps, ("outputs",), clock=thread_time).seconds
                   for _ in range(ROUNDS)) / steps * 1e6
        slope = (best - before[1]) / (components - before[0]) if components > before[0] else None
        table.add_row(f"{components}", f"{steps:,}", f"{best:.3f}", f"{best / components:.4f}",
                      "" if slope is None else f"{slope:.4f}")
        before = components, best
    return table


if __name__ == "__main__":
    main()
