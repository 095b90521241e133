"""What would be refused by Pyccel, mean something else in C, or break the C is refused with the mend."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest

from tests.fmu.driving import MODEL_PATHS, names, plain_class, read
from threadpitch.fmu import ModelError, plain_module
from threadpitch.fmu.subset import check_elementary, check_subset

FRAME = '''\
from dataclasses import dataclass
from math import floor, pi, sqrt
{top}
from threadpitch.fmu.variable import input_, output, parameter, state

COUNT = 3
{constants}

@dataclass
class Probe:
    """A model for one construct."""

    drive: float = input_("1", "An input")
    gain: float = parameter("1", "A parameter", start=1.0)
    y: float = output("1", "An output")
    n: int = state("1", "A count", start=0, min=0, max=100)
    ok: bool = state("1", "A flag", start=False)
    a: list[float] = state("1", "An array", size=4)
{members}

    def check(self) -> int:
        return 0

    def initialize(self) -> None:
        self.y = 0.0

    def step(self, time: float, step_size: float) -> int:
{body}
        return 0

    def _change(self) -> float:
        self.n = self.n + 1
        return 1.0

    def _pair(self, x: float) -> tuple[float, int]:
        return x, 1
'''

REFUSED = {
    # refused by Pyccel
    "dotted math": ("self.y = math.sqrt(2.0)", "math.sqrt"),
    "mixed min": ("self.y = min(self.drive, 1)", "min of float, int"),
    "min of one": ("self.y = min(self.drive)", "min of float"),
    "int into float": ("self.y = 1", "type int for self.y of type float"),
    "float into int": ("self.n = 1.0", "type float for self.n of type int"),
    "int argument for float": ("self.y = sqrt(self.n)", "argument of sqrt of type int"),
    "changed type": ("u = 1\nu = 2.0\nself.y = u", "u, first int, then float,"),
    "chained assignment": ("u = v = 1.0\nself.y = u + v", "chained assignment"),
    "match": ("match self.n:\n    case 1:\n        self.y = 1.0", "Match"),
    "walrus": ("self.y = (u := 2.0)", "NamedExpr"),
    "try": ("try:\n    self.y = 1.0\nexcept ValueError:\n    pass", "Try"),
    "raise": ("raise ValueError", "Raise"),
    "assert": ("assert self.ok", "Assert"),
    "with": ("with self.ok:\n    pass", "With"),
    "divmod": ("u, v = divmod(self.n, 2)", "a call of divmod"),
    "nested function": ("def inner() -> float:\n    return 1.0\nself.y = inner()", "FunctionDef"),
    "lambda": ("f = lambda u: u\nself.y = f(1.0)", "Lambda"),
    "delete": ("u = 1.0\ndel u", "Delete"),
    "comprehension": ("u = [v for v in range(3)]", "ListComp"),
    "text": ("u = 'text'", "the constant 'text'"),
    "f-string": ("u = f'{self.n}'", "JoinedStr"),
    "none": ("u = None", "the constant None"),
    "keyword argument": ("self.y = self._pair(x=1.0)", "with keywords"),
    "import inside": ("import math", "Import"),
    # another meaning in C
    "power": ("self.y = self.drive**2", "**"),
    "square root by power": ("self.y = self.drive**0.5", "**"),
    "float floor division": ("self.y = self.drive // 2.0", "// of floats"),
    "float modulo": ("self.y = self.drive % 2.0", "% of floats"),
    "slice": ("self.y = self.a[1:3]", "the slice"),
    "slice assignment": ("self.a[:] = self.a", "list[float]"),
    "loop variable after its loop": ("for i in range(3):\n    self.y = 1.0\nself.n = i", "i, which has no value"),
    "assigned loop variable": ("for i in range(3):\n    i = i + 1", "the loop variable i"),
    "changing local bound": ("k = 3\nfor i in range(k):\n    k = k - 1", "whose bounds may change"),
    "changing field bound": ("for i in range(self.n):\n    self.n = 2", "whose bounds may change"),
    "bound changed by a call": ("for i in range(self.n):\n    self._change()", "whose bounds may change"),
    "for else": ("for i in range(3):\n    pass\nelse:\n    self.y = 1.0", "for ... else"),
    "while else": ("while self.ok:\n    pass\nelse:\n    self.y = 1.0", "while ... else"),
    "round": ("self.y = round(self.drive)", "a call of round"),
    "sum": ("self.y = sum(self.a)", "a call of sum"),
    "order of evaluation": ("self.y = self._change() + self.n", "_change(...), which changes fields"),
    "two changing calls": ("self.y = self._change() + self._change()", "_change(...), which changes fields"),
    "changing index": ("self.a[self.n] = self._change()", "_change(...), which changes fields"),
    "value on one way only": ("if self.ok:\n    u = 1.0\nself.y = u", "u, which has no value on every way"),
    "value in a loop only": ("while self.ok:\n    u = 1.0\nself.y = u", "u, which has no value on every way"),
    "negative index": ("self.y = self.a[-1]", "negative index"),
    "swap": ("u = 1.0\nv = 2.0\nu, v = v, u\nself.y = u", "the assignment u, v = (v, u)"),
    "fields among several targets": ("self.y, u = self._pair(1.0)", "self.y among several targets"),
    "truth of a number": ("if self.n:\n    self.y = 1.0", "a condition of type int"),
    "or of numbers": ("self.y = self.drive or 1.0", "an operand of and/or of type float"),
    "arithmetic with bool": ("self.n = self.n + self.ok", "arithmetic with int and bool"),
    "is": ("self.ok = self.ok is True", "the comparison self.ok is True"),
    "in": ("self.ok = self.drive in self.a", "the comparison self.drive in self.a"),
    "number of 128 bits": ("self.n = 170141183460469231731687303715884105728", "the number 1701"),
    "infinite number": ("self.y = 1e999", "the constant inf"),
    "range step of a variable": ("for i in range(0, 3, self.n):\n    pass", "the range step self.n"),
    "macro as a local": ("NAN = 1.0\nself.y = NAN", "the local NAN, a name that C's headers may take"),
    "constant of C as a local": ("M_PI = 3.0\nself.y = M_PI", "the local M_PI, a name that"),
    "name of the system as a local": ("linux = 1.0\nself.y = linux", "the local linux, a name that"),
    "macro as a loop variable": ("for INFINITY in range(3):\n    self.y = 1.0", "the local INFINITY, a name that"),
    "index outside": ("self.y = self.a[4]", "the index self.a[4] outside its 4 values"),
    "assigned index outside": ("self.a[7] = 1.0", "the index self.a[7] outside its 4 values"),
    "loop without an end": ("while True:\n    self.y = 1.0", "while True without an end"),
    "break of another loop": ("while True:\n    for i in range(3):\n        break", "while True without an end"),
    # the model's contract
    "array as a whole": ("self.a = self.a", "list[float]"),
    "loop over an array": ("for u in self.a:\n    self.y = u", "for u in self.a"),
    "index that is a float": ("self.y = self.a[self.drive]", "an index of type float"),
    "assigned input": ("self.drive = 1.0", "self.drive, a parameter or input,"),
    "assigned parameter": ("self.gain = 1.0", "self.gain, a parameter or input,"),
    "undeclared field": ("self.z = 1.0", "self.z, which is not declared"),
    "global": ("global COUNT", "Global"),
    "hidden constant": ("COUNT = 4", "the local COUNT, which hides"),
    "never reached": ("return 0\nself.y = 1.0", "never reached"),
    "returned type": ("if self.ok:\n    return 1.0", "a returned value of type float"),
    "bit operation": ("self.n = self.n & 1", "the operator BitAnd"),
    "bit inversion": ("self.n = ~self.n", "~self.n"),
    "print": ("print(self.n)", "a call of print"),
}

ALLOWED = {
    "left loop": "while True:\n    self.n = self.n + 1\n    if self.n > 3:\n        break",
    "returned from loop": "while True:\n    for i in range(3):\n        if self.ok:\n            return 0",
    "last index": "self.a[3] = self.a[0]",
    "arithmetic": "self.y = -self.drive * 2.0 / (3.0 + self.n) - pi",
    "int division and remainder": "self.n = self.n // 2 + self.n % 3",
    "chained comparison": "if 0.0 < time < 1.0:\n    self.y = 1.0",
    "choice": "self.y = 1.0 if self.ok else float(self.n)",
    "augmented": "self.y += 1.0\nself.n -= 1\nself.a[1] *= 2.0",
    "unpacked call": "u, k = self._pair(time)\nself.y = u * k",
    "call alone": "self._change()",
    "call as a value": "self.y = self._change()",
    "loops": "for i in range(3, 0, -1):\n    if i == 2:\n        continue\n    self.a[i] = floor(time) * 1.0",
    "value on both ways": "if self.ok:\n    u = 1.0\nelse:\n    u = 2.0\nself.y = u",
    "value unless returned": "if self.ok:\n    u = 1.0\nelse:\n    return 0\nself.y = u",
    "annotated local": "u: float = 1.0\nself.y = u",
    "logic": "self.ok = self.ok == (time > 0.0) and not self.ok or COUNT >= 3",
    "builtins": "self.y = max(abs(self.drive), min(1.0, 2.0))\nself.n = int(time)",
}


def _model(folder: Path, body: str = "pass", *, top: str = "", constants: str = "", members: str = "") -> Path:
    path = folder / "probe.py"
    path.write_text(FRAME.format(body=textwrap.indent(body, " " * 8), top=top, constants=constants,
                                 members=textwrap.indent(members, "    ")))
    return path


@pytest.mark.parametrize("body", ALLOWED.values(), ids=ALLOWED.keys())
def test_allowed(body: str, tmp_path: Path) -> None:
    text = plain_module(read(_model(tmp_path, body))).text
    compile(text, "probe", "exec")
    assert "class Probe:" in text


@pytest.mark.parametrize(("body", "construct"), REFUSED.values(), ids=REFUSED.keys())
def test_refused_with_line_construct_and_mend(body: str, construct: str, tmp_path: Path) -> None:
    path = _model(tmp_path, body)
    with pytest.raises(ModelError) as caught:
        plain_module(read(path))
    message = str(caught.value)
    where, _, what = message.partition(": ")
    first = next(number for number, line in enumerate(path.read_text().splitlines(), 1) if "def step" in line) + 1
    assert where.startswith(f"{path}:")
    assert first <= int(where.rpartition(":")[2]) < first + len(body.splitlines())
    assert construct in what
    assert "; " in what
    assert "\n" not in message


def test_the_mend_has_its_article(tmp_path: Path) -> None:
    for body, mend in (("self.n = self.ok", "give an int"), ("self.y = self.ok", "give a float")):
        with pytest.raises(ModelError, match=f"; {mend}$"):
            plain_module(read(_model(tmp_path, body)))


@pytest.mark.parametrize(("place", "text", "construct"), [
    ("top", "import math", "import math"),
    ("top", "from math import hypot", "from math import hypot"),
    ("top", "from math import sqrt as root", "from math import sqrt as root"),
    ("top", "from os import path", "an import from os"),
    ("constants", "gamma = 2.0", "the name gamma, which has a meaning in C or"),
    ("constants", "A = B = 2.0", "A = B = 2.0"),
    ("constants", "COUNT = 4", "a second value of COUNT"),
    ("constants", "if COUNT > 2:\n    pass", "If in a module"),
    ("constants", "def f(x):\n    return x", "argument x annotated with nothing"),
    ("constants", "def f(x: float = 1.0) -> float:\n    return x", "f with defaults"),
    ("constants", "def f(x: float) -> float:\n    if x > 0.0:\n        return x", "f, which can end without a value,"),
    ("constants", "def f(x: float) -> str:\n    return 'x'", "f returning str"),
    ("constants", "class Other:\n    pass", "a second class"),
    ("members", "def public(self) -> int:\n    return 0", "a method public"),
    ("members", "@staticmethod\ndef _f(x: float) -> float:\n    return x", "_f without self"),
    ("members", "@property\ndef _f(self) -> float:\n    return 1.0", "_f with defaults"),
    ("members", "LIMIT = 3", "LIMIT = 3 in the class"),
    ("constants", "def step(x: float) -> float:\n    return x", "a function step outside the class"),
    ("constants", "def f(NAN: float) -> float:\n    return NAN", "the local NAN, a name that"),
    ("constants", "def f(x: float) -> float:\n    return f(x)", "f, which calls itself,"),
    ("constants", "def f(x: float) -> float:\n    return g(x)\n\ndef g(x: float) -> float:\n    return f(x)",
     "f, which calls itself through others,"),
    ("members", "def _f(self) -> float:\n    return self._f()", "_f, which calls itself,"),
    ("members", "def _f(self) -> int:\n    return 1\n\ndef _g(self) -> int:\n    return self._f() + self._g()",
     "_g, which calls itself,"),
])
def test_refused_outside_the_methods(place: str, text: str, construct: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError) as caught:
        check_subset(read(_model(tmp_path, **{place: text})))
    assert construct in str(caught.value)


@pytest.mark.parametrize("decorator", ["@dataclass(frozen=True)", "@dataclass(kw_only=True)", "@dataclass()"])
def test_arguments_of_the_dataclass_are_refused(decorator: str, tmp_path: Path) -> None:
    path = _model(tmp_path)
    path.write_text(path.read_text().replace("@dataclass\n", f"{decorator}\n"))
    with pytest.raises(ModelError, match=r"probe\.py:\d+: Probe with bases, other decorators or arg"):
        plain_module(read(path))


@pytest.mark.parametrize("path", MODEL_PATHS, ids=names(MODEL_PATHS))
def test_every_model_keeps_to_the_subset(path: Path) -> None:
    check_subset(read(path))


def test_elementary_functions_keep_to_the_subset() -> None:
    check_elementary()


def test_names_of_the_model_do_not_meet_those_inside_the_elementary_functions(tmp_path: Path) -> None:
    path = _model(tmp_path, "self.y = sin(HALF_PI_1) + LARGEST_ANGLE", top="from threadpitch.fmu.elementary import sin",
                  constants="HALF_PI_1 = 0.5\nLARGEST_ANGLE = 1.0")
    model = read(path)
    plain, declared = plain_class(model)(), model.model_class()
    assert (plain.step(0.0, 1.0), declared.step(0.0, 1.0)) == (0, 0)
    assert plain.y == declared.y == pytest.approx(1.479425538604203, abs=1e-15)
