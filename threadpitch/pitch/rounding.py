"""What rounding to whole counts does to sums of samples: how much of it averages out, and how much does not.

A value that is known to whole counts is off by a sawtooth of its phase phi (value over count), of the variance 1/12:

    e(phi) = sum over k of sin(2 pi k phi) / (pi k)

Of a sum of samples, the phases phi_i = phi_0 + p_i + j_i have a pattern p_i that the smooth motion gives, a common part
phi_0 of which nothing is known, and a normal scatter j_i of the variance s^2 (jitter of the instants, noise). Averaged
over phi_0 and j_i

    Var(sum of w_i e_i) = sum over k of 1 / (2 pi^2 k^2) [r_k^2 |sum of w_i exp(2 pi i k p_i)|^2
                                                           + (1 - r_k^2) sum of w_i^2],     r_k = exp(-2 pi^2 k^2 s^2)

in counts squared. Where samples fall on the counts in step (whole counts per sample), the errors of all samples go
together; where their phases are evenly spread, they cancel; where they scatter by a count, they are independent.

Source: W. R. Bennett, Spectra of quantized signals, Bell System Technical Journal 27 (1948); B. Widrow and I. Kollar,
Quantization Noise (2008), chapters 4 and 5 (characteristic functions of the input).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from threadpitch.trace import FloatArray

ComplexArray = NDArray[np.complex128]

HARMONICS = 12  # of the sawtooth that may go together; 95 % of its variance
_ORDERS = np.arange(1.0, HARMONICS + 1.0)
_VARIANCES = 1.0 / (2.0 * np.pi**2 * _ORDERS**2)  # (HARMONICS,) counts2
_REST = 1.0 / 12.0 - float(_VARIANCES.sum())  # of the higher ones, which the least scatter makes independent
_WHOLE = 0.05  # of a count, by which steps may differ from whole counts
LOOKED_AT = 10_000  # samples, for the count
_TRIED = 100  # counts
_FINER = 1000.0  # than the smallest count are steps told apart


@dataclass(frozen=True, eq=False)
class Rounding:
    """The variance by rounding of sums of samples, or of squares of what a fit leaves of them."""

    NUMBERS: ClassVar = HARMONICS + 1

    together: FloatArray  # (..., HARMONICS) |sum of w_i exp(2 pi i k p_i)|^2
    apart: FloatArray  # (...) sum of w_i^2

    @classmethod
    def of_rows(cls, rows: FloatArray) -> Rounding:
        """Of several sums, (sums, NUMBERS)."""
        return cls(rows[:, 1:], rows[:, 0])

    def row(self) -> FloatArray:
        """Of one sum, (NUMBERS,)."""
        return np.concatenate((self.apart[np.newaxis], self.together))

    def variance(self, scatter: FloatArray) -> FloatArray:
        """(...) counts2; ``scatter`` (...) is the variance of the phases, counts2."""
        share = np.exp(-4.0 * np.pi**2 * np.multiply.outer(scatter, _ORDERS**2))
        apart = self.apart[..., np.newaxis]
        of_harmonics: FloatArray = share * self.together + (1.0 - share) * apart
        return of_harmonics @ _VARIANCES + _REST * self.apart


def of_sum(parts: FloatArray, terms: ComplexArray, apart: float) -> Rounding:
    """Of a sum whose weights are basis @ parts; ``apart`` is the sum of the squares of the weights of samples."""
    return Rounding(np.abs(parts @ terms) ** 2, np.asarray(apart))


def of_rest(waves: ComplexArray, terms: ComplexArray, apart: float) -> Rounding:
    """Of the sum of the squares of what a fit leaves; ``terms`` (terms, HARMONICS): the waves in an orthonormal basis.

    ``apart`` is the expected sum for independent samples of variance 1.
    """
    return Rounding(np.sum(np.abs(waves) ** 2, axis=0) - np.sum(np.abs(terms) ** 2, axis=0), np.asarray(apart))


def waves(phases: FloatArray) -> ComplexArray:
    """exp(2 pi i k phi), (samples, HARMONICS)."""
    first = np.exp(2j * np.pi * (phases - np.floor(phases)))
    powers = np.empty((first.size, HARMONICS), dtype=np.complex128)
    powers[:, 0] = first
    for harmonic in range(1, HARMONICS):
        np.multiply(powers[:, harmonic - 1], first, out=powers[:, harmonic])
    return powers


def count_of(values: FloatArray, smallest: float) -> float:
    """The count of rounded values: the largest of which all steps are multiples; 0 for none above ``smallest``."""
    steps = np.abs(np.diff(values[:LOOKED_AT]))
    sizes = np.unique(np.rint(_FINER * steps / smallest)) * (smallest / _FINER)
    for count in np.unique(np.diff(sizes))[::-1][:_TRIED]:
        multiples = np.rint(steps / count)
        if count > smallest and np.mean(np.abs(steps / count - multiples) < _WHOLE) > 0.99:
            return float(steps @ multiples / (multiples @ multiples))  # the mean, as fine as the steps are
    return 0.0
