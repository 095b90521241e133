"""What ``threadpitch analyze`` says about measured pitches and about a thread's tolerance."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
from rich.console import Console
from rich.text import Text

from threadpitch.cli.printing import fail
from threadpitch.judgement import (
    ControlParts,
    ControlTrace,
    Evidence,
    ExpectedLag,
    JudgementError,
    MeasuredThread,
    Turns,
    Verdict,
    control_documents,
    control_lines,
    control_parts_of,
    judge,
    verdict_document,
    within_turn_line,
)
from threadpitch.judgement.control import FEWEST_TURNS
from threadpitch.judgement.measured_file import read_measured
from threadpitch.pitch import GroupPitch, StreamedPitch, first_lead, leads_of_turns
from threadpitch.sparkline import verdict_line
from threadpitch.tables import printable
from threadpitch.tolerance import PitchConformity, Thread, parse_thread, pitch_conformity
from threadpitch.trace import FloatArray
from threadpitch.units import from_si, to_si


@dataclass(frozen=True)
class Judged:
    """Options of the command line about the real thread, in their units."""

    measured: Path | None = None
    target_mm: float | None = None
    uncertainty_um: float | None = None
    screw_lead_mm: float | None = None
    thread: str | None = None
    limit_percent: float = 25.0
    engagement_mm: float | None = None
    expected_lag_ms: float | None = None
    negligible_um: float | None = None
    lead_change_mm: float | None = None


@dataclass(frozen=True)
class Findings:
    """What was found: a verdict where pitches were measured, tolerances where a thread was named."""

    group: str = ""
    verdict: Verdict | None = None
    tolerances: tuple[tuple[str, PitchConformity], ...] = ()  # (of what, how it keeps to its tolerance)
    measured: tuple[MeasuredThread, ...] = ()
    target: float | None = None  # m, where it is known
    control: tuple[ControlParts, ...] = ()  # where in the control, by start angle, where the log tells it
    why_not: str = ""


# The last group of the log as a recording, for where in the control its fluctuation comes from
Recording: TypeAlias = Callable[[], ControlTrace]
NO_TOLERANCE = "a thread whose lead changes has no tolerance of ISO 965; leave --thread or --lead-change out"
_SAME_LEAD = 0.02  # part of the lead by which the target may be another and mean this thread


def find(groups: Sequence[GroupPitch | StreamedPitch], asked: Judged, recording: Recording) -> Findings:
    """Judge the last group of the log: the pass that leaves the groove.

    Raises:
        JudgementError: the measured pitches cannot be judged.
        ToleranceError: the designation cannot be read.
        LatheError: an option is missing.
    """
    group = groups[-1]
    _check(asked)
    thread = None if asked.thread is None else parse_thread(asked.thread)
    measured = [] if asked.measured is None else read_measured(asked.measured)
    verdict = _verdict(group, measured, thread, asked) if measured else None
    tolerances = tuple(_tolerances(group, measured, thread, asked)) if thread else ()
    target = _target(thread, asked)
    known = Findings(group.label, verdict, tolerances, tuple(measured), None if asked.lead_change_mm else target)
    if verdict is None:
        return known
    control, why_not = _where_in_the_control(verdict, group, _targets(group, target or 0.0, asked), asked, recording)
    return replace(known, control=control, why_not=why_not)


def _check(asked: Judged) -> None:
    """In the units of the command line, before anything is told in SI."""
    for option, value, unit in (("--uncertainty", asked.uncertainty_um, "um"),
                                ("--engagement", asked.engagement_mm, "mm"),
                                ("--negligible", asked.negligible_um, "um"),
                                ("--ball-screw", asked.screw_lead_mm, "mm")):
        if value is not None and not value > 0.0:
            fail(f"{option} is {value:g} {unit}; give a positive length")
    if not 0.0 < asked.limit_percent <= 100.0:
        fail(f"--limit is {asked.limit_percent:g} %; give a share of the tolerance above 0 and up to 100 %")


def findings_document(found: Findings) -> dict[str, object]:
    """As JSON, lengths in um; what was not asked for is left out."""
    document: dict[str, object] = {}
    if found.verdict is not None:
        control = control_documents(found.control) if found.control else {"why_not": found.why_not}
        document["verdict"] = {"group": found.group, **verdict_document(found.verdict), "control": control}
    if found.tolerances:
        document["tolerance"] = [{"of": name, **_conformity_document(one)} for name, one in found.tolerances]
    return document


def show_findings(console: Console, found: Findings) -> None:
    """The verdict and the tolerances as text."""
    if found.verdict is not None:
        console.print(Text(f"Verdict on the measured pitches, against group {printable(found.group)}", style="bold"))
        console.print(verdict_line(found.verdict.cause, printable(found.verdict.sentence)))
        for line in _verdict_lines(found.verdict, found.measured):
            console.print(Text(printable(line)), soft_wrap=False)
        for line in _control_lines(found):
            console.print(Text(printable(line)))
    for name, one in found.tolerances:
        console.print(Text(f"Tolerance, {printable(name)}", style="bold"))
        for line in _conformity_lines(one):
            console.print(Text(line))


def _verdict(group: GroupPitch | StreamedPitch, measured: list[MeasuredThread], thread: Thread | None,
             asked: Judged) -> Verdict:
    target = _target(thread, asked)
    if target is None:
        fail("the target of the pitch is not known; give --target in mm, or --thread like M20x1.5-6g")
    return judge(group.table, measured, target=_targets(group, target, asked),
                 uncertainty=_si(asked.uncertainty_um, "um"), screw_lead=_si(asked.screw_lead_mm, "mm"),
                 negligible=_si(asked.negligible_um, "um"))


def _target(thread: Thread | None, asked: Judged) -> float | None:
    if asked.target_mm is not None:
        target = to_si(asked.target_mm, "mm")
        if thread is not None and abs(target - thread.lead) > _SAME_LEAD * thread.lead:
            fail(f"the target is {asked.target_mm:g} mm and the lead of {thread.designation} is "
                 f"{from_si(thread.lead, 'mm'):.6g} mm; leave --target out, or write the thread that was cut")
        return target
    return None if thread is None else thread.lead


def _targets(group: GroupPitch | StreamedPitch, target: float, asked: Judged) -> float | FloatArray:
    """m, or (start_angles, turns) m where the lead changes: lead + change (n - 1/2 + o), o the turns from the first
    sample to the start angle, as after G34 with its F and K.
    """
    if not asked.lead_change_mm:
        return target
    if asked.thread is not None:
        fail(NO_TOLERANCE)
    change = to_si(asked.lead_change_mm, "mm")
    return leads_of_turns(group.table, first_lead(group.table, target, change, group.begins), change)


def _where_in_the_control(verdict: Verdict, group: GroupPitch | StreamedPitch, target: float | FloatArray,
                          asked: Judged, recording: Recording) -> tuple[tuple[ControlParts, ...], str]:
    """(parts of the nominal pitches by start angle, "") over the turns that were measured, or ((), why not)."""
    lag = asked.expected_lag_ms
    if lag is not None and not 0.0 < lag < math.inf:
        fail(f"expected lag {lag:g} ms is not positive; give (1 - feedforward)/Kv + Td, like 20")
    first = 1.0 if math.isnan(verdict.evidence.span[0]) else verdict.evidence.span[0]
    table = group.table
    enough = np.sum(np.isfinite(table.pitch[:, int(first) - 1:]), axis=1) >= FEWEST_TURNS
    rows = np.flatnonzero(enough) if enough.any() else np.zeros(1, dtype=np.intp)
    chosen = table.start_angles[rows]
    wanted = target[rows] if isinstance(target, np.ndarray) else target
    try:
        return control_parts_of(recording(), wanted, [Turns(float(one), int(first)) for one in chosen],
                                None if lag is None else ExpectedLag(1e3 / lag)), ""
    except JudgementError as error:
        return (), str(error)


def _control_lines(found: Findings) -> list[str]:
    return control_lines(found.control) if found.control else [f"Where in the control is not told: {found.why_not}"]


def _tolerances(group: GroupPitch | StreamedPitch, measured: list[MeasuredThread], thread: Thread,
                asked: Judged) -> list[tuple[str, PitchConformity]]:
    """Of every measured thread; of the nominal pitches where nothing was measured."""
    share, engagement = asked.limit_percent / 100.0, _si(asked.engagement_mm, "mm")
    found = []
    for one in measured:
        uncertainty = _si(asked.uncertainty_um, "um") or 0.0
        if one.uncertainty is not None:
            uncertainty = float(one.uncertainty.max())
        name = " ".join(word for word in ("measured pitches", one.flank, _angle(one)) if word)
        found.append((name, pitch_conformity(one.pitch, thread, uncertainty=uncertainty, limit_share=share,
                                             engagement=engagement)))
    for row, angle in enumerate([] if measured else group.table.start_angles):
        name = f"nominal pitches of group {group.label}, start angle {np.degrees(angle):.6g} deg"
        found.append((name, pitch_conformity(group.table.pitch[row], thread, limit_share=share,
                                             engagement=engagement)))
    return found


def _angle(measured: MeasuredThread) -> str:
    return "" if measured.start_angle is None else f"at {from_si(measured.start_angle, 'deg'):.6g} deg"


def _si(value: float | None, unit: str) -> float | None:
    return None if value is None else to_si(value, unit)


def _verdict_lines(verdict: Verdict, measured: Sequence[MeasuredThread]) -> list[str]:
    lines = [*(f"  - {line}" for line in verdict.advice), *_evidence_lines(verdict.evidence)]
    lines += [f"Note: {note}" for note in verdict.notes]
    names = [" ".join(word for word in (one.flank, _angle(one)) if word) for one in measured]
    for number, row in enumerate(verdict.rows):
        name = names[number] if len(names) == len(verdict.rows) else ""
        lines.append(f"Measured {name or f'row {number + 1}'}: {row.sentence}")
    return lines


def _evidence_lines(found: Evidence) -> list[str]:
    lines = [f"Turns in both tables: {found.turns}"]
    if found.gain is not None and found.gain_interval is not None:
        lines.append(f"Gain: {found.gain:.3f} ({found.gain_interval[0]:.3f} to {found.gain_interval[1]:.3f})")
    if found.correlation is not None and found.correlation_interval is not None:
        low, high = found.correlation_interval
        lines.append(f"Correlation: {found.correlation:.3f} ({low:.3f} to {high:.3f}), permutation test "
                     f"p = {found.permutation_p:.4f}")
    if found.sign_agreement is not None:
        lines.append(f"Turns on the same side of the target: {100.0 * found.sign_agreement:.0f} %")
    lines.append(f"Share of the control: {100.0 * found.control_share:.0f} %, of the rest: "
                 f"{100.0 * found.rest_share:.0f} %")
    return [*lines, within_turn_line(found) or "Error within the turn that repeats: not observable from P(n)"]


def _conformity_lines(found: PitchConformity) -> list[str]:
    first, last = found.cumulative_turns
    um = {name: from_si(getattr(found, name), "um") for name in ("cumulative", "limit", "per_turn", "tolerance",
                                                                  "expanded_uncertainty")}
    return [
        f"{found.verdict.capitalize()}: cumulative deviation {um['cumulative']:.2f} um (turns {first} to {last}) "
        f"+- {um['expanded_uncertainty']:.2f} um, limit {um['limit']:.2f} um",
        f"Takes {100.0 * found.cumulative_share:.1f} % of the pitch-diameter tolerance of {um['tolerance']:.0f} um; "
        f"one turn at most {um['per_turn']:.2f} um, {100.0 * found.per_turn_share:.1f} %",
    ]


def _conformity_document(found: PitchConformity) -> dict[str, object]:
    return {
        "verdict": found.verdict,
        "pitch_diameter_tolerance_um": from_si(found.tolerance, "um"),
        "limit_um": from_si(found.limit, "um"),
        "cumulative_um": from_si(found.cumulative, "um"),
        "cumulative_turns": list(found.cumulative_turns),
        "cumulative_share": found.cumulative_share,
        "per_turn_um": from_si(found.per_turn, "um"),
        "per_turn_share": found.per_turn_share,
        "expanded_uncertainty_um": from_si(found.expanded_uncertainty, "um"),
        "engagement_mm": from_si(found.engagement, "mm"),
    }
