"""The two blocks of G76: words -> parameters, words -> ``G76Cycle``.

First block:  G76 P(m)(r)(a) Q(dmin) R(d)
Second block: G76 X(U) Z(W) R(i) P(k) Q(dd) F(L) or I(threads per inch) [J K]
"""

from __future__ import annotations

import math

from threadpitch.cycles.dialect import Dialect, PackedDigits
from threadpitch.cycles.errors import Alarm, Place, ProgramError
from threadpitch.cycles.modal import BlockWords, Modal, UnknownStart
from threadpitch.cycles.moves import Point
from threadpitch.cycles.multiple import G76Cycle, Helix, Infeed, passes, returns_through_air, thinner_than_least
from threadpitch.cycles.parameters import ControlParameters, Number
from threadpitch.cycles.program import Word
from threadpitch.cycles.thread_words import default_run_out, emit_passes, placed, taken_lead, taken_run_out
from threadpitch.cycles.words import allowance, increments
from threadpitch.units import from_si

PASSES, WIDTH, ANGLE, LEAST_CUT, ALLOWANCE = "057", "019", "058", "059", "060"  # parameter numbers
PACKED_DIGITS = 6
MICROMETRES = 1e6  # per m; unit of parameters 059 and 060
_SECOND = ("X", "U", "Z", "W", "F", "I", "J", "K")  # words that only the second block has
_ASSUMED_LEADS = 2.0  # leads before Z0 where an assumed start point lies


def multiple_cycle(modal: Modal, words: BlockWords) -> G76Cycle | None:
    """Either block of G76; the second gives the cycle whose passes it emits.

    Raises:
        ProgramError: what the control refuses, at the word that carries it.
    """
    if not words.has(*_SECOND):
        _first_block(modal, words)
        return None
    cycle = _second_block(modal, words)
    if not modal.setup.dialect.rewrites_parameters:
        modal.cycle_parameters = modal.parameters  # what the first block said was for this cycle only
    return cycle


def _first_block(modal: Modal, words: BlockWords) -> None:
    """P(m)(r)(a), Q(dmin), R(d): valid from now on; in most dialects their parameters are rewritten."""
    packed, least, final = words.take("P"), words.take("Q"), words.take("R")
    if not (packed or least or final):
        raise ProgramError(words.place, Alarm.CYCLE, "G76 has no word that it can use; write P, Q, R, or X, Z, P, Q, F")
    changes: dict[str, Number] = {}
    if packed:
        changes |= packed_digits(packed, modal.setup.dialect)
    if least:
        changes[LEAST_CUT] = _micrometres(increments(least, modal.scale))
    if final:
        changes[ALLOWANCE] = _micrometres(allowance(final, modal.scale))
    modal.cycle_parameters = modal.cycle_parameters.changed(changes)
    if packed:
        _check_dialect(modal.cycle_parameters, modal.setup.dialect, packed.place)
    if modal.setup.dialect.rewrites_parameters:
        modal.parameters = modal.cycle_parameters
        modal.rewritten |= changes


def packed_digits(word: Word, dialect: Dialect) -> dict[str, Number]:
    """P(m)(r)(a) -> the parameters that it gives: the last two digits are a, the two before r, the rest m.

    Raises:
        ProgramError: a point, a sign, more than six digits, or fewer than the dialect takes.
    """
    digits = word.text
    if word.has_point:
        raise ProgramError(word.place, Alarm.POINT, f"{word} packs m, r and a; write six digits without a point")
    if not digits.isdigit():
        raise ProgramError(word.place, Alarm.MINUS, f"{word} packs m, r and a; write six digits without a sign")
    if len(digits) > PACKED_DIGITS:
        raise ProgramError(word.place, Alarm.DIGITS, f"{word} has more than six digits; write two each for m, r and a")
    if dialect.packed_digits is PackedDigits.ZEROS:
        digits = digits.zfill(PACKED_DIGITS)
    if dialect.packed_digits is PackedDigits.WHOLE and len(digits) < PACKED_DIGITS - 1:
        raise ProgramError(word.place, Alarm.CYCLE, f"{word} leaves out a part of m, r, a; write six digits or no P")
    parts = {ANGLE: digits[-2:], WIDTH: digits[-4:-2], PASSES: digits[:-4]}
    return {number: int(part) for number, part in parts.items() if part}


def _second_block(modal: Modal, words: BlockWords) -> G76Cycle:
    modal.require_spindle(words)
    for pair in (("X", "U"), ("Z", "W")):
        if not words.has(*pair):
            raise ProgramError(words.place, Alarm.END_POINT, f"G76 has neither {pair[0]} nor {pair[1]}; write the end "
                               "point of the thread")
    height, first_cut, taper = words.take("P"), words.take("Q"), words.take("R")
    if height is None:
        raise ProgramError(words.place, Alarm.CYCLE, "G76 has no thread height; write P(k) as radius")
    if first_cut is None:
        raise ProgramError(words.place, Alarm.CYCLE, "G76 has no first cut; write Q(dd) as radius")
    parameters = modal.cycle_parameters
    _check_dialect(parameters, modal.setup.dialect, words.place)
    pitch_lead = taken_lead(modal, words)
    run_out = taken_run_out(modal, words, default_run_out(parameters, pitch_lead))
    with placed(words):
        helix = Helix(pitch_lead, modal.taken_length(taper) if taper else 0.0, run_out, modal.setup.starts)
        infeed = _infeed(parameters, increments(first_cut, modal.scale), modal.setup.dialect)
        deep = increments(height, modal.scale)
        start, end = _corners(modal, words, deep + pitch_lead + max(helix.taper, 0.0))
        cycle = G76Cycle(start, end, helix, deep, math.radians(parameters.tool_angle_deg), infeed)
        cuts = passes(cycle)
    _notes(modal, words, cycle)
    emit_passes(modal, words, cuts)
    return cycle


def _infeed(parameters: ControlParameters, first_cut: float, dialect: Dialect) -> Infeed:
    return Infeed(first_cut, parameters.least_cut_um / MICROMETRES, parameters.allowance_um / MICROMETRES,
                  int(parameters.finishing_passes), dialect.clamping, dialect.finishing)


def _corners(modal: Modal, words: BlockWords, clearance: float) -> tuple[Point, Point]:
    """A and D. Where no block has told A and the setup allows it, A is assumed for an external thread before Z0."""
    x, z = modal.target(words)
    unknown = modal.x is None or modal.z is None
    if unknown and modal.setup.unknown_start is UnknownStart.ASSUME and x is not None and z is not None and z < 0.0:
        modal.x = x + clearance if modal.x is None else modal.x
        modal.z = _ASSUMED_LEADS * (modal.lead or 0.0) if modal.z is None else modal.z
        modal.note(words.place, "no start point is told: assumed for an external thread at "
                   f"X{2.0 * from_si(modal.x, 'mm'):.4f} Z{from_si(modal.z, 'mm'):.4f}")
    start = modal.known_place(words)
    return start, Point(start.x if x is None else x, start.z if z is None else z)


def _check_dialect(parameters: ControlParameters, dialect: Dialect, place: Place) -> None:
    if dialect.tool_angles_deg and parameters.tool_angle_deg not in dialect.tool_angles_deg:
        allowed = ", ".join(map(str, dialect.tool_angles_deg))
        raise ProgramError(place, Alarm.CYCLE, f"the tool angle {parameters.tool_angle_deg:g} degrees is not allowed; "
                           f"write one of {allowed}")
    if parameters.finishing_passes < dialect.least_finishing_passes:
        raise ProgramError(place, Alarm.CYCLE, f"{parameters.finishing_passes:g} finishing passes are fewer than "
                           f"{dialect.least_finishing_passes}; write more as P(m)")


def _notes(modal: Modal, words: BlockWords, cycle: G76Cycle) -> None:
    infeed = cycle.infeed
    thin = thinner_than_least(infeed, cycle.height)
    if thin is not None:
        modal.note(words.place, f"the rule clamps one cut only: cuts after it fall below dmin, the first to "
                   f"{from_si(thin, 'mm'):.4f} mm")
    if infeed.finishing_passes == 0 and infeed.allowance > 0.0:
        modal.note(words.place, "no finishing pass (m = 0): the allowance d stays on the thread")
    if not returns_through_air(cycle):
        modal.note(words.place, "the start point lies within the thread height: the tool returns through the metal")
    own = modal.setup.tool_angles.get(modal.tool) if modal.tool is not None else None
    if own is not None and abs(own - cycle.tool_angle) > math.radians(0.01):
        modal.note(words.place, f"P(a) is {math.degrees(cycle.tool_angle):g} degrees, the tool's own angle is "
                   f"{math.degrees(own):g}: the flanks will not be those of the tool")


def _micrometres(value: float) -> float:
    """Parameters 059 and 060 count 0.001 mm; rounded to what the finest increment system can tell apart."""
    return round(value * MICROMETRES, 4)
