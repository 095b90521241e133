"""Parsing of XML from other people's files: nothing is fetched, no entity is resolved, no document type accepted."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeAlias
from xml.parsers import expat

from lxml import etree

from threadpitch.cosim.errors import CosimError

Element: TypeAlias = etree._Element

LARGEST = 128 * 2**20  # bytes; the descriptions of large vehicles come to a tenth
_PIECE = 2**16  # bytes


class DocumentError(CosimError):
    """A file is not XML that can be accepted; the message begins with the line where that is known."""


class _Begun(Exception):  # noqa: N818 -- it is no error: the prologue is over
    """The first element has begun."""


def parse_document(path: Path) -> Element:
    """The root element of an XML file.

    Raises:
        DocumentError: the file is missing or too large, has an encoding that is not known, is not well-formed, is
            nested deeper than any description, or declares a document type (and with it entities), which no file of
            FMI or SSP does.
    """
    try:
        size = path.stat().st_size
        if size > LARGEST:
            raise DocumentError(f"is {size / 2**20:.0f} MiB of XML, more than {LARGEST // 2**20} MiB; refused")
        _refuse_document_type(path)
        parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
        tree = etree.parse(str(path), parser)
    except etree.XMLSyntaxError as error:
        raise DocumentError(f"line {error.lineno}: is not XML: {error.msg}") from None
    except OSError as error:
        raise DocumentError("no such file" if isinstance(error, FileNotFoundError) else _unread(path, error)) from None
    if tree.docinfo.internalDTD is not None or tree.docinfo.doctype:
        raise DocumentError(_NO_TYPE)
    return tree.getroot()


_NO_TYPE = "holds a document type declaration, which FMI and SSP files do not; refused"


def _refuse_document_type(path: Path) -> None:
    """Look at the prologue alone: entities must not be expanded even once, as libxml2 does in attributes."""
    def refuse(*_: Any) -> None:
        raise DocumentError(_NO_TYPE)

    def begin(*_: Any) -> None:
        raise _Begun

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = begin
    try:
        with path.open("rb") as file:
            while piece := file.read(_PIECE):
                parser.Parse(piece)
    except (_Begun, expat.ExpatError):
        pass  # what is not well-formed is told by the parser behind
    except DocumentError:
        raise
    except (LookupError, ValueError) as error:  # the parser behind would see what expat does not
        raise DocumentError(f"is in an encoding that is not read ({error}); save it as UTF-8") from None


def _unread(path: Path, error: OSError) -> str:
    """Why a file cannot be read: the parser says no more than that where bytes are not of the encoding."""
    if error.strerror:
        return f"cannot be read ({error.strerror.lower()})"
    parser = expat.ParserCreate()
    try:
        parser.Parse(path.read_bytes(), True)
    except expat.ExpatError as found:
        return f"line {found.lineno}: is not XML: {expat.ErrorString(found.code)}; it may have another encoding"
    return "cannot be read"


def line_of(element: Element) -> int:
    """The line where an element begins; 0 where it is not known."""
    line: object = element.sourceline
    return line if isinstance(line, int) else 0
