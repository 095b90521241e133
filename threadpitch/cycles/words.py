"""What the number of a word is worth: decimal point rules, increments, inch and millimetre, ranges.

In: a ``Word`` as written. Out: SI (m, rad, s, rad/s), X still as the diameter that was written. Decimal arithmetic up
to the last step, so that 60.64 mm becomes the float nearest to 0.06064 m.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from decimal import Decimal
from enum import Enum

from threadpitch.cycles.dialect import BareNumber
from threadpitch.cycles.errors import Alarm, ProgramError
from threadpitch.cycles.program import Word

_MM = Decimal("0.001")  # m
_INCH_MM = Decimal("25.4")
_LEAST_LEAD_MM, _LARGEST_LEAD_MM = Decimal("0.001"), Decimal(500)  # of F in threading
_FEWEST_THREADS, _MOST_THREADS = Decimal("0.06"), Decimal(25400)  # per inch, of I


class IncrementSystem(Enum):
    """Least input increment: IS-B 0.001 mm or 0.0001 inch, IS-C a tenth of it."""

    IS_B = "IS-B"
    IS_C = "IS-C"

    @property
    def millimetre(self) -> Decimal:
        """The increment in mm."""
        return Decimal("0.001") if self is IncrementSystem.IS_B else Decimal("0.0001")

    @property
    def inch(self) -> Decimal:
        """The increment in inch."""
        return self.millimetre / 10


@dataclass(frozen=True)
class Scale:
    """How lengths are read at this moment of a program."""

    increments: IncrementSystem = IncrementSystem.IS_B
    bare_number: BareNumber = BareNumber.UNIT
    inch: bool = False

    def in_inch(self, inch: bool) -> Scale:
        """The same after G20 (inch) or G21 (mm)."""
        return replace(self, inch=inch)

    @property
    def unit_mm(self) -> Decimal:
        """mm that a length of 1 with a point is worth."""
        return _INCH_MM if self.inch else Decimal(1)

    @property
    def increment_mm(self) -> Decimal:
        """mm that the least input increment is worth."""
        return self.increments.inch * _INCH_MM if self.inch else self.increments.millimetre

    @property
    def least(self) -> Decimal:
        """The least input increment in the program's own unit, mm or inch."""
        return self.increments.inch if self.inch else self.increments.millimetre

    @property
    def largest(self) -> Decimal:
        """The largest length of eight digits, in the program's own unit."""
        return self.least * (10**8 - 1)


@dataclass(frozen=True)
class Span:
    """What a number may be, both ends included, in the unit named; None where the words set no end."""

    low: Decimal | None
    high: Decimal | None
    unit: str = ""


def within(word: Word, value: Decimal, span: Span) -> Decimal:
    """The value, or the alarm that it is out of its range."""
    if value < 0 and span.low == 0:
        raise ProgramError(word.place, Alarm.MINUS, f"{word} is negative; write it without sign")
    if (span.low is not None and value < span.low) or (span.high is not None and value > span.high):
        low, high = (f"{end:f}" if end is not None else "" for end in (span.low, span.high))
        what = f"{word} is out of its range; write {low} to {high} {span.unit}".rstrip()
        raise ProgramError(word.place, Alarm.RANGE, what)
    return value


def length(word: Word, scale: Scale) -> float:
    """A signed length, m: mm or inch with a point and, by the dialect, without (X, U, Z, W, R, J, K)."""
    return float(_own_unit(word, scale, -scale.largest) * scale.unit_mm * _MM)


def unsigned_length(word: Word, scale: Scale) -> float:
    """A length without sign, m (J, K)."""
    return float(_own_unit(word, scale, Decimal(0)) * scale.unit_mm * _MM)


def allowance(word: Word, scale: Scale) -> float:
    """The finishing allowance R(d), m: 0 to 99.999 mm (or inch)."""
    value = _bare(word, scale)
    within(word, value, Span(Decimal(0), Decimal(100) - scale.least, "inch" if scale.inch else "mm"))
    return float(value * scale.unit_mm * _MM)


def increments(word: Word, scale: Scale) -> float:
    """A cut or height, m: least input increments without a point, mm or inch with one (P(k), Q(dd), Q(dmin)).

    Range 0 to 99999 increments (IS-B), 0 to 999999 (IS-C): 99.999 mm both.
    """
    in_unit = word.value if word.has_point else word.value * scale.least
    most = Decimal(99999 if scale.increments is IncrementSystem.IS_B else 999999)
    unit = "inch" if scale.inch else "mm"
    within(word, in_unit, Span(Decimal(0), most * scale.least, unit))
    return float(in_unit * scale.unit_mm * _MM)


def lead(word: Word, scale: Scale) -> float:
    """F, movement per turn, m: 0.001 to 500 mm, in inch after G20."""
    value = word.value * scale.unit_mm
    if value == 0:
        raise ProgramError(word.place, Alarm.NO_FEED, f"the lead {word} is zero; write the movement per turn")
    span = Span(_LEAST_LEAD_MM, _LARGEST_LEAD_MM, "mm")
    if value < 0:
        span = replace(span, low=Decimal(0))
    return float(within(word, value, span) * _MM)


def feed_rate(word: Word, scale: Scale) -> float:
    """F of a cut, m per turn or m per minute: 0.0001 to 240000 mm, in inch after G20."""
    value = within(word, word.value * scale.unit_mm, Span(Decimal("0.0001"), Decimal(240000), "mm"))
    return float(value * _MM)


def lead_of_threads(word: Word) -> float:
    """lead = 25.4 mm / I, I threads per inch, 0.06 to 25400; m."""
    if word.value < 0:
        raise ProgramError(word.place, Alarm.MINUS, f"{word} is negative; write it without sign")
    threads = within(word, word.value, Span(_FEWEST_THREADS, _MOST_THREADS, "threads per inch"))
    return float(_INCH_MM / threads * _MM)


def lead_change(word: Word, scale: Scale) -> float:
    """R of G34, change of lead per turn, signed, m: 0.001 to 500 mm."""
    value = word.value * scale.unit_mm
    if not _LEAST_LEAD_MM <= abs(value) <= _LARGEST_LEAD_MM:
        raise ProgramError(word.place, Alarm.VARIABLE_LEAD,
                           f"the change of lead {word} is out of its range; write 0.001 to 500 mm per turn, "
                           "either sign")
    return float(value * _MM)


def whole(word: Word, span: Span) -> int:
    """A whole number without a decimal point (G, M, S, T, L, P of a dwell)."""
    if word.has_point:
        raise ProgramError(word.place, Alarm.POINT, f"{word} takes no decimal point; write a whole number")
    return int(within(word, word.value, span))


def number(word: Word, span: Span) -> float:
    """A number with or without a point, in its own unit (F of a feed, X of a dwell)."""
    return float(within(word, word.value, span))


def finer_than_increment(word: Word, scale: Scale) -> bool:
    """Whether the number has places below the least input increment, which a control drops."""
    return word.has_point and word.value % scale.least != 0


def _own_unit(word: Word, scale: Scale, low: Decimal) -> Decimal:
    return within(word, _bare(word, scale), Span(low, scale.largest, "inch" if scale.inch else "mm"))


def _bare(word: Word, scale: Scale) -> Decimal:
    if word.has_point or scale.bare_number is BareNumber.UNIT:
        return word.value
    return word.value * scale.least
