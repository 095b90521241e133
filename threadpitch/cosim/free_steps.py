"""Steps whose size the run itself chooses: by an estimate of the error, and so that events lie on their ends.

The points of the schedule are always reached; its step size is the largest. Every step begins with the kept states of
all components, to which it goes back to be repeated. Runs in plain Python: a step costs three of the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.algorithms import STEPS, Step
from threadpitch.cosim.crossing import Crossing, crossings, locate
from threadpitch.cosim.errors import StepError
from threadpitch.cosim.event_mode import EventInstance3
from threadpitch.cosim.events import EventRecord
from threadpitch.cosim.method import StepControl
from threadpitch.cosim.network import Network
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.snapshot import Snapshot

_SAFETY, _SLOWEST, _FASTEST = 0.9, 0.2, 4.0  # of the controller; Hairer, Norsett, Wanner, Solving ODEs I, II.4
_PROPORTIONAL, _INTEGRAL = 0.4, 0.7  # Gustafsson's PI control, Hairer, Wanner II, IV.2
_EVEN = 1e-9  # of a step: what rounding leaves over


@dataclass(frozen=True)
class _Passed:
    """A level that a step passed."""

    crossing: Crossing
    direction: str
    before: float
    after: float


class _EarlyReturn(Exception):  # noqa: N818 # not an error: an FMU has an event
    """A step ended before its end."""

    def __init__(self, time: float) -> None:
        super().__init__(time)
        self.time = time


class FreeSteps:
    """An algorithm over one network: ``free_steps(network, schedule, steps)`` as those in ``algorithms``."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._couple = STEPS[network.method.coupling]
        self._modal = [(node, node.instance) for node in network.nodes if isinstance(node.instance, EventInstance3)]
        self._start = Snapshot(network)
        self._crossings = crossings(network)
        self._places = network.coupled_reals()

    def __call__(self, network: Network, schedule: Schedule, steps: range) -> None:
        """Compute these steps and record them, and the points between them.

        Raises:
            StepError: as the plain algorithm, or the error stays too large at the smallest step.
        """
        for step in steps:
            time, end = schedule.time(step), schedule.time(step + 1)
            while time < end:
                time = self._advance(time, end, schedule.step_size)
            network.record(step + 1)

    def _advance(self, time: float, limit: float, largest: float) -> float:
        """One step that is good, at most up to the limit: where it ended."""
        self._start.save()
        before = [crossing.value() for crossing in self._crossings]
        end = min([limit, *(one.next_event for _, one in self._modal if one.next_event > time)])
        while True:
            try:
                step, middle = self._good_step(time, end, largest)
                passed = self._passed(before)
                if passed:
                    middle = None
                    step = self._stop_at(passed, step)
                break
            except _EarlyReturn as early:
                self._start.restore()
                end = early.time
        happened = self._handle(step.end) or bool(passed)
        self._record(step, middle, limit, happened)
        return step.end

    def _good_step(self, time: float, end: float, largest: float) -> tuple[Step, NDArray[np.uint8] | None]:
        """A step whose error is small, and the values in its middle where it was computed in halves."""
        control = self._network.method.step_control
        if control is not None:
            return self._controlled(control, time, end, largest)
        step = Step(time, end - time, end)
        self._compute(step)
        return step, None

    def _compute(self, step: Step) -> None:
        """One step of all components.

        Raises:
            _EarlyReturn: an FMU came less far.
        """
        self._couple(self._network, step)
        reached = [early for early in (one.returned_early for _, one in self._modal) if early is not None]
        if reached and min(reached) < step.end:
            if min(reached) <= step.start:
                name = next(node.name for node, one in self._modal if one.returned_early == min(reached))
                raise StepError(f"{name}: the step at t = {step.start:.9g} s returned early and came nowhere",
                                component=name, time=step.start, status="error")
            raise _EarlyReturn(min(reached))

    def _record(self, step: Step, middle: NDArray[np.uint8] | None, limit: float, happened: bool) -> None:
        """The points between those of the schedule; where not every point is recorded, those of events only."""
        octets, every = self._network.octets, self._network.recorder.every == 1
        if middle is not None and every:
            now = octets.copy()
            octets[:] = middle
            self._network.record_between(step.start + 0.5 * step.size)
            octets[:] = now
        if step.end < limit and (every or happened):
            self._network.record_between(step.end)

    # Events

    def _handle(self, time: float) -> bool:
        """Let FMUs go through their event mode, and publish what they have then."""
        events = self._network.recorder.events
        happened = False
        for node, instance in self._modal:
            if instance.has_event(time):
                happened = True
                events += [EventRecord(time, f"{node.name}.{clock}", "tick") for clock in instance.handle_event()]
                node.publish(time)
        return happened

    def _passed(self, before: Sequence[float]) -> list[_Passed]:
        found = []
        for crossing, value in zip(self._crossings, before, strict=True):
            after = crossing.value()
            direction = crossing.passed(value, after)
            if direction:
                found.append(_Passed(crossing, direction, value, after))
        return found

    def _stop_at(self, passed: Sequence[_Passed], step: Step) -> Step:
        """Go back and compute up to the first of the events."""
        parts = [self._part(one, step) for one in passed]
        part = min(parts)
        end = step.end if part >= step.size else step.start + part
        self._start.restore()
        self._compute(Step(step.start, part, end))
        for one, found in zip(passed, parts, strict=True):
            if found == part:
                event = one.crossing.event
                self._network.recorder.events.append(EventRecord(end, event.variable, one.direction))
        return Step(step.start, part, end)

    def _part(self, passed: _Passed, step: Step) -> float:
        level = passed.crossing.level

        def distance(part: float) -> float:
            self._start.restore()
            self._compute(Step(step.start, part, step.start + part))
            return passed.crossing.value() - level

        ends = passed.before - level, passed.after - level
        return locate(distance, ends, step.size, self._network.method.event_tolerance)

    # Step control

    def _controlled(self, control: StepControl, time: float, end: float,
                    largest: float) -> tuple[Step, NDArray[np.uint8]]:
        """Halve until one step and two of half the size agree: the step, and the values in its middle."""
        memory = self._network.state.control
        while True:
            wanted = memory[0] if memory[0] > 0.0 else largest
            count = max(1, int(np.ceil((end - time) / wanted - _EVEN)))
            size = (end - time) / count
            step = Step(time, size, end if count == 1 else time + size)
            smallest = size <= max(control.smallest, 4.0 * np.spacing(abs(end)))
            try:
                error, middle = self._doubled(control, step)
            except StepError as failure:
                if failure.status != "discard" or smallest:
                    raise
                error, middle = np.inf, None
            if error <= 1.0 and middle is not None:
                grown = size * self._factor(error, float(memory[1]))
                memory[0] = min(largest, max(grown, wanted) if size < wanted and grown > size else grown)
                memory[1] = max(error, 1e-4)
                return step, middle
            if smallest:
                raise StepError(f"the error at t = {step.end:.9g} s is {error:.3g} times what is allowed with the "
                                f"smallest step of {size:.3g} s; allow a smaller step or a larger error",
                                component=self._network.nodes[0].name, time=time, status="error")
            memory[0] = max(size * max(_SLOWEST, _SAFETY * error ** (-1.0 / self._order())), control.smallest)
            self._start.restore()

    def _doubled(self, control: StepControl, step: Step) -> tuple[float, NDArray[np.uint8]]:
        """One step, then two of half the size, which stay: the error over what is allowed, the values in the middle."""
        network, half = self._network, 0.5 * step.size
        self._compute(step)
        whole = network.reals[self._places]
        self._start.restore()
        self._compute(Step(step.start, half, step.start + half))
        middle = network.octets.copy()
        self._compute(Step(step.start + half, half, step.end))
        values = network.reals[self._places]
        scales = np.maximum(self._network.state.control[2:], np.abs(values))
        self._network.state.control[2:] = scales
        allowed = control.absolute + control.relative * scales
        differences = np.abs(values - whole) / (2.0 ** (self._order() - 1) - 1.0)
        share = np.divide(differences, allowed, out=np.zeros_like(values), where=differences > 0.0)
        return float(share.max(initial=0.0)), middle

    def _order(self) -> int:
        """The power of the step with which the error of one step falls: two above that of the extrapolation."""
        method = self._network.method
        return 2 + min((method.order(node.name) for node in self._network.nodes), default=0)

    def _factor(self, error: float, before: float) -> float:
        order = self._order()
        if error == 0.0:
            return _FASTEST
        history = before if before > 0.0 else error
        factor = _SAFETY * error ** (-_INTEGRAL / order) * history ** (_PROPORTIONAL / order)
        return float(min(_FASTEST, max(_SLOWEST, factor)))
