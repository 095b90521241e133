"""Causes whose shape is known are told apart, with sizes, gains and shares that agree with what was put in."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import threadpitch as tp
from tests.benchmarks.drawn_threads import drawn
from threadpitch.judgement import JudgementError, MeasuredThread, Verdict, read_verdict, verdict_document
from threadpitch.pitch import PitchTable

Array = NDArray[np.float64]

TARGET, U = 1.5e-3, 1e-6
TURNS = np.arange(1.0, 41.0)
QUIET = np.full(TURNS.size, TARGET)
DIP = -12e-6 * np.exp(-TURNS / 3.0)  # what the control sees: the first turns are short
WAVE = 8e-6 * np.sin(2.0 * math.pi * 0.15 * TURNS + 0.4)  # 1.5 mm lead on a screw of 10 mm


def noise(seed: int, size: int = TURNS.size) -> Array:
    """Errors of grooves, whose distances are taken: variance U^2, neighbours correlated by -1/2."""
    return np.asarray(np.diff(np.random.default_rng(seed).normal(size=size + 1)) * U / math.sqrt(2.0))


def judged(nominal: Array, measured: Array, screw_lead: float | None = 10e-3) -> Verdict:
    return tp.judge(nominal, measured, target=TARGET, uncertainty=U, screw_lead=screw_lead)


@pytest.mark.parametrize("seed", range(5))
def test_a_fluctuation_that_both_have_is_the_controls(seed: int) -> None:
    verdict = judged(TARGET + DIP, TARGET + DIP + noise(seed))
    assert verdict.cause == "control"
    assert verdict.evidence.gain_interval is not None
    low, high = verdict.evidence.gain_interval
    assert low - 0.05 < 1.0 < high + 0.05
    assert verdict.evidence.control_share == 1.0
    assert "Kv" in verdict.advice[0] or "gain" in verdict.advice[0]


@pytest.mark.parametrize("seed", range(5))
def test_a_fluctuation_that_only_the_thread_has_is_mechanical(seed: int) -> None:
    verdict = judged(QUIET, TARGET + WAVE + noise(seed))
    assert verdict.cause == "mechanical"
    part, = verdict.evidence.rest
    assert part.kind == "once per screw turn"
    assert part.period == pytest.approx(1.0 / 0.15)
    assert part.size == pytest.approx(8e-6, abs=4.0 * U * math.sqrt(2.0 / TURNS.size))
    assert verdict.evidence.control_share == 0.0
    assert verdict.evidence.gain is None  # the nominal pitches do not fluctuate


@pytest.mark.parametrize("seed", range(5))
def test_both_are_both_with_their_shares(seed: int) -> None:
    verdict = judged(TARGET + DIP, TARGET + DIP + WAVE + noise(seed))
    assert verdict.cause == "both"
    assert verdict.evidence.rest[0].kind == "once per screw turn"
    seen, unseen = float(DIP @ DIP), float(WAVE @ WAVE)
    assert verdict.evidence.control_share == pytest.approx(seen / (seen + unseen), abs=0.05)
    assert verdict.evidence.rest_share == 1.0 - verdict.evidence.control_share


def test_noise_alone_is_none() -> None:
    causes = [judged(QUIET, TARGET + noise(seed)).cause for seed in range(40)]
    assert causes.count("none") >= 38
    assert set(causes) <= {"none", "undetermined"}


def test_jitter_that_only_the_nominal_values_have_is_none() -> None:
    for seed in range(10):
        verdict = judged(TARGET + 10.0 * noise(100 + seed), TARGET + noise(seed))
        assert verdict.cause == "none"
        assert verdict.evidence.nominal_jitter == pytest.approx(10.0 * U, rel=0.5)
        assert "jitter" in verdict.sentence


def test_a_signal_below_the_uncertainty_is_never_given_a_wrong_cause() -> None:
    for seed in range(20):
        assert judged(QUIET, TARGET + 0.3 * U / 12e-6 * DIP + noise(seed)).cause in {"none", "undetermined"}


def test_a_single_turn_is_found_where_it_is() -> None:
    step = np.where(TURNS == 17.0, 9e-6, 0.0)
    part, = judged(QUIET, TARGET + step + noise(3)).evidence.rest
    assert (part.kind, part.first_turn, part.last_turn) == ("event", 17.0, 17.0)
    assert part.size == pytest.approx(9e-6, abs=4.0 * U)


def test_a_progressive_error_is_the_mean_deviation() -> None:
    part, = judged(QUIET, QUIET + 5e-6 + noise(4)).evidence.rest
    assert part.kind == "progressive"
    assert part.size == pytest.approx(5e-6, abs=4.0 * U / math.sqrt(TURNS.size))


def test_a_displaced_turn_is_long_and_then_short() -> None:
    spot = np.where(TURNS == 9.0, 9e-6, 0.0) - np.where(TURNS == 10.0, 9e-6, 0.0)
    part, = judged(QUIET, TARGET + spot + noise(5)).evidence.rest
    assert (part.kind, part.first_turn, part.last_turn) == ("displaced turn", 9.0, 10.0)


def test_without_shape_it_is_irregular() -> None:
    rough = 12e-6 * np.random.default_rng(6).normal(size=TURNS.size)
    verdict = judged(QUIET, TARGET + rough)
    assert verdict.cause == "mechanical"
    assert verdict.evidence.irregular == pytest.approx(12e-6, rel=0.4)


def test_too_few_turns_are_undetermined() -> None:
    verdict = judged(QUIET[:5], TARGET + WAVE[:5])
    assert verdict.cause == "undetermined"
    assert "5 turns" in verdict.sentence


@pytest.mark.parametrize("cause", ["control", "mechanical"])
def test_turned_around_and_scaled_it_is_the_same_verdict(cause: str) -> None:
    seen = DIP if cause == "control" else 0.0 * DIP
    shown = seen + (WAVE if cause == "mechanical" else 0.0) + noise(7)
    for sense in (1.0, -1.0):
        for scale in (1.0, 100.0):
            verdict = tp.judge(TARGET + sense * scale * seen, TARGET + sense * scale * shown, target=TARGET,
                               uncertainty=scale * U, screw_lead=10e-3)
            assert verdict.cause == cause


def test_drawn_threads_are_judged_as_they_were_made() -> None:
    """The benchmark judges thousands; these are some of its development seeds."""
    right = 0
    for seed in range(60):
        thread = drawn(seed)
        verdict = tp.judge(thread.nominal, thread.measured, target=thread.machine.lead,
                           uncertainty=thread.uncertainty, screw_lead=thread.machine.screw_lead)
        right += verdict.cause == thread.cause
        assert {verdict.cause, thread.cause} != {"control", "mechanical"}
    assert right >= 57


def test_missing_turns_are_left_out() -> None:
    shown = TARGET + WAVE + noise(8)
    shown[[4, 5, 20]] = np.nan
    verdict = judged(QUIET, shown)
    assert verdict.cause == "mechanical"
    assert verdict.evidence.turns == TURNS.size - 3


def test_start_angles_are_judged_together() -> None:
    nominal = np.stack([TARGET + DIP, TARGET + DIP])
    measured = np.stack([TARGET + DIP + noise(9), TARGET + DIP + WAVE + noise(10)])
    verdict = tp.judge(nominal, measured, target=TARGET, uncertainty=U, screw_lead=10e-3)
    assert verdict.cause == "both"
    assert [row.cause for row in verdict.rows] == ["control", "both"]


def test_the_drunken_error_comes_from_several_start_angles_only() -> None:
    angle = np.linspace(0.0, 40.0 * math.pi, 40001)
    position = TARGET * angle / (2.0 * math.pi) + 3e-6 * np.sin(angle)  # repeats with every turn
    table = tp.thread_pitch(angle, position, (0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi))
    measured = TARGET + noise(11, table.pitch.shape[1])
    verdict = tp.judge(table, measured, target=TARGET, uncertainty=U)
    assert verdict.cause == "none"
    assert verdict.evidence.within_turn == pytest.approx(6e-6, rel=1e-3)
    alone = tp.judge(table.pitch[0], measured, target=TARGET, uncertainty=U)
    assert alone.evidence.within_turn is None


def test_the_document_is_json() -> None:
    document = json.loads(json.dumps(verdict_document(judged(TARGET + DIP, TARGET + DIP + WAVE + noise(12))),
                                     allow_nan=False))
    assert document["cause"] == "both"
    assert document["evidence"]["rest"][0]["size_um"] == pytest.approx(8.0, abs=1.0)
    assert document["evidence"]["within_turn_um"] is None


def test_a_verdict_is_read_from_its_document() -> None:
    for measured in (TARGET + DIP + WAVE + noise(12), QUIET + noise(3)):
        document = json.loads(json.dumps(verdict_document(judged(TARGET + DIP, measured)), allow_nan=False))
        assert verdict_document(read_verdict(document)) == document


def test_uncertainties_of_the_measured_thread_win() -> None:
    shown = TARGET + WAVE + noise(13)
    known = MeasuredThread(shown, uncertainty=np.full(shown.size, U))
    assert tp.judge(QUIET, known, target=TARGET, uncertainty=1.0e-3).cause == "mechanical"
    vague = replace(known, uncertainty=np.full(shown.size, 20.0 * U))
    assert tp.judge(QUIET, vague, target=TARGET).cause == "none"


def test_what_cannot_be_judged_is_refused_in_one_line() -> None:
    cases: list[tuple[object, object, dict[str, float], str]] = [
        (QUIET, QUIET, {}, "uncertainty is not known"),
        (QUIET, QUIET, {"uncertainty": 0.0}, "positive length"),
        (QUIET, ["a"], {"uncertainty": U}, "no array of numbers"),
        (QUIET, np.zeros((2, 2, 2)), {"uncertainty": U}, "shape"),
        (1e3 * QUIET, 1e5 * QUIET, {"uncertainty": U}, "give pitches in m"),
        (np.stack([QUIET, QUIET]), np.stack([QUIET] * 3), {"uncertainty": U}, "3 rows of measured"),
        (QUIET, np.full(40, np.nan), {"uncertainty": U}, "no measured pitches but missing ones"),
        (np.full(500, TARGET), np.full(450, TARGET), {"uncertainty": U}, "which are of different length"),
    ]
    for nominal, measured, options, text in cases:
        with pytest.raises(JudgementError, match=text) as caught:
            tp.judge(nominal, measured, target=TARGET, **options)  # type: ignore[arg-type]
        assert "\n" not in str(caught.value)


def test_thousands_of_turns_are_judged_in_stretches() -> None:
    """One displaced turn in 900, and a control that dips once."""
    count = 900
    dip = np.zeros(count)
    dip[350:390] = DIP
    spot = np.zeros(count)
    spot[700:702] = 12e-6, -12e-6
    shown = noise(21, count)
    verdict = judged(TARGET + dip, TARGET + dip + spot + shown)
    assert verdict.cause == "both"
    assert verdict.evidence.turns == count
    assert sorted(one.cause for one in verdict.rows) == ["control", "mechanical", "none"]
    assert "judged in 3 stretches" in verdict.notes[0]
    assert verdict.rows[2].evidence.rest[0].kind == "displaced turn"


def test_a_control_that_moves_less_than_shows_is_left_open() -> None:
    """A turn that the detectors saw off by twice the uncertainty: it is in the thread, and noise hides it."""
    event = np.where(TURNS == 9.0, 2.0 * U, 0.0)
    verdicts = [judged(TARGET + event, TARGET + event + noise(seed)) for seed in range(20)]
    assert {one.cause for one in verdicts} <= {"undetermined", "control"}
    assert any("the control moves the feed by 0.316 um rms" in one.sentence for one in verdicts)


def test_what_the_detectors_saw_counts_beside_mechanics() -> None:
    """A movement of 2.5 U in one turn can hardly be told in the thread, but the detectors saw it: it is both."""
    seen = np.where(TURNS == 12.0, 2.5 * U, 0.0)

    def causes(movement: Array, wave: Array) -> list[str]:
        return [judged(TARGET + movement, TARGET + movement + wave + noise(seed)).cause for seed in range(10)]

    assert causes(seen, WAVE).count("both") >= 8
    assert causes(0.5 * seen, WAVE).count("mechanical") >= 9  # within the expanded uncertainty of one pitch
    assert causes(seen, 3.0 * WAVE).count("mechanical") >= 4  # a tenth of the deviation


def test_the_target_of_every_turn_may_be_another() -> None:
    """A lead that grows by 20 um a turn: the verdict is that of the same deviations from one lead, rows or places."""
    growing = TARGET + 20e-6 * (TURNS - 0.5)
    nominal, shown = DIP, DIP + WAVE + noise(4)
    known = tp.judge(TARGET + nominal, TARGET + shown, target=TARGET, uncertainty=U)
    verdict = tp.judge(growing + nominal, growing + shown, target=growing, uncertainty=U)
    assert verdict.cause == known.cause == "both"
    assert verdict.evidence.costs == pytest.approx(known.evidence.costs)
    angle = np.linspace(0.0, TURNS.size * 2.0 * math.pi, 40 * TURNS.size + 1)
    edges = np.concatenate([[0.0], np.cumsum(growing + nominal)])
    table = tp.thread_pitch(angle, np.interp(angle, 2.0 * math.pi * np.arange(edges.size), edges))
    placed = MeasuredThread((growing + shown)[3:], position=(0.5 * (edges[1:] + edges[:-1]))[3:])
    again = tp.judge(table, placed, target=growing, uncertainty=U)
    assert (again.cause, again.evidence.offset, again.evidence.span) == ("both", 3.0, (4.0, 40.0))
    with pytest.raises(JudgementError, match="3 targets and 40 nominal turns"):
        tp.judge(growing, growing, target=growing[:3], uncertainty=U)


def test_a_target_of_another_thread_is_told() -> None:
    shown = TARGET + DIP + noise(5)
    right = tp.judge(TARGET + DIP, shown, target=TARGET, uncertainty=U)
    wrong = tp.judge(TARGET + DIP, shown, target=25.4e-3 / 18.0, uncertainty=U)  # 1.411 mm
    assert not any("is it that of this thread" in note for note in right.notes)
    assert wrong.notes[0] == ("nominal and measured pitches agree on 1.5 mm and the target is 1.4111 mm: is it that "
                              "of this thread, and of every turn of it?")


def test_uncertain_crossings_of_the_nominal_pitches_count() -> None:
    """Both move alike, and the nominal crossings are uncertain by 4 U: that is no second cause."""
    table = PitchTable.of_pitches(TARGET + 3.0 * DIP + 4.0 * noise(7), 0.0)
    shown = TARGET + 3.0 * DIP + noise(8)
    known = replace(table, uncertainty=np.full((1, TURNS.size), 4.0 * U))
    assert tp.judge(known, shown, target=TARGET, uncertainty=U).cause == "control"


@pytest.mark.parametrize(("nominal", "measured", "uncertainty", "message"), [
    (1.0, 1e3, 1e-6, "the measured pitches are 1500 mm in their middle and the target is 1.5 mm"),
    (1e3, 1.0, 1e-6, "the nominal pitches are 1500 mm"),
    (1.0, -1.0, 1e-6, "positive in the direction of the cut"),
    (0.5, 0.5, 1e-6, "the target is the movement per revolution"),
    (1.0, 1.0, 1e-3, "the uncertainty of 1 mm is more than a tenth"),
    (1.0, np.nan, 1e-6, "there are no measured pitches but missing ones"),
])
def test_another_unit_sign_or_thread_is_no_fluctuation(nominal: float, measured: float, uncertainty: float,
                                                       message: str) -> None:
    pitches = np.full(20, 1.5e-3) + 1e-6 * np.sin(np.arange(20.0))
    with pytest.raises(JudgementError, match=message):
        tp.judge(nominal * pitches, measured * pitches, target=1.5e-3, uncertainty=uncertainty)


def test_masked_is_missing() -> None:
    pitches = np.full(20, 1.5e-3) + 1e-6 * np.sin(np.arange(20.0))
    spoiled = np.ma.masked_array(np.where(np.arange(20) == 7, 1.6e-3, pitches), mask=np.arange(20) == 7)
    verdict = tp.judge(pitches, spoiled, target=1.5e-3, uncertainty=0.1e-6)
    assert (verdict.cause, verdict.evidence.turns) == ("control", 19)


def test_a_movement_that_is_not_in_the_thread_is_said_to_be_of_another_log() -> None:
    """Smooth and large in the nominal pitches, and the thread excludes even half of it."""
    verdict = tp.judge(TARGET + DIP, TARGET + noise(11), target=TARGET, uncertainty=U)
    assert verdict.cause == "undetermined"
    assert "which is not in the thread (gain " in verdict.sentence
    assert verdict.advice[0].startswith("Check that the nominal pitches are of this thread")
