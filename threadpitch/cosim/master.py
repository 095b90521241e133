"""The co-simulation master: initialises a network of instances and steps it.

Gauss-Seidel in the order of the data: a component sees what the components before it have computed for the end of the
step, and of those behind it (feedback) what they had computed for its beginning.
"""

from __future__ import annotations

import logging
import time as clock
from collections.abc import Callable, Iterable
from typing import TypeAlias

import numpy as np

from threadpitch.cosim.check import Setting
from threadpitch.cosim.errors import SimulationInterrupted
from threadpitch.cosim.instance import DTYPES, Instance
from threadpitch.cosim.interrupt import HeldInterrupt
from threadpitch.cosim.network import Network
from threadpitch.cosim.schedule import Schedule

Algorithm: TypeAlias = Callable[[Network, Schedule, range], None]  # computes these steps and records them
Progress: TypeAlias = Callable[[int, int], None]  # (steps done, steps in all)

_CHUNK_TIME = 0.05  # s of computing between two looks at progress and Ctrl-C
_log = logging.getLogger(__name__)


def gauss_seidel(network: Network, schedule: Schedule, steps: range) -> None:
    """Each component in order receives its inputs, steps from t to t + h and publishes its outputs at t + h.

    Raises:
        StepError: a component fails, or publishes a value that is not a number.
    """
    for step in steps:
        time = schedule.time(step)
        network.time = schedule.time(step + 1)
        for node in network.nodes:
            node.receive()
            node.instance.do_step(time, schedule.step_size)
            node.publish()
        network.record(step + 1)


def initialize(network: Network, schedule: Schedule, settings: Iterable[Setting]) -> None:
    """Set values, initialise every component with consistent inputs, and record row 0.

    Values go along the links, in order, until they rest: once without feedback, at most once per component and once
    more with it. An algebraic loop that does not rest by then is logged and starts with the last values.

    Raises:
        StepError: a component refuses a value or fails to initialise.
        SimulationInterrupted: Ctrl-C was pressed meanwhile.
    """
    instances = {node.name: node.instance for node in network.nodes}
    with HeldInterrupt() as interrupt:
        for setting in settings:
            _set(instances[setting.component], setting)
        for node in network.nodes:
            node.instance.setup_experiment(schedule.start_time)
            node.instance.enter_initialization()
        _propagate(network)
        for node in network.nodes:
            node.instance.exit_initialization()
            node.publish()
        network.record(0)
    if interrupt.requested:
        raise SimulationInterrupted(schedule.start_time)


def run(network: Network, schedule: Schedule, algorithm: Algorithm = gauss_seidel,
        progress: Progress | None = None) -> None:
    """Compute all steps, in chunks: between them progress is told and Ctrl-C is obeyed.

    Raises:
        StepError: a component fails; rows recorded before are valid.
        SimulationInterrupted: Ctrl-C was pressed; rows recorded before are valid.
    """
    done, count = 0, 1
    with HeldInterrupt() as interrupt:
        while done < schedule.steps:
            began = clock.perf_counter()
            last = min(done + count, schedule.steps)
            algorithm(network, schedule, range(done, last))
            done = last
            elapsed = clock.perf_counter() - began
            count = max(1, count * 2 if elapsed < _CHUNK_TIME else count // 2 if elapsed > 4 * _CHUNK_TIME else count)
            if progress is not None:
                progress(done, schedule.steps)
            if interrupt.requested:
                raise SimulationInterrupted(schedule.time(done))


def _propagate(network: Network) -> None:
    for node in network.nodes:
        node.get()  # feedback begins with the start values of the components behind
    before = None
    for _ in range(len(network.nodes) + 1):
        for node in network.nodes:
            node.receive()
            node.get()
        now = network.written_bits()
        if now == before:
            return
        before = now
    _log.warning("initial values of the feedback between components do not rest after %d rounds",
                 len(network.nodes) + 1)


def _set(instance: Instance, setting: Setting) -> None:
    variable = setting.variable
    if isinstance(setting.value, str):
        instance.set_text(variable.reference, setting.value)
    else:
        reference = np.array([variable.reference], np.uint32)
        instance.setter(variable.kind, reference, np.array([setting.value], DTYPES[variable.kind]))()
