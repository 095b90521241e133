"""The kernel computes the bits of the plain loop, for any network of FMUs, and fails as it does."""

from __future__ import annotations

import signal
import subprocess
import sys
import time as clock
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.cosim.slaves import FunctionInstance, network, variable
from threadpitch.cosim import CosimError, Method, Result, SimulationInterrupted, StepError, TimeLimitError, simulate
from threadpitch.cosim.algorithms import Algorithm
from threadpitch.cosim.engine import choose_engine
from threadpitch.cosim.network import Network
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.system import Component, Connection, System

Factory = Callable[..., Path]
Drawn = dict[str, Any]

GIVEN: dict[str, dict[int, tuple[str, ...]]] = {  # outputs by family, of the probes of FMI 2.0 and 3.0
    "Real": {2: ("x", "twice"), 3: ("x", "v[1]", "v[3]")},
    "Small": {3: ("int8_out", "int16_out", "uint8_out")},  # fit into all that take them
    "Integer": {2: ("count", "number_out"), 3: ("int32_out",)},
    "Boolean": {2: ("flag_out",), 3: ("truth_out[1]", "truth_out[2]")},
}
TAKEN: dict[str, dict[int, tuple[str, ...]]] = {
    "Real": {2: ("u",), 3: ("u", "w[1]", "w[2]", "single_in")},
    "Small": {2: ("number",), 3: ("int16_in", "int32_in", "int64_in")},
    "Integer": {2: ("number",), 3: ("int32_in", "int64_in")},
    "Boolean": {2: ("flag",), 3: ("truth_in[1]", "truth_in[2]")},
}


@st.composite
def methods(draw: st.DrawFn, components: int, couplings: Sequence[str]) -> Method:
    coupling, order = draw(st.sampled_from(couplings)), draw(st.integers(0, 2))
    if coupling == "iterated":  # a loop that does not rest ends the run
        tolerance = draw(st.sampled_from([1e-8, 0.1]))
        return Method(coupling, order, iterations=draw(st.integers(3, 20)), tolerance=tolerance)
    names = [f"c{number}" for number in range(components)]
    ahead: tuple[str, ...] = ()
    if coupling == "jacobi" and "iterated" in couplings:
        ahead = tuple(draw(st.lists(st.sampled_from(names), unique=True)))
    return Method(coupling, order, {name: draw(st.sampled_from([1, 1, 2, 3, 4])) for name in names}, ahead)


@st.composite
def networks(draw: st.DrawFn, couplings: Sequence[str] = ("gauss-seidel", "jacobi")) -> Drawn:
    """Probes of both versions, links with loops among them, steps of their own, and a method."""
    versions = draw(st.lists(st.sampled_from([2, 3]), min_size=1, max_size=4))
    place = st.integers(0, len(versions) - 1)
    links: dict[tuple[int, str], Connection] = {}
    for _ in range(draw(st.integers(0, 10))):
        family = draw(st.sampled_from(sorted(GIVEN)))
        giver, taker = draw(place), draw(place)
        outputs, inputs = GIVEN[family].get(versions[giver], ()), TAKEN[family][versions[taker]]
        if not outputs:
            continue
        start, end = draw(st.sampled_from(outputs)), draw(st.sampled_from(inputs))
        factor, offset = (1.0, 0.0) if family != "Real" else draw(
            st.sampled_from([(1.0, 0.0), (-0.5, 0.0), (0.3, 0.1), (1.0, -0.25)]))
        links[taker, end] = Connection(f"c{giver}", start, f"c{taker}", end, factor, offset, convert_units=False)
    return {
        "versions": versions,
        "links": tuple(links.values()),
        "method": draw(methods(len(versions), couplings)),
        "every": draw(st.integers(1, 5)),
        "record": draw(st.sampled_from([("outputs",), ("*",), ("c0.x",)])),
        "start": [draw(st.floats(-2.0, 2.0)) for _ in versions],
    }


def run(drawn: Drawn, fmus: dict[int, Path], engine: str) -> tuple[Result, str]:
    """The result, and why it ended early."""
    try:
        return compute(drawn, fmus, engine), ""
    except StepError as error:
        if error.result is None:
            raise
        return error.result, f"{error.status}: {error}"


def compute(drawn: Drawn, fmus: dict[int, Path], engine: str) -> Result:
    components = tuple(Component(f"c{number}", fmus[version]) for number, version in enumerate(drawn["versions"]))
    parameters = {f"c{number}.{'start_x' if version == 2 else 'u'}": drawn["start"][number]
                  for number, version in enumerate(drawn["versions"])}
    fed = {f"{link.end_component}.{link.end_variable}" for link in drawn["links"]}
    return simulate(System("random", components, drawn["links"]), engine=engine, method=drawn["method"],
                    parameters={name: value for name, value in parameters.items() if name not in fed},
                    record=drawn["record"], record_every=drawn["every"], stop_time=0.36, step_size=0.01)


@settings(deadline=None, max_examples=90)
@given(drawn=networks(("gauss-seidel", "jacobi", "iterated")))
def test_any_network_has_the_same_bits_in_both_engines(drawn: Drawn, probe_fmu: Path, probe3_fmu: Path) -> None:
    fmus = {2: probe_fmu, 3: probe3_fmu}
    (plain, why), (compiled, also) = run(drawn, fmus, "python"), run(drawn, fmus, "kernel")
    assert why == also
    assert not why or why.startswith("loop")
    assert list(plain) == list(compiled)
    assert plain.time.tobytes() == compiled.time.tobytes()
    assert (plain.steps, plain.completed) == (compiled.steps, compiled.completed)
    assert plain.completed == (not why)
    for name in plain:
        assert plain[name].tobytes() == compiled[name].tobytes(), name
        assert plain[name].dtype == compiled[name].dtype


def test_every_nth_row_is_that_of_the_whole(probe_fmu: Path) -> None:
    system = System("one", (Component("a", probe_fmu),))
    whole = simulate(system, parameters={"a.start_x": 1.0}, stop_time=1.0, engine="kernel")
    for engine in ("kernel", "python"):
        some = simulate(system, parameters={"a.start_x": 1.0}, stop_time=1.0, record_every=7, engine=engine)
        assert some.time.tobytes() == whole.time[::7].tobytes()
        assert some["a.x"].tobytes() == whole["a.x"][::7].tobytes()
        assert (some.steps, some.completed) == (100, True)
    with pytest.raises(CosimError, match="give 1 or more"):
        simulate(system, stop_time=1.0, record_every=0)


@pytest.mark.parametrize("method", [Method(), Method("jacobi")])
@pytest.mark.parametrize("fault", [2, 3, 4, 5])
def test_both_engines_fail_alike(probe_fmu: Path, fault: int, method: Method) -> None:
    system = System("two", (Component("a", probe_fmu), Component("b", probe_fmu)),
                    (Connection("a", "x", "b", "u"), Connection("b", "x", "a", "u")))
    told = []
    for engine in ("python", "kernel"):
        with pytest.raises(StepError) as error:
            simulate(system, stop_time=1.0, engine=engine, method=method, record_every=2,
                     parameters={"b.fault": fault, "b.fault_time": 0.25, "a.start_x": 1.0})
        result = error.value.result
        assert result is not None
        assert not result.completed
        told.append((str(error.value), error.value.component, error.value.time, error.value.status, result.steps,
                     result["b.x"].tobytes(), result.time.tolist()))
    assert told[0] == told[1]
    assert told[0][4] == 25


def test_the_kernel_is_chosen_for_long_runs_of_fmus(probe_fmu: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    chosen: list[str] = []

    def choose(joined: Network, engine: str | None) -> Algorithm:
        algorithm = choose_engine(joined, engine)
        chosen.append(type(algorithm).__name__)
        return algorithm

    monkeypatch.setattr("threadpitch.cosim.simulation.choose_engine", choose)
    system = System("one", (Component("a", probe_fmu),))
    for steps, engine in ((10, None), (2 * 10**5, None), (10, "kernel"), (10**3, "python")):
        simulate(system, stop_time=float(steps), step_size=1.0, record=("a.count",), engine=engine,
                 parameters={"a.k": 0.0})
    assert chosen == ["function", "Program", "Program", "function"]
    with pytest.raises(CosimError, match="engine 'fast' is not known; choose one of kernel, python"):
        simulate(system, stop_time=1.0, engine="fast")
    joined = network([FunctionInstance("f", lambda state, time, step_size: None, [variable("y")])], [], [],
                     Schedule(0.0, 1.0, 10**6))
    assert choose_engine(joined).__class__.__name__ == "function"
    with pytest.raises(CosimError, match="loaded FMUs only"):
        choose_engine(joined, "kernel")


def test_chunks_do_not_matter_and_progress_rises(probe_fmu: Path) -> None:
    told: list[tuple[int, int]] = []
    system = System("one", (Component("a", probe_fmu),))
    result = simulate(system, stop_time=300000.0, step_size=1.0, engine="kernel", record=("a.count",),
                      parameters={"a.k": 0.0}, progress=lambda done, steps: told.append((done, steps)))
    assert result["a.count"].tolist() == list(range(300001))
    assert told[-1] == (300000, 300000)
    assert all(before < after for before, after in pairwise(told))
    assert len(told) > 10


@pytest.mark.parametrize("engine", ["kernel", "python"])
def test_a_time_limit_ends_a_run_and_keeps_its_rows(probe_fmu: Path, engine: str) -> None:
    system = System("one", (Component("a", probe_fmu),))
    began = clock.perf_counter()
    with pytest.raises(TimeLimitError, match=r"the run reached t = .* s in the 0\.2 s that it was given") as error:
        simulate(system, stop_time=1e8, step_size=1.0, engine=engine, record=("a.count",), record_every=10**6,
                 parameters={"a.k": 0.0}, time_limit=0.2)
    assert clock.perf_counter() - began < 5.0
    assert error.value.result is not None
    assert error.value.result.steps == int(error.value.time)
    assert not error.value.result.completed


def test_ctrl_c_between_chunks_of_the_kernel(probe_fmu: Path) -> None:
    system = System("one", (Component("a", probe_fmu),))
    with pytest.raises(SimulationInterrupted) as error:
        simulate(system, stop_time=1e8, step_size=1.0, engine="kernel", record=("a.count",), record_every=10**6,
                 parameters={"a.k": 0.0},
                 progress=lambda done, steps: signal.raise_signal(signal.SIGINT) if done > 1000 else None)
    assert error.value.result is not None
    assert error.value.result.steps == int(error.value.time) > 1000


@pytest.mark.skipif(sys.platform == "win32", reason="interval timers are of POSIX")
def test_an_exception_at_the_edge_of_compiled_code_crashes_nothing(probe_fmu: Path) -> None:
    """A second Ctrl-C raises wherever Python runs, that is also while a compiled loop hands back what it found."""
    told = subprocess.run([sys.executable, "-m", "tests.cosim.signalled_kernel", str(probe_fmu)], text=True,
                          capture_output=True, cwd=Path(__file__).parent.parent.parent, check=False)
    assert told.returncode == 0, told.stderr
    assert int(told.stdout) == 2000
