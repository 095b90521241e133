"""A mass on a spring with every kind of variable that a declaration knows: the builder's test model."""

from dataclasses import dataclass
from math import floor, pi, sqrt

from threadpitch.fmu.elementary import sin
from threadpitch.fmu.variable import Experiment, input_, output, parameter, state

EXPERIMENT = Experiment(stop_time=1.0, step_size=0.01)
ERRORS = {
    1: "the mass left the guide: choose a stiffer spring",
    2: "weights must not all be zero: set one of them",
}
TURN = 2.0 * pi
WEIGHTS = 3
SPRING = 1
RUBBER = 2
LARGEST_COUNT = 2147483647


def series(first: float, second: float) -> float:
    """1 / (1/a + 1/b)."""
    return first * second / (first + second)


@dataclass
class DampedMass:
    """A mass < 2 kg & its "spring" on a moving base. SI units.

    m x'' = k (u - x) - d x' + F,  midpoint rule
    """

    base: float = input_("m", "Position u of the base", display="mm")
    forces: list[float] = input_("N", "Forces on the mass", size=3)
    locked: bool = input_("1", "The mass is held", start=False, discrete=True)
    kicks: int = input_("1", "Kicks so far", start=0, min=0, max=LARGEST_COUNT, discrete=True)

    position: float = output("m", "Position x of the mass", display="mm", nominal=1e-3)
    stretch: float = output("m", "Spring stretch u - x", display="mm", depends_on=("base",))
    moving: bool = output("1", "The mass moves", start=False, discrete=True)
    steps: int = output("1", "Steps done", start=0, min=0, max=LARGEST_COUNT, discrete=True)
    history: list[float] = output("m", "The last four positions, newest first", display="mm", size=4, discrete=True)
    seen: list[bool] = output("1", "Which places of the history are filled", start=False, size=4, discrete=True)

    mass: float = parameter("kg", "Mass", start=1.0, min=0.1, max=2.0)
    stiffness: float = parameter("N/m", "Stiffness k", start=400.0, display="N/um", min=1.0)
    damping: float = parameter("N.s/m", "Damping d", start=0.5, min=0.0)
    kind: int = parameter("1", "What carries the mass", start=SPRING, choices={"spring": 1, "rubber": 2})
    weights: list[float] = parameter("1", "Weights of the forces", start=1.0, min=0.0, max=10.0, size=3)
    substeps: int = parameter("1", "Integration steps in a step", start=4, min=1, max=1000)
    guided: bool = parameter("1", "Positions beyond 100 m are an error", start=True)
    temperature: float = parameter("K", "Temperature", start=293.15, display="degC", min=0.0)

    velocity: float = state("m/s", "Velocity of the mass")
    phase: list[float] = state("rad", "Phase of a ripple", display="deg", size=2)
    last_kicks: int = state("1", "Kicks that have been felt", start=0, min=0, max=LARGEST_COUNT, discrete=True)

    def check(self) -> int:
        """2 when no force counts."""
        total = 0.0
        for i in range(WEIGHTS):
            total = total + self.weights[i]
        if total == 0.0:
            return 2
        return 0

    def initialize(self) -> None:
        """At rest where the base is."""
        self.position = self.base
        self.velocity = 0.0
        self.stretch = 0.0
        self.moving = False
        self.steps = 0
        self.last_kicks = self.kicks
        for i in range(4):
            self.history[i] = self.base
            self.seen[i] = False
        self.phase[0] = 0.0
        self.phase[1] = 0.25 * pi

    def step(self, time: float, step_size: float) -> int:
        """Midpoint steps, then the history."""
        h = step_size / self.substeps
        for _ in range(self.substeps):
            self._move(h)
        if self.kicks > self.last_kicks:
            self.velocity = self.velocity + 0.1 * (self.kicks - self.last_kicks)
            self.last_kicks = self.kicks
        for i in range(3):
            self.history[3 - i] = self.history[2 - i]
            self.seen[3 - i] = self.seen[2 - i]
        self.history[0] = self.position
        self.seen[0] = True
        self.stretch = self.base - self.position
        self.moving = abs(self.velocity) > 1e-9
        self.steps = self.steps + 1
        if self.guided and abs(self.position) > 100.0:
            return 1
        return 0

    def _stiffness(self) -> float:
        if self.kind == RUBBER:
            return series(self.stiffness, 2.0 * self.stiffness) * sqrt(self.temperature / 293.15)
        return self.stiffness

    def _slopes(self, position: float, velocity: float) -> tuple[float, float]:
        """(x', v')."""
        force = self._stiffness() * (self.base - position) - self.damping * velocity
        for i in range(WEIGHTS):
            force = force + self.weights[i] * self.forces[i]
        return velocity, force / self.mass

    def _move(self, h: float) -> None:
        if self.locked:
            self.velocity = 0.0
            return
        dx, dv = self._slopes(self.position, self.velocity)
        ripple = 1e-3 * sin(self.phase[0] + self.phase[1])
        dx, dv = self._slopes(self.position + 0.5 * h * dx, self.velocity + 0.5 * h * dv)
        self.position = self.position + h * dx
        self.velocity = self.velocity + h * (dv + ripple)
        turned = self.phase[0] + 3.0 * h
        self.phase[0] = turned - floor(turned / TURN) * TURN
