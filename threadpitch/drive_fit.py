"""What a drive does, out of a recording of what it was told and where it went.

A position controller with the period Ts of the log, and behind it a velocity loop of first order:

    v(k+1) = a v(k) + (1 - a) (Kv (r(k) - x(k)) + f (r(k) - r(k-1)) / Ts),    a = exp(-Ts / T)
    x(k+1) = x(k) + Ts v(k+1)

r commanded, x actual position, Kv position gain, T lag of the velocity loop, f velocity feedforward. At a constant
speed V the following error is V (1 - f) / Kv; without lag x(k+1) = x(k) + c (r(k) - x(k)), Kv = c / Ts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy  # its parts are loaded when they are used
from numpy.typing import ArrayLike, NDArray

from threadpitch.trace import ColumnChoice, read_pieces

FloatArray = NDArray[np.float64]

PARAMETERS = ("gain", "lag", "feedforward")
CONFIDENCE_FACTOR = 1.96  # standard uncertainties to either side: 95 %
_LEAST_ROWS = 50
_UNEVEN = 0.01  # of the period, by which rows may be early or late
_KNOWABLE = 0.5  # relative standard uncertainty above which a parameter is not told by the recording
_SPREAD = (0.5, 1.5)  # beginnings of the search, parts of what one step of the recording tells
_FIRST_SCALE = 1e-6  # m, by which the first positions may be wrong, for the search
_FASTEST = 0.9  # Kv Ts up to which the loop is searched: it becomes unstable at 2


class FitError(ValueError):
    """A recording does not tell the parameters: why, and how to mend it."""


@dataclass(frozen=True)
class DriveFit:
    """Gain Kv (1/s), lag T (s), feedforward f, and the standard ``uncertainty`` of those that were free.

    ``residual`` is the root mean square of measured less calculated position, m, ``period`` Ts, s.
    """

    gain: float
    lag: float
    feedforward: float
    uncertainty: Mapping[str, float]
    residual: float
    period: float
    rows: int

    @property
    def parameters(self) -> dict[str, float]:
        """The same as parameters of a FeedDrive, for those that it has."""
        return {"position_gain": self.gain, "feedforward": self.feedforward}


def fit(time: ArrayLike, command: ArrayLike, position: ArrayLike, *, free: Sequence[str] = ("gain", "lag"),
        known: Mapping[str, float] | None = None) -> DriveFit:
    """Gain, lag and feedforward of a drive from its commanded and actual position; time (n,) s, the others (n,) m.

    The sum of the squares of measured less calculated position over the whole recording is least. The uncertainty is
    that of the estimate whatever the residuals are correlated with (Newey and West 1987). What is not ``free`` stays
    as ``known`` says, else lag and feedforward are 0.

    Raises:
        FitError: too few or uneven rows, no movement, or a parameter that the recording does not tell.
    """
    recording = _Recording.of(time, command, position)
    _check_free(free, known or {})
    fixed = {"lag": 0.0, "feedforward": 0.0, **(known or {})}
    begin = {"lag": 3.0 * recording.period, "feedforward": 0.0}
    rough = min((_search(recording, free, fixed, [{**begin, "gain": gain}[name] for name in free])
                 for gain in _beginnings(recording)), key=lambda found: float(found.cost))
    # The first positions were measured like the others. Taken as they are, their errors would move all that follows
    # alike, which no residual tells.
    best = _search(recording, free, fixed, [*rough.x, 0.0, 0.0])
    uncertainty = _uncertainty(best.jac, best.fun)[:len(free)]
    values = {**fixed, **dict(zip(free, best.x[:len(free)].tolist(), strict=True))}
    told = dict(zip(free, uncertainty.tolist(), strict=True))
    _check_told(values, told, recording)
    residual = float(np.sqrt(np.mean(best.fun**2)))
    return DriveFit(values["gain"], values["lag"], values["feedforward"], told, residual, recording.period,
                    recording.time.size)


def read_fit(path: str | Path, columns: Mapping[str, str | None], *, unit: str | None = None,
             free: Sequence[str] = ("gain", "lag"), known: Mapping[str, float] | None = None) -> DriveFit:
    """The fit of a log's columns "time", "command" and "position", of any format that logs may have.

    Raises:
        TraceError: the log cannot be read, or has no such column.
        FitError: as ``fit``.
    """
    read = {}
    for name in ("command", "position"):
        # Time stands for the angle too: it runs forward, and is not looked at any further.
        choice = ColumnChoice(angle=columns["time"], angle_unit="rad", position=columns[name], position_unit=unit,
                              time=columns["time"])
        with read_pieces(path, choice) as pieces:
            parts = [samples for _, samples in pieces]
        read[name] = np.concatenate([one.position for one in parts])
        read["time"] = np.concatenate([one.angle if one.time is None else one.time for one in parts])
    return fit(read["time"], read["command"], read["position"], free=free, known=known)


def follow(command: FloatArray, first: FloatArray, values: Mapping[str, float], period: float) -> FloatArray:
    """x (n,) of the model for r (n,), after the two positions ``first``; m.

    x(k+1) = (1 + a - (1 - a) Kv Ts) x(k) - a x(k-1) + (1 - a) ((Kv Ts + f) r(k) - f r(k-1))
    """
    keep = math.exp(-period / values["lag"]) if values["lag"] > 0.0 else 0.0
    pull, ahead = (1.0 - keep) * values["gain"] * period, (1.0 - keep) * values["feedforward"]
    forward = np.array([0.0, pull + ahead, -ahead])
    back = np.array([1.0, -(1.0 + keep - pull), keep])
    state = scipy.signal.lfiltic(forward, back, first[::-1], command[1::-1])
    rest, _ = scipy.signal.lfilter(forward, back, command[2:], zi=state)
    return np.concatenate([first, rest])


@dataclass(frozen=True)
class _Recording:
    """Checked columns, relative to the first position; ``period`` Ts, s."""

    time: FloatArray
    command: FloatArray
    position: FloatArray
    period: float

    @classmethod
    def of(cls, time: ArrayLike, command: ArrayLike, position: ArrayLike) -> _Recording:
        moments, told, went = (np.asarray(column, np.float64) for column in (time, command, position))
        if moments.ndim != 1 or not moments.shape == told.shape == went.shape:
            raise FitError(f"time {moments.shape}, command {told.shape} and position {went.shape} must be columns of "
                           "one length")
        if moments.size < _LEAST_ROWS:
            raise FitError(f"{moments.size} rows are too few; give {_LEAST_ROWS} or more")
        if not all(np.isfinite(column).all() for column in (moments, told, went)):
            raise FitError("time, command and position must be numbers in every row; cut the others out")
        period = float(np.median(np.diff(moments)))
        if period <= 0.0 or float(np.max(np.abs(np.diff(moments) - period))) > _UNEVEN * period:
            row = int(np.argmax(np.abs(np.diff(moments) - period))) + 1
            raise FitError(f"the rows are not evenly spaced: {period:.6g} s, but {np.diff(moments)[row - 1]:.6g} s "
                           f"before t = {moments[row]:.6g} s; cut the recording there")
        if np.ptp(told) == 0.0:
            raise FitError("the command does not change; record a movement")
        return cls(moments, told - told[0], went - told[0], period)


def _check_free(free: Sequence[str], known: Mapping[str, float]) -> None:
    unknown = [name for name in (*free, *known) if name not in PARAMETERS]
    if unknown or not free or len(set(free)) < len(free):
        what = f"{unknown[0]!r} is no parameter" if unknown else "nothing to fit, or a parameter twice"
        raise FitError(f"{what}; the parameters are {', '.join(PARAMETERS)}")
    if "gain" not in free and "gain" not in known:
        raise FitError("the gain is neither free nor known; state it")


def _beginnings(recording: _Recording) -> list[float]:
    """About the gain, from single steps: v(k+1) = a v(k) + b (r(k) - x(k)), Kv = b / (1 - a); noise makes it wrong."""
    moved = np.diff(recording.position)
    columns = np.stack([moved[:-1], (recording.command - recording.position)[1:-1]], axis=1)
    keep, pull = np.linalg.lstsq(columns, moved[1:], rcond=None)[0]
    guess = abs(pull) / max(1.0 - keep, 1e-3) / recording.period
    return [float(np.clip(part * guess, 1.0, 0.5 / recording.period)) for part in _SPREAD]


def _search(recording: _Recording, free: Sequence[str], fixed: Mapping[str, float],
            begin: Sequence[float]) -> scipy.optimize.OptimizeResult:
    """Least squares from values of what is free; two more are what the positions that the model begins with are off."""
    count, gain = len(free), begin[0] if free[0] == "gain" else fixed.get("gain", 1.0)
    bounds = {"gain": (0.0, _FASTEST / recording.period), "lag": (0.0, float(np.ptp(recording.time))),
              "feedforward": (-1.0, 2.0)}
    scale = {"gain": gain or 1.0, "lag": recording.period, "feedforward": 0.1}

    def residuals(values: FloatArray) -> FloatArray:
        model = {**fixed, **dict(zip(free, values[:count].tolist(), strict=True))}
        first = recording.position[:2] + (values[count:] if values.size > count else 0.0)
        with np.errstate(over="ignore", invalid="ignore"):
            found = recording.position - follow(recording.command, first, model, recording.period)
        return np.nan_to_num(found, nan=1e6, posinf=1e6, neginf=-1e6)  # an unstable loop is far away from all

    more = len(begin) - count
    low, high = ([bounds[name][end] for name in free] + [far] * more for end, far in ((0, -math.inf), (1, math.inf)))
    return scipy.optimize.least_squares(
        residuals, begin, bounds=(low, high), x_scale=[*(scale[name] for name in free), *[_FIRST_SCALE] * more],
        jac="3-point", xtol=1e-12, ftol=1e-12, gtol=1e-12)


def _uncertainty(jacobian: FloatArray, residuals: FloatArray) -> FloatArray:
    """Standard uncertainties: the diagonal of (J'J)^-1 S (J'J)^-1, the greater one of two estimates of S, of

        S = sum over lags l of w(l) sum over k of J'(k) e(k) e(k+l) J(k+l)          (Newey and West)
        S = sum over lags l of w(l) c(l) sum over k of J'(k) J(k+l),  c(l) = mean of e(k) e(k+l)

    The first holds where residuals are not alike everywhere. But a lag shows in the few rows after a change of speed
    only, and so few residuals, which the fit has made small besides, say less of the noise than all do: the second.
    w falls from 1 to 0 within L lags (Bartlett), L from the residuals' own correlation time.
    """
    count, scale = residuals.size, np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    jacobian = jacobian / scale  # columns of one size: the pseudo-inverse takes very small ones for nothing
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    scores = jacobian * residuals[:, None]  # (n, parameters)
    lags = min(count // 4, max(int(4.0 * (count / 100.0) ** (2.0 / 9.0)), int(10.0 * _correlation_time(residuals))))
    inner, alike = scores.T @ scores, float(np.mean(residuals**2)) * (jacobian.T @ jacobian)
    for lag in range(1, lags + 1):
        cross = scores[lag:].T @ scores[:-lag]
        inner += (1.0 - lag / (lags + 1.0)) * (cross + cross.T)
        cross = float(residuals[lag:] @ residuals[:-lag]) / count * (jacobian[lag:].T @ jacobian[:-lag])
        alike += (1.0 - lag / (lags + 1.0)) * (cross + cross.T)
    freedom = count / max(1, count - jacobian.shape[1])
    variances = [np.diag(inverse @ one @ inverse) for one in (inner, alike)]
    return np.asarray(np.sqrt(np.maximum(0.0, np.maximum(*variances)) * freedom) / scale)


def _correlation_time(residuals: FloatArray) -> float:
    """Rows over which residuals are alike: the sum of their correlations up to the first that is negative."""
    spectrum = np.abs(np.fft.rfft(residuals - residuals.mean(), 2 * residuals.size)) ** 2
    correlation = np.fft.irfft(spectrum)[:residuals.size]
    if correlation[0] <= 0.0:
        return 0.0
    negative = np.flatnonzero(correlation < 0.0)
    return float(np.sum(correlation[:negative[0] if negative.size else None]) / correlation[0])


def _check_told(values: Mapping[str, float], uncertainty: Mapping[str, float], recording: _Recording) -> None:
    """Refuse what the recording does not tell."""
    fastest = _FASTEST / recording.period
    if "gain" in uncertainty and values["gain"] > 0.99 * fastest:
        raise FitError(f"the gain is more than {fastest:.4g} 1/s, which rows every {recording.period:.4g} s do not "
                       "show: the position follows at once; record faster, or a drive without feedforward")
    if "gain" in uncertainty and not uncertainty["gain"] < _KNOWABLE * values["gain"]:
        raise FitError(f"the recording does not tell the gain ({values['gain']:.4g} 1/s with a standard uncertainty of "
                       f"{uncertainty['gain']:.2g}); record a movement with changes of speed, or state more that is "
                       "known")
