"""The control chart of the parts that a filter chooses, drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from bokeh.models import BasicTicker

from threadpitch.control_chart import BETWEEN, Chart, ControlCharts, Part, control_charts
from threadpitch.report.curves import Curve
from threadpitch.report.drawing import Chart as Drawing
from threadpitch.report.drawing import Plot, Words
from threadpitch.report.series import Style, shown
from threadpitch.store import RunSummary
from threadpitch.store.records import REAL_THREAD
from threadpitch.units import from_si

_RED = "#b00020"


@dataclass(frozen=True)
class PartRow:
    """A part in words; lengths in mm and um."""

    number: int  # of the run
    place: int  # in the chart, from 1
    name: str
    turns: int
    mean_mm: str
    spread_um: str
    outside: str  # what is beyond its limits


def parts_of(runs: Sequence[RunSummary], calculator: str) -> list[tuple[RunSummary, Part]]:
    """Every run's last series by this calculator, of its first start angle; oldest first."""
    found = []
    for run in sorted(runs, key=lambda one: (one.recorded_at, one.number)):
        series = run.series_of(calculator)
        if series is not None:
            one = series.best
            name = run.serial_number or f"run {run.number}"
            found.append((run, Part(name, one.turns, one.mean, one.standard_deviation)))
    return found


def calculators(runs: Sequence[RunSummary]) -> list[str]:
    """What the runs have pitches of, those of the real thread first."""
    names = dict.fromkeys(one.calculator for run in runs for one in run.series)
    return sorted(names, key=lambda name: (name not in REAL_THREAD, name))


def made_charts(parts: Sequence[tuple[RunSummary, Part]], limits: str) -> tuple[list[Drawing], list[PartRow]]:
    """The two charts, and their values as a table.

    Raises:
        ControlChartError: too few parts, or limits of no known kind.
    """
    found = control_charts([part for _, part in parts], limits)
    numbers = [run.number for run, part in parts if part in found.parts]
    spread = "Moving range of the mean" if limits == BETWEEN else "Spread of P(n) in a part"
    drawings = [_drawn(found.mean, "mean", "Mean P(n) of every part", "mean P(n) [mm]", "mm"),
                _drawn(found.spread, "spread", spread, "spread [um]", "um")]
    return drawings, [_row(found, place, number) for place, number in enumerate(numbers)]


def _drawn(chart: Chart, name: str, title: str, label: str, unit: str) -> Drawing:
    plot = Plot("part", label)
    plot.figure.xaxis.ticker = BasicTicker(min_interval=1)
    place = np.arange(1.0, chart.values.size + 1.0)
    factor = from_si(1.0, unit)
    plot.marked("parts", Style.of(0), Curve(place, factor * chart.values))
    for bound, values, dash in (("centre", chart.centre, ()), ("lower limit", chart.lower, (8, 4)),
                                ("upper limit", chart.upper, (8, 4))):
        plot.line(bound, Style("#000000" if bound == "centre" else _RED, dash, "dash", ""),
                  Curve(place, factor * values))
        plot.see(factor * values)
    plot.see_all(factor * chart.values)  # a part far beyond its limits is what the chart is looked at for
    outside = chart.outside
    if outside:
        plot.marks("beyond a limit", Style(_RED, (), "x", "×"),
                   Curve(place[outside], factor * chart.values[outside]))
    told = ", ".join(str(one + 1) for one in outside) or "none"
    text = f"Parts in the order of their making; solid: centre, dashed: limits of three sigma. Beyond: {told}."
    return plot.chart(Words(name, title, text, ""))


def _row(found: ControlCharts, place: int, number: int) -> PartRow:
    part = found.parts[place]
    beyond = [name for name, chart in (("mean", found.mean), ("spread", found.spread)) if place in chart.outside]
    return PartRow(number, place + 1, shown(part.name), part.turns, f"{from_si(part.mean, 'mm'):.5f}",
                   f"{from_si(part.spread, 'um'):.3f}", " and ".join(beyond) or "-")
