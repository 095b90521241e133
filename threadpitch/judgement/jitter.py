"""Movement of the feed, or jitter of the detectors: what of the nominal pitches can be in the thread."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from threadpitch.judgement.noise import BoolArray, crossing_variance
from threadpitch.judgement.pursuit import explain, span
from threadpitch.judgement.shapes import Dictionary, Shape
from threadpitch.trace import FloatArray

_THIRD_DIFFERENCE = 20.0  # 1 + 9 + 9 + 1: variance of the third difference of crossings that jitter independently
_FEWEST_TURNS = 8  # of which jitter is told apart
_ROUNDS = 3
_SAFE = 2.0  # of a variance that is estimated by a few turns
_NORMAL = 1.4826  # standard deviations per median absolute deviation
_SURELY = 4.0  # by which the shapes must be the cheaper explanation


@dataclass(frozen=True)
class Nominal:
    """What the nominal pitches are made of."""

    shapes: tuple[Shape, ...]  # of the movement
    jitter: float  # m2, variance of one nominal pitch that is not in the thread, at most
    least_jitter: float  # m2, the same, at least
    moves: bool  # the shapes explain the nominal pitches far better than jitter does


def nominal_parts(nominal: FloatArray, measured: tuple[FloatArray, FloatArray], linked: BoolArray,
                  candidates: Dictionary) -> Nominal:
    """Shapes of the movement, and the variance of the jitter, from deviations of pitches (turns,) m.

    Jitter of the crossings is rough, the movement of a drive has a shape: what remains of the nominal pitches beside
    their shapes is jitter, but for the part g of it that is in the thread:

        J = (1 - g) |rest|^2 / (N - k),   g = rest' P_measured / |rest|^2  within 0 ... 1

    ``measured``: the deviations of the measured pitches, and what their own shapes leave of them. The first may follow
    by chance where mechanics move the thread, the second not follow where a shape took away what the two share. Jitter
    is in every turn, and cannot be more than the turns in the middle differ from one table to the other.
    """
    if nominal.size < _FEWEST_TURNS or not nominal.any():
        return Nominal((), 0.0, 0.0, bool(nominal.any()))
    floor = _rough(nominal, linked)
    shapes: tuple[Shape, ...] = ()
    rest = nominal
    moves = False
    for _ in range(_ROUNDS):
        if floor <= 0.0:
            break
        z = nominal / np.sqrt(floor)
        found = explain(z, candidates, crossing_variance(linked))
        moves = found.cost < float(z @ z) - _SURELY
        shapes = found.shapes if moves else ()
        basis = span(shapes, candidates)
        rest = nominal - basis @ (basis.T @ nominal)
        floor = float(rest @ rest) / max(nominal.size - basis.shape[1], 1)
    square = float(rest @ rest)
    follows = [float(np.clip(rest @ one / square, 0.0, 1.0)) if square > 0.0 else 1.0 for one in measured]
    most = _SAFE * _usual_square(measured[0] - nominal)
    return Nominal(shapes, min((1.0 - min(follows)) * floor, most), min((1.0 - max(follows)) * floor, most), moves)


def _usual_square(differences: FloatArray) -> float:
    """Variance by the median of the absolute deviations: single turns that differ much do not count."""
    return (_NORMAL * float(np.median(np.abs(differences - np.median(differences))))) ** 2


def _rough(nominal: FloatArray, linked: BoolArray) -> float:
    """Upper bound of the jitter's variance: second differences of pitches are third differences of crossings."""
    rough = np.diff(nominal, 2)[linked[:-1] & linked[1:]]
    return 2.0 * float(rough @ rough) / rough.size / _THIRD_DIFFERENCE if rough.size else float(np.var(nominal))
