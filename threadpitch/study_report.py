"""A study in words: what came out, the yield with its interval, which parameters matter."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from threadpitch.studies import Estimate, Interval, StudyResult
from threadpitch.studies.analysis import CONFIDENCE
from threadpitch.tables import printable
from threadpitch.units import from_si

_MOST_REASONS = 5
_MEGABYTE = 1e6


def show_study(console: Console, result: StudyResult) -> None:
    """Print what a study came to."""
    found, rows = result.analysis, len(result.study.rows)
    console.print(Text(f"Study {printable(result.study.name)}: {found.rows} of {rows} rows"
                       + (f", {found.failed} of them failed" if found.failed else ""), style="bold"))
    for line in _reasons(result):
        console.print(Text(line))
    for table in (_outcomes(console, result), _yields(console, result), _effects(console, result),
                  _indices(console, result)):
        if table is not None:
            console.print(table)


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


def _reasons(result: StudyResult) -> Iterator[str]:
    """Why rows failed: every reason once, with how often it came and the first row."""
    rows: dict[str, list[int]] = {}
    for row, status, reason in zip(*(result.table[name].to_pylist() for name in ("row", "status", "reason")),
                                   strict=True):
        if status == "failed":
            rows.setdefault(reason, []).append(row)
    for reason, failed in list(rows.items())[:_MOST_REASONS]:
        yield f"  row {failed[0]}{f' and {len(failed) - 1} more' if failed[1:] else ''}: {printable(reason)}"
    if len(rows) > _MOST_REASONS:
        yield f"  and {len(rows) - _MOST_REASONS} other reasons, in the column 'reason' of the table"


def _outcomes(console: Console, result: StudyResult) -> Table | None:
    made = _table(console, "outcome (SI)", "min", "mean", "max", "limit")
    for name, values in result.analysis.outcomes.items():
        limit = result.study.limits.get(name)
        made.add_row(name, *map(_number, values), "" if limit is None else _number(limit))
    return made if made.row_count else None


def _yields(console: Console, result: StudyResult) -> Table | None:
    made = _table(console, "within limit", "yield", f"{CONFIDENCE:.0%} interval")
    for name, one in result.analysis.yields.items():
        made.add_row("all limits" if name == "all" else name, f"{from_si(one.value, '%'):.2f} %", _interval(one, "%"))
    return made if made.row_count else None


def _effects(console: Console, result: StudyResult) -> Table | None:
    made = _table(console, "main effect on", "of", "share of variance", "rank correlation")
    for one in sorted(result.analysis.responses, key=lambda one: (one.outcome, -one.share)):
        rank = "" if math.isnan(one.rank) else f"{one.rank:+.2f}"
        made.add_row(one.outcome, one.parameter, f"{from_si(one.share, '%'):.1f} %", rank)
    return made if made.row_count else None


def _indices(console: Console, result: StudyResult) -> Table | None:
    made = _table(console, "Sobol indices of", "parameter", "first order", "interval", "total", "interval")
    for one in result.analysis.indices:
        for parameter, first, total in zip(one.parameters, one.first, one.total, strict=True):
            made.add_row(one.outcome, parameter, f"{first.value:.3f}", _interval(first), f"{total.value:.3f}",
                         _interval(total))
    return made if made.row_count else None


def _table(console: Console, first: str, *others: str) -> Table:
    made = Table(box=box.SIMPLE_HEAD if console.is_terminal else box.ASCII2)
    made.add_column(Text(first), no_wrap=True)
    for heading in others:
        named = heading in ("of", "parameter")
        made.add_column(Text(heading), justify="left" if named else "right", overflow="fold", min_width=22 * named)
    return made


def _interval(one: Interval, unit: str = "1") -> str:
    if math.isnan(one.low):
        return ""
    low, high = (from_si(value, unit) for value in (one.low, one.high))
    return f"{low:.2f} to {high:.2f}" if unit == "%" else f"{low:.3f} to {high:.3f}"


def _number(value: Any) -> str:
    return f"{value:.5g}"
