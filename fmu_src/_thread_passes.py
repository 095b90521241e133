"""The passes of a thread: their depths, kinds and starts."""

from dataclasses import dataclass
from math import floor, sqrt

from threadpitch.fmu.elementary import cos, sin
from threadpitch.fmu.variable import output, parameter, state

from ._block_chain import BlockChain
from ._spindle_reading import PULSE_GENERATOR, TURN

SINGLE = 0
MULTIPLE = 1
LIST = 2
ROUGH = 0
FINISH = 1
SPRING = 2
NO_MEMORY = 0
EQUAL_PARTS = 0
FIRST_TAKES_ALL = 1
PASS_BY_PASS = 1
SAME_DEPTH = 1e-12  # m; depths closer than this are one
MOST_PASSES = 10000
DEPTHS = 32


@dataclass
class ThreadPasses(BlockChain):
    """The cycle as numbers: one pass, G76, or a list of depths; every pass for every start."""

    pass_number: int = output("1", "Number of the pass, from 1", start=0, min=0, max=10000, discrete=True)
    start_number: int = output("1", "Number of the start that is cut, from 1", start=1, min=1, max=100, discrete=True)
    cut_depth: float = output("m", "Depth of this pass, radius", display="mm", discrete=True)
    start_angle: float = output("rad", "Spindle angle from the one-turn pulse at which this start begins",
                                display="deg", discrete=True)
    pass_kind: int = output("1", "0 rough, 1 finish, 2 spring pass", start=0, min=0, max=2, discrete=True)

    cycle: int = parameter("1", "Passes: one (G32), G76 by first_cut and so on, or a list of depths (G92)",
                           start=SINGLE, choices={"single": 0, "multiple": 1, "list": 2})
    starts: int = parameter("1", "Starts of the thread; pitch = lead / starts", start=1, min=1, max=100)
    start: int = parameter("1", "Number of the start to cut, from 1; 0 = all of them", start=0, min=0, max=100)
    start_order: int = parameter("1", "All passes of a start first, or all starts of a pass", start=0, choices={
        "start_by_start": 0, "pass_by_pass": 1})
    first_start_angle: float = parameter("rad", "Spindle angle of the first start from the one-turn pulse (Q)",
                                         start=0.0, display="deg", min=0.0, max=6.283185307179587)
    thread_height: float = parameter("m", "Thread height k, radius: depth of a pass at x_thread", start=0.00092,
                                     display="mm", min=0.0, max=1.0)
    first_cut: float = parameter("m", "First cut depth, radius", start=0.00025, display="mm", min=1e-9, max=1.0)
    least_cut: float = parameter("m", "Least roughing cut dmin, radius", start=0.00005, display="mm", min=0.0, max=1.0)
    allowance: float = parameter("m", "Finishing allowance d, radius", start=0.00005, display="mm", min=0.0, max=1.0)
    finishing_passes: int = parameter("1", "Finishing passes m", start=2, min=0, max=99)
    tool_angle: float = parameter("rad", "Tool angle a: flank infeed by depth * tan(a / 2); < 0: along the other flank",
                                  start=1.0471975511965976, display="deg", min=-3.0, max=3.0)
    clamping: int = parameter("1", "Cuts that the rule makes smaller than least_cut", start=0, choices={
        "no_memory": 0, "sticky": 1})
    finishing: int = parameter("1", "How the finishing passes share the allowance", start=0, choices={
        "equal_parts": 0, "first_takes_all": 1})
    pass_count: int = parameter("1", "Passes of the list", start=1, min=1, max=32)
    depth: list[float] = parameter("m", "Depths of the list's passes, radius", start=0.0, display="mm", min=-1.0,
                                   max=1.0, size=32)

    planned_depth: float = state("m", "Depth of the pass that is under way or next", display="mm", discrete=True)
    rough_number: int = state("1", "Roughing passes of this start, or passes of its list", start=0, min=0, max=10001)
    finish_number: int = state("1", "Finishing passes of this start", start=0, min=0, max=100)
    flank: float = state("1", "tan(a / 2) of the flank infeed", discrete=True)

    def _check_passes(self) -> int:
        """0, or a declared error."""
        if self.start > self.starts:
            return 2
        if self.cycle == MULTIPLE:
            bottom = self.thread_height - self.allowance
            if self.thread_height <= 0.0 or bottom < 0.0 or self.least_cut > self.thread_height:
                return 5
            number = self._roughing_passes(bottom) + self.finishing_passes
            if number < 1 or number * self.starts > MOST_PASSES:
                return 6
        return self._check_chain(self.thread_height * self._flank())

    def _flank(self) -> float:
        """tan(a / 2) of the flank infeed; 0 where the words give no depth to shift by."""
        half = 0.5 * self.tool_angle
        if self.cycle == MULTIPLE:
            return sin(half) / cos(half)
        return 0.0

    def _initialize_passes(self) -> None:
        """Before the first pass."""
        self.flank = self._flank()
        self.pass_number = 0
        self.start_number = max(1, self.start)
        self.cut_depth = 0.0
        self.pass_kind = ROUGH
        self._begin_chain(0.0)
        self._begin_start()
        self._plan_depth()
        self._plan_pass()

    # The sequence of passes

    def _begin_start(self) -> None:
        """No pass of this start is cut."""
        self.planned_depth = 0.0
        self.rough_number = 0
        self.finish_number = 0

    def _plan_next(self) -> bool:
        """Plan the next pass; False when all are cut."""
        more_starts = self.start == 0 and self.start_number < self.starts
        if self.start_order == PASS_BY_PASS:
            if more_starts:
                self.start_number = self.start_number + 1
            elif self._plan_depth():
                self.start_number = max(1, self.start)
            else:
                return False
        elif not self._plan_depth():
            if not more_starts:
                return False
            self.start_number = self.start_number + 1
            self._begin_start()
            self._plan_depth()
        self._plan_pass()
        return True

    def _plan_depth(self) -> bool:
        """Depth and kind of the next pass of this start; False when there is none."""
        if self.cycle == MULTIPLE:
            return self._plan_multiple()
        count = 1
        depth = self.x_surface - self.x_thread
        deepest = depth
        if self.cycle == LIST:
            count = self.pass_count
            depth = self.depth[min(self.rough_number, DEPTHS - 1)]
            deepest = self.depth[0]
            for i in range(1, count):
                deepest = max(deepest, self.depth[i])
        if self.rough_number >= count:
            return False
        self.pass_kind = ROUGH
        if self.rough_number > 0 and depth <= self.planned_depth + SAME_DEPTH:
            self.pass_kind = SPRING
        elif depth >= deepest - SAME_DEPTH:
            self.pass_kind = FINISH
        self.planned_depth = depth
        self.rough_number = self.rough_number + 1
        return True

    def _plan_multiple(self) -> bool:
        """G76: roughing to k - d, then the finishing passes."""
        bottom = self.thread_height - self.allowance
        if self.finish_number == 0 and self.planned_depth < bottom - SAME_DEPTH:
            self.rough_number = self.rough_number + 1
            deep = self._roughing_depth(self.rough_number, self.planned_depth)
            if deep > bottom - SAME_DEPTH:
                deep = bottom
            self.planned_depth = deep
            self.pass_kind = ROUGH
            return True
        if self.finish_number >= self.finishing_passes:
            return False
        self.finish_number = self.finish_number + 1
        self.planned_depth = self._finishing_depth(self.finish_number)
        self.pass_kind = FINISH
        if self.allowance <= SAME_DEPTH or (self.finishing == FIRST_TAKES_ALL and self.finish_number > 1):
            self.pass_kind = SPRING
        return True

    def _roughing_depth(self, number: int, former: float) -> float:
        """dd sqrt(n), or where dd (sqrt(n) - sqrt(n - 1)) < dmin: dd sqrt(n - 1) + dmin; sticky: former depth + dmin.

        The differences of the roots only fall: once the rule clamps it clamps for good.
        """
        rule = self.first_cut * sqrt(1.0 * number)
        before = self.first_cut * sqrt(number - 1.0)
        if self.clamping == NO_MEMORY:
            return max(rule, before + self.least_cut)
        if rule - before < self.least_cut:
            return former + self.least_cut
        return rule

    def _finishing_depth(self, number: int) -> float:
        """k - d (m - n) / m, counted down so that the last pass is at k exactly; or k in all."""
        if self.finishing == EQUAL_PARTS:
            return self.thread_height - self.allowance * (self.finishing_passes - number) / self.finishing_passes
        return self.thread_height

    def _roughing_passes(self, bottom: float) -> int:
        """Number of roughing passes to the bottom; more than MOST_PASSES are not counted."""
        number = 0
        depth = 0.0
        while depth < bottom - SAME_DEPTH and number <= MOST_PASSES:
            number = number + 1
            depth = self._roughing_depth(number, depth)
        return number

    def _start_angle(self) -> float:
        """first_start_angle + 2 pi (start - 1) / starts modulo a turn; of a pulse generator in whole counts."""
        angle = self.first_start_angle + TURN * (self.start_number - 1.0) / self.starts
        if self.detector == PULSE_GENERATOR:
            first = floor(self.first_start_angle / TURN * self.counts_per_turn + 0.5)
            displaced = floor((self.start_number - 1.0) * self.counts_per_turn / self.starts + 0.5)
            angle = (first + displaced) / self.counts_per_turn * TURN
        if angle >= TURN:
            angle = angle - TURN
        return angle

    def _plan_pass(self) -> None:
        """Start angle and points of the pass: depth tan(a / 2) along the flank, X off x_thread by what is missing."""
        self.start_angle = self._start_angle()
        above = 0.0
        if self.cycle != SINGLE:
            above = self._outward() * (self.thread_height - self.planned_depth)
        self._plan_chain(above, self.planned_depth * self.flank)

    def _begin_pass(self, angle: float) -> None:
        """The gate opens; the line begins at this angle since the counter's reset."""
        self.pass_number = self.pass_number + 1
        self.cut_depth = self.planned_depth
        self._begin_chain(angle)
