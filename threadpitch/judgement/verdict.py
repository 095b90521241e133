"""The verdict on a thread: its cause, the numbers it rests on, and what to do."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from threadpitch.units import from_si, to_si


class JudgementError(ValueError):
    """Pitches that cannot be judged: what is wrong with them, where, and how to mend it."""


@dataclass(frozen=True)
class Part:
    """One shape of what the control does not explain.

    ``kind``: progressive (every pitch off by the same), drift (changing along the thread), periodic, once per screw
    turn, event (one turn), displaced turn (one groove displaced: long, then short), section, start, end.
    """

    kind: str
    size: float  # m, amplitude of a periodic part, else the largest deviation with its sign
    first_turn: float
    last_turn: float
    period: float | None = None  # turns
    decay: float | None = None  # turns in which it falls to 1/e

    def __str__(self) -> str:
        size = f"{from_si(self.size, 'um'):.3g} um"
        if self.period is not None:
            return f"{self.kind}, amplitude {size}, period {self.period:.3g} turns"
        if self.decay is not None:
            return f"an effect of the {self.kind}, {size}, gone after {3.0 * self.decay:.2g} turns"
        if self.kind == "progressive":
            return f"progressive, {size} per turn"
        named = f"{'an' if self.kind == 'event' else 'a'} {self.kind}"
        if self.first_turn == self.last_turn:
            return f"{named} of {size} at turn {self.first_turn:g}"
        return f"{named} of {size}, turns {self.first_turn:g} to {self.last_turn:g}"


@dataclass(frozen=True)
class Evidence:
    """The numbers behind a verdict; lengths in m, intervals of 95 %."""

    turns: int  # that both tables have
    offset: float  # turn of the nominal table less that of the measured one, as they were given
    fluctuation: float  # root mean square of the measured pitch less target
    largest: float  # largest measured deviation from the target, with its sign
    uncertainty: float  # standard, of one measured pitch
    gain: float | None  # g of P_measured - P_ref = g (P_nominal - P_ref) + ...; None = the nominal does not fluctuate
    gain_interval: tuple[float, float] | None
    correlation: float | None  # of the fluctuations about their means
    correlation_interval: tuple[float, float] | None
    permutation_p: float | None  # chance of such a correlation among series of the same spectrum
    sign_agreement: float | None  # share of turns on the same side of the target in both tables
    control_share: float  # square of the control's part over the squares of both parts, the noise taken off
    nominal_jitter: float  # m, standard deviation of nominal pitches that is not in the thread
    rest: tuple[Part, ...]  # what the control does not explain
    irregular: float  # root mean square of the rest beside its parts, where it exceeds the uncertainty; 0 = noise
    within_turn: float | None  # m, largest error within the turn that repeats, nominal; None = not observable
    measured_within_turn: tuple[float, float] | None = None  # m: the same of the thread, and its standard uncertainty
    span: tuple[float, float] = (math.nan, math.nan)  # first and last turn that both tables have, as the nominal one
    movement: float = 0.0  # m, root mean square of what the control surely moves the feed by; 0 = it only jitters
    detectable: float = math.nan  # m: a single turn off by less than this may be taken for noise
    bound: float = math.nan  # m, of 95 %: no deviation by a cause that is not named is larger; NaN where both are
    sure: str = ""  # the cause without which nothing explains the thread, also where the other one is left open
    costs: dict[str, float] = field(default_factory=dict)  # minus twice the logarithm of each cause's likelihood

    @property
    def rest_share(self) -> float:
        """What the control's share leaves."""
        return 1.0 - self.control_share


@dataclass(frozen=True)
class Verdict:
    """Where the fluctuation comes from: control, mechanical, both, none or undetermined."""

    cause: str
    sentence: str
    advice: tuple[str, ...]
    evidence: Evidence
    notes: tuple[str, ...] = ()  # what was done to the tables
    rows: tuple[Verdict, ...] = ()  # one per start angle, where there are several


def verdict_document(verdict: Verdict) -> dict[str, object]:
    """The verdict as a JSON document, lengths in um; null where something cannot be told."""
    found = verdict.evidence
    return {
        "cause": verdict.cause,
        "sentence": verdict.sentence,
        "advice": list(verdict.advice),
        "notes": list(verdict.notes),
        "evidence": {
            "turns": found.turns,
            "first_turn": None if math.isnan(found.span[0]) else found.span[0],
            "last_turn": None if math.isnan(found.span[1]) else found.span[1],
            "offset_turns": found.offset,
            "fluctuation_um": _um(found.fluctuation),
            "largest_um": _um(found.largest),
            "uncertainty_um": _um(found.uncertainty),
            "gain": found.gain,
            "gain_interval": _pair(found.gain_interval),
            "correlation": found.correlation,
            "correlation_interval": _pair(found.correlation_interval),
            "permutation_p": found.permutation_p,
            "sign_agreement": found.sign_agreement,
            "control_share": found.control_share,
            "rest_share": found.rest_share,
            "nominal_jitter_um": _um(found.nominal_jitter),
            "rest": [_part(part) for part in found.rest],
            "irregular_um": _um(found.irregular),
            "movement_um": _um(found.movement),
            "detectable_um": _um(found.detectable),
            "bound_um": _um(found.bound),
            "sure": found.sure,
            "within_turn_um": None if found.within_turn is None else _um(found.within_turn),
            "measured_within_turn_um": _lengths(found.measured_within_turn),
            "costs": {cause: round(cost, 3) for cause, cost in found.costs.items()},
        },
        "rows": [verdict_document(row) for row in verdict.rows],
    }


def _part(part: Part) -> dict[str, object]:
    return {"kind": part.kind, "size_um": _um(part.size), "first_turn": part.first_turn, "last_turn": part.last_turn,
            "period_turns": part.period, "decay_turns": part.decay}


def _lengths(values: tuple[float, float] | None) -> list[float | None] | None:
    return None if values is None else [_um(value) for value in values]


def _pair(interval: tuple[float, float] | None) -> list[float] | None:
    return None if interval is None else list(interval)


def _um(length: float) -> float | None:
    return None if math.isnan(length) else round(from_si(length, "um"), 6)


def read_verdict(document: Mapping[str, Any]) -> Verdict:
    """What ``verdict_document`` made, as a verdict again.

    Raises:
        KeyError: the document lacks something.
        TypeError: it holds something else.
    """
    told: Mapping[str, Any] = document["evidence"]
    parts = tuple(Part(one["kind"], _metres(one["size_um"]), one["first_turn"], one["last_turn"], one["period_turns"],
                       one["decay_turns"]) for one in told["rest"])
    evidence = Evidence(
        turns=told["turns"], offset=told["offset_turns"], fluctuation=_metres(told["fluctuation_um"]),
        largest=_metres(told["largest_um"]), uncertainty=_metres(told["uncertainty_um"]), gain=told["gain"],
        gain_interval=_interval(told["gain_interval"]), correlation=told["correlation"],
        correlation_interval=_interval(told["correlation_interval"]), permutation_p=told["permutation_p"],
        sign_agreement=told["sign_agreement"], control_share=told["control_share"],
        nominal_jitter=_metres(told["nominal_jitter_um"]), rest=parts, irregular=_metres(told["irregular_um"]),
        within_turn=None if told["within_turn_um"] is None else _metres(told["within_turn_um"]),
        measured_within_turn=_both(told["measured_within_turn_um"]),
        span=(_number(told["first_turn"]), _number(told["last_turn"])), movement=_metres(told["movement_um"]),
        detectable=_metres(told["detectable_um"]), costs=dict(told["costs"]),
        bound=_metres(told.get("bound_um")), sure=told.get("sure", ""))  # kept verdicts of former versions lack them
    return Verdict(document["cause"], document["sentence"], tuple(document["advice"]), evidence,
                   tuple(document["notes"]), tuple(read_verdict(row) for row in document["rows"]))


def _metres(length_um: float | None) -> float:
    return math.nan if length_um is None else to_si(length_um, "um")


def _interval(ends: Sequence[float] | None) -> tuple[float, float] | None:
    return None if ends is None else (ends[0], ends[1])


def _both(lengths_um: Sequence[float | None] | None) -> tuple[float, float] | None:
    return None if lengths_um is None else (_metres(lengths_um[0]), _metres(lengths_um[1]))


def _number(value: float | None) -> float:
    return math.nan if value is None else value
