"""The mechanics of a feed axis: motor, ball screw with its errors, table with friction."""

from dataclasses import dataclass
from math import floor, pi, sqrt

from threadpitch.fmu.elementary import sin
from threadpitch.fmu.variable import input_, output, parameter, state

TURN = 2.0 * pi
TABLE = 16
IDEAL = 0
BALL_SCREW = 1
LINEAR_MOTOR = 2
SAME_INSTANT = 1e-6  # of a period: instants closer than this are one
RUNAWAY = 1e4  # m/s, beyond any axis


@dataclass
class FeedMechanics:
    """J omega' = T - r F_axial - B omega,  m v' = F_axial - F_friction(v) - F_load,  T' = (T_command - T) / T_t."""

    load_force: float = input_("N", "Force of the cutting process against the positive direction",
                               derivatives=("load_force_rate", "load_force_curvature"))

    position: float = output("m", "True position of the tool", display="mm", derivative="velocity")
    velocity: float = output("m/s", "True velocity of the tool", display="mm/s")
    motor_angle: float = output("rad", "Motor angle theta'", display="deg", derivative="motor_speed")
    motor_force: float = output("N", "Motor force at the table, of a ball screw torque / r")

    drive_type: int = parameter("1", "Kind of drive", start=BALL_SCREW, choices={
        "ideal": 0, "ball_screw": 1, "linear_motor": 2})
    screw_lead: float = parameter("m", "Ball-screw lead", start=0.010, display="mm", min=1e-4, max=1.0)
    motor_inertia: float = parameter("kg.m2", "Inertia of motor, coupling and screw", start=3.6e-3, min=1e-7,
                                     nominal=1e-3)
    table_mass: float = parameter("kg", "Mass of table, slide and tool turret", start=300.0, min=1e-3, nominal=100.0)
    axial_stiffness: float = parameter("N/m", "Axial stiffness of screw, nut, bearing and mount in series",
                                       start=120e6, display="N/um", min=1e3, nominal=1e8)
    axial_damping: float = parameter("N.s/m", "Axial damping", start=17e3, min=0.0, nominal=1e4)
    motor_friction: float = parameter("N.m.s/rad", "Viscous friction B of motor and screw", start=0.022, min=0.0)
    coulomb_friction: float = parameter("N", "Coulomb friction F_c of the guide", start=150.0, min=0.0, nominal=100.0)
    static_friction: float = parameter("N", "Static friction F_s of the guide", start=200.0, min=0.0, nominal=100.0)
    stribeck_speed: float = parameter("m/s", "Stribeck speed v_s", start=5e-3, display="mm/s", min=1e-6)
    friction_speed: float = parameter("m/s", "Speed at which dry friction has 71 % of its value", start=5e-4,
                                      display="mm/s", min=1e-6)
    viscous_friction: float = parameter("N.s/m", "Viscous friction B_v of the guide", start=500.0, min=0.0)
    backlash: float = parameter("m", "Backlash between screw and table", start=0.0, display="um", min=0.0, max=1e-2)
    lead_slope: float = parameter("1", "Progressive screw error: growth of e per movement", start=0.0,
                                  display="um/(300 mm)", min=-0.01, max=0.01)
    lead_amplitude: float = parameter("m", "Amplitude of the periodic screw error", start=0.0, display="um", min=0.0,
                                      max=1e-3)
    lead_period: float = parameter("m", "Period of the periodic screw error", start=0.010, display="mm", min=1e-4)
    lead_phase: float = parameter("rad", "Phase of the periodic screw error at movement zero", start=0.0,
                                  display="deg")
    lead_table: list[float] = parameter("m", "Screw error at table_start + i * table_spacing, held outside",
                                        start=0.0, display="um", min=-0.01, max=0.01, size=16)
    table_start: float = parameter("m", "Position of the table's first point", start=-0.15, display="mm")
    table_spacing: float = parameter("m", "Distance of the table's points; 0 = no table", start=0.0, display="mm",
                                     min=0.0)
    thermal_expansion: float = parameter("1/K", "Thermal expansion of the screw", start=12e-6, display="um/m/K",
                                         min=0.0, max=1e-3)
    temperature_rise: float = parameter("K", "Temperature of the screw above the reference of 20 degrees Celsius",
                                        start=0.0, min=-50.0, max=100.0)
    fixed_bearing: float = parameter("m", "Position from which the screw grows", start=0.3, display="mm")
    torque_time_constant: float = parameter("s", "Time constant of the current loop", start=2e-4, display="us",
                                            min=1e-5, max=0.1)
    internal_step: float = parameter("s", "Longest integration step", start=2.5e-5, display="us", min=1e-7, max=1e-3)
    initial_position: float = parameter("m", "Position at the start, at rest", start=0.0, display="mm")

    motor_speed: float = state("rad/s", "Motor speed omega", display="rpm")
    load_force_rate: float = state("N/s", "First time derivative of load_force at the beginning of the step")
    load_force_curvature: float = state("N/s2", "Second time derivative of load_force at the beginning of the step")
    elapsed: float = state("s", "Time since the beginning of the step")
    force_command: float = state("N", "Held output of the velocity loop", discrete=True)

    def _initialize_mechanics(self) -> None:
        """At rest at initial_position, no force anywhere."""
        self.position = self.initial_position
        self.velocity = 0.0
        self.motor_speed = 0.0
        self.motor_force = 0.0
        # r theta + e(r theta) = x, by repetition: the error's slope is far below one
        screw = self.initial_position
        for _ in range(20):
            screw = self.initial_position - self._screw_error(screw)
        self.motor_angle = screw / self._radius()
        if self.drive_type != BALL_SCREW:
            self.motor_angle = 0.0
        self.force_command = 0.0

    def _radius(self) -> float:
        """r = screw_lead / 2 pi, movement per motor angle."""
        return self.screw_lead / TURN

    def _moved_mass(self) -> float:
        """M = m + J / r^2, the mass that the motor's force at the table accelerates."""
        radius = self._radius()
        if self.drive_type == BALL_SCREW:
            return self.table_mass + self.motor_inertia / (radius * radius)
        return self.table_mass

    def _screw_error(self, movement: float) -> float:
        """e(r theta): progressive, periodic, table, thermal growth."""
        error = self.lead_slope * movement
        error = error + self.thermal_expansion * self.temperature_rise * (movement - self.fixed_bearing)
        if self.lead_amplitude != 0.0:
            error = error + self.lead_amplitude * sin(TURN * movement / self.lead_period + self.lead_phase)
        if self.table_spacing > 0.0:
            place = (movement - self.table_start) / self.table_spacing
            place = max(0.0, min(TABLE - 1.0, place))
            i = floor(place)
            if i > TABLE - 2:
                i = TABLE - 2
            share = place - i
            error = error + (1.0 - share) * self.lead_table[i] + share * self.lead_table[i + 1]
        return error

    def _friction(self, velocity: float) -> float:
        """(F_c + (F_s - F_c) v_s^2 / (v_s^2 + v^2)) v / sqrt(v_0^2 + v^2) + B_v v."""
        square = velocity * velocity
        slow = self.stribeck_speed * self.stribeck_speed
        dry = self.coulomb_friction + (self.static_friction - self.coulomb_friction) * slow / (slow + square)
        return dry * velocity / sqrt(self.friction_speed * self.friction_speed + square) + (
            self.viscous_friction * velocity)

    def _axial_force(self, angle: float, speed: float, position: float, velocity: float) -> float:
        """K delta + D delta' of the screw, none inside the backlash."""
        radius = self._radius()
        screw = radius * angle
        delta = screw + self._screw_error(screw) - position
        half = 0.5 * self.backlash
        if delta > half:
            delta = delta - half
        elif delta < -half:
            delta = delta + half
        else:
            return 0.0
        return self.axial_stiffness * delta + self.axial_damping * (radius * speed - velocity)

    def _forces(self, angle: float, speed: float, position: float, velocity: float,
                force: float) -> tuple[float, float]:
        """(J omega', m v' + F_load) of the state (theta, omega, x, v, F); F is the motor's force at the table."""
        axial = force
        turning = 0.0
        if self.drive_type == BALL_SCREW:
            axial = self._axial_force(angle, speed, position, velocity)
            turning = self._radius() * (force - axial) - self.motor_friction * speed
        return turning, axial - self._friction(velocity)

    def _load_at(self, elapsed: float) -> float:
        """F_load as the importer extrapolates it inside the step."""
        return self.load_force + elapsed * (self.load_force_rate + 0.5 * elapsed * self.load_force_curvature)

    def _integrate(self, interval: float) -> bool:
        """Runge-Kutta of order 4 in ceil(interval / internal_step) equal steps; False when the motion runs away."""
        count = -floor(SAME_INSTANT - interval / self.internal_step)
        h = interval / count
        for _ in range(count):
            self._runge_kutta(h)
            self.elapsed = self.elapsed + h
            if not (abs(self.velocity) < RUNAWAY and abs(self.motor_speed * self._radius()) < RUNAWAY):
                return False
        return True

    def _runge_kutta(self, h: float) -> None:
        """One step of (theta, omega, x, v, F)."""
        a1 = self.motor_angle
        w1 = self.motor_speed
        x1 = self.position
        v1 = self.velocity
        f1 = self.motor_force
        # multiplied by, because a division takes a processor four times as long
        per_inertia = 1.0 / self.motor_inertia
        per_mass = 1.0 / self.table_mass
        rate = 1.0 / self.torque_time_constant
        half = 0.5 * h
        load2 = self._load_at(self.elapsed + half)

        torque, force = self._forces(a1, w1, x1, v1, f1)
        dw1 = per_inertia * torque
        dv1 = per_mass * (force - self._load_at(self.elapsed))
        df1 = rate * (self.force_command - f1)
        w2 = w1 + half * dw1
        v2 = v1 + half * dv1
        f2 = f1 + half * df1
        torque, force = self._forces(a1 + half * w1, w2, x1 + half * v1, v2, f2)
        dw2 = per_inertia * torque
        dv2 = per_mass * (force - load2)
        df2 = rate * (self.force_command - f2)
        w3 = w1 + half * dw2
        v3 = v1 + half * dv2
        f3 = f1 + half * df2
        torque, force = self._forces(a1 + half * w2, w3, x1 + half * v2, v3, f3)
        dw3 = per_inertia * torque
        dv3 = per_mass * (force - load2)
        df3 = rate * (self.force_command - f3)
        w4 = w1 + h * dw3
        v4 = v1 + h * dv3
        f4 = f1 + h * df3
        torque, force = self._forces(a1 + h * w3, w4, x1 + h * v3, v4, f4)
        dw4 = per_inertia * torque
        dv4 = per_mass * (force - self._load_at(self.elapsed + h))
        df4 = rate * (self.force_command - f4)

        sixth = h / 6.0
        self.motor_angle = a1 + sixth * (w1 + 2.0 * w2 + 2.0 * w3 + w4)
        self.motor_speed = w1 + sixth * (dw1 + 2.0 * dw2 + 2.0 * dw3 + dw4)
        self.position = x1 + sixth * (v1 + 2.0 * v2 + 2.0 * v3 + v4)
        self.velocity = v1 + sixth * (dv1 + 2.0 * dv2 + 2.0 * dv3 + dv4)
        self.motor_force = f1 + sixth * (df1 + 2.0 * df2 + 2.0 * df3 + df4)
