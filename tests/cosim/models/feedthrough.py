"""Two values passed on: what a master adds shows beside it."""

from dataclasses import dataclass

from threadpitch.fmu.variable import Experiment, input_, output

EXPERIMENT = Experiment(stop_time=1.0, step_size=0.001)


@dataclass
class Feedthrough:
    """The outputs are the inputs at the end of the step."""

    x_in: float = input_("m", "Position")
    rate_in: float = input_("m/s", "Its derivative")
    x: float = output("m", "Position", depends_on=("x_in",))
    rate: float = output("m/s", "Its derivative", depends_on=("rate_in",))

    def check(self) -> int:
        """Always content."""
        return 0

    def initialize(self) -> None:
        """Pass on."""
        self.x = self.x_in
        self.rate = self.rate_in

    def step(self, time: float, step_size: float) -> int:
        """Pass on."""
        self.x = self.x_in
        self.rate = self.rate_in
        return 0
