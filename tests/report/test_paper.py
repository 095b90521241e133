"""The PDF of a report: vector graphics, embedded fonts, all tables."""

from __future__ import annotations

import re
import zlib
from dataclasses import replace
from pathlib import Path

import pytest

from tests.report.made import made_thread
from tests.report.test_page import HOSTILE, judged_thread
from threadpitch.report.content import Report
from threadpitch.report.paper import write_paper
from threadpitch.report.recorded_run import read_run


def streams(path: Path) -> bytes:
    """All that the pages draw."""
    content = path.read_bytes()
    return b"\n".join(zlib.decompress(match[1]) for match in
                      re.finditer(rb"FlateDecode[^>]*>>\s*stream\r?\n(.*?)\r?\nendstream", content, re.DOTALL)
                      if match[1][:1] == b"x")


def pages(path: Path) -> int:
    return len(re.findall(rb"/Type\s*/Page\b", path.read_bytes()))


def test_fonts_are_embedded_and_curves_are_vectors(run_folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "report.pdf"
    write_paper(Report("Thread", tuple(read_run(run_folder))), path)
    content = path.read_bytes()
    assert content.startswith(b"%PDF")
    assert content.count(b"/FontFile2") >= 2  # TrueType programs: sans and mono
    assert b"/Type3" not in content
    assert len(re.findall(rb"\d l\n", streams(path))) > 1000  # line segments of the curves
    assert pages(path) >= 7
    assert b"/CreationDate" not in content


def test_every_turn_of_a_long_thread_is_on_paper_and_equal_reports_are_equal(tmp_path: Path) -> None:
    path, again = tmp_path / "report.pdf", tmp_path / "again.pdf"
    for one in (path, again):
        write_paper(Report("Long", (made_thread(300),)), one)
    assert path.read_bytes() == again.read_bytes()
    rows = 300
    assert pages(path) >= 6 + rows // 152  # two columns of 72 rows on a page


def test_hostile_names_do_not_break_the_page(tmp_path: Path) -> None:
    path = tmp_path / "report.pdf"
    thread = replace(judged_thread("$\\frac{</b>" + HOSTILE), notes=("$x^2$ 100 % \\ ",), provenance=(("$", "\\"),))
    write_paper(Report("$\\undefined{" + HOSTILE, (thread, made_thread(name="$"))), path)
    assert pages(path) >= 8


def test_a_missing_library_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from threadpitch.report.content import ReportError
    from threadpitch.report.output import check_output

    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    for name, libraries in (("report.pdf", "matplotlib"), ("report.html", "bokeh and jinja2")):
        with pytest.raises(ReportError, match=rf"{libraries}: not installed; .*threadpitch\[report\]"):
            check_output(tmp_path / name)
