"""What a pass waits for before it cuts, the spindle's commanded speed, and the alarms."""

from dataclasses import dataclass

from threadpitch.fmu.variable import output, parameter, state

from ._spindle_reading import TURN
from ._thread_passes import ThreadPasses

APPROACH = 0
WAIT_SPEED = 1
WAIT_INDEX = 2
WAIT_START = 3
THREADING = 4
STOPPING = 5
RETRACT = 6
RETURN = 7
DONE = 8
ALARMED = 9
FLUCTUATION = 1
TOO_SLOW = 2
TOO_FAST = 3
NOT_AT_SPEED = 4
NOT_IN_POSITION = 5
NO_INDEX = 6
TURNS_TO_INDEX = 2.0  # a one-turn pulse comes within one turn
CENTRE = 1e-6  # m; nearer to the turning axis the surface speed asks for no higher spindle speed


@dataclass
class ThreadReadiness(ThreadPasses):
    """The spindle at its speed, the axes in position, the pulses of its detector; or an alarm."""

    spindle_speed_command: float = output("rad/s", "Commanded spindle speed", display="rpm", discrete=True)
    alarm: int = output("1", "0 none, 1 the spindle's speed varies too much, 2 the spindle is too slow, 3 lead * speed "
                             "is too fast for the axis, 4 the spindle does not reach its speed, 5 an axis does not "
                             "come into position, 6 no one-turn pulse", start=0, min=0, max=6, discrete=True)

    commanded_speed: float = parameter("rad/s", "Spindle speed for threading (S)", start=52.35987755982989,
                                       display="rpm", min=1e-3, max=5000.0)
    surface_speed: float = parameter("m/s", "Constant surface speed (G96 S) in place of it; 0 = off", start=0.0,
                                     display="m/min", min=0.0, max=1000.0)
    highest_speed: float = parameter("rad/s", "Highest spindle speed under constant surface speed (G50 S)",
                                     start=523.5987755982989, display="rpm", min=1e-3, max=5000.0)
    speed_tolerance: float = parameter("1", "Largest deviation of a speed that counts as reached", start=0.02,
                                       display="%", min=1e-6, max=1.0)
    speed_settling: float = parameter("s", "Time for which the speed must have been reached", start=0.05,
                                      display="ms", min=0.0)
    position_width: float = parameter("m", "Largest distance of an axis from where the thread starts that counts as in "
                                           "position; 0 = not asked", start=2e-5, display="um", min=0.0, max=0.01)
    longest_wait: float = parameter("s", "Longest wait for speed and position, and beyond two turns for the one-turn "
                                         "pulse; 0 = no end", start=10.0, min=0.0)
    fluctuation_limit: float = parameter("1", "Largest change of the speed during a pass (parameter 106); 0 = off",
                                         start=0.0, display="%", min=0.0, max=1.0)
    least_speed: float = parameter("rad/s", "Least spindle speed for threading; 0 = off", start=0.0, display="rpm",
                                   min=0.0, max=5000.0)
    feed_limit: float = parameter("m/s", "Largest lead * speed that the axis can do; 0 = off", start=0.0,
                                  display="m/min", min=0.0, max=10.0)

    settled: float = state("s", "Time for which the speed has been reached", discrete=True)
    waited: float = state("s", "Time for which this pass has waited for what it is waiting for", discrete=True)
    speed_at_start: float = state("rad/s", "Spindle speed when the gate opened", display="rpm", discrete=True)

    def _initialize_readiness(self) -> None:
        """Spindle commanded to speed, nothing reached yet."""
        self.alarm = 0
        self.settled = 0.0
        self.waited = 0.0
        self.speed_at_start = 0.0
        self._command_speed(self.x_command)

    def _command_speed(self, x: float) -> None:
        """commanded_speed, or of a constant surface speed v / |x| up to highest_speed."""
        self.spindle_speed_command = self.commanded_speed
        if self.surface_speed > 0.0:
            self.spindle_speed_command = min(self.highest_speed, self.surface_speed / max(CENTRE, abs(x)))

    def _speed_radius(self, phase: int) -> float:
        """X that the surface speed holds at: of the start while the pass waits for its speed, else where the tool is
        told to be.
        """
        if phase == WAIT_SPEED:
            return self.chain_x[0]
        return self.x_command

    def _settle(self) -> None:
        """The time for which the spindle has kept its speed."""
        off = abs(self.spindle_speed - self.spindle_speed_command)
        if off <= self.speed_tolerance * self.spindle_speed_command:
            self.settled = self.settled + self.period
        else:
            self.settled = 0.0

    def _at_speed(self) -> bool:
        """The spindle has its speed, and has kept it for long enough."""
        return self.settled > 0.0 and self.settled >= self.speed_settling

    def _axes_in_position(self) -> bool:
        """Both detected positions are near what is commanded."""
        if self.position_width <= 0.0:
            return True
        farthest = max(abs(self.z_position - self.z_command), abs(self.x_position - self.x_command))
        return farthest <= self.position_width

    def _watch_waiting(self, phase: int) -> None:
        """Alarms of a pass that waits for too long: which of the things does not come."""
        self.waited = self.waited + self.period
        longest = self.longest_wait
        if phase != WAIT_SPEED:
            longest = longest + TURNS_TO_INDEX * TURN / self.spindle_speed_command
        if self.longest_wait > 0.0 and self.waited > longest:
            near = abs(self.spindle_speed - self.spindle_speed_command) <= (
                self.speed_tolerance * self.spindle_speed_command)
            if not near:
                self.alarm = NOT_AT_SPEED
            elif phase == WAIT_SPEED:
                self.alarm = NOT_IN_POSITION
            else:
                self.alarm = NO_INDEX

    def _watch_spindle(self, phase: int) -> None:
        """Alarms: the speed varies or falls too low while threading, or is too high for an axis before it."""
        change = abs(self.spindle_speed - self.speed_at_start)
        if phase == THREADING:
            if self.fluctuation_limit > 0.0 and change > self.fluctuation_limit * self.speed_at_start:
                self.alarm = FLUCTUATION
            if self.spindle_speed < self.least_speed:
                self.alarm = TOO_SLOW
        elif self.feed_limit > 0.0 and self._largest_lead() / TURN * self.spindle_speed > self.feed_limit:
            self.alarm = TOO_FAST
