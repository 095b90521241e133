"""How the components of a system are coupled: whose values they see when, and how their inputs behave in a step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from threadpitch.cosim.check import Link, Plan
from threadpitch.cosim.extrapolation import HIGHEST_ORDER
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.system import SystemStructureError, nearest

COUPLINGS = ("gauss-seidel", "jacobi")


@dataclass(frozen=True)
class Method:
    """A co-simulation method.

    ``coupling``: "gauss-seidel": each component in the order of the data sees what those before it have computed for
    the end of the step, and of those behind it the values at its beginning; "jacobi": all see the values at the
    beginning. ``extrapolation`` is the order (0, 1, 2) of the polynomial in time that inputs follow inside of a step,
    through the newest values of what feeds them: a number for all FMUs that can (the others hold their inputs, and a
    warning names them), or the order by component. ``multiples`` gives by component how many communication steps one
    step of its own takes; it steps when its own step ends, and its outputs hold in between.
    """

    coupling: str = "gauss-seidel"
    extrapolation: int | Mapping[str, int] = 0
    multiples: Mapping[str, int] = field(default_factory=dict)

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
    problems = [*_word_problems(method), *_rate_problems(method, plan, schedule)]
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
