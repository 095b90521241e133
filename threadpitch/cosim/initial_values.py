"""Consistent values at the start: along the links until they rest, and where they do not, by solving the loop.

In initialisation mode a component answers at once with what follows from its inputs, so that a loop of components is a
set of equations x = G(x) for the Real values that are fed back (FMI 2.0.5, 4.2.4; FMI 3.0.2, 2.3.3).
"""

from __future__ import annotations

import logging
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import fsolve

from threadpitch.cosim.errors import StepError
from threadpitch.cosim.iteration import FEW_DIGITS, Loop
from threadpitch.cosim.network import Network
from threadpitch.cosim.node import Node

_SOLVED = 1e-9  # relative to a value, and a thousandth of it to the largest of the loop
_log = logging.getLogger(__name__)


def propagate(network: Network, time: float) -> None:
    """Bring values along the links, in order, until all rest.

    A loop that does not is logged and starts with the last values.

    Raises:
        StepError: a component refuses a value, or a loop does not rest and is to be iterated.
    """
    for node in network.nodes:
        node.get()  # feedback begins with the start values of the components behind
    before = None
    for _ in range(len(network.nodes) + 1):
        _sweep(network.nodes)
        now = network.written_bits()
        if now == before:
            return
        before = now
    done = 0
    for loop in network.loops:
        _sweep(network.nodes[done:loop.first])
        if not _solve(network, loop):
            _tell(network, loop, time)
        done = loop.last
    _sweep(network.nodes[done:])


def _sweep(nodes: Iterable[Node]) -> None:
    for node in nodes:
        node.hold()
        node.get()


def _solve(network: Network, loop: Loop) -> bool:
    """Powell's hybrid method on G(x) - x; whether it came to rest."""
    nodes, iterates, reals = network.nodes[loop.first:loop.last], network.state.iterates, network.reals
    places = iterates.places[loop.first_value:loop.last_value]
    octets = iterates.octets[loop.first_octet:loop.last_octet]

    def fed_back(x: NDArray[np.float64]) -> NDArray[np.float64]:
        reals[places] = x
        _sweep(nodes)
        return reals[places]

    def residual(x: Any) -> Any:
        return fed_back(x) - x

    x = reals[places]
    if x.size:
        # With its full output it tells of trouble instead of warning: what came out is looked at below.
        x = fsolve(residual, x, xtol=1e-14, full_output=True)[0]
    before, values = fed_back(x), network.octets[octets]
    after = fed_back(before)
    sizes = np.maximum(np.abs(before), np.abs(after))
    near = np.abs(after - before) <= np.maximum(_SOLVED * np.maximum(sizes, 1e-3 * sizes.max(initial=0.0)), FEW_DIGITS)
    return bool(near.all()) and np.array_equal(values, network.octets[octets])


def _tell(network: Network, loop: Loop, time: float) -> None:
    names = [node.name for node in network.nodes[loop.first:loop.last]]
    text = f"initial values of the loop {' -> '.join([*names, names[0]])} do not come to rest"
    if network.method.coupling == "iterated":
        raise StepError(f"{text}; look at its start values and parameters", component=names[0], time=time,
                        status="loop")
    _log.warning("%s; it starts with the last values", text)
