"""Are two fluctuations of similar tendency? Gain, correlation and a permutation test, in numbers.

    gain: g = x'y / (x'x - N J),  x and y the deviations from the target beside the shapes of the rest
    correlation: r = cov(x, y) / (s_x s_y), Fisher's interval with Bartlett's effective number of turns
        N_e = N / (1 + 2 sum (1 - k/N) rho_x(k) rho_y(k))
    permutation: share of series with the spectrum of x and random phases whose |r| reaches that of x

Turns follow one another: shuffled they would call any two smooth curves related.
"""

from __future__ import annotations

import math

import numpy as np

from threadpitch.trace import FloatArray

WIDTH = 1.96  # standard deviations of a 95 % interval
SURROGATES = 1999
_FEWEST = 4
_AT_ONCE = 250  # surrogates, so that a long thread needs no large memory


def sign_agreement(nominal: FloatArray, measured: FloatArray) -> float | None:
    """Share of turns in which both deviate to the same side of the target (US 2016/0008901 A1, paragraph 47)."""
    sided = (nominal != 0.0) & (measured != 0.0)
    return float(np.mean(np.sign(nominal[sided]) == np.sign(measured[sided]))) if sided.any() else None


def gain(nominal: FloatArray, measured: FloatArray, basis: FloatArray,
         noise: tuple[float, float]) -> tuple[float, float, float] | None:
    """(g, low, high): the measured deviation per nominal one beside the columns of ``basis`` (turns, columns).

    ``noise``: variances of one measured pitch and of the jitter of one nominal pitch, m2. None where the nominal
    pitches do not fluctuate, or only jitter.
    """
    x = nominal - basis @ (basis.T @ nominal)
    y = measured - basis @ (basis.T @ measured)
    free = x.size - basis.shape[1]
    square = float(x @ x)
    attenuated = square - max(free, 0) * noise[1]
    if free < _FEWEST or not attenuated > 0.1 * square:
        return None
    found = float(x @ y) / attenuated
    rest = y - found * x
    variance = max(noise[0] + found**2 * noise[1], float(rest @ rest) / (free - 1))
    wide = WIDTH * math.sqrt(variance * square) / attenuated
    return found, found - wide, found + wide


def correlation(nominal: FloatArray, measured: FloatArray) -> tuple[float, float, float] | None:
    """(r, low, high) of the fluctuations about their means; None where one of them does not fluctuate."""
    x, y = nominal - nominal.mean(), measured - measured.mean()
    length = math.sqrt(float(x @ x) * float(y @ y))
    if x.size < _FEWEST + 1 or not length > 0.0:
        return None
    found = min(max(float(x @ y) / length, -1.0), 1.0)
    size = x.size
    lags = np.arange(1, size // 2)
    related = [float(x[k:] @ x[:-k]) / float(x @ x) * float(y[k:] @ y[:-k]) / float(y @ y) for k in lags]
    effective = size / max(1.0, 1.0 + 2.0 * float(np.sum((1.0 - lags / size) * related)))
    middle, wide = math.atanh(min(max(found, -1.0 + 1e-12), 1.0 - 1e-12)), WIDTH / math.sqrt(max(effective - 3.0, 1.0))
    return found, math.tanh(middle - wide), math.tanh(middle + wide)


def permutation_p(turns: FloatArray, nominal: FloatArray, measured: FloatArray) -> float | None:
    """(1 + number of surrogates with |r| at least that of the nominal pitches) / (1 + surrogates).

    By Parseval a surrogate's x'y is sum 2 |X_k| |Y_k| cos(phi_k) / N, phi_k random: no series has to be made.
    """
    along = np.arange(turns[0], turns[-1] + 1.0)
    x = np.interp(along, turns, nominal)  # missing turns are bridged
    y = np.interp(along, turns, measured)
    x, y = x - x.mean(), y - y.mean()
    if along.size < _FEWEST + 1 or not float(x @ x) * float(y @ y) > 0.0:
        return None
    product = np.abs(np.fft.rfft(x)) * np.abs(np.fft.rfft(y))
    product[1:] *= 2.0
    if along.size % 2 == 0:  # the fastest component is real: two turns a period
        product[-1] *= 0.5
    draw, reached, limit = np.random.default_rng(along.size), 0, abs(float(x @ y)) * along.size * (1.0 - 1e-12)
    for first in range(0, SURROGATES, _AT_ONCE):
        phases = draw.uniform(0.0, 2.0 * math.pi, (min(_AT_ONCE, SURROGATES - first), product.size))
        turned = np.cos(phases)
        if along.size % 2 == 0:
            turned[:, -1] = np.sign(turned[:, -1])
        reached += int(np.count_nonzero(np.abs(turned @ product) >= limit))
    return (1.0 + reached) / (1.0 + SURROGATES)
