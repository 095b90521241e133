"""The verdict in plain words, and what to adjust or check."""

from __future__ import annotations

from threadpitch.judgement import shapes
from threadpitch.judgement.hypotheses import BOTH, CONTROL, MECHANICAL, NONE
from threadpitch.judgement.verdict import Evidence
from threadpitch.units import from_si

_HALF = 0.5  # of what the detectors saw
_SHOWN = 3  # parts of the rest that the sentence names
_CONTROL_ADVICE = ("Adjust the control: look where the nominal pitches deviate (spindle speed, following error, "
                   "torque limit, start) and raise the position gain or the feedforward, steady the spindle's speed or "
                   "lengthen the approach.")
_CHECKS = {
    shapes.PROGRESSIVE: "Every pitch is off by the same: check the screw's lead compensation, its temperature, the "
                        "spindle encoder's counts per turn (missed ones too), and the scale of the measurement.",
    shapes.DRIFT: "The pitch changes along the thread: check thermal growth and the screw's lead error table.",
    shapes.PERIODIC: "Something turns with this period: check screw, bearings, belt and gears for one that does.",
    shapes.SCREW: "It repeats with the turns of the ball screw: check its run-out, bearing and lead compensation.",
    shapes.EVENT: "One turn is off and the groove stays displaced: check for missed counts, slip of the workpiece or "
                  "the nut, and backlash.",
    shapes.DISPLACED: "One groove is displaced and the next is back: look there for a hard spot, foreign matter or a "
                      "chip.",
    shapes.SECTION: "A section of the thread is off: check the workpiece's support and wall, and the screw there.",
    shapes.START: "The beginning is off behind the detectors: check backlash, the approach, and the tool's deflection "
                  "as it enters.",
    shapes.END: "The end is off behind the detectors: check the run-out, and the workpiece's free end.",
}
_IRREGULAR_ADVICE = "It has no shape: check for a loose nut, tool or clamping, and chatter."

def sentence(cause: str, found: Evidence) -> str:
    """What the numbers say."""
    size = f"{_um(found.fluctuation)} um rms (largest {_um(found.largest)} um)"
    if cause == NONE:
        jitter = (" The nominal pitches fluctuate, but the thread does not: their detectors jitter."
                  if found.nominal_jitter > 2.0 * found.uncertainty else "")
        return (f"None: the measured fluctuation of {size} is what a measuring uncertainty of {_um(found.uncertainty)} "
                f"um makes; no pitch is off by more than {_um(found.bound)} um (95 %).{jitter}")
    if cause == CONTROL:
        return (f"Control: the fluctuation of {size} follows the nominal pitches{_gain(found)}, and what they leave is "
                f"within the measuring uncertainty of {_um(found.uncertainty)} um: at most {_um(found.bound)} um in "
                "any turn (95 %).")
    if cause == MECHANICAL:
        return f"Mechanical: the fluctuation of {size} is not in the nominal pitches; it is {_rest(found)}."
    if cause == BOTH:
        return (f"Both: {100.0 * found.control_share:.0f} % of the fluctuation of {size} is the nominal pitches'"
                f"{_gain(found)}; the rest is {_rest(found)}.")
    return f"Undetermined: {_open(size, found)}"


def not_in_the_thread(found: Evidence) -> bool:
    """Whether the detectors surely saw a movement, and the thread surely has not even half of it."""
    likeliest = min(found.costs, key=lambda one: found.costs[one], default="")
    return likeliest == NONE and found.movement > 0.0 and found.gain_interval is not None \
        and found.gain_interval[1] < _HALF


def _open(size: str, found: Evidence) -> str:
    """What is known where no cause can be named."""
    likeliest = min(found.costs, key=lambda one: found.costs[one])
    known = f"a fluctuation of {size} at a measuring uncertainty of {_um(found.uncertainty)} um"
    if not_in_the_thread(found):
        return (f"the detectors saw the feed move by {_um(found.movement)} um rms, which is not in the thread"
                f"{_gain(found)}, {known}; no pitch is off by more than {_um(found.bound)} um (95 %).")
    if found.movement > 0.0 and likeliest == NONE:
        return (f"the control moves the feed by {_um(found.movement)} um rms, which {known} neither shows nor "
                f"excludes; no pitch is off by more than {_um(found.bound)} um (95 %).")
    if found.sure:
        other = "a mechanical part" if found.sure == CONTROL else "the control's part"
        return (f"at least {found.sure}: {known} shows it, but neither shows nor excludes {other}, of up to "
                f"{_um(found.bound)} um in a turn (95 %).")
    if likeliest == NONE:
        return (f"noise explains {known} and {found.turns} turns, but does not exclude what matters: a pitch may be "
                f"off by {_um(found.bound)} um (95 %).")
    near = sorted(found.costs, key=lambda one: found.costs[one])[:2]
    return f"{known} and {found.turns} turns does not tell {' from '.join(near)}."


def advice(cause: str, found: Evidence) -> tuple[str, ...]:
    """What to adjust or check, the likeliest first."""
    lines: list[str] = []
    if cause in (CONTROL, BOTH):
        lines.append(_CONTROL_ADVICE)
    if cause in (MECHANICAL, BOTH):
        lines += dict.fromkeys(_CHECKS[part.kind] for part in found.rest)
        if found.irregular > 0.0:
            lines.append(_IRREGULAR_ADVICE)
    if cause == NONE and found.nominal_jitter > 2.0 * found.uncertainty:
        lines.append("Check the encoders and their cables: the nominal pitches jitter, the thread does not.")
    if cause not in (CONTROL, MECHANICAL, BOTH, NONE) and not_in_the_thread(found):
        lines.append("Check that the nominal pitches are of this thread, and of the pass that left it; if they are, "
                     "check the detectors: the tool did not do what they saw.")
    elif cause not in (CONTROL, MECHANICAL, BOTH, NONE):
        lines.append("Measure more turns, or with a smaller uncertainty.")
    return tuple(lines)

def within_turn_line(found: Evidence) -> str:
    """What repeats with every turn and is not in P(n); empty where it cannot be told."""
    told = [] if found.within_turn is None else [f"{_um(found.within_turn)} um (nominal)"]
    if found.measured_within_turn is not None:
        size, uncertainty = found.measured_within_turn
        told.append(f"{_um(size)} um (measured, +- {from_si(2.0 * uncertainty, 'um'):.2g} um)")
    return f"Error within the turn that repeats: {', '.join(told)}" if told else ""


def _gain(found: Evidence) -> str:
    if found.gain is None or found.gain_interval is None:
        return ""
    low, high = found.gain_interval
    return f" (gain {found.gain:.2f}, {low:.2f} to {high:.2f})"

def _rest(found: Evidence) -> str:
    named = [str(part) for part in found.rest[:_SHOWN]]
    if len(found.rest) > _SHOWN:
        named.append(f"{len(found.rest) - _SHOWN} smaller parts")
    if found.irregular > 0.0:
        named.append(f"irregular, {_um(found.irregular)} um rms")
    return "; ".join(named)

def _um(length: float) -> str:
    return f"{from_si(length, 'um'):.3g}"
