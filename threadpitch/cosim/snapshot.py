"""The state of a whole network between two steps, kept in memory to go back to."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.network import Network


class Snapshot:
    """One state of all instances, of the values between them, and of what extrapolation and iteration remember."""

    def __init__(self, network: Network) -> None:
        state = network.state
        self._slots = [node.instance.slot() for node in network.nodes]
        self._arrays: tuple[NDArray[Any], ...] = (
            network.octets, state.times, state.starts, *state.samples, *state.iterates)
        self._kept = tuple(array.copy() for array in self._arrays)

    def save(self) -> None:
        """Keep the state as it is now."""
        for slot in self._slots:
            slot.save()
        for kept, array in zip(self._kept, self._arrays, strict=True):
            np.copyto(kept, array)

    def restore(self) -> None:
        """Go back to what was kept."""
        for slot in self._slots:
            slot.restore()
        for kept, array in zip(self._kept, self._arrays, strict=True):
            np.copyto(array, kept)
