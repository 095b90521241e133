"""Loops iterated to a tolerance: what is compared between two sweeps, and what the next one begins with.

A sweep computes G, the outputs of a loop at the end of a step, from the values x that were fed back. The fixed point
x = G(x) is approached by the interface quasi-Newton method with least squares (IQN-ILS; Degroote, Bathe, Vierendeels
2009; of the family of Anderson 1965). With r = G(x) - x, scaled by the values' size, and the differences between
sweeps, dR and dG, as columns:

    x <- G(x) - dG c,  c = argmin |r - dR c|

which for one value is the secant method, comes to rest on every linear contraction (Toth, Kelley 2015), and converges
where plain repetition (no columns) runs away. The functions are written so that Numba compiles them: the plain loop and
the kernel have one definition.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_PLAIN_SWEEPS = 2  # the first begins with extrapolated inputs: only from the second on residuals are comparable
MOST_COLUMNS = 8
FEW_DIGITS = 1e-290  # nearer to zero than that, numbers lose their digits, and differences of them all
_ASTRAY = 100.0  # times the square of the residual of the sweep before: a tenfold residual
_DEPENDENT = 1e-20  # of a column's square: what is left of it beside newer ones is rounding


class Iterates(NamedTuple):
    """Values that are fed back in loops.

    By Float64 or Real value: ``places`` (n,) its number among those in the memory, ``fed`` (n,) what the sweep began
    with, ``residuals`` and ``results`` (n,) r and G of the sweep before, ``scales`` (n,) the largest absolute value so
    far; ``turns`` and ``moves`` (n, columns) dR and dG; ``basis`` (n, columns), ``triangle`` (columns, columns),
    ``slots`` and ``weights`` (columns,) are room for the least squares. All others are compared bit by bit: ``octets``
    (m,) the bytes of the memory, ``former`` (m,) what they were.
    """

    places: NDArray[np.intp]
    fed: NDArray[np.float64]
    residuals: NDArray[np.float64]
    results: NDArray[np.float64]
    scales: NDArray[np.float64]
    turns: NDArray[np.float64]
    moves: NDArray[np.float64]
    basis: NDArray[np.float64]
    triangle: NDArray[np.float64]
    slots: NDArray[np.intp]
    weights: NDArray[np.float64]
    octets: NDArray[np.intp]
    former: NDArray[np.uint8]

    @classmethod
    def of(cls, places: list[int], octets: list[int]) -> Iterates:
        """Nothing yet of these values and bytes."""
        count = len(places)
        table = (count, MOST_COLUMNS)
        return cls(np.array(places, np.intp), np.zeros(count), np.zeros(count), np.zeros(count), np.zeros(count),
                   np.zeros(table), np.zeros(table), np.zeros(table), np.zeros((MOST_COLUMNS, MOST_COLUMNS)),
                   np.zeros(MOST_COLUMNS, np.intp), np.zeros(MOST_COLUMNS), np.array(octets, np.intp),
                   np.zeros(len(octets), np.uint8))


class Loop(NamedTuple):
    """Nodes ``first`` to ``last`` - 1, which feed each other, and their values and octets among the iterates."""

    first: int
    last: int
    first_value: int
    last_value: int
    first_octet: int
    last_octet: int


def begin_iteration(iterates: Iterates, loop: Loop, reals: NDArray[np.float64], octets: NDArray[np.uint8]) -> None:
    """Note what the first sweep begins with."""
    for i in range(loop.first_value, loop.last_value):
        iterates.fed[i] = reals[iterates.places[i]]
    for i in range(loop.first_octet, loop.last_octet):
        iterates.former[i] = octets[iterates.octets[i]]


def settled(iterates: Iterates, loop: Loop, reals: NDArray[np.float64], tolerance: float) -> bool:
    """Whether a sweep gave the Real values that it began with: to the tolerance, relative to the largest so far."""
    same = True
    for i in range(loop.first_value, loop.last_value):
        value = float(reals[iterates.places[i]])
        if abs(value) > iterates.scales[i]:
            iterates.scales[i] = abs(value)
        if not abs(value - float(iterates.fed[i])) <= max(tolerance * float(iterates.scales[i]), FEW_DIGITS):
            same = False
    return same


def unchanged(iterates: Iterates, loop: Loop, octets: NDArray[np.uint8]) -> bool:
    """Whether a sweep gave all other values that it began with, exactly."""
    same = True
    for i in range(loop.first_octet, loop.last_octet):
        octet = octets[iterates.octets[i]]
        if octet != iterates.former[i]:
            same = False
        iterates.former[i] = octet
    return same


def add_column(iterates: Iterates, loop: Loop, reals: NDArray[np.float64], sweep: int, columns: int) -> int:
    """Note r and G, and how they differ from those of the sweep before: how many columns there are. ``sweep`` counts
    from 1.

    A residual that has grown much tells that older columns do not fit where the iteration is now.
    """
    slot = sweep % MOST_COLUMNS
    former, square = 0.0, 0.0
    for i in range(loop.first_value, loop.last_value):
        result = float(reals[iterates.places[i]])
        residual = result - float(iterates.fed[i])
        scale = float(iterates.scales[i])
        if scale > 0.0:
            former += float(iterates.residuals[i]) / scale * (float(iterates.residuals[i]) / scale)
            square += residual / scale * (residual / scale)
        iterates.turns[i, slot] = residual - float(iterates.residuals[i])
        iterates.moves[i, slot] = result - float(iterates.results[i])
        iterates.residuals[i], iterates.results[i] = residual, result
    if sweep <= _PLAIN_SWEEPS:
        return 0
    return min(columns + 1, MOST_COLUMNS) if square <= _ASTRAY * former else 1


def fit(iterates: Iterates, loop: Loop, sweep: int, columns: int) -> int:
    """c by orthogonal columns, the newest first; one that depends on newer ones is left out. How many are used."""
    used = 0
    for age in range(columns):
        slot, before = (sweep - age) % MOST_COLUMNS, 0.0
        for i in range(loop.first_value, loop.last_value):
            scale = float(iterates.scales[i])
            value = float(iterates.turns[i, slot]) / scale if scale > 0.0 else 0.0
            iterates.basis[i, used] = value
            before += value * value
        for j in range(used):
            share = 0.0
            for i in range(loop.first_value, loop.last_value):
                share += float(iterates.basis[i, j]) * float(iterates.basis[i, used])
            iterates.triangle[j, used] = share
            for i in range(loop.first_value, loop.last_value):
                iterates.basis[i, used] -= share * float(iterates.basis[i, j])
        rest = 0.0
        for i in range(loop.first_value, loop.last_value):
            rest += float(iterates.basis[i, used]) * float(iterates.basis[i, used])
        if rest > _DEPENDENT * before:
            for i in range(loop.first_value, loop.last_value):
                iterates.basis[i, used] /= math.sqrt(rest)
            iterates.triangle[used, used] = math.sqrt(rest)
            iterates.slots[used] = slot
            used += 1
    for j in range(used - 1, -1, -1):
        weight = 0.0
        for i in range(loop.first_value, loop.last_value):
            scale = float(iterates.scales[i])
            if scale > 0.0:
                weight += float(iterates.basis[i, j]) * float(iterates.residuals[i]) / scale
        for k in range(j + 1, used):
            weight -= float(iterates.triangle[j, k]) * float(iterates.weights[k])
        iterates.weights[j] = weight / float(iterates.triangle[j, j])
    return used


def feed(iterates: Iterates, loop: Loop, reals: NDArray[np.float64], used: int) -> None:
    """Put the values that the next sweep begins with into the memory."""
    for i in range(loop.first_value, loop.last_value):
        value = float(iterates.results[i])
        for j in range(used):
            value -= float(iterates.moves[i, iterates.slots[j]]) * float(iterates.weights[j])
        if not abs(value) < math.inf:  # squares of what is far from its size run over
            value = float(iterates.results[i])
        iterates.fed[i] = value
        reals[iterates.places[i]] = value
