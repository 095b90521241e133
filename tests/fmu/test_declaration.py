"""Declarations that do not make sense are refused with file, line, variable and mend."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fmu.driving import TEST_MODEL, read
from threadpitch.fmu import ModelError, read_model, scalars

FRAME = '''\
from dataclasses import dataclass
from threadpitch.fmu.variable import Experiment, input_, output, parameter, state
{top}

@dataclass
class Probe:
    """A model."""

    {field}

    def check(self) -> int:
        return 0

    def initialize(self) -> None:
        pass

    def step(self, time: float, step_size: float) -> int:
        return 0
'''
GOOD = 'y: float = output("m", "An output")'


def _refusal(tmp_path: Path, field: str = GOOD, top: str = "") -> str:
    path = tmp_path / "probe.py"
    path.write_text(FRAME.format(field=field, top=top))
    with pytest.raises(ModelError) as caught:
        read_model(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    return message.removeprefix(str(path))


@pytest.mark.parametrize(("field", "message"), [
    ('x: float = 1.0', "x: the field is not declared"),
    ('x: str = parameter("1", "Text", start=0.0)', "x: type str cannot be in an FMU"),
    ('x: list[float] = state("m", "Array")', "x: type list[float] and size=None do not fit"),
    ('x: float = state("m", "Scalar", size=3)', "x: type float and size=3 do not fit"),
    ('x: list[float] = state("m", "Array", size=0)', "x: size=0 is not a size"),
    ('x: float = state("mile", "Length")', "x: unit 'mile' is not known"),
    ('x: float = state("mm", "Length")', "x: 'mm' is not an SI unit"),
    ('x: float = state("m", "Length", display="deg")', "x: display unit 'deg' measures another quantity than 'm'"),
    ('x: int = state("m", "Count", start=0, min=0, max=1)', "x: FMI gives no unit to int"),
    ('x: int = state("1", "Count", min=0, max=1)', "x: is int but starts at 0.0; write start=0 or another int"),
    ('x: bool = state("1", "Flag")', "x: is bool but starts at 0.0"),
    ('x: float = parameter("1", "Number", start=1)', "x: is float but starts at 1"),
    ('x: float = parameter("1", "Number", start=float("nan"))', "x: starts at nan"),
    ('x: int = state("1", "Count", start=0)', "x: an int declares its bounds within 32 bits"),
    ('x: int = state("1", "Count", start=0, min=0, max=2147483648)', "x: an int declares its bounds within 32 bits"),
    ('x: float = parameter("m", "Length", start=2.0, max=1.0)', "x: start 2.0 is outside -inf to 1.0"),
    ('x: float = parameter("m", "Length", start=0.0, max=float("inf"))', "x: min or max is not finite"),
    ('x: float = state("m", "Length", nominal=0.0)', "x: nominal=0.0"),
    ('x: bool = parameter("1", "Flag", start=False, min=0)', "x: is bool and has no range"),
    ('x: int = parameter("1", "Kind", start=3, choices={"a": 1, "b": 2})', "x: start 3 is outside 1 to 2"),
    ('x: int = parameter("1", "Kind", start=1, choices={"a": 1, "b": 1})', "x: two choices have the same number"),
    ('x: float = output("m", "Output", depends_on=("z",))', "x: depends_on names 'z'"),
    ('double: float = state("m", "Length")', "double: this name has a meaning in C"),
    ('is_freed: float = state("m", "Length")', "is_freed: this name has a meaning in C"),
    ('NULL: float = state("m", "Length")', "NULL: this name has a meaning in C"),
    ('_x: float = state("m", "Length")', "_x: this name is not legal in FMI"),
    ('x: float = state("m", "")', "x: the description is empty"),
])
def test_field_is_refused(field: str, message: str, tmp_path: Path) -> None:
    assert _refusal(tmp_path, field).startswith(f":9: {message}")


@pytest.mark.parametrize(("top", "message"), [
    ("import nowhere_to_be_found", ":3: ModuleNotFoundError"),
    ("x = 1 / 0", ":3: ZeroDivisionError"),
    ("def f(:", ":3: "),
    ("import sys\nsys.exit('no')", ":4: SystemExit: no; the model cannot be imported"),
    ("from threadpitch.fmu.variable import Clock\nCLOCKS = 3", ":4: CLOCKS must be a tuple"),
    ("TERMINALS = 'all'", ":3: TERMINALS must be a tuple"),
    ("ERRORS = {0: 'zero'}", ":3: ERRORS must be a dict"),
    ("ERRORS = ['one']", ":3: ERRORS must be a dict"),
    ("EXPERIMENT = 2.0", ":3: EXPERIMENT must be an Experiment"),
    ("EXPERIMENT = Experiment(stop_time=0.0, step_size=1e-3)", ":3: EXPERIMENT must have start_time < stop_time"),
    ("@dataclass\nclass Other:\n    pass", ": a model file holds one dataclass, this one holds Other, Probe"),
])
def test_file_is_refused(top: str, message: str, tmp_path: Path) -> None:
    assert _refusal(tmp_path, top=top).startswith(message)


def test_missing_methods_and_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "probe.py"
    text = FRAME.format(field=GOOD, top="")
    path.write_text(text.replace("def check(self)", "def other(self)"))
    with pytest.raises(ModelError, match=r"probe.py:6: Probe has no method check\(self\); add it"):
        read_model(path)
    path.write_text(text.replace("step(self, time: float,", "step(self, now: float,"))
    with pytest.raises(ModelError, match=r"write it as step\(self, time, step_size\)"):
        read_model(path)
    path.write_text(text.replace("class Probe", "class _Base:\n    pass\n\nclass Probe").replace("@dataclass", ""))
    with pytest.raises(ModelError, match="this one holds none"):
        read_model(path)
    with pytest.raises(ModelError, match="cannot be read"):
        read_model(tmp_path / "absent.py")
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(ModelError, match="UTF-8"):
        read_model(path)


def test_record_holds_what_is_declared() -> None:
    model = read(TEST_MODEL)
    assert model.class_name == "DampedMass"
    assert [variable.name for variable in model.variables][:3] == ["base", "forces", "locked"]
    assert model.variable("kind").choices == {"spring": 1, "rubber": 2}
    assert (model.variable("kind").min, model.variable("kind").max) == (1, 2)
    assert [scalar.name for scalar in scalars(model)][:5] == ["base", "forces[1]", "forces[2]", "forces[3]", "locked"]
    assert [scalar.reference for scalar in scalars(model)] == list(range(len(scalars(model))))
    assert read_model(str(TEST_MODEL)) is model  # one class for one content
    with pytest.raises(KeyError):
        model.variable("absent")
