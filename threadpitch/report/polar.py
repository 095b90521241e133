"""Start angles as the seed's Fig. 5 shows them: the workpiece seen along its axis."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from bokeh.models import Range1d
from bokeh.plotting import figure

from threadpitch.report import curves
from threadpitch.report.content import Thread
from threadpitch.report.series import Series, Style
from threadpitch.trace import TURN
from threadpitch.units import from_si

_RAY = 1.25  # length of a start angle's line, the workpiece's radius is 1
_TEXT = 1.6
_EDGE = 2.2  # room for the words beside the rays
_SWING = 0.3  # of the radius, for the largest error within the turn


def draw_polar(made: figure, angles: Sequence[Series], threads: Sequence[tuple[Thread, str, Style]]) -> str:
    """Circle, angle zero, a ray for every start angle, the error within the turn; the length of the radius as text."""
    circle = np.linspace(0.0, TURN, 181)
    made.line(np.cos(circle), np.sin(circle), line_color="#666666", line_width=1.5)
    made.line([0.0, _TEXT], [0.0, 0.0], line_color="#666666", line_dash="dotted", line_width=1.5)
    for one in angles:
        _ray(made, one)
    found = [(curve, name, style) for thread, name, style in threads
             if (curve := curves.mean_within_turn(thread, thread.truest[0])) is not None]
    largest = max((float(np.abs(curve.y).max()) for curve, _, _ in found), default=0.0)
    for curve, name, style in found if largest > 0.0 else []:
        radius = 1.0 + _SWING * curve.y / largest
        made.line(radius * np.cos(TURN * curve.x), radius * np.sin(TURN * curve.x), line_color=style.colour,
                  line_dash=list(style.dash), line_width=1.6, name=name)
    made.axis.visible = False
    made.grid.visible = False
    made.x_range = Range1d(-_EDGE, _EDGE)
    made.y_range = Range1d(-_EDGE, _EDGE)
    return f"{from_si(largest / _SWING, 'um'):.3g} um" if largest > 0.0 else ""


def _ray(made: figure, one: Series) -> None:
    angle = float(one.thread.nominal.start_angles[one.row])
    x, y = math.cos(angle), math.sin(angle)
    made.line([0.0, _RAY * x], [0.0, _RAY * y], line_color=one.style.colour, line_dash=list(one.style.dash),
              line_width=1.6, name=one.name)
    made.scatter([_RAY * x], [_RAY * y], marker=one.style.marker, size=9, line_color=one.style.colour,
                 fill_color=None, name=one.name)
    chosen = one.thread.deviation[one.row][one.thread.chosen[one.row]]
    mean = f"\n{from_si(float(chosen.mean()), 'um'):+.2f} um" if chosen.size else ""
    made.text([_TEXT * x], [_TEXT * y], text=[f"{from_si(angle, 'deg'):.6g} deg{mean}"], text_align="center",
              text_baseline="middle", text_font_size="11px")
