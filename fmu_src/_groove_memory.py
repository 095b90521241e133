"""What former passes have left: the groove along the thread's helix."""

from dataclasses import dataclass
from math import floor, pi

from threadpitch.fmu.variable import parameter, state

TURN = 2.0 * pi
POINTS = 288
LEAD_IN = 1.0  # turns that are kept before: deeper passes meet the metal earlier, infeed along Z shifts them
MOST_INFEED = 0.75  # turns that infeed may shift the helix along Z; what is more is another turn


@dataclass
class GrooveMemory:
    """The groove at points of the helix, as the union of two V grooves at each.

    A point's angle is counted from where the first pass met the metal, every start of the thread has its own points.
    A new V that contains a stored one takes its place: two are enough for radial, flank and alternating infeed. Where
    passes scatter there may be three of which none contains another; the two are joined whose hull adds the least
    area, (low2 - low1) (high2 - high1) / (2 tan): a sliver of the scatter's width beside one flank.
    """

    face: float = parameter("m", "Z of the workpiece's face, where the thread begins", start=0.0, display="mm")
    starts: int = parameter("1", "Starts of the thread; pitch = lead / starts", start=1, min=1, max=100)
    groove_interval: float = parameter("rad", "Angle between the points at which the groove is kept, 288 for all "
                                              "starts; doubled when the thread has more turns",
                                       start=0.5235987755982988, display="deg", min=1e-3, max=12.566370614359172)

    first_low: list[float] = state("m", "Groove kept: low end of its first V", display="mm", size=288, discrete=True)
    first_high: list[float] = state("m", "Groove kept: high end of its first V; equal to its low end where there is "
                                         "none yet", display="mm", size=288, discrete=True)
    second_low: list[float] = state("m", "Groove kept: low end of its second V", display="mm", size=288, discrete=True)
    second_high: list[float] = state("m", "Groove kept: high end of its second V", display="mm", size=288,
                                     discrete=True)
    interval: float = state("rad", "Angle between the points", display="deg", discrete=True)
    reference_known: bool = state("1", "A pass has been cut", start=False)
    reference_angle: float = state("rad", "Angle at which the first pass met the metal", display="deg", discrete=True)
    reference_z: float = state("m", "Z at which it did", display="mm", discrete=True)
    reference_lead: float = state("m", "Largest movement along Z per turn in the first pass; 0 = not known yet",
                                  display="mm", discrete=True)
    reference_start: float = state("rad", "Angle at which the first pass began", display="deg", discrete=True)
    pass_start: float = state("rad", "Angle at which this pass began", display="deg", discrete=True)
    located: bool = state("1", "The helix of this pass is known", start=False)
    helix: int = state("1", "Which start this pass cuts, counted from that of the first pass", start=0, min=0, max=99)
    origin_angle: float = state("rad", "Angle at which this pass would meet it there, but for its infeed",
                                display="deg", discrete=True)
    pending_point: int = state("1", "Point that this pass has cut last and that is not kept yet; -1: none", start=-1,
                               min=-1, max=288)
    pending_low: float = state("m", "Its V: low end", display="mm", discrete=True)
    pending_high: float = state("m", "Its V: high end", display="mm", discrete=True)
    advance: float = state("m", "Movement along Z from point to point", display="mm")
    left_low: list[float] = state("m", "Where the tool is: low ends of what former passes left", display="mm", size=2)
    left_high: list[float] = state("m", "Where the tool is: high ends of what former passes left", display="mm", size=2)

    def _initialize_memory(self) -> None:
        """A workpiece without a groove."""
        for i in range(POINTS):
            self.first_low[i] = 0.0
            self.first_high[i] = 0.0
            self.second_low[i] = 0.0
            self.second_high[i] = 0.0
        for i in range(2):
            self.left_low[i] = 0.0
            self.left_high[i] = 0.0
        self.interval = self.groove_interval
        self.reference_known = False
        self.reference_angle = 0.0
        self.reference_z = 0.0
        self.reference_start = 0.0
        self.reference_lead = 0.0
        self.pass_start = 0.0
        self.located = False
        self.helix = 0
        self.origin_angle = 0.0
        self.advance = 0.0
        self.pending_point = -1
        self.pending_low = 0.0
        self.pending_high = 0.0

    def _points(self) -> int:
        """Points of one start."""
        return POINTS // self.starts

    def _locate(self, angle: float, z: float) -> None:
        """Which start is cut, and where: the helix through here met z_r at theta - 2 pi (z - z_r) / lead.

        z_r is where the first pass met the metal. The lead is that of the first pass once its feed was in step: where
        a pass meets the metal its own feed may hardly have begun to move. Passes of one start begin whole turns apart,
        those of different starts a share of a turn. Infeed along Z shifts where they meet z_r, another approach does
        so by whole turns.
        """
        if not self.reference_known:
            self.reference_known = True
            self.reference_z = z
            self.reference_angle = angle
            self.reference_start = self.pass_start
        crossing = angle
        if self.reference_lead != 0.0:
            crossing = angle - (z - self.reference_z) * TURN / self.reference_lead
        between = (self.pass_start - self.reference_start) / TURN
        shift = (crossing - self.reference_angle) / TURN - between
        whole = 1.0 * floor(abs(shift) + 1.0 - MOST_INFEED)
        if shift < 0.0:
            whole = -whole
        passed = 1.0 * floor((between + whole) * self.starts + 0.5)
        self.origin_angle = self.reference_angle + TURN * passed / self.starts
        self.helix = floor(passed - self.starts * floor(passed / self.starts) + 0.5)
        self.located = True

    def _learn_lead(self, turned: float, moved: float) -> None:
        """The largest movement per turn of the first pass: that of a feed in step."""
        if self.pass_start == self.reference_start and turned > 0.0:
            lead = moved / turned * TURN
            if abs(lead) > abs(self.reference_lead):
                self.reference_lead = lead

    def _place(self, angle: float) -> float:
        """The angle along the helix, in points; below zero where it is before the first of them."""
        return (angle - self.origin_angle + LEAD_IN * TURN) / self.interval

    def _thin_out(self) -> None:
        """Every second point stays: there is room for as many turns again."""
        points = self._points()
        half = (points + 1) // 2
        first = self.helix * points
        if self.pending_point >= 0:
            self._put_back(self.pending_point - first)
            self.pending_point = first + (self.pending_point - first) // 2
        for helix in range(self.starts):
            for i in range(points):
                to = helix * points + i
                self.first_low[to] = self._halved(self.first_low, to, i, half)
                self.first_high[to] = self._halved(self.first_high, to, i, half)
                self.second_low[to] = self._halved(self.second_low, to, i, half)
                self.second_high[to] = self._halved(self.second_high, to, i, half)
        self.interval = 2.0 * self.interval

    def _put_back(self, point: int) -> None:
        """A pending point that will not stay: the one before waits in its place, not cut yet where nothing else is."""
        if point % 2 == 1:
            before = self.pending_point - 1
            self.pending_low = self.pending_low - self.advance
            self.pending_high = self.pending_high - self.advance
            if point + 1 >= self._points() or not self._is_cut(self.pending_point + 1):
                self.first_high[before] = self.first_low[before]
                self.second_high[before] = self.first_low[before]
                self.second_low[before] = self.first_low[before]
            self.pending_point = before

    def _halved(self, values: list[float], to: int, i: int, half: int) -> float:
        """What place ``to``, the i-th of its start, gets from the one twice as far."""
        if i < half:
            return values[to + i]
        return 0.0

    def _recall(self, place: float, z: float) -> None:
        """What former passes left, on straight lines between points; a groove of no width at z where nothing is.

        Where a pass ends between two points its groove goes on, by the tool's advance from point to point: what is
        beyond the material makes no chip.
        """
        point = max(0, floor(place))
        share = place - point
        i = point + self.helix * self._points()
        j = i + 1
        beyond = 0.0
        if not self._is_cut(i):
            beyond = (share - 1.0) * self.advance
            i = j
        elif not self._is_cut(j):
            beyond = share * self.advance
            j = i
        self.left_low[0] = z
        self.left_high[0] = z
        self.left_low[1] = z
        self.left_high[1] = z
        if place >= 0.0 and self._is_cut(i):
            self.left_low[0] = self.first_low[i] + share * (self.first_low[j] - self.first_low[i]) + beyond
            self.left_high[0] = self.first_high[i] + share * (self.first_high[j] - self.first_high[i]) + beyond
            self.left_low[1] = self.second_low[i] + share * (self.second_low[j] - self.second_low[i]) + beyond
            self.left_high[1] = self.second_high[i] + share * (self.second_high[j] - self.second_high[i]) + beyond

    def _is_cut(self, i: int) -> bool:
        """Whether there is a groove at this point."""
        return self.first_high[i] > self.first_low[i]

    def _pass_point(self, point: int, low: float, high: float) -> None:
        """The tool has passed a point: the one before is kept, this one waits until the tool is past the next."""
        self._keep_pending()
        if high > low:
            self.pending_point = point + self.helix * self._points()
            self.pending_low = low
            self.pending_high = high

    def _keep_pending(self) -> None:
        """The point that waits joins the groove."""
        if self.pending_point >= 0:
            self._join(self.pending_point, self.pending_low, self.pending_high)
        self.pending_point = -1

    def _join(self, i: int, low: float, high: float) -> None:
        """The union of the groove at point i with another V, as two of them again: the lower one first."""
        none = not self._is_cut(i)
        in_first = low >= self.first_low[i] and high <= self.first_high[i]
        in_second = low >= self.second_low[i] and high <= self.second_high[i]
        if not none and (in_first or in_second):
            return
        over_first = none or (low <= self.first_low[i] and high >= self.first_high[i])
        over_second = none or (low <= self.second_low[i] and high >= self.second_high[i])
        one = self.first_low[i] == self.second_low[i] and self.first_high[i] == self.second_high[i]
        if over_first or over_second or one:
            if over_first or (one and low < self.first_low[i]):
                self.first_low[i] = low
                self.first_high[i] = high
            if over_second or (one and low > self.second_low[i]):
                self.second_low[i] = low
                self.second_high[i] = high
        else:
            self._join_third(i, low, high)

    def _join_third(self, i: int, low: float, high: float) -> None:
        """Three V, none within another, in order of their ends: the two neighbours that differ least become one."""
        low1 = self.first_low[i]
        high1 = self.first_high[i]
        low2 = self.second_low[i]
        high2 = self.second_high[i]
        low3 = low
        high3 = high
        if low < low1:
            low3 = low2
            high3 = high2
            low2 = low1
            high2 = high1
            low1 = low
            high1 = high
        elif low < low2:
            low3 = low2
            high3 = high2
            low2 = low
            high2 = high
        if (low2 - low1) * (high2 - high1) <= (low3 - low2) * (high3 - high2):
            high1 = high2
            low2 = low3
        self.first_low[i] = low1
        self.first_high[i] = high1
        self.second_low[i] = low2
        self.second_high[i] = high3
