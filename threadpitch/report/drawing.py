"""A chart of a page while it is drawn: axes, curves with their styles, and what its legend says."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from bokeh.models import CrosshairTool, HoverTool, Model, Range1d, Span
from bokeh.plotting import figure
from numpy.typing import NDArray

from threadpitch.pitch import usual
from threadpitch.report.curves import Curve
from threadpitch.report.series import Style
from threadpitch.trace import FloatArray

CURSOR = "cursor"  # name of the line that all charts over the turn share
HEIGHT = 320  # px
TOOLS = "pan,box_zoom,wheel_zoom,reset,save"
_MOST_MARKERS = 60  # of one curve; every turn has its value, not every one a marker
_MARGIN = 0.08  # of the range of the values


@dataclass(frozen=True, eq=False)
class Chart:
    """One drawing with what it is about; without a figure the note tells why."""

    name: str  # of its place in the page
    title: str
    text: str  # what is seen in it, for those who do not see it too
    figure: figure | None
    legend: tuple[tuple[str, Style], ...] = ()
    note: str = ""
    shares_turns: bool = False  # range and cursor with all other charts over the turn


@dataclass(frozen=True)
class Words:
    """What is said of a chart."""

    name: str
    title: str
    text: str
    missing: str  # why it is not drawn, where it is not


@dataclass(eq=False)
class TurnAxes:
    """What the charts over the turn share: range and cursor."""

    turns: Range1d
    cursor: Span = field(default_factory=lambda: Span(dimension="height", line_dash="dotted", line_width=1,
                                                      line_color="#444444", name=CURSOR))


class Plot:
    """A figure with curves; over the turn where it is given the axes that those charts share."""

    def __init__(self, x: str, y: str, axes: TurnAxes | None = None) -> None:
        shared = {} if axes is None else {"x_range": axes.turns}
        self.figure = figure(height=HEIGHT, sizing_mode="stretch_width", tools=TOOLS, active_scroll=None,
                             x_axis_label=x, y_axis_label=y, **shared)
        level = Span(dimension="width", line_dash="dotted", line_width=1, line_color="#444444")
        upright = Span(dimension="height", line_dash="dotted", line_width=1, line_color="#444444")
        self.figure.add_tools(
            HoverTool(tooltips=[("", "$name"), (x, "$snap_x{0.[000]}"), (y, "$snap_y{0.[00000]}")], visible=False),
            CrosshairTool(overlay=[upright if axes is None else axes.cursor, level], visible=False))
        self._shares_turns = axes is not None
        self._legend: dict[str, Style] = {}
        self._seen: list[FloatArray] = []  # values that the range is made for
        self._levels: list[float] = []  # that are in the range whatever the values are

    def line(self, name: str, style: Style, curve: Curve) -> None:
        """A curve; NaN is a gap."""
        self._legend[name] = style
        self.figure.line(_single(curve.x), _single(curve.y), name=name, line_color=style.colour,
                         line_dash=list(style.dash), line_width=1.4)

    def marked(self, name: str, style: Style, curve: Curve) -> None:
        """A curve of single values: with markers, of many values not at every one."""
        self.line(name, style, curve)
        every = max(1, math.ceil(curve.x.size / _MOST_MARKERS))
        self.marks(name, style, Curve(curve.x[::every], curve.y[::every]))

    def marks(self, name: str, style: Style, curve: Curve) -> None:
        """Markers alone."""
        self._legend[name] = style
        self.figure.scatter(_single(curve.x), _single(curve.y), name=name, marker=style.marker, size=6,
                            line_color=style.colour, fill_color=None)

    def level(self, value: float, colour: str, dash: Sequence[int] = ()) -> None:
        """A line at this height."""
        self.figure.add_layout(Span(location=value, dimension="width", line_color=colour, line_dash=list(dash)))
        self._levels.append(value)

    def upright(self, value: float, colour: str) -> None:
        """A dashed line at this place."""
        self.figure.add_layout(Span(location=value, dimension="height", line_color=colour, line_dash="dashed"))

    def see(self, values: FloatArray) -> None:
        """Values of one curve for which the range is made, but for those far outside; zooming out shows them.

        What is far outside is told by the curve's own values: a steady curve beside it does not cut it off.
        """
        known = values[~np.isnan(values)]
        self._seen.append(known[usual(known)])

    def see_all(self, values: FloatArray) -> None:
        """Values that are in the range however far outside they are."""
        self._levels.extend(values[~np.isnan(values)].tolist())

    def chart(self, words: Words) -> Chart:
        """What was drawn, or that there was nothing to draw."""
        if not self._legend:
            return Chart(words.name, words.title, words.text, None, note=words.missing)
        near = np.concatenate(self._seen) if self._seen else np.zeros(0)
        if near.size:
            low, high = min([float(near.min()), *self._levels]), max([float(near.max()), *self._levels])
            margin = _MARGIN * (high - low) or max(1e-6, 1e-6 * abs(high))
            self.figure.y_range = Range1d(low - margin, high + margin)
        return Chart(words.name, words.title, words.text, quiet(self.figure), tuple(self._legend.items()),
                     shares_turns=self._shares_turns)


def _single(values: FloatArray) -> NDArray[np.float32]:
    """Half the size of the page, and finer than any screen: 0.1 nm of 1.5 mm."""
    return values.astype(np.float32)


def quiet(made: figure) -> figure:
    """Without the sign of the library."""
    made.toolbar.logo = None
    return made


def documents(charts: Sequence[Chart]) -> list[dict[str, object]]:
    """What the page's script draws: first the charts that share their turns, then every other one by itself.

    Each is ``{"document": Bokeh's JSON, "roots": {model: element of the page}}``.
    """
    drawn = [chart for chart in charts if chart.figure is not None]
    together = [chart for chart in drawn if chart.shares_turns]
    alone = [[chart] for chart in drawn if not chart.shares_turns]
    return [_document(group) for group in ([together] if together else []) + alone]


def _document(group: Sequence[Chart]) -> dict[str, object]:
    from bokeh.document import Document

    document = Document(title="threadpitch")
    roots = {}
    for chart in group:
        root: Model = chart.figure
        document.add_root(root)
        roots[root.id] = f"chart-{chart.name}"
    return {"document": document.to_json(deferred=False), "roots": roots}
