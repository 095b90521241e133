"""What was found in the control, turn by turn, in numbers and in plain words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from threadpitch.trace import FloatArray
from threadpitch.units import from_si

SPEED, LEAD, START, SATURATION, FOLLOWING, OTHER = "speed", "lead", "start", "saturation", "following", "other"
_NAMED = 0.1  # share from which a part is named
_RIPPLE = 4  # swings from which the speed ripples: a drop and its recovery are two
_LAG_AGREES = 0.15  # of the expected lag


@dataclass(frozen=True, eq=False)
class ControlParts:
    """The nominal pitches' deviations and their parts, turn by turn."""

    turns: FloatArray  # (turns,) number of each turn
    deviation: FloatArray  # (turns,) m, P(n) - F
    speed_change: FloatArray  # (turns,) rad/s in each turn
    speed: FloatArray  # (turns,) rad/s at the end of each turn
    parts: dict[str, FloatArray]  # (turns,) m by name; they add up to the deviation
    lag: float | None  # s, fitted; None where the speed explains nothing
    lag_interval: tuple[float, float] | None  # of 95 %
    expected_lag: float | None
    course: FloatArray  # (crossings,) rad/s, the speed where turn 1 begins, and at the end of every turn
    start_angle: float = 0.0  # rad, where its turns begin

    @property
    def worst(self) -> float:
        """Largest deviation, m."""
        return float(np.abs(self.deviation).max())

    @property
    def shares(self) -> dict[str, float]:
        """part' deviation / |deviation|^2; they add up to 1. A part that works against the others is negative."""
        whole = float(self.deviation @ self.deviation)
        return {name: float(part @ self.deviation) / whole if whole > 0.0 else 0.0 for name, part in self.parts.items()}

    @property
    def lag_agrees(self) -> bool | None:
        """Whether the data follow the formula: the expected lag is in the interval, or nearly the fitted one."""
        if self.lag is None or self.lag_interval is None or self.expected_lag is None:
            return None
        near = abs(self.lag - self.expected_lag) <= _LAG_AGREES * self.expected_lag
        return near or self.lag_interval[0] <= self.expected_lag <= self.lag_interval[1]

    def sentences(self) -> tuple[str, ...]:
        """What happened and what to do about it, the largest part first."""
        shares = self.shares
        named = sorted((name for name in shares if shares[name] >= _NAMED), key=lambda name: -shares[name])
        return tuple(f"{100.0 * shares[name]:.0f} %: {_TEXTS[name](self)}" for name in named)


def control_document(found: ControlParts) -> dict[str, object]:
    """As JSON, lengths in um, turn by turn."""
    lag = {"lag_ms": found.lag, "expected_lag_ms": found.expected_lag}
    return {
        "start_angle_deg": round(from_si(found.start_angle, "deg"), 6),
        "shares": {name: round(share, 6) for name, share in found.shares.items()},
        **{name: None if value is None else round(1e3 * value, 6) for name, value in lag.items()},
        "lag_interval_ms": None if found.lag_interval is None else [round(1e3 * one, 6) for one in found.lag_interval],
        "lag_agrees": found.lag_agrees,
        "turns": [int(turn) for turn in found.turns.tolist()],
        "speed_rpm": [round(from_si(value, "rpm"), 4) for value in found.speed.tolist()],
        "deviation_um": [round(from_si(value, "um"), 6) for value in found.deviation.tolist()],
        "parts_um": {name: [round(from_si(value, "um"), 6) for value in part.tolist()]
                     for name, part in found.parts.items()},
        "sentences": list(found.sentences()),
    }


def control_documents(found: Sequence[ControlParts]) -> dict[str, object]:
    """That of the first start angle, and in ``start_angles`` those of all, ``lines`` in words."""
    return {**control_document(found[0]), "start_angles": [control_document(one) for one in found],
            "lines": control_lines(found)}


def _of_speed(found: ControlParts) -> str:
    return (f"the spindle's speed changes: it {_largest_change(found)}, and {_late(found)}: raise Kv or the "
            "feedforward, or steady the spindle")


def _of_lead(found: ControlParts) -> str:
    middle = from_si(float(np.median(found.parts[LEAD])), "um")
    return (f"the lead changes, and with it the feed's velocity: {_late(found)}, which makes {middle:.3g} um in a turn "
            "(change of lead x turns per second x lag): raise Kv or the feedforward")


def _late(found: ControlParts) -> str:
    told = f"the feed follows {1e3 * (found.lag or 0.0):.1f} ms late"
    if found.expected_lag is None:
        return told
    return f"{told}, {'as' if found.lag_agrees else 'not as'} expected ({1e3 * found.expected_lag:.1f} ms)"


def _largest_change(found: ControlParts) -> str:
    """``drops by 30 rpm in turns 1 to 3, from 500 rpm``; a ripple ``goes up and down, by up to 10 rpm``."""
    if _swings(found.course) >= _RIPPLE:
        return f"goes up and down, by up to {from_si(float(np.ptp(found.course)), 'rpm'):.3g} rpm"
    speed, before = found.course, found.course.size - 1 - found.turns.size  # turns before those that were split
    fall = np.maximum.accumulate(speed) - speed
    rise = speed - np.minimum.accumulate(speed)
    drops = fall.max() >= rise.max()
    last = int(np.argmax(fall if drops else rise))
    first = int((np.argmax if drops else np.argmin)(speed[:last + 1]))
    change = from_si(float(abs(speed[last] - speed[first])), "rpm")
    number = found.turns[0] - before
    turns = f"turn {number + first:g}" if last - first <= 1 else f"turns {number + first:g} to {number + last - 1:g}"
    entry = " at the entry" if first <= before <= last else ""
    return (f"{'drops' if drops else 'rises'} by {change:.3g} rpm{entry}, in {turns}, from "
            f"{from_si(float(speed[first]), 'rpm'):.4g} rpm")


def _swings(speed: FloatArray) -> int:
    """How often it goes from the upper quarter of its range to the lower one, or back."""
    high, low = float(speed.max()), float(speed.min())
    about = speed - 0.5 * (high + low)
    sides = np.sign(about[np.abs(about) > 0.25 * (high - low)])
    return int(np.count_nonzero(np.diff(sides)))


def _of_start(found: ControlParts) -> str:
    return (f"the start's transient, {from_si(float(found.parts[START][0]), 'um'):.3g} um in turn {found.turns[0]:g}: "
            "lengthen the approach or raise the acceleration")


def _of_saturation(found: ControlParts) -> str:
    turns = found.turns[found.parts[SATURATION] != 0.0]
    return (f"the feed drive is at its torque limit up to turn {turns.max():g}: lower the speed or the load, or raise "
            "the limit")


def _of_following(found: ControlParts) -> str:
    worst = int(np.argmax(np.abs(found.parts[FOLLOWING])))
    return (f"the following error changes beyond what the speed does, by "
            f"{from_si(float(found.parts[FOLLOWING][worst]), 'um'):.3g} um in turn {found.turns[worst]:g}: look for "
            "load, friction or resonance; raise Kv or the stiffness of the velocity loop")


def _of_other(found: ControlParts) -> str:
    return "neither speed nor following error: look at the command, the detectors' counts and their jitter"


_TEXTS = {SPEED: _of_speed, LEAD: _of_lead, START: _of_start, SATURATION: _of_saturation, FOLLOWING: _of_following,
          OTHER: _of_other}


def control_lines(found: Sequence[ControlParts]) -> list[str]:
    """In plain words: the start angle with the largest deviation, and in a line each the others."""
    worst, *others = sorted(found, key=lambda one: -one.worst)
    where = f" (start angle {_deg(worst)})" if others else ""
    return [f"Where in the control: the nominal pitches deviate by up to {_um(worst)} um{where}, of it",
            *(f"  - {line}" for line in worst.sentences()),
            *(f"  at {_deg(one)} by up to {_um(one)} um: {_shares(one)}" for one in others)]


def _shares(found: ControlParts) -> str:
    """``speed 91 %, start 9 %``: the parts that are worth a word."""
    shares = found.shares
    named = sorted((name for name in shares if abs(shares[name]) >= _NAMED), key=lambda name: -shares[name])
    return ", ".join(f"{name} {100.0 * shares[name]:.0f} %" for name in named)


def _deg(found: ControlParts) -> str:
    return f"{from_si(found.start_angle, 'deg'):.6g} deg"


def _um(found: ControlParts) -> str:
    return f"{from_si(found.worst, 'um'):.3g}"
