"""Parsing of XML from other people's files: nothing is fetched, no entity is resolved, no document type accepted."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

from lxml import etree

from threadpitch.cosim.errors import CosimError

Element: TypeAlias = etree._Element


class DocumentError(CosimError):
    """A file is not XML that can be accepted; the message begins with the line where that is known."""


def parse_document(path: Path) -> Element:
    """The root element of an XML file.

    Raises:
        DocumentError: the file is missing, is not well-formed, or declares a document type (and with it entities),
            which no file of FMI or SSP does.
    """
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        tree = etree.parse(str(path), parser)
    except etree.XMLSyntaxError as error:
        raise DocumentError(f"line {error.lineno}: is not XML: {error.msg}") from None
    except OSError:
        raise DocumentError("no such file") from None
    if tree.docinfo.internalDTD is not None or tree.docinfo.doctype:
        raise DocumentError("holds a document type declaration, which FMI and SSP files do not; refused")
    return tree.getroot()


def line_of(element: Element) -> int:
    """The line where an element begins; 0 where it is not known."""
    line: object = element.sourceline
    return line if isinstance(line, int) else 0
