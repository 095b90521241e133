"""G76, the multiple threading cycle: numbers -> passes.

Geometry (seed's sheet, GSK 980TDi and 988TA): A start and end point of the cycle, D end point of the thread, C = D
moved by the taper i in X at the Z of A, B = k away from C at the Z of A. Pass n begins at

    Bn = B + depth_n towards the axis of the infeed + depth_n tan(a / 2) towards D, along the taper

runs parallel to C-D, and ends on the line D-E. E has the X of A and the Z of D.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from threadpitch.cycles.dialect import Clamping, Finishing
from threadpitch.cycles.errors import Alarm, ThreadError
from threadpitch.cycles.moves import TURN, Kind, Pass, Point, RunOut, ThreadPath

MOST_PASSES = 10000  # of one cycle, all starts together; what the controller's pass_number can count
ROUNDING = 1e-12  # m; depths closer than this are one


@dataclass(frozen=True)
class Helix:
    """What all passes of a cycle share: lead (m per turn along the long axis), taper i (m), run-out, starts.

    Start j of n begins at first_start_angle + 2 pi (j - 1) / n, rad from the one-turn signal.
    ``run_out.height`` carries no sign here: the cycle knows which way is out.

    Raises:
        ThreadError: no positive lead, no start.
    """

    lead: float
    taper: float = 0.0
    run_out: RunOut | None = None
    starts: int = 1
    first_start_angle: float = 0.0

    def __post_init__(self) -> None:
        if not self.lead > 0.0:
            raise ThreadError(Alarm.NO_FEED, "F", "the lead is not positive; write F in mm or I in threads per inch")
        if self.starts < 1:
            raise ThreadError(Alarm.RANGE, "L", f"{self.starts} starts are none; give 1 or more")

    def start_angle(self, start_number: int) -> float:
        """Of this start, from 1; rad, 0 to 2 pi."""
        return math.fmod(self.first_start_angle + TURN * (start_number - 1) / self.starts, TURN)


@dataclass(frozen=True)
class Infeed:
    """How the depth is shared: first cut dd, least cut dmin, allowance d (m, radius), m finishing passes.

    Raises:
        ThreadError: dd not positive, dmin, d or m negative.
    """

    first_cut: float
    least_cut: float = 0.0
    allowance: float = 0.0
    finishing_passes: int = 1
    clamping: Clamping = Clamping.NO_MEMORY
    finishing: Finishing = Finishing.EQUAL_PARTS

    def __post_init__(self) -> None:
        if not self.first_cut > 0.0:
            raise ThreadError(Alarm.CYCLE, "Q", "the first cut Q(dd) is not positive; write the depth of the first cut")
        unsigned = (("Q", "least cut Q(dmin)", self.least_cut), ("R", "allowance R(d)", self.allowance),
                    ("P", "number of finishing passes P(m)", self.finishing_passes))
        for address, name, value in unsigned:
            if not value >= 0:
                raise ThreadError(Alarm.MINUS, address, f"the {name} is negative; write it without sign")


@dataclass(frozen=True)
class G76Cycle:
    """One G76: start point A, end point D, the helix, thread height k (m, radius), tool angle a (rad), the infeed.

    Raises:
        ThreadError: numbers that the control refuses; the text says which word and how to mend it.
    """

    start: Point
    end: Point
    helix: Helix
    height: float
    tool_angle: float
    infeed: Infeed

    def __post_init__(self) -> None:
        if not self.height > 0.0:
            raise ThreadError(Alarm.CYCLE, "P", "the thread height P(k) is not positive; write the height as radius")
        if self.infeed.least_cut > self.height:
            raise ThreadError(Alarm.CYCLE, "P", "the least cut Q(dmin) is more than the thread height P(k); "
                              "write a smaller one")
        if self.infeed.allowance > self.height:
            raise ThreadError(Alarm.CYCLE, "P", "the finishing allowance R(d) is more than the thread height "
                              "P(k); write a smaller one")
        if not 0.0 <= self.tool_angle < math.pi:
            raise ThreadError(Alarm.CYCLE, "P", "the tool angle P(a) is out of its range; write 0 to 99 degrees")
        check_line(self.start, self.end, self.helix)
        self._check_length()

    def _check_length(self) -> None:
        shortest = abs(self.end.z - self.start.z) - self.height * math.tan(self.tool_angle / 2.0)
        if not shortest > 0.0:
            raise ThreadError(Alarm.LENGTH, "Z", "the thread is no longer than the flank infeed k tan(a/2); start it "
                              "farther away")
        steepness = abs(self.helix.taper) / abs(self.end.z - self.start.z)
        check_run_out(self.helix.run_out, shortest * max(steepness, 1.0))

    @property
    def outward(self) -> float:
        """+1 where the tool leaves the thread towards larger X (external thread), -1 for an internal one."""
        return outward(self.start, self.end)

    @property
    def feed_direction(self) -> float:
        """+1 or -1: the sign of Z from A to D."""
        return math.copysign(1.0, self.end.z - self.start.z)


def outward(start: Point, end: Point) -> float:
    """The sign of X from the thread to the start point."""
    return math.copysign(1.0, start.x - end.x)


def check_line(start: Point, end: Point, helix: Helix) -> None:
    """What G76 and G92 refuse in A, D and the taper.

    Raises:
        ThreadError: A and D have one Z or one X, or the taper reaches to or past A.
    """
    if end.z == start.z:
        raise ThreadError(Alarm.LENGTH, "Z", "the thread ends at the Z where it starts; give it a length")
    if end.x == start.x:
        raise ThreadError(Alarm.END_POINT, "X", "the thread ends at the X where it starts; start away from it")
    if not (start.x - end.x - helix.taper) * outward(start, end) > 0.0:
        raise ThreadError(Alarm.CYCLE, "R", "the taper R(i) reaches past the start point; start farther away")


def check_run_out(run_out: RunOut | None, length: float) -> None:
    """Raises ThreadError when the run-out is longer than the thread."""
    if run_out is not None and run_out.length > length + ROUNDING:
        raise ThreadError(Alarm.RUN_OUT, "K", f"the run-out takes {run_out.length * 1e3:.4g} mm, the thread is only "
                          f"{length * 1e3:.4g} mm long; shorten the run-out")


def passes(cycle: G76Cycle) -> tuple[Pass, ...]:
    """All passes of the cycle in the order of cutting; with several starts each start is cut whole before the next.

    Raises:
        ThreadError: more than 10000 passes.
    """
    depths = pass_depths(cycle.infeed, cycle.height)
    starts = cycle.helix.starts
    if len(depths) * starts > MOST_PASSES:
        raise ThreadError(Alarm.PASSES, "Q", f"{len(depths) * starts} passes are more than {MOST_PASSES}; cut deeper")
    return tuple(
        Pass(k * len(depths) + n, kind, depth, cycle.start, (pass_path(cycle, depth, k + 1),), k + 1)
        for k in range(starts) for n, (kind, depth) in enumerate(depths, start=1)
    )


def pass_depths(infeed: Infeed, height: float) -> tuple[tuple[Kind, float], ...]:
    """Kind and depth (m, radius, from the top of the thread) of every pass of one start."""
    rough: list[tuple[Kind, float]] = [("rough", depth) for depth in roughing_depths(infeed, height)]
    return (*rough, *_finishing(infeed, height))


def roughing_depths(infeed: Infeed, height: float) -> tuple[float, ...]:
    """depth_n = max(dd sqrt(n), dd sqrt(n - 1) + dmin), at most k - d  (no memory)
    depth_n = depth_(n-1) + dmin from the first n with dd (sqrt(n) - sqrt(n - 1)) < dmin on  (sticky); m, radius.

    The first cut is never below dmin. dd > k - d gives a single pass.

    Raises:
        ThreadError: more than 10000 passes.
    """
    bottom = height - infeed.allowance
    depths: list[float] = []
    depth = 0.0
    clamped = False
    while depth < bottom - ROUNDING:
        n = len(depths) + 1
        if n > MOST_PASSES:
            raise ThreadError(Alarm.PASSES, "Q", f"roughing takes more than {MOST_PASSES} passes; write a deeper cut")
        rule = infeed.first_cut * math.sqrt(n)
        former = infeed.first_cut * math.sqrt(n - 1)
        if infeed.clamping is Clamping.STICKY:
            clamped = clamped or rule - former < infeed.least_cut
            depth = depth + infeed.least_cut if clamped else rule
        else:
            depth = max(rule, former + infeed.least_cut)
        if depth > bottom - ROUNDING:
            depth = bottom
        depths.append(depth)
    return tuple(depths)


def _finishing(infeed: Infeed, height: float) -> list[tuple[Kind, float]]:
    count = infeed.finishing_passes
    if infeed.allowance <= ROUNDING:
        return [("spring", height)] * count
    if infeed.finishing is Finishing.FIRST_TAKES_ALL:
        return [("spring" if n else "finish", height) for n in range(count)]
    # counted down from k, so that the last pass is at k exactly
    return [("finish", height - infeed.allowance * (count - n) / count) for n in range(1, count + 1)]


def pass_path(cycle: G76Cycle, depth: float, start_number: int = 1) -> ThreadPath:
    """Bn = (C.x + out (k - depth) + slope shift, A.z + shift), end = (D.x + out (k - depth), D.z);
    shift = depth tan(a / 2) towards D, slope = (D.x - C.x) / (D.z - A.z).
    """
    out = cycle.outward
    above = out * (cycle.height - depth)
    shift = cycle.feed_direction * depth * math.tan(cycle.tool_angle / 2.0)
    slope = -cycle.helix.taper / (cycle.end.z - cycle.start.z)
    start = Point(cycle.end.x + cycle.helix.taper + above + slope * shift, cycle.start.z + shift)
    end = Point(cycle.end.x + above, cycle.end.z)
    run_out = signed_run_out(cycle.helix, cycle.start, cycle.end)
    return ThreadPath(start, end, cycle.helix.lead, cycle.helix.start_angle(start_number), run_out=run_out)


def signed_run_out(helix: Helix, start: Point, end: Point) -> RunOut | None:
    """The run-out with the sign of its height: along X out of the thread; along Z back to the start point."""
    if helix.run_out is None:
        return None
    steep = abs(helix.taper) > abs(end.z - start.z)
    sign = math.copysign(1.0, start.z - end.z) if steep else outward(start, end)
    return RunOut(helix.run_out.length, sign * helix.run_out.height)


def thinner_than_least(infeed: Infeed, height: float) -> float | None:
    """The first roughing cut below dmin that is not the last one, m; None where there is none.

    The rule without memory clamps the first thin cut only: n counts on, and what follows is thinner than dmin.
    """
    depths = (0.0, *roughing_depths(infeed, height))
    for n in range(1, len(depths) - 1):
        if depths[n] - depths[n - 1] < infeed.least_cut - ROUNDING:
            return depths[n] - depths[n - 1]
    return None


def returns_through_air(cycle: G76Cycle) -> bool:
    """Whether A lies outside the whole thread height, so that the tool returns through the air."""
    top = cycle.end.x + cycle.outward * cycle.height
    return min((cycle.start.x - top) * cycle.outward, (cycle.start.x - top - cycle.helix.taper) * cycle.outward) >= 0.0
