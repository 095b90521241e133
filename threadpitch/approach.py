"""How much room a thread needs before and behind it, or how fast the spindle may turn: by formula and by simulation.

The start of the synchronised feed has an error that dies away. ``Start`` is the line of a lathe's control and drive:

    exponential   V e^(-t/T1)                    the lag T1 of the commanded velocity stays
    catch_up      the command accelerates at A until it is on the spindle's line again, then is exact

followed by the drive, a lag of first order with T2 = (1 - feedforward) / Kv. x(t) is the tool's movement, V = F S / 60:

    x(t) = V (t - T1 - T2) + z(t),   z -> 0;    pitch error of the turn from t on: z(t + 60/S) - z(t)

The approach is x at the time from which on every turn keeps within the limit. The Fanuc manual's own formula has T1
alone and the ratio a = dL/L of the momentary velocity: delta1 = V T1 (-ln a - 1 + a), delta2 = V T1.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from threadpitch import cosim, lathe
from threadpitch.cosim.values import Given

FloatArray = NDArray[np.float64]

FANUC_TIME_CONSTANT = 1.0 / 30.0  # s, T1 of the manual: delta2 = F S / 1800
EXPONENTIAL = 0  # controller.start_mode
_NAMES = {
    "lead": "controller.lead", "start_mode": "controller.start_mode", "speed": "controller.commanded_speed",
    "start_lag": "controller.start_time_constant", "acceleration": "controller.acceleration_limit",
    "gain": "z_drive.position_gain", "feedforward": "z_drive.feedforward", "axis_speed": "z_drive.speed_limit",
}
_POINTS = 20001  # of the search for the last bad turn
_SETTLED = 60.0  # time constants: e^-60 is nothing
SLOWEST = 2.0 * math.pi / 60.0  # rad/s: 1 rpm
_RESOLUTION = 0.01  # of a speed
_TURNS_KEPT = 4  # good turns that a simulation must show between start and stop
_RAPID = 0.1  # m/s, slower than any machine's rapid traverse


class ApproachError(ValueError):
    """The question has no answer: why, and how to mend it."""


@dataclass(frozen=True)
class Room:
    """Approach before the thread and run-out behind it, m."""

    approach: float
    run_out: float


@dataclass(frozen=True)
class Start:
    """A machine's start of the synchronised feed: lead F (m), spindle speed (rad/s), T1, T2 (s), A (m/s2).

    ``catches_up`` tells the two kinds of start apart; T1 is of the exponential one.
    """

    lead: float
    speed: float
    start_lag: float
    drive_lag: float
    acceleration: float
    catches_up: bool

    @property
    def feed(self) -> float:
        """V = F S / 60, m/s."""
        return self.lead * self.speed / (2.0 * math.pi)

    @property
    def turn(self) -> float:
        """60 / S, s."""
        return 2.0 * math.pi / self.speed

    @property
    def lag(self) -> float:
        """What stays between tool and line, s: T1 + T2, or T2 of a start that catches up."""
        return self.drive_lag if self.catches_up else self.start_lag + self.drive_lag

    @property
    def on_line(self) -> float:
        """When the command is on the line: (1 + sqrt 2) V / A, s; 0 of the exponential start."""
        return (1.0 + math.sqrt(2.0)) * self.feed / self.acceleration if self.catches_up else 0.0

    def error(self, time: FloatArray) -> FloatArray:
        """z(t), m: how far the tool is off the line that it will follow; (n,) -> (n,)."""
        return self._caught_up(time) if self.catches_up else self._lagged(time)

    def _lagged(self, time: FloatArray) -> FloatArray:
        """V (T1^2 e^(-t/T1) - T2^2 e^(-t/T2)) / (T1 - T2)."""
        one, two = self.start_lag, self.drive_lag
        if abs(one - two) < 1e-6 * one:
            two = one * (1.0 - 1e-6)  # the limit of equal lags, without dividing by zero
        slow = np.zeros_like(time) if two <= 0.0 else two * two * np.exp(-time / two)
        return np.asarray(self.feed * (one * one * np.exp(-time / one) - slow) / (one - two))

    def _caught_up(self, time: FloatArray) -> FloatArray:
        """z' = q,  q' = (w - q) / T2,  w the command's velocity less V: up at A to V + u, down at A to V.

        u = V / sqrt 2 makes the movement won equal to the movement lost.
        """
        lag = max(self.drive_lag, 1e-9)
        feed, rate = self.feed, self.acceleration
        peak = (feed + feed / math.sqrt(2.0)) / rate
        first = np.minimum(time, peak)
        error = feed * lag - feed * first + rate * (first * first / 2.0 - lag * first) + (
            rate * lag * lag * (1.0 - np.exp(-first / lag)))
        over = feed / math.sqrt(2.0)
        at_peak = over - rate * lag * (1.0 - math.exp(-peak / lag))
        second = np.clip(time - peak, 0.0, over / rate)
        rest = at_peak - over - rate * lag
        error += (over + rate * lag) * second - rate * second * second / 2.0
        error += rest * lag * (1.0 - np.exp(-second / lag))
        at_line = rate * lag + rest * math.exp(-over / rate / lag)
        third = np.clip(time - self.on_line, 0.0, None)
        return np.asarray(error + at_line * lag * (1.0 - np.exp(-third / lag)))

    def room(self, limit: float) -> Room:
        """Approach for a largest error ``limit`` (m) of the movement per turn, and run-out for the stop.

        Raises:
            ApproachError: the limit is not positive.
        """
        if not limit > 0.0:
            raise ApproachError("the pitch limit must be positive; give it like 5um")
        horizon = self.on_line + _SETTLED * max(self.lag, 1e-6)
        time = np.linspace(0.0, horizon, _POINTS)

        def excess(at: FloatArray) -> FloatArray:
            return np.abs(self.error(at + self.turn) - self.error(at)) - limit

        bad = np.flatnonzero(excess(time) > 0.0)
        moment = 0.0
        if bad.size:
            low, high = time[bad[-1]], time[min(bad[-1] + 1, time.size - 1)]
            moment = brentq(lambda at: float(excess(np.array([at]))[0]), low, high) if low < high else high
        moved = self.feed * (moment - self.lag) + float(self.error(np.array([moment]))[0])
        stop = self.feed * self.feed / (2.0 * self.acceleration) if self.catches_up else 0.0
        return Room(max(moved, 0.0), stop + self.feed * self.lag)


def fanuc_room(lead: float, speed: float, ratio: float, time_constant: float = FANUC_TIME_CONSTANT) -> Room:
    """delta1 = V T1 (-ln a - 1 + a), delta2 = V T1 of the Fanuc manual; lead m, speed rad/s, a = dL/L, T1 s.

    Raises:
        ApproachError: the ratio is not between 0 and 1.
    """
    if not 0.0 < ratio < 1.0:
        raise ApproachError(f"a pitch limit of {ratio:.3g} leads is none; give less than the lead, and more than 0")
    lag = lead * speed / (2.0 * math.pi) * time_constant
    return Room(lag * (-math.log(ratio) - 1.0 + ratio), lag)


def highest_speed(approach_at: Callable[[float], float], approach: float, most: float, least: float = SLOWEST) -> float:
    """The highest spindle speed (rad/s, ``least`` to ``most``) whose approach fits into the one that there is, to 1 %.

    Raises:
        ApproachError: there is none.
    """
    if approach_at(most) <= approach:
        return most
    if approach_at(least) > approach:
        raise ApproachError(f"an approach of {approach * 1e3:.4g} mm is too short for the pitch limit even at "
                            f"{least * 30.0 / math.pi:.3g} rpm; give more")
    low, high = least, most
    while high > low * (1.0 + _RESOLUTION):  # not by a root of the difference: a simulated approach has steps
        middle = math.sqrt(low * high)
        low, high = (middle, high) if approach_at(middle) <= approach else (low, middle)
    return low


@dataclass(frozen=True)
class Machine:
    """A simulated lathe with its parameters: what the formula takes from it, and simulations of it."""

    system: str
    parameters: Mapping[str, Given]
    flavor: str | None = None

    @functools.cached_property
    def start(self) -> Start:
        """The machine's numbers, as its FMUs know them after initialisation.

        Raises:
            cosim.CosimError: the system or a parameter is wrong.
            ApproachError: the system is no lathe.
        """
        values = self._values()
        return Start(
            lead=values["lead"], speed=values["speed"], start_lag=values["start_lag"],
            drive_lag=max(0.0, 1.0 - values["feedforward"]) / values["gain"],
            acceleration=values["acceleration"], catches_up=values["start_mode"] != EXPONENTIAL)

    @functools.cached_property
    def largest_speed(self) -> float:
        """The spindle speed at which the Z axis runs at its limit, rad/s."""
        return 2.0 * math.pi * self._values()["axis_speed"] / self.start.lead

    def at(self, speed: float) -> Machine:
        """The same machine at another spindle speed, rad/s."""
        return replace(self, parameters={**self.parameters, _NAMES["speed"]: speed})

    def start_at(self, speed: float) -> Start:
        """``start`` at another spindle speed, rad/s."""
        return replace(self.start, speed=speed)

    def simulated_room(self, limit: float) -> Room:
        """Approach and run-out as a simulation of the machine shows them, m: the first and the last place of a turn
        from which on, and up to which, every turn of the tool keeps within the limit.

        Raises:
            ApproachError: no turn in the middle of the thread keeps within the limit.
        """
        guess = self.start.room(limit)
        lead = self.start.lead
        begin = 2.0 * guess.approach + 4.0 * lead
        end = -(2.0 * guess.run_out + 2.0 * _TURNS_KEPT * lead)
        simulation = lathe.simulate(
            self.system, flavor=self.flavor, stop_time=self._duration(begin, end),
            parameters={**self.parameters, "controller.z_start": begin, "controller.z_end": end,
                        "z_drive.initial_position": begin, "spindle.initial_speed": self.start.speed})
        return _room_of(simulation, begin, end, limit)

    def _duration(self, begin: float, end: float) -> float:
        """Enough for the infeed, the wait for speed and pulse, and the thread, s."""
        needed = 1.0 + 2.0 * self.start.turn + (begin - end) / self.start.feed + (begin - end) / _RAPID
        return math.ceil(needed * 10.0) / 10.0

    @functools.cache  # noqa: B019 -- a machine is asked a few times and lives as long as the question
    def _values(self) -> dict[str, float]:
        flavor = lathe.choose_flavor(self.flavor)
        locate = functools.partial(lathe.locate_fmu, flavor)
        try:
            with cosim.read_system(lathe.find_system(self.system), locate=locate) as structure:
                step = structure.step_size or 1e-3
                result = cosim.simulate(structure, parameters=self.parameters, record=list(_NAMES.values()),
                                        start_time=0.0, stop_time=step, step_size=step)
        except cosim.SystemStructureError as error:
            missing = [name for name in _NAMES.values() if f"{name!r}" in str(error) and "to record" in str(error)]
            if missing:
                raise ApproachError(f"{self.system}: has no {missing[0]}; give a lathe such as "
                                    f"{lathe.DEFAULT_SYSTEM}") from None
            raise
        return {short: float(result[name][0]) for short, name in _NAMES.items()}

    def __hash__(self) -> int:
        return id(self)


def _room_of(simulation: lathe.Simulation, begin: float, end: float, limit: float) -> Room:
    """Approach and run-out of a simulated thread."""
    angle = simulation["spindle.angle"].astype(np.float64)
    moved = np.abs(simulation["z_drive.position"].astype(np.float64) - begin)
    threading = np.flatnonzero(simulation["controller.threading"])
    if not threading.size:
        raise ApproachError(f"the simulated machine does not thread; {simulation.why_no_turn()}")
    first = threading[0]
    last = first + int(np.argmax(moved[first:])) + 1  # where the tool is at the end: behind it is the way back
    angle, moved = angle[first:last], moved[first:last]
    turn = 2.0 * math.pi
    lead = float(simulation["nominal_pitch.pitch_target"][0])
    whole = angle + turn <= angle[-1]
    error = np.interp(angle[whole] + turn, angle, moved) - moved[whole] - lead  # of the turn that begins here
    length = abs(end - begin)
    middle = int(np.searchsorted(moved[whole], 0.5 * length))
    bad = np.abs(error) > limit
    before, behind = np.flatnonzero(bad[:middle]), np.flatnonzero(bad[middle:])
    approach = float(moved[before[-1] + 1]) if before.size else 0.0
    good = middle + int(behind[0]) - 1 if behind.size else error.size - 1
    reached = float(np.interp(angle[good] + turn, angle, moved))  # the end of the last good turn
    if reached - approach < _TURNS_KEPT * lead:
        around = slice(max(0, middle - error.size // 8), middle + error.size // 8)
        worst = float(np.max(np.abs(error[around])))
        raise ApproachError(f"the movement per turn errs by up to {worst * 1e6:.3g} um where the start is long over; "
                            "give a wider pitch limit, or a better machine with --set")
    return Room(approach, max(0.0, length - reached))
