"""One piece of memory for all values that pass between instances, each in its own C type."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.instance import References

_WORD = 8  # bytes: every stretch begins at a multiple


@dataclass(frozen=True)
class Port:
    """Values of one C type that pass between an instance and the memory in one call.

    ``references`` (r,) are the variables, ``values`` (n,) their stretch of the memory, which begins at the byte
    ``offset``; n exceeds r where variables are arrays.
    """

    c_type: str
    references: References
    values: NDArray[Any]
    offset: int


class Memory:
    """Bytes, and views of them by type."""

    def __init__(self, size: int) -> None:
        self._words = np.zeros(size // _WORD, np.int64)
        self._used = 0

    def view(self, dtype: np.dtype[Any] | type[np.generic] | str) -> NDArray[Any]:
        """All of it as values of one type: the value at byte b is number b / itemsize."""
        return self._words.view(dtype)

    def stretch(self, dtype: np.dtype[Any], count: int) -> tuple[int, NDArray[Any]]:
        """The next free place for some values: its first byte, and the values."""
        offset = self._used
        self._used += space(dtype, count)
        first = offset // dtype.itemsize
        return offset, self.view(dtype)[first:first + count]

    def port(self, c_type: str, variables: dict[int, int]) -> Port:
        """A place for the values of some variables: by value reference the number of values."""
        offset, values = self.stretch(C_TYPES[c_type].dtype, sum(variables.values()))
        return Port(c_type, np.array(list(variables), np.uint32), values, offset)


def space(dtype: np.dtype[Any], count: int) -> int:
    """The bytes that a stretch takes."""
    return -(-count * dtype.itemsize // _WORD) * _WORD
