"""Designations, tabulated limits with their sources, and what a pitch deviation takes of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from threadpitch.tolerance import (
    CONFORM,
    NOT_CONFORM,
    NOT_DECIDABLE,
    ToleranceError,
    external_limits,
    internal_limits,
    parse_thread,
    pitch_conformity,
)
from threadpitch.tolerance.conformity import worst_cumulative
from threadpitch.tolerance.limits import fundamental_deviation, normal_engagement
from threadpitch.units import from_si

# T_d2 in um of 6g and 4g. Sources, read there: limits of size of ASME B1.13M (amesweb.info, metric-thread-chart; 6g and
# 4g6g from M1.6 to M10x0.75), ISO 965-4 (es - ei of 6az from M10 to M64, whose T_d2 is that of 6g), ISO 965 in the
# Mastik catalogue, page 711. The rest of the 4g column is the formula's, of which M20x2 4g is read in TABULATED_D2.
EXTERNAL = {"M1.6": (63, 40), "M2": (67, 42), "M2.5": (71, 45), "M3": (75, 48), "M3.5": (85, 53), "M4": (90, 56),
            "M5": (95, 60), "M6": (112, 71), "M8": (118, 75), "M8x1": (112, 71), "M10": (132, 85), "M10x1.5": (132, 85),
            "M10x1.25": (118, 75), "M10x0.75": (100, 63), "M12": (150, 95), "M16": (160, 100), "M20": (170, 106),
            "M20x2": (160, 100), "M20x1.5": (140, 90), "M24": (200, 125), "M30": (212, 132), "M36": (224, 140),
            "M42": (236, 150), "M48": (250, 160), "M64": (280, 180)}
# Limits of d2 in mm, (least, largest). Sources: M20x2 4g, 4h machiningdoctor.com; 6g and 6H of M6 to M30 and of fine
# pitches: adrianschlatter/threadlib, design/metric_thread.csv, copied from the standard; 19.2157 of M20x1.5-6H also
# elsmar.com, thread gages; M10 ISO 965-2
TABULATED_D2 = {"M20x2-4g6g": (18.563, 18.663), "M20x2-4h6h": (18.601, 18.701), "M6-6g": (5.212, 5.324),
                "M8-6g": (7.042, 7.160), "M8x1-6g": (7.212, 7.324), "M10x1-6g": (9.212, 9.324),
                "M10x1.25-6g": (9.042, 9.160), "M6-6H": (5.350, 5.500), "M8-6H": (7.188, 7.348),
                "M10-6H": (9.026, 9.206), "M12-6H": (10.863, 11.063), "M16-6H": (14.701, 14.913),
                "M20-6H": (18.376, 18.600), "M20x2-6H": (18.701, 18.913), "M20x1.5-6H": (19.026, 19.216),
                "M24-6H": (22.051, 22.316), "M24x2-6H": (22.701, 22.925), "M30-6H": (27.727, 28.007)}
# Normal lengths of engagement in mm. Sources: ISO 965-4 (M10 to M42), Mastik catalogue, page 711 (M1.6 to M6),
# machiningdoctor.com (M20x2)
ENGAGEMENTS = {"M1.6": (0.8, 2.6), "M2": (1.0, 3.0), "M2.5": (1.3, 3.8), "M3": (1.5, 4.5), "M4": (2.0, 6.0),
               "M6": (3.0, 9.0), "M10": (5.0, 15.0), "M12": (6.0, 18.0), "M16": (8.0, 24.0), "M20": (10.0, 30.0),
               "M20x2": (8.0, 24.0), "M24": (12.0, 36.0), "M30": (15.0, 45.0), "M36": (18.0, 53.0), "M42": (21.0, 63.0)}
# T_D2 in um of 4H, 5H, 6H (None: not in the table). Source: ISO 965-1, table of T_D2; Yamawa general catalogue 2021,
# "Comparison of pitch diameter tolerance", internal threads
INTERNAL = {"M1": (45, 56, None), "M1.4": (48, 60, 75), "M1.6": (53, 67, 85), "M2": (56, 71, 90), "M2.5": (60, 75, 95),
            "M3": (63, 80, 100), "M3.5": (71, 90, 112), "M4": (75, 95, 118), "M5": (80, 100, 125), "M6": (95, 118, 150),
            "M8": (100, 125, 160)}
# es in um of position g by pitch in mm. Source: ISO 965-1, table 1
G_POSITION = {0.35: 19, 0.4: 19, 0.45: 20, 0.5: 20, 0.6: 21, 0.7: 22, 0.75: 22, 0.8: 24, 1.0: 26, 1.25: 28, 1.5: 32,
              1.75: 34, 2.0: 38, 2.5: 42, 3.0: 48, 3.5: 53, 4.0: 60, 4.5: 63, 5.0: 71, 5.5: 75, 6.0: 80}
# Pitch diameter in inch, (largest, least). Source: ASME B1.1, table of limits of size, as in efunda.com, Unified Screw
# Threads (0-80 to 2-64), and in "Internal Thread Dimensions for Unified UNC Screw Threads" (2B)
UNIFIED = {"1/4-20 UNC-2A": (0.2164, 0.2127), "1/4-20 UNC-3A": (0.2175, 0.2147), "1/4-20 UNC-2B": (0.2224, 0.2175),
           "1/4-28 UNF-2A": (0.2258, 0.2225), "3/8-16 UNC-2A": (0.3331, 0.3287), "1/2-13 UNC-2A": (0.4485, 0.4435),
           "1/2-13 UNC-2B": (0.4565, 0.4500), "1/2-20 UNF-2A": (0.4662, 0.4619), "#10-32 UNF-2A": (0.1688, 0.1658),
           "1-8 UNC-2A": (0.9168, 0.9100), "#0-80 UNF-2A": (0.0514, 0.0496), "#0-80 UNF-2B": (0.0542, 0.0519),
           "#1-64 UNC-2A": (0.0623, 0.0603), "#1-72 UNF-3A": (0.0640, 0.0626), "#2-56 UNC-3B": (0.0765, 0.0744),
           "#6-32 UNC-2B": (0.1214, 0.1177), "#10-24 UNC-2B": (0.1672, 0.1629), "3/8-16 UNC-2B": (0.3401, 0.3344),
           "5/8-11 UNC-2B": (0.5732, 0.5660), "3/4-10 UNC-2B": (0.6927, 0.6850), "1-8 UNC-2B": (0.9276, 0.9188)}


def um(length: float) -> float:
    return from_si(length, "um")


@pytest.mark.parametrize("size", EXTERNAL)
def test_tabulated_tolerances_of_external_threads(size: str) -> None:
    found = tuple(um(external_limits(parse_thread(f"{size}-{grade}")).pitch_tolerance) for grade in ("6g", "4g6g"))
    assert found == pytest.approx(EXTERNAL[size], abs=1e-9)


@pytest.mark.parametrize("size", INTERNAL)
def test_tabulated_tolerances_of_internal_threads(size: str) -> None:
    for grade, expected in zip("456", INTERNAL[size], strict=True):
        if expected is not None:
            found = internal_limits(parse_thread(f"{size}-{grade}H")).pitch_tolerance
            assert um(found) == pytest.approx(expected, abs=1e-9)


def test_tabulated_fundamental_deviations() -> None:
    assert {pitch: fundamental_deviation("g", pitch) for pitch in G_POSITION} == G_POSITION
    assert fundamental_deviation("h", 1.5) == 0.0
    assert fundamental_deviation("e", 2.0) == 71.0


@pytest.mark.parametrize(("designation", "tolerance", "deviation"), [
    ("M20x1.5-6g", 140, -32), ("M10x1.5-6g", 132, -32), ("M20x2-4g", 100, -38)])
def test_the_three_of_the_field(designation: str, tolerance: float, deviation: float) -> None:
    found = external_limits(parse_thread(designation))
    assert (um(found.pitch_tolerance), um(found.deviation)) == pytest.approx((tolerance, deviation), abs=1e-9)


def test_limits_of_size_of_m10() -> None:
    """ISO 965-2: d 9.968 to 9.732, d2 8.994 to 8.862 mm."""
    found = external_limits(parse_thread("M10"))
    assert found.crest_diameter is not None
    assert [round(1e3 * value, 3) for value in (*found.crest_diameter, *found.pitch_diameter)] \
        == [9.732, 9.968, 8.862, 8.994]


@pytest.mark.parametrize("designation", UNIFIED)
def test_tabulated_limits_of_unified_threads(designation: str) -> None:
    thread = parse_thread(designation)
    found = internal_limits(thread) if thread.external is None else external_limits(thread)
    inches = [from_si(value, "inch") for value in reversed(found.pitch_diameter)]
    # The tables round allowance, tolerance and basic size one by one.
    assert inches == pytest.approx(UNIFIED[designation], abs=1.1e-4)


@pytest.mark.parametrize("designation", TABULATED_D2)
def test_tabulated_pitch_diameters(designation: str) -> None:
    thread = parse_thread(designation)
    found = internal_limits(thread) if thread.external is None else external_limits(thread)
    assert [round(1e3 * value, 3) for value in found.pitch_diameter] == pytest.approx(TABULATED_D2[designation])


@pytest.mark.parametrize("size", ENGAGEMENTS)
def test_normal_lengths_of_engagement(size: str) -> None:
    found = [1e3 * length for length in normal_engagement(parse_thread(size))]
    assert found == pytest.approx(ENGAGEMENTS[size])


def test_normal_length_of_engagement_of_m20x15() -> None:
    """ISO 965-1: 5.6 to 16 mm; the formula of what is not in the table comes near it."""
    least, most = (1e3 * length for length in normal_engagement(parse_thread("M20x1.5")))
    assert (least, most) == pytest.approx((5.6, 16.0))
    found = [1e3 * length for length in normal_engagement(parse_thread("M20x1.25"))]
    assert found == pytest.approx((2.24 * 1.25 * 11.2**0.2, 6.7 * 1.25 * 11.2**0.2))


@pytest.mark.parametrize(("designation", "diameter", "lead", "pitch", "starts"), [
    ("M20x1.5-6g", 20.0, 1.5, 1.5, 1), ("M20-6H/6g", 20.0, 2.5, 2.5, 1), ("M20x3(P1.5)-6g", 20.0, 3.0, 1.5, 2),
    ("M20xPh3P1.5-5g6g-L-LH", 20.0, 3.0, 1.5, 2), ("m 8 x 1", 8.0, 1.0, 1.0, 1), ("M64x4-7H", 64.0, 4.0, 4.0, 1),
    ("M20x1,5 6g", 20.0, 1.5, 1.5, 1), ("M20x3P1.5", 20.0, 3.0, 1.5, 2),
    ("1/4-20 UNC-2A", 6.35, 1.27, 1.27, 1), ("#8-32 UNC", 4.1656, 0.79375, 0.79375, 1),
    ("1 1/4-12 UNF-2A", 31.75, 25.4 / 12, 25.4 / 12, 1), (".250-28 UNF-3B", 6.35, 25.4 / 28, 25.4 / 28, 1)])
def test_designations(designation: str, diameter: float, lead: float, pitch: float, starts: int) -> None:
    thread = parse_thread(designation)
    assert (1e3 * thread.diameter, 1e3 * thread.lead, 1e3 * thread.pitch, thread.starts) == pytest.approx(
        (diameter, lead, pitch, starts))


def test_classes_of_a_designation() -> None:
    both = parse_thread("M20-6H/5g6g")
    assert both.external is not None
    assert both.internal is not None
    assert (both.external.grade, both.external.position, both.external.crest_grade) == (5, "g", 6)
    assert (both.internal.grade, both.internal.position) == (6, "H")
    assert parse_thread("M20").external is not None  # 6g where none is written
    assert parse_thread("M20-6H").external is None
    assert (parse_thread("M20xPh3P1.5-5g6g-L-LH").length_group, parse_thread("M20-6g-LH").left_handed) == ("L", True)


@pytest.mark.parametrize(("designation", "message"), [
    ("Tr20x4", "no thread designation; write it like M20x1.5-6g"), ("M21", "no coarse pitch for 21 mm"),
    ("M20x15", "more than half the diameter"), ("M20x3(P2)", "no whole multiple"), ("M20-6q", "no tolerance class"),
    ("M20-6b", "position 'b' is not known"), ("M20-6g/6g", "two classes"), ("M400x4", "from 0.99 to 355 mm"),
    ("M20-5g", "grades 4, 6 and 8; write it like 5g6g"), ("M20-9H", "no grade 9 here"), ("M20-6H", "internal thread")])
def test_what_the_standards_do_not_have_is_refused(designation: str, message: str) -> None:
    limits = internal_limits if designation == "M20-9H" else external_limits
    with pytest.raises(ToleranceError, match=message) as caught:
        limits(parse_thread(designation))
    assert "\n" not in str(caught.value)


def test_eighty_one_micrometres_take_all_of_it() -> None:
    """T_d2 140 um equals a pitch deviation of 81 um; a quarter of it, 20 um."""
    found = pitch_conformity([1.5e-3 + 80.83e-6], parse_thread("M20x1.5-6g"))
    assert found.cumulative_share == pytest.approx(1.0, abs=1e-4)
    assert um(found.limit) == pytest.approx(20.2, abs=0.05)
    assert found.verdict == NOT_CONFORM


@pytest.mark.parametrize(("deviation_um", "uncertainty_um", "verdict"), [
    (10.0, 4.9, CONFORM), (10.0, 5.3, NOT_DECIDABLE), (20.0, 0.05, CONFORM), (20.5, 0.05, NOT_CONFORM),
    (20.2, 0.05, NOT_DECIDABLE), (40.0, 9.8, NOT_CONFORM), (40.0, 10.0, NOT_DECIDABLE)])
def test_the_uncertainty_is_kept_in_mind(deviation_um: float, uncertainty_um: float, verdict: str) -> None:
    """ISO 14253-1, with 2 u."""
    found = pitch_conformity([1.5e-3 + 1e-6 * deviation_um, 1.5e-3], parse_thread("M20x1.5-6g"),
                             uncertainty=1e-6 * uncertainty_um)
    assert found.verdict == verdict


def test_deviations_add_up_over_the_engagement_only() -> None:
    pitch = np.full(30, 1.501e-3)
    thread = parse_thread("M20x1.5-6g")
    assert um(pitch_conformity(pitch, thread, engagement=9e-3).cumulative) == pytest.approx(6.0)
    assert um(pitch_conformity(pitch, thread, engagement=0.1).cumulative) == pytest.approx(30.0)
    pitch[::5] = np.nan  # never across a missing turn
    assert um(pitch_conformity(pitch, thread, engagement=0.1).cumulative) == pytest.approx(4.0)


def test_several_starts_are_judged_by_their_lead() -> None:
    found = pitch_conformity([3.0e-3] * 8, parse_thread("M20x3(P1.5)-6g"))
    assert found.verdict == CONFORM
    assert found.cumulative == pytest.approx(0.0, abs=1e-15)


@settings(deadline=None, max_examples=60)
@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=12), st.integers(1, 12))
def test_the_worst_cumulative_deviation_is_that_of_all_pairs(values: list[float], most: int) -> None:
    deviations = np.array(values)
    worst, (first, last) = worst_cumulative(deviations, most)
    every = [abs(float(deviations[i:j].sum())) for i in range(len(values))
             for j in range(i + 1, min(i + most, len(values)) + 1)]
    assert worst == pytest.approx(max(every), abs=1e-12)
    assert abs(float(deviations[first - 1:last].sum())) == pytest.approx(worst, abs=1e-12)


def test_pitches_that_make_no_sense_are_refused() -> None:
    thread = parse_thread("M20x1.5-6g")
    for pitch, options in (([math.nan], {}), ([math.inf], {}), ([1.5e-3], {"limit_share": 0.0}),
                           ([1.5e-3], {"uncertainty": -1.0}), ([1.5e-3], {"engagement": 0.0})):
        with pytest.raises(ToleranceError):
            pitch_conformity(pitch, thread, **options)
