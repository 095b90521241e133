"""Reference results: what they hold, that every built FMU gives them, and that a difference is found and named."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.fmu.driving import MODEL_PATHS, TEST_MODEL, names, read
from tests.fmu.native.building import both_versions, built, every_model, needs_compiler
from threadpitch.fmu import ModelError, scalars
from threadpitch.fmu.check import check_built
from threadpitch.fmu.reference import STEPS, reference, reference_entries

IN, REF = (f"documentation/reference/DampedMass_{part}.csv" for part in ("in", "ref"))


def _changed(fmu: Path, target: Path, change: Callable[[str, bytes], bytes | None]) -> Path:
    """A copy of the FMU with other entries; None leaves one out."""
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(target, "w") as copy:
        for name in source.namelist():
            content = change(name, source.read(name))
            if content is not None:
                copy.writestr(name, content)
    return target


@needs_compiler
@every_model
@both_versions
def test_native_fmus_give_their_reference_results(path: Path, fmi: int) -> None:
    assert check_built(built(path, fmi)) == []


@every_model
def test_python_fmus_give_their_reference_results(path: Path, python_fmu: Callable[[Path], Path]) -> None:
    assert check_built(python_fmu(path)) == []


@pytest.mark.parametrize("path", MODEL_PATHS, ids=names(MODEL_PATHS))
def test_the_run_moves_outputs_and_is_the_same_again(path: Path) -> None:
    model = read(path)
    results = reference(model)
    assert results == reference.__wrapped__(model)
    assert len(results.inputs) == STEPS == len(results.outputs) - 1
    outputs = {scalar.name for scalar in scalars(model) if scalar.variable.causality == "output"}
    assert results.outputs[0].keys() == outputs
    assert any(results.outputs[-1][name] != results.outputs[0][name] for name in outputs)
    assert reference_entries(model) == reference_entries(model)


@needs_compiler
@both_versions
def test_a_difference_of_one_bit_is_named_with_its_time(tmp_path: Path, fmi: int) -> None:
    def change(name: str, content: bytes) -> bytes:
        if name != REF:
            return content
        lines = content.decode().splitlines()
        place = lines[0].split(",").index('"position"')
        cells = lines[4].split(",")
        cells[place] = repr(float(cells[place]) * (1.0 + 2.0**-52))
        lines[4] = ",".join(cells)
        return "\n".join(lines).encode()

    target = _changed(built(TEST_MODEL, fmi), tmp_path / "changed.fmu", change)
    (problem,) = check_built(target)
    assert problem.startswith(f"{target}: position is ")
    assert " at 0.03 s where the reference has " in problem


@needs_compiler
def test_what_cannot_be_run_is_said(tmp_path: Path) -> None:
    fmu = built(TEST_MODEL)
    (problem,) = check_built(_changed(fmu, tmp_path / "a.fmu",
                                      lambda name, content: None if name.startswith("binaries") else content))
    assert "it holds no library for" in problem
    (problem,) = check_built(_changed(fmu, tmp_path / "b.fmu",
                                      lambda name, content: None if name == REF else content))
    assert "its reference results cannot be read" in problem
    (problem,) = check_built(_changed(fmu, tmp_path / "c.fmu",
                                      lambda name, content: content.replace(b'guid="{', b'guid="{x')
                                      if name == "modelDescription.xml" else content))
    assert "it does not run (" in problem
    (tmp_path / "d.fmu").write_bytes(b"no zip")
    (problem,) = check_built(tmp_path / "d.fmu")
    assert "the FMU cannot be read" in problem


def test_start_values_that_do_not_initialize_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "mass.py"
    path.write_text(TEST_MODEL.read_text().replace('"Weights of the forces", start=1.0', '"Weights", start=0.0'))
    with pytest.raises(ModelError, match=r"check\(\) refuses the start values: weights must not all be zero"):
        reference(read(path))
    path.write_text(TEST_MODEL.read_text().replace("self.position = self.base", "self.position = 1.0 / self.base"))
    with pytest.raises(ModelError, match=r"the start values: ZeroDivisionError: .*mass\.py:\d+; mend"):
        reference(read(path))


def test_a_run_that_the_model_refuses_ends_there(tmp_path: Path) -> None:
    path = tmp_path / "mass.py"
    path.write_text(TEST_MODEL.read_text().replace("abs(self.position) > 100.0", "self.steps > 7"))
    results = reference(read(path))
    assert len(results.outputs) == 8
    assert len(results.inputs) == 8  # the last one is refused
