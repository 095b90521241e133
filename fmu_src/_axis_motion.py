"""The commands of both axes: rapid traverse, and a way that follows a target at limited acceleration."""

from dataclasses import dataclass
from math import floor, sqrt

from threadpitch.fmu.elementary import exp
from threadpitch.fmu.variable import input_, output, parameter, state

from ._spindle_reading import SpindleReading

ROUNDING = 1e-12  # m
MOST_PERIODS = 1e9  # of a stop; more is no machine's
SMOOTHED = 64
EXPONENTIAL = 0
CATCH_UP = 1
S_SHAPED = 2


def stopping_velocity(distance: float, acceleration: float, period: float) -> float:
    """u with T (u + (u - aT) + (u - 2aT) + ...) = distance, the terms that are positive: k of them.

    k (k - 1) / 2 <= distance / (a T^2) <= k (k + 1) / 2,  u = distance / (k T) + a T (k - 1) / 2
    """
    change = acceleration * period
    k = 1.0 + floor(min(MOST_PERIODS, 0.5 * (sqrt(1.0 + 8.0 * max(0.0, distance) / (change * period)) - 1.0)))
    return max(0.0, distance) / (k * period) + 0.5 * change * (k - 1.0)


def arrived(command: float, goal: float) -> bool:
    """The command is on its goal, but for rounding."""
    return abs(goal - command) <= ROUNDING


@dataclass
class AxisMotion(SpindleReading):
    """Commanded positions. ``travel`` is the way along the chain of threading blocks, which Z and X are points of."""

    z_position: float = input_("m", "Detected Z position", display="mm")
    x_position: float = input_("m", "Detected X position, radius", display="mm")

    z_command: float = output("m", "Commanded Z position", display="mm", discrete=True)
    x_command: float = output("m", "Commanded X position, radius", display="mm", discrete=True)

    start_mode: int = parameter("1", "Acceleration at the start", start=CATCH_UP, choices={
        "exponential": 0, "catch_up": 1, "s_shaped": 2})
    start_time_constant: float = parameter("s", "Time constant T1 of the exponential start", start=0.03333333333333333,
                                           display="ms", min=1e-5, max=10.0)
    smoothing_periods: int = parameter("1", "Periods over which the s-shaped start averages", start=16, min=1, max=64)
    acceleration_limit: float = parameter("m/s2", "Largest commanded acceleration", start=2.0, min=1e-3, max=1e6)
    rapid_speed: float = parameter("m/s", "Rapid traverse", start=0.25, display="m/min", min=1e-6, max=10.0)

    z_velocity: float = state("m/s", "Z velocity of rapid traverse in the latest period", display="mm/s", discrete=True)
    x_velocity: float = state("m/s", "X velocity of rapid traverse in the latest period", display="mm/s", discrete=True)
    travel: float = state("m", "Way along the threading blocks", display="mm", discrete=True)
    travel_velocity: float = state("m/s", "Its velocity in the latest period", display="mm/s", discrete=True)
    former_target: float = state("m", "Way that the spindle asked for at the former instant", display="mm",
                                 discrete=True)
    on_line: bool = state("1", "The command has caught up with the line", start=False)
    smoothed: list[float] = state("m", "Latest ways of an s-shaped start, a ring", display="mm", size=64, discrete=True)
    smoothed_next: int = state("1", "Place of the next way in the ring", start=0, min=0, max=63, discrete=True)

    def _initialize_motion(self) -> None:
        """At rest at the detected position."""
        self.z_command = self.z_position
        self.x_command = self.x_position
        self._rest()
        self._begin_travel()

    def _rest(self) -> None:
        """Both axes stand."""
        self.z_velocity = 0.0
        self.x_velocity = 0.0

    def _begin_travel(self) -> None:
        """At the first point of the blocks, at rest."""
        self.travel = 0.0
        self.travel_velocity = 0.0
        self.former_target = 0.0
        self.on_line = False
        for i in range(SMOOTHED):
            self.smoothed[i] = 0.0

    def _stopping_velocity(self, distance: float) -> float:
        """The velocity from which the distance is enough to stop."""
        return stopping_velocity(distance, self.acceleration_limit, self.period)

    def _accelerated(self, velocity: float, wanted: float) -> float:
        """The wanted velocity as near as acceleration_limit lets it come within one period."""
        change = self.acceleration_limit * self.period
        return max(velocity - change, min(velocity + change, wanted))

    def _limited_velocity(self, remaining: float, velocity: float) -> float:
        """Velocity of a rapid traverse over the remaining distance, signed, after one more period."""
        wanted = min(self.rapid_speed, self._stopping_velocity(abs(remaining)))
        if remaining < 0.0:
            wanted = -wanted
        return self._accelerated(velocity, wanted)

    def _traverse(self, goal: float) -> None:
        """Z at rapid traverse with limited acceleration, exactly onto the goal."""
        self.z_velocity = self._limited_velocity(goal - self.z_command, self.z_velocity)
        self.z_command = self.z_command + self.z_velocity * self.period
        if arrived(self.z_command, goal):
            self.z_command = goal
            self.z_velocity = 0.0

    def _infeed(self, goal: float) -> None:
        """X at rapid traverse with limited acceleration, exactly onto the goal."""
        self.x_velocity = self._limited_velocity(goal - self.x_command, self.x_velocity)
        self.x_command = self.x_command + self.x_velocity * self.period
        if arrived(self.x_command, goal):
            self.x_command = goal
            self.x_velocity = 0.0

    def _halt(self) -> None:
        """Both axes come to rest at limited acceleration."""
        self.z_velocity = self._accelerated(self.z_velocity, 0.0)
        self.x_velocity = self._accelerated(self.x_velocity, 0.0)
        self.z_command = self.z_command + self.z_velocity * self.period
        self.x_command = self.x_command + self.x_velocity * self.period

    def _lagged_velocity(self, target: float) -> float:
        """First-order lag, exact for a target that moves on a line within the period.

        z(k) = target(k) - T1 v + (z(k-1) - target(k-1) + T1 v) exp(-period / T1)
        v = (target(k) - target(k-1)) / period
        """
        lag = self.start_time_constant * (target - self.former_target) / self.period
        decay = exp(-self.period / self.start_time_constant)
        wanted = (target - lag + (self.travel - self.former_target + lag) * decay - self.travel) / self.period
        return self._accelerated(self.travel_velocity, wanted)

    def _catching_velocity(self, target: float, line_begins: float, line_velocity: float) -> float:
        """Time-optimal: the line's velocity and as much more as can still be taken away in time.

        The distance is closed by u, u - aT, u - 2aT, ... (``stopping_velocity``); after the last of them the command
        is on the line and stays there.
        """
        line = (target - self.former_target) / self.period
        behind = self.former_target - self.travel
        closing = self._stopping_velocity(abs(behind))
        if behind < 0.0:
            closing = -closing
        wanted = line + closing
        if self.on_line:
            return wanted
        velocity = self._accelerated(self.travel_velocity, wanted)
        # the first period holds a part of the line only: its velocity tells nothing of the acceleration to come
        change = self.acceleration_limit * self.period
        whole = self.former_target > line_begins or line_velocity <= change
        if whole and velocity == wanted and abs(behind) <= change * self.period:
            self.on_line = True
        return velocity

    def _smooth(self) -> float:
        """The way that is commanded: of an s-shaped start the mean of the latest ones."""
        if self.start_mode != S_SHAPED:
            return self.travel
        self.smoothed[self.smoothed_next] = self.travel
        self.smoothed_next = self.smoothed_next + 1
        if self.smoothed_next >= self.smoothing_periods:
            self.smoothed_next = 0
        total = 0.0
        count = self.smoothing_periods
        for i in range(count):
            total = total + self.smoothed[i]
        return total / count

    def _smoothing_age(self) -> float:
        """By how much the mean is older than the newest way, s: the line is asked for so much earlier."""
        if self.start_mode == S_SHAPED:
            return 0.5 * (self.smoothing_periods - 1.0) * self.period
        return 0.0
