"""The pitch calculator: movement of the feed per spindle revolution, from one or several start angles."""

from dataclasses import dataclass
from math import floor, pi

from threadpitch.fmu.variable import Clock, Experiment, Terminal, input_, output, parameter, state

EXPERIMENT = Experiment(stop_time=4.0, step_size=1e-3)
CLOCKS = (
    Clock("revolution_clock", ticks="completed", description="A revolution of the first start angle was completed"),
)
TERMINALS = (
    Terminal("cut", {"angle": "spindle_angle", "position": "feed_position", "threading": "threading",
                     "threading_angle": "threading_angle"}, "Spindle and feed"),
)
ERRORS = {
    1: "more than 8 turns in one communication step: choose a smaller step size",
    2: "more than 72 samples in one communication step: choose a smaller step size or a larger sample_interval",
    3: "the start angles must be at most a turn from zero",
}
TURN = 2.0 * pi
ANGLES = 8  # largest number of start angles
TURNS_A_STEP = 8  # largest number of turns that one step may complete
NEAR = 1e-9  # turns or samples: angles closer than this are one
ROUNDING = 2e-15  # of an angle that was converted from counts
SAMPLES_A_STEP = 72  # largest number of samples that one step may pass
LINEAR = 0  # values of crossing_estimate
CUBIC = 1


@dataclass
class PitchCalculator:
    """Movement per revolution from the spindle's angle theta and the feed's movement xi, found inside the step.

    P(n) = xi(theta_S + 2 pi n) - xi(theta_S + 2 pi (n - 1)),  n = 1, 2, ...        (seed: US 2016/0008901, formula 2)

    xi(theta) between two communication points is a straight line, or, with crossing_estimate = cubic, the cubic through
    them and the two before, as far as they lie in the same pass and the angle rose. theta_S counts from the one-turn
    pulse, and n = 1 begins at its first crossing after threading began. Threading began inside the step where the
    spindle passed threading_angle (connect it to the controller's start_angle); where that is not in sight, with the
    step. Jitter of the angle backwards changes nothing: a crossing is found once. The results of a pass stay until the
    next one begins. P(n) is positive in the direction of feed.
    """

    spindle_angle: float = input_("rad", "Spindle angle theta, continuous", display="deg")
    feed_position: float = input_("m", "Position xi of the feed", display="mm")
    threading: bool = input_("1", "The thread is being cut", start=False)
    threading_angle: float = input_("rad", "Spindle angle, modulo a turn, at which threading begins", display="deg")

    revolution: list[int] = output("1", "Whole turns n completed since threading began", start=0, size=8, min=0,
                                   max=2147483647, discrete=True)
    pitch: list[float] = output("m", "Movement P(n) in the newest whole turn; 0 before the first", display="mm",
                                size=8, discrete=True)
    pitch_min: list[float] = output("m", "Smallest P(n) of this pass", display="mm", size=8, discrete=True)
    pitch_max: list[float] = output("m", "Largest P(n) of this pass", display="mm", size=8, discrete=True)
    pitch_mean: list[float] = output("m", "Mean P(n) of this pass", display="mm", size=8, discrete=True)
    deviation: list[float] = output("m", "P(n) - pitch_target; 0 before the first whole turn", display="um", size=8,
                                    discrete=True)
    crossing_position: list[float] = output("m", "xi at the newest crossing of the start angle", display="mm",
                                            size=8, discrete=True)
    crossing_time: list[float] = output("s", "Time of the newest crossing of the start angle", size=8, discrete=True)
    completed: list[int] = output("1", "Turns completed in this step", start=0, size=8, min=0, max=8, discrete=True)
    completed_pitch: list[float] = output("m", "P of the turns completed in this step: start angle i (from 1), turn j "
                                               "of the step (from 1) at 8 (i - 1) + j", display="mm", size=64,
                                          discrete=True)
    sample_angle: float = output("rad", "Newest whole multiple of sample_interval since threading began",
                                 display="deg", discrete=True)
    sample_position: float = output("m", "Movement xi since threading began, at sample_angle", display="mm",
                                    discrete=True)
    sample_count: int = output("1", "Samples since threading began", start=0, min=0, max=2147483647, discrete=True)
    step_samples: int = output("1", "Samples passed in this step", start=0, min=0, max=72, discrete=True)
    step_sample_position: list[float] = output("m", "Movement xi at the samples passed in this step; the last of them "
                                                    "is sample_position", display="mm", size=72, discrete=True)
    threading_start: float = output("rad", "Spindle angle at which threading began", display="deg", discrete=True)

    start_angle_count: int = parameter("1", "Number of start angles", start=4, min=1, max=8)
    start_angle: list[float] = parameter("rad", "Start angles theta_S, counted from the one-turn pulse", start=0.0,
                                         display="deg", min=-6.283185307179587, max=6.283185307179587, size=8)
    use_threading_start: bool = parameter("1", "Count the start angles from where threading began instead",
                                          start=False)
    reference_angle: float = parameter("rad", "spindle_angle at the one-turn pulse", start=0.0, display="deg")
    pitch_target: float = parameter("m", "Target of P(n): the thread's lead", start=0.0015, display="mm", min=0.0,
                                    max=1.0, nominal=1e-3)
    feed_direction: int = parameter("1", "Direction of the cut in xi; 0 = fixed by the first turn", start=0, min=-1,
                                    max=1)
    sample_interval: float = parameter("rad", "Interval of the samples xi(theta)", start=0.17453292519943295,
                                       display="deg", min=1e-4, max=6.283185307179587)

    crossing_estimate: int = parameter("1", "xi between two communication points; cubic is for angles and positions "
                                            "without quantisation", start=LINEAR, choices={"linear": LINEAR,
                                                                                           "cubic": CUBIC})

    direction: float = state("1", "Direction of the cut of this pass, 0 while not known", discrete=True)
    was_threading: bool = state("1", "Threading at the former communication point", start=False)
    former_angle: float = state("rad", "Furthest angle so far", display="deg", discrete=True)
    former_time: float = state("s", "Time of the former communication point, or when threading began", discrete=True)
    step_end: float = state("s", "End of the newest step", discrete=True)
    former_position: float = state("m", "Newest position at the furthest angle", display="mm", discrete=True)
    past_angle: list[float] = state("rad", "Angles at the two communication points before, newest first", display="deg",
                                    size=2, discrete=True)
    past_position: list[float] = state("m", "xi there", display="mm", size=2, discrete=True)
    past_time: list[float] = state("s", "Their times", size=2, discrete=True)
    past_count: int = state("1", "How many of them there are in this pass", start=0, min=0, max=2, discrete=True)
    first_crossing: list[float] = state("rad", "First angle theta_S + 2 pi k since threading began", display="deg",
                                        size=8, discrete=True)
    crossings: list[int] = state("1", "Crossings since threading began", start=0, size=8, min=0, max=2147483647,
                                 discrete=True)
    pitch_sum: list[float] = state("m", "Sum of P(n) of this pass", display="mm", size=8, discrete=True)
    first_position: float = state("m", "xi where threading began", display="mm", discrete=True)

    def check(self) -> int:
        """3 when a start angle is more than a turn from zero, otherwise 0."""
        for i in range(ANGLES):
            if abs(self.start_angle[i]) > TURN:
                return 3
        return 0

    def initialize(self) -> None:
        """No turn yet; the inputs are the first communication point."""
        self.former_angle = self.spindle_angle
        self.former_position = self.feed_position
        self.was_threading = self.threading
        self.step_samples = 0
        self.former_time = 0.0
        self.step_end = 0.0
        self._restart(self.spindle_angle)

    def step(self, time: float, step_size: float) -> int:
        """Crossings and samples between the furthest angle so far and the new one."""
        for i in range(ANGLES):
            self.completed[i] = 0
        self.step_samples = 0
        self.former_time = time
        self.step_end = time + step_size
        if self.threading and not self.was_threading:
            edge = self._edge()
            if edge > self.former_angle and edge < self.spindle_angle:
                self.former_time = self._time_at(edge)
                self.former_angle = edge  # the feed stands still until threading begins
            self._restart(edge)
        result = 0
        if self.threading and self.spindle_angle >= self.former_angle:
            result = self._advance()
        self._remember()
        self.was_threading = self.threading
        if self.spindle_angle >= self.former_angle or not self.threading:
            self.former_angle = self.spindle_angle
            self.former_position = self.feed_position
        return result

    def _edge(self) -> float:
        """Where threading began: the first angle congruent to threading_angle in this step, or less than one beside it.

        Beside it: the controller saw another detector's angle. Not in sight: the former communication point, or, as
        a starting point of its own, the first one that is threading.
        """
        movement = self.spindle_angle - self.former_angle
        threading_angle = self.reference_angle + self.threading_angle
        edge = threading_angle - floor((threading_angle - self.former_angle) / TURN + NEAR) * TURN
        if edge - self.spindle_angle < movement:
            return edge
        if self.former_angle - (edge - TURN) < movement:
            return edge - TURN
        if self.use_threading_start:
            return self.spindle_angle
        return self.former_angle

    def _position_at(self, angle: float) -> float:
        """xi at an angle of this step."""
        if self.spindle_angle <= self.former_angle:
            return self.feed_position
        share = (angle - self.former_angle) / (self.spindle_angle - self.former_angle)
        return (self.former_position + (self.feed_position - self.former_position) * share
                + self._bend(angle, self.feed_position, self.former_position, self.past_position[0],
                             self.past_position[1]))

    def _time_at(self, angle: float) -> float:
        """Time at an angle of this step."""
        if self.spindle_angle <= self.former_angle:
            return self.step_end
        share = (angle - self.former_angle) / (self.spindle_angle - self.former_angle)
        return (self.former_time + (self.step_end - self.former_time) * share
                + self._bend(angle, self.step_end, self.former_time, self.past_time[0], self.past_time[1]))

    def _bend(self, angle: float, newest: float, former: float, second: float, third: float) -> float:
        """What the polynomial through three or four points has beyond the line through the newest two.

        (a - a0)(a - a1) (d012 + (a - a2) d0123), Newton's form; a0 is the newest angle, d are divided differences.
        """
        if self.crossing_estimate != CUBIC or self.past_count == 0:
            return 0.0
        slope = (newest - former) / (self.spindle_angle - self.former_angle)
        former_slope = (former - second) / (self.former_angle - self.past_angle[0])
        bend = (slope - former_slope) / (self.spindle_angle - self.past_angle[0])
        if self.past_count > 1:
            second_slope = (second - third) / (self.past_angle[0] - self.past_angle[1])
            former_bend = (former_slope - second_slope) / (self.former_angle - self.past_angle[1])
            change = (bend - former_bend) / (self.spindle_angle - self.past_angle[1])
            bend = bend + (angle - self.past_angle[0]) * change
        return (angle - self.spindle_angle) * (angle - self.former_angle) * bend

    def _remember(self) -> None:
        """The former communication point becomes the newest of the past; where the angle did not rise there is none."""
        if not self.threading or self.spindle_angle <= self.former_angle:
            self.past_count = 0
        else:
            self.past_angle[1] = self.past_angle[0]
            self.past_position[1] = self.past_position[0]
            self.past_time[1] = self.past_time[0]
            self.past_angle[0] = self.former_angle
            self.past_position[0] = self.former_position
            self.past_time[0] = self.former_time
            self.past_count = min(self.past_count + 1, 2)

    def _restart(self, edge: float) -> None:
        """A new pass: every start angle waits for its first crossing at or after the edge."""
        self.threading_start = edge
        self.past_count = 0
        self.first_position = self._position_at(edge)
        self.direction = 1.0 * self.feed_direction
        self.sample_count = 0
        self.sample_angle = 0.0
        self.sample_position = 0.0
        for i in range(ANGLES):
            start = self.reference_angle + self.start_angle[i]
            if self.use_threading_start:
                start = edge + self.start_angle[i]
            self.first_crossing[i] = start - floor((start - edge) / TURN + NEAR) * TURN
            self.crossings[i] = 0
            self.revolution[i] = 0
            self.pitch[i] = 0.0
            self.pitch_min[i] = 0.0
            self.pitch_max[i] = 0.0
            self.pitch_mean[i] = 0.0
            self.pitch_sum[i] = 0.0
            self.deviation[i] = 0.0
            self.completed[i] = 0
            self.crossing_position[i] = 0.0
            self.crossing_time[i] = 0.0

    def _advance(self) -> int:
        """Every start angle's crossings up to the new angle, then the samples; a count is not late by rounding."""
        reached = self.spindle_angle + ROUNDING * (abs(self.spindle_angle) + TURN)
        for i in range(self.start_angle_count):
            if self.spindle_angle - self._next_crossing(i) >= TURN * TURNS_A_STEP:
                return 1
            while self._next_crossing(i) <= reached:
                self.crossing_time[i] = self._time_at(self._next_crossing(i))
                self._cross(i, self._position_at(self._next_crossing(i)))
        passed = floor((self.spindle_angle - self.threading_start) / self.sample_interval + NEAR) + 1
        if passed - self.sample_count > SAMPLES_A_STEP:
            return 2
        while self.sample_count < passed:
            self.sample_angle = self.sample_count * self.sample_interval
            self.sample_position = self._position_at(self.threading_start + self.sample_angle) - self.first_position
            self.step_sample_position[self.step_samples] = self.sample_position
            self.step_samples = self.step_samples + 1
            self.sample_count = self.sample_count + 1
        return 0

    def _next_crossing(self, i: int) -> float:
        """theta_S + 2 pi k, the next of start angle i."""
        return self.first_crossing[i] + self.crossings[i] * TURN

    def _cross(self, i: int, position: float) -> None:
        """Start angle i is crossed at this position: from the second time on a turn is complete."""
        if self.crossings[i] > 0:
            movement = position - self.crossing_position[i]
            if self.direction == 0.0:
                self.direction = 1.0
                if movement < 0.0:
                    self.direction = -1.0
            self._complete(i, self.direction * movement)
        self.crossings[i] = self.crossings[i] + 1
        self.crossing_position[i] = position

    def _complete(self, i: int, pitch: float) -> None:
        """Statistics with one more turn: minimum, maximum, mean, deviation."""
        self.revolution[i] = self.revolution[i] + 1
        if self.revolution[i] == 1:
            self.pitch_min[i] = pitch
            self.pitch_max[i] = pitch
        self.pitch[i] = pitch
        self.pitch_min[i] = min(self.pitch_min[i], pitch)
        self.pitch_max[i] = max(self.pitch_max[i], pitch)
        self.pitch_sum[i] = self.pitch_sum[i] + pitch
        self.pitch_mean[i] = self.pitch_sum[i] / self.revolution[i]
        self.deviation[i] = pitch - self.pitch_target
        self.completed_pitch[TURNS_A_STEP * i + self.completed[i]] = pitch
        self.completed[i] = self.completed[i] + 1
