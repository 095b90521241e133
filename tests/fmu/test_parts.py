"""A model in several files: its parts are joined to it, held to the subset, and named where they leave it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fmu.driving import plain_class, read
from threadpitch.fmu import ModelError, plain_module, read_model
from threadpitch.fmu.dependencies import initial
from threadpitch.fmu.model import scalars
from threadpitch.fmu.translate import translate

NUMBERS = '''\
"""Functions of numbers."""
from math import sqrt

FACTOR = 3.0


def scaled(x: float) -> float:
    """FACTOR sqrt(x)."""
    return FACTOR * sqrt(x)
'''
BASE = '''\
"""Half of the model."""
from dataclasses import dataclass

from threadpitch.fmu.variable import input_, output, state

from ._numbers import scaled


@dataclass
class Half:
    """The lower half."""

    drive: float = input_("1", "An input", start=4.0)
    y: float = output("1", "An output")
    n: int = state("1", "A count", start=0, min=0, max=100)

    def _advance(self) -> None:
        self.n = self.n + 1
        self.y = scaled(self.drive)
'''
MODEL = '''\
"""A model of two halves."""
from dataclasses import dataclass

from threadpitch.fmu.variable import parameter

from ._half import Half
from ._numbers import FACTOR


@dataclass
class Whole(Half):
    """The whole model."""

    gain: float = parameter("1", "A gain", start=2.0)

    def check(self) -> int:
        return 0

    def initialize(self) -> None:
        self.n = 0
        self.y = self.gain * self.drive

    def step(self, time: float, step_size: float) -> int:
        self._advance()
        self.y = self.y * self.gain + FACTOR
        return 0
'''
FILES = {"whole.py": MODEL, "_half.py": BASE, "_numbers.py": NUMBERS}


def written(folder: Path, **changes: tuple[str, str]) -> Path:
    """The three files; ``_half=(old, new)`` changes one of them."""
    for name, text in FILES.items():
        old, new = changes.get(name.removesuffix(".py"), ("", ""))
        assert old in text
        (folder / name).write_text(text.replace(old, new) if old else text, encoding="utf-8")
    return folder / "whole.py"


def test_fields_and_methods_of_the_parts_are_the_models(tmp_path: Path) -> None:
    model = read_model(written(tmp_path))
    assert [variable.name for variable in model.variables] == ["drive", "y", "n", "gain"]
    assert model.description == "The whole model."
    assert {scalar.name for scalar in initial(model, scalars(model))} == {"drive", "gain"}


def test_the_plain_module_stands_alone_and_calculates_the_same(tmp_path: Path) -> None:
    model = read(written(tmp_path))
    text = plain_module(model).text
    assert "import" not in text.replace("from math import sqrt", "")
    plain, declared = plain_class(model)(), model.model_class()
    for instance in (plain, declared):
        instance.initialize()
        assert instance.step(0.0, 1.0) == 0
        assert (instance.y, instance.n) == (3.0 * 2.0 * 2.0 + 3.0, 1)


def test_parts_are_translated_to_c(tmp_path: Path) -> None:
    equations = translate(read(written(tmp_path)))
    assert "function_scaled" in equations.source
    assert "int64_t n;" in equations.header


def test_a_change_of_a_part_is_a_change_of_the_model(tmp_path: Path) -> None:
    before = plain_module(read(written(tmp_path))).name
    assert plain_module(read(written(tmp_path, _numbers=("3.0", "4.0")))).name != before


@pytest.mark.parametrize(("changes", "file", "line", "what"), [
    ({"_numbers": ("FACTOR * sqrt(x)", "FACTOR * x**0.5")}, "_numbers.py", 9, "**, which rounds"),
    ({"_half": ("self.n = self.n + 1", "print(self.n)")}, "_half.py", 18, "a call of print"),
    ({"_half": ("start=0, min=0", "start=-1, min=0")}, "_half.py", 15, "n: start -1 is outside"),
    ({"whole": ("self.y * self.gain", "self.y % self.gain")}, "whole.py", 25, "% of floats"),
    ({"whole": ("gain: float", "drive: float")}, "whole.py", 14, "drive is defined in"),
    ({"whole": ("import FACTOR", "import FACTOR\nFACTOR = 2.0")}, "whole.py", 8, "FACTOR is defined in"),
    ({"whole": ("import FACTOR", "import NUMBER")}, "whole.py", 7, "finds no NUMBER in _numbers.py"),
    ({"whole": ("import FACTOR", "import FACTOR as F")}, "whole.py", 7, "import it without as"),
    ({"whole": ("._numbers", "._number")}, "whole.py", 7, "finds no file _number.py"),
    ({"whole": ("._numbers", ".whole")}, "whole.py", 7, "is no import of a part"),
    ({"_numbers": ("from math import sqrt", "from math import sqrt\nfrom ._half import Half")}, "_numbers.py", 3,
     "imports in a circle"),
    ({"_numbers": ("FACTOR = 3.0", "FACTOR = 1.0 / 0.0")}, "_numbers.py", 4, "ZeroDivisionError"),
    ({"_numbers": ("FACTOR = 3.0", "FACTOR = = 3.0")}, "_numbers.py", 4, "not Python"),
])
def test_refused_with_the_file_and_line_of_the_part(
        changes: dict[str, tuple[str, str]], file: str, line: int, what: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError) as caught:
        plain_module(read_model(written(tmp_path, **changes)))
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / file}:{line}: ")
    assert what in message
    assert "\n" not in message


def test_a_base_class_in_the_same_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "one.py"
    path.write_text(MODEL.replace("from ._half import Half\nfrom ._numbers import FACTOR", BASE.partition("\n\n\n")[2]))
    with pytest.raises(ModelError):
        plain_module(read_model(path))
