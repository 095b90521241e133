"""Loops iterated to a tolerance: what is compared between two sweeps, and what the next one begins with.

A sweep computes G, the outputs of a loop at the end of a step, from the values x that were fed back. The fixed point
x = G(x) is approached with Aitken's relaxation (Kuettler and Wall 2008), r = G(x) - x scaled by the values' size:

    x <- x + omega r,  omega <- -omega r_former . (r - r_former) / |r - r_former|^2

which for one value is the secant method, and converges where plain repetition (omega = 1) runs away. The functions
are written so that Numba compiles them: the plain loop and the kernel have one definition.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_PLAIN_SWEEPS = 2  # the first begins with extrapolated inputs: only from the second on residuals are comparable

_LARGEST = 1e6  # omega; beyond, 1 - G' is lost in rounding


class Iterates(NamedTuple):
    """Values that are fed back in loops.

    By Float64 or Real value: ``places`` (n,) its number among those in the memory, ``fed`` (n,) what the sweep began
    with, ``residuals`` (n,) of the sweep before, ``scales`` (n,) the largest absolute value so far. All others are
    compared bit by bit: ``octets`` (m,) the bytes of the memory, ``former`` (m,) what they were.
    """

    places: NDArray[np.intp]
    fed: NDArray[np.float64]
    residuals: NDArray[np.float64]
    scales: NDArray[np.float64]
    octets: NDArray[np.intp]
    former: NDArray[np.uint8]

    @classmethod
    def of(cls, places: list[int], octets: list[int]) -> Iterates:
        """Nothing yet of these values and bytes."""
        count = len(places)
        return cls(np.array(places, np.intp), np.zeros(count), np.zeros(count), np.zeros(count),
                   np.array(octets, np.intp), np.zeros(len(octets), np.uint8))


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


def settled(iterates: Iterates, loop: Loop, reals: NDArray[np.float64], octets: NDArray[np.uint8],
            tolerance: float) -> bool:
    """Whether a sweep gave what it began with: to the tolerance, relative to the largest value so far, or exactly."""
    same = True
    for i in range(loop.first_value, loop.last_value):
        value = float(reals[iterates.places[i]])
        if abs(value) > iterates.scales[i]:
            iterates.scales[i] = abs(value)
        if not abs(value - float(iterates.fed[i])) <= tolerance * float(iterates.scales[i]):
            same = False
    for i in range(loop.first_octet, loop.last_octet):
        octet = octets[iterates.octets[i]]
        if octet != iterates.former[i]:
            same = False
        iterates.former[i] = octet
    return same


def relax(iterates: Iterates, loop: Loop, reals: NDArray[np.float64], sweep: int, omega: float) -> float:
    """Put the values that the next sweep begins with into the memory; ``sweep`` counts from 1. The new omega."""
    if sweep > _PLAIN_SWEEPS:
        product, square = 0.0, 0.0
        for i in range(loop.first_value, loop.last_value):
            scale = float(iterates.scales[i])
            if scale > 0.0:
                former = float(iterates.residuals[i]) / scale
                change = (float(reals[iterates.places[i]]) - float(iterates.fed[i])) / scale - former
                product += former * change
                square += change * change
        if square > 0.0:
            omega = -omega * product / square
        if not 0.0 < abs(omega) <= _LARGEST:
            omega = 1.0
    for i in range(loop.first_value, loop.last_value):
        residual = float(reals[iterates.places[i]]) - float(iterates.fed[i])
        iterates.residuals[i] = residual
        iterates.fed[i] = float(iterates.fed[i]) + omega * residual
        reals[iterates.places[i]] = iterates.fed[i]
    return omega
