"""A program's cycles and threads as the parameters of the ThreadingController: program -> operations of a lathe.

An operation is what one run of the controller cuts: a G76 cycle with all its passes and starts, or passes by G32, G33,
G34 and G92 that follow each other and differ in their X only.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from threadpitch.cosim.values import Given
from threadpitch.cycles import ControlParameters, G76Cycle, Interpretation, Pass, spindle_of_passes
from threadpitch.cycles import passes as passes_of_cycle
from threadpitch.cycles.chain_blocks import without_inner_run_outs
from threadpitch.cycles.dialect import Clamping, Finishing
from threadpitch.cycles.moves import TURN, Point, SpindleSpeed, SurfaceSpeed, Wait
from threadpitch.cycles.thread_starts import in_order_of_starts, runs, shape_of, with_start_numbers

MOST_BLOCKS = 32  # of a chain in the controller
MOST_DEPTHS = 32  # of its list of passes
EXTERNAL_HEIGHT = 17.0 / 24.0 * math.sqrt(3.0) / 2.0  # of the pitch, ISO 68-1 and ISO 965-1: depth of the root
START_MODES = ("catch_up", "s_shaped", "exponential")  # of parameter 253: 0 linear, 1 S, 2 exponential
_LONGEST_SPIN_UP = 3.0  # s
_RAPID = 0.25  # m/s, slow enough for a stop time
_MARGIN = 0.5  # s a pass for accelerations and until the axes are in position
_SPEED_CHANGE = 1.0  # s a pass under constant surface speed, for the spindle to follow X

Spindle = SpindleSpeed | SurfaceSpeed | None


class OperationError(ValueError):
    """A threading pass that the controller cannot cut; the message tells which, why and how to mend it."""


@dataclass(frozen=True)
class Workpiece:
    """What the words do not tell: Z of the face, m; x of the surface (radius, m), None where it is not known."""

    face: float = 0.0
    surface: float | None = None


@dataclass(frozen=True)
class Operation:
    """``component.variable`` -> value for one run, a stop time that is enough for it (s), and the passes it cuts."""

    parameters: Mapping[str, Given]
    stop_time: float
    passes: tuple[Pass, ...]


def operations(program: Interpretation, workpiece: Workpiece | None = None,
               control: ControlParameters | None = None) -> tuple[Operation, ...]:
    """The operations of a program, to be run one after the other, each from where its first pass is approached.

    ``control`` gives parameters 106 and 253 to the machine; None leaves it its own fluctuation limit and start.

    Raises:
        OperationError: no pass, no spindle speed, a chain of more than 32 blocks.
    """
    if not program.passes:
        raise OperationError("the program cuts no thread; write G32, G33, G34, G76 or G92")
    piece = workpiece or Workpiece()
    spindle = spindle_of_passes(program.moves)
    set_up = {} if control is None else _of_control(control)
    made: list[Operation] = []
    cycles = list(program.cycles)
    left = [without_inner_run_outs(one) for one in with_start_numbers(program.passes, program.moves)]
    while left:
        if left[0].depth is not None:
            cycle = cycles.pop(0)
            taken = left[:len(passes_of_cycle(cycle))]
            if not taken:  # m = 0 and all of the height as allowance
                continue
            own = _multiple(cycle, piece)
        else:
            taken = _alike(left, spindle)
            own = _list(taken, piece)
        del left[:len(taken)]
        made.append(_operation({**set_up, **own}, taken, spindle.get(taken[0].number)))
    return tuple(made)


def _operation(own: Mapping[str, Given], passes: Sequence[Pass], spindle: Spindle) -> Operation:
    first = passes[0]
    values = {**_spindle(spindle, first), "x_clear": first.approach.x, **_infeed_axis(first), **own}
    named: dict[str, Given] = {f"controller.{name}": value for name, value in values.items()}
    named |= {"z_drive.initial_position": first.approach.z, "x_drive.initial_position": first.approach.x}
    return Operation(named, _stop_time(passes, spindle), tuple(passes))


def _spindle(spindle: Spindle, first: Pass) -> dict[str, Given]:
    """Speed, and of a constant surface speed that with its limit."""
    values: dict[str, Given] = {"commanded_speed": _speed(spindle, first, first.start)}
    if isinstance(spindle, SurfaceSpeed):
        values["surface_speed"] = spindle.speed
        if spindle.highest < math.inf:
            values["highest_speed"] = spindle.highest
    return values


def _speed(spindle: Spindle, one: Pass, at: Point) -> float:
    """rad/s; of a constant surface speed that at the X of a point of the pass."""
    if isinstance(spindle, SpindleSpeed) and spindle.speed > 0.0:
        return spindle.speed
    if isinstance(spindle, SurfaceSpeed) and spindle.speed > 0.0:
        if at.x == 0.0 and spindle.highest == math.inf:
            raise OperationError(f"pass {one.number} is on the turning axis under constant surface speed; write its "
                                 "highest spindle speed with G50 S, or G97")
        return min(spindle.highest, spindle.speed / abs(at.x)) if at.x else spindle.highest
    raise OperationError(f"pass {one.number} finds no turning spindle; write S and M3 before it")


def _infeed_axis(first: Pass) -> dict[str, Given]:
    """Z where the tool came to a thread across a face along Z; else X."""
    if first.paths[0].long_axis == "x" and first.approach.z != first.start.z and first.depth is None:
        return {"infeed_axis": "z", "z_clear": first.approach.z}
    return {"infeed_axis": "x"}


def _of_control(control: ControlParameters) -> dict[str, Given]:
    """Parameters 106 (percent) and 253."""
    return {"fluctuation_limit": control.speed_fluctuation_percent / 100.0,
            "start_mode": START_MODES[int(control.acceleration_type)]}


def _multiple(cycle: G76Cycle, piece: Workpiece) -> dict[str, Given]:
    """G76 by its words: the controller counts the depths itself."""
    helix, infeed = cycle.helix, cycle.infeed
    run_out = helix.run_out
    return {
        "z_face": piece.face,
        "x_surface": cycle.end.x + cycle.outward * cycle.height if piece.surface is None else piece.surface,
        "cycle": "multiple", "lead": helix.lead, "starts": helix.starts, "start": 0, "start_order": "start_by_start",
        "first_start_angle": helix.first_start_angle, "z_start": cycle.start.z, "z_end": cycle.end.z,
        "x_thread": cycle.end.x, "taper": helix.taper, "thread_height": cycle.height, "tool_angle": cycle.tool_angle,
        "run_out_length": 0.0 if run_out is None else run_out.length,
        "run_out_height": 0.0 if run_out is None else run_out.height,
        "first_cut": infeed.first_cut, "least_cut": infeed.least_cut, "allowance": infeed.allowance,
        "finishing_passes": infeed.finishing_passes,
        "clamping": "sticky" if infeed.clamping is Clamping.STICKY else "no_memory",
        "finishing": "first_takes_all" if infeed.finishing is Finishing.FIRST_TAKES_ALL else "equal_parts",
    }


def _list(passes: Sequence[Pass], piece: Workpiece) -> dict[str, Given]:
    """Passes that differ in X only, by their depths under the surface."""
    first = passes[0]
    starts = max(one.start_number for one in passes)
    by_start = in_order_of_starts(passes)
    ends = [one.paths[0].end.x for one in (passes[:len(passes) // starts] if by_start else passes[::starts])]
    outside = first.approach.x >= ends[-1]
    deepest = min(ends) if outside else max(ends)
    below = [abs(x - deepest) for x in ends]  # how far each is above the deepest
    height = EXTERNAL_HEIGHT * first.lead / starts
    height = abs(piece.surface - deepest) if piece.surface is not None else max(height, max(below))
    path, run_out = first.paths[0], first.run_out
    values: dict[str, Given] = {
        "z_face": piece.face, "x_surface": deepest + (height if outside else -height),
        "cycle": "list", "lead": path.lead, "lead_change": path.lead_change, "starts": starts, "start": 0,
        "start_order": "start_by_start" if by_start else "pass_by_pass",
        "first_start_angle": path.start_angle, "z_start": path.start.z,
        "z_end": path.end.z, "x_thread": deepest, "taper": path.taper, "thread_height": height,
        "run_out_length": 0.0 if run_out is None else run_out.length,
        "run_out_height": 0.0 if run_out is None else abs(run_out.height),
        "pass_count": len(ends), "depth": [height - x for x in below],
    }
    return values | _chain(first, deepest - path.end.x)


def _chain(one: Pass, moved: float) -> dict[str, Given]:
    """The threading blocks after the first, their X as that of the deepest pass."""
    paths = one.paths
    if len(paths) > MOST_BLOCKS:
        raise OperationError(f"pass {one.number} is a chain of {len(paths)} threading blocks, run-outs amid it counted "
                             f"as their own; the controller takes {MOST_BLOCKS}: write fewer")
    further = paths[1:]
    if not further:
        return {}
    return {
        "further_blocks": len(further), "further_z": [path.end.z for path in further],
        "further_x": [path.end.x + moved for path in further], "further_lead": [path.lead for path in further],
        "further_lead_change": [path.lead_change for path in further],
        "further_start_angle": [path.start_angle for path in further],
        "start_each_block": any(path.wait is Wait.START_ANGLE for path in further),
    }


def _alike(passes: Sequence[Pass], spindle: Mapping[int, Spindle]) -> list[Pass]:
    """The passes from the first on that make one list: cuts of all starts, one after the other, deeper or not."""
    run = next(runs(passes, spindle))
    if in_order_of_starts(run) and len(run) <= MOST_DEPTHS * len(_starts_of(run)):
        return run
    taken: list[Pass] = []
    for cut in _cuts(run):
        same = shape_of(cut[0], 0.0) == shape_of(run[0], 0.0)
        if taken and not (same and len(cut) == len(_starts_of(taken)) and len(taken) // len(cut) < MOST_DEPTHS):
            break
        taken += cut
    return taken


def _starts_of(passes: Iterable[Pass]) -> set[int]:
    """The numbers of the starts that these passes cut."""
    return {one.start_number for one in passes}


def _cuts(passes: Sequence[Pass]) -> list[list[Pass]]:
    """Passes parted where a cut begins with the first start, up to one whose depth is its own affair."""
    cuts: list[list[Pass]] = []
    for one in passes:
        if one.depth is not None:
            break
        if one.start_number == 1 or not cuts:
            cuts.append([])
        cuts[-1].append(one)
    return cuts


def _stop_time(passes: Sequence[Pass], spindle: Spindle) -> float:
    """Enough for the spin-up, and for every pass: the wait for the start, its turns, the stop, the way back."""
    total = _LONGEST_SPIN_UP
    if isinstance(spindle, SurfaceSpeed):
        total += _SPEED_CHANGE * len(passes)
    for one in passes:
        widest = max((one.start, one.end), key=lambda at: abs(at.x))
        speed = _speed(spindle, one, widest)
        turns = sum(path.turns for path in one.paths)
        turns += sum(1.0 for path in one.paths if path.wait is not Wait.NONE) + 1.0
        length = abs(one.end.z - one.approach.z) + abs(one.end.x - one.approach.x)
        total += turns * TURN / speed + 2.0 * length / _RAPID + _MARGIN
    return math.ceil(total * 10.0) / 10.0
