"""The way from a system to its result: read, check, instantiate, initialise, step, free."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from threadpitch.cosim import master
from threadpitch.cosim.block import Channels
from threadpitch.cosim.check import Plan, check
from threadpitch.cosim.checkpoint import Checkpoint, CheckpointError, read_checkpoint
from threadpitch.cosim.engine import choose_engine
from threadpitch.cosim.errors import CosimError, SimulationInterrupted, StepError, TimeLimitError
from threadpitch.cosim.event_mode import EventInstance3
from threadpitch.cosim.events import find_levels
from threadpitch.cosim.fmus import opened
from threadpitch.cosim.instance import Instance, Library, References
from threadpitch.cosim.instance2 import FmuInstance2
from threadpitch.cosim.instance3 import FmuInstance3
from threadpitch.cosim.isolation import IsolatedInstance, isolated_components
from threadpitch.cosim.keeping import Keeper, Keeping, warn_of_versions
from threadpitch.cosim.metadata import again, describe, plain_parameters, versions
from threadpitch.cosim.method import Method, check_method, has_event_mode
from threadpitch.cosim.network import Network
from threadpitch.cosim.onlooker import Look, Onlooker
from threadpitch.cosim.recording import Recorder
from threadpitch.cosim.result import Result
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.selection import Selection, Watch
from threadpitch.cosim.ssp import read_system
from threadpitch.cosim.system import System
from threadpitch.cosim.values import Given

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Request:
    """What ``simulate`` is asked for."""

    parameters: Mapping[str, Given]
    times: tuple[float | None, float | None, float | None]  # start, stop, step size
    selection: Selection
    method: Method
    engine: str | None
    isolate: bool | tuple[str, ...]
    keeping: Keeping
    about: Mapping[str, Any]
    time_limit: float | None
    progress: master.Progress | None


def simulate(system: System | Plan | str | Path, *, parameters: Mapping[str, Given] | None = None,
             stop_time: float | None = None, step_size: float | None = None, start_time: float | None = None,
             record: Iterable[str] = ("outputs",), record_every: int = 1, record_on: Iterable[str] = (),
             watch: Watch | None = None,
             results: str | Path | None = None, checkpoint: str | Path | None = None, checkpoint_every: float = 60.0,
             method: Method | None = None, engine: str | None = None, isolate: bool | Iterable[str] = False,
             time_limit: float | None = None, progress: master.Progress | None = None,
             about: Mapping[str, Any] | None = None) -> Result:
    """Simulate a system of FMI 2.0 and 3.0 co-simulation FMUs, or a plan of one, and return what was recorded.

    ``parameters`` maps ``component.variable`` to a number (SI), a truth value or a text ("10mm", "linear_motor").
    Times are seconds; what is None comes from the SSD's default experiment, the step size from the smallest that an
    FMU recommends. ``method`` says how the components are coupled. ``engine`` is "kernel" (compiled loop), "python"
    (the same bits, slower), or None for the kernel where it is worth its start. ``time_limit`` ends a run that takes
    longer, in seconds of the clock. ``progress(done, steps)`` is called several times a second.

    ``record`` lists "outputs", "inputs", "locals", "parameters", names ``component.variable``, and patterns of them
    with ``*`` and ``?``. ``record_every`` = n keeps every n-th communication point only, ``record_on`` of these only
    those at which one of the variables that it lists differs from the row before (and the first). What ``watch``
    describes is kept besides, as ``watched`` of the result. ``results`` is a
    file that grows while the run computes, so that it needs no more memory for more steps: ``.parquet`` (a folder of
    files) or ``.csv``; or a ``.mat``, which is written at the end.

    ``checkpoint`` is a file that receives the state of the whole system every ``checkpoint_every`` seconds of the
    clock, at the end, and when Ctrl-C, SIGTERM, SIGHUP or the time limit end the run; ``resume`` goes on from it.
    ``isolate`` runs components, all or those that are listed, in processes of their own, so that one that crashes
    does not take the run's results with it. ``about`` is kept in the result's metadata, as JSON holds it.

    Raises:
        SystemStructureError: the system or a parameter is wrong; every problem is in its ``problems``.
        StepError: a component fails; ``result`` of the error holds the rows recorded before, or None.
        SimulationInterrupted: Ctrl-C, SIGTERM or SIGHUP; likewise.
        TimeLimitError: the time limit; likewise.
        CosimError: a file is not what it should be, or the times do not fit.
        OSError: results or checkpoint cannot be written.
    """
    keeping = Keeping(None if results is None else Path(results), None if checkpoint is None else Path(checkpoint),
                      checkpoint_every)
    return _simulate(system, _Request(
        parameters=dict(parameters or {}), times=(start_time, stop_time, step_size),
        selection=Selection(_words(record), record_every, _words(record_on), watch), method=method or Method(),
        engine=engine, isolate=isolate if isinstance(isolate, bool) else _words(isolate), keeping=keeping,
        about=dict(about or {}), time_limit=time_limit, progress=progress))


def resume(checkpoint: str | Path, *, system: System | Plan | str | Path | None = None, stop_time: float | None = None,
           results: str | Path | None = None, checkpoint_every: float = 60.0, engine: str | None = None,
           time_limit: float | None = None, progress: master.Progress | None = None,
           look: Look | None = None) -> Result:
    """Go on with a run from its checkpoint, to the same bits as if it had never ended.

    ``system`` is the one that was simulated (default: where it was then), ``stop_time`` may be later than that of the
    run, and ``results`` another place that the files were moved to. The checkpoint is written on. Rows that were
    recorded behind it are replaced. ``look`` is shown what the run watches: first all that it kept so far.

    Raises:
        CheckpointError: the file is no checkpoint, or FMUs, parameters or method are not those of the run.
        CosimError, OSError: as ``simulate``.
    """
    saved = read_checkpoint(checkpoint)
    arguments = again(saved.metadata)
    went_to = saved.document["results"].get("path")
    place = results if results is not None else went_to
    if system is None:
        system = saved.metadata["system"]
        if system is None:
            raise CheckpointError(f"{checkpoint}: does not say where its system is; hand it over")
    stop = arguments["stop_time"] if stop_time is None else stop_time
    watch = None if arguments["watch"] is None else replace(arguments["watch"], look=look)
    return _simulate(system, _Request(
        parameters=arguments["parameters"], times=(arguments["start_time"], stop, arguments["step_size"]),
        selection=Selection(tuple(arguments["record"]), arguments["record_every"], tuple(arguments["record_on"]),
                            watch), method=arguments["method"], engine=engine,
        isolate=tuple(arguments["isolate"]), about=arguments["about"], time_limit=time_limit, progress=progress,
        keeping=Keeping(None if place is None else Path(place), Path(checkpoint), checkpoint_every)), saved)


def _simulate(system: System | Plan | str | Path, request: _Request, saved: Checkpoint | None = None) -> Result:
    with ExitStack() as stack:
        if not isinstance(system, System | Plan):
            system = stack.enter_context(read_system(system))
        plan = stack.enter_context(prepare(system, request.parameters))
        start, stop, step = request.times
        schedule = choose_schedule(plan, start_time=start, stop_time=stop, step_size=step)
        warnings = list(check_method(request.method, plan, schedule))
        for text in warnings:
            _log.warning("%s", text)
        request.keeping.check(plan)
        isolated = isolated_components(plan, request.isolate)
        channels = request.selection.channels(plan)
        metadata = _metadata(plan, schedule, request, channels, isolated)
        if saved is not None:
            saved.check(metadata)
            saved.check_steps(schedule)
            warnings += warn_of_versions(saved)
        warnings[:0] = plan.notes
        file = request.keeping.file(channels, metadata, saved)
        recorder = request.selection.recorder(plan, schedule, channels, file)
        instances = stack.enter_context(instantiate(plan, request.method, isolated))
        keeper = Keeper(request.keeping, recorder, file, metadata, lambda: [
            *warnings, *(f"{instance.name}: {text}" for instance in instances for text in instance.warnings())])
        try:
            network = Network(instances, plan.links, recorder, request.method, find_levels(request.method.events, plan))
            algorithm = choose_engine(network, request.engine)
            master.initialize(network, schedule, plan.settings)
            if saved is not None:
                saved.restore(network)
            keeper.watch(network)
            master.run(network, schedule, algorithm, progress=request.progress, time_limit=request.time_limit,
                       between=_between(request, recorder, keeper))
            keeper.save()
        except (StepError, SimulationInterrupted, TimeLimitError) as error:
            if not isinstance(error, StepError):
                keeper.save_at_the_end()
            error.result = keeper.result()
            raise
        except KeyboardInterrupt:  # the second signal: at once, but rows that are there reach their file
            recorder.drain()
            raise
        result = keeper.result()
        assert result is not None  # row 0 at least
        return result


def _between(request: _Request, recorder: Recorder, keeper: Keeper) -> Callable[[], None]:
    """What is done between two chunks: looked at first, as the keeper hands rows on."""
    watch = request.selection.watch
    if watch is None or watch.look is None:
        return keeper
    onlooker = Onlooker(recorder, recorder.takings[-1], watch.look)

    def both() -> None:
        onlooker()
        keeper()

    return both


def _metadata(plan: Plan, schedule: Schedule, request: _Request, channels: Channels,
              isolated: Iterable[str]) -> dict[str, Any]:
    path = plan.system.path
    document = {
        **versions(), "system": None if path is None else str(path.absolute()), **describe(plan),
        "order": list(plan.order), "parameters": plain_parameters(request.parameters),
        "method": asdict(request.method), "engine": request.engine, "start_time": schedule.start_time,
        "step_size": schedule.step_size, "steps": schedule.steps, "record": [found.name for found in channels.all],
        **request.selection.describe(), "isolate": list(isolated), "about": dict(request.about),
    }
    return dict(json.loads(json.dumps(document)))  # as it will be read again: lists instead of tuples


def _words(given: Iterable[str]) -> tuple[str, ...]:
    return (given,) if isinstance(given, str) else tuple(given)


@contextmanager
def prepare(system: System | Plan, parameters: Mapping[str, Given] | None = None) -> Iterator[Plan]:
    """Unpack the FMUs of a system and check all; the unpacked files are removed when the context ends.

    A plan is checked with other parameters; its FMUs are unpacked already.

    Raises:
        SystemStructureError: as ``simulate``; FMUs that cannot be read are among its problems.
    """
    if isinstance(system, Plan):
        yield check(system.system, system.descriptions, parameters)
        return
    with opened(system) as fmus:
        yield check(system, fmus.descriptions, parameters, fmus.problems)


@contextmanager
def instantiate(plan: Plan, method: Method | None = None,
                isolated: Iterable[str] = ()) -> Iterator[tuple[Instance, ...]]:
    """The instances of a plan in the order of the data; all are terminated, then freed when the context ends.

    Those of ``isolated`` components live in processes of their own.

    Raises:
        StepError: an FMU cannot be loaded or instantiated; the others are freed.
    """
    libraries = {description.path: Library(description) for description in plan.descriptions.values()}
    instances: list[Instance] = []
    try:
        for name in plan.order:
            library, followed = libraries[plan.descriptions[name].path], _followed(plan, method or Method(), name)
            if name in isolated:
                instances.append(IsolatedInstance(name, library, followed))
            elif library.description.fmi == 2:
                instances.append(FmuInstance2(name, library))
            else:
                with_events = method is not None and method.event_mode and has_event_mode(library.description)
                instances.append((EventInstance3 if with_events else FmuInstance3)(name, library, followed))
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
