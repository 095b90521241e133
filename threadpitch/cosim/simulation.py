"""The way from a system to its result: read, check, instantiate, initialise, step, free."""

from __future__ import annotations

import logging
import re
import time as clock
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

from threadpitch.cosim import master
from threadpitch.cosim.check import Plan, check
from threadpitch.cosim.description import FmuDescription, read_fmu
from threadpitch.cosim.engine import choose_engine
from threadpitch.cosim.errors import CosimError, SimulationInterrupted, StepError, TimeLimitError
from threadpitch.cosim.instance import FmuInstance, Library, References
from threadpitch.cosim.instance2 import FmuInstance2
from threadpitch.cosim.instance3 import FmuInstance3
from threadpitch.cosim.method import Method, check_method
from threadpitch.cosim.network import Network
from threadpitch.cosim.recording import Channel, Recorder, Result
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.ssp import read_system
from threadpitch.cosim.system import System, SystemStructureError, nearest
from threadpitch.cosim.values import Given

_log = logging.getLogger(__name__)
_GROUPS = {
    "outputs": ("output",),
    "inputs": ("input",),
    "locals": ("local",),
    "parameters": ("parameter", "calculatedParameter"),
}


def simulate(system: System | str | Path, *, parameters: Mapping[str, Given] | None = None,
             stop_time: float | None = None, step_size: float | None = None, start_time: float | None = None,
             record: Iterable[str] = ("outputs",), record_every: int = 1, method: Method | None = None,
             engine: str | None = None, time_limit: float | None = None,
             progress: master.Progress | None = None) -> Result:
    """Simulate a system of FMI 2.0 and 3.0 co-simulation FMUs and return what was recorded.

    ``parameters`` maps ``component.variable`` to a number (SI), a truth value or a text ("10mm", "linear_motor").
    Times are seconds; what is None comes from the SSD's default experiment, the step size from the smallest that an
    FMU recommends. ``record`` lists "outputs", "inputs", "locals", "parameters", names ``component.variable``, and
    patterns of them with ``*`` and ``?``; ``record_every`` = n keeps every n-th communication point only. ``method``
    says how the components are coupled. ``engine`` is "kernel" (compiled loop), "python" (the same bits, slower), or
    None for the kernel where it is worth its start. ``time_limit`` ends a run that takes longer, in seconds of the
    clock. ``progress(done, steps)`` is called several times a second.

    Raises:
        SystemStructureError: the system or a parameter is wrong; every problem is in its ``problems``.
        StepError: a component fails; ``result`` of the error holds the rows recorded before, or None.
        SimulationInterrupted: Ctrl-C; likewise.
        TimeLimitError: the time limit; likewise.
        CosimError: a file is not what it should be, or the times do not fit.
    """
    with ExitStack() as stack:
        if not isinstance(system, System):
            system = stack.enter_context(read_system(system))
        plan = stack.enter_context(prepare(system, parameters))
        schedule = choose_schedule(plan, start_time=start_time, stop_time=stop_time, step_size=step_size)
        method = Method() if method is None else method
        cannot = check_method(method, plan, schedule)
        for text in cannot:
            _log.warning("%s", text)
        recorder = Recorder(choose_channels(plan, record), schedule, record_every)
        began = clock.perf_counter()
        instances = stack.enter_context(instantiate(plan, method))

        def result() -> Result:
            logged = [f"{instance.name}: {text}" for instance in instances for text in instance.warnings()]
            return Result(recorder, wall_time=clock.perf_counter() - began, order=plan.order,
                          warnings=[*plan.notes, *cannot, *logged])

        try:
            network = Network(instances, plan.links, recorder, method)
            algorithm = choose_engine(network, engine)
            master.initialize(network, schedule, plan.settings)
            master.run(network, schedule, algorithm, progress=progress, time_limit=time_limit)
        except (StepError, SimulationInterrupted, TimeLimitError) as error:
            error.result = result() if recorder.filled else None
            raise
        return result()


@contextmanager
def prepare(system: System, parameters: Mapping[str, Given] | None = None) -> Iterator[Plan]:
    """Unpack the FMUs of a system and check all; the unpacked files are removed when the context ends.

    Raises:
        SystemStructureError, ArchiveError, FmuError: as ``simulate``.
    """
    with ExitStack() as stack:
        by_path: dict[Path, FmuDescription] = {}
        for component in system.components:
            if component.fmu not in by_path:
                by_path[component.fmu] = read_fmu(component.fmu)
                stack.callback(by_path[component.fmu].close)
        descriptions = {component.name: by_path[component.fmu] for component in system.components}
        yield check(system, descriptions, parameters)


@contextmanager
def instantiate(plan: Plan, method: Method | None = None) -> Iterator[tuple[FmuInstance, ...]]:
    """The instances of a plan in the order of the data; all are terminated, then freed when the context ends.

    Raises:
        StepError: an FMU cannot be loaded or instantiated; the others are freed.
    """
    libraries = {description.path: Library(description) for description in plan.descriptions.values()}
    instances: list[FmuInstance] = []
    try:
        for name in plan.order:
            library = libraries[plan.descriptions[name].path]
            if library.description.fmi == 2:
                instances.append(FmuInstance2(name, library))
            else:
                instances.append(FmuInstance3(name, library, _followed(plan, method or Method(), name)))
        yield tuple(instances)
    finally:
        for instance in instances:
            instance.terminate()
        for instance in reversed(instances):
            instance.free()


def _followed(plan: Plan, method: Method, component: str) -> References:
    """The value references of a component's inputs that follow polynomials."""
    found = {link.target.reference for link in plan.links
             if link.target_component == component and method.follows(link)}
    return np.array(sorted(found), np.uint32)


def choose_schedule(plan: Plan, *, start_time: float | None = None, stop_time: float | None = None,
                    step_size: float | None = None) -> Schedule:
    """The communication points: as given, else as the system says, the step size else as the FMUs recommend.

    Raises:
        CosimError: no stop time or step size is known, or they do not fit.
    """
    system = plan.system
    start = system.start_time if start_time is None else start_time
    stop = system.stop_time if stop_time is None else stop_time
    if stop is None:
        raise CosimError(f"system {system.name!r} states no stop time; give one")
    step = system.step_size if step_size is None else step_size
    if step is None:
        recommended = [found.step_size for found in plan.descriptions.values() if found.step_size]
        if not recommended:
            raise CosimError(f"neither system {system.name!r} nor its FMUs state a step size; give one")
        step = min(recommended)
    return Schedule.between(start, stop, step)


def choose_channels(plan: Plan, record: Iterable[str]) -> list[Channel]:
    """The variables to record, in the order of the components and of their variables (see ``simulate``).

    Raises:
        SystemStructureError: a word or name matches nothing; all that do not are told.
    """
    words = [record] if isinstance(record, str) else list(record)
    known = [Channel(component.name, variable) for component in plan.system.components
             for variable in plan.descriptions[component.name].variables.values() if variable.exchanged]
    chosen: set[str] = set()
    problems = []
    for word in words:
        if word in _GROUPS:
            chosen |= {channel.name for channel in known if channel.variable.causality in _GROUPS[word]}
            continue
        # Not fnmatch: brackets are the indices of arrays here.
        pattern = re.compile(re.escape(word).replace(r"\*", ".*").replace(r"\?", "."))
        found = {channel.name for channel in known if pattern.fullmatch(channel.name)}
        if not found:
            hint = nearest(word, [*_GROUPS, *(channel.name for channel in known)])
            problems.append(f"nothing to record is called {word!r}{hint}")
        chosen |= found
    if problems:
        raise SystemStructureError(*problems)
    return [channel for channel in known if channel.name in chosen]
