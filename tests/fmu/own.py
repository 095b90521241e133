"""Small models that the tests write: ``model_text`` fills one frame."""

from __future__ import annotations

import textwrap
from pathlib import Path

_FRAME = '''\
from dataclasses import dataclass
from math import floor, sqrt

from threadpitch.fmu.variable import Clock, Experiment, Terminal, input_, output, parameter, state
{top}

@dataclass
class {name}:
    """A model of the tests."""

    drive: float = input_("1", "An input", start=1.0)
    y: float = output("1", "An output")
    n: int = output("1", "Number of steps", start=0, min=0, max=2147483647)
    a: list[float] = state("1", "An array", size=4)

    def check(self) -> int:
        return 0

    def initialize(self) -> None:
        self.y = 0.0
        self.n = 0

    def step(self, time: float, step_size: float) -> int:
{step}
        return 0

{members}
'''


def write_model(path: Path, step: str, *, top: str = "", members: str = "", name: str = "Probe") -> Path:
    """Write a model whose steps do ``step``; ``top`` stands above the class, ``members`` are further methods."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(_FRAME.format(step=textwrap.indent(step, " " * 8), top=top, name=name,
                                  members=textwrap.indent(members, " " * 4)), encoding="utf-8")
    return path


def line_of(path: Path, text: str) -> int:
    """The number of the first line with this text."""
    return next(number for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1) if text in line)
