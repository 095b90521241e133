"""The four hypotheses about a pair of tables, and the evidence that they leave."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from threadpitch.judgement import tendency
from threadpitch.judgement.alignment import Pair
from threadpitch.judgement.equivalence import EXPANDED, WORTH_NAMING, bound
from threadpitch.judgement.hypotheses import (
    BOTH,
    CONTROL,
    HARDLY,
    MECHANICAL,
    NOISE_MARGIN,
    NONE,
    UNDETERMINED,
    Fluctuations,
    Hypothesis,
    decide,
    energy,
    hidden,
    hypotheses,
    sure,
    without_control,
)
from threadpitch.judgement.jitter import Nominal, nominal_parts
from threadpitch.judgement.noise import neighbours
from threadpitch.judgement.pursuit import span, sure_event
from threadpitch.judgement.shapes import Dictionary, Shape, dictionary
from threadpitch.judgement.verdict import Evidence, Part
from threadpitch.trace import FloatArray


@dataclass(frozen=True, eq=False)
class Assessment:
    """Deviations of one pair of tables, and all hypotheses about them."""

    data: Fluctuations
    nominal: Nominal
    candidates: Dictionary
    found: dict[str, Hypothesis]
    offset: float
    moved: float  # sum of the squares of what the nominal pitches move by, over the uncertainty

    @property
    def moves(self) -> bool:
        """Whether the control surely moves the feed by what can be measured."""
        return self.nominal.moves and self.moved > HARDLY

    @property
    def costs(self) -> dict[str, float]:
        """By cause."""
        return {cause: one.cost for cause, one in self.found.items()}

    @property
    def moves_much(self) -> bool:
        """Whether it moves the feed, in some turn, by what the measurement of a single turn shows.

        And by a part of the thread's largest deviation that is worth naming.
        """
        least = np.maximum(EXPANDED * self.data.uncertainty, WORTH_NAMING * np.abs(self.data.measured).max())
        return self.moves and bool(np.any(np.abs(self._movement) >= least))

    @property
    def _movement(self) -> FloatArray:
        """(turns,) m: the nominal fluctuation without its jitter."""
        basis = span(self.nominal.shapes, self.candidates)
        return np.asarray(basis @ (basis.T @ self.data.nominal))

    def cause(self, negligible: float | None = None) -> str:
        """What the costs tell, where the nominal pitches could tell it; ``cause_at`` has the arguments."""
        return self.cause_at(self.costs, negligible)

    def cause_at(self, costs: dict[str, float], negligible: float | None = None) -> str:
        """The same at other costs.

        A cause is not called absent unless it is surely smaller than what does not matter: ``negligible``, m, or what a
        judgement of so many turns is sure to find or, where another cause is named, as much as that one.
        """
        cause = decide(costs, self.moves_much)
        if cause == NONE and self.moves:
            return UNDETERMINED  # the control does move the feed, by less than this thread can show
        if cause == MECHANICAL and hidden(self.data, self.nominal, self.found[MECHANICAL]):
            return UNDETERMINED
        if cause == MECHANICAL and negligible is not None and self.moves and \
                bool(np.any(np.abs(self._movement) > negligible)):
            return BOTH if BOTH in costs else UNDETERMINED
        if cause in (NONE, CONTROL, MECHANICAL) and self.bound_beside(cause) > self._matters(cause, negligible):
            return UNDETERMINED
        return cause

    def bound_beside(self, cause: str) -> float:
        """m, of 95 %: no deviation by a cause that is not named is larger."""
        data = self.data
        if cause == CONTROL:
            chosen = self.found[CONTROL]
            return bound(data.measured - chosen.gain * chosen.seen, chosen.scale)
        if cause == MECHANICAL:
            return bound(data.nominal, np.maximum(math.sqrt(self.nominal.jitter), data.doubt))
        return bound(data.measured, data.uncertainty)

    def _matters(self, cause: str, negligible: float | None) -> float:
        """m: so large may the bound be."""
        if negligible is not None:
            return negligible
        if cause == MECHANICAL:
            return math.inf  # what the control did is seen, and what jitter hides of it was asked before
        scale = self.found[cause].scale
        least = float(np.sqrt(np.mean(scale**2))) * sure_event(scale.size, NOISE_MARGIN)
        return least if cause == NONE else max(least, float(np.abs(self.found[cause].seen).max()))


def assess(pair: Pair, screw_turns: float | None, parts: int = 1) -> Assessment:
    """The hypotheses about P - target of the two tables; of one part where a thread is judged in several."""
    data = Fluctuations(pair.turns, pair.nominal - pair.target, pair.measured - pair.target, pair.uncertainty,
                        neighbours(pair.turns), pair.nominal_uncertainty)
    candidates = dictionary(tuple(pair.turns.tolist()), screw_turns, parts)
    shapes = without_control(data, candidates)
    nominal = nominal_parts(data.nominal, (data.measured, shapes.left * data.uncertainty), data.linked, candidates)
    return Assessment(data, nominal, candidates, hypotheses(data, nominal, candidates, shapes), pair.offset,
                      energy(data, nominal, candidates))


def evidence(found: Assessment, cause: str) -> Evidence:
    """The numbers that belong to a verdict."""
    data = found.data
    chosen = _hypothesis(found, cause)
    mechanical = chosen.cause in (MECHANICAL, BOTH)
    basis = chosen.explanation.basis if mechanical else np.zeros((data.turns.size, 0))
    uncertainty = float(np.sqrt(np.mean(data.uncertainty**2)))
    gain = tendency.gain(data.nominal, data.measured, basis, (uncertainty**2, chosen.jitter))
    related = tendency.correlation(data.nominal, data.measured)
    fluctuation = float(np.sqrt(np.mean(data.measured**2)))
    known = sure(found.costs)
    return Evidence(
        turns=data.turns.size, offset=found.offset, fluctuation=fluctuation,
        largest=float(data.measured[np.argmax(np.abs(data.measured))]), uncertainty=uncertainty,
        gain=None if gain is None else gain[0], gain_interval=None if gain is None else gain[1:],
        correlation=None if related is None else related[0],
        correlation_interval=None if related is None else related[1:],
        permutation_p=tendency.permutation_p(data.turns, data.nominal, data.measured),
        sign_agreement=tendency.sign_agreement(data.nominal, data.measured),
        control_share=_share(data, chosen), nominal_jitter=math.sqrt(chosen.jitter),
        rest=tuple(_parts(chosen, data, found.candidates)) if mechanical else (),
        irregular=_irregular(chosen), within_turn=None, costs=found.costs,
        span=(float(data.turns[0]), float(data.turns[-1])),
        movement=math.sqrt(max(found.moved, 0.0) / data.turns.size) * uncertainty if found.moves else 0.0,
        detectable=uncertainty * sure_event(data.turns.size, NOISE_MARGIN),
        bound=math.nan if cause == BOTH else found.bound_beside(cause if cause != UNDETERMINED else known), sure=known,
    )


def of_the_whole(part: Evidence, pair: Pair) -> Evidence:
    """The evidence of one stretch with the numbers that can be told of the whole thread."""
    nominal, measured = pair.nominal - pair.target, pair.measured - pair.target
    related = tendency.correlation(nominal, measured)
    uncertainty = float(np.sqrt(np.mean(pair.uncertainty**2)))
    gain = tendency.gain(nominal, measured, np.zeros((nominal.size, 0)), (uncertainty**2, part.nominal_jitter**2))
    return replace(part, turns=pair.turns.size, span=(float(pair.turns[0]), float(pair.turns[-1])),
                   uncertainty=uncertainty, fluctuation=float(np.sqrt(np.mean(measured**2))),
                   largest=float(measured[np.argmax(np.abs(measured))]),
                   gain=None if gain is None else gain[0], gain_interval=None if gain is None else gain[1:],
                   correlation=None if related is None else related[0],
                   correlation_interval=None if related is None else related[1:],
                   permutation_p=tendency.permutation_p(pair.turns, nominal, measured),
                   sign_agreement=tendency.sign_agreement(nominal, measured))


def _hypothesis(found: Assessment, cause: str) -> Hypothesis:
    """That of the cause; of an undetermined one the cheapest."""
    if cause in found.found and cause != UNDETERMINED:
        return found.found[cause]
    return min(found.found.values(), key=lambda one: one.cost)


def _share(data: Fluctuations, chosen: Hypothesis) -> float:
    """|g x|^2 / (|g x|^2 + |y - g x|^2), the noise taken off the rest; 0 or 1 where one of them has no part."""
    if chosen.cause != BOTH:
        return 1.0 if chosen.cause == CONTROL else 0.0
    control = float(np.sum((chosen.gain * chosen.seen) ** 2))
    noise = float(np.sum(chosen.scale**2))
    rest = max(float(np.sum((data.measured - chosen.gain * chosen.seen) ** 2)) - noise, 0.0)
    return control / max(control + rest, 1e-30)


def _parts(chosen: Hypothesis, data: Fluctuations, candidates: Dictionary) -> list[Part]:
    """The shapes with their sizes, fitted together to what the control leaves; the largest first."""
    shapes = chosen.explanation.shapes
    if not shapes:
        return []
    rest = (data.measured - chosen.gain * chosen.seen) / chosen.scale
    indices = [index for shape in shapes for index in shape.columns]
    sizes = np.linalg.lstsq(candidates.columns[:, indices], rest, rcond=None)[0]
    found: list[Part] = []
    for shape in shapes:
        here, sizes = sizes[:len(shape.columns)], sizes[len(shape.columns):]
        found.append(_part(shape, candidates.columns[:, shape.columns] @ here * chosen.scale))
    return sorted(found, key=lambda part: -abs(part.size))


def _part(shape: Shape, share: FloatArray) -> Part:
    largest = float(share[np.argmax(np.abs(share))])
    if len(shape.columns) == 2:  # a wave: what it reaches between the turns counts as well
        largest = math.sqrt(2.0 * float(np.mean(share**2))) if shape.period > 2.0 + 1e-9 else abs(largest)
    return Part(shape.kind, largest, float(shape.turns[0]), float(shape.turns[1]),
                None if math.isnan(shape.period) else shape.period, None if math.isnan(shape.decay) else shape.decay)


def _irregular(chosen: Hypothesis) -> float:
    """Root mean square [m] of the rest beside its parts and the noise, where it is more than noise."""
    excess = chosen.explanation.irregular**2 - 1.0
    return math.sqrt(excess * float(np.mean(chosen.scale**2))) if excess > 0.0 else 0.0
