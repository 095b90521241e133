"""``judge``: nominal and measured pitches -> where the fluctuation comes from, with the evidence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from threadpitch.judgement.alignment import MeasuredThread, Pair, pairs
from threadpitch.judgement.assessment import Assessment, assess, evidence, of_the_whole
from threadpitch.judgement.hypotheses import BOTH, CONTROL, MECHANICAL, NONE, UNDETERMINED
from threadpitch.judgement.judged_rows import Row, doubts, rows_of, targets_of
from threadpitch.judgement.verdict import JudgementError, Verdict
from threadpitch.judgement.within_turn import drunkenness, measured_drunkenness
from threadpitch.judgement.wording import advice, sentence
from threadpitch.pitch import PitchTable
from threadpitch.trace import FloatArray
from threadpitch.units import from_si

FEWEST_TURNS = 6
MOST_TURNS = 400  # of one stretch; the shapes of more are too many to try
MOST_OFFSETS = 40  # ways to lay tables of different lengths over one another
NEAR_OFFSETS = 8.0  # cost by which another place may fit worse and still be the right one
SHIFTS = tuple(range(-12, 0)) + tuple(range(1, 13))  # turns by which tables may be out of step: an approach is as long
_SHIFT_WORTH = 0.5  # part of the squares of measured less nominal pitch that a shift must leave at most to be tried
_ALIKE = 1.3  # shares of the squares by which two shifts fit alike
_SHIFT_KEEPS = 0.6  # part of the turns that both tables must still have then
_NO_FLUCTUATION = 0.4  # of the target: the pitches' median is that far off where the unit or the thread is another
_COARSEST = 0.1  # of the target: uncertainty above which no thread is judged
OUT_OF_STEP = 14.0  # cost that a shift saves where the tables are numbered differently


@dataclass(frozen=True)
class _Question:
    """What is asked about every row."""

    target: float  # m
    uncertainty: float | None  # m
    screw_turns: float | None
    negligible: float | None = None  # m, deviation of a pitch that does not matter
    parts: int = 1  # rows that are judged: as many times the shapes to choose from


def judge(nominal: ArrayLike | PitchTable, measured: ArrayLike | MeasuredThread | Sequence[MeasuredThread], *,
          target: ArrayLike, uncertainty: float | None = None, screw_lead: float | None = None,
          negligible: float | None = None) -> Verdict:
    """Cause of the fluctuation of a thread's pitches: control, mechanical, both, none or undetermined.

        P_measured(n) - P_ref = g (P_nominal(n) - P_ref) + rest(n) + noise,  g = 1 but for what the control cannot see

    Four hypotheses (noise; g; a rest made of few shapes; both) are compared by their likelihood, each with the price
    of what it may choose from. A cause is named where it wins by a margin; else the verdict is undetermined.

    Args:
        nominal: P(n) (revolutions,) m, or (start_angles, revolutions), or the table that ``thread_pitch`` makes.
        measured: P_n (revolutions,) m, or (start_angles, revolutions); NaN where a turn was not measured. Or measured
            threads with turn numbers, positions, uncertainties of their own; several for several start angles.
        target: P_ref, m: the movement per revolution that was wanted (the lead); of a thread with variable lead that of
            every nominal turn, (revolutions,) or (start_angles, revolutions).
        uncertainty: standard uncertainty of one measured pitch, m; those of a measured thread win. That of the nominal
            pitches' crossings counts besides where their table has one.
        screw_lead: lead of the feed's ball screw, m: finds what repeats with its turns.
        negligible: deviation of one pitch, m, that does not matter: a cause is called absent only where it surely makes
            no larger one, else the verdict is undetermined. None: what is sure to be found in so many turns (5 to 6
            uncertainties), or as much as the cause that is named.

    Tables of different length are laid over one another by turn numbers or positions, or where there are none, by
    their fluctuations, if those leave no doubt. More than ``MOST_TURNS`` turns are judged in stretches.

    Raises:
        JudgementError: no numbers, no target or uncertainty, tables that cannot be laid over one another.

    Source: US 2016/0008901 A1, paragraphs 46 to 51.
    """
    targets = targets_of(target)
    lead = float(np.nanmean(targets))
    changes = float(np.nanmax(targets)) > float(np.nanmin(targets))  # the lead: no period of the screw, no mean w
    question = _question(lead, uncertainty, None if changes else screw_lead, negligible)
    rows = rows_of(nominal, measured, targets)
    question = replace(question, parts=len(rows))
    for row in rows:
        _plausible(row, question)
    verdicts = [_judge_row(row, question) for row in rows]
    seen = drunkenness(nominal, lead, _judged(verdicts)) if isinstance(nominal, PitchTable) and not changes \
        else None
    shown = measured_drunkenness([row.measured for row in rows], lead) if not changes else None
    verdicts = [replace(one, evidence=replace(one.evidence, within_turn=seen, measured_within_turn=shown),
                        notes=(*doubts(row, lead), *one.notes)) for row, one in zip(rows, verdicts, strict=True)]
    return verdicts[0] if len(verdicts) == 1 else together(verdicts, negligible)


def _question(target: float, uncertainty: float | None, screw_lead: float | None,
              negligible: float | None) -> _Question:
    for name, value in (("target", target), ("uncertainty", uncertainty), ("screw lead", screw_lead),
                        ("negligible deviation", negligible)):
        if value is not None and not 0.0 < value < 1.0:
            raise JudgementError(f"{name} is {_mm(value)} mm; give a positive length below 1 m")
    return _Question(target, uncertainty, None if screw_lead is None else target / screw_lead, negligible)


def _judged(verdicts: list[Verdict]) -> tuple[int, int] | None:
    """First and last turn that any row judged."""
    spans = [one.evidence.span for one in verdicts if np.isfinite(one.evidence.span).all()]
    return (int(min(first for first, _ in spans)), int(max(last for _, last in spans))) if spans else None


def _plausible(row: Row, question: _Question) -> None:
    """A wrong unit, the other sign or another thread is no fluctuation."""
    for name, values in (("nominal", row.nominal.pitch), ("measured", row.measured.pitch)):
        if np.isnan(values).all():
            raise JudgementError(f"there are no {name} pitches but missing ones; give those of {FEWEST_TURNS} turns")
        middle = float(np.nanmedian(values))
        if abs(middle - question.target) > _NO_FLUCTUATION * question.target:
            raise JudgementError(f"the {name} pitches are {_mm(middle)} mm in their middle and the target is "
                                 f"{_mm(question.target)} mm; look at the unit and the sign of both: pitches are "
                                 "positive in the direction of the cut, and the target is the movement per revolution "
                                 "(the lead)")
    uncertainty = question.uncertainty if row.measured.uncertainty is None else float(row.measured.uncertainty.max())
    if uncertainty is not None and uncertainty > _COARSEST * question.target:
        raise JudgementError(f"the uncertainty of {_mm(uncertainty)} mm is more than a tenth of the target of "
                             f"{_mm(question.target)} mm, which shows no fluctuation; give the standard uncertainty of "
                             "one pitch, and look at its unit")


def _mm(length: float) -> str:
    return f"{from_si(length, 'mm'):.4g}"


def _judge_row(row: Row, question: _Question) -> Verdict:
    measured = row.measured
    uncertainty = measured.uncertainty
    if uncertainty is None:
        if question.uncertainty is None:
            raise JudgementError("the measuring uncertainty is not known; give the standard uncertainty of one "
                                 "measured pitch")
        uncertainty = np.full(measured.pitch.size, question.uncertainty)
    if not (np.isfinite(uncertainty) & (uncertainty > 0.0)).all():
        raise JudgementError("an uncertainty of the measured pitches is not positive; give standard uncertainties in m")
    offered = pairs(row.nominal, measured, uncertainty)
    most = max(one.turns.size for one in offered)
    if most < FEWEST_TURNS:
        return _too_few(max(offered, key=lambda one: one.turns.size), question)
    if most > MOST_TURNS and len(offered) > 1:
        raise JudgementError(f"{most} turns are in both tables, which are of different length; give the measured "
                             "turns' numbers or positions")
    if most > MOST_TURNS:
        return _in_stretches(offered[0], question)
    if len(offered) == 1:
        return _in_step(offered[0], row, uncertainty, question)
    return _by_fluctuation(offered, question)


def _in_stretches(pair: Pair, question: _Question) -> Verdict:
    """Many turns are judged part by part, with as many times the shapes to choose from; the evidence is of all."""
    count = math.ceil(pair.turns.size / MOST_TURNS)
    parts = [pair.only(pair.part(k, count)) for k in range(count)]
    verdicts = []
    for part in parts:
        found = assess(part, question.screw_turns, count * question.parts)
        verdicts.append(_worded(found.cause(question.negligible), found, ()))
    bounds = [f"{part.turns[0]:g} to {part.turns[-1]:g}" for part in parts]
    chief = together(verdicts, question.negligible)
    note = f"judged in {count} stretches: turns {', '.join(bounds)}; the parts of the rest are those of one of them"
    return replace(chief, evidence=of_the_whole(chief.evidence, pair), notes=(note,))


def _in_step(pair: Pair, row: Row, uncertainty: FloatArray, question: _Question) -> Verdict:
    """Tables of one length, and turns that were counted from another groove, may be numbered differently."""
    found = assess(pair, question.screw_turns, question.parts)
    cause = found.cause(question.negligible)
    if row.measured.position is None and cause != NONE:
        shift = _better_shift(pair, row, uncertainty, question)
        if shift:
            note = (f"shifted by {shift} turns the tables agree far better; number the measured turns as the nominal "
                    "table does, or give positions")
            text = (f"Undetermined: the measured turns seem to be numbered otherwise than the nominal ones, by {shift} "
                    "turns.")
            return replace(_worded(UNDETERMINED, found, (note,)), sentence=text,
                           advice=("Number the measured turns as the nominal table does, or give their positions.",))
    return _worded(cause, found, ())


def _better_shift(pair: Pair, row: Row, uncertainty: FloatArray, question: _Question) -> int:
    """By how many turns the measured ones fit far better, so that no chance explains it; 0 = by none."""
    counted = np.arange(1.0, row.measured.pitch.size + 1.0) if row.measured.turn is None else row.measured.turn
    fits: list[tuple[float, int, Pair, Pair]] = []
    for shift in SHIFTS:
        (other,) = pairs(row.nominal, replace(row.measured, turn=counted + shift), uncertainty)
        if other.turns.size < max(FEWEST_TURNS, _SHIFT_KEEPS * pair.turns.size):
            continue
        other = other.only(np.isin(other.turns - shift, pair.turns))
        same = pair.only(np.isin(pair.turns + shift, other.turns))
        share = _misfit(other) / max(_misfit(same), 1e-30)
        if same.turns.size >= FEWEST_TURNS and share <= _SHIFT_WORTH:
            fits.append((share, shift, same, other))
    if not fits:
        return 0
    least = min(share for share, *_ in fits)  # a ripple fits again a period further: the smallest shift of those alike
    _, shift, same, other = min((one for one in fits if one[0] <= _ALIKE * least), key=lambda one: abs(one[1]))
    here = assess(same, question.screw_turns, question.parts)
    there = assess(other, question.screw_turns, question.parts)
    likeliest = min(there.costs, key=lambda cause: there.costs[cause])
    if likeliest not in (CONTROL, BOTH):  # it only shifts what the thread does not have out of sight
        return 0
    return shift if there.costs[likeliest] < min(here.costs.values()) - OUT_OF_STEP else 0


def _misfit(pair: Pair) -> float:
    """Sum of the squares of measured less nominal pitch over the uncertainty."""
    return float(np.sum(((pair.measured - pair.nominal) / pair.uncertainty) ** 2))


def _by_fluctuation(offered: list[Pair], question: _Question) -> Verdict:
    """Laid over one another where the fluctuations fit best, if they leave no doubt or the cause is the same."""
    if len(offered) > MOST_OFFSETS:
        raise JudgementError(f"{offered[0].offset - offered[-1].offset:+.0f} turns between the lengths of the tables; "
                             "give the measured turns' numbers or positions")
    tried = [assess(one, question.screw_turns, question.parts) for one in offered]
    chance = 2.0 * math.log(len(offered))  # the best of many offsets fits better by chance
    costs = [{cause: cost + (chance if cause in (CONTROL, BOTH) else 0.0) for cause, cost in one.costs.items()}
             for one in tried]
    least = [min(one.values()) for one in costs]
    best = least.index(min(least))
    near = [i for i, cost in enumerate(least) if cost < least[best] + NEAR_OFFSETS]
    causes = {tried[i].cause_at(costs[i], question.negligible) for i in near}
    if len(causes) > 1:
        raise JudgementError(f"the {offered[0].measured.size} measured turns fit the nominal ones in {len(near)} "
                             f"places, with different verdicts ({', '.join(sorted(causes))}); give their turn numbers "
                             "or positions")
    first = offered[best].offset + 1.0
    note = f"turn 1 of the measured table is turn {first:g} of the nominal one, by their fluctuations"
    if len(near) > 1:
        note = f"which turn is which is not known: {len(near)} places fit, with the same verdict"
    return _worded(causes.pop(), tried[best], (note,))


def _too_few(pair: Pair, question: _Question) -> Verdict:
    if pair.turns.size == 0:
        raise JudgementError("no turn is in both tables; number the measured turns as the nominal table does")
    found = evidence(assess(pair, question.screw_turns, question.parts), UNDETERMINED)
    known = "1 turn is" if pair.turns.size == 1 else f"{pair.turns.size} turns are"
    text = f"Undetermined: {known} in both tables, and fewer than {FEWEST_TURNS} tell nothing."
    return Verdict(UNDETERMINED, text, ("Measure more turns.",), found)


def _worded(cause: str, found: Assessment, notes: tuple[str, ...]) -> Verdict:
    told = evidence(found, cause)
    return Verdict(cause, sentence(cause, told), advice(cause, told), told, notes)


def _likeliest_noise(one: Verdict) -> bool:
    """Whether noise is the likeliest of the causes, and the control surely moves nothing."""
    costs = one.evidence.costs
    return bool(costs) and min(costs, key=lambda cause: costs[cause]) == NONE and one.evidence.movement == 0.0


def together(verdicts: list[Verdict], negligible: float | None = None) -> Verdict:
    """One verdict on several start angles, flanks or stretches: a cause that one of them shows is there.

    One that is not named must be negligible, m, in all of them, where that is told.

    Where noise is the likeliest in all of them, and surely in most, that some are less sure is to be expected.
    """
    causes = {one.cause for one in verdicts}
    doubtful = [one for one in verdicts if one.cause == UNDETERMINED]
    if causes == {NONE, UNDETERMINED} and 2 * len(doubtful) <= len(verdicts) and all(map(_likeliest_noise, doubtful)):
        causes = {NONE}
    if BOTH in causes or {CONTROL, MECHANICAL} <= causes:
        cause = BOTH
    else:
        cause = next(one for one in (CONTROL, MECHANICAL, UNDETERMINED, NONE) if one in causes)
    chief = max((one for one in verdicts if one.cause == cause), default=verdicts[0],
                key=lambda one: one.evidence.fluctuation)
    if cause not in causes:
        text = "Some of the rows show the control, others mechanics: both."
        return replace(chief, cause=cause, sentence=text, rows=tuple(verdicts),
                       advice=tuple(dict.fromkeys(line for one in verdicts for line in one.advice)))
    told = replace(chief.evidence, bound=max(one.evidence.bound for one in verdicts)) if cause != BOTH else \
        chief.evidence
    if negligible is not None and cause != BOTH and told.bound > negligible:
        cause = UNDETERMINED
    return replace(chief, cause=cause, evidence=told, sentence=sentence(cause, told), advice=advice(cause, told),
                   rows=tuple(verdicts))
