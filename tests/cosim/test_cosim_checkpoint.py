"""A run that goes on in another process has the bits of one that never ended; what does not fit is refused."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import textwrap
import time as clock
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.cosim.test_cosim_kernel import networks
from threadpitch.cosim import (
    CheckpointError,
    Method,
    Result,
    SimulationInterrupted,
    StepError,
    SystemStructureError,
    TimeLimitError,
    resume,
    simulate,
)
from threadpitch.cosim.system import Component, Connection, System

Factory = Callable[..., Path]


def same(one: Result, other: Result) -> None:
    assert list(one) == list(other)
    assert one.time.tobytes() == other.time.tobytes()
    for name in one:
        assert one[name].tobytes() == other[name].tobytes(), name
        assert one[name].dtype == other[name].dtype
    assert (one.steps, one.completed, one.rows) == (other.steps, other.completed, other.rows)


@settings(deadline=None, max_examples=40, derandomize=True)
@given(drawn=networks(), data=st.data())
def test_any_run_goes_on_to_the_same_bits(drawn: dict[str, Any], data: st.DataObject, probe_fmu: Path,
                                          probe3_fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    fmus = {2: probe_fmu, 3: probe3_fmu}
    system = System("random", tuple(Component(f"c{number}", fmus[version])
                                    for number, version in enumerate(drawn["versions"])), drawn["links"])
    fed = {f"{link.end_component}.{link.end_variable}" for link in drawn["links"]}
    starts = {f"c{number}.{'start_x' if version == 2 else 'u'}": drawn["start"][number]
              for number, version in enumerate(drawn["versions"])}
    options: dict[str, Any] = {
        "parameters": {name: value for name, value in starts.items() if name not in fed}, "step_size": 0.01,
        "method": drawn["method"], "record": drawn["record"], "record_every": drawn["every"]}
    try:
        whole = simulate(system, stop_time=0.48, engine="python", **options)
    except StepError:  # a loop that does not come to rest
        assume(False)
    # A last step that every multiple divides, so that both runs may end there.
    middle = 0.12 * data.draw(st.integers(1, 3))
    engines = data.draw(st.permutations(["python", "kernel"]))
    file = tmp_path_factory.mktemp("checkpoint") / "state"
    part = simulate(system, stop_time=middle, engine=engines[0], checkpoint=file, **options)
    assert part.steps == round(middle / 0.01)
    same(whole, resume(file, system=system, stop_time=0.48, engine=engines[1]))


def coupled(fmu: Path) -> System:
    return System("two", (Component("a", fmu), Component("b", fmu)),
                  (Connection("a", "x", "b", "u"), Connection("b", "x", "a", "u")))


@pytest.mark.parametrize("kind", [None, "rows.parquet", "rows.csv", "rows.mat"])
@pytest.mark.parametrize("method", [Method(), Method("jacobi", extrapolation=2, multiples={"b": 4})])
def test_after_an_interrupt_at_any_step(probe_fmu: Path, tmp_path: Path, kind: str | None, method: Method) -> None:
    """Rows that another process wrote behind the checkpoint are replaced."""
    system = coupled(probe_fmu)
    options: dict[str, Any] = {"parameters": {"a.start_x": 1.0}, "stop_time": 10.0, "step_size": 0.001,
                               "method": method, "record_on": ["b.count"]}
    whole = simulate(system, **options)
    results = None if kind is None else tmp_path / kind
    with pytest.raises(SimulationInterrupted) as error:
        simulate(system, **options, results=results, checkpoint=tmp_path / "state", checkpoint_every=0.0,
                 progress=lambda done, steps: signal.raise_signal(signal.SIGTERM) if done > 500 else None)
    assert error.value.signal == signal.SIGTERM
    assert error.value.result is not None
    assert 500 < error.value.result.steps < 10000
    kept = shutil.copy(tmp_path / "state", tmp_path / "kept")
    resume(tmp_path / "state", system=system)
    same(whole, resume(kept, system=system))


def test_the_time_limit_leaves_a_checkpoint(probe_fmu: Path, tmp_path: Path) -> None:
    system = coupled(probe_fmu)
    with pytest.raises(TimeLimitError) as error:
        simulate(system, stop_time=1e5, step_size=0.01, record=["a.count"], record_every=1000, time_limit=0.2,
                 checkpoint=tmp_path / "state")
    result = resume(tmp_path / "state", system=system, stop_time=error.value.time + 1.0)
    assert result.steps == round(error.value.time / 0.01) + 100


def test_adaptive_steps_and_events_go_on(probe_fmu: Path, tmp_path: Path) -> None:
    from threadpitch.cosim.events import Event
    from threadpitch.cosim.method import StepControl

    method = Method(step_control=StepControl(1e-3), events=(Event("b.x", 0.2, "rising"), Event("b.x", 0.3)))
    options: dict[str, Any] = {"parameters": {"a.start_x": 1.0}, "step_size": 0.1, "method": method}
    whole = simulate(coupled(probe_fmu), stop_time=4.0, **options)
    simulate(coupled(probe_fmu), stop_time=1.0, checkpoint=tmp_path / "state", **options)
    rest = resume(tmp_path / "state", system=coupled(probe_fmu), stop_time=4.0)
    same(whole, rest)
    assert len(whole.events) == 2
    assert whole.events == rest.events


def edit_number(text: str) -> str:
    return text.replace('guid="probe"', 'guid="probe" author="another"')


def test_what_is_not_of_this_run_is_refused(probe_fmu: Path, make_fmu: Factory, tmp_path: Path) -> None:
    system = coupled(probe_fmu)
    state = tmp_path / "state"
    simulate(system, parameters={"a.start_x": 1.0}, stop_time=0.5, step_size=0.01, checkpoint=state)
    other = make_fmu(tmp_path / "Probe.fmu", edit_number)
    cases = [(coupled(other), r"FMU of component a: was Probe\.fmu \(.{12}\), is Probe\.fmu \(.{12}\) \(and 1 more\)"),
             (System("two", system.components, system.connections[:1]),
              r"connection b\.x to a\.u was there, and is not")]
    for changed, message in cases:
        with pytest.raises(CheckpointError, match=message):
            resume(state, system=changed, stop_time=1.0)
    with pytest.raises(CheckpointError, match="its results went to memory, and cannot go on in"):
        resume(state, system=system, results=tmp_path / "rows.parquet")
    with pytest.raises(CheckpointError, match="does not say where its system is; hand it over"):
        resume(state)
    with pytest.raises(CheckpointError, match=r"state: the run is at t = 0\.5 s already; give a later stop time"):
        resume(state, system=system, stop_time=0.4)


def test_parameter_sets_that_changed_are_refused(probe_fmu: Path, tmp_path: Path) -> None:
    from threadpitch.cosim.system import ParameterValue

    simulate(coupled(probe_fmu), stop_time=0.5, step_size=0.01, checkpoint=tmp_path / "state")
    system = System("two", coupled(probe_fmu).components, coupled(probe_fmu).connections,
                    (ParameterValue("a.k", 2.0), ParameterValue("b.k", 3.0)))
    with pytest.raises(CheckpointError, match=r"value of a\.k was not there, and is \(and 1 more\); go on with what"):
        resume(tmp_path / "state", system=system, stop_time=1.0)


def test_damaged_files_are_refused(probe_fmu: Path, tmp_path: Path) -> None:
    system, state, broken = coupled(probe_fmu), tmp_path / "state", tmp_path / "broken"
    simulate(system, stop_time=0.5, step_size=0.01, checkpoint=state)
    whole = state.read_bytes()
    rng = random.Random(1)
    for size in (0, 10, len(whole) // 2, len(whole) - 1):
        broken.write_bytes(whole[:size])
        with pytest.raises(CheckpointError, match="readable checkpoint"):
            resume(broken, system=system)
    for _ in range(50):
        place = rng.randrange(len(whole))
        broken.write_bytes(whole[:place] + bytes([whole[place] ^ (1 << rng.randrange(8))]) + whole[place + 1:])
        try:
            changed = resume(broken, system=system)
        except CheckpointError:
            continue
        same(simulate(system, stop_time=0.5, step_size=0.01), changed)  # a bit of the ZIP that means nothing
    with pytest.raises(CheckpointError, match="no such file"):
        resume(tmp_path / "missing", system=system)


def test_made_up_archives_are_refused(tmp_path: Path, probe_fmu: Path) -> None:
    for name, kind, message in (("x", zipfile.ZIP_STORED, "is not a checkpoint of threadpitch"),
                                ("checkpoint.json", zipfile.ZIP_STORED, "is damaged"),
                                ("checkpoint.json", zipfile.ZIP_DEFLATED, "is not a checkpoint of threadpitch")):
        with zipfile.ZipFile(tmp_path / "state", "w", kind) as packed:
            packed.writestr(name, "{}" * 1000)
        with pytest.raises(CheckpointError, match=message):
            resume(tmp_path / "state", system=coupled(probe_fmu))


def test_fmus_that_cannot_serialise_are_named_before_the_run(make_fmu: Factory, tmp_path: Path) -> None:
    fmu = make_fmu(tmp_path / "Mute.fmu", lambda text: text.replace('canSerializeFMUstate="true"', ""))
    with pytest.raises(SystemStructureError) as error:
        simulate(coupled(fmu), stop_time=1e9, step_size=0.01, checkpoint=tmp_path / "state", record=["a.x"],
                 record_every=10**6)
    assert error.value.problems == tuple(
        f"checkpoint: {name} (Mute.fmu) cannot serialise its state (no canSerializeFMUstate)" for name in "ab")


def test_after_a_failed_step_the_last_checkpoint_stays(probe_fmu: Path, tmp_path: Path) -> None:
    options: dict[str, Any] = {"parameters": {"b.fault": 3, "b.fault_time": 5.0}, "step_size": 0.01}
    simulate(coupled(probe_fmu), stop_time=4.0, checkpoint=tmp_path / "state", **options)
    before = (tmp_path / "state").read_bytes()
    with pytest.raises(StepError):
        resume(tmp_path / "state", system=coupled(probe_fmu), stop_time=10.0)
    assert (tmp_path / "state").read_bytes() == before


PROGRAM = """
    import sys
    from pathlib import Path
    from threadpitch.cosim import resume, simulate
    from threadpitch.cosim.system import Component, Connection, System
    system = System("two", (Component("a", Path({fmu!r})), Component("b", Path({fmu!r}))),
                    (Connection("a", "x", "b", "u"), Connection("b", "x", "a", "u")))
    told = lambda done, steps: print(done, flush=True)
    if Path("state").exists():
        resume("state", system=system, checkpoint_every=0.02, progress=told)
    else:
        simulate(system, parameters={{"a.start_x": 1.0}}, stop_time={stop}, step_size=0.001, results="rows.parquet",
                 record_every=10, checkpoint="state", checkpoint_every=0.02, engine={engine!r}, progress=told)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_kill_at_random_moments(probe_fmu: Path, tmp_path: Path) -> None:
    """What was written is readable whenever the process is killed, and the run goes on until it is complete."""
    dataset = pytest.importorskip("pyarrow.parquet")
    stop = 60.0
    whole = simulate(coupled(probe_fmu), parameters={"a.start_x": 1.0}, stop_time=stop, step_size=0.001,
                     record_every=10)
    program = textwrap.dedent(PROGRAM.format(fmu=str(probe_fmu), stop=stop, engine="python"))
    rng = random.Random(7)
    for attempt in range(20):
        with subprocess.Popen([sys.executable, "-c", program], cwd=tmp_path, stdout=subprocess.PIPE,
                              env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}) as process:
            assert process.stdout is not None
            process.stdout.readline()  # it computes
            if attempt < 4:
                clock.sleep(rng.uniform(0.0, 0.25))
                process.kill()
            process.stdout.read()
        parts = list((tmp_path / "rows.parquet").glob("*.parquet"))
        if parts:
            table = dataset.read_table(tmp_path / "rows.parquet")
            times = table.column("time").to_numpy()
            assert times.tobytes() == whole.time[:times.size].tobytes()
            for name in whole:
                assert table.column(name).to_numpy().tobytes() == whole[name][:times.size].tobytes()
        if process.returncode == 0:
            break
    assert process.returncode == 0
    assert attempt == 4
    assert times.size == whole.time.size
    assert np.array_equal(times, whole.time)
