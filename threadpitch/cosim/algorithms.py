"""The couplings as sentences: which component receives, steps and publishes when. The definition of what is computed.

A component with a step of its own, m communication steps long, takes part where its step ends; until then its outputs
hold. The kernel computes the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from threadpitch.cosim.network import Network
from threadpitch.cosim.node import Node
from threadpitch.cosim.schedule import Schedule

Algorithm: TypeAlias = Callable[[Network, Schedule, range], None]  # computes these steps and records them


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
        network.record(step + 1)


def _start(network: Network, node: Node, schedule: Schedule, step: int) -> float:
    """Where the node's step begins that ends with communication step number ``step``."""
    return schedule.time(step + 1 - network.multiples[node.number])


ALGORITHMS: dict[str, Algorithm] = {"gauss-seidel": gauss_seidel, "jacobi": jacobi}
