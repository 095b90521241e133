"""The numerical control: threads from any spindle angle, in many passes and starts, feed in step with the spindle."""

from dataclasses import dataclass
from math import floor

from threadpitch.fmu.elementary import exp
from threadpitch.fmu.variable import Experiment, Terminal, input_, output, parameter, state

from ._axis_motion import EXPONENTIAL, arrived
from ._spindle_reading import PULSE_GENERATOR, SAME_INSTANT, TURN
from ._thread_readiness import (
    ALARMED,
    APPROACH,
    DONE,
    RETRACT,
    RETURN,
    STOPPING,
    THREADING,
    WAIT_INDEX,
    WAIT_SPEED,
    WAIT_START,
    ThreadReadiness,
)

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
    4: "a threading block has no lead that stays positive up to its end: mend its lead, lead change or length",
    5: "thread_height must be positive, and least_cut and allowance not larger than it",
    6: "the cycle has no pass, or more than 10000: mend first_cut, allowance or finishing_passes",
    7: "the flank infeed or the run-out is longer than the thread: start farther away or shorten the run-out",
}
PERIODS_A_STEP = 64


@dataclass
class ThreadingController(ThreadReadiness):
    """Threading cycles G32 to G76 from a designated spindle angle. SI units, x as radius.

    way = lead n + lead_change n^2 / 2,  n = (phi + omega command_age - phi_start) / 2 pi    phi: from the one-turn 1P
    depth n = max(dd sqrt(n), dd sqrt(n - 1) + dmin) up to k - d, then the finishing passes        (cycle multiple)
    z_start n = z_start + depth tan(a / 2) towards z_end,  x = x_thread + (k - depth) outwards + taper

    Every pass: approach its start, infeed, wait for the spindle's speed and both axes in position, wait for the
    one-turn pulse (it resets the counter once), compare the counter with the start position, open the gate: from there
    on the pulses are distributed in the ratio lead / turn. Stop at the end of the last block, retract X, return Z; then
    the next pass or start. Threads across a face are fed in and left along Z (infeed_axis).

    Start position: round(k N / starts) counts for start k = 0, 1, ..., displaced by start_angle. It is found by a
    crossing test; what the spindle has turned past it goes into the first command. Blocks of a chain go on without
    waiting; with start_each_block each holds the gate until the count meets its own start position modulo a turn.
    The run-out leaves the thread over the last run_out_length while the long axis stays in step; the short axis takes
    its velocity at once, the lag of the drive rounds that corner.

    start_mode exponential filters the commanded movement by a first-order lag of start_time_constant whose lag of
    velocity * time constant stays; catch_up accelerates at acceleration_limit until the command is on the line again;
    s_shaped takes the mean of that over smoothing_periods, its age compensated. The limit holds along the long axis.

    Runs every period at absolute instants k * period; inputs between two communication points are interpolated.
    command_age is the sum Td of all ages between the spindle and the commanded feed (measuring, sampling, order of
    the co-simulation); with age_compensation the angle is extrapolated by it at the measured speed.

    surface_speed (G96) commands v / |x| in place of commanded_speed, in a taper as X moves. The spindle's angle counts
    up in the direction in which it cuts, M3 or M4: turning the other way cuts the mirror image, a left-hand thread.

    feed_hold stops the axes at once, but a thread only at the end of its last block. An alarm ends the threading, or
    the wait for it: the feed brakes, X retracts, and the machine stands.
    """

    feed_hold: bool = input_("1", "Feed hold", start=False)

    threading: bool = output("1", "The feed is in step with the spindle", start=False)
    phase: int = output("1", "0 approach, 1 wait for speed, 2 wait for the one-turn pulse, 3 wait for the start "
                             "position, 4 threading, 5 stop, 6 retract, 7 return, 8 done, 9 stopped by an alarm",
                        start=0, min=0, max=9, discrete=True)
    gate: bool = output("1", "The gate to the pulse distribution is open", start=False)
    coincidence: bool = output("1", "In this period the counter has met a start position", start=False)
    z_pulses: float = output("1", "Distribution pulses ZP of the latest period", discrete=True)
    x_pulses: float = output("1", "Distribution pulses XP of the latest period", discrete=True)
    holding: bool = output("1", "Standing by feed hold", start=False)

    pulse_weight: float = parameter("m", "Movement per distribution pulse", start=1e-6, display="um", min=1e-12,
                                    max=1e-3)
    command_age: float = parameter("s", "Sum Td of all ages from the spindle to the commanded feed", start=0.0,
                                   display="ms", min=-1.0, max=1.0)
    age_compensation: bool = parameter("1", "Compensate command_age by the measured speed", start=True)
    in_position: float = parameter("m", "Distance from the end at which the exponential stop is over", start=1e-6,
                                   display="um", min=1e-12)

    next_instant: float = state("1", "Number k of the next instant k * period, -1 before the first step", start=-1.0,
                                discrete=True)
    seen_index: int = state("1", "index_count when the wait for it began", start=0, min=0, max=2147483647,
                            discrete=True)
    start_position: float = state("rad", "Angle since the counter's reset at which the gate opens", display="deg",
                                  discrete=True)

    def check(self) -> int:
        """0, or which parameters make no thread."""
        return self._check_passes()

    def initialize(self) -> None:
        """At the detected position, spindle commanded to speed."""
        self._initialize_reading()
        self._initialize_motion()
        self._initialize_passes()
        self._initialize_readiness()
        self.threading = False
        self.phase = APPROACH
        self.gate = False
        self.coincidence = False
        self.z_pulses = 0.0
        self.x_pulses = 0.0
        self.holding = False
        self.next_instant = -1.0
        self.seen_index = self.index_count
        self.start_position = 0.0

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
        self._remember_reading()
        return 0

    def _control(self, angle: float) -> None:
        """One control period."""
        z = self.z_command
        x = self.x_command
        self.coincidence = False
        self._measure_speed(angle)
        self._command_speed(self._speed_radius(self.phase))
        if self.phase >= WAIT_START and self.detector == PULSE_GENERATOR:
            self._count(angle)
        self.holding = self.feed_hold and self.phase != THREADING and self.phase != STOPPING
        if self.holding:
            self._hold()
        else:
            self._proceed(angle)
        self.z_pulses = self._pulses(self.z_command) - self._pulses(z)
        self.x_pulses = self._pulses(self.x_command) - self._pulses(x)

    def _pulses(self, command: float) -> float:
        """Distribution pulses up to a commanded position."""
        return 1.0 * floor(command / self.pulse_weight + 0.5)

    def _hold(self) -> None:
        """Feed hold: the axes come to rest; a start position that passes meanwhile is waited for anew."""
        self._halt()
        self.seen_index = self.index_count
        if self.phase == WAIT_START:
            self.phase = WAIT_INDEX

    def _proceed(self, angle: float) -> None:
        """What the phase asks for; phases that take no time follow each other at once."""
        if self.phase == APPROACH:
            self._approach()
        elif self.phase == WAIT_SPEED:
            self._wait_speed()
        if self.phase == WAIT_INDEX:
            self._wait_index(angle)
        if self.phase == WAIT_START and angle - self.zero_angle >= self.start_position:
            self._open_gate()
        if self.phase >= WAIT_SPEED and self.phase <= THREADING:
            self._watch()
        if self.phase == THREADING:
            self._thread(angle - self.zero_angle)
        elif self.phase == STOPPING:
            self._stop()
        elif self.phase == RETRACT:
            self._retract()
        elif self.phase == RETURN:
            self._return()

    def _approach(self) -> None:
        """Rapid traverse to the start of the pass, clear of the workpiece."""
        if self._approach_start():
            self.phase = WAIT_SPEED
            self.waited = 0.0

    def _wait_speed(self) -> None:
        """Infeed; then both axes have to be in position, and the speed reached for speed_settling, as it still is
        before later passes.
        """
        there = self._feed_in()
        self._settle()
        if there and self._at_speed() and self._axes_in_position():
            self.phase = WAIT_INDEX
            self.waited = 0.0
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
        self.coincidence = True
        self.threading = True
        self.speed_at_start = self.spindle_speed
        self._begin_pass(self.start_position)

    def _watch(self) -> None:
        """An alarm ends the threading, or the wait for it."""
        if self.phase < THREADING:
            self._watch_waiting(self.phase)
        if self.phase > WAIT_SPEED:
            self._watch_spindle(self.phase)
        if self.alarm != 0:
            began = self.phase == THREADING
            self._close_gate()
            if not began:
                self.phase = RETRACT

    def _thread(self, angle: float) -> None:
        """The way that the spindle asks for, as start_mode reaches it, up to the end of the last block."""
        turned = angle
        if self.age_compensation:
            turned = turned + self.spindle_speed * self.command_age
        turned = turned + self.spindle_speed * self._smoothing_age()
        block = self.block
        target = self._target(turned)
        opens = not self._waits(turned)
        met = (opens and not self.gate) or (block < self.block and (opens or not self.gate))
        self.coincidence = self.coincidence or met
        self.gate = opens
        end = self.chain_way[self.block]
        if not opens:
            end = self.chain_way[self.block - 1]
        last = opens and self.block > self.further_blocks
        if self.start_mode == EXPONENTIAL:
            velocity = self._lagged_velocity(target)
            ends = last and target >= end
        else:
            k = self.block - 1
            line_velocity = self._block_lead(k) / TURN * self.spindle_speed
            velocity = self._catching_velocity(target, self.chain_way[k], line_velocity)
            limit = self._stopping_velocity(end - self.travel)
            ends = last and velocity > limit
            if velocity > limit and (not opens or self._stop_ahead()):
                velocity = limit
                self.on_line = False
        self.former_target = target
        if ends:
            self._close_gate()
            self._stop()
            return
        self.travel = self.travel + velocity * self.period
        if self.on_line:
            self.travel = target
        self.travel_velocity = velocity
        way = self._smooth()
        self._place(way)

    def _close_gate(self) -> None:
        """The thread is cut, or an alarm ends it: the feed leaves the spindle's lead."""
        self.phase = STOPPING
        self.gate = False
        self.threading = False
        self.on_line = False

    def _stop(self) -> None:
        """Stop at the end: at the acceleration limit, or, of the exponential start, with its time constant."""
        end = self._length()
        if self.alarm != 0:
            self.travel_velocity = self._accelerated(self.travel_velocity, 0.0)
            end = self.travel
        elif self.start_mode == EXPONENTIAL:
            share = 1.0 - exp(-self.period / self.start_time_constant)
            if abs(end - self.travel) <= self.in_position:
                share = 1.0
            self.travel_velocity = (end - self.travel) * share / self.period
        else:
            self.travel_velocity = self._limited_velocity(end - self.travel, self.travel_velocity)
        self.travel = self.travel + self.travel_velocity * self.period
        if arrived(self.travel, end):
            self.travel = end
        way = self._smooth()
        self._place(way)
        if arrived(way, end):
            self._place(end)
            self._rest()
            self.phase = RETRACT

    def _retract(self) -> None:
        """Out of the thread; after an alarm that is all."""
        if self._retract_clear():
            self.phase = RETURN
            if self.alarm != 0:
                self.phase = ALARMED

    def _return(self) -> None:
        """Back to where the passes start; the next pass, or done."""
        if self._return_to_start():
            self.phase = DONE
            if self._plan_next():
                self.phase = APPROACH
