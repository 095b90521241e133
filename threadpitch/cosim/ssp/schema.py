"""SSP's namespaces, and its files as documents that keep their schema: SSP 1.0's from FMPy, 2.0's from pyssp_standard.

Of pyssp_standard only the schemas are used (see ``read_system``); it is not imported, which would take half a second.
"""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import as_file, files
from importlib.util import find_spec
from pathlib import Path

from lxml import etree

from threadpitch.cosim.document import DocumentError, Element, line_of, parse_document
from threadpitch.cosim.system import SystemStructureError

_BASE = "{http://ssp-standard.org/SSP1/SystemStructure"
SSD = f"{_BASE}Description}}"
SSC = f"{_BASE}Common}}"
SSV = f"{_BASE}ParameterValues}}"
SSM = f"{_BASE}ParameterMapping}}"
SSB = f"{_BASE}SignalDictionary}}"
_NAMESPACE = re.compile(r"\{http[^}]*\}")
# What tools write that leaves nothing in doubt: a list without entries, and an enumeration that the FMU alone defines.
_HARMLESS = re.compile(r"Element '(Connectors|Connections|Elements|ParameterBindings|Units|Enumerations|Annotations)': "
                       r"Missing child element|Element 'Enumeration': The attribute 'name' is required but missing")
VERSIONS = ("1.0", "2.0")  # the namespaces are the same
_FILES = {SSD: "Description", SSV: "ParameterValues", SSM: "ParameterMapping", SSB: "SignalDictionary"}


def parse(path: Path, name: str, expected: str) -> Element:
    """The root of a file, which has the tag ``expected`` and keeps its schema; ``name`` stands for it in messages.

    Raises:
        SystemStructureError: the file is missing, is something else, or breaks its schema.
    """
    what = etree.QName(expected).localname
    try:
        root = parse_document(path)
    except DocumentError as error:
        raise SystemStructureError(f"{name}: {error}; give a file with a {what} of SSP") from None
    if root.tag != expected:
        found = etree.QName(root)
        which = f" of the namespace {found.namespace or ''!r}" if found.localname == what else ""
        mend = f"; the namespace of SSP is {etree.QName(expected).namespace!r}" if which else ""
        raise SystemStructureError(f"{name}: holds <{found.localname}>{which}, not a {what} of SSP{mend}")
    validate(root, name)
    return root


def validate(root: Element, name: str) -> None:
    """Hold a document, or one that stands inside of another, against the schema of its version.

    Raises:
        SystemStructureError: it breaks it, or is of another version; the message tells the line.
    """
    version = root.get("version", "").strip()
    if version not in VERSIONS:
        raise SystemStructureError(f"{name}: is SSP version {version!r}; only {' and '.join(VERSIONS)} are read: "
                                   "export it so")
    schema = _schema(version, _FILES[str(root.tag).partition("}")[0] + "}"])
    if not schema.validate(root):
        errors = ((error.line, _NAMESPACE.sub("", error.message))
                  for error in schema.error_log)  # type: ignore[attr-defined] # lxml-stubs cannot iterate it
        for line, message in errors:
            if not _HARMLESS.match(message):
                raise SystemStructureError(f"{name}: breaks the SSP {version} schema: line {line}: {message}")


def inside(parent: Element, path: str) -> Element:
    """The child that the schema makes sure of."""
    child = parent.find(path)
    assert child is not None, path
    return child


def where(name: str, element: Element) -> str:
    """``file:line`` of an element."""
    return f"{name}:{line_of(element)}"


@cache
def _schema(version: str, kind: str) -> etree.XMLSchema:
    file = f"SystemStructure{kind}.xsd"
    if version == "1.0":
        with as_file(files("fmpy.ssp") / "schema") as folder:
            return etree.XMLSchema(file=str(folder / file))
    package = find_spec("pyssp_standard")
    if package is None or not package.submodule_search_locations:
        raise SystemStructureError("the schemas of SSP 2.0 are missing; install pyssp-standard")
    folder = Path(package.submodule_search_locations[0]) / "resources" / "ssp2"
    return etree.XMLSchema(file=str(folder / file))
