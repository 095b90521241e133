"""Where in the control a fluctuation of the nominal pitches comes from: the recording split turn by turn.

    P(n) - F = -dE(n) + start(n) + saturation(n) + following(n) + other(n)
    E' = F theta'/360 - E/lag                dE(n) = lag F dN(n)/60 where the speed changes slowly

E is by how much a feed that follows with the time constant lag = (1 - feedforward)/Kv + Td runs behind the spindle,
dN [rpm] the change of the speed in turn n. The lag is fitted, so that the formula is checked against the data.
``start`` is the transient after
the feed begins, falling exponentially; ``saturation`` what remains in turns in which the drive was at its torque
limit, and in the turn after; ``following`` what the following error's change -dE(n) has beyond these three; ``other``
what is neither: the command itself, quantisation, jitter. The parts of a turn add up to its deviation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from threadpitch.compiled import compiled
from threadpitch.judgement.verdict import JudgementError
from threadpitch.pitch import pitch_table
from threadpitch.trace import TURN, FloatArray, Trace
from threadpitch.units import from_si

SPEED, START, SATURATION, FOLLOWING, OTHER = "speed", "start", "saturation", "following", "other"
DECAYS = (0.3, 0.5, 0.8, 1.2, 2.0, 3.0, 5.0)  # turns in which the start's transient falls to 1/e
LAGS = np.geomspace(0.5e-3, 0.5, 61)  # s, that are tried
_FEWEST_TURNS = 5
_WIDTH = 1.96  # standard deviations of a 95 % interval
_SCALES = (0.9, 1.1)  # of the part that a lag predicts
_WORTH = 9.0  # square over the variance that a part must explain before it is believed (three sigma)
_NAMED = 0.1  # share from which a part is named
_LAG_AGREES = 0.15  # of the expected lag


@dataclass(frozen=True, eq=False)
class ControlTrace:
    """Recording of one pass, with what else is known sample by sample."""

    trace: Trace  # angle, position from the detectors, and the time, which is needed
    speed: FloatArray | None = None  # (samples,) rad/s; None = from angle and time
    following_error: FloatArray | None = None  # (samples,) m, command less position
    saturated: NDArray[np.bool_] | None = None  # (samples,) the drive is at its torque limit


@dataclass(frozen=True)
class ExpectedLag:
    """Of the drive's parameters: (1 - feedforward) / Kv + Td."""

    position_gain: float  # 1/s
    feedforward: float = 0.0
    delay: float = 0.0  # s, all sampling, interpolation and coupling delays

    @property
    def lag(self) -> float:
        """Seconds."""
        return (1.0 - self.feedforward) / self.position_gain + self.delay


@dataclass(frozen=True, eq=False)
class ControlParts:
    """The nominal pitches' deviations and their parts, turn by turn."""

    turns: FloatArray  # (turns,) number of each turn
    deviation: FloatArray  # (turns,) m, P(n) - F
    speed_change: FloatArray  # (turns,) rad/s in each turn
    speed: FloatArray  # (turns,) rad/s at the end of each turn
    parts: dict[str, FloatArray]  # (turns,) m by name; they add up to the deviation
    lag: float | None  # s, fitted; None where the speed explains nothing
    lag_interval: tuple[float, float] | None  # of 95 %
    expected_lag: float | None
    course: FloatArray  # (crossings,) rad/s, the speed where turn 1 begins, and at the end of every turn

    @property
    def shares(self) -> dict[str, float]:
        """part' deviation / |deviation|^2; they add up to 1. A part that works against the others is negative."""
        whole = float(self.deviation @ self.deviation)
        return {name: float(part @ self.deviation) / whole if whole > 0.0 else 0.0 for name, part in self.parts.items()}

    @property
    def lag_agrees(self) -> bool | None:
        """Whether the data follow the formula: the expected lag is in the interval, or nearly the fitted one."""
        if self.lag is None or self.lag_interval is None or self.expected_lag is None:
            return None
        near = abs(self.lag - self.expected_lag) <= _LAG_AGREES * self.expected_lag
        return near or self.lag_interval[0] <= self.expected_lag <= self.lag_interval[1]

    def sentences(self) -> tuple[str, ...]:
        """What happened and what to do about it, the largest part first."""
        shares = self.shares
        named = sorted((name for name in shares if shares[name] >= _NAMED), key=lambda name: -shares[name])
        return tuple(f"{100.0 * shares[name]:.0f} %: {_TEXTS[name](self)}" for name in named)


def control_parts(recording: ControlTrace, target: float, *, start_angle: float = 0.0,
                  expected: ExpectedLag | None = None, first_turn: int = 1) -> ControlParts:
    """Split the deviations of P(n) from ``target``, m, from turn ``first_turn`` on.

    Raises:
        JudgementError: the recording has no time, columns of other lengths, or too few turns.
        PitchError: the recording has less than one whole turn.
    """
    time = recording.trace.time
    if time is None:
        raise JudgementError(f"{recording.trace.whole()}: the control is split by the spindle's speed; give the time")
    columns = {"speed": recording.speed, "following error": recording.following_error,
               "saturation": recording.saturated}
    for name, column in columns.items():
        if column is not None and column.shape != time.shape:
            raise JudgementError(f"{name} has {column.size} samples and the recording {time.size}; give equal lengths")
    table = pitch_table(recording.trace, (start_angle,))
    whole = np.flatnonzero(~np.isnan(table.pitch[0]))
    known = whole[whole + 1 >= first_turn]
    if known.size < _FEWEST_TURNS:
        raise JudgementError(f"{recording.trace.whole()}: {known.size} whole turns; splitting the control needs "
                             f"{_FEWEST_TURNS}")
    bounds = start_angle + TURN * (table.turns_before + np.append(whole, whole[-1] + 1))  # (whole turns + 1,) rad
    rising, sense = np.maximum.accumulate(recording.trace.angle), _sense(table.crossings[0])
    course = _at(bounds, rising, recording.speed) if recording.speed is not None else _speed(bounds, rising, time)
    levels, speed = bounds[-known.size - 1:], course[-known.size - 1:]  # (turns + 1,)
    following = None if recording.following_error is None \
        else -sense * np.diff(_at(levels, rising, recording.following_error))
    saturated = np.zeros(known.size, dtype=np.bool_) if recording.saturated is None \
        else _touched(levels, rising, recording.saturated)
    deviation = np.asarray(table.pitch[0, known] - target)
    lagging = np.stack([-np.diff(_at(levels, rising, _lagging(rising, time, lag))) for lag in LAGS.tolist()])
    return _split(np.asarray(known + 1.0), deviation, speed,
                  _Columns(target / TURN * lagging, following, saturated, expected, course))


@dataclass(frozen=True, eq=False)
class _Columns:
    lagging: FloatArray  # (lags, turns) m, -dE(n) of the lags that are tried
    following: FloatArray | None  # (turns,) m
    saturated: NDArray[np.bool_]  # (turns,)
    expected: ExpectedLag | None
    course: FloatArray  # (crossings,) rad/s


def _split(turns: FloatArray, deviation: FloatArray, speed: FloatArray, columns: _Columns) -> ControlParts:
    change = np.diff(speed)
    lag, interval, moved, start = _fit(turns, deviation, columns)
    parts = {SPEED: moved, START: start}
    rest = deviation - parts[SPEED] - parts[START]
    parts[SATURATION] = np.where(columns.saturated, rest, 0.0)
    rest = rest - parts[SATURATION]
    if columns.following is None:
        parts[FOLLOWING] = np.zeros_like(deviation)
    else:
        parts[FOLLOWING] = np.where(columns.saturated, 0.0, _beyond(columns, moved, start))
    parts[OTHER] = rest - parts[FOLLOWING]
    return ControlParts(turns, deviation, change, speed[1:], parts, lag, interval,
                        None if columns.expected is None else columns.expected.lag, columns.course)


def _beyond(columns: _Columns, moved: FloatArray, start: FloatArray) -> FloatArray:
    """(turns,) m, the following error's change without what it shares with the speed's part and the start's.

    The command itself may run behind, as in an exponential start: the drive then follows with its own share of them.
    """
    assert columns.following is not None
    design = np.column_stack([one for one in (moved, start) if one.any()] or [np.zeros_like(moved)])
    free = ~columns.saturated
    sizes = np.asarray(np.linalg.lstsq(design[free], columns.following[free], rcond=None)[0], dtype=np.float64)
    return np.asarray(columns.following - design @ sizes)


def _fit(turns: FloatArray, deviation: FloatArray,
         columns: _Columns) -> tuple[float | None, tuple[float, float] | None, FloatArray, FloatArray]:
    """(lag, its interval, part of the speed, part of the start) by least squares over the turns not saturated."""
    free = ~columns.saturated
    none = np.zeros_like(deviation)
    if int(free.sum()) < _FEWEST_TURNS:
        return None, None, none, none
    transients = [np.exp(-(turns - turns[0]) / decay) for decay in DECAYS]
    best = _Fit(float(deviation[free] @ deviation[free]), None, (), np.zeros(0))
    for transient in (None, *transients):
        for lag, moved in ((None, None), *zip(LAGS.tolist(), columns.lagging, strict=True)):
            chosen = tuple(one for one in (moved, transient) if one is not None)
            best = min(best, _fitted(deviation, free, lag, chosen), key=lambda one: one.cost) if chosen else best
    if best.lag is None:
        start = none if not best.columns else best.sizes[0] * best.columns[0]
        return None, None, none, start
    start = best.sizes[1] * best.columns[1] if len(best.columns) == 2 else none
    design = np.column_stack(best.columns)[free]
    left = deviation[free] - design @ best.sizes
    variance = float(left @ left) / max(left.size - best.sizes.size, 1)
    wide = _WIDTH * math.sqrt(variance * float(np.linalg.pinv(design.T @ design)[0, 0])) * best.lag
    lag = best.lag * float(best.sizes[0])
    return lag, (lag - wide, lag + wide), best.sizes[0] * best.columns[0], start


@dataclass(frozen=True, eq=False)
class _Fit:
    cost: float
    lag: float | None
    columns: tuple[FloatArray, ...]  # (turns,) each
    sizes: FloatArray  # (columns,)


def _fitted(deviation: FloatArray, free: NDArray[np.bool_], lag: float | None,
            columns: tuple[FloatArray, ...]) -> _Fit:
    """Least squares; its cost is what it leaves, and per column what three standard deviations of it would take off."""
    design = np.column_stack(columns)[free]
    sizes = np.asarray(np.linalg.lstsq(design, deviation[free], rcond=None)[0], dtype=np.float64)
    left = deviation[free] - design @ sizes
    square = float(left @ left)
    if lag is not None and not _SCALES[0] <= sizes[0] <= _SCALES[1]:
        return _Fit(math.inf, lag, columns, sizes)  # another lag of those that are tried fits
    return _Fit(square * (1.0 + _WORTH * sizes.size / max(left.size - sizes.size, 1)), lag, columns, sizes)


@compiled(nogil=True)
def _lagging(rising: FloatArray, time: FloatArray, lag: float) -> FloatArray:
    """(samples,) rad by which what follows with this lag runs behind, exact for an angle that is linear in between."""
    behind = np.empty(rising.size)
    whole = time[-1] - time[0]
    behind[0] = lag * (rising[-1] - rising[0]) / whole if whole > 0.0 else 0.0
    for i in range(1, rising.size):
        step = time[i] - time[i - 1]
        if step > 0.0:
            kept = math.exp(-step / lag)
            behind[i] = kept * behind[i - 1] + (1.0 - kept) * lag * (rising[i] - rising[i - 1]) / step
        else:
            behind[i] = behind[i - 1] + rising[i] - rising[i - 1]
    return behind


def _at(levels: FloatArray, rising: FloatArray, values: FloatArray) -> FloatArray:
    """(crossings,) of a column where the angle crosses the levels."""
    return np.interp(levels, rising, values)


def _speed(levels: FloatArray, rising: FloatArray, time: FloatArray) -> FloatArray:
    """(crossings,) rad/s: the quarter of a turn on either side over the time that it took."""
    late = np.clip(levels + 0.125 * TURN, rising[0], rising[-1])
    early = np.clip(levels - 0.125 * TURN, rising[0], rising[-1])
    passed = np.interp(late, rising, time) - np.interp(early, rising, time)
    return np.asarray((late - early) / np.maximum(passed, 1e-12))


def _touched(levels: FloatArray, rising: FloatArray, saturated: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(turns,) whether the drive was at its limit in the turn, or in the one before."""
    bounds = np.searchsorted(rising, levels)
    here = np.array([bool(saturated[low:max(high, low + 1)].any()) for low, high in pairwise(bounds.tolist())])
    return np.asarray(here | np.append(False, here[:-1]))


def _sense(crossings: FloatArray) -> float:
    known = crossings[~np.isnan(crossings)]
    return -1.0 if known[-1] < known[0] else 1.0


def control_document(found: ControlParts) -> dict[str, object]:
    """As JSON, lengths in um, turn by turn."""
    lag = {"lag_ms": found.lag, "expected_lag_ms": found.expected_lag}
    return {
        "shares": {name: round(share, 6) for name, share in found.shares.items()},
        **{name: None if value is None else round(1e3 * value, 6) for name, value in lag.items()},
        "lag_interval_ms": None if found.lag_interval is None else [round(1e3 * one, 6) for one in found.lag_interval],
        "lag_agrees": found.lag_agrees,
        "turns": [int(turn) for turn in found.turns.tolist()],
        "speed_rpm": [round(from_si(value, "rpm"), 4) for value in found.speed.tolist()],
        "deviation_um": [round(from_si(value, "um"), 6) for value in found.deviation.tolist()],
        "parts_um": {name: [round(from_si(value, "um"), 6) for value in part.tolist()]
                     for name, part in found.parts.items()},
        "sentences": list(found.sentences()),
    }


def _of_speed(found: ControlParts) -> str:
    told = (f"the spindle's speed changes: it {_largest_change(found)}, and the feed follows "
            f"{1e3 * (found.lag or 0.0):.1f} ms late")
    if found.expected_lag is not None:
        word = "as expected" if found.lag_agrees else "not as expected"
        told += f", {word} ({1e3 * found.expected_lag:.1f} ms)"
    return f"{told}: raise Kv or the feedforward, or steady the spindle"


def _largest_change(found: ControlParts) -> str:
    """``drops by 30 rpm in turns 1 to 3, from 500 rpm``."""
    speed, before = found.course, found.course.size - 1 - found.turns.size  # turns before those that were split
    fall = np.maximum.accumulate(speed) - speed
    rise = speed - np.minimum.accumulate(speed)
    drops = fall.max() >= rise.max()
    last = int(np.argmax(fall if drops else rise))
    first = int((np.argmax if drops else np.argmin)(speed[:last + 1]))
    change = from_si(float(abs(speed[last] - speed[first])), "rpm")
    number = found.turns[0] - before
    turns = f"turn {number + first:g}" if last - first <= 1 else f"turns {number + first:g} to {number + last - 1:g}"
    entry = " at the entry" if first <= before <= last else ""
    return (f"{'drops' if drops else 'rises'} by {change:.3g} rpm{entry}, in {turns}, from "
            f"{from_si(float(speed[first]), 'rpm'):.4g} rpm")


def _of_start(found: ControlParts) -> str:
    return (f"the start's transient, {from_si(float(found.parts[START][0]), 'um'):.3g} um in turn {found.turns[0]:g}: "
            "lengthen the approach or raise the acceleration")


def _of_saturation(found: ControlParts) -> str:
    turns = found.turns[found.parts[SATURATION] != 0.0]
    return (f"the feed drive is at its torque limit up to turn {turns.max():g}: lower the speed or the load, or raise "
            "the limit")


def _of_following(found: ControlParts) -> str:
    worst = int(np.argmax(np.abs(found.parts[FOLLOWING])))
    return (f"the following error changes beyond what the speed does, by "
            f"{from_si(float(found.parts[FOLLOWING][worst]), 'um'):.3g} um in turn {found.turns[worst]:g}: look for "
            "load, friction or resonance; raise Kv or the stiffness of the velocity loop")


def _of_other(found: ControlParts) -> str:
    return "neither speed nor following error: look at the command, the detectors' counts and their jitter"


_TEXTS = {SPEED: _of_speed, START: _of_start, SATURATION: _of_saturation, FOLLOWING: _of_following, OTHER: _of_other}
