"""Every view in a real browser, from ``threadpitch serve`` as a process of its own."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tests.browser import Visit, visit, wait_until_drawn
from tests.report.made import LEAD
from tests.report.test_page import drawn_charts
from tests.serve.conftest import PARTS, SHIFTED, Stored
from threadpitch.runs import Labels, RunEvents
from threadpitch.runs.events import Turn

if TYPE_CHECKING:
    from playwright.sync_api import Browser


@pytest.fixture(scope="module")
def address(stored: Stored) -> Iterator[str]:
    """Where the server is opened; it ends with Ctrl-C and says nothing."""
    command = [sys.executable, "-m", "threadpitch", "serve", "--store", stored.address, "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                          env={**os.environ, "PYTHONUNBUFFERED": "1"}) as process:
        assert process.stdout is not None
        assert process.stdout.readline().strip() == stored.store.address
        told = process.stdout.readline().strip()
        assert re.fullmatch(r"open http://127\.0\.0\.1:\d+/\?token=[\w-]{32}", told)
        yield told.removeprefix("open ")
        process.send_signal(signal.SIGINT)
        left = process.communicate(timeout=30)
    assert left == ("", "")


@pytest.fixture
def seen(browser: Browser, address: str) -> Iterator[Visit]:
    """The list of runs, opened with the token; nothing is asked of others, and nothing complained of."""
    with visit(browser, address) as opened:
        yield opened
        base = address.partition("/?")[0]
        assert all(url.startswith((base, "data:")) for url in opened.requests), opened.requests
        assert opened.complaints == []


def test_the_list_filters_by_keyboard_and_leads_to_a_comparison(seen: Visit, stored: Stored) -> None:
    page = seen.page
    assert page.inner_text("p[role=status]") == f"{stored.store.count()} runs"
    assert "token" not in page.url
    page.select_option("select[name=machine]", "Lathe 2")
    page.focus("input[name=text]")
    page.keyboard.type("s00")
    page.keyboard.press("Enter")
    page.wait_for_url("**machine=Lathe*")
    assert page.inner_text("p[role=status]") == f"{PARTS} runs"
    assert page.input_value("select[name=machine]") == "Lathe 2"
    for row in (0, 1):
        page.check(f"tbody tr >> nth={row} >> input")
    page.click("text=Compare the chosen runs")
    wait_until_drawn(page)
    assert page.inner_text("h1") == f"Runs {PARTS}, {PARTS - 1}"
    assert drawn_charts(page) == {"pitch", "cumulative", "polar"}
    assert page.locator("#section-pitch .curves button").count() == 2


def test_the_report_of_a_run_and_its_note(seen: Visit, stored: Stored, address: str) -> None:
    page = seen.page
    page.goto(f"{address.partition('/?')[0]}/run/{stored.simulation}")
    wait_until_drawn(page)
    assert {"pitch", "judged", "map-0", "speed", "following"} <= drawn_charts(page)
    assert "machine Lathe 1" in page.inner_text(".bar")
    page.fill("textarea[name=note]", "seen <b>")
    page.click("text=Save note")
    page.wait_for_load_state()
    assert page.input_value("textarea[name=note]") == "seen <b>"
    stored.store.set_note(stored.simulation, "a simulation")


def test_a_hostile_run_is_text_in_every_view(seen: Visit, stored: Stored, address: str) -> None:
    base = address.partition("/?")[0]
    for path in ("/", f"/run/{stored.hostile}", f"/compare?run={stored.hostile}", "/control?machine=&text=DROP"):
        seen.page.goto(base + path)
        if "control" not in path and path != "/":
            wait_until_drawn(seen.page)
        assert seen.page.evaluate("() => window.hacked") is None
        assert seen.page.locator("img").count() == 0
    assert stored.store.count() > PARTS


def test_the_control_chart_shows_the_part_beyond_its_limits(seen: Visit, address: str) -> None:
    page = seen.page
    page.goto(f"{address.partition('/?')[0]}/control?machine=Lathe+2")
    wait_until_drawn(page)
    assert drawn_charts(page) == {"mean", "spread"}
    assert f"Beyond: {SHIFTED}." in page.inner_text("#section-mean")
    row = page.inner_text(f"tbody tr >> nth={SHIFTED - 1}")
    assert f"S{SHIFTED:03d}" in row
    assert row.endswith("mean")
    page.select_option("select[name=limits]", "between")
    page.click("text=Show >> nth=-1")
    page.wait_for_url("**limits=between*")
    wait_until_drawn(page)
    assert "Moving range" in page.inner_text("#section-spread")


def test_the_live_page_shows_revolutions_as_they_come(seen: Visit, stored: Stored, address: str) -> None:
    page = seen.page
    page.set_viewport_size({"width": 360, "height": 800})
    page.goto(f"{address.partition('/?')[0]}/live")
    wait_until_drawn(page)
    events = RunEvents("log", "live.csv", Labels("Lathe 3", serial_number="L1"))
    stored.store.append([events.begin()])
    page.wait_for_selector("#state:has-text('Running: Lathe 3, L1, live.csv')")
    pitches = LEAD + 1e-6 * np.cos(np.arange(1.0, 13.0))
    for first in (0, 6):
        stored.store.append([events.revolution(Turn("log", "1", n, 0.0, float(pitches[n - 1]), LEAD))
                             for n in range(first + 1, first + 7)])
        page.wait_for_selector(f"#newest tr:first-child td:has-text('{first + 6}')")
    shown = page.evaluate("() => [...Bokeh.documents[0].roots()[0].renderers[0].data_source.data.y]")
    assert shown == pytest.approx(1e6 * (pitches - LEAD), abs=1e-6)
    assert drawn_charts(page) == {"live"}
    assert page.inner_text("#section-live .curves li:not([hidden]) span") == "log, 1, 0 deg"
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 360


def test_a_taken_port_is_told_in_one_line(address: str, stored: Stored) -> None:
    port = re.findall(r":(\d+)/", address)[0]
    ended = subprocess.run([sys.executable, "-m", "threadpitch", "serve", "--store", stored.address, "--port", port],
                           capture_output=True, text=True, timeout=120, check=False)
    assert ended.returncode == 2
    assert ended.stdout == ""
    assert ended.stderr == (f"threadpitch: port {port} cannot be served (address already in use); choose another with "
                            "--port, or 0 for any\n")
