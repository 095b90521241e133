"""What ``--store`` does: while a command computes its revolutions become events, at its end it is a run."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from threadpitch.cli.judging import Findings
from threadpitch.cli.printing import remark
from threadpitch.diagnosis import Diagnosis
from threadpitch.lathe import Simulation
from threadpitch.live_turns import LiveTurn
from threadpitch.pitch import GroupPitch, StreamedPitch
from threadpitch.publish import Outlet, outlets, wait_until_taken
from threadpitch.runs import Labels, LogTrace, RunEvents, log_run, simulation_run, simulation_trace
from threadpitch.runs.events import Turn
from threadpitch.store import NewEvent, NewRun, open_store
from threadpitch.trace import Samples, Trace

if TYPE_CHECKING:
    from threadpitch.store import Store

PATIENCE = 5.0  # s that a command waits at its end for those who listen
STANDARD_INPUT = "standard input"


@dataclass(frozen=True)
class Asked:
    """What the command line says about keeping a run."""

    store: str | None = None  # an address
    publish: tuple[str, ...] = ()  # URLs
    labels: Labels = field(default_factory=Labels)

    @property
    def wanted(self) -> bool:
        """Whether the run is to be kept: what is published is, so that nothing is lost while nobody listens."""
        return self.store is not None or bool(self.publish)


class Keeper:
    """Keeps one run. ``folder`` is for files on their way, and is removed."""

    def __init__(self, store: Store, events: RunEvents, folder: Path, ways_out: Sequence[Outlet]) -> None:
        self.store, self.events, self.folder, self._ways_out = store, events, folder, ways_out
        self.trace = folder / "trace.parquet"
        self._trace: LogTrace | None = None
        self._told: set[tuple[str, str, float, int]] = set()

    def begin(self) -> None:
        """The run begins."""
        self._tell([self.events.begin()])

    def turns(self, turns: Sequence[Turn]) -> None:
        """Revolutions are complete."""
        self._told |= {(turn.calculator, turn.group, turn.start_angle, turn.number) for turn in turns}
        self._tell([self.events.revolution(turn) for turn in turns])

    def live(self, turns: Sequence[LiveTurn]) -> None:
        """Revolutions of a simulation that runs."""
        self.turns([Turn(one.calculator, str(one.number_of_pass), one.turn, one.start_angle, one.pitch, one.target)
                    for one in turns])

    def sample(self, group: str, samples: Samples | Trace) -> None:
        """The next samples of a log."""
        if self._trace is None:
            self._trace = LogTrace(self.trace)
        self._trace.add(group, samples.angle, samples.position, samples.time)

    def finish_log(self, groups: Sequence[GroupPitch | StreamedPitch], found: Findings,
                   options: Mapping[str, object]) -> dict[str, object]:
        """The log is read to its end, and judged."""
        if self._trace is not None:
            self._trace.close()
        return self.finish(log_run(groups, self.events, target=found.target, measured=found.measured,
                                   verdict=found.verdict, options=options,
                                   trace=None if self._trace is None else self.trace))

    def finish_simulation(self, simulation: Simulation, found: Diagnosis | None) -> dict[str, object]:
        """The simulation came to its end, and is judged."""
        simulation_trace(simulation, self.trace)
        return self.finish(simulation_run(
            simulation, self.events, verdict=None if found is None else found.verdict,
            measured=() if found is None else found.measured, trace=self.trace))

    def finish(self, run: NewRun) -> dict[str, object]:
        """The run is complete: kept, with all revolutions that have not been told; where, as JSON."""
        left = [turn for turn in self.events.turns(run)
                if (turn.calculator, turn.group, turn.start_angle, turn.number) not in self._told]
        number = self.store.add(run)
        self._tell([*(self.events.revolution(turn) for turn in left), self.events.result(run, number)])
        return {"stored": {"run": number, "store": self.store.address}}

    def _tell(self, events: Sequence[NewEvent]) -> None:
        if events:
            self.store.append(events)
            for way_out in self._ways_out:
                way_out.notify()


@contextlib.contextmanager
def keeping_run(asked: Asked, kind: str, source: str) -> Iterator[Keeper | None]:
    """The keeper of a run; None where it is not to be kept. The store is opened before anything is computed.

    Raises:
        StoreError: the store cannot be opened.
    """
    if not asked.wanted:
        yield None
        return
    with tempfile.TemporaryDirectory(prefix="threadpitch-") as folder, open_store(asked.store) as store, \
            outlets(asked.publish, store) as ways_out:
        events = RunEvents(kind, STANDARD_INPUT if source == "-" else source, asked.labels)
        keeper = Keeper(store, events, Path(folder), ways_out)
        keeper.begin()
        yield keeper
        wait_until_taken(ways_out, PATIENCE)
        for way_out in ways_out:
            if waiting := way_out.behind():
                why = f" ({way_out.trouble})" if way_out.trouble else ""
                remark(f"note: {waiting} events wait for {way_out.receiver.name}{why}; `threadpitch publish` with its "
                       "URL sends them")


def check_store(asked: Asked) -> None:
    """Refuse a store that cannot be opened before anything is computed.

    Raises:
        StoreError: it cannot be opened.
    """
    if asked.wanted:
        open_store(asked.store).close()


def stored_line(stored: dict[str, object]) -> str:
    """Where a run was kept, for people; empty where it was not."""
    place = stored.get("stored")
    return f"kept as run {place['run']} in {place['store']}" if isinstance(place, dict) else ""
