"""Tables of different length, with turn numbers, with positions, or with nothing but their fluctuation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

import threadpitch as tp
from threadpitch.judgement import JudgementError, MeasuredThread, judging

Array = NDArray[np.float64]
TARGET, U = 1.5e-3, 1e-6
NUMBERS = np.arange(1.0, 41.0)
SEEN = TARGET + 10e-6 * np.exp(-0.5 * ((NUMBERS - 18.0) / 2.0) ** 2)


def noise(seed: int) -> Array:
    return np.asarray(np.random.default_rng(seed).normal(size=NUMBERS.size) * U)


def test_turn_numbers_lay_the_tables_over_one_another() -> None:
    shown = (SEEN + noise(0))[10:30]
    verdict = tp.judge(SEEN, MeasuredThread(shown, turn=NUMBERS[10:30]), target=TARGET, uncertainty=U)
    assert (verdict.cause, verdict.evidence.turns) == ("control", 20)
    shuffled = np.random.default_rng(1).permutation(20)
    again = tp.judge(SEEN, MeasuredThread(shown[shuffled], turn=NUMBERS[10:30][shuffled]), target=TARGET,
                     uncertainty=U)
    assert again.evidence == verdict.evidence


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_positions_lay_the_tables_over_one_another(sense: float) -> None:
    angle = np.linspace(0.0, 2.0 * math.pi * 40.0, 40 * 100 + 1)
    moved = np.concatenate([[0.0], np.cumsum(SEEN)])
    position = 0.02 + sense * np.interp(angle / (2.0 * math.pi), np.arange(41.0), moved)
    table = tp.thread_pitch(angle, position)
    middle = 0.02 + sense * 0.5 * (moved[1:] + moved[:-1])
    shown = MeasuredThread((SEEN + noise(2))[8:33], position=middle[8:33] + 0.1e-3)
    verdict = tp.judge(table, shown, target=TARGET, uncertainty=U)
    assert (verdict.cause, verdict.evidence.offset) == ("control", 8.0)
    between = MeasuredThread(shown.pitch, position=middle[8:33] + 0.5 * TARGET)
    with pytest.raises(JudgementError, match="measure from the zero of the feed"):
        tp.judge(table, between, target=TARGET, uncertainty=U)


@pytest.mark.parametrize("offset", [0, 3, 7])
def test_a_shorter_table_finds_its_place_by_its_fluctuation(offset: int) -> None:
    verdict = tp.judge(SEEN, (SEEN + noise(3))[offset:offset + 33], target=TARGET, uncertainty=U)
    assert (verdict.cause, verdict.evidence.offset) == ("control", float(offset))
    assert verdict.notes == (f"turn 1 of the measured table is turn {offset + 1} of the nominal one, by their "
                             "fluctuations",)


def test_a_longer_table_finds_its_place_too() -> None:
    verdict = tp.judge(SEEN[4:36], SEEN + noise(4), target=TARGET, uncertainty=U)
    assert (verdict.cause, verdict.evidence.offset) == ("control", -4.0)


def test_the_place_does_not_matter_where_the_nominal_pitches_are_quiet() -> None:
    shown = TARGET + 9e-6 * np.sin(0.9 * NUMBERS[:30]) + noise(5)[:30]
    verdict = tp.judge(np.full(40, TARGET), shown, target=TARGET, uncertainty=U)
    assert verdict.cause == "mechanical"
    assert verdict.notes == ("which turn is which is not known: 11 places fit, with the same verdict",)


def test_places_that_fit_alike_with_one_verdict_leave_no_doubt_about_it() -> None:
    wave = TARGET + 10e-6 * np.sin(2.0 * math.pi * NUMBERS / 4.0)  # fits at every fourth turn
    verdict = tp.judge(wave, wave[:30] + noise(6)[:30], target=TARGET, uncertainty=U)
    assert verdict.cause == "control"
    assert "3 places fit" in verdict.notes[0]


def test_doubt_about_the_place_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judging, "NEAR_OFFSETS", 1e9)  # any place is as good as another
    with pytest.raises(JudgementError, match=r"in 8 places, with different verdicts \(.*\); give their turn numbers"):
        tp.judge(SEEN, (SEEN + noise(3))[3:36], target=TARGET, uncertainty=U)


def test_tables_of_one_length_that_are_out_of_step_are_not_judged() -> None:
    verdict = tp.judge(SEEN, np.roll(SEEN, -2) + noise(7), target=TARGET, uncertainty=U)
    assert verdict.cause == "undetermined"
    assert "shifted by 2 turns" in verdict.notes[0]


@pytest.mark.parametrize("offset", [-7, -3, 5, 9])
def test_turns_that_were_counted_from_another_groove_are_told(offset: int) -> None:
    """A measuring machine counts from the first groove in the metal, the nominal table from the start of the feed."""
    nominal = np.concatenate([[TARGET - 250e-6, TARGET - 9e-6], SEEN[2:]])
    inside = np.arange(9, 34)
    turn = NUMBERS[inside]
    shown = nominal[inside] + noise(8)[:inside.size]
    right = tp.judge(nominal, MeasuredThread(shown, turn=turn), target=TARGET, uncertainty=U)
    assert right.cause == "control"
    wrong = tp.judge(nominal, MeasuredThread(shown, turn=turn + offset), target=TARGET, uncertainty=U)
    assert wrong.cause == "undetermined"
    assert f"by {-offset} turns" in wrong.sentence
    assert "give positions" in wrong.notes[0]


def test_another_fault_is_not_taken_for_another_numbering() -> None:
    shown = TARGET + 8e-6 * np.sin(2.0 * math.pi * NUMBERS / 6.67) + noise(9)
    verdict = tp.judge(SEEN, MeasuredThread(shown, turn=NUMBERS), target=TARGET, uncertainty=U)
    assert verdict.cause in ("mechanical", "both")


@pytest.mark.parametrize(("turn", "text"), [
    ([1.0, 2.0, 2.0, 4.0, 5.0, 6.0, 7.0], "comes 2 times"),
    ([1.0, 2.0, 2.5, 4.0, 5.0, 6.0, 7.0], "no whole number"),
    ([51.0, 52.0, 53.0, 54.0, 55.0, 56.0, 57.0], "no turn is in both"),
])
def test_turn_numbers_that_make_no_sense_are_refused(turn: list[float], text: str) -> None:
    with pytest.raises(JudgementError, match=text):
        tp.judge(SEEN, MeasuredThread(SEEN[:7], turn=np.array(turn)), target=TARGET, uncertainty=U)
