"""Canonical moves: what a program asks of the machine, flat, one frozen record each.

SI units; x is the radius here, whatever the program writes: words give X as diameter, ``move_text`` prints it so again.
Every move carries the line of the block that asked for it. Coordinates are those of the workpiece.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Literal

from threadpitch.units import from_si

TURN = 2.0 * math.pi
Kind = Literal["rough", "finish", "spring"]
Direction = Literal["forward", "reverse"]
Hand = Literal["right", "left"]


@dataclass(frozen=True)
class Point:
    """A place of the tool tip: x radius, m; z, m."""

    x: float
    z: float


class Wait(Enum):
    """What a threading block waits for before the feed begins."""

    INDEX = "index"  # the one-turn signal, then the start angle counted from it
    START_ANGLE = "start_angle"  # the start angle, counted on from the index of the first block, modulo a turn
    NONE = "none"  # it goes on where the block before it ended


@dataclass(frozen=True)
class RunOut:
    """Withdrawal over the last ``length`` m along the long axis, by ``height`` m (signed) along the short axis."""

    length: float
    height: float

    @property
    def angle(self) -> float:
        """atan(|height| / length), rad, against the long axis."""
        return math.atan2(abs(self.height), self.length)


@dataclass(frozen=True)
class ThreadPath:
    """One threading block: a straight line in step with the spindle.

    long axis: lead(n) = lead + lead_change n, n turns from the start;  short axis follows on the line.

    The lead runs along Z up to a taper of 45 degrees, else along X, never along the path. ``end`` is the end of the
    line as if there were no run-out; with one the tool leaves it on the way and comes to ``leaves_at``.
    """

    start: Point
    end: Point
    lead: float  # m per turn along the long axis
    start_angle: float = 0.0  # rad from the one-turn signal, 0 to 2 pi; nothing to a block that does not wait
    lead_change: float = 0.0  # m per turn, per turn
    run_out: RunOut | None = None
    wait: Wait = Wait.INDEX

    @property
    def long_axis(self) -> Literal["z", "x"]:
        """The axis that the lead is measured along: Z, or X where the taper is steeper than 45 degrees."""
        return "z" if abs(self.end.z - self.start.z) >= abs(self.end.x - self.start.x) else "x"

    @property
    def length(self) -> float:
        """Travel of the long axis, m."""
        return max(abs(self.end.z - self.start.z), abs(self.end.x - self.start.x))

    @property
    def taper(self) -> float:
        """i = x of the start - x of the end, m, radius; 0 = straight."""
        return self.start.x - self.end.x

    @property
    def lead_along_z(self) -> float:
        """Movement of Z per turn, m: the lead, or lead |dz / dx| where the lead runs along X."""
        if self.long_axis == "z":
            return self.lead
        return self.lead * abs(self.end.z - self.start.z) / self.length

    @property
    def end_lead(self) -> float:
        """sqrt(lead^2 + 2 lead_change length): the lead where the line ends, m."""
        return math.sqrt(max(self.lead * self.lead + 2.0 * self.lead_change * self.length, 0.0))

    @property
    def turns(self) -> float:
        """Spindle turns from start to end: length / ((lead + end lead) / 2); 0 for a block without movement."""
        return 2.0 * self.length / (self.lead + self.end_lead) if self.length > 0.0 else 0.0

    @property
    def leaves_line_at(self) -> Point:
        """Where the run-out begins; the end where there is none."""
        if self.run_out is None:
            return self.end
        share = self.run_out.length / self.length
        return Point(self.end.x - share * (self.end.x - self.start.x), self.end.z - share * (self.end.z - self.start.z))

    @property
    def leaves_at(self) -> Point:
        """Where the tool is when the block ends: ``end``, moved by the run-out's height along the short axis."""
        if self.run_out is None:
            return self.end
        if self.long_axis == "z":
            return Point(self.end.x + self.run_out.height, self.end.z)
        return Point(self.end.x, self.end.z + self.run_out.height)


@dataclass(frozen=True)
class Pass:
    """One cut along a thread: a single path in G76 and G92, a chain of them with G32, G33, G34.

    ``depth`` is counted from the top of the thread (radius, m); None where the words do not tell it (G32, G92).
    """

    number: int  # from 1
    kind: Kind
    depth: float | None
    approach: Point  # where the tool comes from and goes back to
    paths: tuple[ThreadPath, ...]
    start_number: int = 1  # of the thread's starts, from 1

    @property
    def start(self) -> Point:
        """Where the cut begins: the cut-in point Bn."""
        return self.paths[0].start

    @property
    def end(self) -> Point:
        """Where the cut ends, on the line D-E."""
        return self.paths[-1].end

    @property
    def start_angle(self) -> float:
        """Of the first path, rad."""
        return self.paths[0].start_angle

    @property
    def lead(self) -> float:
        """Of the first path, m per turn along its long axis."""
        return self.paths[0].lead

    @property
    def lead_along_z(self) -> float:
        """Of the first path, m per turn along Z whatever its long axis."""
        return self.paths[0].lead_along_z

    @property
    def taper(self) -> float:
        """i = x of the start - x of the end, m, radius."""
        return self.start.x - self.end.x

    @property
    def run_out(self) -> RunOut | None:
        """Of the last path."""
        return self.paths[-1].run_out


@dataclass(frozen=True)
class Move:
    """A canonical move; ``line`` is the program's line, from 1."""

    line: int


@dataclass(frozen=True)
class Rapid(Move):
    """Rapid traverse; an axis whose place is not known yet has None."""

    x: float | None
    z: float | None


@dataclass(frozen=True)
class Feed(Move):
    """Straight cut with a feed per turn (m) or, where ``per_turn`` is None, per time (m/s)."""

    end: Point
    per_turn: float | None
    per_time: float | None


@dataclass(frozen=True)
class Thread(Move):
    """Threading block; ``pass_number`` is the number of the pass it belongs to."""

    path: ThreadPath
    pass_number: int


@dataclass(frozen=True)
class Dwell(Move):
    """Wait."""

    duration: float  # s


@dataclass(frozen=True)
class SpindleSpeed(Move):
    """Spindle on at this speed."""

    speed: float  # rad/s, never negative
    direction: Direction


@dataclass(frozen=True)
class SurfaceSpeed(Move):
    """Spindle on at a constant surface speed, and at most at ``highest``."""

    speed: float  # m/s
    direction: Direction
    highest: float = math.inf  # rad/s, of the spindle limit that holds


@dataclass(frozen=True)
class SpindleLimit(Move):
    """Highest spindle speed under constant surface speed."""

    speed: float  # rad/s


@dataclass(frozen=True)
class SpindleStop(Move):
    """Spindle off."""


@dataclass(frozen=True)
class Tool(Move):
    """Tool change."""

    number: int
    offset: int


@dataclass(frozen=True)
class Stop(Move):
    """The program halts until it is started again (M0)."""


@dataclass(frozen=True)
class End(Move):
    """End of the program."""


def move_text(move: Move) -> str:
    """A move as one line of text: mm with X as diameter, degrees, rpm, seconds."""
    match move:
        case Rapid(x=x, z=z):
            words = [_diameter(x) if x is not None else "", _z(z) if z is not None else ""]
            return " ".join(["rapid ", *filter(None, words)])
        case Feed(end=end, per_turn=per_turn, per_time=per_time):
            per_minute = from_si(per_time or 0.0, "mm/min")
            rate = f"{_mm(per_turn)} mm/rev" if per_turn is not None else f"{per_minute:.4f} mm/min"
            return f"feed   {_diameter(end.x)} {_z(end.z)} at {rate}"
        case Thread():
            return _thread_text(move)
        case Dwell(duration=duration):
            return f"dwell  {duration:.3f} s"
        case SpindleSpeed(speed=speed, direction=direction):
            return f"spindle {direction} {from_si(speed, 'rpm'):.3f} rpm"
        case SurfaceSpeed(speed=speed, direction=direction):
            return f"spindle {direction} surface speed {from_si(speed, 'm/min'):.3f} m/min"
        case SpindleLimit(speed=speed):
            return f"spindle limit {from_si(speed, 'rpm'):.3f} rpm"
        case SpindleStop():
            return "spindle stop"
        case Tool(number=number, offset=offset):
            return f"tool   {number} offset {offset}"
        case Stop():
            return "stop"
    return "end"


def _thread_text(move: Thread) -> str:
    path = move.path
    words = [f"thread pass {move.pass_number} from {_diameter(path.start.x)} {_z(path.start.z)} "
             f"to {_diameter(path.end.x)} {_z(path.end.z)} lead {_mm(path.lead)} along {path.long_axis.upper()}"]
    if path.lead_change:
        words.append(f"change {_mm(path.lead_change)}")
    angle = "" if path.wait is Wait.NONE else f"angle {from_si(path.start_angle, 'deg'):.3f} "
    words.append(f"{angle}wait {path.wait.value}")
    if path.run_out is not None:
        words.append(f"run-out {_mm(path.run_out.length)} by {_mm(path.run_out.height)}")
    return " ".join(words)


def _diameter(x: float) -> str:
    return f"X{_mm(2.0 * x)}"


def _z(z: float) -> str:
    return f"Z{_mm(z)}"


def _mm(value: float) -> str:
    """mm to four places; a zero has no sign."""
    return f"{round(from_si(value, 'mm'), 4) + 0.0:.4f}"
