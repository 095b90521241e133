"""How the components of a system are coupled: whose values they see when, and how their inputs behave in a step."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from threadpitch.cosim.check import Link, Plan
from threadpitch.cosim.description import FmuDescription
from threadpitch.cosim.events import Event, event_problems
from threadpitch.cosim.extrapolation import HIGHEST_ORDER
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.system import SystemStructureError, nearest

COUPLINGS = ("gauss-seidel", "jacobi", "iterated")


@dataclass(frozen=True)
class StepControl:
    """Communication steps as large as an error allows, at most the run's step size, at least ``smallest`` seconds.

    The error of a step is estimated by computing it in two halves too. Of every Real value that a connection brings it
    must stay below ``absolute + relative * m``, m the largest absolute value so far.
    """

    relative: float = 1e-4
    absolute: float = 0.0
    smallest: float = 1e-9


@dataclass(frozen=True)
class Method:
    """A co-simulation method.

    ``coupling``: "gauss-seidel": each component in the order of the data sees what those before it have computed for
    the end of the step, and of those behind it the values at its beginning; "jacobi": all see the values at the
    beginning; "iterated": as Gauss-Seidel, but components that feed each other go back to the step's beginning and
    repeat it, with what the others have computed for its end, until the values that they feed back change by less than
    ``tolerance``, relative to the largest so far, at most ``iterations`` times. ``extrapolation`` is the order
    (0, 1, 2) of the polynomial in time that inputs follow inside of a step, through the newest values of what feeds
    them: a number for all FMUs that can (the others hold their inputs, and a warning names them), or the order by
    component. ``multiples`` gives by component how many communication steps one step of its own takes; it steps when
    its own step ends, and its outputs hold in between. ``feedthrough`` lists
    components whose outputs depend directly on their inputs; in Jacobi's coupling they then publish what follows from
    the inputs at t + h. With ``step_control`` steps are divided until their error is
    small, and with ``events`` so that a communication point lies where each of them happens, located to
    ``event_tolerance`` seconds. With ``event_mode`` FMUs of FMI 3.0 that have one are run with it: their clocks tick,
    steps end where they announce an event or return early. All of these need FMUs that can go back to a kept state.
    """

    coupling: str = "gauss-seidel"
    extrapolation: int | Mapping[str, int] = 0
    multiples: Mapping[str, int] = field(default_factory=dict)
    feedthrough: Sequence[str] = ()
    iterations: int = 20
    tolerance: float = 1e-8
    step_control: StepControl | None = None
    events: Sequence[Event] = ()
    event_tolerance: float = 1e-9
    event_mode: bool = False

    @property
    def free(self) -> bool:
        """Whether the run itself chooses the size of its steps."""
        return self.step_control is not None or bool(self.events) or self.event_mode

    def order(self, component: str) -> int:
        """The order of extrapolation that is asked for."""
        return self.extrapolation if isinstance(self.extrapolation, int) else self.extrapolation.get(component, 0)

    def follows(self, link: Link) -> bool:
        """Whether a link's target follows a polynomial."""
        reals = link.target.family == "Real" and link.source.c_type in ("fmi2Real", "fmi3Float64")
        return self.order(link.target_component) > 0 and link.target.interpolated and reals


def check_method(method: Method, plan: Plan, schedule: Schedule) -> tuple[str, ...]:
    """Warnings of what some FMUs cannot do of what is asked for all.

    Raises:
        SystemStructureError: with every problem: an unknown word or component, an order or a multiple that cannot be,
            steps that do not fill the time, an FMU that cannot do what is asked of it by name.
    """
    problems = [*_word_problems(method), *_rate_problems(method, plan, schedule), *_number_problems(method),
                *_state_problems(method, plan), *event_problems(method.events, plan)]
    holding = [] if problems else _holding(method, plan)
    if isinstance(method.extrapolation, Mapping):
        problems += [f"extrapolation: no component {component!r}{nearest(component, plan.order)}"
                     for component in _unknown(method.extrapolation, plan)]
        problems += [f"extrapolation: {text}" for text in holding]
        holding = []
    if problems:
        raise SystemStructureError(*problems)
    return tuple(f"extrapolation: {text}" for text in holding)


def _word_problems(method: Method) -> list[str]:
    problems = []
    if method.coupling not in COUPLINGS:
        problems.append(f"coupling {method.coupling!r} is not known; choose one of {', '.join(COUPLINGS)}")
    given = method.extrapolation
    orders = [given] if isinstance(given, int) else given.values()
    problems += [f"extrapolation of order {order!r} is not known; choose 0 to {HIGHEST_ORDER}"
                 for order in orders if order not in range(HIGHEST_ORDER + 1)]
    return problems


def _rate_problems(method: Method, plan: Plan, schedule: Schedule) -> list[str]:
    problems = [f"multiple of the step: no component {component!r}{nearest(component, plan.order)}"
                for component in _unknown(method.multiples, plan)]
    for component, multiple in method.multiples.items():
        if not isinstance(multiple, int) or multiple < 1:
            problems.append(f"{component}: {multiple!r} is no multiple of the communication step; give 1 or more")
        elif schedule.steps % multiple:
            problems.append(f"{component}: {schedule.steps} steps are not a multiple of {multiple}; stop "
                            f"{-schedule.steps % multiple * schedule.step_size:g} s later")
    return problems


def _number_problems(method: Method) -> Iterator[str]:
    if not isinstance(method.iterations, int) or method.iterations < 2:
        yield f"{method.iterations!r} iterations cannot tell whether a loop comes to rest; give 2 or more"
    numbers = {"tolerance": method.tolerance, "event tolerance": method.event_tolerance}
    control = method.step_control
    if control is not None:
        numbers["smallest step"] = control.smallest
        if not (min(control.relative, control.absolute) >= 0.0 < control.relative + control.absolute < math.inf):
            yield (f"errors of {control.relative!r} (relative) and {control.absolute!r} (absolute) allow no step; "
                   "give more")
    for name, number in numbers.items():
        if not 0.0 < number < math.inf:
            yield f"a {name} of {number!r} is not positive"


def _state_problems(method: Method, plan: Plan) -> Iterator[str]:
    """What FMUs cannot do that are to repeat steps, or to take steps of any size."""
    what = "steps whose size is free" if method.free else "iterated steps"
    if method.free or method.coupling == "iterated":
        slow = [name for name, multiple in method.multiples.items() if multiple != 1]
        if slow:
            yield f"{', '.join(slow)}: {what} and steps of its own do not go together; leave out one of them"
    if method.event_mode and not any(map(has_event_mode, plan.descriptions.values())):
        yield "event mode: no FMU of this system has one (hasEventMode, FMI 3.0); leave it out"
    looped = {name for loop in plan.loops for name in loop} if method.coupling == "iterated" else set()
    if method.feedthrough and method.coupling != "jacobi":
        yield f"feedthrough: serves Jacobi's coupling, not {method.coupling}, which needs none; leave it out"
    yield from (f"feedthrough: no component {name!r}{nearest(name, plan.order)}"
                for name in method.feedthrough if name not in plan.order)
    for component in plan.order:
        fmu, ahead = plan.descriptions[component], component in method.feedthrough
        lacking = []
        if (method.free or ahead or component in looped) and not {"canGetAndSetFMUstate", "canGetAndSetFMUState"} & {
                *fmu.capabilities}:
            lacking.append("go back to a kept state (no canGetAndSetFMUstate)")
        if (method.free or ahead) and "canHandleVariableCommunicationStepSize" not in fmu.capabilities:
            lacking.append("change its step size (no canHandleVariableCommunicationStepSize)")
        if lacking:
            needs = "direct feedthrough needs" if ahead and not method.free else f"{what} need"
            yield f"{component} ({fmu.path.name}) cannot {' or '.join(lacking)}, as {needs}"


def read_method(document: Mapping[str, Any]) -> Method:
    """The method of a document that ``dataclasses.asdict`` made, as JSON holds it."""
    control = document.get("step_control")
    return Method(**{**document, "step_control": None if control is None else StepControl(**control),
                     "events": tuple(Event(**event) for event in document.get("events", ()))})


def has_event_mode(fmu: FmuDescription) -> bool:
    """Whether an FMU can be run with its event mode."""
    return fmu.fmi == 3 and "hasEventMode" in fmu.capabilities


def _unknown(names: Mapping[str, int], plan: Plan) -> Sequence[str]:
    return [name for name in names if name not in plan.order]


def _holding(method: Method, plan: Plan) -> list[str]:
    """By component: the connected inputs that are to be extrapolated and cannot."""
    texts = []
    for component in plan.order:
        reals = [link.target for link in plan.links
                 if link.target_component == component and link.target.family == "Real"]
        held = [variable.name for variable in reals if not variable.interpolated]
        if method.order(component) > 0 and held:
            fmu = plan.descriptions[component]
            lacking = "canInterpolateInputs" if fmu.fmi == 2 else "intermediateUpdate"
            texts.append(f"{component} ({fmu.path.name}) cannot interpolate {', '.join(held)} (no {lacking}), "
                         "which is held during a step")
    return texts
