"""What passes are: rough, finish or spring where the words do not say it, which leaves the flank, how fast it turns."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from threadpitch.cycles.moves import (
    TURN,
    Direction,
    Hand,
    Kind,
    Move,
    Pass,
    SpindleLimit,
    SpindleSpeed,
    SpindleStop,
    SurfaceSpeed,
    Thread,
)
from threadpitch.units import from_si

SAME = 1e-9  # m; a tenth of a thousandth of the least input increment


def marked(passes: Sequence[Pass]) -> tuple[Pass, ...]:
    """The same passes with their kinds: the first at the deepest X of its groove finishes, later ones there spring.

    A groove is what the passes with one lead, one end and one start (Z and angle) cut. A pass at the X of the one
    before it springs as well. Passes of G76 know their kind and depth and stay.
    """
    deepest: dict[tuple[float, ...], float] = {}
    for cut in passes:
        deepest[_groove(cut)] = max(deepest.get(_groove(cut), -1e9), _inward(cut))
    former: dict[tuple[float, ...], float] = {}
    made = []
    for cut in passes:
        key = _groove(cut)
        here = _inward(cut)
        kind: Kind = "rough"
        if key in former and here <= former[key] + SAME:
            kind = "spring"
        elif here >= deepest[key] - SAME:
            kind = "finish"
        former[key] = max(here, former.get(key, here))
        made.append(cut if cut.depth is not None else replace(cut, kind=kind))
    return tuple(made)


def final_flank(passes: Sequence[Pass]) -> tuple[int, ...]:
    """Numbers of the passes that leave the final flank: of each groove, the last that takes metal."""
    last: dict[tuple[float, ...], int] = {}
    for cut in passes:
        if cut.kind != "spring" or _groove(cut) not in last:
            last[_groove(cut)] = cut.number
    return tuple(sorted(last.values()))


def spindle_of_passes(moves: Iterable[Move]) -> dict[int, SpindleSpeed | SurfaceSpeed | None]:
    """By pass number, the spindle command that holds when the pass begins; None where the program gave none."""
    spindle: SpindleSpeed | SurfaceSpeed | None = None
    highest = math.inf
    found: dict[int, SpindleSpeed | SurfaceSpeed | None] = {}
    for move in moves:
        if isinstance(move, SpindleSpeed | SurfaceSpeed):
            spindle = move
        elif isinstance(move, SpindleStop):
            spindle = None
        elif isinstance(move, SpindleLimit):
            highest = move.speed
        elif isinstance(move, Thread):
            limited = replace(spindle, highest=highest) if isinstance(spindle, SurfaceSpeed) else spindle
            found.setdefault(move.pass_number, limited)
    return found


def hand_of(cut: Pass, direction: Direction = "forward") -> Hand | None:
    """right: M3 and a feed towards -Z, or both the other way; left: one of them; None across a face, where Z stays."""
    travel = cut.end.z - cut.start.z
    if travel == 0.0:
        return None
    return "right" if (travel < 0.0) == (direction == "forward") else "left"


def hands(passes: Iterable[Pass], moves: Iterable[Move]) -> tuple[Hand | None, ...]:
    """The hand of every pass's thread; a spindle that no move has told turns forward."""
    spindle = spindle_of_passes(moves)
    commands = ((cut, spindle.get(cut.number)) for cut in passes)
    return tuple(hand_of(cut, "forward" if command is None else command.direction) for cut, command in commands)


def differently_turned(passes: Iterable[Pass], moves: Sequence[Move]) -> Iterator[tuple[int, str]]:
    """Line and text for each pass that cuts the groove of a former one at another speed or in the other direction."""
    lines = {move.pass_number: move.line for move in reversed(moves) if isinstance(move, Thread)}
    spindle = spindle_of_passes(moves)
    first: dict[tuple[float, ...], tuple[int, SpindleSpeed]] = {}
    for cut in passes:
        command = spindle.get(cut.number)
        if not isinstance(command, SpindleSpeed):
            continue
        number, former = first.setdefault(_groove(cut), (cut.number, command))
        if command.direction != former.direction:
            yield lines[cut.number], (f"pass {cut.number} turns the other way than pass {number} in the same groove: "
                                      "it crosses its thread")
        elif command.speed != former.speed:
            speeds = " and ".join(f"{from_si(one.speed, 'rpm'):.6g}" for one in (former, command))
            yield lines[cut.number], (f"passes {number} and {cut.number} cut one groove at {speeds} rpm: where the lag "
                                      "of the start stays, the second is shifted along Z")


def turning_speed(command: SpindleSpeed | SurfaceSpeed, cut: Pass) -> float:
    """rad/s: as commanded; of a constant surface speed v / r at the pass's smallest radius, where it turns fastest, up
    to the spindle's limit.
    """
    if isinstance(command, SpindleSpeed):
        return command.speed
    radius = min(abs(point.x) for path in cut.paths for point in (path.start, path.end))
    return min(command.highest, command.speed / radius) if radius > 0.0 else command.highest


def largest_feed(cut: Pass, speed: float) -> float:
    """max(lead, end lead) speed / 2 pi: what the long axis of the pass has to do, m/s."""
    return max(max(path.lead, path.end_lead) for path in cut.paths) * speed / TURN


def _groove(cut: Pass) -> tuple[float, ...]:
    """What tells grooves apart; the start Z counts where the words give it, G76's own flank shift does not."""
    start_z = cut.start.z if cut.depth is None else cut.approach.z
    return (round(cut.lead, 9), round(cut.end.z, 9), round(start_z, 9), round(cut.start_angle, 9), len(cut.paths))


def _inward(cut: Pass) -> float:
    """How far X is into the material, m, growing with the depth."""
    outside = cut.approach.x >= cut.end.x
    return -cut.end.x if outside else cut.end.x
