"""From a simulated thread to its cause: the verdict names the fault's cause, and where in the control it lies."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from tests.conftest import Command, assert_one_line
from tests.test_faults import run
from threadpitch import faults, lathe
from threadpitch.cosim.values import Given
from threadpitch.diagnosis import UNCERTAINTY, Diagnosis, diagnose, diagnosis_document, diagnosis_lines
from threadpitch.judgement import ControlParts, JudgementError
from threadpitch.measuring import MeasuringPlan

pytestmark = pytest.mark.usefixtures("fmu_cache")
FINE = 0.5e-6


def found(name: str, plan: MeasuringPlan | None = None) -> Diagnosis:
    result = diagnose(run(name), plan, uncertainty=FINE)
    assert result is not None
    return result


def control(name: str) -> ControlParts:
    parts = found(name).control
    assert parts is not None
    return parts


@pytest.mark.parametrize("uncertainty", [UNCERTAINTY, FINE])
@pytest.mark.parametrize("name", faults.fault_names())
def test_the_verdict_is_the_faults_cause(name: str, uncertainty: float) -> None:
    """Of every fault of the library as ``run --fault`` judges it, and with half of its uncertainty."""
    result = diagnose(run(name), uncertainty=uncertainty)
    assert result is not None
    assert result.verdict.cause == faults.read_fault(name).cause, result.verdict.sentence


@pytest.mark.parametrize("name", ["none", "spindle_dip", "periodic_screw_error"])
def test_a_measured_thread_gives_the_same(name: str) -> None:
    result = found(name, MeasuringPlan(uncertainty=FINE, seed=1))
    assert result.verdict.cause == faults.read_fault(name).cause, result.verdict.sentence
    assert len(result.measured) == 8
    assert [one.flank for one in result.measured] == ["negative_z"] * 4 + ["positive_z"] * 4


def test_the_dip_is_told_with_its_size_and_the_formula_holds() -> None:
    """dP = -F dN / (60 Kv): the lag that the recording shows is 1 / Kv."""
    parts = control("spindle_dip")
    assert parts.lag == pytest.approx(1.0 / 50.0, rel=0.02)
    assert parts.expected_lag == pytest.approx(1.0 / 50.0)
    assert parts.lag_agrees
    result = run("spindle_dip")
    speed = np.asarray(result["spindle.speed"])[np.asarray(result["controller.threading"]) == 1]
    drop = (500.0 / 60.0 * 2.0 * np.pi - speed.min()) * 60.0 / (2.0 * np.pi)
    text = parts.sentences()[0]
    assert f"it drops by {drop:.2g} rpm at the entry" in text
    assert "as expected (20.0 ms): raise Kv or the feedforward" in text
    changes = np.diff(parts.course)[-parts.turns.size:] * 60.0 / (2.0 * np.pi)
    formula = -1.5e-3 * changes / (60.0 * 50.0)
    assert parts.deviation == pytest.approx(formula, abs=0.6e-6)  # which is of slow changes
    assert np.abs(formula).max() > 4e-6


@pytest.mark.parametrize(("name", "part"), [("saturation", "saturation"), ("short_start", "start"),
                                            ("belt_ripple", "speed"), ("low_gain", "speed")])
def test_the_part_of_the_control_is_the_faults(name: str, part: str) -> None:
    shares = control(name).shares
    assert max(shares, key=lambda one: shares[one]) == part, shares
    assert shares[part] > 0.98, shares
    assert all(share > -0.02 for share in shares.values()), shares


@pytest.mark.parametrize("name", ["spindle_dip", "short_start"])
def test_the_control_is_split_over_the_turns_in_the_metal(name: str) -> None:
    """Their numbers and deviations are those of the table, though n = 1 begins before the first row."""
    parts, (one,) = control(name), run(name).passes
    inside = np.flatnonzero(one.in_metal[0])
    assert parts.turns[0] == inside[0] + 1
    assert parts.deviation[:inside.size] == pytest.approx(one.deviation[0, inside], abs=0.05e-6)


def test_lines_and_document_tell_the_same() -> None:
    one = found("spindle_dip")
    text = "\n".join(diagnosis_lines(one))
    assert text.startswith("Verdict on pass 1, pitches of the groove, as an uncertainty of 0.5 um would show them\n")
    document: Any = json.loads(json.dumps(diagnosis_document(one), allow_nan=False))
    assert document["cause"] == "control"
    assert document["control"]["lag_ms"] == pytest.approx(20.0, rel=0.02)
    assert document["control"]["lines"] == text.split("\n")[-len(document["control"]["lines"]):]


def test_where_in_the_control_is_told_of_every_start_angle() -> None:
    """Each from its own turns: numbers and deviations are those of the table."""
    one, (left,) = found("short_start"), run("short_start").passes
    assert [round(np.degrees(parts.start_angle)) for parts in one.controls] == [0, 90, 180, 270]
    for row, parts in enumerate(one.controls):
        inside = np.flatnonzero(left.in_metal[row])
        assert parts.turns[0] == inside[0] + 1
        assert parts.deviation[:inside.size] == pytest.approx(left.deviation[row, inside], abs=0.05e-6)
        assert parts.shares["start"] > 0.9
    worst = max(one.controls, key=lambda parts: parts.worst)
    lines = diagnosis_lines(one)
    heading = next(line for line in lines if line.startswith("Where in the control: "))
    assert heading.endswith(f"(start angle {np.degrees(worst.start_angle):.0f} deg), of it")
    assert f"  - {worst.sentences()[0]}" in lines
    others = [line for line in lines if line.startswith("  at ")]
    assert len(others) == 3
    assert all("start 100 %" in line or "start 9" in line for line in others), others
    documents: Any = diagnosis_document(one)["control"]
    assert [each["start_angle_deg"] for each in documents["start_angles"]] == pytest.approx([0.0, 90.0, 180.0, 270.0])


def test_saturation_is_told_of_every_start_angle_without_a_start_that_nobody_saw() -> None:
    """A transient that is over before the turns that it would be fitted to is not told from them."""
    one = diagnose(run("saturation"))
    assert one is not None
    assert len(one.controls) == 4
    for parts in one.controls:
        assert parts.shares["saturation"] == pytest.approx(1.0, abs=0.02)
        assert all(abs(share) < 0.02 for name, share in parts.shares.items() if name != "saturation")
    assert one.verdict.notes == ()  # the target is that of this thread


def test_a_ripple_is_not_called_a_drop() -> None:
    for name in ("belt_ripple", "low_gain"):
        assert "it goes up and down, by up to " in control(name).sentences()[0]


@pytest.mark.parametrize(("change", "gain"), [(0.02e-3, 50.0), (0.1e-3, 30.0)])
def test_the_lag_of_a_variable_lead_is_the_leads(change: float, gain: float) -> None:
    """v = lead(n) rps, and the feed is v / Kv behind: P(n) is off by -change rps / Kv, at an even speed."""
    simulation = lathe.simulate(parameters={**faults.read_fault("none").parameters, "controller.lead_change": change,
                                            "z_drive.position_gain": gain})
    one = diagnose(simulation)
    assert one is not None
    assert one.controls
    for parts in one.controls:
        assert parts.shares["lead"] == pytest.approx(1.0, abs=0.06)  # the chip grows with the lead
        assert parts.lag == pytest.approx(1.0 / gain, rel=0.03)
        formula = -change * float(np.mean(parts.speed)) / (2.0 * np.pi) / gain
        assert np.median(parts.parts["lead"]) == pytest.approx(formula, rel=0.03)
        assert parts.sentences()[0].split(": ")[1] == "the lead changes, and with it the feed's velocity"


def test_a_variable_lead_is_judged_as_it_was_measured() -> None:
    """Turn by turn against the lead of the turn, at every point around the thread."""
    simulation = lathe.simulate(parameters={**faults.read_fault("none").parameters, "controller.lead_change": 0.05e-3,
                                            "z_drive.feedforward": 1.0})
    one = diagnose(simulation, MeasuringPlan(uncertainty=FINE, points=3, seed=2))
    assert one is not None
    assert one.verdict.cause == "none", one.verdict.sentence
    assert len(one.verdict.rows) == 2 * 3 or one.verdict.evidence.fluctuation < 2.0 * FINE
    lagging = lathe.simulate(parameters={**faults.read_fault("none").parameters, "controller.lead_change": 0.05e-3})
    other = diagnose(lagging, MeasuringPlan(uncertainty=FINE, points=3, seed=2))
    assert other is not None
    assert other.verdict.cause == "control", other.verdict.sentence


def test_an_eccentric_encoder_is_told_within_the_turn() -> None:
    """w = F / 360 deg 0.3 deg Kv / sqrt(Kv^2 + omega^2), its largest less its least at four angles; not in P(n)."""
    omega = 500.0 / 60.0 * 2.0 * np.pi
    size = 1.5e-3 / 360.0 * 0.3 * 50.0 / np.hypot(50.0, omega)
    one = found("encoder_eccentricity")
    assert one.verdict.evidence.within_turn is not None
    assert one.verdict.evidence.measured_within_turn is not None
    for told in (one.verdict.evidence.within_turn, one.verdict.evidence.measured_within_turn[0]):
        assert np.sqrt(2.0) * size * 0.95 < told < 2.0 * size * 1.05
    assert any(line.startswith("Error within the turn that repeats: ") for line in diagnosis_lines(one))


def test_a_chain_of_several_leads_is_refused() -> None:
    chain: dict[str, Given] = {"controller.further_blocks": 1, "controller.further_z": ["-36mm"],
                               "controller.further_x": ["8mm"]}
    same = lathe.simulate(parameters={**chain, "controller.further_lead": ["1.5mm"]})
    assert diagnose(same) is not None
    other = lathe.simulate(parameters={**chain, "controller.further_lead": ["2mm"]})
    with pytest.raises(JudgementError, match=r"leads of their own \(1\.5, 2 mm\).* cut its blocks by themselves"):
        diagnose(other)


def test_a_run_that_stops_before_the_metal_says_so() -> None:
    with pytest.raises(JudgementError, match=r"pass 1 is in the metal: the simulation stops at 0\.7 s, while"):
        diagnose(lathe.simulate(stop_time=0.7))
    one = diagnose(lathe.simulate(stop_time=0.9))
    assert one is not None
    assert one.verdict.cause == "undetermined"
    assert not one.controls


def test_without_both_calculators_there_is_no_verdict() -> None:
    assert diagnose(lathe.simulate(stop_time=0.2)) is None  # no turn yet


def test_what_was_not_recorded_is_said() -> None:
    blind = lathe.simulate(stop_time=2.0, record=["controller.threading"])
    result = diagnose(blind)
    assert result is not None
    assert result.control is None
    assert "spindle.encoder_angle was not recorded" in result.why_not


def test_run_prints_the_verdict_and_writes_what_analyze_reads(threadpitch: Command, workplace: Any) -> None:
    """The whole comparison: cut, measure, analyse the recording against the measurement."""
    outcome = threadpitch("run", "--measure", "uncertainty=0.5um", "points=2", "flanks=middle", "seed=3", "--output",
                          "o")
    assert outcome.status == 0, outcome.err
    text = " ".join(outcome.out.split())
    assert "Verdict on pass 1, pitches measured with an uncertainty of 0.5 um Mechanical: " in text
    assert "once per screw turn, amplitude" in text
    assert (workplace / "o" / "measured.csv").read_text(encoding="utf-8").count("\n") > 30
    columns = ("--angle", "spindle.encoder_angle [rad]", "--position", "z_drive.measured_position [m]", "--group",
               "controller.threading", "--following-error", "z_drive.following_error [m]", "--expected-lag", 20)
    outcome = threadpitch("analyze", "o/trace.csv", *columns, "--measured", "o/measured.csv", "--target", 1.5,
                          "--ball-screw", 10, "--start-angle", 0, 180, "--json")
    assert outcome.status == 0, outcome.err
    verdict = json.loads(outcome.out)["verdict"]
    assert verdict["cause"] == "mechanical"
    assert verdict["evidence"]["rest"][0]["kind"] == "once per screw turn"
    assert verdict["control"]["lag_ms"] == pytest.approx(20.0, rel=0.03)
    assert verdict["control"]["lag_agrees"]
    assert [one["start_angle_deg"] for one in verdict["control"]["start_angles"]] == [0.0, 180.0]


def test_run_tells_the_verdict_as_json_and_forgets_an_old_measurement(threadpitch: Command, workplace: Any) -> None:
    (workplace / "o").mkdir()
    (workplace / "o" / "measured.csv").write_text("old\n")
    outcome = threadpitch("run", "--stop-time", 2, "--start-angle", 0, "--output", "o", "--json")
    document = json.loads(outcome.out)
    assert document["verdict"]["pass"] == 1
    assert document["verdict"]["cause"] in {"mechanical", "undetermined"}
    assert not (workplace / "o" / "measured.csv").exists()


def test_a_plan_that_makes_no_sense_is_refused_before_the_run(threadpitch: Command, workplace: Any) -> None:
    outcome = threadpitch("run", "--measure", "every=0")
    assert outcome.status == 2
    assert_one_line(outcome.err, "give turns and points from 1 to 360")
    assert not (workplace / "threadpitch-run").exists()
