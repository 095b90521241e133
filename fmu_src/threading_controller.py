"""The numerical control: start of threading at any spindle angle, feed in step with the spindle, retraction."""

from dataclasses import dataclass
from math import floor, pi, sqrt

from threadpitch.fmu.elementary import exp
from threadpitch.fmu.variable import Experiment, Terminal, input_, output, parameter, state

EXPERIMENT = Experiment(stop_time=4.0, step_size=1e-3)
TERMINALS = (
    Terminal("spindle_detector", {"angle": "spindle_angle", "count": "encoder_count", "index_count": "index_count",
                                  "index_latch": "index_latch"}, "The spindle's detector"),
    Terminal("z_axis", {"command": "z_command", "measured_position": "z_position"}, "The Z axis"),
    Terminal("x_axis", {"command": "x_command", "measured_position": "x_position"}, "The X axis"),
)
ERRORS = {
    1: "z_end equals z_start: the thread has no length",
    2: "start must not be larger than starts",
    3: "more than 64 control periods in one communication step: choose a smaller step size",
}
TURN = 2.0 * pi
HISTORY = 65
PERIODS_A_STEP = 64
SAME_INSTANT = 1e-6  # of a period: instants closer than this are one
ROUNDING = 1e-12  # m
MOST_PERIODS = 1e9  # of a stop; more is no machine's
ABSOLUTE = 0
PULSE_GENERATOR = 1
EXPONENTIAL = 0
CATCH_UP = 1
APPROACH = 0
WAIT_SPEED = 1
WAIT_INDEX = 2
WAIT_START = 3
THREADING = 4
STOPPING = 5
RETRACT = 6
RETURN = 7
DONE = 8


@dataclass
class ThreadingController:
    """One threading pass (G32/G33) from a designated spindle angle. SI units, x as radius.

    z = z_start +- lead / 2 pi (phi + omega command_age - phi_start)       phi: angle from the one-turn pulse

    Order: approach z_start, wait for the spindle's speed, infeed to x_thread, wait for the one-turn pulse (it resets
    the counter once), compare the counter with the start position, open the gate: from there on the pulses are
    distributed to Z in the ratio lead / turn. Stop at z_end, retract X, return Z.

    Start position: round(k N / starts) counts for start k = 0, 1, ..., displaced by start_angle. It is found by a
    crossing test; what the spindle has turned past it goes into the first command. start_mode exponential filters
    the commanded movement by a first-order lag of start_time_constant whose lag of velocity * time constant stays;
    catch_up accelerates at acceleration_limit until the command is on the line again. Both keep to the limit.

    Runs every period at absolute instants k * period; inputs between two communication points are interpolated.
    command_age is the sum Td of all ages between the spindle and the commanded feed (measuring, sampling, order of
    the co-simulation); with age_compensation the angle is extrapolated by it at the measured speed.
    """

    spindle_angle: float = input_("rad", "Detected spindle angle from the one-turn pulse, continuous", display="deg")
    encoder_count: float = input_("1", "Counted pulses NP of the pulse generator", discrete=True)
    index_count: int = input_("1", "One-turn pulses 1P so far", start=0, min=0, max=2147483647, discrete=True)
    index_latch: float = input_("1", "encoder_count at the newest one-turn pulse", discrete=True)
    z_position: float = input_("m", "Detected Z position", display="mm")
    x_position: float = input_("m", "Detected X position, radius", display="mm")

    spindle_speed_command: float = output("rad/s", "Commanded spindle speed", display="rpm", discrete=True)
    z_command: float = output("m", "Commanded Z position", display="mm", discrete=True)
    x_command: float = output("m", "Commanded X position, radius", display="mm", discrete=True)
    threading: bool = output("1", "The feed is in step with the spindle", start=False)
    pass_number: int = output("1", "Number of the pass, from 1", start=0, min=0, max=10000, discrete=True)
    start_number: int = output("1", "Number of the start that is cut, from 1", start=1, min=1, max=100, discrete=True)
    cut_depth: float = output("m", "Depth of this pass, radius", display="mm", discrete=True)
    start_angle: float = output("rad", "Spindle angle from the one-turn pulse at which this start begins",
                                display="deg", discrete=True)
    phase: int = output("1", "0 approach, 1 wait for speed, 2 wait for the one-turn pulse, 3 wait for the start "
                             "position, 4 threading, 5 stop, 6 retract, 7 return, 8 done", start=0, min=0, max=8,
                        discrete=True)
    counter: float = output("1", "Content of the counter; 0 before its reset by the one-turn pulse", discrete=True)
    gate: bool = output("1", "The gate to the pulse distribution is open", start=False)
    spindle_speed: float = output("rad/s", "Spindle speed from the detector", display="rpm", discrete=True)

    lead: float = parameter("m", "Lead of the thread: movement per turn", start=0.0015, display="mm", min=1e-6, max=0.5)
    starts: int = parameter("1", "Starts of the thread; pitch = lead / starts", start=1, min=1, max=100)
    start: int = parameter("1", "Number of the start to cut, from 1", start=1, min=1, max=100)
    first_start_angle: float = parameter("rad", "Spindle angle of the first start from the one-turn pulse (Q)",
                                         start=0.0, display="deg", min=0.0, max=6.283185307179587)
    z_start: float = parameter("m", "Z where the feed starts", start=0.006, display="mm", min=-100.0, max=100.0)
    z_end: float = parameter("m", "Z where the thread ends", start=-0.030, display="mm", min=-100.0, max=100.0)
    z_face: float = parameter("m", "Z of the workpiece's face, where the metal begins", start=0.0, display="mm",
                              min=-100.0, max=100.0)
    x_clear: float = parameter("m", "X clear of the workpiece, radius", start=0.012, display="mm",
                               min=-100.0, max=100.0)
    x_thread: float = parameter("m", "X of the pass, radius", start=0.0097, display="mm", min=-100.0, max=100.0)
    x_surface: float = parameter("m", "X of the workpiece's surface, radius", start=0.010, display="mm",
                                 min=-100.0, max=100.0)
    commanded_speed: float = parameter("rad/s", "Spindle speed for threading (S)", start=52.35987755982989,
                                       display="rpm", min=1e-3, max=5000.0)
    speed_tolerance: float = parameter("1", "Largest deviation of a speed that counts as reached", start=0.02,
                                       display="%", min=1e-6, max=1.0)
    speed_settling: float = parameter("s", "Time for which the speed must have been reached", start=0.05,
                                      display="ms", min=0.0)
    speed_window: int = parameter("1", "Periods over which the speed is measured", start=16, min=1, max=64)
    detector: int = parameter("1", "Detector of the spindle's angle", start=PULSE_GENERATOR, choices={
        "absolute": 0, "pulse_generator": 1})
    counts_per_turn: float = parameter("1", "Pulses NP per turn of the pulse generator", start=4096.0, min=1.0,
                                       max=1073741824.0)
    counter_overflow: bool = parameter("1", "The counter overflows at one turn's count and starts again", start=False)
    start_mode: int = parameter("1", "Acceleration at the start", start=CATCH_UP, choices={
        "exponential": 0, "catch_up": 1})
    start_time_constant: float = parameter("s", "Time constant T1 of the exponential start", start=0.03333333333333333,
                                           display="ms", min=1e-5, max=10.0)
    acceleration_limit: float = parameter("m/s2", "Largest commanded acceleration", start=2.0, min=1e-3, max=1e6)
    rapid_speed: float = parameter("m/s", "Rapid traverse", start=0.25, display="m/min", min=1e-6, max=10.0)
    command_age: float = parameter("s", "Sum Td of all ages from the spindle to the commanded feed", start=0.0,
                                   display="ms", min=-1.0, max=1.0)
    age_compensation: bool = parameter("1", "Compensate command_age by the measured speed", start=True)
    period: float = parameter("s", "Control period", start=1e-3, display="us", min=1e-5, max=0.1)
    in_position: float = parameter("m", "Distance from z_end at which the exponential stop is over", start=1e-6,
                                   display="um", min=1e-12)

    next_instant: float = state("1", "Number k of the next instant k * period, -1 before the first step", start=-1.0,
                                discrete=True)
    former_angle: float = state("rad", "Angle at the former communication point", display="deg", discrete=True)
    former_count: float = state("1", "encoder_count at the former communication point", discrete=True)
    history: list[float] = state("rad", "Angles at the latest instants, a ring", display="deg", size=65, discrete=True)
    history_filled: int = state("1", "Angles in the ring", start=0, min=0, max=65, discrete=True)
    history_next: int = state("1", "Place of the next angle in the ring", start=0, min=0, max=64, discrete=True)
    settled: float = state("s", "Time for which the speed has been reached", discrete=True)
    seen_index: int = state("1", "index_count when the wait for it began", start=0, min=0, max=2147483647,
                            discrete=True)
    zero_angle: float = state("rad", "Detected angle at the one-turn pulse that reset the counter", display="deg",
                              discrete=True)
    start_position: float = state("rad", "Angle since the counter's reset at which the gate opens", display="deg",
                                  discrete=True)
    former_target: float = state("m", "Movement on the line at the former instant", display="mm", discrete=True)
    z_velocity: float = state("m/s", "Commanded velocity of the latest period", display="mm/s", discrete=True)
    x_velocity: float = state("m/s", "Commanded X velocity of the latest period", display="mm/s", discrete=True)
    on_line: bool = state("1", "The command has caught up with the line", start=False)

    def check(self) -> int:
        """0, or which parameters make no thread."""
        if self.z_end == self.z_start:
            return 1
        if self.start > self.starts:
            return 2
        return 0

    def initialize(self) -> None:
        """At the detected position, spindle commanded to speed."""
        self.z_command = self.z_position
        self.x_command = self.x_position
        self.spindle_speed_command = self.commanded_speed
        self.spindle_speed = 0.0
        self.threading = False
        self.gate = False
        self.phase = APPROACH
        self.pass_number = 0
        self.start_number = self.start
        self.cut_depth = 0.0
        self.start_angle = self._start_angle()
        self.counter = 0.0
        self.next_instant = -1.0
        self.former_angle = self.spindle_angle
        self.former_count = self.encoder_count
        self.history_filled = 0
        self.history_next = 0
        self.settled = 0.0
        self.seen_index = self.index_count
        self.zero_angle = 0.0
        self.start_position = 0.0
        self.former_target = 0.0
        self.z_velocity = 0.0
        self.x_velocity = 0.0
        self.on_line = False

    def step(self, time: float, step_size: float) -> int:
        """The control instants in (time, time + step_size], with the inputs on the line between the two."""
        end = time + step_size
        if self.next_instant < 0.0:
            self.next_instant = 1.0 * floor(time / self.period + SAME_INSTANT) + 1.0
        if end - self.next_instant * self.period > PERIODS_A_STEP * self.period:
            return 3
        while self.next_instant * self.period <= end + SAME_INSTANT * self.period:
            share = min(1.0, (self.next_instant * self.period - time) / step_size)
            self._control(self._detected_angle(share))
            self.next_instant = self.next_instant + 1.0
        self.former_angle = self.spindle_angle
        self.former_count = self.encoder_count
        return 0

    def _start_angle(self) -> float:
        """first_start_angle + 2 pi (start - 1) / starts modulo a turn; of a pulse generator in whole counts."""
        angle = self.first_start_angle + TURN * (self.start - 1.0) / self.starts
        if self.detector == PULSE_GENERATOR:
            first = floor(self.first_start_angle / TURN * self.counts_per_turn + 0.5)
            displaced = floor((self.start - 1.0) * self.counts_per_turn / self.starts + 0.5)
            angle = (first + displaced) / self.counts_per_turn * TURN
        if angle >= TURN:
            angle = angle - TURN
        return angle

    def _detected_angle(self, share: float) -> float:
        """Angle at a share of the step; of a pulse generator whole counts, from where the counting began."""
        if self.detector == PULSE_GENERATOR:
            count = floor(self.former_count + (self.encoder_count - self.former_count) * share + SAME_INSTANT)
            return count / self.counts_per_turn * TURN
        return self.former_angle + (self.spindle_angle - self.former_angle) * share

    def _control(self, angle: float) -> None:
        """One control period."""
        self._measure_speed(angle)
        if self.phase >= WAIT_START and self.detector == PULSE_GENERATOR:
            self._count(angle)
        if self.phase == APPROACH:
            self._approach()
        elif self.phase == WAIT_SPEED:
            self._wait_speed()
        if self.phase == WAIT_INDEX:
            self._wait_index(angle)
        if self.phase == WAIT_START and angle - self.zero_angle >= self.start_position:
            self._open_gate()
        if self.phase == THREADING:
            self._thread(angle)
        elif self.phase == STOPPING:
            self._stop()
        elif self.phase == RETRACT:
            self._infeed(self.x_clear)
            if self._arrived(self.x_command, self.x_clear):
                self.phase = RETURN
        elif self.phase == RETURN:
            self._traverse(self.z_start)
            if self._arrived(self.z_command, self.z_start):
                self.phase = DONE

    def _measure_speed(self, angle: float) -> None:
        """omega = (phi(k) - phi(k - w)) / (w period), w = speed_window or what there is."""
        self.history[self.history_next] = angle
        span = min(self.history_filled, self.speed_window)
        if span > 0:
            old = self.history_next - span
            if old < 0:
                old = old + HISTORY
            self.spindle_speed = (angle - self.history[old]) / (span * self.period)
        self.history_next = self.history_next + 1
        if self.history_next == HISTORY:
            self.history_next = 0
        self.history_filled = min(HISTORY, self.history_filled + 1)

    def _count(self, angle: float) -> None:
        """The counter: pulses since its reset, with counter_overflow modulo one turn's count."""
        self.counter = 1.0 * floor((angle - self.zero_angle) / TURN * self.counts_per_turn + 0.5)
        if self.counter_overflow:
            self.counter = self.counter - self.counts_per_turn * floor(self.counter / self.counts_per_turn)

    def _approach(self) -> None:
        """Rapid traverse to z_start at x_clear."""
        self._infeed(self.x_clear)
        self._traverse(self.z_start)
        if self._arrived(self.z_command, self.z_start) and self._arrived(self.x_command, self.x_clear):
            self.phase = WAIT_SPEED

    def _wait_speed(self) -> None:
        """Infeed; the spindle's speed must have been within its tolerance for speed_settling."""
        self._infeed(self.x_thread)
        if abs(self.spindle_speed - self.commanded_speed) <= self.speed_tolerance * self.commanded_speed:
            self.settled = self.settled + self.period
        else:
            self.settled = 0.0
        if self.settled >= self.speed_settling and self._arrived(self.x_command, self.x_thread):
            self.phase = WAIT_INDEX
            self.seen_index = self.index_count

    def _wait_index(self, angle: float) -> None:
        """The first one-turn pulse resets the counter, once; an absolute detector knows its next start position."""
        if self.detector == PULSE_GENERATOR:
            if self.index_count == self.seen_index:
                return
            self.zero_angle = self.index_latch / self.counts_per_turn * TURN
            self.start_position = self.start_angle
            self._count(angle)
        else:
            self.zero_angle = 0.0
            self.start_position = self.start_angle + TURN * (floor((angle - self.start_angle) / TURN) + 1.0)
        self.phase = WAIT_START

    def _open_gate(self) -> None:
        """Coincidence: from here on the pulses reach the distribution."""
        self.phase = THREADING
        self.gate = True
        self.threading = True
        self.pass_number = self.pass_number + 1
        self.cut_depth = self.x_surface - self.x_thread
        self.former_target = 0.0
        self.z_velocity = 0.0
        self.on_line = False

    def _direction(self) -> float:
        """+1 where the thread runs towards positive Z, else -1."""
        if self.z_end > self.z_start:
            return 1.0
        return -1.0

    def _thread(self, angle: float) -> None:
        """Movement on the line lead / 2 pi (phi + omega Td - phi_start), as start_mode reaches it, up to z_end."""
        turned = angle - self.zero_angle - self.start_position
        if self.age_compensation:
            turned = turned + self.spindle_speed * self.command_age
        target = self.lead / TURN * turned
        direction = self._direction()
        length = abs(self.z_end - self.z_start)
        moved = abs(self.z_command - self.z_start)
        if self.start_mode == EXPONENTIAL:
            velocity = self._lagged_velocity(moved, target)
            ends = target >= length
        else:
            velocity = self._catching_velocity(moved, target)
            ends = velocity > self._stopping_velocity(length - moved)
        self.former_target = target
        if ends:
            self._close_gate()
            self._stop()
        else:
            moved = moved + velocity * self.period
            if self.on_line:
                moved = target
            self.z_velocity = direction * velocity
            self.z_command = self.z_start + direction * moved

    def _lagged_velocity(self, moved: float, target: float) -> float:
        """First-order lag, exact for a target that moves on a line within the period.

        z(k) = target(k) - T1 v + (z(k-1) - target(k-1) + T1 v) exp(-period / T1)
        v = (target(k) - target(k-1)) / period
        """
        lag = self.start_time_constant * (target - self.former_target) / self.period
        decay = exp(-self.period / self.start_time_constant)
        wanted = (target - lag + (moved - self.former_target + lag) * decay - moved) / self.period
        return self._accelerated(self._direction() * self.z_velocity, wanted)

    def _catching_velocity(self, moved: float, target: float) -> float:
        """Time-optimal: the line's velocity and as much more as can still be taken away in time.

        The distance is closed by u, u - aT, u - 2aT, ... (``_stopping_velocity``); after the last of them the command
        is on the line and stays there.
        """
        line = (target - self.former_target) / self.period
        behind = self.former_target - moved
        closing = self._stopping_velocity(abs(behind))
        if behind < 0.0:
            closing = -closing
        wanted = line + closing
        if self.on_line:
            return wanted
        velocity = self._accelerated(self._direction() * self.z_velocity, wanted)
        # the first period holds a part of the line only: its velocity tells nothing of the acceleration to come
        change = self.acceleration_limit * self.period
        whole = self.former_target > 0.0 or self.lead / TURN * self.spindle_speed <= change
        if whole and velocity == wanted and abs(behind) <= change * self.period:
            self.on_line = True
        return velocity

    def _accelerated(self, velocity: float, wanted: float) -> float:
        """The wanted velocity as near as acceleration_limit lets it come within one period."""
        change = self.acceleration_limit * self.period
        return max(velocity - change, min(velocity + change, wanted))

    def _stopping_velocity(self, distance: float) -> float:
        """u with T (u + (u - aT) + (u - 2aT) + ...) = distance, the terms that are positive: k of them.

        k (k - 1) / 2 <= distance / (a T^2) <= k (k + 1) / 2,  u = distance / (k T) + a T (k - 1) / 2
        """
        change = self.acceleration_limit * self.period
        k = 1.0 + floor(min(MOST_PERIODS, 0.5 * (sqrt(1.0 + 8.0 * max(0.0, distance) / (change * self.period)) - 1.0)))
        return max(0.0, distance) / (k * self.period) + 0.5 * change * (k - 1.0)

    def _close_gate(self) -> None:
        """The thread is cut: the feed leaves the spindle's lead."""
        self.phase = STOPPING
        self.gate = False
        self.threading = False
        self.on_line = False

    def _stop(self) -> None:
        """Stop at z_end: at the acceleration limit, or, of the exponential start, with its time constant."""
        if self.start_mode == EXPONENTIAL:
            remaining = self.z_end - self.z_command
            share = 1.0 - exp(-self.period / self.start_time_constant)
            if abs(remaining) <= self.in_position:
                share = 1.0
            self.z_velocity = remaining * share / self.period
            self.z_command = self.z_command + remaining * share
        else:
            self._traverse(self.z_end)
        if self._arrived(self.z_command, self.z_end):
            self.z_velocity = 0.0
            self.phase = RETRACT

    def _arrived(self, command: float, goal: float) -> bool:
        """The command is on its goal, but for rounding."""
        return abs(goal - command) <= ROUNDING

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
        if self._arrived(self.z_command, goal):
            self.z_command = goal
            self.z_velocity = 0.0

    def _infeed(self, goal: float) -> None:
        """X at rapid traverse with limited acceleration, exactly onto the goal."""
        self.x_velocity = self._limited_velocity(goal - self.x_command, self.x_velocity)
        self.x_command = self.x_command + self.x_velocity * self.period
        if self._arrived(self.x_command, goal):
            self.x_command = goal
            self.x_velocity = 0.0
