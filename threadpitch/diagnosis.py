"""What made the pitch of a simulated thread fluctuate: the verdict on its groove, and the control's part of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from threadpitch.judgement import (
    ControlParts,
    ControlTrace,
    ExpectedLag,
    JudgementError,
    MeasuredThread,
    Turns,
    Verdict,
    control_documents,
    control_lines,
    control_parts_of,
    drunkenness,
    judge,
    together,
    verdict_document,
    within_turn_line,
)
from threadpitch.judgement.control import FEWEST_TURNS
from threadpitch.lathe import ACTUAL, NOMINAL, Simulation
from threadpitch.measuring import MeasuringPlan, measure, recorded_rows
from threadpitch.passes import CONTROLLER, FloatArray, Pass
from threadpitch.pitch import PitchError, PitchTable, pitch_table
from threadpitch.roles import Z_DRIVE
from threadpitch.trace import TURN, Trace, TraceError
from threadpitch.units import from_si

UNCERTAINTY = 1e-6  # m, standard, of one pitch: what a good coordinate measuring machine reaches
_DETECTED = ("spindle.encoder_angle", f"{Z_DRIVE}.measured_position")
_CHIPS = {"negative_z": "cutting.chip_thickness[1]", "positive_z": "cutting.chip_thickness[2]"}  # by flank
_CUTTING = ("cutting.groove_depth", f"{CONTROLLER}.threading")
DECIDING = (*_CHIPS.values(), *_CUTTING)  # tell which pass left the groove
_EXPONENTIAL = 0  # a value of the controller's start_mode
_BALL_SCREW = 1  # of the drive's drive_type
_AT_THE_LIMIT = 0.999
_WORTH = 1.0  # of the uncertainty: the control is not explained where it does less
_BEFORE = 1e-2  # of a turn: the first row may be a count before the line begins
_CUTS = 0.5  # of the turns in the metal in which a pass must take a chip off a flank to have left it


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The verdict on the pass that left the groove.

    ``controls`` has where in the control for every start angle; it is empty where the recording does not tell it, and
    ``why_not`` then says why.
    """

    pass_number: int
    target: float  # m, the lead
    uncertainty: float  # m, standard, of one pitch
    verdict: Verdict
    controls: tuple[ControlParts, ...]
    measured: tuple[MeasuredThread, ...] = ()  # where the thread was measured by a plan
    why_not: str = ""

    @property
    def control(self) -> ControlParts | None:
        """That of the first start angle."""
        return self.controls[0] if self.controls else None

    @property
    def control_shows(self) -> bool:
        """Whether the control moves a pitch by more than the measuring uncertainty: where it does less, nothing is to
        be adjusted.
        """
        return any(one.worst > _WORTH * self.uncertainty for one in self.controls)


def diagnose(simulation: Simulation, plan: MeasuringPlan | None = None, *,
             uncertainty: float = UNCERTAINTY) -> Diagnosis | None:
    """Judge the pitches in the metal of the pass that left the groove, nominal against actual ones.

    Without a plan the actual pitches are those of the calculator, exact, judged as if each had this standard
    uncertainty, m. With one they are measured (``measure``), flank by flank, each against the pass that left it.
    None where the system does not calculate both pitches, or no turn was completed.

    Raises:
        LatheError: the plan needs what was not recorded.
        JudgementError: the pitches cannot be judged.
    """
    if not {NOMINAL, ACTUAL} <= set(simulation.calculators) or not simulation.passes:
        return None
    left = _left_by(simulation)
    _can_be_judged(left, simulation)
    targets, target = _targets(left)
    threads: tuple[MeasuredThread, ...] = ()
    if plan is None:
        verdict = _of_groove(simulation, left, uncertainty)
    else:
        threads, uncertainty = tuple(measure(simulation, plan, simulation.passes[-1])), plan.uncertainty
        verdict = _of_flanks(simulation, plan, threads, target)
    controls, why_not = _control(simulation, left, targets if left.variable else target)
    return Diagnosis(left.number, target, uncertainty, verdict, controls, threads, why_not)


def verdict_on_groove(simulation: Simulation, *, uncertainty: float = UNCERTAINTY) -> Verdict:
    """The verdict alone, as ``diagnose`` without a plan gives it; ``DECIDING`` and what is watched must be recorded.

    Raises:
        JudgementError: the pitches cannot be judged, or there are none.
    """
    if not {NOMINAL, ACTUAL} <= set(simulation.calculators):
        raise JudgementError(f"the system does not calculate both pitches; it needs {NOMINAL} and {ACTUAL}")
    if not simulation.passes:
        raise JudgementError(simulation.why_no_turn())
    left = _left_by(simulation)
    _can_be_judged(left, simulation)
    return _of_groove(simulation, left, uncertainty)


def _can_be_judged(left: Pass, simulation: Simulation) -> None:
    """Whether it has turns in the metal, each of which has one lead that is known."""
    leads = _leads_of_chain(simulation)
    if len(set(leads)) > 1:
        told = ", ".join(f"{from_si(lead, 'mm'):.6g}" + (f" {from_si(change, 'mm'):+.6g} a turn" if change else "")
                         for lead, change in leads)
        raise JudgementError(f"the blocks of the chain have leads of their own ({told} mm), and which turn is of which "
                             "block is not known; cut its blocks by themselves to judge them")
    if (left.in_metal & np.isfinite(left.table.pitch)).any():
        return
    threading = simulation.get(f"{CONTROLLER}.threading")
    mend = f"the simulation stops at {simulation.time[-1]:g} s, while it is being cut; choose a longer stop time" \
        if threading is not None and threading[-1] else "cut a longer thread, or begin farther from the workpiece"
    raise JudgementError(f"no whole turn of pass {left.number} is in the metal: {mend}")


def _leads_of_chain(simulation: Simulation) -> list[tuple[float, float]]:
    """(lead, its change per turn), m, of every block; none where the controller cuts no chain."""
    def told(name: str) -> float:
        return simulation.parameter(f"{CONTROLLER}.{name}") or 0.0

    further = [(told(f"further_lead[{k}]"), told(f"further_lead_change[{k}]"))
               for k in range(1, int(told("further_blocks")) + 1)]
    return [(told("lead"), told("lead_change")), *further] if further else []


def diagnosis_document(found: Diagnosis) -> dict[str, object]:
    """As JSON, lengths in um."""
    return {"pass": found.pass_number, "uncertainty_um": from_si(found.uncertainty, "um"),
            **verdict_document(found.verdict),
            "control": {**control_documents(found.controls), "shows": found.control_shows} if found.controls
            else {"why_not": found.why_not}}


def diagnosis_lines(found: Diagnosis) -> list[str]:
    """In plain words: the verdict, what to adjust or check, where in the control."""
    um = f"{from_si(found.uncertainty, 'um'):.3g}"
    how = f"measured with an uncertainty of {um} um" if found.measured else \
        f"of the groove, as an uncertainty of {um} um would show them"
    lines = [f"Verdict on pass {found.pass_number}, pitches {how}", found.verdict.sentence]
    lines += [f"  - {line}" for line in found.verdict.advice]
    lines += [f"Note: {note}" for note in found.verdict.notes]
    lines += [line for line in (within_turn_line(found.verdict.evidence),) if line]
    return [*lines, *control_lines(found.controls)] if found.control_shows else lines


def _left_by(simulation: Simulation, flank: str = "") -> Pass:
    """The pass that left the groove, or one flank of it: the last that takes a chip off it.

    Where the chips were not recorded: the last pass that is not a spring pass.
    """
    passes = simulation.passes
    names = [chip for name, chip in _CHIPS.items() if flank in ("", "middle", name)]
    if not all(name in simulation for name in (*names, *_CUTTING)):
        return next((one for one in reversed(passes) if one.kind != "spring"), passes[-1])
    for one in reversed(passes):
        rows = recorded_rows(simulation, one, names)
        rows &= np.asarray(simulation["cutting.groove_depth"]) > 0.0
        chips = [np.asarray(simulation[name])[rows] > 0.0 for name in names]
        if rows.any() and max(float(chip.mean()) for chip in chips) > _CUTS:
            return one
    return passes[-1]


def _screw_lead(simulation: Simulation) -> float | None:
    ball_screw = simulation.parameter(f"{Z_DRIVE}.drive_type") == _BALL_SCREW
    return simulation.parameter(f"{Z_DRIVE}.screw_lead") if ball_screw else None


def _of_groove(simulation: Simulation, left: Pass, uncertainty: float) -> Verdict:
    nominal, actual, known = _both(left, simulation)
    targets, target = _targets(left)
    wanted = targets[known, :actual.pitch.shape[1]] if left.variable else target
    verdict = judge(nominal, actual.pitch, target=wanted, uncertainty=uncertainty, screw_lead=_screw_lead(simulation))
    return verdict if left.variable else _with_drunkenness(verdict, actual, target, uncertainty)


def _targets(one: Pass) -> tuple[FloatArray, float]:
    """The pass's targets, (start_angles, revolutions) m, and the first of them."""
    targets = one.table.pitch - one.deviation
    return targets, float(targets[np.isfinite(targets)][0])


def _both(left: Pass, simulation: Simulation) -> tuple[PitchTable, PitchTable, NDArray[np.bool_]]:
    """Nominal and actual pitches of the same turns, NaN outside of the metal, and of which of the pass's start angles
    they are.
    """
    other = next((one for one in simulation.passes_of(ACTUAL) if one.number == left.number), None)
    if other is None:
        raise JudgementError("no turn of the groove was completed; choose a longer stop time")
    turns = min(left.table.pitch.shape[1], other.table.pitch.shape[1])
    inside = left.in_metal[:, :turns]
    nominal = np.where(inside, left.table.pitch[:, :turns], np.nan)
    actual = np.where(inside, other.table.pitch[:, :turns], np.nan)
    both = np.isfinite(nominal) & np.isfinite(actual)
    known = np.asarray(both.any(axis=1), dtype=np.bool_)  # a start angle may have no turn in the metal yet
    starts = left.table.start_angles[known]

    def table(pitches: FloatArray, one: Pass) -> PitchTable:
        return replace(PitchTable.of_pitches(pitches[known], starts), crossings=one.table.crossings[known, :turns + 1])

    return table(nominal, left), table(actual, other), known


def _with_drunkenness(verdict: Verdict, actual: PitchTable, target: float, uncertainty: float) -> Verdict:
    """The verdict with the groove's error within the turn, over the turns that were judged."""
    first, last = verdict.evidence.span
    if not np.isfinite([first, last]).all():
        return verdict
    size = drunkenness(actual, target, (int(first), int(last)))
    if size is None:
        return verdict
    doubt = uncertainty * float(np.sqrt(2.0 / (last - first + 2.0)))  # of the mean over the grooves
    return replace(verdict, evidence=replace(verdict.evidence, measured_within_turn=(size, doubt)))


def _of_flanks(simulation: Simulation, plan: MeasuringPlan, threads: Sequence[MeasuredThread],
               target: float) -> Verdict:
    """Every flank against the nominal pitches of the pass that left it; one verdict of all."""
    verdicts = []
    for flank in dict.fromkeys(one.flank for one in threads):
        left = _left_by(simulation, flank)
        trace, table = _nominal(simulation, left, plan.start_angles)
        own = [one for one in threads if one.flank == flank]
        verdict = judge(table, own, target=_leads(simulation, left, trace, table) if left.variable else target,
                        screw_lead=_screw_lead(simulation))
        verdicts.append(replace(verdict, notes=(*verdict.notes, f"told by the flank {flank}")))
    return verdicts[0] if len(verdicts) == 1 else together(verdicts)


def _nominal(simulation: Simulation, one: Pass, start_angles: Sequence[float]) -> tuple[Trace, PitchTable]:
    """Of the detectors' signals, with the crossings along the axis."""
    rows = recorded_rows(simulation, one, _DETECTED)
    angle, position = (np.asarray(simulation[name], dtype=np.float64)[rows] for name in _DETECTED)
    trace = Trace(angle, position)
    return trace, pitch_table(trace, start_angles)


def _leads(simulation: Simulation, one: Pass, trace: Trace, table: PitchTable) -> FloatArray:
    """(start_angles, revolutions) m: lead + lead_change (n - 1/2 + o) of the pass's turns as its trace numbers them.

    The line begins at the pass's start angle, in the turn in which its first row is.
    """
    assert one.lead is not None  # of a pass whose lead changes
    assert one.start_angle is not None
    begins = one.start_angle + TURN * np.floor((trace.angle[0] - one.start_angle) / TURN + _BEFORE)
    middles = table.start_angles[:, np.newaxis] + TURN * (table.turns_before + np.arange(table.pitch.shape[1]) + 0.5)
    change = simulation.parameter(f"{CONTROLLER}.lead_change") or 0.0
    return np.asarray(one.lead + change * (middles - begins) / TURN)


def _control(simulation: Simulation, left: Pass, target: float | FloatArray) -> tuple[tuple[ControlParts, ...], str]:
    """Where in the control, of every start angle from its first turn in the metal on; or none, and why not."""
    names = (*_DETECTED, "spindle.speed", f"{Z_DRIVE}.following_error", f"{Z_DRIVE}.torque")
    try:
        rows = recorded_rows(simulation, left, names)
        angle, position, speed, error, torque = (np.asarray(simulation[name], dtype=np.float64)[rows] for name in names)
        limit = simulation.parameter(f"{Z_DRIVE}.torque_limit")
        saturated = None if limit is None else np.abs(torque) >= _AT_THE_LIMIT * limit
        trace = Trace(angle, position, simulation.time[rows])
        known = _with_turns(left)
        chosen = [Turns(_first_crossing(trace, left.table, row), _first_in_metal(left, row)) for row in known]
        found = control_parts_of(ControlTrace(trace, speed, error, saturated),
                                 target[known] if isinstance(target, np.ndarray) else target, chosen,
                                 _expected(simulation))
        return tuple(replace(one, start_angle=float(left.table.start_angles[row]))
                     for row, one in zip(known, found, strict=True)), ""
    except (JudgementError, PitchError, TraceError, ValueError) as error_:
        return (), str(error_)


def _with_turns(left: Pass) -> list[int]:
    """The start angles that have enough turns in the metal; the one with the most where none has."""
    turns = np.sum(np.isfinite(left.table.pitch) & left.in_metal, axis=1)
    return np.flatnonzero(turns >= FEWEST_TURNS).tolist() or [int(np.argmax(turns))]


def _first_in_metal(left: Pass, row: int) -> int:
    return int(np.argmax(left.in_metal[row])) + 1 if left.in_metal[row].any() else 1


def _first_crossing(trace: Trace, table: PitchTable, row: int) -> float:
    """Angle, rad, at which n = 1 of a start angle of the table begins.

    It may lie in the step in which threading begins, and so before the first row: the pitches themselves tell.
    """
    start, known = float(table.start_angles[row]), table.pitch[row]
    later = start + TURN * float(np.ceil((trace.angle[0] - start) / TURN - 1e-9))

    def apart(first: float) -> float:
        seen = pitch_table(trace, (first,)).pitch[0]
        both = min(seen.size, known.size)
        return float(np.nanmax(np.abs(seen[:both] - known[:both])))

    return min((later, later - TURN), key=apart)


def _expected(simulation: Simulation) -> ExpectedLag | None:
    """Of the drive's parameters; Td is the fine interpolation's period less what the order of the data is ahead.

    An exponential start adds its time constant.
    """
    gain = simulation.parameter(f"{Z_DRIVE}.position_gain")
    if gain is None:
        return None
    delay = (simulation.parameter(f"{Z_DRIVE}.command_period") or 0.0) - simulation.result.schedule.step_size
    if simulation.parameter(f"{CONTROLLER}.start_mode") == _EXPONENTIAL:
        delay += simulation.parameter(f"{CONTROLLER}.start_time_constant") or 0.0
    if simulation.parameter(f"{CONTROLLER}.age_compensation"):
        delay -= simulation.parameter(f"{CONTROLLER}.command_age") or 0.0
    return ExpectedLag(gain, simulation.parameter(f"{Z_DRIVE}.feedforward") or 0.0, delay)
