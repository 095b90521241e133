"""G92, the single threading cycle: approach, one cut per start, retract, return."""

from __future__ import annotations

from dataclasses import dataclass

from threadpitch.cycles.moves import Pass, Point, ThreadPath
from threadpitch.cycles.multiple import Helix, check_line, check_run_out, signed_run_out


@dataclass(frozen=True)
class G92Cycle:
    """One G92 block: start point A, end point D of this cut, the helix.

    Raises:
        ThreadError: numbers that the control refuses.
    """

    start: Point
    end: Point
    helix: Helix

    def __post_init__(self) -> None:
        check_line(self.start, self.end, self.helix)
        check_run_out(self.helix.run_out, max(abs(self.end.z - self.start.z), abs(self.helix.taper)))


def passes(cycle: G92Cycle) -> tuple[Pass, ...]:
    """One pass per start: from (D.x + i, A.z) to D. The words tell no depth; ``marked`` tells rough from finish."""
    begin = Point(cycle.end.x + cycle.helix.taper, cycle.start.z)
    run_out = signed_run_out(cycle.helix, cycle.start, cycle.end)
    return tuple(
        Pass(k + 1, "rough", None, cycle.start,
             (ThreadPath(begin, cycle.end, cycle.helix.lead, cycle.helix.start_angle(k + 1), run_out=run_out),), k + 1)
        for k in range(cycle.helix.starts)
    )
