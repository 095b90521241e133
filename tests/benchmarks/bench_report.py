"""A report of 10,000 turns: its size, and how long Chromium takes to open it from disk.

    python -m tests.benchmarks.bench_report

"Loaded" is the end of the page's load event, "first charts" when those over the turn are drawn, "all" the last of them;
seconds from the beginning of the navigation, the least of five. "Empty" is a page without anything, in the same run.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from tests.browser import chromium
from tests.report.made import made_thread
from threadpitch.report.content import Report
from threadpitch.report.page import write_page

if TYPE_CHECKING:
    from playwright.sync_api import Browser

TURNS = 10_000
REPEATS = 5


def opening(browser: Browser, path: Path, states: tuple[str, ...]) -> list[float]:
    """Seconds to the load event, and to each state of the page."""
    context = browser.new_context(viewport={"width": 1200, "height": 900}, offline=True)
    page = context.new_page()
    page.goto(path.as_uri())
    found = [float(page.evaluate("() => performance.getEntriesByType('navigation')[0].loadEventEnd")) / 1e3]
    for state in states:
        page.wait_for_selector(state, state="attached", timeout=120_000)
        found.append(float(page.evaluate("() => performance.now()")) / 1e3)
    context.close()
    return found


def main() -> None:
    """Print size and times."""
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        path, empty = Path(folder, "report.html"), Path(folder, "empty.html")
        write_page(Report("Long", (made_thread(TURNS),)), path)
        empty.write_text("<!DOCTYPE html><title>empty</title>", encoding="utf-8")
        print(f"report of {TURNS} turns: {path.stat().st_size / 1e6:.2f} MB")
        bare = min(opening(browser, empty, ())[0] for _ in range(REPEATS))
        found = [opening(browser, path, ("html[data-drawn]", "html[data-drawn=all]")) for _ in range(REPEATS)]
        loaded, first, last = (min(one) for one in zip(*found, strict=True))
        print(f"empty page {bare:.2f} s; loaded {loaded:.2f} s, first charts {first:.2f} s, all charts {last:.2f} s")


if __name__ == "__main__":
    main()
