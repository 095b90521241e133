"""The one table of units: SI inside, millimetres, degrees and rpm at the edge.

Every unit is described as the FMI and SSP standards do: ``SI value = factor * value + offset`` in SI base units with
integer exponents; radian is kept as a base unit of its own.
"""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass

BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True)
class Unit:
    """A unit: ``SI value = factor * value + offset`` in ``kg^a m^b s^c A^d K^e mol^f cd^g rad^h``."""

    name: str
    exponents: tuple[int, ...] = (0, 0, 0, 0, 0, 0, 0, 0)  # in the order of BASES
    factor: float = 1.0
    offset: float = 0.0

    def base(self) -> dict[str, int]:
        """The exponents that are not zero, by base unit."""
        return {name: power for name, power in zip(BASES, self.exponents, strict=True) if power}


class UnitError(ValueError):
    """A unit is not known, or does not fit the quantity."""


def _unit(name: str, factor: float = 1.0, offset: float = 0.0, **powers: int) -> Unit:
    return Unit(name, tuple(powers.get(base, 0) for base in BASES), factor, offset)


_TURN = 2.0 * math.pi
_TABLE = (
    _unit("1"), _unit("%", 0.01),
    _unit("m", m=1), _unit("mm", 1e-3, m=1), _unit("um", 1e-6, m=1), _unit("nm", 1e-9, m=1), _unit("inch", 0.0254, m=1),
    _unit("rad", rad=1), _unit("deg", math.pi / 180.0, rad=1), _unit("rev", _TURN, rad=1),
    _unit("s", s=1), _unit("ms", 1e-3, s=1), _unit("us", 1e-6, s=1), _unit("min", 60.0, s=1),
    _unit("Hz", s=-1), _unit("kHz", 1e3, s=-1), _unit("1/s", s=-1),
    _unit("rad/s", rad=1, s=-1), _unit("rpm", _TURN / 60.0, rad=1, s=-1), _unit("deg/s", math.pi / 180.0, rad=1, s=-1),
    _unit("rad/s2", rad=1, s=-2), _unit("rad/s3", rad=1, s=-3),
    _unit("m/s", m=1, s=-1), _unit("mm/s", 1e-3, m=1, s=-1), _unit("m/min", 1.0 / 60.0, m=1, s=-1),
    _unit("mm/min", 1e-3 / 60.0, m=1, s=-1),
    _unit("m/s2", m=1, s=-2), _unit("mm/s2", 1e-3, m=1, s=-2), _unit("m/s3", m=1, s=-3),
    _unit("m/rad", m=1, rad=-1), _unit("mm/rev", 1e-3 / _TURN, m=1, rad=-1),
    _unit("kg", kg=1), _unit("kg.m2", kg=1, m=2), _unit("kg.cm2", 1e-4, kg=1, m=2),
    _unit("N", kg=1, m=1, s=-2), _unit("kN", 1e3, kg=1, m=1, s=-2),
    _unit("N/s", kg=1, m=1, s=-3), _unit("N/s2", kg=1, m=1, s=-4),
    _unit("N.m", kg=1, m=2, s=-2), _unit("N.m/s", kg=1, m=2, s=-3), _unit("N.m/s2", kg=1, m=2, s=-4),
    _unit("N.m.s/rad", kg=1, m=2, s=-1, rad=-1),
    _unit("N.m/rad", kg=1, m=2, s=-2, rad=-1),
    _unit("N/m", kg=1, s=-2), _unit("N/um", 1e6, kg=1, s=-2), _unit("N.s/m", kg=1, s=-1),
    _unit("N/m2", kg=1, m=-1, s=-2), _unit("N/mm2", 1e6, kg=1, m=-1, s=-2),
    _unit("J", kg=1, m=2, s=-2), _unit("J/K", kg=1, m=2, s=-2, K=-1), _unit("W/K", kg=1, m=2, s=-3, K=-1),
    _unit("W", kg=1, m=2, s=-3), _unit("kW", 1e3, kg=1, m=2, s=-3),
    _unit("W/m2", kg=1, s=-3), _unit("W/(m.K)", kg=1, m=1, s=-3, K=-1), _unit("W/(m2.K)", kg=1, s=-3, K=-1),
    _unit("J/(kg.K)", m=2, s=-2, K=-1), _unit("kJ", 1e3, kg=1, m=2, s=-2), _unit("kW.h", 3.6e6, kg=1, m=2, s=-2),
    _unit("K/W", kg=-1, m=-2, s=3, K=1), _unit("K/s", K=1, s=-1),
    _unit("A", A=1), _unit("mA", 1e-3, A=1), _unit("C", A=1, s=1), _unit("A/s", A=1, s=-1),
    _unit("V", kg=1, m=2, s=-3, A=-1), _unit("mV", 1e-3, kg=1, m=2, s=-3, A=-1),
    _unit("V/s", kg=1, m=2, s=-4, A=-1), _unit("V.s/rad", kg=1, m=2, s=-2, A=-1, rad=-1),
    _unit("Ohm", kg=1, m=2, s=-3, A=-2), _unit("H", kg=1, m=2, s=-2, A=-2), _unit("mH", 1e-3, kg=1, m=2, s=-2, A=-2),
    _unit("F", kg=-1, m=-2, s=4, A=2), _unit("uF", 1e-6, kg=-1, m=-2, s=4, A=2), _unit("Wb", kg=1, m=2, s=-2, A=-1),
    _unit("T", kg=1, s=-2, A=-1), _unit("N.m/A", kg=1, m=2, s=-2, A=-1), _unit("N/A", kg=1, m=1, s=-2, A=-1),
    _unit("Pa", kg=1, m=-1, s=-2), _unit("kPa", 1e3, kg=1, m=-1, s=-2), _unit("MPa", 1e6, kg=1, m=-1, s=-2),
    _unit("GPa", 1e9, kg=1, m=-1, s=-2), _unit("bar", 1e5, kg=1, m=-1, s=-2), _unit("Pa/s", kg=1, m=-1, s=-3),
    _unit("Pa.s", kg=1, m=-1, s=-1), _unit("m2/s", m=2, s=-1),
    _unit("m2", m=2), _unit("mm2", 1e-6, m=2), _unit("m3", m=3), _unit("mm3", 1e-9, m=3), _unit("l", 1e-3, m=3),
    _unit("m3/s", m=3, s=-1), _unit("l/min", 1e-3 / 60.0, m=3, s=-1), _unit("kg/s", kg=1, s=-1),
    _unit("m3/Pa", kg=-1, m=4, s=2), _unit("kg/m3", kg=1, m=-3), _unit("g", 1e-3, kg=1), _unit("h", 3600.0, s=1),
    _unit("K", K=1), _unit("1/K", K=-1), _unit("um/m/K", 1e-6, K=-1), _unit("degC", 1.0, 273.15, K=1),
    _unit("um/m", 1e-6), _unit("um/(300 mm)", 1e-6 / 0.3),
)
UNITS: dict[str, Unit] = {unit.name: unit for unit in _TABLE}
_SPELLINGS = {"": "1", "-": "1", "mm/U": "mm/rev", "in": "inch", "µm": "um", "μm": "um", "°": "deg", "Nm": "N.m",
              "m/s^2": "m/s2", "kg.m^2": "kg.m2", "kgm2": "kg.m2", "1/min": "rpm", "r/min": "rpm", "rps": "rev/s",
              "ohm": "Ohm", "Ω": "Ohm"}
UNITS["rev/s"] = _unit("rev/s", _TURN, rad=1, s=-1)


_SOME = "; known are m, mm, um, rad, deg, rev, s, rpm, N, N.m, ..."


def unit(name: str) -> Unit:
    """The unit of this name.

    Raises:
        UnitError: the name is not in the table; the nearest names are given.
    """
    known = UNITS.get(_SPELLINGS.get(name, name))
    if known is None:
        near = difflib.get_close_matches(name, UNITS, n=3)
        hint = f"; did you mean {', '.join(near)}?" if near else _SOME
        raise UnitError(f"unit {name!r} is not known{hint}")
    return known


def compatible(one: Unit, other: Unit) -> bool:
    """Whether both measure the same quantity (equal exponents of all base units)."""
    return one.exponents == other.exponents


def conversion(source: str, target: str) -> tuple[float, float]:
    """(factor, offset) with ``target value = factor * source value + offset``.

    Raises:
        UnitError: a unit is not known, or the two measure different quantities.
    """
    return between(unit(source), unit(target))


def between(one: Unit, other: Unit) -> tuple[float, float]:
    """(factor, offset) with ``value in other = factor * value in one + offset``; serves units of any table.

    Raises:
        UnitError: the two measure different quantities.
    """
    if not compatible(one, other):
        raise UnitError(f"unit {one.name!r} cannot be converted to {other.name!r}")
    if (one.factor, one.offset) == (other.factor, other.offset):
        return 1.0, 0.0
    return one.factor / other.factor, (one.offset - other.offset) / other.factor


def to_si(value: float, name: str) -> float:
    """``factor * value + offset`` of the unit: the value in SI.

    Raises:
        UnitError: the unit is not known.
    """
    known = unit(name)
    return known.factor * value + known.offset


def from_si(value: float, name: str) -> float:
    """``(value - offset) / factor`` of the unit: the SI value in this unit.

    Raises:
        UnitError: the unit is not known.
    """
    known = unit(name)
    return (value - known.offset) / known.factor
