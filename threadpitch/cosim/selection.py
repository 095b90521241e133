"""Which variables a run records, and at which communication points."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from threadpitch.cosim.block import Channel, Channels
from threadpitch.cosim.onlooker import Look
from threadpitch.cosim.plan import Plan
from threadpitch.cosim.recording import MemoryRows, Recorder, Sink, Taking, check_every
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.system import SystemStructureError, nearest

_GROUPS = {
    "outputs": ("output",),
    "inputs": ("input",),
    "locals": ("local",),
    "parameters": ("parameter", "calculatedParameter"),
}


@dataclass(frozen=True)
class Watch:
    """Rows that are kept in memory besides the recorded ones: of ``record``, whenever a variable of ``on`` changes.

    ``look`` is shown them while the run computes, several times a second.
    """

    record: tuple[str, ...]
    on: tuple[str, ...]
    look: Look | None = None


@dataclass(frozen=True)
class Selection:
    """What ``simulate`` is asked to record: see there."""

    record: tuple[str, ...] = ("outputs",)
    every: int = 1
    on: tuple[str, ...] = ()
    watch: Watch | None = None

    def channels(self, plan: Plan) -> Channels:
        """The recorded variables.

        Raises:
            SystemStructureError: a word or name matches nothing.
            CosimError: ``every`` counts no steps.
        """
        check_every(self.every)
        return Channels(choose_channels(plan, (*self.record, *self.on)))

    def recorder(self, plan: Plan, schedule: Schedule, channels: Channels, file: Sink | None) -> Recorder:
        """A recorder that brings ``channels`` to the file, or keeps them in memory, and what is watched besides.

        Raises:
            SystemStructureError: a word or name matches nothing.
            CosimError: the rows do not fit into the memory.
        """
        count = 0 if self.on else schedule.steps // self.every + 1
        sink = MemoryRows(channels, count) if file is None else file
        on = [found.name for found in choose_channels(plan, self.on)]
        if self.watch is None:
            return Recorder(channels, schedule, self.every, [Taking(channels, sink, on=on)])
        watched = Channels(choose_channels(plan, (*self.watch.record, *self.watch.on)))
        changing = [found.name for found in choose_channels(plan, self.watch.on)]
        takings = [Taking(channels, sink, every=self.every, on=on), Taking(watched, MemoryRows(watched), on=changing)]
        both = choose_channels(plan, [found.name for found in (*channels.all, *watched.all)])
        return Recorder(both, schedule, 1, takings)

    def describe(self) -> dict[str, Any]:
        """For the metadata: all but the names of the recorded variables."""
        watch = None if self.watch is None else {"record": list(self.watch.record), "on": list(self.watch.on)}
        return {"record_every": self.every, "record_on": list(self.on), "watch": watch}


def choose_channels(plan: Plan, record: Iterable[str]) -> list[Channel]:
    """The variables to record, in the order of the components and of their variables (see ``simulate``).

    Raises:
        SystemStructureError: a word or name matches nothing; all that do not are told.
    """
    words = [record] if isinstance(record, str) else list(record)
    channels = [Channel(component.name, variable) for component in plan.system.components
                for variable in plan.descriptions[component.name].variables.values() if variable.exchanged]
    known = {channel.name for channel in channels}
    chosen: set[str] = set()
    problems = []
    for word in words:
        if word in _GROUPS:
            chosen |= {channel.name for channel in channels if channel.variable.causality in _GROUPS[word]}
            continue
        if word in known:  # not by its pattern: thousands of names would be compared with thousands
            chosen.add(word)
            continue
        # Not fnmatch: brackets are the indices of arrays here.
        pattern = re.compile(re.escape(word).replace(r"\*", ".*").replace(r"\?", "."))
        found = {name for name in known if pattern.fullmatch(name)}
        if not found:
            hint = nearest(word, [*_GROUPS, *(channel.name for channel in channels)])
            problems.append(f"nothing to record is called {word!r}{hint}")
        chosen |= found
    if problems:
        raise SystemStructureError(*problems)
    return [channel for channel in channels if channel.name in chosen]
