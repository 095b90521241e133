"""A program -> canonical moves and threading passes: block by block, as the control executes it.

Understood, in G code system A (X and U diameters; U, W differences): G0 G1 G4 G18 G20 G21 G32 G33 G34 G40 G50 G54 G76
G80 G90 G92 G96 G97 G98 G99, M0 M1 M2 M3 M4 M5 M8 M9 M30, S, T, F, N, O, %. Any other word is an alarm, so that none is
passed over in silence; unknown M codes get a note, they belong to the machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal

from threadpitch.cycles.errors import Alarm, Notice, Place, ProgramError
from threadpitch.cycles.modal import BlockWords, Modal, Setup
from threadpitch.cycles.moves import (
    Dwell,
    End,
    Feed,
    Move,
    Pass,
    Point,
    SpindleLimit,
    SpindleSpeed,
    SpindleStop,
    Stop,
    SurfaceSpeed,
    Tool,
)
from threadpitch.cycles.multiple import G76Cycle
from threadpitch.cycles.multiple_words import multiple_cycle
from threadpitch.cycles.parameters import ControlParameters, Number
from threadpitch.cycles.pass_kinds import differently_turned, marked
from threadpitch.cycles.program import Block, Program, Word
from threadpitch.cycles.thread_words import single_cycle, taken_lead, thread_block
from threadpitch.cycles.words import Span, feed_rate, number, whole
from threadpitch.units import to_si

MOTION = ("G0", "G1", "G32", "G33", "G34", "G90", "G92")
AXES = ("X", "Z", "U", "W")
_UNITS, _FEEDS, _SPEEDS = ("G20", "G21"), ("G98", "G99"), ("G96", "G97")
_ONCE = ("G4", "G50", "G76")
_SPINDLE_CODES = (3, 4, 5)
_NO_EFFECT = ("G18", "G40", "G54", "G80")  # the planes, offsets and cycles that a threading program cancels
_GROUPS = (MOTION + _ONCE, _UNITS, _FEEDS, _SPEEDS)
_NATURAL = Span(Decimal(0), Decimal(99999999))
_SPEED = Span(Decimal(0), Decimal(99999))
_TOOL = Span(Decimal(0), Decimal(9999))
_SECONDS = Span(Decimal(0), Decimal(99999), "s")
_TOOL_WORD = 100  # T0203: tool 2, offset 3
_MENDS = {
    "G2": "arcs are not simulated", "G3": "arcs are not simulated", "G19": "threads are turned in G18",
    "G17": "threads are turned in G18", "G28": "write G0 to a safe place", "G30": "write G0 to a safe place",
    "G91": "write U and W for differences", "G7": "X is a diameter already", "G8": "X is a diameter here; double it",
    "G71": "stock removal is not simulated", "G94": "write G1 or G90", "G95": "write G99",
}


@dataclass(frozen=True)
class Interpretation:
    """What a program comes to. ``rewritten`` holds the parameters that its execution rewrote, by number."""

    moves: tuple[Move, ...]
    passes: tuple[Pass, ...]
    cycles: tuple[G76Cycle, ...]
    parameters: ControlParameters
    rewritten: dict[str, Number]
    notices: tuple[Notice, ...]


def interpret(program: Program, setup: Setup | None = None) -> Interpretation:
    """The moves and passes of a program on a machine that stands as ``setup`` says.

    Raises:
        ProgramError: the alarm with which the control stops, with line and column.
    """
    modal = Modal.of(setup or Setup())
    cycles: list[G76Cycle] = []
    for block in program.blocks:
        if modal.ended or (block.ends_tape and block is not program.blocks[0]):
            break
        cycle = _execute(modal, block)
        if cycle is not None:
            cycles.append(cycle)
    passes = marked(modal.finished_passes())
    for line, text in differently_turned(passes, modal.moves):
        modal.note(Place(line, 1, program.name), text)
    return Interpretation(tuple(modal.moves), passes, tuple(cycles), modal.parameters, modal.rewritten,
                          tuple(modal.notices))


def _execute(modal: Modal, block: Block) -> G76Cycle | None:
    """One block, in the order of the control: settings, tool and spindle, movement, stop."""
    words = BlockWords(block)
    codes = _codes(words)
    for address in ("N", "O"):
        label = words.take(address)
        if label is not None:
            whole(label, _NATURAL)
    switches = _switches(words)
    turning = modal.turning
    _settings(modal, words, codes)
    _tool_and_spindle(modal, words, codes, switches)
    if modal.direction is not None and modal.turning != turning:
        _turn(modal, words)
    cycle = _movement(modal, words, codes)
    _stops(modal, words, switches)
    words.refuse_unused()
    return cycle


def _switches(words: BlockWords) -> list[tuple[Word, int]]:
    """The M codes of the block; two that tell the spindle different things contradict each other."""
    switches = [(word, whole(word, _NATURAL)) for word in words.all("M")]
    spindle = [(word, code) for word, code in switches if code in _SPINDLE_CODES]
    for word, code in spindle:
        if code != spindle[0][1]:
            raise ProgramError(word.place, Alarm.M_CODE, f"{word} contradicts {spindle[0][0]} in one block; write one")
    return switches


def _codes(words: BlockWords) -> dict[str, Word]:
    """The G codes of the block; two of one group contradict each other."""
    codes: dict[str, Word] = {}
    for word in words.all("G"):
        if word.has_point or word.value < 0:
            raise ProgramError(word.place, Alarm.G_CODE, f"{word} is no G code; write a whole number")
        code = f"G{int(word.value)}"
        known = any(code in group for group in (*_GROUPS, _NO_EFFECT))
        if not known:
            raise ProgramError(word.place, Alarm.G_CODE, f"{word} is not known here; {_MENDS.get(code, 'remove it')}")
        for group in _GROUPS:
            rival = next((other for other in codes if code in group and other in group), None)
            lone_g90 = "G90" in (code, rival) and not words.has(*AXES)
            if rival is not None and rival != code and not lone_g90:
                raise ProgramError(word.place, Alarm.G_CODE, f"{word} contradicts {rival} in one block; write one")
        codes[code] = word
    return codes


def _settings(modal: Modal, words: BlockWords, codes: dict[str, Word]) -> None:
    for code in codes:
        if code in _UNITS:
            modal.scale = modal.scale.in_inch(code == "G20")
        elif code in _FEEDS:
            modal.feed_per_turn = code == "G99"
        elif code in _SPEEDS:
            modal.surface = code == "G96"
        elif code in MOTION and not (code == "G90" and not words.has(*AXES)):
            # G90 alone is the word for absolute coordinates of other controls: nothing to do where X and Z are so
            modal.enter(code)


def _tool_and_spindle(modal: Modal, words: BlockWords, codes: dict[str, Word],
                      switches: list[tuple[Word, int]]) -> None:
    tool = words.take("T")
    if tool is not None:
        modal.tool, offset = divmod(whole(tool, _TOOL), _TOOL_WORD)
        modal.emit(Tool(words.line, modal.tool, offset), tool.place)
    speed = None if "G50" in codes else words.take("S")
    if speed is not None:
        _speed(modal, speed)
    for _, switch in switches:
        if switch in (3, 4):
            modal.direction = "forward" if switch == 3 else "reverse"


def _speed(modal: Modal, word: Word) -> None:
    value = float(whole(word, _SPEED))
    if modal.surface:
        feet = 12 * 25.4e-3 if modal.scale.inch else 1.0  # m; S counts feet per minute after G20
        modal.surface_speed = to_si(value, "m/min") * feet
    else:
        modal.speed = to_si(value, "rpm")


def _turn(modal: Modal, words: BlockWords) -> None:
    assert modal.direction is not None
    if modal.surface and modal.surface_speed is not None:
        modal.emit(SurfaceSpeed(words.line, modal.surface_speed, modal.direction), words.place)
    elif not modal.surface and modal.speed is not None:
        modal.emit(SpindleSpeed(words.line, modal.speed, modal.direction), words.place)


def _movement(modal: Modal, words: BlockWords, codes: dict[str, Word]) -> G76Cycle | None:
    if "G76" in codes:
        return multiple_cycle(modal, words)
    if "G4" in codes:
        _dwell(modal, words)
    elif "G50" in codes:
        _coordinates(modal, words)
    elif words.has(*AXES):
        _BLOCKS[modal.motion](modal, words)
    elif modal.motion in ("G1", "G0", "G90"):
        _taken_feed(modal, words)
    elif any(code in codes for code in MOTION):
        _BLOCKS[modal.motion](modal, words)  # says what is missing
    elif words.has("F", "I"):
        taken_lead(modal, words)
    return None


def _stops(modal: Modal, words: BlockWords, switches: list[tuple[Word, int]]) -> None:
    for word, switch in switches:
        if switch == 5:
            modal.direction = None
            modal.emit(SpindleStop(words.line), word.place)
        elif switch == 0:
            modal.emit(Stop(words.line), word.place)
        elif switch in (2, 30):
            modal.ended = True
            modal.emit(End(words.line), word.place)
        elif switch in (98, 99):
            raise ProgramError(word.place, Alarm.M_CODE, f"{word} needs subprograms, which are not simulated; write "
                               "their blocks out")
        elif switch not in (1, 3, 4, 8, 9):
            modal.note(word.place, f"{word} belongs to the machine and is passed over")


def _dwell(modal: Modal, words: BlockWords) -> None:
    """G4: P in ms, X or U in s."""
    for address in ("P", "X", "U"):
        word = words.take(address)
        if word is not None:
            duration = whole(word, _NATURAL) / 1000.0 if address == "P" else number(word, _SECONDS)
            modal.emit(Dwell(words.line, duration), words.place)
            return
    raise ProgramError(words.place, Alarm.NO_NUMBER, "G4 has no duration; write P in ms, or X or U in s")


def _coordinates(modal: Modal, words: BlockWords) -> None:
    """G50 X Z: the tool stands at X, Z;  G50 U W: coordinates move by that much;  G50 S: highest speed."""
    limit = words.take("S")
    if limit is not None:
        modal.emit(SpindleLimit(words.line, to_si(float(whole(limit, _SPEED)), "rpm")), limit.place)
    elif not words.has(*AXES):
        raise ProgramError(words.place, Alarm.NO_NUMBER, "G50 has no word; write S, or X and Z")
    before = (modal.x, modal.z)
    x, z = modal.target(words)
    # The programmed coordinates of this very place become x - shift, z - shift: the shift takes the difference.
    if before[0] is None:
        modal.x = x
    elif x is not None:
        modal.shift_x += before[0] - x
    if before[1] is None:
        modal.z = z
    elif z is not None:
        modal.shift_z += before[1] - z


def _rapid_block(modal: Modal, words: BlockWords) -> None:
    if words.has("F"):
        _taken_feed(modal, words)
    x, z = modal.target(words)
    modal.rapid(x, z, words.place)


def _feed_block(modal: Modal, words: BlockWords) -> None:
    _taken_feed(modal, words)
    modal.known_place(words)
    x, z = modal.target(words)
    assert x is not None
    assert z is not None
    _cut(modal, words, Point(x, z))


def _turning_cycle(modal: Modal, words: BlockWords) -> None:
    """G90: rapid to X (by the taper R farther), cut to X Z, cut out to the start X, rapid back."""
    _taken_feed(modal, words)
    start = modal.known_place(words)
    x, z = modal.cycle_target(words)
    assert x is not None
    assert z is not None
    taper = words.take("R")
    if taper is not None:
        modal.taper = modal.taken_length(taper)
    modal.rapid(x + modal.taper, start.z, words.place)
    _cut(modal, words, Point(x, z))
    _cut(modal, words, Point(start.x, z))
    modal.rapid(start.x, start.z, words.place)


def _taken_feed(modal: Modal, words: BlockWords) -> None:
    word = words.take("F")
    if word is not None:
        modal.feed = feed_rate(word, modal.scale)


def _cut(modal: Modal, words: BlockWords, end: Point) -> None:
    if modal.feed is None:
        raise ProgramError(words.place, Alarm.NO_FEED, "the cut has no feed; write F")
    per_turn, per_time = (modal.feed, None) if modal.feed_per_turn else (None, modal.feed / 60.0)
    modal.emit(Feed(words.line, end, per_turn, per_time), words.place)
    modal.x, modal.z = end.x, end.z


_BLOCKS: dict[str, Callable[[Modal, BlockWords], None]] = {
    "G0": _rapid_block, "G1": _feed_block, "G32": thread_block, "G33": thread_block, "G34": thread_block,
    "G90": _turning_cycle, "G92": single_cycle,
}
