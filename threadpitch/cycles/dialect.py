"""The dialects of the threading words: one frozen record each, one field for every difference.

Sources: the command sheets of TOMATECH (the default reading), GSK 980TDi and GSK 988TA, and the operator's manual of
Fanuc 16/18. Where a sheet is silent the dialect follows TOMATECH, the fullest of them.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from enum import Enum

from threadpitch.cycles.errors import CycleError


class Clamping(Enum):
    """What becomes of roughing cuts that the rule dd (sqrt(n) - sqrt(n - 1)) makes smaller than dmin."""

    NO_MEMORY = "no_memory"  # depth n = max(dd sqrt(n), dd sqrt(n - 1) + dmin): n counts on, later cuts are below dmin
    STICKY = "sticky"  # once clamped, every later cut is dmin


class Finishing(Enum):
    """How the m finishing passes share the allowance d."""

    EQUAL_PARTS = "equal_parts"  # d / m each
    FIRST_TAKES_ALL = "first_takes_all"  # d, then spring passes without infeed


class PackedDigits(Enum):
    """How a P(m)(r)(a) of fewer than six digits is read."""

    PARTIAL = "partial"  # the digits from the right: a, then r, then m; what is not written stays with its parameter
    WHOLE = "whole"  # m, r and a together or none
    ZEROS = "zeros"  # a number: leading zeros need not be written


class BareNumber(Enum):
    """What a length without a decimal point counts (X, U, Z, W, R, J, K)."""

    UNIT = "unit"  # mm, or inch after G20
    INCREMENT = "increment"  # the least input increment


@dataclass(frozen=True)
class Dialect:
    """A control's reading of the threading words; angles in degrees as they are written in programs."""

    name: str
    title: str
    clamping: Clamping
    finishing: Finishing
    packed_digits: PackedDigits
    rewrites_parameters: bool  # executing m, r, a, dmin, d rewrites their system parameters
    start_angle_unit_deg: float  # what Q counts in G32, G33, G34 and G92
    start_angle_modulo: bool  # Q of more than a turn is taken modulo 360, otherwise refused
    single_cycle_start_angle: bool  # G92 takes Q
    least_finishing_passes: int = 0
    tool_angles_deg: tuple[int, ...] = ()  # the only ones that G76 takes; empty: 0 to 99
    bare_number: BareNumber = BareNumber.UNIT
    lead_change_addresses: tuple[str, ...] = ("R",)  # of G34


TOMATECH = Dialect(
    "tomatech", "TOMATECH G76 sheet",
    clamping=Clamping.NO_MEMORY, finishing=Finishing.EQUAL_PARTS, packed_digits=PackedDigits.PARTIAL,
    rewrites_parameters=True, start_angle_unit_deg=0.001, start_angle_modulo=False, single_cycle_start_angle=False,
)
GSK980TDI = Dialect(
    "gsk980tdi", "GSK 980TDi",
    clamping=Clamping.STICKY, finishing=Finishing.EQUAL_PARTS, packed_digits=PackedDigits.PARTIAL,
    rewrites_parameters=False, start_angle_unit_deg=0.001, start_angle_modulo=False, single_cycle_start_angle=False,
)
GSK988TA = Dialect(
    "gsk988ta", "GSK 988TA",
    clamping=Clamping.NO_MEMORY, finishing=Finishing.FIRST_TAKES_ALL, packed_digits=PackedDigits.WHOLE,
    rewrites_parameters=True, start_angle_unit_deg=1.0, start_angle_modulo=True, single_cycle_start_angle=True,
)
# The Fanuc manual says of dmin "the depth of cut is clamped at this value", and its finishing passes repeat the last
# one. Lengths without a point are read as by calculator-type input (parameter 3401 bit 0); BareNumber.INCREMENT is
# the other setting.
FANUC = Dialect(
    "fanuc", "Fanuc 16/18 T, G code system A",
    clamping=Clamping.STICKY, finishing=Finishing.FIRST_TAKES_ALL, packed_digits=PackedDigits.ZEROS,
    rewrites_parameters=True, start_angle_unit_deg=0.001, start_angle_modulo=False, single_cycle_start_angle=True,
    least_finishing_passes=1, tool_angles_deg=(0, 29, 30, 55, 60, 80),
    lead_change_addresses=("R", "K"),
)
DIALECTS: dict[str, Dialect] = {dialect.name: dialect for dialect in (TOMATECH, GSK980TDI, GSK988TA, FANUC)}


def dialect_named(name: str) -> Dialect:
    """The dialect of this name, in capitals or not.

    Raises:
        CycleError: there is none of this name; the nearest is given.
    """
    known = DIALECTS.get(name.strip().lower())
    if known is None:
        near = difflib.get_close_matches(name.lower(), DIALECTS, n=1)
        hint = f"did you mean {near[0]}?" if near else f"choose one of {', '.join(DIALECTS)}"
        raise CycleError(f"dialect {name!r} is not known; {hint}")
    return known
