"""The spindle: motor, speed loop, and the detectors of its angle."""

from dataclasses import dataclass
from math import floor, pi, sqrt

from threadpitch.fmu.elementary import sin
from threadpitch.fmu.variable import Experiment, Terminal, input_, output, parameter, state

EXPERIMENT = Experiment(stop_time=2.0, step_size=1e-3)
TERMINALS = (
    Terminal("detector", {"angle": "encoder_angle", "count": "encoder_count", "index_count": "index_count",
                          "index_latch": "index_latch"}, "What the control sees of the spindle"),
    Terminal("shaft", {"angle": "angle", "speed": "speed", "torque": "load_torque"}, "Spindle nose"),
)
ERRORS = {
    1: "the spindle's speed or angle is no longer finite: choose a smaller internal_step or a lower speed_gain",
    2: "internal_step must not be longer than loop_period",
    3: "more than 100000 loop periods in one communication step: choose a smaller step size",
}
TURN = 2.0 * pi
PERIODS_A_STEP = 100000
RIPPLES = 4
IDEAL = 0
ENCODER = 1
HALL_ELEMENT = 2
ABSOLUTE_ENCODER = 3
SAME_INSTANT = 1e-6  # of a period: instants closer than this are one
RUNAWAY = 1e6  # rad/s, beyond any spindle


@dataclass
class SpindleDrive:
    """Spindle motor under a sampled speed loop, with the detector of the spindle's angle.

    theta' = omega
    J omega' = T + sum_i A_i sin(q_i theta + phi_i) - T_friction(omega) - T_load
    T = limit(Kp e + I),  I' = Ki e while T is not limited,  e = omega_command - omega,  sampled every loop_period
    |T| <= min(torque_limit, power_limit / |omega|)
    T_friction = T_c omega / sqrt(omega_0^2 + omega^2) + B omega,  omega_0 = friction_speed

    The plant is integrated by the classical Runge-Kutta method of order 4 in steps of at most internal_step.
    The detector sees theta_d = theta + e sin(theta + phi) (eccentricity) in N counts per turn; the one-turn pulse 1P
    falls on the count line nearest to index_angle, and encoder_angle is counted from there. missed_counts of them are
    lost in every turn, half a turn from the one-turn pulse, which itself comes where it belongs.
    """

    speed_command: float = input_("rad/s", "Commanded spindle speed", display="rpm")
    load_torque: float = input_("N.m", "Load torque of the cutting process, braking when positive",
                                derivatives=("load_torque_rate", "load_torque_curvature"))

    angle: float = output("rad", "True spindle angle, continuous, counted up in the turning direction", display="deg",
                           derivative="speed")
    speed: float = output("rad/s", "True spindle speed", display="rpm")
    torque: float = output("N.m", "Motor torque without its ripple")
    encoder_angle: float = output("rad", "Detected spindle angle, quantised, counted from the one-turn pulse",
                                  display="deg")
    encoder_count: float = output("1", "Counted pulses NP: from the start of the simulation, with an absolute encoder "
                                       "from the one-turn pulse", discrete=True)
    index_count: int = output("1", "One-turn pulses 1P since the start of the simulation", start=0,
                              min=0, max=2147483647, discrete=True)
    index_latch: float = output("1", "encoder_count at the newest one-turn pulse", discrete=True)

    inertia: float = parameter("kg.m2", "Inertia of motor, spindle, chuck and workpiece, at the spindle", start=0.15,
                               min=1e-6, nominal=0.1)
    torque_limit: float = parameter("N.m", "Largest motor torque", start=70.0, min=1e-3, nominal=100.0)
    power_limit: float = parameter("W", "Largest motor power", start=11e3, display="kW", min=1.0, nominal=1e4)
    friction_torque: float = parameter("N.m", "Coulomb friction of bearings and belt", start=2.0, min=0.0)
    viscous_friction: float = parameter("N.m.s/rad", "Viscous friction", start=0.02, min=0.0)
    friction_speed: float = parameter("rad/s", "Speed at which the Coulomb friction has 71 % of its value", start=0.1,
                                      min=1e-6)
    speed_gain: float = parameter("N.m.s/rad", "Proportional gain Kp of the speed loop", start=14.0, min=0.0)
    integral_gain: float = parameter("N.m/rad", "Integral gain Ki of the speed loop", start=260.0, min=0.0)
    loop_period: float = parameter("s", "Sampling period of the speed loop", start=5e-4, display="us", min=1e-5,
                                   max=0.1)
    internal_step: float = parameter("s", "Longest integration step", start=1e-4, display="us", min=1e-7, max=1e-2)
    ripple_amplitude: list[float] = parameter("N.m", "Torque ripple amplitudes A_i", start=0.0, size=4)
    ripple_order: list[float] = parameter("1", "Torque ripple orders q_i: periods per turn", start=1.0, min=0.0, size=4)
    ripple_phase: list[float] = parameter("rad", "Torque ripple phases phi_i", start=0.0, display="deg", size=4)
    initial_angle: float = parameter("rad", "Spindle angle at the start", start=0.0, display="deg")
    initial_speed: float = parameter("rad/s", "Spindle speed at the start", start=0.0, display="rpm")
    detector: int = parameter("1", "Detector of the spindle's angle", start=ENCODER, choices={
        "ideal": 0, "encoder": 1, "hall_element": 2, "absolute_encoder": 3})
    encoder_lines: int = parameter("1", "Lines of the incremental encoder; four counts a line", start=1024, min=1,
                                   max=5000000)
    absolute_counts: int = parameter("1", "Counts per turn of the absolute encoder", start=1048576, min=1,
                                     max=1073741824)
    hall_periods: int = parameter("1", "Periods per turn of the Hall element: teeth of its wheel", start=256, min=1,
                                  max=100000)
    hall_interpolation: int = parameter("1", "Counts that one period of the Hall signal is interpolated to", start=16,
                                        min=1, max=20000)
    hall_error: float = parameter("rad", "Amplitude of the Hall element's error, once per period", start=0.0,
                                  display="deg", min=0.0, max=0.1)
    eccentricity: float = parameter("rad", "Amplitude of the detector's error, once per turn", start=0.0, display="deg",
                                    min=0.0, max=0.5)
    eccentricity_phase: float = parameter("rad", "Phase of the detector's error", start=0.0, display="deg")
    missed_counts: int = parameter("1", "Counts that an encoder or a Hall element loses per turn; negative: too many",
                                   start=0, min=-100000, max=100000)
    index_angle: float = parameter("rad", "Detected angle at which the one-turn pulse fires", start=0.0, display="deg")

    load_torque_rate: float = state("N.m/s", "First time derivative of load_torque at the beginning of the step")
    load_torque_curvature: float = state("N.m/s2", "Second time derivative of load_torque at the beginning of the "
                                                   "step")
    elapsed: float = state("s", "Time since the beginning of the step")
    speed_integral: float = state("N.m", "Integral part I of the speed loop")
    torque_command: float = state("N.m", "Held output of the speed loop", discrete=True)
    next_sample: float = state("1", "Number k of the next instant k * loop_period of the speed loop, -1 before the "
                                    "first step", start=-1.0, discrete=True)
    counts_per_turn: float = state("1", "Counts of the detector per turn", start=4096.0, discrete=True)
    index_line: float = state("1", "Count line of the one-turn pulse", discrete=True)
    first_count: float = state("1", "Count line at which encoder_count is zero", discrete=True)
    index_turn: float = state("1", "Turns from the one-turn pulse's line that the detector has completed",
                              discrete=True)

    def check(self) -> int:
        """2 when the integration step is longer than the loop's period, otherwise 0."""
        if self.internal_step > self.loop_period:
            return 2
        return 0

    def initialize(self) -> None:
        """Spindle at initial_angle and initial_speed, speed loop at rest, counter as at power on."""
        self.angle = self.initial_angle
        self.speed = self.initial_speed
        self.torque_command = self._limited(self.viscous_friction * self.speed + self._friction(self.speed), self.speed)
        self.speed_integral = self.torque_command
        self.torque = self.torque_command
        self.next_sample = -1.0
        self.counts_per_turn = 4.0 * self.encoder_lines
        if self.detector == HALL_ELEMENT:
            self.counts_per_turn = 1.0 * self.hall_periods * self.hall_interpolation
        if self.detector == ABSOLUTE_ENCODER:
            self.counts_per_turn = 1.0 * self.absolute_counts
        self.index_line = 1.0 * floor(self.index_angle / TURN * self.counts_per_turn + 0.5)
        line = self._count_line()
        self.first_count = line
        if self.detector == ABSOLUTE_ENCODER:
            self.first_count = self.index_line
        self.first_count = self.first_count - self._lost(line)
        self.index_turn = 1.0 * floor((line - self.index_line) / self.counts_per_turn)
        self.index_count = 0
        self.index_latch = 0.0
        self._detect()

    def step(self, time: float, step_size: float) -> int:
        """From instant to instant of the speed loop: sample, then integrate the plant to the next one or the end."""
        if step_size > PERIODS_A_STEP * self.loop_period:
            return 3
        end = time + step_size
        near = SAME_INSTANT * self.loop_period
        if self.next_sample < 0.0:
            self.next_sample = -1.0 * floor(SAME_INSTANT - time / self.loop_period)
        now = time
        self.elapsed = 0.0
        while now < end - near:
            if self.next_sample * self.loop_period <= now + near:
                self._speed_loop()
                self.next_sample = self.next_sample + 1.0
            upto = end
            if self.next_sample * self.loop_period < end - near:
                upto = self.next_sample * self.loop_period
            if not self._integrate(upto - now):
                return 1
            now = upto
        self.torque = self.torque_command
        self._detect()
        return 0

    def _friction(self, speed: float) -> float:
        """T_c omega / sqrt(omega_0^2 + omega^2), omega_0 = friction_speed."""
        return self.friction_torque * speed / sqrt(self.friction_speed * self.friction_speed + speed * speed)

    def _limited(self, torque: float, speed: float) -> float:
        """The torque within +-min(torque_limit, power_limit / |omega|)."""
        limit = self.torque_limit
        if abs(speed) * limit > self.power_limit:
            limit = self.power_limit / abs(speed)
        return max(-limit, min(limit, torque))

    def _speed_loop(self) -> None:
        """PI controller; the integral stands still while the torque is limited and the error would drive it on."""
        error = self.speed_command - self.speed
        wanted = self.speed_gain * error + self.speed_integral
        self.torque_command = self._limited(wanted, self.speed)
        if wanted == self.torque_command or (wanted - self.torque_command) * error < 0.0:
            self.speed_integral = self.speed_integral + self.integral_gain * self.loop_period * error

    def _load_at(self, elapsed: float) -> float:
        """T_load as the importer extrapolates it inside the step."""
        return self.load_torque + elapsed * (self.load_torque_rate + 0.5 * elapsed * self.load_torque_curvature)

    def _torque(self, angle: float, speed: float, load: float) -> float:
        """J omega' = T + sum_i A_i sin(q_i theta + phi_i) - T_friction - T_load."""
        torque = self.torque_command - load - self._friction(speed) - self.viscous_friction * speed
        for i in range(RIPPLES):
            if self.ripple_amplitude[i] != 0.0:
                torque = torque + self.ripple_amplitude[i] * sin(self.ripple_order[i] * angle + self.ripple_phase[i])
        return torque

    def _integrate(self, interval: float) -> bool:
        """Runge-Kutta of order 4 in ceil(interval / internal_step) equal steps; False when the speed runs away."""
        count = -floor(SAME_INSTANT - interval / self.internal_step)
        h = interval / count
        half = 0.5 * h
        sixth = h / 6.0
        per_inertia = 1.0 / self.inertia  # a division takes a processor four times as long as a product
        for _ in range(count):
            angle = self.angle
            speed = self.speed
            middle = self._load_at(self.elapsed + half)
            a1 = per_inertia * self._torque(angle, speed, self._load_at(self.elapsed))
            v2 = speed + half * a1
            a2 = per_inertia * self._torque(angle + half * speed, v2, middle)
            v3 = speed + half * a2
            a3 = per_inertia * self._torque(angle + half * v2, v3, middle)
            v4 = speed + h * a3
            self.elapsed = self.elapsed + h
            a4 = per_inertia * self._torque(angle + h * v3, v4, self._load_at(self.elapsed))
            self.angle = angle + sixth * (speed + 2.0 * v2 + 2.0 * v3 + v4)
            self.speed = speed + sixth * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
            if not abs(self.speed) < RUNAWAY:
                return False
        return True

    def _detected_angle(self) -> float:
        """theta + e sin(theta + phi), and for the Hall element its error once per period."""
        seen = self.angle
        if self.eccentricity != 0.0 and self.detector != IDEAL:
            seen = seen + self.eccentricity * sin(self.angle + self.eccentricity_phase)
        if self.hall_error != 0.0 and self.detector == HALL_ELEMENT:
            seen = seen + self.hall_error * sin(self.hall_periods * self.angle)
        return seen

    def _count_line(self) -> float:
        """floor(theta_d N / 2 pi): the newest count line that the detector has passed."""
        return 1.0 * floor(self._detected_angle() / TURN * self.counts_per_turn)

    def _lost(self, line: float) -> float:
        """Counts lost up to a count line: missed_counts half a turn behind every one-turn pulse."""
        if self.missed_counts == 0 or self.detector == IDEAL or self.detector == ABSOLUTE_ENCODER:
            return 0.0
        return 1.0 * self.missed_counts * floor((line - self.index_line) / self.counts_per_turn + 0.5)

    def _detect(self) -> None:
        """Counter, one-turn pulse and latch from the detected angle."""
        line = self._count_line()
        counted = line - self._lost(line)
        self.encoder_count = counted - self.first_count
        self.encoder_angle = (counted - self.index_line) / self.counts_per_turn * TURN
        if self.detector == IDEAL:
            self.encoder_angle = self.angle - self.index_line / self.counts_per_turn * TURN
        turn = 1.0 * floor((line - self.index_line) / self.counts_per_turn)
        if turn > self.index_turn:
            passed = floor(turn - self.index_turn + 0.5)
            self.index_count = self.index_count + passed
            index = self.index_line + turn * self.counts_per_turn
            self.index_latch = index - self._lost(index) - self.first_count
            self.index_turn = turn
