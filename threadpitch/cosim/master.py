"""The co-simulation master: initialises a network of instances and steps it, by an algorithm that is handed to it."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.algorithms import ALGORITHMS, Algorithm
from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.check import Setting
from threadpitch.cosim.errors import SimulationInterrupted, TimeLimitError
from threadpitch.cosim.initial_values import propagate
from threadpitch.cosim.instance import Instance
from threadpitch.cosim.interrupt import HeldInterrupt
from threadpitch.cosim.network import Network
from threadpitch.cosim.schedule import Schedule

Progress: TypeAlias = Callable[[int, int], None]  # (steps done, steps in all)

_CHUNK_TIME = 0.05  # s of computing between two looks at progress and Ctrl-C


def initialize(network: Network, schedule: Schedule, settings: Iterable[Setting]) -> None:
    """Set values, initialise every component with consistent inputs, and record row 0.

    Values go along the links, in order, until they rest: once without feedback, at most once per component and once
    more with it. An algebraic loop that does not rest by then is solved (see ``initial_values``).

    Raises:
        StepError: a component refuses a value or fails to initialise.
        SimulationInterrupted: Ctrl-C was pressed meanwhile.
    """
    instances = {node.name: node.instance for node in network.nodes}
    with HeldInterrupt() as interrupt:
        for node in network.nodes:
            node.instance.setup_experiment(schedule.start_time)
        # After the set-up: FMUs of 20-sim begin anew with it, and forget what was set before.
        for name, chosen in _by_component(settings).items():
            set_values(instances[name], chosen)
        for node in network.nodes:
            node.instance.enter_initialization()
            node.prime()
        propagate(network, schedule.start_time)
        for node in network.nodes:
            node.instance.exit_initialization()
            node.settle()
            node.publish(schedule.start_time)
        for node in network.nodes:
            node.sample()
        network.record(0)
    if interrupt.requested:
        raise SimulationInterrupted(schedule.start_time, interrupt.signal)


def run(network: Network, schedule: Schedule, algorithm: Algorithm | None = None, *,
        progress: Progress | None = None, time_limit: float | None = None,
        between: Callable[[], None] | None = None) -> None:
    """Compute all steps that are not done, in chunks: between them progress is told, and Ctrl-C, SIGTERM and the limit
    [s of the clock] are obeyed.

    Without an algorithm that of the network's method is taken. ``between`` is called after every chunk, when all that
    was computed is recorded.

    Raises:
        StepError: a component fails; rows recorded before are valid.
        SimulationInterrupted: Ctrl-C was pressed, or SIGTERM or SIGHUP came; rows recorded before are valid.
        TimeLimitError: the time is over; rows recorded before are valid.
    """
    advance = ALGORITHMS[network.method.coupling] if algorithm is None else algorithm
    end = math.inf if time_limit is None else clock.perf_counter() + time_limit
    done, count = network.recorder.steps, 1
    with HeldInterrupt() as interrupt:
        while done < schedule.steps:
            began = clock.perf_counter()
            last = min(done + count, schedule.steps)
            advance(network, schedule, range(done, last))
            done = last
            now = clock.perf_counter()
            elapsed = now - began
            count = max(1, count * 2 if elapsed < _CHUNK_TIME else count // 2 if elapsed > 4 * _CHUNK_TIME else count)
            if between is not None:
                between()
            if progress is not None:
                progress(done, schedule.steps)
            if interrupt.requested:
                raise SimulationInterrupted(schedule.time(done), interrupt.signal)
            if now > end and done < schedule.steps:
                raise TimeLimitError(schedule.time(done), time_limit or 0.0)


def _by_component(settings: Iterable[Setting]) -> dict[str, list[Setting]]:
    found: dict[str, list[Setting]] = {}
    for setting in settings:
        found.setdefault(setting.component, []).append(setting)
    return found


def set_values(instance: Instance, settings: Iterable[Setting]) -> None:
    """Set variables of one instance; of an array of FMI 3.0 the elements that are not given keep their start values.

    Raises:
        StepError: the instance refuses a value.
    """
    arrays: dict[tuple[str, int], NDArray[Any]] = {}
    for setting in settings:
        variable = setting.variable
        if isinstance(setting.value, str):
            instance.set_text(variable.reference, setting.value)
            continue
        key = variable.c_type, variable.reference
        if key not in arrays:
            starts = setting.starts or (0.0,) * variable.size
            arrays[key] = np.array(starts).astype(C_TYPES[variable.c_type].dtype)
        arrays[key][variable.element] = setting.value
    for (c_type, reference), values in arrays.items():
        instance.setter(c_type, np.array([reference], np.uint32), values)()
