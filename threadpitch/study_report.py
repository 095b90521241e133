"""A study in words and tables: what came out, the yield with its interval, where it is best, what matters.

Terminal, page, paper and store show the same tables, which are made of the study's JSON document.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from threadpitch.studies import Estimate, StudyResult
from threadpitch.studies.analysis import ALL
from threadpitch.tables import MISSING, printable
from threadpitch.units import from_si

Document = Mapping[str, Any]  # what ``studies.analysis_document`` makes

_MOST_REASONS = 5
_MEGABYTE = 1e6
_LEFT = {"outcome", "parameter", "word", "within limit"}  # columns of names
_PIPE_WIDTH = 120  # characters where nobody's window sets them


@dataclass(frozen=True)
class StudyTable:
    """A table as people read it: a heading, the names of the columns, rows of text."""

    heading: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def show_study(console: Console, result: StudyResult) -> None:
    """Print what a study came to."""
    found, rows = result.analysis, len(result.study.rows)
    console.print(Text(f"Study {printable(result.study.name)}: {found.rows} of {rows} rows"
                       + (f", {found.failed} of them failed" if found.failed else ""), style="bold"))
    for line in reasons(result):
        print(f"  {line}")
    show_tables(console, result.document)


def show_tables(console: Console, document: Document) -> None:
    """Print the tables and sentences of a study's document; in a pipe as wide as they are."""
    if not console.is_terminal:
        console = Console(file=console.file, width=max(console.width, _PIPE_WIDTH))
    for one in study_tables(document):
        console.print(Text(one.heading, style="bold"))
        made = Table(box=box.SIMPLE_HEAD if console.is_terminal else box.ASCII2, padding=(0, 0))
        for column in one.columns:
            made.add_column(Text(column), justify="left" if column in _LEFT else "right", overflow="fold")
        for row in one.rows:
            made.add_row(*map(Text, row))
        console.print(made)
    for line in sentences(document):
        print(line)


def sentences(document: Document) -> list[str]:
    """The answer in words: how many are within all limits, how sure that is, on what it depends most."""
    share = document["yields"].get(ALL)
    if share is None:
        return []
    found = [f"Within all limits: {_percent(share['value'])} of {_rows(document['rows'])}"
             + (f"; {document['confidence']:.0%} confidence interval {_interval(share, percent=True)}."
                if share["low"] is not None else ", no random sample: no confidence interval.")]
    spreads = {number: max(shares) - min(shares) for number, one in enumerate(document["yield_responses"])
               if (shares := [here["value"] for here in one["yields"]])}
    if spreads and max(spreads.values()) > 0.0:
        one = document["yield_responses"][max(spreads, key=lambda number: spreads[number])]
        best, worst = (choose(range(len(one["yields"])), key=lambda place: one["yields"][place]["value"])
                       for choose in (max, min))
        found.append(f"It depends most on {printable(one['parameter'])}: " + ", ".join(
            f"{_percent(one['yields'][place]['value'])} at {_ends(one['ends'][place])}"
            + ("" if one["unit"] in (None, "1") else f" {one['unit']}") for place in (worst, best)) + ".")
    return found


def study_tables(document: Document) -> list[StudyTable]:
    """Outcomes, words, yields, where the yield is best, main effects, Sobol indices; none that would be empty."""
    found = [_outcomes(document), _words(document), _yields(document), *map(_yields_by, _telling(document)),
             *_effects(document), _indices(document)]
    return [_without_empty(one) for one in found if one.rows]


def _telling(document: Document) -> list[Document]:
    """The parameters that the yield goes with."""
    return [one for one in document["yield_responses"] if len({share["value"] for share in one["yields"]}) > 1]


def _without_empty(table: StudyTable) -> StudyTable:
    """Without the columns in which nothing stands."""
    kept = [place for place in range(len(table.columns)) if any(row[place] for row in table.rows)]
    return StudyTable(table.heading, tuple(table.columns[place] for place in kept),
                      tuple(tuple(row[place] for place in kept) for row in table.rows))


def reasons(result: StudyResult) -> Iterator[str]:
    """Why rows failed: every reason once, with how often it came and the first row."""
    rows: dict[str, list[int]] = {}
    for row, status, reason in zip(*(result.table[name].to_pylist() for name in ("row", "status", "reason")),
                                   strict=True):
        if status == "failed":
            rows.setdefault(reason, []).append(row)
    for reason, failed in list(rows.items())[:_MOST_REASONS]:
        yield f"row {failed[0]}{f' and {len(failed) - 1} more' if failed[1:] else ''}: {printable(reason)}"
    if len(rows) > _MOST_REASONS:
        yield f"and {len(rows) - _MOST_REASONS} other reasons, in the column 'reason' of the table"


def estimate_text(found: Estimate) -> str:
    """What a study would take, in lines."""
    return "\n".join([
        f"{found.rows} rows, {found.missing} of them to be computed",
        f"{found.row_time * 1e3:.3g} ms a row, {duration(found.wall_time)} with {found.workers} workers",
        f"{found.disk / _MEGABYTE:.3g} MB on the disk at most",
    ])


def duration(seconds: float) -> str:
    """A time as people say it."""
    if seconds < 90.0:
        return f"{seconds:.3g} s"
    minutes = seconds / 60.0
    return f"{minutes:.3g} min" if minutes < 90.0 else f"{minutes / 60.0:.3g} h"


def named(name: str, unit: str | None) -> str:
    """A name with its unit, ``lag [mm]``."""
    return printable(name) if unit in (None, "1") else f"{printable(name)} [{unit}]"


def _outcomes(document: Document) -> StudyTable:
    numeric = {name: one for name, one in document["outcomes"].items() if "words" not in one}
    infinite = any(one["infinite"] for one in numeric.values())
    rows = [(named(name, one["unit"]), *(_number(one[key]) for key in ("min", "mean", "max")),
             "" if one["limit"] is None else _number(one["limit"]), *([str(one["infinite"])] if infinite else []))
            for name, one in numeric.items()]
    columns = ("outcome", "min", "mean", "max", "limit", *(["infinite rows"] if infinite else []))
    return StudyTable("Outcomes", columns, tuple(rows))


def _words(document: Document) -> StudyTable:
    rows = [(printable(name), printable(word), str(count), _percent(count / document["rows"]))
            for name, one in document["outcomes"].items() for word, count in one.get("words", {}).items()]
    return StudyTable("Outcomes in words", ("outcome", "word", "rows", "share"), tuple(rows))


def _yields(document: Document) -> StudyTable:
    rows = []
    for name, one in document["yields"].items():
        outcome = document["outcomes"].get(name, {})
        unit = outcome.get("unit")
        limit = "all limits" if name == ALL else f"{name} <= {_number(outcome.get('limit'))}" + (
            "" if unit in (None, "1") else f" {unit}")
        rows.append((limit, _percent(one["value"]), _interval(one, percent=True)))
    return StudyTable("Yield", ("within limit", "yield", f"{document['confidence']:.0%} interval"), tuple(rows))


def _yields_by(one: Document) -> StudyTable:
    rows = [(_ends(ends), str(rows), _percent(share["value"]), _interval(share, percent=True))
            for ends, rows, share in zip(one["ends"], one["rows"], one["yields"], strict=True)]
    return StudyTable(f"Yield within all limits over {printable(one['parameter'])}",
                      (named(one["parameter"], one["unit"]), "rows", "yield", "interval"), tuple(rows))


def _effects(document: Document) -> Iterator[StudyTable]:
    """For every outcome that varies: where its mean is least and greatest, and how much each parameter explains."""
    for name, outcome in document["outcomes"].items():
        found = [one for one in document["responses"] if one["outcome"] == name]
        if not any(max(one["mean"], default=0.0) > min(one["mean"], default=0.0) for one in found):
            continue
        units = document["parameters"]
        ordered = sorted(found, key=lambda one: -_spread(one["mean"]) if one["share"] is None else -one["share"])
        yield StudyTable(f"Main effects on {named(name, outcome['unit'])}", (
            "parameter", "least mean", "greatest mean", "share of variance", "rank correlation"), tuple(
                (named(one["parameter"], units[one["parameter"]]["unit"]), _mean_at(one, min), _mean_at(one, max),
                 "" if one["share"] is None else _percent(one["share"]),
                 "" if one["rank_correlation"] is None else f"{one['rank_correlation']:+.2f}") for one in ordered))


def _spread(values: Sequence[float]) -> float:
    return max(values) - min(values)


def _mean_at(one: Document, choose: Any) -> str:
    """``2.47 at 76.3``: the least or greatest mean, and the place of the parameter where it is."""
    place = choose(range(len(one["mean"])), key=lambda place: one["mean"][place])
    return f"{_number(one['mean'][place])} at {_place(one['places'][place])}"


def _indices(document: Document) -> StudyTable:
    rows = [(printable(found["outcome"]), printable(name), f"{one['first']['value']:.3f}", _interval(one["first"]),
             f"{one['total']['value']:.3f}", _interval(one["total"]))
            for found in document["sobol_indices"] for name, one in found["parameters"].items()]
    interval = f"{document['confidence']:.0%} interval"
    return StudyTable("Sobol indices", ("outcome", "parameter", "first order", interval, "total", interval),
                      tuple(rows))


def _ends(ends: Sequence[Any]) -> str:
    return _place(ends[0]) if ends[0] == ends[1] else f"{_place(ends[0])} to {_place(ends[1])}"


def _place(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else printable(str(value))


def _interval(one: Document, *, percent: bool = False) -> str:
    if one["low"] is None:
        return ""
    if percent:
        return f"{from_si(one['low'], '%'):.2f} to {from_si(one['high'], '%'):.2f} %"
    return f"{one['low']:.3f} to {one['high']:.3f}"


def _rows(count: int) -> str:
    return "1 row" if count == 1 else f"{count} rows"


def _percent(share: float) -> str:
    return f"{from_si(share, '%'):.2f} %"


def _number(value: float | None) -> str:
    return MISSING if value is None else f"{value:.5g}"
