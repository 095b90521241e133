"""What the dry check of a system found, as people read it and as JSON."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from threadpitch.cosim.description import FmuDescription
from threadpitch.cosim.plan import Link, Plan
from threadpitch.cosim.survey import Survey, survey
from threadpitch.cosim.system import Component
from threadpitch.cosim.values import Given
from threadpitch.lathe import choose_flavor, find_system, locate_fmu
from threadpitch.replacement import replacements
from threadpitch.tables import printable

_ABILITIES = {  # what a master can make use of, by the flags of FMI 2.0 and 3.0
    "canGetAndSetFMUstate": "state", "canGetAndSetFMUState": "state", "canSerializeFMUstate": "saved state",
    "canSerializeFMUState": "saved state", "canHandleVariableCommunicationStepSize": "any step",
    "canInterpolateInputs": "inputs interpolated", "providesIntermediateUpdate": "inputs interpolated",
    "canReturnEarlyAfterIntermediateUpdate": "early return", "mightReturnEarlyFromDoStep": "early return",
    "hasEventMode": "events",
}


def check_system(system: str | Path, parameters: Mapping[str, Given] | None = None, *, flavor: str | None = None,
                 replace: Mapping[str, str | Path] | None = None) -> Survey:
    """The dry check of a system, with the FMUs that ``lathe.simulate`` would run; nothing is computed.

    Raises:
        cosim.SystemStructureError: a replacement is no file that can be run.
        ModelError, BuildError, OSError: an FMU cannot be built.
    """
    flavor = choose_flavor(flavor)
    return survey(find_system(system), parameters, locate=functools.partial(locate_fmu, flavor),
                  replace=replacements(replace or {}, flavor))


def survey_document(found: Survey) -> dict[str, object]:
    """The survey as a JSON document; where something is wrong, what could not be found out is empty."""
    system, plan = found.system, found.plan
    return {
        "system": None if system is None else system.name,
        "components": [] if system is None else [_component(one, found) for one in system.components],
        "connections": [] if plan is None else [_connection(link, found) for link in plan.links],
        "parameters": [] if plan is None else [
            {"name": f"{one.component}.{one.variable.name}", "value": one.value, "unit": one.variable.unit}
            for one in plan.settings],
        "order": [] if plan is None else list(plan.order),
        "loops": [] if plan is None else [list(loop) for loop in plan.loops],
        "feedthrough_loops": [list(loop) for loop in found.feedthrough],
        "start_s": None if system is None else system.start_time,
        "stop_s": None if system is None else system.stop_time,
        "notes": [] if plan is None else list(plan.notes),
        "problems": list(found.problems),
    }


def show_survey(console: Console, found: Survey) -> None:
    """Print what was found, but for the problems, which go elsewhere."""
    if found.system is None:
        return
    console.print(Text(printable(found.system.name), style="bold"))
    console.print(_component_table(found))
    if found.plan is None:
        return
    console.print(_connection_table(found.plan, found))
    for line in _lines(found.plan, found):
        console.print(Text(printable(line)))


def _component(component: Component, found: Survey) -> dict[str, object]:
    fmu = (found.fmus or {}).get(component.name)
    record: dict[str, object] = {"name": component.name, "fmu": component.label or str(component.fmu)}
    if fmu is None:
        return record
    counts = {cause: sum(variable.causality == cause for variable in fmu.variables.values())
              for cause in ("input", "output", "parameter")}
    return {**record, "fmi": fmu.version, "tool": fmu.tool, "flavor": _flavor(fmu), "platforms": list(fmu.platforms),
            "step_size_s": fmu.step_size, "capabilities": list(fmu.capabilities),
            "once_per_process": fmu.once_per_process, **{f"{cause}s": count for cause, count in counts.items()}}


def _flavor(fmu: FmuDescription) -> str:
    """What runs inside: PythonFMU's FMUs need a Python where they run."""
    return "python" if "pythonfmu" in fmu.tool.lower() else "native"


def _connection(link: Link, found: Survey) -> dict[str, object]:
    return {"from": f"{link.source_component}.{link.source.name}", "to": f"{link.target_component}.{link.target.name}",
            "type": link.target.type, "from_unit": link.source.unit, "to_unit": link.target.unit,
            "factor": link.factor, "offset": link.offset, "table": [list(pair) for pair in link.table],
            "cut": link in found.cut}


def _component_table(found: Survey) -> Table:
    table = Table("component", "FMU", "FMI", "runs as", "step [s]", "abilities", box=box.ASCII2)
    assert found.system is not None
    for component in found.system.components:
        fmu = (found.fmus or {}).get(component.name)
        label = printable(component.fmu.name)
        cells = ("-", "-", "-", "-") if fmu is None else (
            fmu.version, f"{_flavor(fmu)}: {', '.join(fmu.platforms)}", f"{fmu.step_size:g}" if fmu.step_size else "-",
            ", ".join(word for flag, word in _ABILITIES.items() if flag in fmu.capabilities) or "-")
        table.add_row(*(Text(text) for text in (printable(component.name), label, *map(printable, cells))))
    return table


def _connection_table(plan: Plan, found: Survey) -> Table:
    table = Table("from", "to", "conversion", box=box.ASCII2)
    for link in plan.links:
        ends = (f"{component}.{variable.name}" + (f" [{variable.unit}]" if variable.unit else "")
                for component, variable in ((link.source_component, link.source), (link.target_component, link.target)))
        table.add_row(*(Text(printable(text)) for text in (*ends, ", ".join(_conversion(link, found)))))
    return table


def _conversion(link: Link, found: Survey) -> Iterator[str]:
    if link.factor != 1.0:
        yield f"x {link.factor:.9g}"
    if link.offset != 0.0:
        yield f"{link.offset:+.9g}"
    if link.table:
        yield "table"
    if link in found.cut:
        yield "cut: of the step before"


def _lines(plan: Plan, found: Survey) -> Iterator[str]:
    yield f"order: {' -> '.join(plan.order)}"
    for loop in plan.loops:
        yield f"feed each other: {', '.join(loop)}"
    for loop in found.feedthrough:
        yield f"direct feedthrough loop: {' -> '.join((*loop, loop[0]))}"
    if not found.feedthrough:
        yield "no loop of direct feedthrough"
    yield f"{len(plan.settings)} values are set; {len(plan.links)} connections, {len(found.cut)} of them cut"
    for note in plan.notes:
        yield f"note: {note}"
