"""The feed drive: ball screw or linear motor under cascaded position, velocity and torque control."""

from dataclasses import dataclass
from math import floor

from threadpitch.fmu.variable import Experiment, Terminal, input_, output, parameter, state

from ._feed_mechanics import BALL_SCREW, IDEAL, LINEAR_MOTOR, SAME_INSTANT, TURN, FeedMechanics

EXPERIMENT = Experiment(stop_time=2.0, step_size=1e-3)
TERMINALS = (
    Terminal("axis", {"command": "position_command", "measured_position": "measured_position"}, "The control's side"),
    Terminal("tool", {"position": "position", "velocity": "velocity", "force": "load_force"}, "The process's side"),
)
ERRORS = {
    1: "the drive's motion is no longer finite: choose a smaller internal_step or lower gains",
    2: "internal_step must not be longer than velocity_period",
    3: "position_period must be a whole multiple of velocity_period",
    4: "command_period must be a whole multiple of velocity_period",
    5: "a linear motor has no motor encoder: set detector to linear_scale",
    6: "more than 100000 velocity periods in one communication step: choose a smaller step size",
}
PERIODS_A_STEP = 100000
MOTOR_ENCODER = 1
LINEAR_SCALE = 2


@dataclass
class FeedDrive(FeedMechanics):
    """Feed axis: motor and screw, table, cascaded control, detector of the movement xi. SI units.

    J omega' = T - r F_axial - B omega                      motor and screw, r = screw_lead / 2 pi
    m v' = F_axial - F_friction(v) - F_load                 table; linear motor: F_axial is the motor's force
    F_axial = K delta + D delta',  delta = r theta + e(r theta) - x less half the backlash on either side
    T' = (T_command - T) / torque_time_constant             current loop
    F_friction = (F_c + (F_s - F_c) v_s^2 / (v_s^2 + v^2)) v / sqrt(v_0^2 + v^2) + B_v v,  v_0 = friction_speed
    v_command = Kv (c - xi) + feedforward c'                every position_period; c the fine-interpolated command
    F_command = M (Kp (e_v + I)),  I' = e_v / T_i           every velocity_period; e_v = v_command - v_motor

    The plant is integrated by the classical Runge-Kutta method of order 4 in steps of at most internal_step. With
    fine interpolation a new command is reached one command_period after it was read, on a straight line.
    The motor encoder's angle theta' is converted by the nominal screw lead: xi = theta' r; the screw's own errors
    are outside of what it sees. The linear scale sees x. An ideal drive follows the command exactly.
    """

    position_command: float = input_("m", "Commanded position", display="mm")

    measured_position: float = output("m", "Position xi from the detector", display="mm")
    following_error: float = output("m", "Fine-interpolated command less detected position", display="um")
    torque: float = output("N.m", "Motor torque; zero for a linear motor")

    detector: int = parameter("1", "Detector of the movement", start=MOTOR_ENCODER, choices={
        "motor_encoder": 1, "linear_scale": 2})
    encoder_counts: float = parameter("1", "Counts per motor turn; 0 = not quantised", start=1048576.0, min=0.0,
                                      max=4294967296.0)
    scale_resolution: float = parameter("m", "Resolution of the linear scale; 0 = not quantised", start=1e-8,
                                        display="um", min=0.0, max=1e-3)
    position_gain: float = parameter("1/s", "Position gain Kv", start=50.0, min=0.1, max=2000.0)
    feedforward: float = parameter("1", "Share of the commanded velocity fed forward", start=0.0, display="%",
                                   min=0.0, max=1.5)
    velocity_gain: float = parameter("1/s", "Gain Kp of the velocity loop, over the moved mass", start=500.0, min=0.1,
                                     max=20000.0)
    integral_time: float = parameter("s", "Integral time T_i of the velocity loop", start=0.02, display="ms",
                                     min=1e-4)
    torque_limit: float = parameter("N.m", "Largest motor torque of a ball-screw drive", start=20.0, min=1e-3)
    force_limit: float = parameter("N", "Largest force of a linear motor", start=6000.0, min=1e-3, nominal=1e3)
    speed_limit: float = parameter("m/s", "Largest commanded velocity", start=0.5, display="m/min", min=1e-6)
    velocity_period: float = parameter("s", "Sampling period of the velocity loop", start=1.25e-4, display="us",
                                       min=1e-5, max=0.1)
    position_period: float = parameter("s", "Sampling period of the position loop", start=2.5e-4, display="us",
                                       min=1e-5, max=0.1)
    command_period: float = parameter("s", "Period in which commands are read", start=1e-3, display="us", min=1e-5,
                                      max=0.1)
    fine_interpolation: bool = parameter("1", "Commands are interpolated in between", start=True)

    velocity_command: float = state("m/s", "Held output of the position loop", display="mm/s", discrete=True)
    velocity_integral: float = state("m/s", "Integral part I of the velocity loop", discrete=True)
    next_sample: float = state("1", "Number k of the next instant k * velocity_period, -1 before the first step",
                               start=-1.0, discrete=True)
    command_start: float = state("m", "Fine interpolation: where its line begins", display="mm", discrete=True)
    command_end: float = state("m", "Fine interpolation: where its line ends", display="mm", discrete=True)
    command_sample: float = state("1", "Number of the instant at which command_end was read", discrete=True)

    def check(self) -> int:
        """0, or which periods or kinds do not go together."""
        if self.internal_step > self.velocity_period:
            return 2
        if not self._whole(self.position_period / self.velocity_period):
            return 3
        if not self._whole(self.command_period / self.velocity_period):
            return 4
        if self.drive_type == LINEAR_MOTOR and self.detector == MOTOR_ENCODER:
            return 5
        return 0

    def initialize(self) -> None:
        """At rest at initial_position, no force anywhere, command there too."""
        self._initialize_mechanics()
        self.velocity_command = 0.0
        self.velocity_integral = 0.0
        self.next_sample = -1.0
        self.command_start = self._detected()
        self.command_end = self.command_start
        self.command_sample = 0.0
        self.measured_position = self.command_start
        self.following_error = 0.0
        self.torque = 0.0

    def step(self, time: float, step_size: float) -> int:
        """From instant to instant of the velocity loop: sample, then integrate the plant to the next one or the end."""
        if self.drive_type == IDEAL:
            self._follow(step_size)
            return 0
        if step_size > PERIODS_A_STEP * self.velocity_period:
            return 6
        end = time + step_size
        near = SAME_INSTANT * self.velocity_period
        if self.next_sample < 0.0:
            self.next_sample = -1.0 * floor(SAME_INSTANT - time / self.velocity_period)
        now = time
        self.elapsed = 0.0
        while now < end - near:
            if self.next_sample * self.velocity_period <= now + near:
                self._sample()
                self.next_sample = self.next_sample + 1.0
            upto = end
            if self.next_sample * self.velocity_period < end - near:
                upto = self.next_sample * self.velocity_period
            if not self._integrate(upto - now):
                return 1
            now = upto
        self.measured_position = self._detected()
        self.following_error = self._interpolated(end / self.velocity_period) - self.measured_position
        self.torque = 0.0
        if self.drive_type == BALL_SCREW:
            self.torque = self.motor_force * self._radius()
        return 0

    def _whole(self, ratio: float) -> bool:
        """Whether the ratio is a whole number from 1 on."""
        return ratio > 0.5 and abs(ratio - floor(ratio + 0.5)) < SAME_INSTANT

    def _follow(self, step_size: float) -> None:
        """x = xi = command, without any dynamics."""
        self.velocity = (self.position_command - self.position) / step_size
        self.position = self.position_command
        self.measured_position = self.position_command
        self.motor_angle = self.position / self._radius()

    def _detected(self) -> float:
        """xi: theta' r in whole counts, or the scale's reading in whole increments."""
        if self.detector == MOTOR_ENCODER and self.drive_type == BALL_SCREW:
            turns = self.motor_angle / TURN
            if self.encoder_counts >= 1.0:
                turns = floor(turns * self.encoder_counts) / self.encoder_counts
            return turns * self.screw_lead
        if self.scale_resolution > 0.0:
            return floor(self.position / self.scale_resolution) * self.scale_resolution
        return self.position

    def _motor_velocity(self) -> float:
        """What the velocity loop controls: r omega, of a linear motor v."""
        if self.drive_type == BALL_SCREW:
            return self.motor_speed * self._radius()
        return self.velocity

    def _interpolated(self, sample: float) -> float:
        """c: on the line from command_start to command_end, reached one command_period after it was read."""
        if not self.fine_interpolation:
            return self.command_end
        share = (sample - self.command_sample) * self.velocity_period / self.command_period
        share = max(0.0, min(1.0, share))
        return self.command_start + (self.command_end - self.command_start) * share

    def _sample(self) -> None:
        """The loops that are due at this instant: command, position, velocity."""
        k = self.next_sample
        command_ratio = floor(self.command_period / self.velocity_period + 0.5)
        position_ratio = floor(self.position_period / self.velocity_period + 0.5)
        if k - command_ratio * floor(k / command_ratio) == 0.0:
            self.command_start = self.command_end
            self.command_end = self.position_command
            self.command_sample = k
        if k - position_ratio * floor(k / position_ratio) == 0.0:
            self._position_loop(k)
        self._velocity_loop()

    def _position_loop(self, k: float) -> None:
        """v_command = Kv (c - xi) + feedforward c', within the speed limit."""
        slope = (self.command_end - self.command_start) / self.command_period
        wanted = self.position_gain * (self._interpolated(k) - self._detected()) + self.feedforward * slope
        self.velocity_command = max(-self.speed_limit, min(self.speed_limit, wanted))

    def _velocity_loop(self) -> None:
        """F = M Kp (e_v + I); the integral stands still while the force is limited and e_v would drive it on."""
        limit = self.force_limit
        if self.drive_type == BALL_SCREW:
            limit = self.torque_limit / self._radius()
        error = self.velocity_command - self._motor_velocity()
        wanted = self._moved_mass() * self.velocity_gain * (error + self.velocity_integral)
        self.force_command = max(-limit, min(limit, wanted))
        if wanted == self.force_command or (wanted - self.force_command) * error < 0.0:
            self.velocity_integral = self.velocity_integral + self.velocity_period / self.integral_time * error
