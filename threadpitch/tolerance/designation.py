"""Thread designations: M20x1.5-6g, M20-6H/6g, M20x3(P1.5), M20xPh3P1.5-5g6g-L-LH, 1/4-20 UNC-2A."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction

from threadpitch.units import from_si, to_si

METRIC, UNIFIED = "metric", "unified"

# Coarse pitches in mm by nominal diameter in mm: ISO 261
COARSE = {1.0: 0.25, 1.1: 0.25, 1.2: 0.25, 1.4: 0.3, 1.6: 0.35, 1.8: 0.35, 2.0: 0.4, 2.2: 0.45, 2.5: 0.45, 3.0: 0.5,
          3.5: 0.6, 4.0: 0.7, 4.5: 0.75, 5.0: 0.8, 6.0: 1.0, 7.0: 1.0, 8.0: 1.25, 9.0: 1.25, 10.0: 1.5, 11.0: 1.5,
          12.0: 1.75, 14.0: 2.0, 16.0: 2.0, 18.0: 2.5, 20.0: 2.5, 22.0: 2.5, 24.0: 3.0, 27.0: 3.0, 30.0: 3.5,
          33.0: 3.5, 36.0: 4.0, 39.0: 4.0, 42.0: 4.5, 45.0: 4.5, 48.0: 5.0, 52.0: 5.0, 56.0: 5.5, 60.0: 5.5, 64.0: 6.0,
          68.0: 6.0}
_SMALLEST_6H = 1.6  # mm, ISO 965-1: below it 5H and 6h are meant where no class is written
_SMALLEST, _LARGEST = 0.99, 355.0  # mm, ranges of ISO 965-1
_NUMBER = r"\d+(?:\.\d+)?"
_METRIC = re.compile(
    rf"M\s*(?P<d>{_NUMBER})"
    rf"(?:\s*[x×*]\s*(?:(?:Ph\s*)?(?P<ph>{_NUMBER})\s*P\s*(?P<p>{_NUMBER})|(?P<lead>{_NUMBER})"
    rf"(?:\s*\(\s*P\s*(?P<of>{_NUMBER})\s*\))?))?"
    r"(?P<classes>(?:\s*-\s*|\s+(?=\d))[^-]+)?(?P<group>\s*-\s*[SNL])?(?P<hand>\s*-?\s*LH)?", re.IGNORECASE)
_CLASS = re.compile(r"([3-9])([a-hA-H])(?:([3-9])([a-hA-H]))?")
_UNIFIED = re.compile(
    rf"(?:#?\s*(?P<screw>\d+)|(?P<inches>\d+\s+\d+/\d+|\d+/\d+|\d*\.\d+))\s*-\s*(?P<tpi>{_NUMBER})\s*"
    r"-?\s*(?P<series>UNC|UNF|UNEF|UNS|UNR[A-Z]*|UN)\s*(?:-\s*(?P<class>[123][AB]))?(?:\s*-\s*(?P<hand>LH))?",
    re.IGNORECASE)
_SMALL_SCREWS = 12  # numbered sizes #0 to #12; 1-8 UNC is one inch


class ToleranceError(ValueError):
    """A designation, or pitches, that no tolerance can be told of: what is wrong, and how to mend it."""


@dataclass(frozen=True)
class ToleranceClass:
    """Grades of pitch diameter and crest diameter with the letter of their position: 6g, or 5g6g."""

    grade: int
    position: str
    crest_grade: int


@dataclass(frozen=True)
class Thread:
    """What a designation says; lengths in m."""

    designation: str
    standard: str  # metric (ISO 965-1) or unified (ASME B1.1)
    diameter: float  # m, nominal major diameter
    pitch: float  # m, between neighbouring grooves
    starts: int
    external: ToleranceClass | None
    internal: ToleranceClass | None
    series: str = ""  # UNC, UNF, UN, ...
    length_group: str = "N"  # short, normal or long engagement
    left_handed: bool = False

    @property
    def lead(self) -> float:
        """Movement per revolution: starts * pitch."""
        return self.starts * self.pitch


def parse_thread(designation: str) -> Thread:
    """The thread of a designation.

    Raises:
        ToleranceError: the designation cannot be read, or names what the standards do not have.
    """
    text = re.sub(r"(?<=\d),(?=\d)", ".", designation.strip())  # a decimal comma, as on German drawings
    metric = _METRIC.fullmatch(text)
    if metric:
        return _metric(text, metric)
    unified = _UNIFIED.fullmatch(text)
    if unified:
        return _unified(text, unified)
    raise ToleranceError(f"{text!r} is no thread designation; write it like M20x1.5-6g, M20-6H/6g, M20x3(P1.5)-6g or "
                         "1/4-20 UNC-2A")


def _metric(text: str, match: re.Match[str]) -> Thread:
    diameter = float(match["d"])
    if not _SMALLEST <= diameter <= _LARGEST:
        raise ToleranceError(f"{text!r}: ISO 965-1 has diameters from {_SMALLEST:g} to {_LARGEST:g} mm")
    written = match["ph"] or match["lead"]
    if written is None and diameter not in COARSE:
        raise ToleranceError(f"{text!r}: there is no coarse pitch for {diameter:g} mm; write the pitch, "
                             f"like M{diameter:g}x1.5")
    lead = COARSE[diameter] if written is None else float(written)
    pitch = float(match["p"] or match["of"] or lead)
    starts = round(lead / pitch) if pitch > 0.0 else 0
    if starts < 1 or not math.isclose(starts * pitch, lead, rel_tol=1e-9):
        raise ToleranceError(f"{text!r}: the lead {lead:g} mm is no whole multiple of the pitch {pitch:g} mm")
    if pitch > 0.5 * diameter:
        raise ToleranceError(f"{text!r}: a pitch of {pitch:g} mm is more than half the diameter; is it the lead? "
                             f"write M{diameter:g}x{lead:g}(P...)")
    external, internal = _classes(text, (match["classes"] or "").strip(" -"), diameter)
    return Thread(text, METRIC, to_si(diameter, "mm"), to_si(pitch, "mm"), starts, external, internal,
                  length_group=(match["group"] or "N").strip(" -").upper(), left_handed=match["hand"] is not None)


def _classes(text: str, written: str, diameter: float) -> tuple[ToleranceClass | None, ToleranceClass | None]:
    """(external, internal): lower case letters are external threads, capitals internal ones."""
    if not written:
        written = "6H/6g" if diameter >= _SMALLEST_6H else "5H/6h"
    found: dict[bool, ToleranceClass] = {}
    for part in written.split("/"):
        match = _CLASS.fullmatch(part.strip())
        if match is None:
            raise ToleranceError(f"{text!r}: {part.strip()!r} is no tolerance class; write it like 6g, 5g6g or 6H")
        letter, other = match[2], match[4] or match[2]
        external = letter.islower()
        if letter not in ("efgh" if external else "GH") or other != letter:
            raise ToleranceError(f"{text!r}: position {letter!r} is not known; known are e, f, g, h (external) and "
                                 "G, H (internal)")
        if external in found:
            raise ToleranceError(f"{text!r}: two classes for one thread; write internal/external, like 6H/6g")
        found[external] = ToleranceClass(int(match[1]), letter, int(match[3] or match[1]))
    return found.get(True), found.get(False)


def _unified(text: str, match: re.Match[str]) -> Thread:
    if match["screw"] is not None:
        number = int(match["screw"])
        numbered = "#" in text or number > 4 or number == 0
        inches = 0.060 + 0.013 * number if numbered and number <= _SMALL_SCREWS else float(number)
    else:
        inches = float(sum(Fraction(part) for part in match["inches"].split()))
    per_inch = float(match["tpi"])
    if not 0.0 < inches <= 6.0 or not 3.0 <= per_inch <= 100.0:
        raise ToleranceError(f"{text!r}: ASME B1.1 has sizes to 6 inch with 4 to 80 threads per inch")
    diameter, pitch = to_si(inches, "inch"), to_si(1.0 / per_inch, "inch")
    written = (match["class"] or "").upper()
    one = ToleranceClass(int(written[0]), written[1], int(written[0])) if written else None
    external = one if one and one.position == "A" else (None if one else ToleranceClass(2, "A", 2))
    internal = one if one and one.position == "B" else (None if one else ToleranceClass(2, "B", 2))
    return Thread(text, UNIFIED, diameter, pitch, 1, external, internal, match["series"].upper(),
                  left_handed=match["hand"] is not None)


def millimetres(length: float) -> float:
    """A length of a thread in mm, in which the formulae of ISO 965-1 stand."""
    return from_si(length, "mm")
