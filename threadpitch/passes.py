"""The threading passes of a simulated lathe: pitches of their whole turns, and what the control says of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from threadpitch.cycles.moves import Hand, Kind
from threadpitch.pitch import PitchTable, Statistics, statistics
from threadpitch.trace import TURN

CONTROLLER = "controller"  # its name in the lathe's SSD
KINDS: tuple[Kind, ...] = ("rough", "finish", "spring")  # by the controller's pass_kind
WORKPIECE = ("z_face", "z_start", "z_end")  # parameters of the controller
TOLD = ("pass_kind", "cut_depth", "start_angle", "start_number", "lead", "starts", "lead_change",
        "further_blocks")  # what it says of a pass
ALARMS = {  # of the controller: what is wrong, and how to mend it
    1: "the spindle's speed varied by more than the fluctuation limit (parameter 106); load it less or allow more with "
       "controller.fluctuation_limit",
    2: "the spindle was slower than controller.least_speed; load it less or turn faster",
    3: "lead * speed is more than controller.feed_limit; turn slower",
    4: "the spindle does not reach its speed; turn slower, or wait longer with controller.longest_wait",
    5: "an axis does not come into position; look at its drive, or widen controller.position_width",
    6: "no one-turn pulse comes; look at the spindle's detector and controller.detector",
}
TURNS_A_STEP = 8  # turns of one start angle that a PitchCalculator keeps per step

FloatArray = NDArray[np.float64]
Columns = Mapping[str, NDArray[np.generic]]


@dataclass(frozen=True, eq=False)
class Pass:
    """One threading pass: the pitches of its whole turns, and which of them lie in the metal.

    What a system does not tell is None. The lead is the movement per turn, pitch = lead / starts the distance from
    groove to groove; P(n) measures the lead.
    """

    number: int
    start_number: int
    table: PitchTable
    effective: Statistics | None  # over the turns wholly in the metal; None where the system does not tell the face
    deviation: FloatArray  # (start_angles, revolutions) m, P(n) - target
    in_metal: NDArray[np.bool_]  # (start_angles, revolutions)
    kind: Kind | None = None
    depth: float | None = None  # m, radius
    start_angle: float | None = None  # rad from the one-turn pulse
    lead: float | None = None  # m
    pitch: float | None = None  # m, lead / starts
    hand: Hand | None = None  # of the thread, where a program tells in which direction the spindle turns
    final_flank: bool = False  # of its start, the last pass that takes metal
    began: float | None = None  # s, when the feed began to follow the spindle
    ended: float | None = None  # s
    target: float | None = None  # m, movement per turn that the calculator compares with
    variable: bool = False  # the lead changes along the thread; the deviation is from that of every turn


@dataclass(frozen=True, eq=False)
class ToolPath:
    """True positions of the tool, x as radius; m."""

    time: FloatArray  # (rows,) s
    z: FloatArray  # (rows,)
    x: FloatArray  # (rows,)
    threading: NDArray[np.bool_]  # (rows,)


def alarm_text(columns: Columns, time: FloatArray) -> str:
    """The alarm that stopped the controller, its time and mend; empty where there is none, or none is told."""
    alarm = columns.get(f"{CONTROLLER}.alarm")
    if alarm is None or not np.any(alarm):
        return ""
    row = int(np.argmax(alarm != 0))
    number = int(alarm[row])
    return f"alarm {number} at {time[row]:.4g} s: {ALARMS.get(number, 'see the controller')}"


def hold_text(columns: Columns) -> str:
    """That the feed is held at the end, and how to mend it; empty where it is not, or not told."""
    holding = columns.get(f"{CONTROLLER}.holding")
    if holding is None or not holding[-1]:
        return ""
    return "the feed is held; release controller.feed_hold"


def find_passes(columns: Columns, calculator: str, threading: NDArray[np.bool_], time: FloatArray) -> tuple[Pass, ...]:
    """The passes as this calculator saw them; ``threading`` (rows,) parts them, ``time`` (rows,) s tells when."""
    found = []
    for number, rows in enumerate(_stretches(threading), start=1):
        one = _pass(columns, calculator, rows)
        if one is not None:
            ends = rows.start + int(np.argmin(np.append(threading[rows], False)))
            found.append(replace(one, number=number, began=float(time[rows.start]),
                                 ended=float(time[min(ends, time.size - 1)])))
    last = {one.start_number: one.number for one in found if one.kind not in (None, "spring")}
    return tuple(replace(one, final_flank=one.number == last.get(one.start_number)) for one in found)


def _stretches(threading: NDArray[np.bool_]) -> list[slice]:
    """Rows of every threading pass: from the first that is threading to the last before the next pass."""
    begins = np.flatnonzero(threading & ~np.concatenate(([False], threading[:-1])))
    ends = np.append(begins, threading.size)[1:]
    return [slice(int(begin), int(end)) for begin, end in zip(begins, ends, strict=True)]


def _pass(columns: Columns, calculator: str, rows: slice) -> Pass | None:
    """The pass, not numbered yet; None where no turn was completed."""
    count = int(columns[f"{calculator}.start_angle_count"][0])
    turns = [_turns(columns, calculator, angle, rows) for angle in range(count)]
    longest = max(pitch.size for pitch, _, _ in turns)
    if longest == 0:
        return None
    pitch = np.full((count, longest), np.nan)  # (start_angles, revolutions)
    crossings = np.full((count, longest + 1), np.nan)
    for row, (values, ends, direction) in enumerate(turns):
        pitch[row, :values.size], crossings[row, 1:ends.size + 1] = values, ends
        if ends.size:
            crossings[row, 0] = ends[0] - direction * values[0]
    starts = [float(columns[f"{calculator}.start_angle[{i + 1}]"][0]) for i in range(count)]
    target = float(columns[f"{calculator}.pitch_target"][0])
    in_metal = _in_metal(columns, pitch, crossings[:, 1:])
    effective = None if in_metal is None else statistics(np.where(in_metal, pitch, np.nan))
    table = replace(PitchTable.of_pitches(pitch, starts), crossings=crossings)
    one = Pass(0, _start_number(columns, rows), table, effective, pitch - target,
               np.ones(pitch.shape, dtype=np.bool_) if in_metal is None else in_metal, target=target)
    return _described(columns, one, rows)


def _described(columns: Columns, one: Pass, rows: slice) -> Pass:
    """The pass with what the controller says of it."""
    outputs = [f"{CONTROLLER}.{name}" for name in ("pass_kind", "cut_depth", "start_angle", "lead", "starts")]
    if not all(name in columns for name in outputs):
        return one
    kind, depth, angle, lead, starts = (float(columns[name][rows][0]) for name in outputs)
    one = replace(one, kind=KINDS[int(kind)], depth=depth, start_angle=angle, lead=lead, pitch=lead / starts)
    change, further = (columns.get(f"{CONTROLLER}.{name}") for name in ("lead_change", "further_blocks"))
    if change is None or further is None or not change[0] or further[0]:
        return one
    return replace(one, deviation=one.table.pitch - _variable_lead(one, lead, angle, float(change[0])), variable=True)


def _variable_lead(one: Pass, lead: float, start: float, change: float) -> FloatArray:
    """(start_angles, revolutions) m: lead + lead_change (n - 1/2 + o), o the turns from the start to the start angle.

    The way is lead n + lead_change n^2 / 2, n turns since the line began.
    """
    offset = (one.table.start_angles - start) / TURN % 1.0
    offset[offset > 1.0 - 1e-9] = 0.0
    return np.asarray(lead + change * (offset[:, np.newaxis] + np.arange(one.table.pitch.shape[1]) + 0.5))


def _turns(columns: Columns, calculator: str, angle: int, rows: slice) -> tuple[FloatArray, FloatArray, float]:
    """(P(n), xi at the end of turn n, direction of the cut in the first) of one start angle: several turns may end in
    one step.
    """
    completed = columns[f"{calculator}.completed[{angle + 1}]"][rows]
    position = columns[f"{calculator}.crossing_position[{angle + 1}]"][rows]
    direction = columns[f"{calculator}.direction"][rows]
    most = int(completed.max(initial=0))
    kept = [columns[f"{calculator}.completed_pitch[{TURNS_A_STEP * angle + turn + 1}]"][rows] for turn in range(most)]
    pitches: list[float] = []
    ends: list[float] = []
    for row in np.flatnonzero(completed):
        after = 0.0  # movement of this step's later turns
        of_step = []
        for values in reversed(kept[:int(completed[row])]):
            of_step.append((float(values[row]), float(position[row] - direction[row] * after)))
            after += float(values[row])
        pitches += [pitch for pitch, _ in reversed(of_step)]
        ends += [end for _, end in reversed(of_step)]
    first = float(direction[int(np.argmax(completed != 0))]) if completed.size else 0.0
    return np.array(pitches), np.array(ends), first


def _in_metal(columns: Columns, pitch: FloatArray, ends: FloatArray) -> NDArray[np.bool_] | None:
    """Turns that begin behind the workpiece's face; they end before z_end because threading does."""
    names = [f"{CONTROLLER}.{name}" for name in WORKPIECE]
    if not all(name in columns for name in names):
        return None
    face, start, end = (float(columns[name][0]) for name in names)
    sense = 1.0 if end > start else -1.0
    begins = ends - sense * pitch
    with np.errstate(invalid="ignore"):
        return np.asarray(sense * (begins - face) >= 0.0)


def _start_number(columns: Columns, rows: slice) -> int:
    name = f"{CONTROLLER}.start_number"
    return int(columns[name][rows][0]) if name in columns else 1
