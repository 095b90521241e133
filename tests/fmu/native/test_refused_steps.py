"""What a model refuses: importers end, the build warns, the check compares refusals too."""

from __future__ import annotations

import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.fmu.driving import ROOT, read
from tests.fmu.native.building import needs_compiler
from tests.fmu.own import line_of, write_model
from threadpitch.cli import invoke
from threadpitch.cosim import StepError, simulate
from threadpitch.cosim.system import Component, System
from threadpitch.fmu import ModelError, build_fmu, effort, refusal
from threadpitch.fmu.check import check_built
from threadpitch.fmu.reference import reference

REFUSALS = {
    "declared": ("if self.n == 30:\n    return 1\nself.n = self.n + 1", "enough: stop"),
    "undeclared": ("if self.n == 30:\n    return 7\nself.n = self.n + 1", "the model returns 7, which ERRORS does not"),
    "index": ("self.y = self.a[self.n // 10]\nself.n = self.n + 1", "IndexError: list index out of range"),
    "large": ("self.n = self.n + 1\nif self.n > 30:\n    self.n = 3000000000", "n is 3000000000, beyond the 32 bits"),
}
TOP = 'ERRORS = {1: "enough: stop"}\nEXPERIMENT = Experiment(stop_time=1.0, step_size=0.01)\n'
STEPS = {"declared": 30, "undeclared": 30, "index": 40, "large": 30}
# The rows are collected by step_finished, as FMPy raises what an FMU of FMI 3 refuses and returns no rows
RUN = """
import sys
from fmpy import simulate_fmu
times = []
def finished(time, recorder):
    times.append(time)
    return True
try:
    rows = simulate_fmu(sys.argv[1], stop_time=float(sys.argv[2]), step_size=float(sys.argv[3]),
                        output_interval=float(sys.argv[3]), step_finished=finished)
    print("returned", len(rows) - 1)
except Exception as error:
    print("raised", len(times), error)
"""
FLAVORS = pytest.mark.parametrize(("flavor", "fmi"), [
    ("python", 2), pytest.param("native", 2, marks=needs_compiler), pytest.param("native", 3, marks=needs_compiler)])


def simulated(fmu: Path, stop_time: float, step_size: float) -> str:
    """What FMPy makes of the FMU; a run that does not end fails."""
    done = subprocess.run([sys.executable, "-c", RUN, str(fmu), str(stop_time), str(step_size)], capture_output=True,
                          text=True, timeout=60, check=True)
    return done.stdout.splitlines()[-1]


@pytest.mark.parametrize("kind", REFUSALS)
@FLAVORS
def test_the_refusal_is_warned_of_and_compared_and_an_importer_ends_at_it(
        kind: str, flavor: str, fmi: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_model(tmp_path / "probe.py", REFUSALS[kind][0], top=TOP)
    options = ["--output", str(tmp_path), "--check", "--flavor", flavor, "--fmi", str(fmi)]
    assert invoke(["build", str(path), *options]) == 0
    written = capsys.readouterr()
    assert written.err.startswith(f"threadpitch: warning: {path}: the default experiment is refused at ")
    assert "all agree" in written.out
    told = simulated(next(tmp_path.rglob("Probe.fmu")), 1.0, 0.01)
    if fmi == 3:
        assert told == f"raised {STEPS[kind]} fmi3DoStep failed with status 2 (discard)."
    else:
        assert re.fullmatch(rf"returned {STEPS[kind]}|returned {STEPS[kind] + 1}", told)


@FLAVORS
def test_the_model_of_the_page_ends_when_its_first_step_is_too_long(flavor: str, fmi: int, tmp_path: Path) -> None:
    page = (ROOT / "docs" / "own_model.md").read_text(encoding="utf-8")
    text = re.findall(r"<!-- model: thermal_spindle.py -->\n```python\n(.*?)^```", page, flags=re.DOTALL | re.MULTILINE)
    (tmp_path / "thermal_spindle.py").write_text(text[0], encoding="utf-8")
    told = simulated(build_fmu(tmp_path / "thermal_spindle.py", tmp_path, flavor, fmi=fmi), 3000.0, 1000.0)
    assert told.startswith("raised 0 " if fmi == 3 else "returned ")


# Reference results ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", REFUSALS)
def test_a_refused_experiment_is_told_with_its_time_and_line(kind: str, tmp_path: Path) -> None:
    step, reason = REFUSALS[kind]
    path = write_model(tmp_path / "probe.py", step, top=TOP)
    results = reference(read(path))
    assert (len(results.inputs), len(results.outputs)) == (STEPS[kind] + 1, STEPS[kind] + 1)
    told = refusal(read(path))
    assert told is not None
    assert told.startswith(f"{path}: the default experiment is refused at {STEPS[kind] / 100:g} s: {reason}")
    if kind == "index":
        assert f"{path}:{line_of(path, 'self.a[self.n')}; the reference results end there" in told


@FLAVORS
def test_an_index_outside_its_array_in_the_initialization(flavor: str, fmi: int, tmp_path: Path) -> None:
    """With a start value that the build does not try."""
    path = write_model(tmp_path / "probe.py", "self.n = self.n + 1", top=TOP)
    path.write_text(path.read_text().replace("self.y = 0.0\n", "self.y = self.a[int(floor(self.drive))]\n"))
    fmu = build_fmu(path, tmp_path, flavor, fmi=fmi)
    system = System("own", (Component("own", fmu),))
    assert simulate(system, parameters={"own.drive": 3.0}, stop_time=0.1).steps == 10
    with pytest.raises(StepError, match=r"initialisation failed .*(index is outside its array|IndexError)"):
        simulate(system, parameters={"own.drive": 4.0}, stop_time=0.1)


@needs_compiler
@pytest.mark.parametrize("step", ["self.n = self.n + 1\nself.y = 1.0 / (5.0 - self.n)",
                                  "self.n = self.n + 1\nself.y = sqrt(4.0 - self.n)"], ids=["division", "root"])
def test_what_python_refuses_and_c_computes_is_a_difference(step: str, tmp_path: Path) -> None:
    path = write_model(tmp_path / "probe.py", step, top=TOP)
    assert check_built(build_fmu(path, tmp_path / "python")) == []
    for fmi in (2, 3):
        (problem,) = check_built(build_fmu(path, tmp_path, "native", fmi=fmi))
        assert "the step from 0.04 s is computed where Python refuses it; guard the model" in problem


@pytest.mark.parametrize(("step", "reason"), [
    ("if self.drive > 0.0:\n    return 1", "enough: stop"),
    ("self.y = 1.0 / self.n", "ZeroDivisionError: float division by zero, FILE:LINE"),
    ("self.n = 4000000000", "n is 4000000000, beyond the 32 bits of an FMI integer"),
])
def test_a_model_that_refuses_its_first_step_is_not_built(step: str, reason: str, tmp_path: Path) -> None:
    path = write_model(tmp_path / "probe.py", step, top=TOP)
    reason = reason.replace("FILE:LINE", f"{path}:{line_of(path, step.splitlines()[0])}")
    step_text = f"{path}: the first step cannot be computed with the start values and the default experiment: {reason}"
    with pytest.raises(ModelError, match=re.escape(step_text)):
        build_fmu(path, tmp_path)
    assert [one.name for one in tmp_path.iterdir()] == ["probe.py"]


def test_a_step_without_end_is_told_with_its_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(effort, "MOST_LINES", 10_000)
    loop = "x = 0.0\nwhile x < 1.0 + self.drive * 0.0:\n    x = x * 2.0"
    path = write_model(tmp_path / "probe.py", loop, top=TOP)
    with pytest.raises(ModelError, match=rf"the first step cannot be .* no end after .* {re.escape(str(path))}:2[5-8]"):
        build_fmu(path, tmp_path)
    later = write_model(tmp_path / "later.py", f"self.n = self.n + 1\nif self.n > 3:\n    {loop!s}".replace(
        "\n    x = x", "\n        x = x").replace("\nwhile", "\n    while"), top=TOP)
    results = reference(read(later))
    assert (len(results.inputs), len(results.outputs)) == (3, 4)  # no FMU is asked for the step that does not end
    assert "is refused at 0.03 s: no end after" in str(refusal(read(later)))
    assert sys.gettrace() is None


# Damaged reference results -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sound_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sound")
    return build_fmu(write_model(folder / "probe.py", "self.n = self.n + 1", top=TOP), folder, "native")


@needs_compiler
@pytest.mark.parametrize(("part", "change", "problem"), [
    ("ref.csv", lambda text: text.rsplit("\n", 2)[0] + "\n",
     r"Probe_ref\.csv ends at 0\.99 s, and Probe_ref\.opt has the StopTime 1\.0 s"),
    ("ref.csv", lambda text: "\n".join(text.splitlines()[:50]) + "\n", r"holds 100 rows for the 48 steps"),
    ("ref.csv", lambda text: text.replace("\n", ",1\n", 3).replace(",1\n", "\n", 1),
     r"line 2 of Probe_ref\.csv holds 4 cells, and the header 3"),
    ("ref.csv", lambda text: "", r"Probe_ref\.csv holds no row"),
    ("ref.opt", lambda text: text.replace("StopTime, 1.0", "StopTime, 2.0"), r"has the StopTime 2\.0 s"),
])
def test_reference_results_that_are_cut_off_are_named(part: str, change: object, problem: str, tmp_path: Path,
                                                       sound_fmu: Path) -> None:
    assert callable(change)
    with zipfile.ZipFile(sound_fmu) as source, zipfile.ZipFile(tmp_path / "changed.fmu", "w") as copy:
        for name in source.namelist():
            content = source.read(name)
            copy.writestr(name, change(content.decode()) if name.endswith(part) else content)
    (told,) = check_built(tmp_path / "changed.fmu")
    assert "its reference results cannot be read (" in told
    assert re.search(problem, told)


@needs_compiler
def test_the_last_line_of_the_log_says_why_a_step_was_refused(tmp_path: Path) -> None:
    path = write_model(tmp_path / "probe.py", "if self.drive > 1e6:\n    return 1\nself.n = self.n + 1", top=TOP)
    for flavor, fmi in (("python", 2), ("native", 2), ("native", 3)):
        fmu = build_fmu(path, tmp_path / flavor, flavor, fmi=fmi)
        with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(tmp_path / "changed.fmu", "w") as copy:
            for name in source.namelist():
                text = source.read(name)
                if name.endswith("_in.csv"):
                    lines = text.decode().splitlines()
                    text = "\n".join([*lines[:3], lines[3].partition(",")[0] + ",1e7", *lines[4:], ""]).encode()
                copy.writestr(name, text)
        (told,) = check_built(tmp_path / "changed.fmu")
        assert "it does not run (" in told
        assert "the step from 0.02 s of 0.01 s is refused: enough: stop" in told
