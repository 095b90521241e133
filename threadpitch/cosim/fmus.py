"""The FMUs of a system unpacked side by side: every one that can be read, and why the others cannot."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from threadpitch.cosim.archive import MAXIMUM_SIZE
from threadpitch.cosim.description import FmuDescription, read_fmu
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.system import System


@dataclass
class Fmus:
    """By component what its FMU says of itself; components whose FMU cannot be read are in ``problems`` only."""

    descriptions: dict[str, FmuDescription] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)


@contextmanager
def opened(system: System) -> Iterator[Fmus]:
    """Unpack the FMUs of a system, each file once, all together below the limit for one; removed at the end."""
    fmus = Fmus()
    by_path: dict[Path, FmuDescription | str] = {}
    room = MAXIMUM_SIZE
    with ExitStack() as stack:
        for component in system.components:
            if component.fmu == Path():
                continue  # it was not found, which the reader of the system has told
            if component.fmu not in by_path:
                try:
                    description = read_fmu(component.fmu, component.label, room)
                except CosimError as error:
                    by_path[component.fmu] = str(error)
                else:
                    stack.callback(description.close)
                    room -= description.temporary.size if description.temporary is not None else 0
                    by_path[component.fmu] = description
            found = by_path[component.fmu]
            if isinstance(found, str):
                fmus.problems.append(found)
            else:
                fmus.descriptions[component.name] = found
        yield fmus
