"""A system that runs again and again: its FMUs are unpacked and loaded once, the instances are reset between runs."""

from __future__ import annotations

import time as clock
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim import master
from threadpitch.cosim.block import Channel
from threadpitch.cosim.branching import Branching
from threadpitch.cosim.check import Plan, Setting
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.instance import FmuInstance
from threadpitch.cosim.links import Joiner
from threadpitch.cosim.metadata import describe, versions
from threadpitch.cosim.network import Network
from threadpitch.cosim.program import Program
from threadpitch.cosim.result import Result
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.selection import Selection, Watch, choose_channels
from threadpitch.cosim.settings import Setter
from threadpitch.cosim.simulation import choose_schedule, instantiate, prepare
from threadpitch.cosim.system import System, SystemStructureError
from threadpitch.cosim.values import Given


@dataclass(frozen=True)
class Experiment:
    """What all runs of a mounted system have in common; times are seconds, None is what the system says.

    ``record`` and ``watch`` are those of ``simulate``. ``part_at`` names a recorded Boolean: what runs have in common
    before it is true is computed once (see ``branching``); without a name every run begins at the beginning.
    """

    stop_time: float | None = None
    step_size: float | None = None
    record: tuple[str, ...] = ()
    watch: Watch | None = None
    part_at: str | None = None


class Mounted:
    """Loaded instances of a plan, ready to run with other parameters; after a run that failed mount anew."""

    def __init__(self, plan: Plan, instances: Iterable[FmuInstance], schedule: Schedule,
                 experiment: Experiment) -> None:
        self._plan = plan
        self._instances = tuple(instances)
        self._schedule = schedule
        selection = Selection(experiment.record, watch=experiment.watch)
        recorder = selection.recorder(plan, schedule, selection.channels(plan), None)
        self._network = Network(self._instances, plan.links, recorder)
        self._branching = self._choose_branching(experiment.part_at)
        self._program = Program(self._network)
        self._problems: list[str] = []
        self._setter = Setter(Joiner(plan.system, plan.descriptions, self._problems), [])
        self._settings = {(found.component, found.variable.name): found for found in plan.settings}
        self._fed = {(link.target_component, link.target.name): link for link in plan.links}
        state = self._network.state
        self._arrays: tuple[NDArray[Any], ...] = (
            self._network.octets, state.times, state.starts, *state.samples, *state.iterates, state.control)
        self._new = tuple(array.copy() for array in self._arrays)
        self._used = False
        self.broken = False

    @property
    def order(self) -> tuple[str, ...]:
        """The components in the order of the data."""
        return self._plan.order

    @property
    def branched(self) -> int:
        """How many runs began with what a former one had computed."""
        return 0 if self._branching is None else self._branching.branched

    def describe(self) -> dict[str, Any]:
        """Versions and FMUs by their content, connections, and the values that all runs share, as JSON holds them."""
        return {**versions(), **describe(self._plan), "start_time": self._schedule.start_time,
                "step_size": self._schedule.step_size, "steps": self._schedule.steps}

    def check(self, parameters: Mapping[str, Given]) -> None:
        """Look at parameters without running anything.

        Raises:
            SystemStructureError: one is wrong; every problem is told.
        """
        self._choose(parameters)

    def run(self, parameters: Mapping[str, Given]) -> Result:
        """The result that ``simulate`` gives with these parameters, to the bit, but without its metadata.

        Raises:
            SystemStructureError: a parameter is wrong.
            StepError: a component fails.
            SimulationInterrupted: Ctrl-C or SIGTERM.
            CosimError: it has failed before.
        """
        if self.broken:
            raise CosimError("a run of these instances has failed; mount the system anew")
        began = clock.perf_counter()
        settings = self._choose(parameters)
        try:
            self._initialize(settings)
            if self._branching is not None and not self._branching.begin(self._program, settings):
                if self._branching.touched:
                    self._initialize(settings)
                self._branching.compute(self._program, settings)
            master.run(self._network, self._schedule, self._program)
        except BaseException:  # a second Ctrl-C too: the instances stand somewhere
            self.broken = True
            raise
        warnings = [f"{instance.name}: {text}" for instance in self._instances for text in instance.warnings()]
        wall_time = clock.perf_counter() - began
        result, *watched = (Result(self._network.recorder, wall_time=wall_time, order=self._plan.order,
                                   warnings=warnings, taking=number)
                            for number in range(len(self._network.recorder.takings)))
        result.watched = watched[0] if watched else None
        return result

    def _choose(self, parameters: Mapping[str, Given]) -> list[Setting]:
        """What ``check`` makes of these parameters; the system itself has been checked."""
        self._problems.clear()
        settings = self._setter.overridden(self._settings, self._fed, parameters)
        if self._problems:
            raise SystemStructureError(*dict.fromkeys(self._problems))
        return settings

    def _initialize(self, settings: Iterable[Any]) -> None:
        """All as if it were new, then initialised."""
        if self._used:
            for instance in self._instances:
                instance.reset()
            for array, new in zip(self._arrays, self._new, strict=True):
                np.copyto(array, new)
        self._used = True
        self._network.recorder.begin()
        master.initialize(self._network, self._schedule, settings)

    def _choose_branching(self, part_at: str | None) -> Branching | None:
        states = all(description.serializes_state for description in self._plan.descriptions.values())
        if part_at is None or not states:
            return None
        mark: Channel = choose_channels(self._plan, [part_at])[0]
        return Branching(self._network, self._schedule, mark)


@contextmanager
def mount(system: System, experiment: Experiment | None = None) -> Iterator[Mounted]:
    """Unpack and load the FMUs of a system.

    Raises:
        SystemStructureError: the system or a name to record is wrong.
        StepError: an FMU cannot be loaded.
        CosimError: the times do not fit.
    """
    chosen = experiment or Experiment()
    with prepare(system) as plan:
        schedule = choose_schedule(plan, stop_time=chosen.stop_time, step_size=chosen.step_size)
        with instantiate(plan) as instances:
            loaded = [instance for instance in instances if isinstance(instance, FmuInstance)]
            yield Mounted(plan, loaded, schedule, chosen)
