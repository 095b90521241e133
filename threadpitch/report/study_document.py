"""A study as one HTML file that needs no script, or as a PDF: the answer, tables, figures, provenance."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from threadpitch import __version__
from threadpitch.report.output import check_output
from threadpitch.report.page import Scripts, style, templates, write_whole
from threadpitch.report.paper import A4, LINES, Page, paginated, require, table_pages, wrapped, write_pages
from threadpitch.report.statements import TextTable
from threadpitch.report.study_figures import StudyFigure, study_figures
from threadpitch.studies import StudyResult
from threadpitch.studies.keeping import METADATA
from threadpitch.study_report import reasons, sentences, study_tables
from threadpitch.tables import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TOP, _BOTTOM = 0.92, 0.05  # of a page, between which figures stand
_SVG = {"svg.hashsalt": "threadpitch", "axes.grid": True, "grid.alpha": 0.3, "font.size": 9.0,
        "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False, "text.parse_math": False}


def write_study(result: StudyResult, title: str | None, path: Path) -> None:
    """Write a study's report as .html or .pdf; the file appears whole or not at all.

    Raises:
        ReportError: the format is not known, or what makes it is not installed.
        OSError: the file cannot be written.
    """
    check_output(path)
    heading = title or f"Study {result.study.name}"
    if path.suffix.lower() == ".pdf":
        write_pages(heading, _pages(heading, result), path)
    else:
        write_whole(path, _page(heading, result).encode("utf-8"))


def _page(title: str, result: StudyResult) -> str:
    require()  # the drawings are matplotlib's: no script, and nothing that moves
    import matplotlib as mpl

    with mpl.rc_context(_SVG):  # type: ignore[arg-type] # its keys are literals
        figures = [{"title": one.title, "text": one.text, "image": _svg(one)} for one in study_figures(result)]
    return templates().get_template("study.html").render(
        title=printable(title), policy=Scripts().policy, style=style(), lines=_told(result),
        answer=sentences(result.document), tables=study_tables(result.document), figures=figures,
        provenance=_provenance(result), version=__version__)


def _svg(one: StudyFigure) -> str:
    drawn = io.BytesIO()
    one.figure.savefig(drawn, format="svg", metadata={"Date": None})
    return base64.b64encode(drawn.getvalue()).decode()


def _pages(title: str, result: StudyResult) -> Iterator[Page]:
    page = [line for text in (title, *_told(result), "", *sentences(result.document)) for line in wrapped(text)]
    for one in study_tables(result.document):
        for table in table_pages(result.study.name, TextTable(one.heading, one.columns, one.rows)):
            if page and len(page) + 2 + len(table) > LINES:  # a table is not torn apart
                yield from paginated(page)
                page = []
            page += ["", "", *table]
    yield from paginated(page)
    for figure in study_figures(result):
        yield _on_paper(figure)
    yield from paginated(line for name, text in (("Provenance", ""), *_provenance(result))
                         for line in wrapped(f"{name}: {text}" if text else name))


def _on_paper(one: StudyFigure) -> Figure:
    """The figure at the head of a page, below its title."""
    height = min(one.figure.get_figheight() / A4[1], _TOP - _BOTTOM)
    one.figure.set_size_inches(*A4)
    one.figure.set_layout_engine("constrained", rect=(0.06, _TOP - height, 0.88, height))
    one.figure.text(0.07, 0.96, "\n".join(wrapped(f"{one.title}. {one.text}")), fontsize=8, va="top")
    return one.figure


def _told(result: StudyResult) -> list[str]:
    """What was done, and what is missing."""
    found, study = result.analysis, result.study
    drawn = f", {study.design.samples} samples, seed {study.design.seed}" if study.design.samples else ""
    lines = [f"Design {study.design.kind}{drawn}; {found.rows} of {len(study.rows)} rows are done"
             + (f", {found.failed} of them failed." if found.failed else ".")]
    return [*lines, *(f"Failed: {line}" for line in reasons(result))]


def _provenance(result: StudyResult) -> list[tuple[str, str]]:
    """What was asked for and what computed it, entry by entry."""
    document = json.loads(result.table.schema.metadata[METADATA])
    return [(printable(name), printable(value if isinstance(value, str) else json.dumps(value, sort_keys=True)))
            for name, value in sorted(document.items())]
