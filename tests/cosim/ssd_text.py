"""Systems as the text of SSDs: small words that make whole files, and what is read and checked of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from tests.cosim.slaves import description, variable
from threadpitch.cosim.check import Plan, check
from threadpitch.cosim.ssp import read_system
from threadpitch.cosim.system import System, SystemStructureError

SPACES = " ".join(f'xmlns:{prefix}="http://ssp-standard.org/SSP1/SystemStructure{name}"' for prefix, name in (
    ("ssd", "Description"), ("ssc", "Common"), ("ssv", "ParameterValues"), ("ssm", "ParameterMapping"),
    ("ssb", "SignalDictionary")))
UNITS = """<ssd:Units><ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit>
<ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit></ssd:Units>"""
EXPERIMENT = '<ssd:DefaultExperiment stopTime="1"/>'
BOX = description(
    variable("u", "input", unit="m"), variable("x", unit="m"), variable("k", "parameter", unit="1/s"),
    variable("length", "parameter", unit="m", minimum=-10.0), variable("number", "input", "Integer"),
    variable("count", type_="Integer"), variable("on", "input", "Boolean"), variable("lit", type_="Boolean"),
    variable("mode", "parameter", "Enumeration", choices={"slow": 1, "fast": 2}),
    variable("gear", "input", "Enumeration", choices={"low": 1, "high": 2}),
    variable("stage", type_="Enumeration", choices={"first": 1, "second": 2, "third": 3}),
    variable("v[1]", unit="m"), variable("v[2]", unit="m"), variable("w[1]", "input", unit="m"),
    variable("w[2]", "input", unit="m"), variable("a[1]", "parameter"), variable("a[2]", "parameter"))


def ssd(system: str, version: str = "1.0", more: str = "") -> str:
    return (f'<?xml version="1.0"?><ssd:SystemStructureDescription {SPACES} version="{version}" name="nested">'
            f'<ssd:System name="root">{system}</ssd:System>{UNITS}{more or EXPERIMENT}'
            "</ssd:SystemStructureDescription>")


def box(name: str, more: str = "") -> str:
    return f'<ssd:Component name="{name}" source="Box.fmu">{more}</ssd:Component>'


def wire(start: str, end: str, more: str = "", attributes: str = "") -> str:
    """``wire("a.x", "b.u")``; a name without a dot is a connector of the system around."""
    words = []
    for role, text in (("start", start), ("end", end)):
        element, _, connector = text.rpartition(".")
        words.append((f'{role}Element="{element}" ' if element else "") + f'{role}Connector="{connector}"')
    return f'<ssd:Connection {" ".join(words)} {attributes}>{more}</ssd:Connection>'


def ports(*names: str) -> str:
    """``ports("input u Real m", "output x")``: kind, name, type, unit."""
    found = []
    for text in names:
        kind, name, *typed = text.split()
        unit = f' unit="{typed[1]}"' if typed[1:] else ""
        inner = f"<ssc:{typed[0]}{unit}/>" if typed else ""
        found.append(f'<ssd:Connector name="{name}" kind="{kind}">{inner}</ssd:Connector>')
    return f"<ssd:Connectors>{''.join(found)}</ssd:Connectors>"


def values(*named: str, binding: str = "", mapping: str = "") -> str:
    """One binding with an inline set: ``values("k Real 3", "length Real 5 mm")``."""
    found = []
    for text in named:
        name, kind, value, *unit = text.split()
        word = f' unit="{unit[0]}"' if unit else ""
        found.append(f'<ssv:Parameter name="{name}"><ssv:{kind} value="{value}"{word}/></ssv:Parameter>')
    return (f"<ssd:ParameterBinding {binding}><ssd:ParameterValues><ssv:ParameterSet version='1.0' name='set'>"
            f"<ssv:Parameters>{''.join(found)}</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues>{mapping}"
            "</ssd:ParameterBinding>")


def bound(*bindings: str) -> str:
    return f"<ssd:ParameterBindings>{''.join(bindings)}</ssd:ParameterBindings>"


def system(elements: str, wires: str = "", before: str = "", after: str = "") -> str:
    joined = f"<ssd:Connections>{wires}</ssd:Connections>" if wires else ""
    return f"{before}<ssd:Elements>{elements}</ssd:Elements>{joined}{after}"


def nested(name: str, content: str, attributes: str = "") -> str:
    return f'<ssd:System name="{name}" {attributes}>{content}</ssd:System>'


def read(path: Path, text: str, files: Mapping[str, str | bytes] | None = None) -> System:
    path.mkdir(exist_ok=True)
    (path / "SystemStructure.ssd").write_text(text)
    (path / "Box.fmu").write_text("fmu")
    for name, content in (files or {}).items():
        (path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_system(path)


def planned(path: Path, text: str, files: Mapping[str, str | bytes] | None = None,
            parameters: dict[str, Any] | None = None) -> Plan:
    structure = read(path, text, files)
    return check(structure, {component.name: BOX for component in structure.components}, parameters)


def laws(plan: Plan) -> dict[str, Any]:
    return {f"{link.source_component}.{link.source.name} -> {link.target_component}.{link.target.name}":
            (link.factor, link.offset) for link in plan.links}


def settings(plan: Plan) -> dict[str, object]:
    return {f"{found.component}.{found.variable.name}": found.value for found in plan.settings}


def problems(path: Path, text: str, files: Mapping[str, str | bytes] | None = None) -> str:
    with pytest.raises(SystemStructureError) as error:
        planned(path, text, files)
    return " | ".join(error.value.problems)


INNER = system(box("box"), wire("u", "box.u") + wire("box.x", "x"),
               ports("input u Real mm", "output x Real m") + bound(values("box.k Real 2")))
LINEAR = '<ssc:LinearTransformation factor="2" offset="1"/>'


def entry(source: str, target: str, transformation: str = "", attributes: str = "") -> str:
    return f'<ssm:MappingEntry source="{source}" target="{target}" {attributes}>{transformation}</ssm:MappingEntry>'


def pairs(kind: str, *entries: str) -> str:
    found = "".join('<ssc:MapEntry source="{}" target="{}"/>'.format(*text.split("=")) for text in entries)
    return f"<ssc:{kind}MappingTransformation>{found}</ssc:{kind}MappingTransformation>"
