"""What the control knows of the spindle: its angle at the control's instants, speed, and the counter of pulses."""

from dataclasses import dataclass
from math import floor, pi

from threadpitch.fmu.variable import input_, output, parameter, state

TURN = 2.0 * pi
HISTORY = 65
SAME_INSTANT = 1e-6  # of a period: instants closer than this are one
ABSOLUTE = 0
PULSE_GENERATOR = 1


@dataclass
class SpindleReading:
    """Pulse generator with its counter, or an absolute detector; the speed over a window of control periods."""

    spindle_angle: float = input_("rad", "Detected spindle angle from the one-turn pulse, continuous", display="deg")
    encoder_count: float = input_("1", "Counted pulses NP of the pulse generator", discrete=True)
    index_count: int = input_("1", "One-turn pulses 1P so far", start=0, min=0, max=2147483647, discrete=True)
    index_latch: float = input_("1", "encoder_count at the newest one-turn pulse", discrete=True)

    counter: float = output("1", "Content of the counter; 0 before its reset by the one-turn pulse", discrete=True)
    spindle_speed: float = output("rad/s", "Spindle speed from the detector", display="rpm", discrete=True)
    rotation: float = output("rad", "Amount of rotation in the latest period, from the detector", display="deg",
                             discrete=True)

    detector: int = parameter("1", "Detector of the spindle's angle", start=PULSE_GENERATOR, choices={
        "absolute": 0, "pulse_generator": 1})
    counts_per_turn: float = parameter("1", "Pulses NP per turn of the pulse generator", start=4096.0, min=1.0,
                                       max=1073741824.0)
    counter_overflow: bool = parameter("1", "The counter overflows at one turn's count and starts again", start=False)
    speed_window: int = parameter("1", "Periods over which the speed is measured", start=16, min=1, max=64)
    period: float = parameter("s", "Control period", start=1e-3, display="us", min=1e-5, max=0.1)

    former_angle: float = state("rad", "Angle at the former communication point", display="deg", discrete=True)
    former_count: float = state("1", "encoder_count at the former communication point", discrete=True)
    history: list[float] = state("rad", "Angles at the latest instants, a ring", display="deg", size=65, discrete=True)
    history_filled: int = state("1", "Angles in the ring", start=0, min=0, max=65, discrete=True)
    history_next: int = state("1", "Place of the next angle in the ring", start=0, min=0, max=64, discrete=True)
    zero_angle: float = state("rad", "Detected angle at the one-turn pulse that reset the counter", display="deg",
                              discrete=True)

    def _initialize_reading(self) -> None:
        """Nothing measured yet."""
        self.counter = 0.0
        self.spindle_speed = 0.0
        self.rotation = 0.0
        self.former_angle = self.spindle_angle
        self.former_count = self.encoder_count
        self.history_filled = 0
        self.history_next = 0
        self.zero_angle = 0.0

    def _detected_angle(self, share: float) -> float:
        """Angle at a share of the step; of a pulse generator whole counts, from where the counting began."""
        if self.detector == PULSE_GENERATOR:
            count = floor(self.former_count + (self.encoder_count - self.former_count) * share + SAME_INSTANT)
            return count / self.counts_per_turn * TURN
        return self.former_angle + (self.spindle_angle - self.former_angle) * share

    def _remember_reading(self) -> None:
        """The end of this step is the beginning of the next."""
        self.former_angle = self.spindle_angle
        self.former_count = self.encoder_count

    def _measure_speed(self, angle: float) -> None:
        """omega = (phi(k) - phi(k - w)) / (w period), w = speed_window or what there is."""
        self.history[self.history_next] = angle
        if self.history_filled > 0:
            self.rotation = angle - self._angle_before(1)
            span = min(self.history_filled, self.speed_window)
            self.spindle_speed = (angle - self._angle_before(span)) / (span * self.period)
        self.history_next = self.history_next + 1
        if self.history_next == HISTORY:
            self.history_next = 0
        self.history_filled = min(HISTORY, self.history_filled + 1)

    def _angle_before(self, periods: int) -> float:
        """The angle that was read this many periods ago."""
        place = self.history_next - periods
        if place < 0:
            place = place + HISTORY
        return self.history[place]

    def _count(self, angle: float) -> None:
        """The counter: pulses since its reset, with counter_overflow modulo one turn's count."""
        self.counter = 1.0 * floor((angle - self.zero_angle) / TURN * self.counts_per_turn + 0.5)
        if self.counter_overflow:
            self.counter = self.counter - self.counts_per_turn * floor(self.counter / self.counts_per_turn)

    def _whole_counts(self, angle: float) -> float:
        """The angle as the control compares it: of a pulse generator in whole counts."""
        if self.detector == PULSE_GENERATOR:
            return floor(angle / TURN * self.counts_per_turn + 0.5) / self.counts_per_turn * TURN
        return angle
