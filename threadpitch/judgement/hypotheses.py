"""Four hypotheses about a thread, and what each costs: nothing, the control, mechanics, both.

    none        P_measured - P_ref = noise
    control     P_measured - P_ref = g (P_nominal - P_ref) + noise
    mechanical  P_measured - P_ref = shapes + noise
    both        P_measured - P_ref = g (P_nominal - P_ref) + shapes + noise

What the detectors saw the feed do, the tool did: g is 1, but for what moves between detector and tool
(``GAIN_RANGE``); how far it is from 1 has its price. Costs are minus twice the logarithm of the likelihood plus the
prices of ``pursuit``. Where the nominal pitches jitter, they are taken as they are, with the jitter as additional
noise, or smoothed, whichever explains more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from threadpitch.judgement.jitter import Nominal
from threadpitch.judgement.noise import BoolArray, crossing_variance, measured_variance
from threadpitch.judgement.pursuit import Explanation, explain, pruned, span, unexplained, with_shapes
from threadpitch.judgement.shapes import Dictionary
from threadpitch.trace import FloatArray

CONTROL, MECHANICAL, BOTH, NONE, UNDETERMINED = "control", "mechanical", "both", "none", "undetermined"
GAIN_RANGE = (0.95, 1.05)  # of the movement that a drive's table makes per movement that its detector sees
GAIN_SPREAD = 0.015  # standard deviation of g about 1: resonance and yielding between detector and tool
CONTROL_PRICE = 3.0
MARGIN = 4.0  # by which a cause must win: a likelihood ratio of e^2, on top of the prices
NOISE_MARGIN = 1.0  # by which noise alone must win
VISIBLE = 9.0  # sum of the squares of the nominal fluctuation over the uncertainty: less cannot be seen in the thread
MOVED = 4.0  # the same, where the nominal pitches surely are a movement
HARDLY = 1.0  # the same: the feed moves less than can be measured
SHOWS = 25.0  # the same: so much must be seen
PHYSICS = 14.0  # cost of a feed that moves in the detectors' sight and leaves nothing in the thread: one in a thousand
TOLD = 16.0  # square over the jitter's variance from which the nominal pitches tell whether a shape is in them
WORTH_SMOOTHING = 0.2  # jitter over measuring uncertainty


@dataclass(frozen=True, eq=False)
class Fluctuations:
    """Deviations from the target, turn by turn, over the turns that both tables have."""

    turns: FloatArray  # (turns,) number of each turn
    nominal: FloatArray  # (turns,) m
    measured: FloatArray  # (turns,) m
    uncertainty: FloatArray  # (turns,) m, standard, of each measured pitch
    linked: BoolArray  # (turns - 1,) the next turn follows at once
    doubt: FloatArray  # (turns,) m, standard uncertainty of each nominal pitch


@dataclass(frozen=True, eq=False)
class Seen:
    """The control's part of the fluctuation, as far as it can be known."""

    nominal: FloatArray  # (turns,) m
    variance: FloatArray  # (turns,) m2, of what jitter leaves in it
    jitter: float  # m2, variance of one nominal pitch that is not in the thread


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One of the four, as well as it can be had."""

    cause: str
    gain: float  # g; 0 where the control has no part
    seen: FloatArray  # (turns,) m, the nominal fluctuation that g multiplies
    scale: FloatArray  # (turns,) m, what one unit of the explanation is
    jitter: float  # m2, variance of one nominal pitch that is not in the thread
    explanation: Explanation
    cost: float


def without_control(data: Fluctuations, candidates: Dictionary) -> Explanation:
    """The measured fluctuation by shapes alone."""
    return explain(data.measured / data.uncertainty, candidates, measured_variance(data.linked))


def hypotheses(data: Fluctuations, nominal: Nominal, candidates: Dictionary, shapes: Explanation) -> \
        dict[str, Hypothesis]:
    """The four, by cause; without the control where it did too little to show. ``shapes``: ``without_control``."""
    plain = data.measured / data.uncertainty
    absent = np.zeros_like(plain)
    noise = unexplained(plain)
    moved = energy(data, nominal, candidates)
    surprise = PHYSICS if nominal.moves and moved > SHOWS else 0.0
    found = [Hypothesis(NONE, 0.0, absent, data.uncertainty, nominal.jitter, noise, noise.cost + surprise),
             Hypothesis(MECHANICAL, 0.0, absent, data.uncertainty, nominal.jitter, shapes, shapes.cost + surprise)]
    if moved < (MOVED if nominal.moves else VISIBLE):
        return {one.cause: one for one in found}
    sights = _sights(data, nominal, candidates, shapes)
    for cause in (CONTROL, BOTH):
        offers = [_with_control(cause, data, seen, candidates, shapes) for seen in sights]
        found.append(min(offers, key=lambda one: one.cost))
    return {one.cause: one for one in found}


def decide(costs: dict[str, float], moved: bool = False) -> str:
    """The cause that costs least, where no other does nearly as well; the simpler of two that do.

    Noise alone needs a small margin only: every cause has paid its price already. Where "both" wins over a single
    cause by less than ``MARGIN``, the other cause is too small to be sure of, and the single one is named. But where
    the detectors surely saw the feed move (``moved``), mechanics alone are not the simpler explanation: it is both.
    """
    best = min(costs, key=lambda cause: costs[cause])
    if best == NONE:
        other = min(cost for cause, cost in costs.items() if cause != NONE)
        return NONE if other >= costs[NONE] + NOISE_MARGIN else UNDETERMINED
    near = {cause for cause, cost in costs.items() if cost < costs[best] + MARGIN}
    if NONE in near or {CONTROL, MECHANICAL} <= near:
        return UNDETERMINED
    if moved and {MECHANICAL, BOTH} <= near:
        return BOTH
    return next((cause for cause in (CONTROL, MECHANICAL) if cause in near), best)


def sure(costs: dict[str, float]) -> str:
    """The single cause without which every explanation is worse by ``MARGIN``; empty where there is none, or both."""
    least = min(costs.values())
    parts = {CONTROL: (NONE, MECHANICAL), MECHANICAL: (NONE, CONTROL)}
    found = [cause for cause, without in parts.items()
             if all(costs[one] >= least + MARGIN for one in without if one in costs)]
    return found[0] if len(found) == 1 else ""


def _sights(data: Fluctuations, nominal: Nominal, candidates: Dictionary, measured: Explanation) -> list[Seen]:
    """The nominal fluctuation as it is; where it jitters, also what its shapes, and those of the thread, make of it."""
    found = [Seen(data.nominal, np.maximum(jitter, data.doubt**2), jitter)
             for jitter in sorted({nominal.least_jitter, nominal.jitter})]
    rough = max(nominal.jitter, float(np.mean(data.doubt**2)))
    if math.sqrt(rough) <= WORTH_SMOOTHING * float(np.median(data.uncertainty)):
        return found
    offers = [nominal.shapes, tuple(dict.fromkeys(nominal.shapes + measured.shapes))] if nominal.moves else []
    if not nominal.moves and _told(data.nominal, nominal.jitter, data, measured.basis):
        offers = [measured.shapes]
    for shapes in offers:
        basis = span(shapes, candidates)
        found.append(Seen(basis @ (basis.T @ data.nominal), rough * np.sum(basis**2, axis=1), nominal.jitter))
    return found


def _told(deviation: FloatArray, jitter: float, data: Fluctuations, basis: FloatArray) -> bool:
    """Whether the part of a deviation in these directions stands out of the nominal pitches' jitter."""
    square = (basis.T @ deviation) ** 2 / crossing_variance(data.linked)(basis)
    return float(np.sum(square)) > TOLD * jitter


def hidden(data: Fluctuations, nominal: Nominal, mechanical: Hypothesis) -> bool:
    """Whether the nominal pitches jitter so much that they would not show what the thread shows."""
    jitter = nominal.least_jitter
    if nominal.moves or jitter <= 0.0:
        return False
    found = mechanical.explanation
    irregular = float(np.sum((found.left * mechanical.scale)**2)) if found.irregular > 1.0 else 0.0
    return irregular < TOLD * jitter and not _told(data.measured, jitter, data, found.basis)


def _with_control(cause: str, data: Fluctuations, seen: Seen, candidates: Dictionary,
                  mechanical: Explanation) -> Hypothesis:
    """The nominal fluctuation is taken off with the gain within its range that leaves least."""
    scale = np.sqrt(data.uncertainty**2 + seen.variance)
    nominal, measured = seen.nominal / scale, data.measured / scale
    added = float(2.0 * np.sum(np.log(scale / data.uncertainty)))
    gain, basis = 1.0, np.zeros((nominal.size, 0))
    for _ in range(2):  # the gain depends a little on the shapes, and they on the gain
        gain = _gain(nominal, measured, basis)
        rest = measured - gain * nominal
        shapes = unexplained(rest)
        if cause == BOTH:
            variance = measured_variance(data.linked)
            same = with_shapes(rest, mechanical.shapes, candidates, variance)
            shapes = min(explain(rest, candidates, variance), pruned(rest, same, candidates, variance),
                         key=lambda one: one.cost)
        basis = shapes.basis
    price = CONTROL_PRICE + ((gain - 1.0) / GAIN_SPREAD) ** 2
    return Hypothesis(cause, gain, seen.nominal, scale, seen.jitter, shapes, shapes.cost + added + price)


def energy(data: Fluctuations, nominal: Nominal, candidates: Dictionary) -> float:
    """Sum of the squares of the nominal fluctuation less its jitter, over the measuring uncertainty."""
    whole = float(np.sum((data.nominal**2 - np.maximum(nominal.least_jitter, data.doubt**2)) / data.uncertainty**2))
    basis = span(nominal.shapes, candidates)
    return max(whole, float(np.sum((basis @ (basis.T @ data.nominal) / data.uncertainty)**2)))


def _gain(nominal: FloatArray, measured: FloatArray, basis: FloatArray) -> float:
    """g that minimises |measured - g nominal|^2 beside the basis, plus ((g - 1) / GAIN_SPREAD)^2."""
    free = nominal - basis @ (basis.T @ nominal)
    square, known = float(free @ free), GAIN_SPREAD**-2
    if not square > 0.0 or not math.isfinite(square):
        return 1.0
    return float(np.clip((float(free @ measured) + known) / (square + known), *GAIN_RANGE))
