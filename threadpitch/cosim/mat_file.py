"""MAT: the trajectory files of Dymola and OpenModelica, which DyMat, BuildingsPy and MATLAB read.

Matrices ``Aclass``, ``name``, ``description``, ``dataInfo``, ``data_1`` (what does not change) and ``data_2`` (time and
what changes), transposed ("binTrans") and as version 4, which is what those tools write themselves. ``metadata``
follows as JSON text.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.block import Block, Blocks, Channel
from threadpitch.cosim.errors import CosimError

_MOST = 2**31 - 1  # bytes of a matrix
_LINEAR, _CONSTANT_OUTSIDE = 0, -1  # dataInfo: interpolation, and what is before and after the time


def write_mat(path: Path, block: Block | Blocks, metadata: Mapping[str, Any]) -> None:
    """Write rows, all as double precision.

    Raises:
        CosimError: there is more than version 4 can hold.
    """
    if 8 * len(block) * (len(block.channels.all) + 1) > _MOST:
        raise CosimError(f"{path.name}: {len(block)} rows of {len(block.channels.all)} variables are more than the 2 "
                         "GiB of a .mat; record fewer variables, every n-th step only, or write Parquet")
    from scipy.io import savemat  # takes its time to load: only runs with a .mat need it

    constant, changing, places = _matrices(block)
    names = ["time", *(channel.name for channel in block.channels.all)]
    descriptions = ["Time in [s]", *map(_description, block.channels.all)]
    savemat(path, {
        "Aclass": _text(["Atrajectory", "1.1", "", "binTrans"], transposed=False),
        "name": _text(names), "description": _text(descriptions),
        "dataInfo": places, "data_1": constant, "data_2": changing,
        "metadata": _text([json.dumps(metadata)], transposed=False),
    }, format="4", appendmat=False)


def _matrices(block: Block | Blocks) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int32]]:
    """``data_1`` (constants + 1, 2), ``data_2`` (changing + 1, rows), and ``dataInfo`` (4, variables + 1)."""
    ends = [block.times[0], block.times[-1]] if len(block) else [0.0, 0.0]
    constant, changing = [np.array(ends)], [np.asarray(block.times)]
    places = [(0, 1, _LINEAR, _CONSTANT_OUTSIDE)]  # the time: the first row of both
    for channel in block.channels.all:
        column = block.column(channel).astype(np.float64)
        if column.size and np.all(column == column[0]):
            constant.append(column[[0, 0]])
            places.append((1, len(constant), _LINEAR, _CONSTANT_OUTSIDE))
        else:
            changing.append(column)
            places.append((2, len(changing), _LINEAR, _CONSTANT_OUTSIDE))
    return np.array(constant), np.array(changing), np.array(places, np.int32).T


def _description(channel: Channel) -> str:
    """As Dymola writes units: ``[rad/s]``, and the type of what is no Real number."""
    variable = channel.variable
    unit = f" [{variable.unit}]" if variable.unit else ""
    return f"{variable.causality}{unit}{'' if variable.family == 'Real' else f' (:#{variable.family})'}"


def _text(texts: Sequence[str], *, transposed: bool = True) -> NDArray[np.str_]:
    """A matrix of characters, one text in each row, or in each column where it is transposed."""
    # One byte for a character: what Latin-1 has not becomes a question mark.
    plain = [text.encode("latin-1", "replace").decode("latin-1") for text in texts]
    width = max(1, *map(len, plain))
    rows = np.array([list(text.ljust(width)) for text in plain])
    return np.ascontiguousarray(rows.T if transposed else rows)  # SciPy takes the memory as it lies
