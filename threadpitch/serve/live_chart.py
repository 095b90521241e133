"""The empty chart of the live page, which its script fills."""

from __future__ import annotations

from bokeh.models import ColumnDataSource, Range1d

from threadpitch.report.drawing import Chart, Plot, quiet
from threadpitch.report.series import Style

SLOTS = 8  # curves that are shown: calculators and start angles, in the order of their coming


def live_chart() -> Chart:
    """P(n) over n, with a slot for every curve; their names come with the events."""
    plot = Plot("turn n", "P(n) less target [um]")
    slots = []
    for number in range(SLOTS):
        style, source = Style.of(number), ColumnDataSource({"x": [], "y": []}, name=f"slot-{number}")
        plot.figure.line("x", "y", source=source, name=f"slot-{number}", line_color=style.colour,
                         line_dash=list(style.dash), line_width=1.4)
        plot.figure.scatter("x", "y", source=source, name=f"slot-{number}", marker=style.marker, size=6,
                            line_color=style.colour, fill_color=None)
        slots.append((f"slot-{number}", style))
    plot.figure.x_range, plot.figure.y_range = Range1d(0.0, 10.0), Range1d(-1.0, 1.0)  # the script sets them
    return Chart("live", "P(n) as it comes", "Deviation of every revolution from the target, or from the first one "
                 "where there is no target.", quiet(plot.figure), tuple(slots))
