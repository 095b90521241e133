"""The page of a report in a real browser: opened from disk with the network off."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tests.browser import visit, wait_until_drawn
from tests.report.made import made_thread
from threadpitch.judgement import MeasuredThread
from threadpitch.report.content import Report, Thread, judged, laid_over
from threadpitch.report.limits import Allowed, limited
from threadpitch.report.page import json_for_script, write_page
from threadpitch.report.recorded_run import read_run
from threadpitch.tolerance import parse_thread

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

CHARTS = {"pitch", "judged", "cumulative", "map-0", "within-0", "movement", "ideal", "spectrum", "speed", "following",
          "polar"}
HOSTILE = "<img src=x onerror=window.hacked=1></script><script>window.hacked=1</script>{{7*7}}\x1b[31m"
LARGEST = 6_000_000  # bytes of a page of 10,000 turns


def drawn_charts(page: Page) -> set[str]:
    """The charts with a canvas that shows more than one colour."""
    shown = page.evaluate("""() => [...document.querySelectorAll(".drawing")].filter((place) => {
        const canvases = [];
        const look = (node) => { for (const one of node.querySelectorAll("*")) {
            if (one.tagName === "CANVAS") canvases.push(one); if (one.shadowRoot) look(one.shadowRoot); } };
        look(place);
        return canvases.some((canvas) => { if (!canvas.width || !canvas.height) return false;
            const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
            return new Set(new Uint32Array(pixels.buffer)).size > 4; });
    }).map((place) => place.id)""")
    return {name.removeprefix("chart-") for name in shown}


def judged_thread(name: str = "made", turns: int = 40) -> Thread:
    """A thread with measured pitches, a verdict, and limits."""
    thread = made_thread(turns, name)
    noise = np.random.default_rng(3).normal(0.0, 0.2e-6, thread.nominal.pitch.shape[1])
    measured = (MeasuredThread(thread.nominal.pitch[0] + noise),)
    thread = judged(replace(thread, measured=laid_over(thread.nominal, measured)), thread.nominal, measured, 0.2e-6)
    return limited(thread, Allowed(parse_thread("M20x1.5-6g"), 0.25))


def test_the_report_of_a_run_opens_offline_with_every_chart(run_folder: Path, tmp_path: Path,
                                                            browser: Browser) -> None:
    path = tmp_path / "report.html"
    write_page(Report("Thread of the lathe", tuple(read_run(run_folder))), path)
    with visit(browser, path.as_uri(), offline=True) as seen:
        wait_until_drawn(seen.page)
        assert drawn_charts(seen.page) == CHARTS - {"spectrum"}  # of three turns in the metal there is none
        assert "fewer than four turns" in seen.page.inner_text("#section-spectrum")
        assert seen.complaints == []
        assert seen.requests == [path.as_uri()]
        text = seen.page.inner_text("body")
        for words in ("Table 3", "Table 4", "theta_S4 = 270 deg", "1.4988"):
            assert words in text
        assert "FMU of spindle" in (seen.page.text_content("body") or "")


def test_keys_move_the_cursor_and_zoom_and_names_hide_curves(tmp_path: Path, browser: Browser) -> None:
    path = tmp_path / "report.html"
    thread = judged_thread()
    write_page(Report("Keys", (thread,)), path)
    with visit(browser, path.as_uri(), offline=True) as seen:
        page = seen.page
        wait_until_drawn(page)
        assert drawn_charts(page) == CHARTS - {"following"}
        assert "does not hold the feed's command" in page.inner_text("#section-following")
        page.focus("#chart-pitch")
        for _ in range(3):
            page.keyboard.press("ArrowRight")
        assert page.inner_text("#reading").startswith(
            f"turn 3: theta_S1 = 0 deg {1e3 * thread.nominal.pitch[0, 2]:.6f}")
        before = ranges(page)
        page.keyboard.press("+")
        assert ranges(page) == pytest.approx([before[0] + 4.1, before[1] - 4.1])
        page.keyboard.press("0")
        assert ranges(page) == pytest.approx(before)
        page.click("#section-pitch .curves button >> nth=0")
        assert visible_curves(page) == [False, False, True, True]
        assert page.get_attribute("#section-pitch .curves button >> nth=0", "aria-pressed") == "false"
        assert seen.complaints == []


def ranges(page: Page) -> list[float]:
    found = page.evaluate("""() => { const range = Bokeh.documents[0].roots()[0].x_range;
                                     return [range.start, range.end]; }""")
    return [float(value) for value in found]


def visible_curves(page: Page) -> list[bool]:
    found = page.evaluate("() => Bokeh.documents[0].roots()[0].renderers.map((one) => one.visible)")
    return [bool(value) for value in found]


def test_hostile_names_are_text(tmp_path: Path, browser: Browser) -> None:
    path = tmp_path / "report.html"
    threads = (replace(judged_thread(HOSTILE), notes=(HOSTILE,), lines=(HOSTILE,), provenance=((HOSTILE, HOSTILE),)),
               made_thread(name=HOSTILE * 3))
    write_page(Report(HOSTILE, threads), path)
    with visit(browser, path.as_uri(), offline=True) as seen:
        wait_until_drawn(seen.page)
        assert seen.page.evaluate("() => window.hacked") is None
        assert seen.complaints == []
        text = seen.page.inner_text("body")
        assert "<img src=x onerror=window.hacked=1></script>" in text
        assert "{{7*7}}" in text
        assert "\x1b" not in path.read_text()
        assert seen.page.locator("img").count() == 0


def test_several_threads_lie_over_one_another_on_a_phone(tmp_path: Path, browser: Browser) -> None:
    path = tmp_path / "report.html"
    write_page(Report("Two", (judged_thread("first"), made_thread(60, "second", back=True))), path)
    with visit(browser, path.as_uri(), width=360, offline=True) as seen:
        wait_until_drawn(seen.page)
        assert drawn_charts(seen.page) == (CHARTS - {"following"}) | {"map-1", "within-1"}
        assert seen.page.evaluate("() => document.documentElement.scrollWidth") <= 360
        assert seen.page.locator("#section-pitch .curves button").count() == 4
        assert seen.complaints == []


def test_paper_shows_all_tables_and_no_keys(tmp_path: Path, browser: Browser) -> None:
    path = tmp_path / "report.html"
    write_page(Report("Print", (made_thread(700),)), path)
    with visit(browser, path.as_uri(), offline=True) as seen:
        wait_until_drawn(seen.page)
        assert seen.page.locator("tbody tr").count() < 50
        seen.page.evaluate("() => window.dispatchEvent(new Event('beforeprint'))")
        seen.page.emulate_media(media="print")
        assert seen.page.locator("tbody tr").count() > 700
        assert not seen.page.is_visible(".keys")
        assert "252000\t700\t" in seen.page.inner_text("tbody tr >> nth=699")


def test_a_report_of_ten_thousand_turns_is_small_and_opens_at_once(tmp_path: Path, browser: Browser) -> None:
    """The figure for an idle machine comes from ``python -m tests.benchmarks.bench_report``."""
    path = tmp_path / "report.html"
    write_page(Report("Long", (made_thread(10_000),)), path)
    assert path.stat().st_size < LARGEST
    with visit(browser, path.as_uri(), offline=True) as seen:
        wait_until_drawn(seen.page)
        assert drawn_charts(seen.page) == CHARTS - {"judged", "following"}
        points = seen.page.evaluate("""() => Math.max(...Bokeh.documents[0].roots()[0].renderers
                                          .map((one) => one.data_source.data.x.length))""")
        assert points == 10_000  # pitches are never thinned
        assert seen.complaints == []


def test_data_in_a_script_element_cannot_end_it() -> None:
    text = json_for_script({"name": "</script><!--<script>&"})
    assert not set("<>&") & set(text)


def test_equal_reports_give_equal_pages(tmp_path: Path, run_folder: Path) -> None:
    pages = []
    for name in ("a.html", "b.html"):
        write_page(Report("Same", (made_thread(),)), tmp_path / name)
        text = (tmp_path / name).read_text()
        pages.append(text[:text.index('id="charts-document"')])  # Bokeh numbers its models on
    assert pages[0] == pages[1]


def test_a_page_that_cannot_be_written_leaves_the_former_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "report.html"
    path.write_text("former")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(OSError, match="No space"):
        write_page(Report("Full", (made_thread(),)), path)
    assert path.read_text() == "former"
    assert [one.name for one in tmp_path.iterdir()] == ["report.html"]
