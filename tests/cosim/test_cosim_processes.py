"""FMUs in a process of their own, to its very end: hosts crash at teardown, and PythonFMU shares the interpreter."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
from pathlib import Path


def test_a_fatal_fmu_does_not_take_the_process_with_it(probe_fmu: Path) -> None:
    """Unloading after fmi2Fatal is where hosts crash."""
    script = textwrap.dedent(f"""
        from pathlib import Path
        from threadpitch.cosim import StepError, simulate
        from threadpitch.cosim.system import Component, System
        system = System("s", tuple(Component(name, Path({str(probe_fmu)!r})) for name in "ab"))
        for fault in ("a.fault", "a.initial_fault"):
            try:
                simulate(system, parameters={{fault: 4}}, stop_time=1.0)
            except StepError as error:
                print(error.status)
        print(simulate(system, stop_time=1.0).completed)
    """)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False,
                          env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])})
    assert (done.returncode, done.stdout.split(), done.stderr) == (0, ["fatal", "fatal", "True"], "")


PYTHON_SLAVE = '''
import signal
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real
from pythonfmu.enums import Fmi2Status

class Integrator(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = 1.0
        self.y = 0.0
        self.raise_at = self.discard_at = self.press_at = 1e9
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        for name in ("raise_at", "discard_at", "press_at"):
            self.register_variable(Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed))

    def do_step(self, time, step_size):
        if time >= self.discard_at:
            self.log("position_command is NaN; look at what feeds it", status=Fmi2Status.error)
            return False
        if time >= self.raise_at:
            raise ValueError("out of range")
        if time == self.press_at:
            signal.raise_signal(signal.SIGINT)
        self.y += step_size * self.u
        return True
'''


def test_pythonfmu_fmus_run_and_fail_by_name(tmp_path: Path) -> None:
    script = tmp_path / "integrator_for_cosim_test.py"
    script.write_text(PYTHON_SLAVE)
    program = textwrap.dedent(f"""
        import json
        from pathlib import Path
        from pythonfmu import FmuBuilder
        from threadpitch.cosim import SimulationInterrupted, StepError, simulate
        from threadpitch.cosim.system import Component, Connection, System
        fmu = Path(FmuBuilder.build_FMU({str(script)!r}, dest={str(tmp_path)!r}))
        system = System("s", (Component("one", fmu), Component("two", fmu)), (Connection("one", "y", "two", "u"),))
        found = {{"y": simulate(system, stop_time=1.0, step_size=0.25)["two.y"].tolist()}}
        for name in ("discard_at", "raise_at"):
            try:
                simulate(system, parameters={{"two." + name: 0.5}}, stop_time=2.0, step_size=0.25)
            except StepError as error:
                found[name] = [error.status, str(error), error.result.steps]
        try:  # a KeyboardInterrupt inside of the FMU's own Python would be answered with fmi2Fatal
            simulate(system, parameters={{"two.press_at": 0.5}}, stop_time=1e5, step_size=0.25)
        except SimulationInterrupted as error:
            found["interrupted"] = error.result.steps
        print(json.dumps(found))
    """)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False,
                          env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])})
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["y"] == [0.0, 0.0625, 0.1875, 0.375, 0.625]
    assert found["discard_at"] == ["discard", "two: the step failed at t = 0.5 s (discard): position_command is NaN; "
                                   "look at what feeds it", 2]
    status, message, steps = found["raise_at"]
    assert (status, steps) == ("fatal", 2)
    assert message.startswith("two: the step failed at t = 0.5 s (fatal): ")
    assert "out of range" in message
    assert found["interrupted"] >= 3
