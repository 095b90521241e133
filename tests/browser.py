"""Pages in a real browser: what they say on the console, what they ask of the network, whether they are drawn."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or ""


@dataclass
class Visit:
    """A page that is open, and what was heard from it."""

    page: Page
    complaints: list[str] = field(default_factory=list)  # errors and warnings on the console, exceptions
    requests: list[str] = field(default_factory=list)


@contextmanager
def chromium() -> Iterator[Browser]:
    """Debian's Chromium, for the tests of one session."""
    sync = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if not CHROMIUM:
        pytest.skip("chromium is not installed; Debian: apt-get install chromium")
    with sync.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@contextmanager
def visit(browser: Browser, address: str, *, width: int = 1200, offline: bool = False) -> Iterator[Visit]:
    """The page at this address, opened and drawn."""
    context = browser.new_context(viewport={"width": width, "height": 900}, offline=offline)
    seen = Visit(context.new_page())
    seen.page.on("console", lambda message: seen.complaints.append(message.text)
                 if message.type in ("error", "warning") else None)
    seen.page.on("pageerror", lambda error: seen.complaints.append(f"{error}"))
    seen.page.on("request", lambda request: seen.requests.append(request.url))
    seen.page.goto(address)
    try:
        yield seen
    finally:
        context.close()


def wait_until_drawn(page: Page) -> None:
    """All charts are on the page."""
    page.wait_for_selector("html[data-drawn=all]", state="attached", timeout=60_000)
