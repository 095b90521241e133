"""Starts of a thread that a program cuts by start angles (Q): which pass cuts which start."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from threadpitch.cycles.moves import TURN, Move, Pass, SpindleSpeed, SurfaceSpeed, ThreadPath, Wait
from threadpitch.cycles.pass_kinds import SAME, spindle_of_passes

SAME_ANGLE = 2e-5  # rad; Q counts thousandths of a degree, of which a third of a turn is no whole number
Spindle = SpindleSpeed | SurfaceSpeed | None


def with_start_numbers(passes: Sequence[Pass], moves: Sequence[Move]) -> tuple[Pass, ...]:
    """The passes; those that follow each other and differ in X and start angle only get the number of their start.

    start angle of start k = angle of the first + 2 pi (k - 1) / starts

    The order has to be a whole one, all starts of a cut or all cuts of a start first, with the same X for every start;
    else every pass stays a thread of its own.
    """
    made: list[Pass] = []
    for run in runs(passes, spindle_of_passes(moves)):
        numbers = _numbers(run)
        made += [replace(one, start_number=number) for one, number in zip(run, numbers or [
            one.start_number for one in run], strict=True)]
    return tuple(made)


def runs(passes: Sequence[Pass], spindle: Mapping[int, Spindle]) -> Iterator[list[Pass]]:
    """Passes that follow each other, alike but for X and start angle; a pass of G76 is a run of its own."""
    run: list[Pass] = []
    for one in passes:
        if run and not _belongs(one, run[0], spindle):
            yield run
            run = []
        run.append(one)
    if run:
        yield run


def in_order_of_starts(run: Sequence[Pass]) -> bool:
    """Whether all cuts of a start come before the next start."""
    return len(run) > 1 and run[0].start_number == run[1].start_number and run[-1].start_number > 1


def shape_of(one: Pass, angle: float) -> tuple[object, ...]:
    """All of a pass but its X, its start angle counted from ``angle``: equal for passes that one list can hold."""
    return (_rounded(one.approach.x), _rounded(one.approach.z),
            *(_path_shape(path, one, angle) for path in one.paths))


def _belongs(one: Pass, first: Pass, spindle: Mapping[int, Spindle]) -> bool:
    if one.depth is not None or first.depth is not None:
        return False
    same = shape_of(one, one.start_angle) == shape_of(first, first.start_angle)
    return same and _turning(spindle.get(one.number)) == _turning(spindle.get(first.number))


def _numbers(run: Sequence[Pass]) -> list[int]:
    """The start of every pass; none where the angles or the order are not those of a thread of several starts."""
    if any(one.start_number > 1 for one in run):
        return []
    angles: list[float] = []
    numbers: list[int] = []
    for one in run:
        known = (k for k, angle in enumerate(angles) if _apart(one.start_angle, angle) < SAME_ANGLE)
        number = next(known, len(angles))
        angles += [one.start_angle] if number == len(angles) else []
        numbers.append(number + 1)
    starts = len(angles)
    even = all(_apart(angle, angles[0] + TURN * k / starts) < SAME_ANGLE for k, angle in enumerate(angles))
    cuts, left = divmod(len(run), starts)
    if starts == 1 or left or not even:
        return []
    x = [_rounded(one.end.x) for one in run]
    pass_by_pass = numbers == [k + 1 for k in range(starts)] * cuts and x == [x[n - n % starts] for n in range(len(x))]
    start_by_start = numbers == [k + 1 for k in range(starts) for _ in range(cuts)] and x == x[:cuts] * starts
    return numbers if pass_by_pass or start_by_start else []


def _apart(angle: float, other: float) -> float:
    return abs(math.remainder(angle - other, TURN))


def _turning(spindle: Spindle) -> Spindle:
    """The command, wherever in the program it stands."""
    return None if spindle is None else replace(spindle, line=0)


def _path_shape(path: ThreadPath, one: Pass, angle: float) -> tuple[object, ...]:
    run_out = None if path.run_out is None else (_rounded(path.run_out.length), _rounded(path.run_out.height))
    begins = 0.0 if path.wait is Wait.NONE else path.start_angle - angle
    return (_rounded(path.start.z), _rounded(path.end.z), _rounded(path.end.x - one.paths[0].end.x),
            _rounded(path.taper), _rounded(path.lead), _rounded(path.lead_change), round(begins, 9), run_out, path.wait)


def _rounded(length: float) -> int:
    return round(length / SAME)
