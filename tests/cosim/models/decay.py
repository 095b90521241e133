"""A decay, as small as a model can be: what a master adds shows beside it."""

from dataclasses import dataclass

from threadpitch.fmu.variable import Experiment, output, parameter

EXPERIMENT = Experiment(stop_time=1.0, step_size=0.001)


@dataclass
class Decay:
    """x' = -k x by Euler's method."""

    x: float = output("m", "Position")
    rate: float = output("m/s", "Its derivative")

    k: float = parameter("1/s", "Rate constant", start=1.0)
    start_x: float = parameter("m", "Position at the start", start=1.0)

    def check(self) -> int:
        """Always content."""
        return 0

    def initialize(self) -> None:
        """Begin at the start position."""
        self.x = self.start_x
        self.rate = -self.k * self.x

    def step(self, time: float, step_size: float) -> int:
        """One step of Euler's method."""
        self.x = self.x + step_size * self.rate
        self.rate = -self.k * self.x
        return 0
