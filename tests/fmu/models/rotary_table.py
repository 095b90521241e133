"""A driven rotary table: derivatives, a clock, terminals, and much of what C does otherwise than Python."""

from dataclasses import dataclass
from math import floor, pi

from threadpitch.fmu.elementary import cos, exp, log
from threadpitch.fmu.variable import Clock, Experiment, Terminal, input_, output, parameter, state

EXPERIMENT = Experiment(stop_time=2.0, step_size=0.01)
ERRORS = {1: 'the table turns "too fast" (100 % of \\ its limit): choose a lower speed'}
CLOCKS = (Clock("turn_clock", ticks="turns", element=1, description="A turn is complete"),)
TERMINALS = (
    Terminal("shaft", {"angle": "angle", "speed": "speed"}, "What the table's shaft does"),
    Terminal("command", {"speed": "speed_command", "hold": "hold"}),
)
TURN = 2.0 * pi
BACK = -2.5  # a negative constant, subtracted below
SLOTS = 4
FAST = True


def largest(values: list[float], count: int) -> float:
    """The largest of the first values."""
    found = values[0]
    for i in range(1, count):
        found = max(found, values[i])
    return found


def split(count: int, size: int) -> tuple[int, int]:
    """(count // size, count % size), rounded down."""
    return count // size, count % size


@dataclass
class RotaryTable:
    """Speed follows its command: omega' = (u - omega) / T, by substeps with u + u' tau + u''/2 tau^2."""

    speed_command: float = input_("rad/s", "Commanded speed u", display="rpm",
                                  derivatives=("command_rate", "command_bend"))
    other_command: float = input_("m", "A second command", derivatives=("other_rate",))
    hold: bool = input_("1", "Stand still", start=False)
    offset: int = input_("1", "Added to the counts", start=-7, min=-100, max=100)

    angle: float = output("rad", "Angle, continuous", display="deg", derivative="speed")
    speed: float = output("rad/s", "Speed omega", display="rpm", derivative="acceleration", depends_on=("hold",))
    turns: list[int] = output("1", "Turns so far, and turns of this step", start=0, size=2, min=-1000000, max=1000000)
    slots: list[float] = output("1", "Residues of the angle", size=4)
    greatest: float = output("1", "Largest residue")
    sector: int = output("1", "Sector of a turn", start=0, min=-1000000, max=1000000)
    row: int = output("1", "Row of sectors", start=0, min=-1000000, max=1000000)
    travel: float = output("m", "Follows the second command")
    fast: bool = output("1", "Faster than the limit", start=False)

    limit: float = parameter("rad/s", "Largest speed", start=5e3, display="rpm", min=1.0)
    time_constant: float = parameter("s", "Time constant T", start=0.05, display="ms", min=1e-4)
    substeps: int = parameter("1", "Integration steps in a step", start=5, min=1, max=100)
    slot: int = parameter("1", "Where the residue is kept; from 4 on outside the array", start=1, min=0, max=9)

    acceleration: float = state("rad/s2", "Acceleration")
    command_rate: float = state("rad/s2", "u'")
    command_bend: float = state("rad/s3", "u''")
    other_rate: float = state("m/s", "Rate of the second command")

    def check(self) -> int:
        """Always content."""
        return 0

    def initialize(self) -> None:
        """At rest."""
        self.angle = 0.0
        self.speed = 0.0
        self.acceleration = 0.0
        for i in range(2):
            self.turns[i] = 0
        self.travel = self.other_command

    def step(self, time: float, step_size: float) -> int:
        """Substeps, then the counts."""
        h = step_size / self.substeps
        for i in range(self.substeps):
            self._turn((i + 1) * h, h)
        self.travel = self.other_command + self.other_rate * step_size
        before = self.turns[0]
        self.turns[0] = floor(self.angle / TURN)
        self.turns[1] = abs(self.turns[0] - before)
        self._count()
        self.fast = FAST and (abs(self.speed) > self.limit or not abs(self.angle) < 1e6)
        if self.fast:
            return 1
        return 0

    def _turn(self, tau: float, h: float) -> None:
        command = self.speed_command + self.command_rate * tau + 0.5 * self.command_bend * tau * tau
        if self.hold:
            command = 0.0
        self.acceleration = (command - self.speed) / self.time_constant
        self.speed = self.speed + h * self.acceleration
        self.angle = self.angle + h * self.speed

    def _count(self) -> None:
        count = int(self.angle / 0.1) + self.offset
        row, sector = split(count, 12)
        self.row = min(row, 100000, 50000 + self.offset)
        self.sector = sector
        residue = self.angle - TURN * floor(self.angle / TURN) - BACK
        wave = cos(residue) * exp(-residue) + log(1.0 + residue)
        self.slots[self.slot] = residue if wave > 0.5 else min(wave, residue, 1.0, 2.0)
        for i in range(SLOTS - 1, 0, -1):
            if i != self.slot:
                self.slots[i] = 0.5 * (self.slots[i] + self.slots[i - 1]) - (self.slots[i] - wave)
        self.greatest = largest(self.slots, SLOTS)
