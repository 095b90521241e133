"""The pages of the server: what they are asked for, and what they show."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from urllib.parse import parse_qs, urlencode

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response, StreamingResponse

from threadpitch.control_chart import BETWEEN, WITHIN, ControlChartError
from threadpitch.report import page as report_page
from threadpitch.report.content import Report, ReportError
from threadpitch.report.drawing import documents
from threadpitch.report.page import Scripts, json_for_script
from threadpitch.report.stored_run import run_name, stored_threads
from threadpitch.runs.study import STUDY
from threadpitch.serve.control_page import calculators, made_charts, parts_of
from threadpitch.serve.guard import Access, with_token
from threadpitch.serve.live import event_stream
from threadpitch.serve.live_chart import live_chart
from threadpitch.serve.rows import run_row
from threadpitch.store import RunFilter, Store, StoreError
from threadpitch.study_report import sentences, study_tables

PAGE_SIZE = 50  # runs of a list
MOST_COMPARED = 8
MOST_PARTS = 1000  # of a control chart
_LARGEST_FORM = 65_536  # bytes
_CHOICES = ("machine", "program", "thread", "cause", "kind")
_SCRIPTS = Scripts(addresses=("/static/bokeh.js", "/static/page.js"))
_LIVE_SCRIPTS = Scripts(addresses=("/static/bokeh.js", "/static/page.js", "/static/live.js"))
_HERE = Path(__file__).parent / "templates"


class Pages:
    """Answers of the server; what reads the store runs beside the loop that serves."""

    def __init__(self, store: Store, access: Access) -> None:
        self._store, self._access = store, access
        self._templates = Environment(loader=FileSystemLoader([_HERE, report_page.TEMPLATES]), autoescape=True,
                                      undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)

    def runs(self, request: Request) -> Response:
        """The stored runs that a filter leaves, newest first."""
        if "token" in request.query_params:
            if not self._access.is_token(request.query_params["token"]):
                raise HTTPException(403, "the token is not that of this server")
            return with_token(RedirectResponse("/", status_code=303), self._access)
        asked = dict(request.query_params)
        number = _whole(asked.get("page", "1"), "page")
        wanted = _filter(asked, PAGE_SIZE, (number - 1) * PAGE_SIZE)
        count = self._store.count(wanted)
        return self._page("runs.html", "Stored runs", rows=[run_row(one) for one in self._store.runs(wanted)],
                          count=count, pages=-(-count // PAGE_SIZE), number=number, **self._filter_words(asked))

    def run(self, request: Request) -> Response:
        """The report of a run; of a study what its rows came to."""
        run = self._store.run(request.path_params["number"])
        bar = self._render("run_bar.html", run=run_row(run.summary), trusted=self._trusted(request))
        if run.summary.kind == STUDY:
            analysis = run.provenance.get("analysis", {})
            told = "yield_responses" in analysis  # else it was kept by an older version, which told less
            return self._page("study.html", run_name(run), bar=bar, sentences=sentences(analysis) if told else [],
                              tables=study_tables(analysis) if told else [])
        return HTMLResponse(report_page.page(Report(run_name(run), tuple(stored_threads(run))), _SCRIPTS,
                                             self._navigation() + bar))

    def compare(self, request: Request) -> Response:
        """Several runs over one another."""
        numbers = list(dict.fromkeys(_whole(text, "run") for text in request.query_params.getlist("run")))
        if not 1 <= len(numbers) <= MOST_COMPARED:
            raise HTTPException(400, f"{len(numbers)} runs are chosen; choose 1 to {MOST_COMPARED} of the list")
        threads = [thread for number in numbers for thread in stored_threads(self._store.run(number))]
        title = "Runs " + ", ".join(str(number) for number in numbers)
        return HTMLResponse(report_page.page(Report(title, tuple(threads)), _SCRIPTS, self._navigation()))

    def control(self, request: Request) -> Response:
        """Control chart of the mean and the spread of P(n) over the parts that a filter leaves."""
        asked = dict(request.query_params)
        runs = self._store.runs(_filter(asked, MOST_PARTS, 0))
        known = calculators(runs)
        calculator = asked.get("calculator") or (known[0] if known else "")
        limits = asked.get("limits") or WITHIN
        note = ""
        try:
            drawings, rows = made_charts(parts_of(runs, calculator), limits)
        except ControlChartError as error:
            drawings, rows, note = [], [], str(error)
        return self._page("control.html", "Control chart", charts=drawings, rows=rows, note=note,
                          document=json_for_script(documents(drawings)), scripts=_SCRIPTS,
                          calculators=known, calculator=calculator, limits=limits, kinds=(WITHIN, BETWEEN),
                          **self._filter_words(asked))

    def live(self, request: Request) -> Response:
        """Revolutions as a simulation or ``watch`` runs."""
        chart = live_chart()
        return self._page("live.html", "Live", charts=[chart], document=json_for_script(documents([chart])),
                          scripts=_LIVE_SCRIPTS)

    async def events(self, request: Request) -> Response:
        """The events of the live page."""
        return StreamingResponse(event_stream(self._store, request), media_type="text/event-stream",
                                 headers={"Cache-Control": "no-store"})

    async def note(self, request: Request) -> Response:
        """Change the operator's note of a run."""
        form = await _form(request)
        number = request.path_params["number"]
        await run_in_threadpool(self._store.set_note, number, form.get("note", ""))
        return RedirectResponse(f"/run/{number}", status_code=303)

    async def delete(self, request: Request) -> Response:
        """Delete a run, when its number was typed to confirm it."""
        number = request.path_params["number"]
        if (await _form(request)).get("confirm", "").strip() != str(number):
            raise HTTPException(400, f"run {number} was not deleted; type its number to confirm")
        await run_in_threadpool(self._store.delete, [number])
        return RedirectResponse("/", status_code=303)

    def script(self, request: Request) -> Response:
        """The scripts of the pages."""
        made: dict[str, Callable[[], str]] = {"bokeh.js": report_page.bokeh_script, "page.js": report_page.page_script,
                                              "live.js": _live_script}
        name = request.path_params["name"]
        if name not in made:
            raise HTTPException(404, "there is no such script")
        return Response(made[name](), media_type="text/javascript", headers={"Cache-Control": "no-cache"})

    def refused(self, request: Request, error: Exception) -> Response:
        """What cannot be shown, and how to mend it."""
        status = error.status_code if isinstance(error, HTTPException) else 404
        text = error.detail if isinstance(error, HTTPException) else str(error)
        response = self._page("refused.html", "This cannot be shown", text=text)
        response.status_code = status
        return response

    def _page(self, template: str, title: str, **content: object) -> HTMLResponse:
        return HTMLResponse(self._render(template, title=title, navigation=self._navigation(),
                                         style=(report_page.TEMPLATES / "page.css").read_text(encoding="utf-8"),
                                         **content))

    def _render(self, template: str, **content: object) -> str:
        return self._templates.get_template(template).render(**content)

    def _navigation(self) -> str:
        return self._render("navigation.html", store=self._store.address)

    def _trusted(self, request: Request) -> bool:
        return self._access.trusted(request.headers, request.cookies)

    def _filter_words(self, asked: Mapping[str, str]) -> dict[str, object]:
        """What the form of the filter shows; ``query`` is the filter for links to other pages of it."""
        known = {name: values for name, values in self._store.choices().items() if name in _CHOICES}
        chosen = {name: asked.get(name, "") for name in ("text", *_CHOICES, "since", "until")}
        given = {name: text for name, text in chosen.items() if text}
        return {"known": known, "asked": chosen, "query": urlencode(given)}


def _filter(asked: Mapping[str, str], limit: int, offset: int) -> RunFilter:
    until = _day(asked.get("until", ""))
    chosen = {name: asked[name] for name in _CHOICES if asked.get(name)}
    return RunFilter(text=asked.get("text", ""), since=_day(asked.get("since", "")),
                     until=None if until is None else until + timedelta(days=1), limit=limit, offset=offset, **chosen)


def _day(text: str) -> datetime | None:
    try:
        return datetime.fromisoformat(text).replace(tzinfo=UTC) if text else None
    except ValueError:
        raise HTTPException(400, f"{text!r} is no day; write it like 2026-01-31") from None


def _whole(text: str, name: str) -> int:
    if not (text.isdecimal() and text.isascii() and 0 < len(text) < 10 and int(text) > 0):
        raise HTTPException(400, f"{name} {text[:20]!r} is no number from 1 on")
    return int(text)


async def _form(request: Request) -> dict[str, str]:
    """The fields of a form that a page of this server sent."""
    body = b""
    async for piece in request.stream():
        body += piece
        if len(body) > _LARGEST_FORM:
            raise HTTPException(413, "the form is too long")
    fields = parse_qs(body.decode("utf-8", errors="replace"), keep_blank_values=True)
    return {name: values[-1] for name, values in fields.items()}


def _live_script() -> str:
    return (_HERE / "live.js").read_text(encoding="utf-8")


KNOWN_ERRORS = (StoreError, ReportError)
