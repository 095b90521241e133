"""Limits of the pitch diameter: ISO 965-1 for metric threads, ASME B1.1 for unified ones.

ISO 965-1, P and d in mm, results in um, rounded to the series R40 of preferred numbers:

    T_d2(6) = 90 P^0.4 d^0.1           d the geometric mean of its range of diameters
    T_d2    = factor(grade) T_d2(6)    3: 0.5, 4: 0.63, 5: 0.8, 6: 1, 7: 1.25, 8: 1.6, 9: 2
    T_D2    = factor(grade) T_d2(6)    4: 0.85, 5: 1.06, 6: 1.32, 7: 1.7, 8: 2.12; factors are whole steps of R40
    T_d(6)  = 180 P^(2/3) - 3.15 P^(-1/2),   T_D1(6) = 230 P^0.7 (P >= 1), 433 P - 190 P^1.22 (P < 1)

The tabulated fundamental deviations decide; the formulae e = 50 + 11 P, f = 30 + 11 P, g = 15 + 11 P serve pitches
that are not in the table. ASME B1.1, in inches, L_E the length of engagement (D; 9 P for the fine series of one pitch):

    T(2A) = 0.0015 D^(1/3) + 0.0015 L_E^(1/2) + 0.015 P^(2/3)
    1A 1.5, 3A 0.75, 1B 1.95, 2B 1.3, 3B 0.975 of that;  allowance of 1A and 2A 0.3 T(2A)
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

from threadpitch.tolerance.designation import METRIC, Thread, ToleranceClass, ToleranceError, millimetres
from threadpitch.units import from_si, to_si

_Number = TypeVar("_Number", int, float)

RANGES = (0.99, 1.4, 2.8, 5.6, 11.2, 22.4, 45.0, 90.0, 180.0, 355.0)  # mm: above, up to and including
R40 = (1.0, 1.06, 1.12, 1.18, 1.25, 1.32, 1.4, 1.5, 1.6, 1.7, 1.8, 1.9, 2.0, 2.12, 2.24, 2.36, 2.5, 2.65, 2.8, 3.0,
       3.15, 3.35, 3.55, 3.75, 4.0, 4.25, 4.5, 4.75, 5.0, 5.3, 5.6, 6.0, 6.3, 6.7, 7.1, 7.5, 8.0, 8.5, 9.0, 9.5, 10.0)
EXTERNAL_STEPS = {3: -12, 4: -8, 5: -4, 6: 0, 7: 4, 8: 8, 9: 12}  # of R40 from T_d2(6): factors 0.5 to 2
INTERNAL_STEPS = {4: -3, 5: 1, 6: 5, 7: 9, 8: 13}  # factors 0.85 to 2.12
# T_d2(6) in um where the table of ISO 965-1 has another value than the formula, by range of diameters and pitch in mm
TABULATED = {(2.8, 0.5): 75.0, (45.0, 5.0): 250.0}
# Normal length of engagement in mm (above, up to) where the table is known, by range of diameters and pitch: ISO 965-1,
# table 2. It decides; the formulae come within 12 % of it.
ENGAGEMENT = {
    (1.4, 0.35): (0.8, 2.6), (1.4, 0.4): (1.0, 3.0), (1.4, 0.45): (1.3, 3.8), (2.8, 0.5): (1.5, 4.5),
    (2.8, 0.6): (1.7, 5.0), (2.8, 0.7): (2.0, 6.0), (2.8, 0.8): (2.5, 7.5), (5.6, 1.0): (3.0, 9.0),
    (5.6, 1.5): (5.0, 15.0), (11.2, 1.5): (5.6, 16.0), (11.2, 1.75): (6.0, 18.0), (11.2, 2.0): (8.0, 24.0),
    (11.2, 2.5): (10.0, 30.0), (22.4, 3.0): (12.0, 36.0), (22.4, 3.5): (15.0, 45.0), (22.4, 4.0): (18.0, 53.0),
    (22.4, 4.5): (21.0, 63.0),
}
CREST_FACTORS = {4: 0.63, 5: 0.8, 6: 1.0, 7: 1.25, 8: 1.6}
EXTERNAL_CREST_GRADES = (4, 6, 8)
# Fundamental deviations e, f, g in um by pitch in mm: ISO 965-1, table 1
DEVIATIONS = {
    0.2: (None, None, 17), 0.25: (None, None, 18), 0.3: (None, None, 18), 0.35: (None, 34, 19), 0.4: (None, 34, 19),
    0.45: (None, 35, 20), 0.5: (50, 36, 20), 0.6: (53, 36, 21), 0.7: (56, 38, 22), 0.75: (56, 38, 22),
    0.8: (60, 38, 24), 1.0: (60, 40, 26), 1.25: (63, 42, 28), 1.5: (67, 45, 32), 1.75: (71, 48, 34), 2.0: (71, 52, 38),
    2.5: (80, 58, 42), 3.0: (85, 63, 48), 3.5: (90, 70, 53), 4.0: (95, 75, 60), 4.5: (100, 80, 63), 5.0: (106, 85, 71),
    5.5: (112, 90, 75), 6.0: (118, 95, 80), 8.0: (140, 118, 100),
}
_CONSTANTS = {"e": 50.0, "f": 30.0, "g": 15.0}
_UNIFIED_FACTORS = {"1A": 1.5, "2A": 1.0, "3A": 0.75, "1B": 1.95, "2B": 1.3, "3B": 0.975}
_FINE_SERIES_LENGTH = 9.0  # pitches
_LENGTH_BY_DIAMETER = ("UNC", "UNF")


@dataclass(frozen=True)
class Limits:
    """Deviation and tolerance of a thread's pitch diameter and of its crest diameter, m.

    ``deviation`` is that of the upper limits of an external thread (es, not positive), of the lower limits of an
    internal one (EI, not negative). The crest diameter is the major one of an external thread, the minor one of an
    internal one; None where the standard is not built in.
    """

    deviation: float
    pitch_tolerance: float  # T_d2, T_D2
    pitch_diameter: tuple[float, float]  # least, largest
    crest_tolerance: float | None
    crest_diameter: tuple[float, float] | None


def external_limits(thread: Thread) -> Limits:
    """Limits of a bolt's thread.

    Raises:
        ToleranceError: the designation names no external thread, or a grade that the standard does not have.
    """
    if thread.external is None:
        raise ToleranceError(f"{thread.designation!r} is an internal thread; write the class like 6g, or 2A")
    if thread.standard != METRIC:
        return _unified(thread, thread.external)
    pitch = millimetres(thread.pitch)
    one = thread.external
    tolerance = written(stepped(basic_tolerance(thread), _grade(EXTERNAL_STEPS, one.grade, thread)))
    if one.crest_grade not in EXTERNAL_CREST_GRADES:
        raise ToleranceError(f"{thread.designation!r}: the major diameter has the grades 4, 6 and 8; write it like "
                             f"{one.grade}{one.position}6{one.position}")
    crest = written(r40(CREST_FACTORS[one.crest_grade] * (180.0 * pitch ** (2.0 / 3.0) - 3.15 / math.sqrt(pitch))))
    return _limits(fundamental_deviation(one.position, pitch), (tolerance, crest),
                   (_basic_pitch_diameter(thread), thread.diameter), -1.0)


def internal_limits(thread: Thread) -> Limits:
    """Limits of a nut's thread.

    Raises:
        ToleranceError: the designation names no internal thread, or a grade that the standard does not have.
    """
    if thread.internal is None:
        raise ToleranceError(f"{thread.designation!r} is an external thread; write the class like 6H, or 2B")
    if thread.standard != METRIC:
        return _unified(thread, thread.internal)
    pitch = millimetres(thread.pitch)
    one = thread.internal
    tolerance = written(stepped(basic_tolerance(thread), _grade(INTERNAL_STEPS, one.grade, thread)))
    sixth = 230.0 * pitch**0.7 if pitch >= 1.0 else 433.0 * pitch - 190.0 * pitch**1.22
    crest = written(r40(_grade(CREST_FACTORS, one.crest_grade, thread) * sixth))
    minor = thread.diameter - 1.25 * math.sqrt(3.0) / 2.0 * thread.pitch
    return _limits(fundamental_deviation(one.position.lower(), pitch), (tolerance, crest),
                   (_basic_pitch_diameter(thread), minor), 1.0)


def basic_tolerance(thread: Thread) -> float:
    """T_d2(6) = 90 P^0.4 d^0.1, um, a number of R40; d the geometric mean of the range of diameters."""
    low, high = diameter_range(thread)
    pitch = round(millimetres(thread.pitch), 9)
    tabulated = TABULATED.get((low, pitch))
    return tabulated if tabulated is not None else r40(90.0 * pitch**0.4 * math.sqrt(low * high) ** 0.1)


def diameter_range(thread: Thread) -> tuple[float, float]:
    """The range of ISO 965-1 (above, up to and including) that holds the nominal diameter, mm."""
    diameter = round(millimetres(thread.diameter), 9)
    upper = next(index for index, bound in enumerate(RANGES) if index and diameter <= bound)
    return RANGES[upper - 1], RANGES[upper]


def normal_engagement(thread: Thread) -> tuple[float, float]:
    """Lengths of engagement of group N, m; ISO 965-1: as tabulated, else (2.24 to 6.7) P d^0.2, d the range's least."""
    if thread.standard != METRIC:
        return 5.0 * thread.pitch, 15.0 * thread.pitch  # ASME B1.1: tolerances of class 2A hold up to 1.5 D
    low, pitch = diameter_range(thread)[0], round(millimetres(thread.pitch), 9)
    tabulated = ENGAGEMENT.get((low, pitch))
    if tabulated is not None:
        return to_si(tabulated[0], "mm"), to_si(tabulated[1], "mm")
    least = pitch * low**0.2
    return to_si(2.24 * least, "mm"), to_si(6.7 * least, "mm")


def fundamental_deviation(position: str, pitch: float) -> float:
    """Absolute fundamental deviation in um of position e, f, g or h at a pitch in mm."""
    if position == "h":
        return 0.0
    tabulated = DEVIATIONS.get(round(pitch, 9), (None, None, None))["efg".index(position)]
    return float(tabulated) if tabulated is not None else written(r40(_CONSTANTS[position] + 11.0 * pitch))


def r40(value: float) -> float:
    """The nearest preferred number of the series R40."""
    decade = 10.0 ** math.floor(math.log10(value))
    above = min(bisect_right(R40, value / decade), len(R40) - 1)
    return min((R40[above - 1], R40[above]), key=lambda one: abs(one * decade - value)) * decade


def stepped(number: float, steps: int) -> float:
    """The number of R40 so many steps further: 8 steps are a factor of 1.6."""
    return r40(number * 10.0 ** (steps / 40.0))


def written(number: float) -> float:
    """As the tables of ISO 965-1 write it, in whole um; a half goes to the even number: 26.5 is 26, 37.5 is 38."""
    return float(round(round(number, 9)))


def _grade(grades: Mapping[int, _Number], grade: int, thread: Thread) -> _Number:
    if grade not in grades:
        raise ToleranceError(f"{thread.designation!r}: there is no grade {grade} here; known are "
                             f"{min(grades)} to {max(grades)}")
    return grades[grade]


def _basic_pitch_diameter(thread: Thread) -> float:
    """d2 = d - 3/4 H,  H = sqrt(3)/2 P."""
    return thread.diameter - 0.375 * math.sqrt(3.0) * thread.pitch


def _limits(deviation: float, tolerances: tuple[float, float], diameters: tuple[float, float], sense: float) -> Limits:
    """Of pitch and crest, from um to m; an external thread (sense -1) lies below its diameters, others above."""
    width, crest_width = (to_si(value, "um") for value in tolerances)
    pitch_diameter, crest_diameter = diameters
    shift = sense * to_si(deviation, "um") + 0.0  # of position h 0, not -0
    return Limits(shift, width, _span(pitch_diameter + shift, sense * width), crest_width,
                  _span(crest_diameter + shift, sense * crest_width))


def _span(start: float, width: float) -> tuple[float, float]:
    return min(start, start + width), max(start, start + width)


def _four_decimals(inches: float) -> float:
    """As the tables of ASME B1.1 have it, a half upwards."""
    return math.floor(1e4 * inches + 0.5 + 1e-9) / 1e4


def _unified(thread: Thread, one: ToleranceClass) -> Limits:
    diameter, pitch = from_si(thread.diameter, "inch"), from_si(thread.pitch, "inch")
    length = diameter if thread.series in _LENGTH_BY_DIAMETER else _FINE_SERIES_LENGTH * pitch
    second = 0.0015 * diameter ** (1.0 / 3.0) + 0.0015 * math.sqrt(length) + 0.015 * pitch ** (2.0 / 3.0)
    name = f"{one.grade}{one.position}"
    tolerance = to_si(_four_decimals(_UNIFIED_FACTORS[name] * second), "inch")
    deviation = -to_si(_four_decimals(0.3 * second), "inch") if name in ("1A", "2A") else 0.0
    sense = -1.0 if one.position == "A" else 1.0
    return Limits(deviation, tolerance, _span(_basic_pitch_diameter(thread) + deviation, sense * tolerance), None, None)
