"""The first half of a two-mass oscillator, for the tests of the master's accuracy."""

from dataclasses import dataclass

from threadpitch.fmu.variable import Experiment, input_, output, parameter, state

EXPERIMENT = Experiment(stop_time=2.0, step_size=0.0025)
SUBSTEPS = 8  # of RK4 in a step: exact beside the errors of the coupling


@dataclass
class OscillatorFirst:
    """Mass 1 with its wall spring: m x1'' = -c x1 - d x1' + F.

    Before t = 0 both halves compute the whole oscillator, so that the history at t = 0 is exact.
    """

    force: float = input_("N", "Coupling force F on mass 1", derivatives=("force_rate", "force_curvature"))
    x1: float = output("m", "Position of mass 1", derivative="v1")
    v1: float = output("m/s", "Velocity of mass 1")

    start: list[float] = parameter("1", "x1, v1, x2, v2 at the start, SI", start=0.0, size=4)
    mass: float = parameter("kg", "Both masses", start=1.0, min=0.1)
    wall: float = parameter("N/m", "Wall springs c", start=10.0)
    wall_damping: float = parameter("N.s/m", "Wall dampers d", start=0.5)
    coupling: float = parameter("N/m", "Spring between the masses", start=30.0)
    coupling_damping: float = parameter("N.s/m", "Damper between the masses", start=1.0)

    force_rate: float = state("N/s", "F'")
    force_curvature: float = state("N/s2", "F''")
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
        self._publish()

    def step(self, time: float, step_size: float) -> int:
        """RK4 in substeps."""
        self.together = time + 0.5 * step_size < 0.0
        h = step_size / SUBSTEPS
        for n in range(SUBSTEPS):
            self._advance(n * h, h)
        self._publish()
        return 0

    def _publish(self) -> None:
        self.x1 = self.whole[0]
        self.v1 = self.whole[1]

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
        between = (self.coupling * (self.trial[2] - self.trial[0])
                   + self.coupling_damping * (self.trial[3] - self.trial[1]))
        force = between
        if not self.together:
            force = self.force + self.force_rate * tau + 0.5 * self.force_curvature * tau * tau
        self.rate[0] = self.trial[1]
        self.rate[1] = (force - self.wall * self.trial[0] - self.wall_damping * self.trial[1]) / self.mass
        self.rate[2] = self.trial[3]
        self.rate[3] = (-between - self.wall * self.trial[2] - self.wall_damping * self.trial[3]) / self.mass
