"""A model of random expressions: what translation does to parentheses, types and rounding shows in its outputs."""

from __future__ import annotations

import random
from collections.abc import Callable

COUNT = 40
_TEXT = '''\
from dataclasses import dataclass
from math import floor, sqrt

from threadpitch.fmu.variable import input_, output


@dataclass
class Expressions:
    """Random expressions."""

    a: float = input_("1", "a", start=0.3)
    b: float = input_("1", "b", start=-1.7)
    c: float = input_("1", "c", start=2.9)
    k: int = input_("1", "k", start=3, min=-100, max=100)
    m: int = input_("1", "m", start=-4, min=-100, max=100)
    real: list[float] = output("1", "results", size={count})
    whole: list[int] = output("1", "results", start=0, size={count}, min=-2147483648, max=2147483647)
    yes: list[bool] = output("1", "results", start=False, size={count})

    def check(self) -> int:
        return 0

    def initialize(self) -> None:
        pass

    def step(self, time: float, step_size: float) -> int:
        a = self.a
        b = self.b
        c = self.c
        k = self.k
        m = self.m
{body}
        return 0
'''


def model_text(seed: int) -> str:
    """The text of the model file, the same for the same seed."""
    generator = random.Random(seed)
    lines = []
    for place in range(COUNT):
        lines += [f"self.real[{place}] = 1.0 * {_real(generator, 4)}", f"self.whole[{place}] = {_whole(generator, 3)}",
                  f"self.yes[{place}] = {_yes(generator, 2)}"]
    return _TEXT.format(count=COUNT, body="\n".join(f"        {line}" for line in lines))


def _real(generator: random.Random, depth: int) -> str:
    """A number; a bare ``k`` or ``m`` is an int amid floats."""
    if depth == 0:
        return generator.choice(["a", "b", "c", "a", "b", "k", "m", "0.1", "2.0", "-3.0", "1e-3"])

    def part() -> str:
        return _real(generator, depth - 1)

    def quotient() -> str:
        divisor = part()
        return f"({part()} / (2.0 + {divisor} * {divisor}))"

    return _one_of(generator, [
        *[lambda: f"({part()} + {part()})"] * 3, *[lambda: f"({part()} - {part()})"] * 3,
        *[lambda: f"({part()} * {part()})"] * 3, quotient, lambda: f"(-{part()})",
        lambda: f"min(float({part()}), float({part()}), 1.0)", lambda: f"sqrt(abs({part()}) * 1.0)",
        lambda: f"(float({part()}) if {_yes(generator, depth - 1)} else {_whole(generator, 1)} * 1.0)",
    ])


def _whole(generator: random.Random, depth: int) -> str:
    if depth == 0:
        return generator.choice(["k", "m", "3", "-7", "1"])

    def part() -> str:
        return _whole(generator, depth - 1)

    return _one_of(generator, [
        lambda: f"({part()} + {part()})", lambda: f"({part()} - {part()})", lambda: f"({part()} * {part()})",
        lambda: f"({part()} // 7)", lambda: f"({part()} % -5)", lambda: f"({part()} // -3)", lambda: f"(-{part()})",
        lambda: f"abs({part()})", lambda: f"max({part()}, {part()})", lambda: f"floor({generator.choice('abc')} * 3.0)",
        lambda: f"int({generator.choice('abc')} * -5.0)",
    ])


def _yes(generator: random.Random, depth: int) -> str:
    if depth <= 0:
        return generator.choice(["a < b", "k >= m", "c != a", "a < b < c", "True"])

    def part() -> str:
        return _yes(generator, depth - 1)

    return _one_of(generator, [
        lambda: f"({part()} and {part()})", lambda: f"({part()} or {part()})", lambda: f"(not ({part()}))",
        lambda: f"({_real(generator, 1)} <= {_real(generator, 1)})",
        lambda: f"({_whole(generator, 1)} == {_whole(generator, 1)})",
    ])


def _one_of(generator: random.Random, writers: list[Callable[[], str]]) -> str:
    return generator.choice(writers)()
