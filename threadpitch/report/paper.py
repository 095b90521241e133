"""A report as a PDF: A4 pages with vector drawings and embedded fonts, drawn by matplotlib."""

from __future__ import annotations

import importlib.util
import io
import textwrap
from collections.abc import Iterable, Iterator
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from threadpitch import __version__
from threadpitch.report.content import Report, ReportError
from threadpitch.report.page import write_whole
from threadpitch.report.statements import Statements, TextTable, statements
from threadpitch.tables import printable

if TYPE_CHECKING:
    from matplotlib.backends.backend_pdf import PdfPages
    from matplotlib.figure import Figure

Page: TypeAlias = "list[str] | Figure"  # lines of text, or a figure of the size A4

A4 = (8.27, 11.69)  # inch
LINES = 76  # of text on a page
_WIDTH = 98  # characters of a line of text
_SHORT = 30  # rows of a table that shares its page
_GAP = "   "  # between two columns of a table
_STYLE: dict[str, object] = {
    "pdf.fonttype": 42, "font.family": "DejaVu Sans", "font.size": 8.0, "axes.grid": True, "grid.alpha": 0.3,
    "axes.titlesize": 9.0, "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False,
    "legend.fontsize": 6.5, "lines.linewidth": 1.0, "lines.markersize": 3.5,
    "text.parse_math": False,  # names from files are text, whatever they hold
}


def require() -> None:
    """Refuse where matplotlib is missing.

    Raises:
        ReportError: it is, with the command that installs it.
    """
    if importlib.util.find_spec("matplotlib") is None:
        raise ReportError("matplotlib: not installed; install with: pip install 'threadpitch[report]'")


def write_paper(report: Report, path: Path) -> None:
    """Write the report as a PDF, which appears whole or not at all.

    Raises:
        ReportError: matplotlib is not installed.
        OSError: the file cannot be written.
    """
    write_pages(report.title, _parts(report), path)


def write_pages(title: str, parts: Iterable[Page], path: Path) -> None:
    """Write pages, of text or with a figure, as a PDF; figures are made in the style of the paper where ``parts`` makes
    them when they are asked for.

    Raises:
        ReportError: matplotlib is not installed.
        OSError: the file cannot be written.
    """
    require()
    import matplotlib as mpl
    from matplotlib.backends.backend_pdf import PdfPages

    content = io.BytesIO()
    about = {"Title": printable(title), "Creator": f"threadpitch {__version__}", "CreationDate": None}
    with mpl.rc_context(_STYLE), PdfPages(content, metadata=about) as pages:  # type: ignore[arg-type] # known keys
        footer = _Footer(printable(title))
        for part in parts:
            if isinstance(part, list):
                _add_text(pages, footer, part)
            else:
                _add(pages, footer, part)
    write_whole(path, content.getvalue())


def _parts(report: Report) -> Iterator[Page]:
    """Words, charts, tables, provenance."""
    from threadpitch.report.paper_drawings import chart_pages

    told = [statements(thread) for thread in report.threads]
    yield from paginated(_summary(report, told))
    yield from chart_pages(report, A4)
    for one in told:
        yield from _tables(one)
    yield from paginated(_provenance(report, told))


class _Footer:
    """Title and number of the page below each of them."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._number = 0

    def add(self, figure: Figure) -> None:
        self._number += 1
        figure.text(0.07, 0.02, textwrap.shorten(self._title, _WIDTH, placeholder="..."), fontsize=7, color="#555555")
        figure.text(0.93, 0.02, str(self._number), fontsize=7, color="#555555", ha="right")


def _add_text(pages: PdfPages, footer: _Footer, lines: list[str]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=A4)
    figure.text(0.07, 0.96, "\n".join(lines), family="DejaVu Sans Mono", fontsize=7.6, va="top", linespacing=1.25)
    _add(pages, footer, figure)


def _add(pages: PdfPages, footer: _Footer, figure: Figure) -> None:
    footer.add(figure)
    pages.savefig(figure)  # type: ignore[no-untyped-call] # matplotlib has not typed it


def _summary(report: Report, told: list[Statements]) -> Iterator[str]:
    """Title, verdicts with their evidence, tolerances and notes."""
    yield from wrapped(report.title)
    for one in told:
        yield from ("", *wrapped(one.name), "-" * min(len(one.name), _WIDTH))
        for line in one.lines:
            yield from wrapped(line)
        if one.verdict:
            yield from ("", *wrapped(f"Verdict: {one.verdict}"))
            for line in one.advice:
                yield from wrapped(f"  - {line}")
            yield ""
            for name, text in one.evidence:
                yield from wrapped(f"{name}: {text}")
        for name, text in one.tolerances:
            yield from ("", *wrapped(f"{name}. {text}"))
        for note in one.notes:
            yield from wrapped(f"Note: {note}")


def _provenance(report: Report, told: list[Statements]) -> Iterator[str]:
    yield "Provenance"
    for name, rows in [*((one.name, one.provenance) for one in told),
                       ("Report", (("made by", f"threadpitch {__version__}"), *report.provenance))]:
        yield from ("", *wrapped(name))
        for what, text in rows:
            yield from wrapped(f"  {what}: {text}")


def wrapped(line: str) -> list[str]:
    """A line of text as lines that fit on the page."""
    return textwrap.wrap(printable(line), _WIDTH, subsequent_indent="    ") or [""]


def paginated(lines: Iterable[str]) -> Iterator[list[str]]:
    """Lines of text, page by page."""
    page: list[str] = []
    for line in lines:
        page.append(line)
        if len(page) == LINES:
            yield page
            page = []
    if page:
        yield page


def _tables(one: Statements) -> Iterator[list[str]]:
    """Pages of the tables of a thread: long ones by themselves, short ones below each other."""
    short = [table for table in one.tables if len(table.rows) <= _SHORT]
    for table in one.tables:
        if table not in short:
            yield from table_pages(one.name, table)
    yield from paginated(line for table in short for page in table_pages(one.name, table) for line in [*page, "", ""])


def table_pages(name: str, table: TextTable) -> Iterator[list[str]]:
    """The rows of a table under its heading, in as many columns beside each other as the page holds."""
    widths = [max(len(row[place]) for row in (table.columns, *table.rows)) for place in range(len(table.columns))]

    def line(row: tuple[str, ...]) -> str:
        return "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))

    head = line(table.columns)
    beside = max(1, (_WIDTH + len(_GAP)) // (len(head) + len(_GAP)))
    rows = [line(row) for row in table.rows]
    room = LINES - 4
    for first in range(0, max(len(rows), 1), room * beside):
        part = rows[first:first + room * beside]
        height = min(room, max(-(-len(part) // beside), min(len(part), room // 2)))
        columns = [part[start:start + height] for start in range(0, len(part), height)]
        heads = _GAP.join([head] * len(columns))
        yield [*wrapped(f"{name}. {table.heading}"), "", heads, "-" * len(heads),
               *(_GAP.join(cell.ljust(len(head)) for cell in cells)
                 for cells in zip_longest(*columns, fillvalue=""))]
