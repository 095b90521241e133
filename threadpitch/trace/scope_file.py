"""Exports of TwinCAT Scope whose channels have sample times of their own.

Channels stand side by side, each with its time in ms; a slower channel has fewer rows, and blanks below its last one.
"""

from __future__ import annotations

from array import array
from collections.abc import Generator, Sequence
from pathlib import Path

import numpy as np

from threadpitch.trace.array_log import ArrayLog, Chunk, Columns
from threadpitch.trace.channels import Channel, aligned, clock_notes
from threadpitch.trace.choice import ColumnChoice, brief
from threadpitch.trace.passes import Array
from threadpitch.trace.recording import TraceError
from threadpitch.trace.text_head import Head
from threadpitch.trace.text_rows import rows_of

_MS = 1e-3  # s
_TIME = "time [ms]"
_CHUNK = 1 << 18  # rows that are brought together at once


def scope_log(path: Path, head: Head, choice: ColumnChoice) -> ArrayLog:
    """The log in an export; its channels are held in memory.

    Raises:
        TraceError: a field is not a number, a column is not there or cannot be told.
    """
    names, units = head.names[1::2], head.units[1::2]

    def chunks(wanted: Sequence[int]) -> Generator[Chunk]:
        recorded = _recorded(path, [i for i in wanted if i < len(names)], names)

        def channel(i: int) -> Channel:
            own = wanted[0] if i == len(names) else i
            time, samples = recorded[own]
            values = time / _MS if i == len(names) else samples
            return Channel([*names, _TIME][i], time.size, lambda a, b: values[a:b], head.sample_times[own],
                           lambda a, b: time[a:b])

        yield from aligned([channel(i) for i in wanted], _CHUNK)

    notes = clock_notes([*head.sample_times, None])
    columns = Columns([*names, _TIME], [*units, "ms"], chunks, True, notes=lambda chosen: (*head.notes, *notes(chosen)))
    return ArrayLog(str(path), columns, choice)


def _recorded(path: Path, channels: Sequence[int], names: Sequence[str]) -> dict[int, tuple[Array, Array]]:
    """(time (samples,) s, values (samples,)) of the channels, as far as each goes."""
    found = {i: (array("d"), array("d")) for i in channels}
    for _, block in rows_of(path):
        for line, row in zip(block.lines, block.rows, strict=True):
            for i, (time, values) in found.items():
                at, value = row[2 * i], row[2 * i + 1]
                if at.strip() or value.strip():
                    time.append(_number(at, f"{path}:{line}", names[i]))
                    values.append(_number(value, f"{path}:{line}", names[i]))
    return {i: (_MS * np.array(time), np.array(values)) for i, (time, values) in found.items()}


def _number(text: str, place: str, name: str) -> float:
    try:
        return float(text if "_" not in text else "")
    except ValueError:
        raise TraceError(f"{place}: channel {brief(name)} holds {brief(text)}, not a number; mend this row") from None
