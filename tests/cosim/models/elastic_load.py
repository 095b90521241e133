"""An elastic load on a feed drive, for the tests of the master's accuracy."""

from dataclasses import dataclass

from threadpitch.fmu.variable import Experiment, input_, output, parameter, state

EXPERIMENT = Experiment(stop_time=0.1, step_size=0.001)
SUBSTEPS = 64  # of the midpoint rule in a step: exact beside the errors of the coupling


@dataclass
class ElasticLoad:
    """A spring behind a first-order lag: T F' = K (x - x0) - F."""

    position: float = input_("m", "Position of the drive", derivatives=("position_rate", "position_curvature"))
    force: float = output("N", "Force on the drive, against its movement")

    stiffness: float = parameter("N/m", "K", start=2e6)
    lag: float = parameter("s", "T", start=0.01, min=1e-6)
    rest: float = parameter("m", "x0", start=0.0)

    position_rate: float = state("m/s", "x'")
    position_curvature: float = state("m/s2", "x''")

    def check(self) -> int:
        """Always content."""
        return 0

    def initialize(self) -> None:
        """Without force."""
        self.force = 0.0

    def step(self, time: float, step_size: float) -> int:
        """The midpoint rule in substeps."""
        h = step_size / SUBSTEPS
        for n in range(SUBSTEPS):
            middle = self.force + 0.5 * h * self._rate(n * h, self.force)
            self.force = self.force + h * self._rate((n + 0.5) * h, middle)
        return 0

    def _rate(self, tau: float, force: float) -> float:
        position = self.position + self.position_rate * tau + 0.5 * self.position_curvature * tau * tau
        return (self.stiffness * (position - self.rest) - force) / self.lag
