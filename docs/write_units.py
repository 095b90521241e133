"""Writes docs/units.md, the page of all units: python docs/write_units.py."""

from __future__ import annotations

from pathlib import Path

from threadpitch.units import UNITS, Unit

PAGE = Path(__file__).with_name("units.md")
_HEAD = """# Units

Written by `python docs/write_units.py` from `threadpitch/units.py`. Variables are declared in SI units; the units
beside them are for people: `display=`, files of parameters, columns of logs.

| SI units | in base units | units for people |
|---|---|---|
"""


def page() -> str:
    """The page: the units of one dimension in one row."""
    dimensions: dict[tuple[int, ...], list[Unit]] = {}
    for unit in UNITS.values():
        dimensions.setdefault(unit.exponents, []).append(unit)
    return _HEAD + "".join(_row(units) for units in dimensions.values())


def _row(units: list[Unit]) -> str:
    own = [f"`{unit.name}`" for unit in units if _is_si(unit)]
    base = " ".join(f"{name}^{power}" if power != 1 else name for name, power in units[0].base().items()) or "1"
    shown = [f"`{unit.name}` = {unit.factor:.12g}" + (f" + {unit.offset:g}" if unit.offset else "")
             for unit in units if not _is_si(unit)]
    return f"| {', '.join(own)} | {base} | {', '.join(shown)} |\n"


def _is_si(unit: Unit) -> bool:
    return unit.factor == 1.0 and unit.offset == 0.0


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
