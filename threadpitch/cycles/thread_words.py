"""Words that all threading blocks share, and the blocks of G32, G33, G34 and G92."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from decimal import Decimal

from threadpitch.cycles import single
from threadpitch.cycles.errors import Alarm, ProgramError, ThreadError
from threadpitch.cycles.modal import BlockWords, Indexing, Modal
from threadpitch.cycles.moves import TURN, Pass, Point, RunOut, Thread, ThreadPath, Wait
from threadpitch.cycles.multiple import Helix
from threadpitch.cycles.parameters import ControlParameters
from threadpitch.cycles.words import Span, lead, lead_change, lead_of_threads, unsigned_length, whole, within

RUN_OUT_UNIT = 0.1  # of a lead: what r and parameter 019 count
LARGEST_LEAD = 0.5  # m per turn
STARTS = Span(Decimal(1), Decimal(99), "starts")
_WHOLE_TURN_DEG = Decimal(360)


@contextmanager
def placed(words: BlockWords) -> Iterator[None]:
    """Gives numbers that make no thread their place: the word that carries them, or the block."""
    try:
        yield
    except ThreadError as error:
        raise ProgramError(words.place_of(error.address), error.alarm, error.what) from None


def taken_lead(modal: Modal, words: BlockWords) -> float:
    """F or I of this block, or what was last written, m per turn; becomes modal."""
    in_length, in_threads = words.take("F"), words.take("I")
    if in_length and in_threads:
        raise ProgramError(in_threads.place, Alarm.REPEATED, f"{in_length} and {in_threads} both give the lead; "
                           "write one of them")
    if in_length:
        modal.lead = lead(in_length, modal.scale)
    elif in_threads:
        modal.lead = lead_of_threads(in_threads)
    if modal.lead is None:
        raise ProgramError(words.place, Alarm.NO_FEED, "the thread has no lead; write F in mm or I in threads per inch")
    return modal.lead


def taken_start_angle(modal: Modal, words: BlockWords) -> float:
    """Q, rad from the one-turn signal; 0 where it is not written, it is not modal."""
    word = words.take("Q")
    if word is None:
        return 0.0
    dialect = modal.setup.dialect
    if dialect.start_angle_modulo:
        return math.radians(float(word.value * Decimal(str(dialect.start_angle_unit_deg)) % _WHOLE_TURN_DEG)) % TURN
    if word.has_point:
        raise ProgramError(word.place, Alarm.POINT, f"the start angle {word} takes no decimal point; write thousandths "
                           "of a degree")
    within(word, word.value, Span(Decimal(0), Decimal(360000), "thousandths of a degree"))
    degrees = word.value * Decimal(str(dialect.start_angle_unit_deg)) % _WHOLE_TURN_DEG
    return math.radians(float(degrees))


def taken_run_out(modal: Modal, words: BlockWords, width: float | None) -> RunOut | None:
    """J along the short axis, K along the long one; without both, ``width`` m along both (45 degrees) or none.

    K missing is K = J; where either is 0 there is none.
    """
    short, long = words.take("J"), words.take("K")
    if short is None and long is None:
        return RunOut(width, width) if width else None
    height = unsigned_length(short, modal.scale) if short else None
    length = unsigned_length(long, modal.scale) if long else None
    height = length if height is None else height
    length = height if length is None else length
    return RunOut(length, height) if length and height else None


def default_run_out(parameters: ControlParameters, pitch_lead: float) -> float:
    """r x 0.1 x lead by parameter 019, m."""
    return parameters.run_out_width * RUN_OUT_UNIT * pitch_lead


def thread_block(modal: Modal, words: BlockWords) -> None:
    """G32, G33, G34: one block in step with the spindle.

    Raises:
        ProgramError: no spindle, no lead, no movement, a lead that leaves its range.
    """
    modal.require_spindle(words)
    begin = modal.known_place(words)
    x, z = modal.target(words)
    end = Point(begin.x if x is None else x, begin.z if z is None else z)
    wait = _wait(modal)
    if modal.chain_is_broken:
        modal.note(words.place, "a dwell or a spindle word ends the chain of threading blocks: this one waits for the "
                   "one-turn signal anew")
    if wait is Wait.NONE and words.has("Q"):
        modal.note(words.place_of("Q"), "in a chain of threading blocks only the Q of the first counts")
    angle = taken_start_angle(modal, words)
    path = ThreadPath(begin, end, _block_lead(modal, words, still=end == begin), 0.0 if wait is Wait.NONE else angle,
                      wait=wait)
    if modal.motion == "G34":
        path = replace(path, lead_change=_taken_change(modal, words, path))
    run_out = taken_run_out(modal, words, None)
    if run_out is not None:
        path = _with_run_out(modal, path, run_out, words)
    if modal.chained:
        modal.paths[-1].append(path)
    else:
        modal.add_pass(Pass(1, "rough", None, _clear_of(modal, path), (path,)))
    modal.emit(Thread(words.line, path, len(modal.passes)), words.place)
    modal.x, modal.z = path.leaves_at.x, path.leaves_at.z


def _clear_of(modal: Modal, path: ThreadPath) -> Point:
    """Where the tool came from to the start of a path: along X, or to a thread across a face along Z."""
    begin = path.start
    if path.long_axis == "x" and modal.infeed_from_z is not None:
        return Point(begin.x, modal.infeed_from_z)
    return Point(begin.x if modal.infeed_from is None else modal.infeed_from, begin.z)


def single_cycle(modal: Modal, words: BlockWords) -> None:
    """G92: approach, one cut per start, retract, return.

    Raises:
        ProgramError: no spindle, no lead, no end point, numbers that make no thread.
    """
    modal.require_spindle(words)
    start = modal.known_place(words)
    x, z = modal.cycle_target(words)
    taper, starts = words.take("R"), words.take("L")
    if taper:
        modal.taper = modal.taken_length(taper)
    if starts:
        modal.starts = whole(starts, STARTS)
    pitch_lead = taken_lead(modal, words)
    run_out = taken_run_out(modal, words, default_run_out(modal.parameters, pitch_lead))
    angle = taken_start_angle(modal, words) if modal.setup.dialect.single_cycle_start_angle else 0.0
    with placed(words):
        helix = Helix(pitch_lead, modal.taper, run_out, modal.starts, angle)
        end = Point(start.x if x is None else x, start.z if z is None else z)
        cuts = single.passes(single.G92Cycle(start, end, helix))
    emit_passes(modal, words, cuts)


def emit_passes(modal: Modal, words: BlockWords, cuts: Sequence[Pass]) -> None:
    """Per pass: rapid A -> Bn, thread to D-E, rapid X to E, rapid Z to A."""
    for cut in cuts:
        numbered = modal.add_pass(cut)
        path = numbered.paths[0]
        modal.rapid(path.start.x, path.start.z, words.place)
        modal.emit(Thread(words.line, path, numbered.number), words.place)
        modal.rapid(cut.approach.x, path.leaves_at.z, words.place)
        modal.rapid(cut.approach.x, cut.approach.z, words.place)


def _block_lead(modal: Modal, words: BlockWords, still: bool) -> float:
    """The block's lead; zero is taken where the tool stands, in special grooves, refused elsewhere."""
    if not still:
        return taken_lead(modal, words)
    if modal.setup.indexing is not Indexing.EVERY_BLOCK:
        raise ProgramError(words.place, Alarm.LENGTH, "the threading block does not move; write an end point away from "
                           "the tool")
    word = words.take("F")
    if word is not None and word.value != 0:
        modal.lead = lead(word, modal.scale)
    return 0.0


def _wait(modal: Modal) -> Wait:
    if not modal.chained:
        return Wait.INDEX
    return Wait.START_ANGLE if modal.setup.indexing is Indexing.EVERY_BLOCK else Wait.NONE


def _taken_change(modal: Modal, words: BlockWords, path: ThreadPath) -> float:
    """Change of lead per turn, by R, or K where the dialect has it so; the end lead has to stay in its range."""
    taken = (words.take(address) for address in modal.setup.dialect.lead_change_addresses)
    word = next(filter(None, taken), None)
    if word:
        modal.lead_change = lead_change(word, modal.scale)
    if not modal.lead_change:
        raise ProgramError(words.place, Alarm.VARIABLE_LEAD, "G34 has no change of lead; write R in mm per turn, or "
                           "G32")
    place = word.place if word else words.place
    square = path.lead**2 + 2.0 * modal.lead_change * path.length
    if square <= 0.0:
        raise ProgramError(place, Alarm.VARIABLE_LEAD, "the lead turns negative before the end of the block; write a "
                           "smaller change or a shorter block")
    if square > LARGEST_LEAD**2:
        raise ProgramError(place, Alarm.VARIABLE_LEAD, "the lead grows beyond 500 mm before the end of the block; "
                           "write a smaller change or a shorter block")
    return modal.lead_change


def _with_run_out(modal: Modal, path: ThreadPath, run_out: RunOut, words: BlockWords) -> ThreadPath:
    """Withdrawal in X to the side that the tool was fed in from; where the lead runs along X, towards larger Z."""
    if run_out.length > path.length:
        raise ProgramError(words.place_of("K"), Alarm.RUN_OUT, f"the run-out takes {run_out.length * 1e3:.4g} mm of a "
                           f"block of {path.length * 1e3:.4g} mm; shorten it")
    inside = path.long_axis == "z" and modal.infeed_from is not None and modal.infeed_from < path.start.x
    return replace(path, run_out=RunOut(run_out.length, -run_out.height if inside else run_out.height))
