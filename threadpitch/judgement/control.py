"""Where in the control a fluctuation of the nominal pitches comes from: the recording split turn by turn.

    P(n) - F = -dE(n) + start(n) + saturation(n) + following(n) + other(n)
    E' = F theta'/360 - E/lag                dE(n) = lag (F dN(n) + N dF(n))/60 where speed and lead change slowly

E is by how much a feed that follows with the time constant lag = (1 - feedforward)/Kv + Td runs behind the spindle,
dN [rpm] the change of the speed in turn n, dF that of a variable lead. The lag is fitted, so that the formula is
checked against the data; what it does at the mean speed is the lead's part, the rest the speed's.
``start`` is the transient after
the feed begins, falling exponentially; ``saturation`` what remains in turns in which the drive was at its torque
limit, and in the turn after; ``following`` what the following error's change -dE(n) has beyond these three; ``other``
what is neither: the command itself, quantisation, jitter. The parts of a turn add up to its deviation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from threadpitch.compiled import compiled
from threadpitch.judgement.control_found import FOLLOWING, LEAD, OTHER, SATURATION, SPEED, START, ControlParts
from threadpitch.judgement.verdict import JudgementError
from threadpitch.pitch import pitch_table
from threadpitch.trace import TURN, FloatArray, Trace

DECAYS = (0.3, 0.5, 0.8, 1.2, 2.0, 3.0, 5.0)  # turns in which the start's transient falls to 1/e
LAGS = np.geomspace(0.5e-3, 0.5, 61)  # s, that are tried
FEWEST_TURNS = 5
_WIDTH = 1.96  # standard deviations of a 95 % interval
_SCALES = (0.9, 1.1)  # of the part that a lag predicts
_SEEN = 0.05  # part of a start's transient that the turns must still show which it is fitted to
_WORTH = 9.0  # square over the variance that a part must explain before it is believed (three sigma)


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


@dataclass(frozen=True)
class Turns:
    """The turns of one start angle that are split."""

    start_angle: float = 0.0  # rad, in the recording: n = 1 begins at the first crossing of it
    first: int = 1


def control_parts(recording: ControlTrace, target: ArrayLike, *, start_angle: float = 0.0,
                  expected: ExpectedLag | None = None, first_turn: int = 1) -> ControlParts:
    """Split the deviations of P(n) from ``target``, m, or (turns,) m, from turn ``first_turn`` on.

    Raises:
        JudgementError: the recording has no time, columns of other lengths, or too few turns.
        PitchError: the recording has less than one whole turn.
    """
    return control_parts_of(recording, target, (Turns(start_angle, first_turn),), expected)[0]


def control_parts_of(recording: ControlTrace, target: ArrayLike, chosen: Sequence[Turns],
                     expected: ExpectedLag | None = None) -> tuple[ControlParts, ...]:
    """The same for several start angles; a target that changes is (turns,) m, or (start_angles, turns) m.

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
    rising = np.maximum.accumulate(recording.trace.angle)
    seen = [_seen(recording, rising, np.asarray(target, dtype=np.float64), (row, one))
            for row, one in enumerate(chosen)]
    lead = _lead(seen[0], rising)
    lagging = _lags(seen, rising, time, _path(lead, rising))
    paced = _lags(seen, rising, time, _paced(lead, rising, time, seen[0])) if np.ptp(lead) > 0.0 else [None] * len(seen)
    return tuple(_split(one, _columns(one, recording, rising, (behind, steady)), expected)
                 for one, behind, steady in zip(seen, lagging, paced, strict=True))


@dataclass(frozen=True, eq=False)
class _Seen:
    """Of one start angle."""

    turns: FloatArray  # (turns,) number of each turn
    deviation: FloatArray  # (turns,) m
    target: FloatArray  # (turns from the first known on,) m
    middles: FloatArray  # (the same,) rad
    levels: FloatArray  # (turns + 1,) rad, where they begin and end
    course: FloatArray  # (crossings,) rad/s, the speed there, and before, from turn 1 on
    sense: float
    start_angle: float


def _seen(recording: ControlTrace, rising: FloatArray, target: FloatArray, chosen: tuple[int, Turns]) -> _Seen:
    row, asked = chosen
    table = pitch_table(recording.trace, (asked.start_angle,))
    whole = np.flatnonzero(~np.isnan(table.pitch[0]))
    known = whole[whole + 1 >= asked.first]
    if target.ndim:
        of_row = np.atleast_2d(target)[min(row, np.atleast_2d(target).shape[0] - 1)]
        known = known[known < of_row.size]
        known = known[~np.isnan(of_row[known])]
        wanted = of_row
    else:
        wanted = np.full(whole[-1] + 1 if whole.size else 0, float(target))
    if known.size < FEWEST_TURNS or (np.diff(known) != 1).any():
        raise JudgementError(f"{recording.trace.whole()}: {known.size} whole turns; splitting the control needs "
                             f"{FEWEST_TURNS} in a row")
    bounds = asked.start_angle + TURN * (table.turns_before + np.arange(known[-1] + 2))
    course = _at(bounds, rising, recording.speed) if recording.speed is not None \
        else _speed(bounds, rising, np.asarray(recording.trace.time))
    turns = np.asarray(known + 1.0, dtype=np.float64)
    of_all = wanted[:known[-1] + 1]
    told = np.isfinite(of_all)
    return _Seen(turns, np.asarray(table.pitch[0, known] - wanted[known]), of_all[told],
                 (0.5 * (bounds[1:] + bounds[:-1]))[told], bounds[known[0]:], course, _sense(table.crossings[0]),
                 asked.start_angle)


def _lead(one: _Seen, rising: FloatArray) -> FloatArray:
    """(samples,) m, that should be cut there: every turn its target in its middle, before and after them the same."""
    return np.interp(rising, one.middles, one.target)


def _path(lead: FloatArray, rising: FloatArray) -> FloatArray:
    """(samples,) m, where the feed should be."""
    steps = 0.5 * (lead[1:] + lead[:-1]) * np.diff(rising) / TURN
    return np.concatenate([[0.0], np.cumsum(steps)])


def _paced(lead: FloatArray, rising: FloatArray, time: FloatArray, one: _Seen) -> FloatArray:
    """(samples,) m, where the feed should be if the spindle turned evenly, with its mean speed, and the lead changed
    when it did.
    """
    began, ended = (float(np.interp(level, rising, time)) for level in (one.levels[0], one.levels[-1]))
    speed = (one.levels[-1] - one.levels[0]) / max(ended - began, 1e-12)  # rad/s
    return _path(lead, speed * time)


def _lags(seen: Sequence[_Seen], rising: FloatArray, time: FloatArray, path: FloatArray) -> list[FloatArray]:
    """-dE(n) (lags, turns) m on this path, of every start angle."""
    found: list[list[FloatArray]] = [[] for _ in seen]
    for lag in LAGS.tolist():
        behind = _lagging(path, time, lag)
        for one, rows in zip(seen, found, strict=True):
            rows.append(-np.diff(_at(one.levels, rising, behind)))
    return [np.stack(rows) for rows in found]


@dataclass(frozen=True, eq=False)
class _Columns:
    lagging: FloatArray  # (lags, turns) m, -dE(n) of the lags that are tried
    paced: FloatArray | None  # (lags, turns) m, that of it which the lead alone makes; None where it does not change
    following: FloatArray | None  # (turns,) m
    saturated: NDArray[np.bool_]  # (turns,)


def _columns(one: _Seen, recording: ControlTrace, rising: FloatArray,
             lagging: tuple[FloatArray, FloatArray | None]) -> _Columns:
    following = None if recording.following_error is None \
        else -one.sense * np.diff(_at(one.levels, rising, recording.following_error))
    saturated = np.zeros(one.turns.size, dtype=np.bool_) if recording.saturated is None \
        else _touched(one.levels, rising, recording.saturated)
    return _Columns(*lagging, following, saturated)


def _split(one: _Seen, columns: _Columns, expected: ExpectedLag | None) -> ControlParts:
    speed = one.course[-one.turns.size - 1:]
    lag, interval, moved, led, start = _fit(one.turns, one.deviation, columns)
    parts = {SPEED: moved - led, LEAD: led, START: start}
    rest = one.deviation - moved - start
    parts[SATURATION] = np.where(columns.saturated, rest, 0.0)
    rest = rest - parts[SATURATION]
    if columns.following is None:
        parts[FOLLOWING] = np.zeros_like(one.deviation)
    else:
        parts[FOLLOWING] = np.where(columns.saturated, 0.0, _beyond(columns, moved, start))
    parts[OTHER] = rest - parts[FOLLOWING]
    return ControlParts(one.turns, one.deviation, np.diff(speed), speed[1:], parts, lag, interval,
                        None if expected is None else expected.lag, one.course, one.start_angle)


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
         columns: _Columns) -> tuple[float | None, tuple[float, float] | None, FloatArray, FloatArray, FloatArray]:
    """(lag, its interval, what it does, that of it by the lead's change, part of the start).

    By least squares over the turns not saturated; a start's transient that is over before them is not told from them.
    """
    free = ~columns.saturated
    none = np.zeros_like(deviation)
    if int(free.sum()) < FEWEST_TURNS:
        return None, None, none, none, none
    transients = [one for one in (np.exp(-(turns - turns[0]) / decay) for decay in DECAYS) if one[free].max() >= _SEEN]
    best = _Fit(float(deviation[free] @ deviation[free]), None, (), np.zeros(0))
    for transient in (None, *transients):
        for lag, moved in ((None, None), *zip(LAGS.tolist(), columns.lagging, strict=True)):
            chosen = tuple(one for one in (moved, transient) if one is not None)
            best = min(best, _fitted(deviation, free, lag, chosen), key=lambda one: one.cost) if chosen else best
    if best.lag is None:
        start = none if not best.columns else best.sizes[0] * best.columns[0]
        return None, None, none, none, start
    start = best.sizes[1] * best.columns[1] if len(best.columns) == 2 else none
    design = np.column_stack(best.columns)[free]
    left = deviation[free] - design @ best.sizes
    variance = float(left @ left) / max(left.size - best.sizes.size, 1)
    wide = _WIDTH * math.sqrt(variance * float(np.linalg.pinv(design.T @ design)[0, 0])) * best.lag
    lag = best.lag * float(best.sizes[0])
    led = none if columns.paced is None else best.sizes[0] * columns.paced[int(np.argmin(np.abs(LAGS - best.lag)))]
    return lag, (lag - wide, lag + wide), best.sizes[0] * best.columns[0], led, start


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
    """(samples,) m by which what follows with this lag runs behind, exact for a path that is linear in between."""
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
