"""Threads that the simulated lathe cuts, each in a run of its own through the real FMUs, with its cause known.

Machine, thread, faults and their sizes are drawn (``drawn_faults``), so are the start angle, the severity and the
noise: the measuring uncertainty is the size of the fault, of two the smaller, over the severity. The FMUs are unpacked
once and their links checked once per process; a run takes new instances of them and the compiled kernel.

The cause is what the run itself shows in the turns in the metal: control where the nominal pitches deviate by at least
the least severity times the uncertainty, mechanical where the actual ones deviate as much from the nominal ones. What
deviates by a fifth of that up to all of it may be found or not: it is in ``besides``. Of a fault that leaves nothing
in P(n) no more than the jitter of the detectors' counts is there: the cause is none. A thread is left out where the
severity would need an uncertainty below FINEST, or where the machine cuts less than a few turns.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.drawn_faults import SCREW_LEAD, Parameters, Workshop, between, drawn_faults, workshop
from tests.benchmarks.drawn_threads import Machine, Thread, measuring_noise
from threadpitch import cosim, lathe
from threadpitch.cosim import master
from threadpitch.cosim.check import Plan, check
from threadpitch.cosim.engine import choose_engine
from threadpitch.cosim.network import Network
from threadpitch.cosim.recording import Recorder
from threadpitch.cosim.result import Result
from threadpitch.cosim.selection import choose_channels
from threadpitch.cosim.simulation import choose_schedule, instantiate
from threadpitch.passes import CONTROLLER

Array = NDArray[np.float64]

FINEST, COARSEST = 0.2e-6, 3e-6  # m: least and largest uncertainty of a measured pitch
NEARLY = 0.2  # of the least severity, from which a cause may be found besides
FEWEST_TURNS = 8
CHANCES = {"control": 0.3, "mechanical": 0.35, "both": 0.3, "none": 0.05}
TURN = 2.0 * math.pi
RECORD = [f"{calculator}.{variable}" for calculator in (lathe.NOMINAL, lathe.ACTUAL)
          for variable in ("direction", "pitch_target", "start_angle*", "completed*", "crossing_position*",
                           "threading")]
RECORD += [f"{CONTROLLER}.{variable}" for variable in (
    "z_face", "z_start", "z_end", "pass_kind", "cut_depth", "start_angle", "start_number", "lead", "starts")]


@dataclass(frozen=True, eq=False)
class Cut:
    """What a run leaves at one start angle, over the turns in the metal."""

    nominal: Array  # (turns,) m
    actual: Array  # (turns,) m


@dataclass(frozen=True, eq=False)
class CutThread:
    """A measured thread, and which causes are in it that are smaller than what the benchmark asks for."""

    thread: Thread
    besides: frozenset[str]


@contextmanager
def opened_lathe() -> Iterator[Plan]:
    """The shipped lathe with its native FMUs unpacked and its links checked."""
    with ExitStack() as stack:
        system = stack.enter_context(cosim.read_system(lathe.find_system(lathe.DEFAULT_SYSTEM),
                                                       locate=functools.partial(lathe.locate_fmu, "native")))
        yield stack.enter_context(cosim.prepare(system))


def run(plan: Plan, parameters: Parameters, stop_time: float) -> lathe.Simulation:
    """One run of the lathe in the kernel."""
    own = check(plan.system, plan.descriptions, parameters)
    schedule = choose_schedule(own, stop_time=stop_time)
    with instantiate(own) as instances:
        network = Network(instances, own.links, Recorder(choose_channels(own, RECORD), schedule))
        algorithm = choose_engine(network, "kernel")
        master.initialize(network, schedule, own.settings)
        master.run(network, schedule, algorithm)
        return lathe.Simulation(Result(network.recorder), "native")


def cut(plan: Plan, parameters: Parameters, shop: Workshop) -> Cut | None:
    """The pass that leaves the groove; None where a machine is so bad that it cuts less than a few turns."""
    passes = 2 if parameters.get("controller.cycle") == "multiple" else 1
    turns = (6e-3 + shop.length) / shop.lead
    simulation = run(plan, parameters, round(1.2 + passes * (0.9 + 1.1 * turns * 60.0 / shop.speed_rpm), 3))
    if not simulation.passes:
        return None
    nominal, actual = simulation.passes_of(lathe.NOMINAL)[-1], simulation.passes_of(lathe.ACTUAL)[-1]
    count = min(nominal.table.pitch.shape[1], actual.table.pitch.shape[1])
    seen, shown = nominal.table.pitch[0, :count], actual.table.pitch[0, :count]
    known = nominal.in_metal[0, :count] & ~(np.isnan(seen) | np.isnan(shown))
    return Cut(seen[known], shown[known]) if int(known.sum()) >= FEWEST_TURNS else None


def cut_thread(plan: Plan, seed: int, least: float = 5.0, most: float = 50.0) -> CutThread | None:
    """The thread of a seed with a severity from ``least`` to ``most``: drawn, cut and measured; None where left out."""
    draw = np.random.default_rng(seed)
    kind = str(draw.choice(list(CHANCES), p=list(CHANCES.values())))
    shop = workshop(draw)
    names, parameters = drawn_faults(kind, draw, shop)
    start_angle = float(draw.uniform(0.0, TURN))
    parameters |= {"cutting.spot_angle": start_angle + 0.1 * float(draw.normal())}
    for calculator in (lathe.NOMINAL, lathe.ACTUAL):
        parameters |= {f"{calculator}.start_angle_count": 1, f"{calculator}.start_angle[1]": start_angle}
    found = cut(plan, parameters, shop)
    if found is None:
        return None
    sizes = _sizes(found, _without_slips(plan, parameters, shop, found), kind, shop.lead)
    wanted = [sizes[name] for name in ("control", "mechanical") if kind in (name, "both")]
    severity = between(draw, least, most)
    uncertainty = min(min(wanted) / severity, COARSEST) if wanted else between(draw, FINEST, COARSEST)
    if uncertainty < FINEST:
        return None
    present = {name for name, size in sizes.items() if size >= least * uncertainty * (1.0 - 1e-12)}
    besides = {name for name, size in sizes.items() if NEARLY * least * uncertainty < size < least * uncertainty}
    cause = "both" if len(present) == 2 else next(iter(present), "none")
    shown = found.actual + measuring_noise(found.actual.size, draw) * uncertainty
    machine = Machine(found.nominal.size, shop.lead, SCREW_LEAD, math.nan, math.nan)
    thread = Thread(names, cause, machine, found.nominal, shown, uncertainty, severity,
                    {name: sizes[name] for name in present})
    return CutThread(thread, frozenset(besides))


def _without_slips(plan: Plan, parameters: Parameters, shop: Workshop, found: Cut) -> Cut:
    """The same machine without missed counts: these make the nominal pitches jump where no feed moves."""
    if not parameters.get("spindle.missed_counts"):
        return found
    sound = cut(plan, parameters | {"spindle.missed_counts": 0}, shop)
    return found if sound is None else sound


def _sizes(found: Cut, sound: Cut, kind: str, lead: float) -> dict[str, float]:
    """Largest deviations, m: in the detectors' sight, and behind them.

    Where nothing is wrong the nominal pitches show the jitter of their counts, which is not in the thread.
    """
    count = min(found.actual.size, sound.nominal.size)
    seen, unseen = sound.nominal - lead, found.actual[:count] - sound.nominal[:count]
    if kind == "none":
        seen, unseen = found.actual - lead, np.zeros(1)
    return {"control": float(np.abs(seen).max()), "mechanical": float(np.abs(unseen).max())}
