"""A cycle alone, without a program around it: ``G76 ...`` ``G76 ...`` -> its passes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from threadpitch.cycles.errors import CycleError
from threadpitch.cycles.interpreter import Interpretation, interpret
from threadpitch.cycles.modal import Setup, UnknownStart
from threadpitch.cycles.moves import Point
from threadpitch.cycles.program import read_program
from threadpitch.units import to_si

NOMINAL_SPEED = to_si(500.0, "rpm")  # of the spindle that a cycle alone finds turning; its passes do not depend on it


def start_point(text: str) -> Point:
    """The start point written as ``X,Z``, mm with X as diameter: ``26,6`` is x = 0.013 m, z = 0.006 m.

    Raises:
        CycleError: not two finite numbers.
    """
    try:
        x, z = (float(part) for part in text.split(","))
    except ValueError:
        x = z = math.nan
    if not (math.isfinite(x) and math.isfinite(z)):
        raise CycleError(f"the start point {text!r} is not X,Z; write two numbers in mm, X as diameter, as in 26,6")
    return Point(to_si(x, "mm") / 2.0, to_si(z, "mm"))


def expand_cycle(blocks: Sequence[str], setup: Setup | None = None) -> Interpretation:
    """The passes of blocks that stand alone: the spindle turns already, and a start point that nobody tells is assumed
    clear of an external thread, with a note. Line n in messages is block n.

    Raises:
        ProgramError: an alarm, with line and column.
        CycleError: the blocks cut no thread.
    """
    stands = setup or Setup()
    if stands.spindle_speed is None:
        stands = replace(stands, spindle_speed=NOMINAL_SPEED)
    lines = (" ".join(block.splitlines()) for block in blocks)
    result = interpret(read_program("\n".join(lines)), replace(stands, unknown_start=UnknownStart.ASSUME))
    if not result.passes:
        raise CycleError("the blocks cut no thread; the second block of G76 has X Z P Q F, as in "
                         "'G76 P020560 Q0.15 R0.1' 'G76 X60.64 Z-62 P3.68 Q1.8 F6'")
    return result
