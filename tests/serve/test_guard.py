"""Who is let in: hosts, origins, the token; and what the pages answer without a browser."""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.serve.conftest import HOSTILE, PARTS, Stored, part
from threadpitch.runs.study import study_run
from threadpitch.serve.guard import COOKIE, Access
from threadpitch.serve.server import application
from threadpitch.store import open_store
from threadpitch.studies import Place, study

TOKEN = "0123456789abcdef"
BASE = "http://127.0.0.1:8765"
OWN = {"Origin": BASE}


class Client:
    """Asks the application, in this process, without following where it leads."""

    def __init__(self, stored: Stored) -> None:
        self._app = application(stored.store, Access(TOKEN, 8765))
        self.cookies: dict[str, str] = {}

    def request(self, method: str, path: str, **words: Any) -> httpx.Response:
        async def asked() -> httpx.Response:
            transport = httpx.ASGITransport(app=self._app)
            async with httpx.AsyncClient(transport=transport, base_url=BASE, cookies=self.cookies) as client:
                return await client.request(method, path, **words)

        with ThreadPoolExecutor(1) as thread:  # the browser of other tests keeps an event loop in this one
            return thread.submit(asyncio.run, asked()).result()

    def get(self, path: str, **words: Any) -> httpx.Response:
        return self.request("GET", path, **words)

    def post(self, path: str, **words: Any) -> httpx.Response:
        return self.request("POST", path, **words)


@pytest.fixture
def client(stored: Stored) -> Client:
    return Client(stored)


@pytest.mark.parametrize("host", [
    "evil.example", "127.0.0.1", "127.0.0.1:80", "127.0.0.1.evil.example:8765", "", "[::1]:1"])
def test_other_hosts_are_refused(client: Client, host: str) -> None:
    answer = client.get("/", headers={"Host": host})
    assert answer.status_code == 403
    assert "localhost and 127.0.0.1 only" in answer.text


@pytest.mark.parametrize("host", ["127.0.0.1:8765", "localhost:8765", "LOCALHOST:8765", "[::1]:8765"])
def test_own_names_are_answered(client: Client, host: str) -> None:
    assert client.get("/", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:9999", "https://127.0.0.1:8765"])
def test_pages_of_other_sites_are_refused_even_with_the_token(client: Client, stored: Stored, origin: str) -> None:
    client.cookies[COOKIE] = TOKEN
    assert client.get("/", headers={"Origin": origin}).status_code == 403
    answer = client.post(f"/run/{stored.simulation}/note", data={"note": "x"}, headers={"Origin": origin})
    assert answer.status_code == 403
    assert stored.store.run(stored.simulation).summary.note == "a simulation"


@pytest.mark.parametrize("given", [None, "", "wrong", TOKEN[:-1], TOKEN + "0", "Ω"])
def test_changes_need_the_token(client: Client, stored: Stored, given: str | None) -> None:
    headers = dict(OWN) if given is None else {**OWN, "Authorization": f"Bearer {given}".encode()}
    for path, form in ((f"/run/{stored.simulation}/note", {"note": "x"}),
                       (f"/run/{stored.simulation}/delete", {"confirm": str(stored.simulation)})):
        assert client.post(path, data=form, headers=headers).status_code == 403
    assert stored.store.run(stored.simulation).summary.note == "a simulation"


def test_reading_never_changes(client: Client, stored: Stored) -> None:
    client.cookies[COOKIE] = TOKEN
    for path in ("note", "delete"):
        assert client.get(f"/run/{stored.simulation}/{path}").status_code == 405
    for method in ("PUT", "PATCH", "DELETE", "OPTIONS"):
        assert client.request(method, "/", headers=OWN).status_code == 405


def test_the_address_with_the_token_leaves_a_strict_cookie(client: Client) -> None:
    answer = client.get(f"/?token={TOKEN}")
    assert answer.status_code == 303
    assert answer.headers["location"] == "/"
    cookie = answer.headers["set-cookie"].lower()
    assert all(word in cookie for word in ("httponly", "samesite=strict", "path=/"))
    assert client.get("/?token=wrong").status_code == 403


def test_note_and_deletion_with_the_token(client: Client, stored: Stored) -> None:
    number = stored.store.add(part(99))
    client.cookies[COOKIE] = TOKEN
    assert client.post(f"/run/{number}/note", data={"note": "new <i>"}, headers=OWN).status_code == 303
    assert stored.store.run(number).summary.note == "new <i>"
    assert client.post(f"/run/{number}/note", data={"note": "x" * 70_000}, headers=OWN).status_code == 413
    assert client.post(f"/run/{number}/delete", data={"confirm": "1"}, headers=OWN).status_code == 400
    assert client.post(f"/run/{number}/delete", data={"confirm": str(number)}, headers=OWN).status_code == 303
    assert client.get(f"/run/{number}").status_code == 404


def test_every_answer_has_the_headers_of_a_careful_server(client: Client) -> None:
    for path in ("/", "/nosuch", "/live", "/static/page.js"):
        headers = client.get(path).headers
        assert "script-src 'self'" in headers["content-security-policy"]
        assert "frame-ancestors 'none'" in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert "access-control-allow-origin" not in headers


@pytest.mark.parametrize(("path", "status", "message"), [
    ("/run/999", 404, "run 999 is not in the store"), ("/compare", 400, "0 runs are chosen; choose 1 to 8"),
    ("/compare?run=1&run=x", 400, "no number from 1 on"), ("/?page=0", 400, "no number from 1 on"),
    ("/?since=tomorrow", 400, "write it like 2026-01-31"), ("/nosuch", 404, ""), ("/run/..%2f..%2fetc", 404, ""),
    ("/static/..%2fguard.py", 404, ""), ("/static/report.html", 404, "no such script"),
    ("/control?limits=sigma", 200, "limits &#39;sigma&#39; are not known"),
    ("/control?calculator=nosuch", 200, "0 parts with two turns or more"),
])
def test_what_cannot_be_shown_is_told(client: Client, path: str, status: int, message: str) -> None:
    answer = client.get(path)
    assert answer.status_code == status
    assert message in answer.text


def test_filters_choose_runs_and_hostile_ones_choose_none(client: Client, stored: Stored) -> None:
    assert f"{PARTS} runs" in client.get("/", params={"machine": "Lathe 2"}).text
    assert "1 run<" in client.get("/", params={"text": "sim1"}).text
    assert "0 runs" in client.get("/", params={"machine": "' OR 1=1 --"}).text
    assert "0 runs" in client.get("/", params={"until": "2000-01-01"}).text
    text = client.get("/").text
    assert HOSTILE not in text
    assert "&lt;img src=x onerror=window.hacked=1&gt;" in text
    assert stored.store.count() >= PARTS + 2


def test_a_stored_study_is_shown(tmp_path: Path) -> None:
    """Its sentences and tables, as ``store show`` prints them; what an older version kept is told."""
    document = {"study": {"system": "none", "name": "<b>lengths</b>"}, "parameters": {"a": ["1mm", "2mm"]},
                "outcomes": {"y": "a"}, "limits": {"y": "1.5mm"}}
    kept = study_run(study(document, output=tmp_path / "study", place=Place(workers=0)), "lengths.toml")
    pages = []
    for name, run in (("runs", kept), ("older", replace(kept, provenance={}))):
        with open_store(str(tmp_path / f"{name}.db")) as store:
            pages.append(Client(Stored(store, "", 0, 0)).get(f"/run/{store.add(run)}"))
    assert [page.status_code for page in pages] == [200, 200]
    assert "Within all limits: 50.00 % of 2 rows" in pages[0].text
    assert "<td>y &lt;= 1.5 mm</td><td>50.00 %</td>" in pages[0].text
    assert "<b>lengths" not in pages[0].text
    assert "Nothing of this study" in pages[1].text
