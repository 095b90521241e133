"""Options of ``run`` that say how the components are coupled."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import typer

from threadpitch import cosim
from threadpitch.cli.options import number
from threadpitch.cli.printing import fail

DEFAULT = cosim.Method()

Coupling = Annotated[str, typer.Option(
    metavar="gauss-seidel|jacobi|iterated", help="Whose values a component sees in a step: of those before it the "
                                                 "newest, of all the former, or repeated until all agree.")]
Extrapolation = Annotated[int, typer.Option(
    metavar="0|1|2", help="Order of the polynomial in time that inputs follow within a step, where an FMU can.")]
Multiples = Annotated[list[str] | None, typer.Option(
    "--multiple", metavar="COMPONENT=N ...", help="A component's own step is N communication steps long.")]
Tolerance = Annotated[float, typer.Option(
    metavar="X", parser=number, help="Of --coupling iterated: the relative change between two repetitions that is "
                                     "none.")]
Adaptive = Annotated[float | None, typer.Option(
    metavar="X", parser=number, help="Divide steps until the relative error of each is below X, estimated by halving "
                                     "it; --step-size is then the largest.", show_default="fixed steps")]
Events = Annotated[list[str] | None, typer.Option(
    "--event", metavar="VARIABLE=VALUE[:rising|falling] ...",
    help="Set a communication point where component.variable passes a value (SI, or with a unit), located to 1e-9 s.")]


@dataclass(frozen=True)
class Words:
    """The options as they were written."""

    coupling: str
    extrapolation: int
    multiples: Sequence[str]
    tolerance: float
    adaptive: float | None
    events: Sequence[str]


def read_method(words: Words) -> cosim.Method:
    """The method that the options ask for; whether the system's FMUs can do it is seen before the run.

    Raises:
        LatheError: an option cannot be read.
    """
    if words.tolerance != DEFAULT.tolerance and words.coupling != "iterated":
        fail(f"--tolerance serves --coupling iterated, not {words.coupling}; leave it out, or take --adaptive X for "
             "steps of any size")
    return cosim.Method(
        words.coupling, words.extrapolation, multiples=dict(map(_multiple, words.multiples)),
        tolerance=words.tolerance,
        step_control=None if words.adaptive is None else cosim.StepControl(relative=words.adaptive),
        events=tuple(map(_event, words.events)))


def _multiple(text: str) -> tuple[str, int]:
    match = re.fullmatch(r"\s*([^=]+?)\s*=\s*([0-9]{1,9})\s*", text)
    if match is None:
        fail(f"--multiple {text!r} is no multiple of the step; write it like nominal_pitch=4")
    return match[1], int(match[2])


def _event(text: str) -> cosim.Event:
    match = re.fullmatch(r"\s*([^=]+?\.[^=]+?)\s*=\s*([^:]+?)\s*(?::\s*(\w+)\s*)?", text)
    if match is None:
        fail(f"--event {text!r} names no variable and value; write it like spindle.angle=90deg:rising")
    return cosim.Event(match[1], match[2], match[3] or "both")
