"""Two recorded signals, played back: what feeds FMUs that were published with their inputs."""

from dataclasses import dataclass
from math import floor

from threadpitch.fmu.variable import Experiment, output, parameter

EXPERIMENT = Experiment(stop_time=60.0, step_size=60.0)
ROWS = 400


@dataclass
class PlayedTable:
    """The row at the end of the step: number t / interval, the last one for ever."""

    first: float = output("1", "First signal")
    second: float = output("1", "Second signal")

    interval: float = parameter("s", "Time from row to row", start=60.0, min=1e-3)
    firsts: list[float] = parameter("1", "Rows of the first signal", start=0.0, size=400)
    seconds: list[float] = parameter("1", "Rows of the second signal", start=0.0, size=400)

    def check(self) -> int:
        """Always content."""
        return 0

    def initialize(self) -> None:
        """The first row."""
        self._play(0.0)

    def step(self, time: float, step_size: float) -> int:
        """The row at the end."""
        self._play(time + step_size)
        return 0

    def _play(self, time: float) -> None:
        row = floor(time / self.interval + 0.5)
        if row < 0:
            row = 0
        if row >= ROWS:
            row = ROWS - 1
        self.first = self.firsts[row]
        self.second = self.seconds[row]
