"""Threads that the simulated lathe cuts, with the cause of their fluctuation known from the fault that is put in.

The faults are those of the library ``models/faults`` (one TOML file each: cause, parameters, stop_time), on a lathe
without others; where there is no library, a few of the drives alone. Speed and position gain are drawn, each run is
seen at four start angles. The measuring uncertainty is drawn so that the fault has the severity that is asked for.

The label is what the run itself shows: control where the nominal pitches deviate by at least 5 uncertainties,
mechanical where the actual ones deviate as much from the nominal ones, both, or none where neither exceeds one. A
thread is left out where one of the two lies between 1 and 5, where a fault leaves nothing, or where the severity would
need an uncertainty below FINEST: ``offered`` counts all, so that the benchmark can tell how many those are.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

import threadpitch as tp
from tests.benchmarks.drawn_threads import Machine, Thread, measuring_noise
from threadpitch.cosim.values import Given
from threadpitch.lathe import ACTUAL, NOMINAL, shipped

Array = NDArray[np.float64]

QUIET: dict[str, Given] = {"z_drive.lead_amplitude": 0.0, "z_drive.lead_slope": 0.0, "z_drive.backlash": 0.0,
                           "z_drive.temperature_rise": 0.0}
TARGET, SCREW_LEAD = 1.5e-3, 10e-3
START_ANGLES = (0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi)
PRESENT, ABSENT = 5.0, 1.0  # uncertainties from which a cause counts, and up to which it does not
FINEST = 0.3e-6  # m: least uncertainty of a measured pitch
FEWEST_TURNS = 8
MEASUREMENTS = 4  # of each thread, each with an uncertainty and noise of its own


@dataclass(frozen=True)
class Fault:
    """What is wrong with the lathe, and what should be found."""

    name: str
    cause: str
    parameters: dict[str, Given] = field(default_factory=dict)
    stop_time: float | None = None


OF_THE_DRIVES = (
    Fault("nothing", "none"),
    Fault("encoder eccentricity", "none", {"spindle.eccentricity": "0.3deg"}),
    Fault("belt ripple", "control", {"spindle.ripple_amplitude": [20.0, 0.0, 0.0, 0.0],
                                     "spindle.ripple_order": [0.61, 1.0, 1.0, 1.0]}),
    Fault("slow ripple", "control", {"spindle.ripple_amplitude": [40.0, 0.0, 0.0, 0.0],
                                     "spindle.ripple_order": [0.17, 1.0, 1.0, 1.0]}),
    Fault("screw lead error", "mechanical", {"z_drive.lead_slope": "1500um/(300 mm)"}),
    Fault("periodic screw error", "mechanical", {"z_drive.lead_amplitude": "8um"}),
    Fault("thermal growth", "mechanical", {"z_drive.temperature_rise": 100.0}),
    Fault("ripple and screw", "both", {"spindle.ripple_amplitude": [20.0, 0.0, 0.0, 0.0],
                                       "spindle.ripple_order": [0.61, 1.0, 1.0, 1.0],
                                       "z_drive.lead_amplitude": "8um"}),
)


def faults() -> tuple[Fault, ...]:
    """The library's faults, in the order of their names, and some of the drives alone."""
    found = []
    for path in sorted((shipped("models") / "faults").glob("*.toml")):
        written = tomllib.loads(path.read_text(encoding="utf-8"))
        chosen = {f"{component}.{name}": value for component, values in written.get("parameters", {}).items()
                  for name, value in values.items()}
        found.append(Fault(path.stem, str(written["cause"]), chosen, written.get("stop_time")))
    return (*OF_THE_DRIVES, *found)


@dataclass(frozen=True, eq=False)
class Cut:
    """What a run leaves at one start angle, over the turns in the metal."""

    fault: Fault
    nominal: Array  # (turns,) m
    actual: Array  # (turns,) m

    @property
    def seen(self) -> float:
        """Largest deviation that the control's detectors see, m."""
        return float(np.abs(self.nominal - TARGET).max())

    @property
    def unseen(self) -> float:
        """Largest deviation behind them, m."""
        return float(np.abs(self.actual - self.nominal).max())


def cuts(fault: Fault, seed: int) -> list[Cut]:
    """The pass that leaves the groove, of a machine with a drawn speed and position gain."""
    draw = np.random.default_rng(seed)
    machine: dict[str, Given] = {"controller.commanded_speed": f"{draw.uniform(400.0, 650.0):.1f}rpm",
                                 "z_drive.position_gain": float(np.round(draw.uniform(35.0, 80.0), 2))}
    simulation = tp.simulate(parameters={**QUIET, **machine, **fault.parameters}, start_angles=START_ANGLES,
                             stop_time=fault.stop_time)
    nominal, actual = simulation.passes_of(NOMINAL)[-1], simulation.passes_of(ACTUAL)[-1]
    found = []
    for row in range(len(START_ANGLES)):
        turns = min(nominal.table.pitch.shape[1], actual.table.pitch.shape[1])
        cut = nominal.in_metal[row, :turns]
        seen, shown = nominal.table.pitch[row, :turns][cut], actual.table.pitch[row, :turns][cut]
        known = ~(np.isnan(seen) | np.isnan(shown))
        if int(known.sum()) >= FEWEST_TURNS:
            found.append(Cut(fault, seen[known], shown[known]))
    return found


def measured(cut: Cut, seed: int, severity: float) -> Thread | None:
    """The thread measured with such an uncertainty that the fault has this severity; None where the cause is in doubt.

    Jitter of the detectors' counts is in the nominal pitches alone: what of it is rougher than the thread is no cause.
    """
    draw = np.random.default_rng(seed)
    largest = {"control": cut.seen, "mechanical": cut.unseen, "both": min(cut.seen, cut.unseen)}.get(cut.fault.cause)
    if largest is None:
        uncertainty = float(np.exp(draw.uniform(math.log(FINEST), math.log(3e-6))))
    else:
        uncertainty = largest / severity
    if uncertainty < FINEST:
        return None
    sizes = {"control": cut.seen / uncertainty, "mechanical": cut.unseen / uncertainty}
    causes = {name for name, size in sizes.items() if size >= PRESENT}
    if any(ABSENT < size < PRESENT for size in sizes.values()) or (cut.fault.cause == "none") != (not causes):
        return None
    cause = "both" if len(causes) == 2 else next(iter(causes), "none")
    machine = Machine(cut.nominal.size, TARGET, SCREW_LEAD, math.nan, math.nan)
    shown = cut.actual + measuring_noise(cut.actual.size, draw) * uncertainty
    return Thread(cut.fault.name, cause, machine, cut.nominal, shown, uncertainty, severity if causes else 0.0)


def offered(machines: int) -> int:
    """Threads before any is left out."""
    return len(faults()) * machines * len(START_ANGLES) * MEASUREMENTS


def threads(first_seed: int, machines: int) -> Iterator[Thread]:
    """Every fault on so many machines, at every start angle, measured some times with severities from 5 to 50."""
    for number, fault in enumerate(faults()):
        for machine in range(machines):
            seed = first_seed + 1000 * number + machine
            for row, cut in enumerate(cuts(fault, seed)):
                draw = np.random.default_rng([seed, row])
                for severity in np.exp(draw.uniform(math.log(5.0), math.log(50.0), MEASUREMENTS)).tolist():
                    found = measured(cut, int(draw.integers(1 << 32)), severity)
                    if found is not None:
                        yield found
