"""What is translated, what stays out of the C, and how a failure is told."""

from __future__ import annotations

import importlib.util
import subprocess
from pathlib import Path

import pytest

from tests.fmu.driving import MODEL_PATHS, TABLE_MODEL, TEST_MODEL, names, read
from tests.fmu.native.building import every_model
from threadpitch.fmu import ModelError
from threadpitch.fmu import translate as translation
from threadpitch.fmu.plain import module_text
from threadpitch.fmu.table import Tokens, c_text, table
from threadpitch.fmu.translate import source_line, translate


@every_model
def test_no_global_variable_and_no_foreign_header(path: Path) -> None:
    equations = translate(read(path))
    includes = [line for text in (equations.header, equations.source) for line in text.splitlines()
                if line.startswith("#include")]
    assert includes == ['#include "translated.h"', '#include "equations.h"']
    for text in (equations.header, equations.source):
        for line in text.splitlines():
            # what stands at the left margin is a function, the struct, a comment or a brace
            assert not line.endswith(";") or line.startswith((" ", "}")) or "(" in line, line


def test_constants_stand_in_the_code_as_numbers() -> None:
    source = translate(read(TABLE_MODEL)).source
    assert "6.283185307179586 * (int64_t)floor(self->angle / 6.283185307179586) - (-2.5)" in source
    assert "M_PI" not in source
    assert "BACK" not in source


def test_integers_keep_64_bits_on_windows() -> None:
    source = translate(read(TABLE_MODEL)).source
    assert "llabs(" in source
    assert " labs(" not in source


def test_functions_of_the_file_have_names_of_their_own() -> None:
    source = translate(read(TABLE_MODEL)).source
    assert "double function_largest(array_double_1d values, int64_t count)" in source
    assert "double elementary_cos(double x)" in source


def test_another_cache_gives_the_same_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = translate(read(TABLE_MODEL))
    monkeypatch.setenv("THREADPITCH_CACHE", str(tmp_path))
    assert translate(read(TABLE_MODEL)) == before
    assert [path.name for path in tmp_path.iterdir()] == ["translation"]


def test_pyccel_runs_once_for_one_content(monkeypatch: pytest.MonkeyPatch) -> None:
    before = translate(read(TEST_MODEL))

    def never(*_: object, **__: object) -> None:
        raise AssertionError("Pyccel ran again")

    monkeypatch.setattr(subprocess, "run", never)
    assert translate(read(TEST_MODEL)) == before


def test_what_pyccel_refuses_is_told_by_file_and_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "broken.py"
    path.write_text(TEST_MODEL.read_text().replace("self.steps = self.steps + 1", "self.steps = divmod(self.steps, 2)"))
    with pytest.raises(ModelError, match="a call of divmod cannot be in an FMU"):
        translate(read(path))
    monkeypatch.setattr(translation, "check_subset", lambda model: None)  # as if the subset had let it pass
    line = path.read_text().splitlines().index("        self.steps = divmod(self.steps, 2)") + 1
    with pytest.raises(ModelError) as caught:
        translate(read(path))
    message = str(caught.value)
    assert message.startswith(f"{path}:{line}: self.steps = divmod(self.steps, 2): Pyccel does not translate this (")
    assert "\n" not in message


def test_a_model_outside_the_subset_never_reaches_pyccel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "broken.py"
    path.write_text(TEST_MODEL.read_text().replace("h = step_size / self.substeps", "h = step_size ** 2"))
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: pytest.fail("Pyccel ran"))
    with pytest.raises(ModelError, match=r"broken\.py:\d+: \*\*, which rounds differently in C"):
        translate(read(path))


def test_many_numbers_compared_at_once_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "many.py"
    path.write_text(TEST_MODEL.read_text().replace("h = step_size / self.substeps",
                                                   "h = min(step_size, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)"))
    with pytest.raises(ModelError, match="min or max of 7 numbers cannot be in a native FMU; compare 6 at a time"):
        translate(read(path))


@pytest.mark.parametrize("path", MODEL_PATHS, ids=names(MODEL_PATHS))
def test_every_line_of_the_module_is_found_in_the_file(path: Path) -> None:
    """The line of an assignment in the module that Pyccel reads is the one of the same assignment in the file."""
    model = read(path)
    text = module_text(model, translation._dialect(model, f"{model.class_name}Model"))
    lines = model.source.splitlines()
    targets = [(number, line.split("=")[0].strip()) for number, line in enumerate(text.splitlines(), 1)
               if " = " in line and "elementary" not in line]
    inside = text.splitlines().index(f"class {model.class_name}Model:")
    initial = next(number for number, line in enumerate(text.splitlines()) if "def check(" in line)
    checked = [(number, target) for number, target in targets if number > max(inside, initial)]
    assert len(checked) > 10
    for number, target in checked:
        found = lines[source_line(model, text, number) - 1]
        assert found.strip().startswith(target.split("[")[0].split(",")[0]), (number, target, found)


def test_texts_survive_as_c_strings(tmp_path: Path) -> None:
    assert c_text('ä "%d" \\ ??/') == '"\\303\\244 \\042%d\\042 \\134 \\077\\077/"'
    model = read(TABLE_MODEL)
    written = table(model, "RotaryTableModel", Tokens("{2}", "{3}"))
    assert '.token2 = "{2}"' in written
    assert '.token3 = "{3}"' in written
    assert "{.name = \"turn_clock\", .variable = 6, .element = 1}," in written
    assert ".derivative = {PLACE(command_rate), PLACE(command_bend)}" in written
    assert f".output_derivative = {[variable.name for variable in model.variables].index('speed')}}}" in written


def test_pyccel_missing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"Pyccel is not installed; install it with: pip install pyccel==2\.0\.1"):
        translate(read(TEST_MODEL))
