"""Components in processes of their own: the same bits and errors, and a crash that leaves everything else alive."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time as clock
from pathlib import Path
from typing import Any

import pytest

from threadpitch.cosim import CosimError, Method, StepError, SystemStructureError, simulate
from threadpitch.cosim.system import Component, Connection, System


@pytest.fixture
def system(probe_fmu: Path, probe3_fmu: Path) -> System:
    return System("three", (Component("a", probe_fmu), Component("b", probe_fmu), Component("c", probe3_fmu)),
                  (Connection("a", "x", "b", "u"), Connection("b", "x", "a", "u"),
                   Connection("b", "x", "c", "u", convert_units=False)))


OPTIONS: dict[str, Any] = {"stop_time": 0.4, "step_size": 0.01, "record": ["*"]}


@pytest.mark.parametrize("method", [Method(extrapolation=2), Method("jacobi", multiples={"a": 2}),
                                    Method("iterated", tolerance=1e-6)])
def test_isolated_components_give_the_same_bits(system: System, method: Method) -> None:
    parameters: dict[str, Any] = {"a.start_x": 1.0, "c.label": "text", "b.gain": [1.0, 2.0]}
    here = simulate(system, parameters=parameters, method=method, engine="python", **OPTIONS)
    for isolate in (True, ["b", "c"], "a"):
        there = simulate(system, parameters=parameters, method=method, isolate=isolate, **OPTIONS)
        for name in here:
            assert here[name].tobytes() == there[name].tobytes(), name


@pytest.mark.parametrize(("fault", "status"), [(2, "discard"), (3, "error"), (4, "fatal"), (5, "nan")])
def test_faults_are_those_of_the_component_itself(system: System, fault: int, status: str) -> None:
    told = []
    for isolate in (False, True):
        with pytest.raises(StepError) as error:
            simulate(system, parameters={"b.fault": fault, "b.fault_time": 0.2}, isolate=isolate, **OPTIONS)
        assert error.value.result is not None
        told.append((str(error.value), error.value.component, error.value.time, error.value.status,
                     error.value.result.steps))
    assert told[0] == told[1]
    assert told[0][3] == status


@pytest.mark.skipif(sys.platform == "win32", reason="crashes have other names there")
@pytest.mark.parametrize(("fault", "how"), [(7, "SIGSEGV"), (8, "exit status 3")])
def test_a_crash_is_an_error_with_a_name(system: System, tmp_path: Path, fault: int, how: str) -> None:
    with pytest.raises(StepError) as error:
        simulate(system, parameters={"a.start_x": 1.0, "b.fault": fault, "b.fault_time": 0.2}, isolate=["b"],
                 results=tmp_path / "rows.csv", **OPTIONS)
    assert str(error.value) == f"b: the FMU crashed at t = 0.2 s ({how}): its process ended"
    assert (error.value.component, error.value.time, error.value.status) == ("b", 0.2, "crash")
    whole = simulate(system, parameters={"a.start_x": 1.0, "b.fault": fault, "b.fault_time": 9.0}, engine="python",
                     **{**OPTIONS, "stop_time": 0.2})
    kept = error.value.result
    assert kept is not None
    assert kept["a.x"].tobytes() == whole["a.x"].tobytes()
    assert len((tmp_path / "rows.csv").read_text().splitlines()) == 1 + 21


def test_a_component_that_is_not_there_is_told(system: System) -> None:
    with pytest.raises(SystemStructureError, match="isolate: no component 'd'; known are"):
        simulate(system, isolate=["d"], **OPTIONS)
    with pytest.raises(CosimError, match="the kernel steps loaded FMUs only"):
        simulate(system, isolate=True, engine="kernel", **OPTIONS)


def test_checkpoints_of_isolated_components(system: System, tmp_path: Path) -> None:
    from threadpitch.cosim import resume

    whole = simulate(system, parameters={"a.start_x": 1.0}, engine="python", **OPTIONS)
    simulate(system, parameters={"a.start_x": 1.0}, isolate=["a", "c"], checkpoint=tmp_path / "state",
             **{**OPTIONS, "stop_time": 0.2})
    rest = resume(tmp_path / "state", system=system, stop_time=0.4)
    for name in whole:
        assert whole[name].tobytes() == rest[name].tobytes(), name


PROGRAM = """
    import os, sys
    from pathlib import Path
    from threadpitch.cosim import SimulationInterrupted, StepError, simulate
    from threadpitch.cosim.system import Component, System
    system = System("one", (Component("a", Path({fmu!r})), Component("b", Path({fmu!r}))))
    print(os.getpid(), flush=True)
    try:
        simulate(system, parameters={parameters!r}, stop_time=1e6, step_size=0.01, record=["a.count"],
                 record_every=10**4, isolate={isolate!r}, progress=lambda done, steps: print(done, flush=True))
    except (SimulationInterrupted, StepError) as error:
        print(type(error).__name__, error, error.result.steps > 0)
"""


def program(**values: object) -> list[str]:
    return [sys.executable, "-c", textwrap.dedent(PROGRAM.format(**values))]


def alive(number: str) -> bool:
    """Whether a process is there, and not only waits for its parent to look at it."""
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def assert_ended(numbers: list[str]) -> None:
    deadline = clock.monotonic() + 10.0
    while any(map(alive, numbers)):
        assert clock.monotonic() < deadline
        clock.sleep(0.02)


def environment(folder: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), "TMPDIR": str(folder)}


def heard() -> None:
    """In the new process: signals that those who started the tests ignore (a shell in the background, nohup)."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("isolate", [[], ["b"]])
def test_signals_end_a_run_in_order(probe_fmu: Path, tmp_path: Path, number: signal.Signals,
                                    isolate: list[str]) -> None:
    """Between two steps, with the rows kept and the unpacked FMUs removed; workers do not hear of it."""
    with subprocess.Popen(program(fmu=str(probe_fmu), parameters={}, isolate=isolate), env=environment(tmp_path),
                          stdout=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=heard) as process:
        assert process.stdout is not None
        process.stdout.readline()
        while int(process.stdout.readline()) < 10:
            pass
        assert any(tmp_path.glob("threadpitch-*"))
        os.killpg(process.pid, number)
        rest = process.stdout.read().splitlines()
    assert process.returncode == 0
    assert rest[-1].startswith("SimulationInterrupted interrupted at t = ")
    assert rest[-1].endswith(" True")
    assert not any(tmp_path.glob("threadpitch-*"))


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_workers_end_with_their_master(probe_fmu: Path, tmp_path: Path) -> None:
    with subprocess.Popen(program(fmu=str(probe_fmu), parameters={}, isolate=["a", "b"]), stdout=subprocess.PIPE,
                          text=True, env=environment(tmp_path)) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.stdout.readline()
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        assert len(children) == 2
        process.kill()
    assert_ended(children)


HANGING = """
    from pathlib import Path
    from threadpitch.cosim import simulate
    from threadpitch.cosim.interrupt import end_in_order
    from threadpitch.cosim.system import Component, System
    end_in_order()
    simulate(System("one", (Component("a", Path({fmu!r})),)), parameters={{"a.fault": 6, "a.fault_time": 0.5}},
             stop_time=1.0, step_size=0.01, isolate=True, results={results!r})
"""


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize("numbers", [[signal.SIGTERM, signal.SIGTERM], [signal.SIGKILL]])
def test_a_component_that_never_returns_can_be_ended(probe_fmu: Path, tmp_path: Path,
                                                     numbers: list[signal.Signals]) -> None:
    """By a second signal, with the rows in the file; and a master that is killed takes its worker with it."""
    results = tmp_path / "rows.csv"
    text = textwrap.dedent(HANGING.format(fmu=str(probe_fmu), results=str(results)))
    with subprocess.Popen([sys.executable, "-c", text], env=environment(tmp_path), stderr=subprocess.PIPE,
                          text=True) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == "never\n"
        workers = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        assert len(workers) == 1
        for number in numbers:
            process.send_signal(number)
            clock.sleep(0.2)  # two signals at once are one
        process.wait(10.0)
        assert_ended(workers)
    if len(numbers) == 2:
        assert len(results.read_text().splitlines()) == 52  # header, 0 to 0.5 s
        assert not any(tmp_path.glob("threadpitch-*"))
