"""A virtual measuring machine: probes the thread that the simulated lathe has cut, by a plan, with errors of its own.

    P(n) = z(theta + 360 n) - z(theta + 360 (n - 1)) + e(n) - e(n - 1),   e normal, standard deviation u / sqrt(2)

z is where a flank of the groove that all passes have left meets the workpiece's surface, theta an angle around it from
the one-turn pulse. Neighbouring pitches share a groove and with it the error of its probing, as on a real machine.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from threadpitch.judgement import MeasuredThread
from threadpitch.lathe import LatheError, Simulation
from threadpitch.passes import CONTROLLER, FloatArray, Pass
from threadpitch.pitch import PitchError, pitch_table
from threadpitch.trace import TURN, Trace
from threadpitch.units import UnitError, conversion, from_si

FLANKS = ("negative_z", "positive_z")
PROBED = {"both": FLANKS, "negative_z": FLANKS[:1], "positive_z": FLANKS[1:], "middle": ("middle",)}
HEADER = ("position_mm", "pitch_mm", "uncertainty_um", "flank", "start_angle_deg")
_SPINDLE, _FLANK = "spindle.angle", "cutting.flank_position"
_FEWEST, _MOST = 1, 360


@dataclass(frozen=True)
class MeasuringPlan:
    """How a thread is measured.

    Raises:
        LatheError: a number or word that makes no plan.
    """

    uncertainty: float = 1e-6  # m, standard, of one measured pitch
    every: int = 1  # the pitch of every so many-th turn is measured
    points: int = 4  # probed around a turn, evenly, from the one-turn pulse on
    flanks: str = "both"  # negative_z, positive_z, both of them by themselves, or the middle between them
    seed: int = 0  # of the errors

    def __post_init__(self) -> None:
        if not 0.0 < self.uncertainty < 1e-3:
            raise LatheError(f"measuring uncertainty {self.uncertainty:g} m; give one from 0 to 1 mm, like 1um")
        if not (_FEWEST <= self.every <= _MOST and _FEWEST <= self.points <= _MOST and self.seed >= 0):
            raise LatheError(f"measuring every {self.every} turns at {self.points} points with seed {self.seed}; give "
                             f"turns and points from {_FEWEST} to {_MOST}, and a seed that is not negative")
        if self.flanks not in PROBED:
            raise LatheError(f"flanks {self.flanks!r} are not known; choose {', '.join(PROBED)}")

    @property
    def start_angles(self) -> list[float]:
        """Where around the thread is probed, rad."""
        return [TURN * point / self.points for point in range(self.points)]


def read_plan(words: Iterable[str]) -> MeasuringPlan:
    """A plan of words like ``uncertainty=0.5um``, ``every=2``, ``points=8``, ``flanks=middle``, ``seed=3``.

    Raises:
        LatheError: a word or its value is not known.
    """
    found: dict[str, float | int | str] = {}
    for word in words:
        name, _, value = word.partition("=")
        found[name] = _value(name, value)
    return MeasuringPlan(**found)  # type: ignore[arg-type] # _value gives each name its type


def _value(name: str, text: str) -> float | int | str:
    try:
        if name == "uncertainty":
            number = text.rstrip("abcdefghijklmnopqrstuvwxyzµμ ")
            return float(number) * conversion(text[len(number):].strip() or "m", "m")[0]
        if name in ("every", "points", "seed"):
            return int(text)
    except (ValueError, UnitError):
        raise LatheError(f"--measure {name}={text} is no number that fits; write it like uncertainty=1um, every=2, "
                         "points=4, seed=1") from None
    if name != "flanks":
        raise LatheError(f"--measure {name!r} is not known; there are uncertainty, every, points, flanks, seed")
    return text


def measure(simulation: Simulation, plan: MeasuringPlan, one: Pass | None = None) -> list[MeasuredThread]:
    """The groove as it is after a pass (default: the last), one thread for every flank and point around the turn.

    Raises:
        LatheError: the groove was not recorded, or holds no pitch to measure.
    """
    chosen = simulation.passes[-1] if one is None and simulation.passes else one
    if chosen is None:
        raise LatheError(simulation.why_no_turn())
    names = (_SPINDLE, f"{_FLANK}[1]", f"{_FLANK}[2]")
    rows = recorded_rows(simulation, chosen, names)
    angle, low, high = (np.asarray(simulation[name], dtype=np.float64)[rows] for name in names)
    places = {"negative_z": low, "positive_z": high, "middle": 0.5 * (low + high)}
    face = simulation.parameter(f"{CONTROLLER}.z_face")
    draw = np.random.default_rng(plan.seed)
    found = []
    for flank in PROBED[plan.flanks]:
        for point in plan.start_angles:
            thread = _probed(_Groove(angle, places, face), flank, point, (plan, draw))
            if thread is not None:
                found.append(thread)
    if not found:
        raise LatheError("the thread holds no whole turn in the metal that could be measured; cut a longer one")
    return found


@dataclass(frozen=True, eq=False)
class _Groove:
    angle: FloatArray  # (rows,) rad
    places: Mapping[str, FloatArray]  # (rows,) m
    face: float | None  # m, where the workpiece begins; None where that is not told


def _probed(groove: _Groove, flank: str, point: float, how: tuple[MeasuringPlan, np.random.Generator]) \
        -> MeasuredThread | None:
    """One flank at one angle; None where no turn is in the metal."""
    plan, draw = how
    try:
        table = pitch_table(Trace(groove.angle, groove.places[flank]), (point,))
    except PitchError:
        return None
    crossings = table.crossings[0]
    levels = point + TURN * (table.turns_before + np.arange(crossings.size))
    middle = np.interp(levels, groove.angle, groove.places["middle"])
    sense = -1.0 if groove.places["middle"][-1] < groove.places["middle"][0] else 1.0
    metal = (levels >= groove.angle[0]) & (levels <= groove.angle[-1]) & ~np.isnan(crossings)
    if groove.face is not None:
        metal &= sense * (middle - groove.face) >= 0.0
    errors = draw.normal(size=crossings.size) * plan.uncertainty / math.sqrt(2.0)
    pitch = sense * np.diff(crossings + errors)
    known = np.flatnonzero(metal[:-1] & metal[1:])[::plan.every]
    if known.size == 0:
        return None
    probed = middle + errors
    return MeasuredThread(pitch[known], position=0.5 * (probed[known] + probed[known + 1]),
                          uncertainty=np.full(known.size, plan.uncertainty), start_angle=point, flank=flank)


def recorded_rows(simulation: Simulation, one: Pass, names: Sequence[str]) -> NDArray[np.bool_]:
    """(rows,) those of a pass in which the feed follows the spindle.

    Raises:
        LatheError: a variable was not recorded.
    """
    threading = f"{CONTROLLER}.threading"
    for name in (threading, *names):
        if name not in simulation:
            raise LatheError(f"{name} was not recorded; record the outputs (--record outputs)")
    time = simulation.time
    began, ended = one.began or 0.0, math.inf if one.ended is None else one.ended
    return np.asarray((np.asarray(simulation[threading]) == 1) & (time >= began) & (time <= ended))


def write_measured(threads: Sequence[MeasuredThread], path: Path) -> None:
    """The measured pitches as CSV, as ``threadpitch analyze --measured`` reads it.

    Raises:
        OSError: the file cannot be written.
    """
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEADER)
        for one in threads:
            assert one.position is not None  # of every thread that was measured here
            assert one.uncertainty is not None
            assert one.start_angle is not None
            angle = round(from_si(one.start_angle, "deg"), 9)
            for place, pitch, uncertainty in zip(one.position.tolist(), one.pitch.tolist(), one.uncertainty.tolist(),
                                                 strict=True):
                writer.writerow((round(from_si(place, "mm"), 6), round(from_si(pitch, "mm"), 9),
                                 round(from_si(uncertainty, "um"), 6), one.flank, angle))
