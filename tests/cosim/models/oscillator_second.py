"""The second half of a two-mass oscillator, for the tests of the master's accuracy."""

from dataclasses import dataclass

from threadpitch.fmu.variable import Experiment, input_, output, parameter, state

EXPERIMENT = Experiment(stop_time=2.0, step_size=0.0025)
SUBSTEPS = 8  # of RK4 in a step: exact beside the errors of the coupling


@dataclass
class OscillatorSecond:
    """Mass 2 with its wall spring and the coupling: m x2'' = -c x2 - d x2' - F, F = K (x2 - x1) + D (x2' - x1').

    Before t = 0 both halves compute the whole oscillator, so that the history at t = 0 is exact.
    """

    x1: float = input_("m", "Position of mass 1", derivatives=("x1_rate", "x1_curvature"))
    v1: float = input_("m/s", "Velocity of mass 1", derivatives=("v1_rate", "v1_curvature"))
    force: float = output("N", "Coupling force F on mass 1", depends_on=("x1", "v1"))
    x2: float = output("m", "Position of mass 2", derivative="v2")
    v2: float = output("m/s", "Velocity of mass 2")

    start: list[float] = parameter("1", "x1, v1, x2, v2 at the start, SI", start=0.0, size=4)
    mass: float = parameter("kg", "Both masses", start=1.0, min=0.1)
    wall: float = parameter("N/m", "Wall springs c", start=10.0)
    wall_damping: float = parameter("N.s/m", "Wall dampers d", start=0.5)
    coupling: float = parameter("N/m", "Spring between the masses K", start=30.0)
    coupling_damping: float = parameter("N.s/m", "Damper between the masses D", start=1.0)

    x1_rate: float = state("m/s", "x1'")
    x1_curvature: float = state("m/s2", "x1''")
    v1_rate: float = state("m/s2", "v1'")
    v1_curvature: float = state("m/s3", "v1''")
    whole: list[float] = state("1", "x1, v1, x2, v2", size=4)
    rate: list[float] = state("1", "Their derivatives", size=4)
    trial: list[float] = state("1", "A point of the Runge-Kutta method", size=4)
    mean: list[float] = state("1", "The weighted derivatives of the method", size=4)
    together: bool = state("1", "Before t = 0", start=False, discrete=True)

    def check(self) -> int:
        """Always content."""
        return 0

    def initialize(self) -> None:
        """Begin at the start values."""
        for i in range(4):
            self.whole[i] = self.start[i]
        self._publish(0.0)

    def step(self, time: float, step_size: float) -> int:
        """RK4 in substeps."""
        self.together = time + 0.5 * step_size < 0.0
        h = step_size / SUBSTEPS
        for n in range(SUBSTEPS):
            self._advance(n * h, h)
        self._publish(step_size)
        return 0

    def _publish(self, tau: float) -> None:
        self.x2 = self.whole[2]
        self.v2 = self.whole[3]
        self.force = (self.coupling * (self.whole[2] - self._other_position(tau))
                      + self.coupling_damping * (self.whole[3] - self._other_velocity(tau)))
        if self.together:
            self.force = (self.coupling * (self.whole[2] - self.whole[0])
                          + self.coupling_damping * (self.whole[3] - self.whole[1]))

    def _other_position(self, tau: float) -> float:
        return self.x1 + self.x1_rate * tau + 0.5 * self.x1_curvature * tau * tau

    def _other_velocity(self, tau: float) -> float:
        return self.v1 + self.v1_rate * tau + 0.5 * self.v1_curvature * tau * tau

    def _advance(self, tau: float, h: float) -> None:
        for i in range(4):
            self.trial[i] = self.whole[i]
            self.mean[i] = 0.0
        for stage in range(4):
            weight = 1.0 / 3.0 if stage == 1 or stage == 2 else 1.0 / 6.0
            shift = h if stage == 3 else 0.5 * h
            if stage == 0:
                shift = 0.0
            self._differentiate(tau + shift)
            ahead = h if stage == 2 else 0.5 * h
            for i in range(4):
                self.mean[i] = self.mean[i] + weight * self.rate[i]
                self.trial[i] = self.whole[i] + ahead * self.rate[i]
        for i in range(4):
            self.whole[i] = self.whole[i] + h * self.mean[i]

    def _differentiate(self, tau: float) -> None:
        position = self.trial[0]
        velocity = self.trial[1]
        if not self.together:
            position = self._other_position(tau)
            velocity = self._other_velocity(tau)
        between = (self.coupling * (self.trial[2] - position)
                   + self.coupling_damping * (self.trial[3] - velocity))
        self.rate[0] = self.trial[1]
        self.rate[1] = (between - self.wall * self.trial[0] - self.wall_damping * self.trial[1]) / self.mass
        self.rate[2] = self.trial[3]
        self.rate[3] = (-between - self.wall * self.trial[2] - self.wall_damping * self.trial[3]) / self.mass
