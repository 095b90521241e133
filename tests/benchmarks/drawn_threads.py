"""Threads whose cause is known, drawn from closed formulae: what the control sees, what the thread shows.

A thread is P_nominal = target + seen + jitter and P_actual = target + seen + unseen (turns,): ``seen`` is what the
control's detectors see the drives do, ``unseen`` what happens behind them, ``jitter`` what only the detectors show.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Draw = Callable[["Machine", np.random.Generator], Array]


@dataclass(frozen=True)
class Machine:
    """Drawn parameters of one thread."""

    turns: int
    lead: float  # m per spindle turn
    screw_lead: float  # m
    lag: float  # s, (1 - feedforward) / Kv + Td
    count: float  # rad, of the spindle's encoder


@dataclass(frozen=True, eq=False)
class Thread:
    """One thread and its cause."""

    fault: str
    cause: str
    machine: Machine
    nominal: Array  # (turns,) m
    measured: Array  # (turns,) m
    uncertainty: float  # m
    severity: float  # largest deviation of the smaller cause over the uncertainty; 0 = nothing is wrong
    sizes: dict[str, float] = field(default_factory=dict)  # m, by cause: its largest deviation


def spindle_dip(machine: Machine, draw: np.random.Generator) -> Array:
    """P = -F dN/60 lag: the speed falls at the entry and comes back."""
    entry, recovery = draw.integers(1, max(2, machine.turns // 2)), draw.uniform(1.0, 6.0)
    turn = np.arange(machine.turns + 1, dtype=np.float64)
    since = np.maximum(turn - entry, 0.0)
    speed = -np.exp(-since / recovery) * (1.0 - np.exp(-since / 0.7)) * (turn >= entry)
    return -np.diff(speed)


def spindle_hunting(machine: Machine, draw: np.random.Generator) -> Array:
    """A speed loop that rings: a damped wave over the whole thread."""
    turn = np.arange(machine.turns + 1, dtype=np.float64)
    wave = np.exp(-turn / draw.uniform(5.0, 40.0)) * np.sin(2.0 * math.pi * draw.uniform(0.03, 0.3) * turn
                                                             + draw.uniform(0.0, 6.3))
    return np.diff(wave)


def belt_ripple(machine: Machine, draw: np.random.Generator) -> Array:
    """Amplitude 2A|sin(pi q)| of an order q that is not whole."""
    order = draw.uniform(0.08, 0.92)
    return np.asarray(np.sin(2.0 * math.pi * order * np.arange(machine.turns) + draw.uniform(0.0, 6.3)))


def saturation(machine: Machine, draw: np.random.Generator) -> Array:
    """The feed falls back for some turns and catches up."""
    first = int(draw.integers(0, max(1, machine.turns // 2)))
    length = int(draw.integers(1, max(2, machine.turns // 4)))
    pitch = np.zeros(machine.turns)
    pitch[first:first + length] = -1.0 / length
    catching = np.exp(-np.arange(machine.turns - first - length) / draw.uniform(0.5, 3.0))
    pitch[first + length:] = catching / max(float(catching.sum()), 1e-9)
    return pitch


def short_start(machine: Machine, draw: np.random.Generator) -> Array:
    """The first turns are short by the exponential approach."""
    return -np.exp(-np.arange(machine.turns) / draw.uniform(0.4, 4.0))


def speed_ramp(machine: Machine, draw: np.random.Generator) -> Array:
    """The spindle slows down all along: a constant deviation -F dN/60 lag, from some turn on."""
    first = int(draw.integers(0, max(1, machine.turns // 2)))
    return np.where(np.arange(machine.turns) >= first, float(draw.choice([-1.0, 1.0])), 0.0)


def screw_slope(machine: Machine, draw: np.random.Generator) -> Array:
    """A progressive screw error: every pitch is off by the same."""
    return np.full(machine.turns, float(draw.choice([-1.0, 1.0])))


def screw_curve(machine: Machine, draw: np.random.Generator) -> Array:
    """A screw error whose slope changes along the way."""
    place = np.linspace(-1.0, 1.0, machine.turns)
    return np.polynomial.Polynomial(draw.normal(size=4))(place)


def screw_wave(machine: Machine, draw: np.random.Generator) -> Array:
    """2A|sin(pi lead/p)| at lead/p periods per turn."""
    order = machine.lead / machine.screw_lead
    place = order * np.arange(machine.turns + 1) + draw.uniform()
    return np.diff(np.sin(2.0 * math.pi * place))


def backlash(machine: Machine, draw: np.random.Generator) -> Array:
    """The approach is too short to take the play up: the first turns lack it; or it opens and closes on the way."""
    pitch = np.zeros(machine.turns)
    if draw.uniform() < 0.5:
        share = draw.uniform(0.3, 1.0)
        pitch[0], pitch[1] = -share, share - 1.0
    else:
        first = int(draw.integers(1, machine.turns - 1))
        pitch[first] = 1.0
        if draw.uniform() < 0.7:
            pitch[min(first + int(draw.integers(1, 6)), machine.turns - 1)] -= 1.0
    return pitch


def loose_nut(machine: Machine, draw: np.random.Generator) -> Array:
    """The groove jumps between two places."""
    jumps = draw.uniform(size=machine.turns + 1) < draw.uniform(0.15, 0.5)
    jumps[machine.turns // 2] = True
    return np.diff(np.cumsum(jumps) % 2 * 1.0)


def thin_section(machine: Machine, draw: np.random.Generator) -> Array:
    """The workpiece gives way in a section: the groove is displaced there by F/K(z)."""
    turn = np.arange(machine.turns + 1)
    centre, width = draw.uniform(0.2, 0.8) * machine.turns, draw.uniform(0.06, 0.2) * machine.turns
    return np.diff(np.exp(-0.5 * ((turn - centre) / width) ** 2))


def hard_spot(machine: Machine, draw: np.random.Generator) -> Array:
    """The tool is pushed aside at one or two turns."""
    crossings = np.zeros(machine.turns + 1)
    first = int(draw.integers(0, machine.turns))
    crossings[first:first + int(draw.integers(1, 4))] = draw.uniform(0.5, 1.0)
    pitch = np.diff(crossings)
    return pitch if pitch.any() else np.eye(1, machine.turns, machine.turns // 2)[0]


def thermal_growth(machine: Machine, draw: np.random.Generator) -> Array:
    """The screw is longer by alpha dT, and warms up on the way."""
    start, warming = draw.uniform(0.0, 1.0), draw.uniform(0.0, 1.0)
    rate = draw.uniform(0.3, 2.0) * machine.turns
    return np.asarray(start + warming * (1.0 - np.exp(-np.arange(machine.turns) / rate)))


def missed_counts(machine: Machine, draw: np.random.Generator) -> Array:
    """The encoder loses counts at one turn: the control does not know, the thread jumps."""
    return np.asarray(np.eye(1, machine.turns, int(draw.integers(0, machine.turns)))[0])


def nothing(machine: Machine, draw: np.random.Generator) -> Array:
    """Nothing is wrong; an error that repeats every turn cancels as well."""
    return np.zeros(machine.turns)


def encoder_jitter(machine: Machine, draw: np.random.Generator) -> Array:
    """Crossings of the detector that jitter: only the nominal values show it."""
    return np.diff(draw.normal(size=machine.turns + 1))


CONTROL: dict[str, Draw] = {"spindle dip": spindle_dip, "spindle hunting": spindle_hunting, "belt ripple": belt_ripple,
                            "saturation": saturation, "short start": short_start, "speed ramp": speed_ramp}
MECHANICAL: dict[str, Draw] = {"screw slope": screw_slope, "screw curve": screw_curve, "screw wave": screw_wave,
                               "backlash": backlash, "loose nut": loose_nut, "thin section": thin_section,
                               "hard spot": hard_spot, "thermal growth": thermal_growth,
                               "missed counts": missed_counts}


def drawn(seed: int, least: float = 5.0, most: float = 50.0) -> Thread:
    """One thread: machine, fault, severity (between ``least`` and ``most`` uncertainties) and noise by the seed."""
    draw = np.random.default_rng(seed)
    machine = Machine(turns=int(draw.integers(8, 81)), lead=float(draw.choice([0.5, 1.0, 1.5, 2.0, 3.0, 4.0])) * 1e-3,
                      screw_lead=float(draw.choice([5.1, 7.3, 10.0, 12.0, 16.0])) * 1e-3,
                      lag=draw.uniform(0.5e-3, 30e-3), count=2.0 * math.pi / float(draw.choice([4096, 16384, 1 << 20])))
    uncertainty = float(np.exp(draw.uniform(math.log(0.2e-6), math.log(3e-6))))
    kind = draw.choice(["control", "mechanical", "both", "none"], p=[0.3, 0.4, 0.2, 0.1])
    seen = unseen = np.zeros(machine.turns)
    names = []
    if kind in ("control", "both"):
        name = str(draw.choice(list(CONTROL)))
        names.append(name)
        seen = _scaled(CONTROL[name](machine, draw), draw, least, most) * uncertainty
    if kind in ("mechanical", "both"):
        name = str(draw.choice(list(MECHANICAL)))
        names.append(name)
        unseen = _scaled(MECHANICAL[name](machine, draw), draw, least, most) * uncertainty
    jitter = encoder_jitter(machine, draw) * machine.lead * machine.count / (2.0 * math.pi * math.sqrt(12.0))
    if draw.uniform() < (0.5 if kind == "none" else 0.25):
        jitter = _scaled(encoder_jitter(machine, draw), draw, 1.0, 20.0 if kind == "none" else 5.0) * uncertainty
        names.append("jitter")
    sizes = {cause: float(np.abs(part).max()) for cause, part in (("control", seen), ("mechanical", unseen))
             if part.any()}
    severity = min(sizes.values(), default=0.0) / uncertainty
    return Thread(" + ".join(names) or "nothing", str(kind), machine, machine.lead + seen + jitter,
                  machine.lead + seen + unseen + measuring_noise(machine.turns, draw) * uncertainty,
                  uncertainty, severity, sizes)


def measuring_noise(turns: int, draw: np.random.Generator) -> Array:
    """(turns,) of variance 1: errors of pitches measured one by one, or of grooves whose distances are taken."""
    if draw.uniform() < 0.5:
        return draw.normal(size=turns)
    return np.asarray(np.diff(draw.normal(size=turns + 1)) / math.sqrt(2.0))


def _scaled(pitch: Array, draw: np.random.Generator, least: float, most: float) -> Array:
    """The largest deviation is drawn, on a logarithmic scale."""
    return np.asarray(pitch / np.abs(pitch).max() * math.exp(draw.uniform(math.log(least), math.log(most))))
