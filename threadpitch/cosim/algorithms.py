"""The couplings as sentences: which component receives, steps and publishes when. The definition of what is computed.

A component with a step of its own, m communication steps long, takes part where its step ends; until then its outputs
hold. The kernel computes the same bits.

Outputs are those that a step computed, with its inputs as they were during the step: FMI forbids to ask for them anew
after inputs were set (FMI 2.0.5, 4.2.4; FMI 3.0.2, 4.2.1). In Jacobi's coupling an output that depends directly on an
input is therefore as old as that, one step more than the couplings of equations in textbooks. For components that the
method lists as ``feedthrough`` it is asked for by a step of next to nothing, which is taken back.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

from threadpitch.cosim.errors import StepError
from threadpitch.cosim.iteration import Loop, add_column, begin_iteration, feed, fit, settled, unchanged
from threadpitch.cosim.network import Network
from threadpitch.cosim.node import Node
from threadpitch.cosim.schedule import Schedule

NEXT_TO_NOTHING = 1e-6  # of a step: outputs move by a millionth of what they do in it

Algorithm: TypeAlias = Callable[[Network, Schedule, range], None]  # computes these steps and records them


class Step(NamedTuple):
    """One communication step of all components, seconds."""

    start: float
    size: float
    end: float


Coupling: TypeAlias = Callable[[Network, Step], None]  # computes one step of all components, and records nothing


def gauss_seidel(network: Network, schedule: Schedule, steps: range) -> None:
    """Each component in order receives its inputs, steps from t to t + h and publishes its outputs at t + h.

    Raises:
        StepError: a component fails, or publishes a value that is not a number.
    """
    for step in steps:
        for node in network.due(step + 1):
            start = _start(network, node, schedule, step)
            node.receive(start)
            node.step(start, network.multiples[node.number] * schedule.step_size)
            node.publish(schedule.time(step + 1))
        network.record(step + 1)


def jacobi(network: Network, schedule: Schedule, steps: range) -> None:
    """All components receive their inputs at t, then all step to t + h, then all publish their outputs at t + h.

    Raises:
        StepError: a component fails, or publishes a value that is not a number.
    """
    for step in steps:
        for node in network.due(step):
            node.receive(schedule.time(step))
        due = network.due(step + 1)
        for node in due:
            start = _start(network, node, schedule, step)
            node.step(start, network.multiples[node.number] * schedule.step_size)
        for node in due:
            node.publish(schedule.time(step + 1))
        for node in due:
            _look_ahead(node, schedule.time(step + 1), schedule.step_size)
        network.record(step + 1)


def iterated(network: Network, schedule: Schedule, steps: range) -> None:
    """As Gauss-Seidel, but components that feed each other are repeated until they agree on the values at t + h.

    Raises:
        StepError: a component fails, publishes a value that is not a number, or a loop does not come to rest.
    """
    for step in steps:
        iterated_step(network, Step(schedule.time(step), schedule.step_size, schedule.time(step + 1)))
        network.record(step + 1)


def gauss_seidel_step(network: Network, step: Step) -> None:
    """One step of ``gauss_seidel`` of any size, of components without steps of their own."""
    for node in network.nodes:
        _compute(node, step)


def jacobi_step(network: Network, step: Step) -> None:
    """One step of ``jacobi`` of any size, of components without steps of their own."""
    for node in network.nodes:
        node.receive(step.start)
    for node in network.nodes:
        node.step(step.start, step.size)
    for node in network.nodes:
        node.publish(step.end)
    for node in network.nodes:
        _look_ahead(node, step.end, step.size)


def iterated_step(network: Network, step: Step) -> None:
    """One step of ``iterated``: part by part, where a part is a component, or those that feed each other."""
    done = 0
    for loop in network.loops:
        for node in network.nodes[done:loop.first]:
            _compute(node, step)
        _iterate(network, loop, step)
        done = loop.last
    for node in network.nodes[done:]:
        _compute(node, step)


def _look_ahead(node: Node, time: float, step_size: float) -> None:
    """Publish what the outputs are with the inputs of this time, where the node's slot says that this is wanted."""
    if node.slot is not None:
        node.save()
        node.receive(time)
        node.step(time, NEXT_TO_NOTHING * step_size)
        node.publish(time)
        node.restore()


def _compute(node: Node, step: Step) -> None:
    node.receive(step.start)
    node.step(step.start, step.size)
    node.publish(step.end)


def _iterate(network: Network, loop: Loop, step: Step) -> None:
    """Sweep by sweep from the same states; inputs follow the polynomial through the newest values at t + h."""
    nodes, iterates = network.nodes[loop.first:loop.last], network.state.iterates
    for node in nodes:
        node.save()
    begin_iteration(iterates, loop, network.reals, network.octets)
    columns = 0
    for sweep in range(1, network.method.iterations + 1):
        for node in nodes:
            if sweep > 1:
                node.restore()
            _compute(node, step)
        rests = settled(iterates, loop, network.reals, network.method.tolerance)
        same = unchanged(iterates, loop, network.octets)
        if rests and same and sweep > 1:  # before, nobody has seen the others' values at t + h
            return
        columns = add_column(iterates, loop, network.reals, sweep, columns)
        if not same:  # other values make other equations
            columns = 0
        feed(iterates, loop, network.reals, fit(iterates, loop, sweep, columns))
    raise unsettled(network, loop, step.end)


def unsettled(network: Network, loop: Loop, time: float) -> StepError:
    """The error that tells which loop does not come to rest."""
    names = [node.name for node in network.nodes[loop.first:loop.last]]
    return StepError(f"the loop {' -> '.join([*names, names[0]])} does not come to rest at t = {time:.9g} s after "
                     f"{network.method.iterations} iterations; take a smaller step, more iterations or a larger "
                     "tolerance", component=names[0], time=time, status="loop")


def _start(network: Network, node: Node, schedule: Schedule, step: int) -> float:
    """Where the node's step begins that ends with communication step number ``step``."""
    return schedule.time(step + 1 - network.multiples[node.number])


ALGORITHMS: dict[str, Algorithm] = {"gauss-seidel": gauss_seidel, "jacobi": jacobi, "iterated": iterated}
STEPS: dict[str, Coupling] = {"gauss-seidel": gauss_seidel_step, "jacobi": jacobi_step, "iterated": iterated_step}
