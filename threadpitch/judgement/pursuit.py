"""What the pitches hold, explained by the fewest shapes that do: greedy forward selection with a price.

The cost of an explanation is minus twice the logarithm of its likelihood, plus a price for every shape that grows
with the number of candidates it was chosen from (Bonferroni) and with how exactly its size had to be set (Occam's
factor), so that noise buys nothing:

    cost = sum (z - sum of the shapes)^2 + sum of the prices
    price = v (PRICE + 2 ln(candidates)) + sum over its columns of ln t^2

z are the pitches over their standard uncertainty, t^2 is what a column takes off sum z^2, v its variance in the noise
(``noise.contrast_variance``). What is left may in addition be irregular, with a variance s^2 of its own: then sum z^2
becomes sum z^2 / s^2 + N ln s^2.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from threadpitch.judgement.shapes import Dictionary, Shape
from threadpitch.trace import FloatArray

PRICE = 5.5  # of one shape among one candidate
MOST_SHAPES = 10
_NEIGHBOURS_SHARE = 1.5  # variance of sum z^2 when neighbours share a crossing, over that when they do not
_FEWEST_LEFT = 4  # turns that are left for a variance of their own
_NINETY_FIVE = 1.64  # standard deviations that a normal value exceeds its mean by less than, in 95 of 100 cases
_ROUNDS = 30  # of a fixed-point iteration that gains a digit in each
_SMALL = 1e-6  # of a column's length that other shapes leave of it

Variance = Callable[[FloatArray], FloatArray]  # (turns, directions) of length 1 -> (directions,)


@dataclass(frozen=True, eq=False)
class Explanation:
    """Shapes, what they leave of z, and the cost of it all."""

    shapes: tuple[Shape, ...]
    basis: FloatArray  # (turns, columns) orthonormal columns that the shapes span
    left: FloatArray  # (turns,)
    irregular: float  # standard deviation s of what is left, where it is no longer noise; 0 = it is
    cost: float


@dataclass(frozen=True, eq=False)
class _Step:
    """The shape that comes next: the directions that it adds, and what it costs less what it takes off."""

    shape: Shape
    directions: FloatArray  # (turns, 1 or 2)
    gain: float
    price: float


def sure_event(turns: int, margin: float) -> float:
    """t + 1.64 with t^2 - ln t^2 = PRICE + 2 ln(turns) + margin.

    A single turn that is off by this many standard uncertainties is not taken for noise in 95 of 100 threads.
    """
    price = PRICE + 2.0 * math.log(turns) + margin
    square = price
    for _ in range(_ROUNDS):
        square = price + math.log(square)
    return math.sqrt(square) + _NINETY_FIVE


def unexplained(z: FloatArray) -> Explanation:
    """z is noise."""
    return Explanation((), np.zeros((z.size, 0)), z, 0.0, float(z @ z))


def explain(z: FloatArray, candidates: Dictionary, variance: Variance) -> Explanation:
    """The cheapest explanation of z (turns,) that holds at least one shape, or an irregular rest."""
    basis, left, prices = np.zeros((z.size, 0)), z, 0.0
    shapes: tuple[Shape, ...] = ()
    offers = [_with_irregular(unexplained(z))]
    while len(shapes) < min(MOST_SHAPES, z.size // 2):
        step = _best(left, basis, candidates, variance)
        if shapes and step.gain <= 0.0:
            break
        basis = np.hstack([basis, step.directions])
        left = left - step.directions @ (step.directions.T @ left)
        prices += step.price
        shapes = (*shapes, step.shape)
        plain = Explanation(shapes, basis, left, 0.0, float(left @ left) + prices)
        offers += [plain, _with_irregular(plain)]
    found = min(offers, key=lambda one: one.cost)
    return pruned(z, found, candidates, variance)


def pruned(z: FloatArray, found: Explanation, candidates: Dictionary, variance: Variance) -> Explanation:
    """Without the shapes that later ones made dear: each is left out in turn while that lowers the cost."""
    while len(found.shapes) > 1:
        fewer = [with_shapes(z, found.shapes[:i] + found.shapes[i + 1:], candidates, variance)
                 for i in range(len(found.shapes))]
        best = min(fewer, key=lambda one: one.cost)
        if best.cost >= found.cost:
            break
        found = best
    return found


def with_shapes(z: FloatArray, shapes: tuple[Shape, ...], candidates: Dictionary, variance: Variance) -> Explanation:
    """The explanation by just these shapes, in this order; irregular besides where that is cheaper."""
    basis, left, prices = np.zeros((z.size, 0)), z, 0.0
    for shape in shapes:
        directions = _directions(shape, basis, candidates)
        if directions.shape[1]:
            taken = (directions.T @ left) ** 2
            prices += _price(shape, taken, variance(directions), candidates)
            basis = np.hstack([basis, directions])
            left = left - directions @ (directions.T @ left)
    plain = Explanation(shapes, basis, left, 0.0, float(left @ left) + prices)
    return min(plain, _with_irregular(plain), key=lambda one: one.cost)


def span(shapes: tuple[Shape, ...], candidates: Dictionary) -> FloatArray:
    """(turns, columns) orthonormal columns that the shapes span."""
    basis = np.zeros((candidates.columns.shape[0], 0))
    for shape in shapes:
        basis = np.hstack([basis, _directions(shape, basis, candidates)])
    return basis


def _directions(shape: Shape, basis: FloatArray, candidates: Dictionary) -> FloatArray:
    """(turns, 0 to 2) what the shape's columns add to the basis, orthonormal."""
    found = basis
    for column in candidates.columns[:, shape.columns].T:
        free = column - found @ (found.T @ column)
        length = float(np.linalg.norm(free))
        if length > _SMALL:
            found = np.column_stack([found, free / length])
    return found[:, basis.shape[1]:]


def _price(shape: Shape, taken: FloatArray, variance: FloatArray, candidates: Dictionary) -> float:
    """v (PRICE + 2 ln(candidates)) + sum of ln t^2."""
    fixed = PRICE + 2.0 * math.log(candidates.choices[shape.kind])
    return float(variance.max() * fixed + np.sum(variance * np.log(np.maximum(taken / variance, 1.0))))


def _best(left: FloatArray, basis: FloatArray, candidates: Dictionary, variance: Variance) -> _Step:
    """The shape that lowers the cost most."""
    free = candidates.columns - basis @ (basis.T @ candidates.columns)
    first = _normalised(free)
    taken = (first.T @ left) ** 2  # (columns,)
    spread = variance(first)
    occam = spread * np.log(np.maximum(taken / spread, 1.0))
    one, other = candidates.pairs[:, 0], candidates.pairs[:, 1]
    second = _normalised(free[:, other] - first[:, one] * np.sum(first[:, one] * free[:, other], axis=0))
    taken_too = (second.T @ left) ** 2  # (pairs,)
    spread_too = variance(second)
    occam_too = spread_too * np.log(np.maximum(taken_too / spread_too, 1.0))
    gains = np.concatenate([
        (taken - occam)[candidates.single]
        - spread[candidates.single] * (PRICE + candidates.bonferroni[:candidates.single.size]),
        taken[one] + taken_too - occam[one] - occam_too
        - np.maximum(spread[one], spread_too) * (PRICE + candidates.bonferroni[candidates.single.size:]),
    ])
    gains[~np.concatenate([first[:, candidates.single].any(axis=0), first[:, one].any(axis=0)])] = -np.inf
    best = int(np.argmax(gains))
    shape = candidates.shapes[best]
    directions = _directions(shape, basis, candidates)
    price = _price(shape, (directions.T @ left) ** 2, variance(directions), candidates)
    return _Step(shape, directions, float(gains[best]), price)


def _normalised(columns: FloatArray) -> FloatArray:
    """Columns of length 1; nothing where nothing is left of one."""
    length = np.sqrt(np.sum(columns * columns, axis=0))
    return np.where(length > _SMALL, columns / np.maximum(length, _SMALL), 0.0)


def _with_irregular(plain: Explanation) -> Explanation:
    """What is left has a variance of its own: sum z^2 / s^2 + N ln s^2."""
    count = plain.left.size - plain.basis.shape[1]
    square = float(plain.left @ plain.left)
    variance = square / count if count >= _FEWEST_LEFT else 1.0
    saved = 0.0 if variance <= 1.0 else square - count - count * math.log(variance)
    return Explanation(plain.shapes, plain.basis, plain.left, math.sqrt(max(variance, 1.0)),
                       plain.cost - saved + _NEIGHBOURS_SHARE * PRICE + math.log(max(count, 1)))
