"""The charts of a page, drawn by Bokeh: cursors, zoom and values under the pointer, without a server."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from bokeh.models import BasicTicker, ColorBar, HoverTool, LinearColorMapper, NumeralTickFormatter, Range1d
from bokeh.palettes import Cividis256
from bokeh.plotting import figure

from threadpitch.report import curves
from threadpitch.report.content import Report, Thread
from threadpitch.report.curves import Curve
from threadpitch.report.drawing import TOOLS, Chart, Plot, TurnAxes, Words, quiet
from threadpitch.report.polar import draw_polar
from threadpitch.report.series import TARGET, Style, recordings, series, threads
from threadpitch.tables import printable
from threadpitch.trace import FloatArray
from threadpitch.units import from_si

_MAP_HEIGHT = 380  # px
_POLAR_SIZE = 320
_MOST_MARKS = 60  # turns of the movement that are marked
_LIMIT_COLOUR = "#b00020"
_NOT_RECORDED = "Not recorded: this chart needs angle and position sample by sample."


def charts(report: Report) -> list[Chart]:
    """All charts in the order of the page."""
    last = max(thread.nominal.pitch.shape[1] for thread in report.threads)
    axes = TurnAxes(Range1d(0.0, last + 1.0))
    maps = [_map(number, thread, within_turn=within_turn) for number, thread in enumerate(report.threads)
            for within_turn in (False, True)]
    return [_pitches(report, axes), _judged(report, axes), _cumulative(report, axes), *maps, _movement(report),
            _ideal(report, axes), _spectrum(report), _speed(report, axes), _following(report, axes), _polar(report)]


def _pitches(report: Report, axes: TurnAxes) -> Chart:
    plot = Plot("turn n", "P(n) [mm]", axes)
    plot.figure.yaxis.formatter = NumeralTickFormatter(format="0.0000")
    for one in series(report):
        pitch = _mm(one.thread.nominal.pitch[one.row])
        plot.marked(one.name, one.style, _over_turn(pitch))
        plot.see(pitch[one.thread.chosen[one.row]])
    for target in {thread.target for thread in report.threads if not thread.lead_change}:
        plot.level(from_si(target, "mm"), "#000000")
    for thread, name, _ in threads(report):
        if thread.lead_change:
            label = "target" if len(report.threads) == 1 else f"target, {name}"
            plot.line(label, TARGET, _over_turn(_mm(thread.targets[0])))
    for low, high in {(thread.target - thread.limit, thread.target + thread.limit) for thread in report.threads
                      if thread.limit is not None}:
        plot.level(from_si(low, "mm"), _LIMIT_COLOUR, (10, 4))
        plot.level(from_si(high, "mm"), _LIMIT_COLOUR, (10, 4))
    return plot.chart(Words("pitch", "P(n) over n", "Movement per revolution of every start angle. The black line is "
                            f"the target; {_limit_text(report)}.", ""))


def _limit_text(report: Report) -> str:
    limits = {f"{from_si(thread.limit, 'um'):.2f} um" for thread in report.threads if thread.limit is not None}
    return f"dashed levels are the limits, target +- {', '.join(sorted(limits))}" if limits else \
        "no limits are known, give --thread"


def _judged(report: Report, axes: TurnAxes) -> Chart:
    plot = Plot("turn n", "deviation [um]", axes)
    number = 0
    for one in series(report):
        if one.thread.measured and one.row < len(one.thread.measured):
            deviation = _um(np.where(one.thread.chosen, one.thread.deviation, np.nan)[one.row])
            plot.marked(f"nominal, {one.name}", Style.of(number), _over_turn(deviation))
            plot.see(deviation)
            number += 1
    for thread, name, _ in threads(report):
        for measured in thread.measured:
            deviation = _um(thread.measured_deviation(measured))
            label = measured.name if len(report.threads) == 1 else f"{name}: {measured.name}"
            plot.marked(label, Style.of(number), Curve(measured.turn, deviation))
            plot.see(deviation)
            number += 1
    return plot.chart(Words(
        "judged", "Nominal and measured", "Deviation of the nominal and of the measured pitches from the target: where "
        "both go the same way, the control did it.",
        "Nothing measured: give measured pitches with --measured, or run a system that calculates the actual ones."))


def _cumulative(report: Report, axes: TurnAxes) -> Chart:
    plot = Plot("turn n", "cumulative deviation [um]", axes)
    for one in series(report):
        total = _um(curves.cumulative(one.thread)[one.row])
        plot.marked(one.name, one.style, _over_turn(total))
        plot.see(total)
    return plot.chart(Words("cumulative", "Cumulative deviation", "Sum of P(n) less the target from the first turn of "
                            "the thread proper on: a lead that is too long rises steadily.", ""))


def _map(number: int, thread: Thread, *, within_turn: bool) -> Chart:
    name, title, text = (f"within-{number}", "Error within the turn", "Every row is a turn, without its drift: upright "
                         "stripes are a drunken thread, slanting ones repeat with another period than the turn.") \
        if within_turn else (f"map-{number}", "Deviation over angle and turn", "Deviation from the ideal line, every "
                             "row a turn: a row of another colour than its neighbours is a displaced turn.")
    samples, source = thread.truest
    found = curves.error_map(thread, samples, within_turn=within_turn)
    if found is None:
        return Chart(name, title, text, None, note=_NOT_RECORDED)
    values = _um(found.values).astype(np.float32)
    most = float(np.abs(values).max()) or 1e-6
    mapper = LinearColorMapper(palette=Cividis256, low=-most, high=most)
    made = figure(height=_MAP_HEIGHT, sizing_mode="stretch_width", tools=TOOLS, x_axis_label="angle in the turn [deg]",
                  y_axis_label="turn n", x_range=Range1d(0.0, 360.0), active_scroll=None,
                  y_range=Range1d(found.first_turn, found.last_turn))
    made.xaxis.ticker = BasicTicker(base=360, mantissas=[0.125, 0.25])
    made.image([values], x=0.0, y=found.first_turn, dw=360.0, dh=found.last_turn - found.first_turn,
               color_mapper=mapper)
    made.add_layout(ColorBar(color_mapper=mapper, title="um", width=12), "right")
    made.add_tools(HoverTool(tooltips=[("angle [deg]", "$x{0}"), ("turn", "$y{0.0}"), ("[um]", "@image{0.000}")],
                             visible=False))
    more = f" {found.turns_a_row} turns share a row, which shows the farthest of them." if found.turns_a_row > 1 else ""
    return Chart(name, title, f"{printable(thread.name)}, {source}: {text}{more}", quiet(made))


def _movement(report: Report) -> Chart:
    plot = Plot("movement xi [mm]", "rotation angle theta [deg]")
    for thread, name, style in threads(report):
        if thread.samples is None:
            continue
        turn, position = thread.samples.turn, thread.samples.position
        kept = curves.extremes(position - thread.ideal(turn), curves.MOST_POINTS // 2) \
            if turn.size > curves.MOST_POINTS else np.arange(turn.size)
        plot.line(name, style, Curve(_mm(position[kept]), 360.0 * turn[kept]))
        marked = np.arange(0.0, thread.nominal.pitch.shape[1] + 1.0)
        marked = marked[::max(1, marked.size // _MOST_MARKS)]
        plot.marks(name, style, Curve(_mm(np.interp(marked, turn, position)), 360.0 * marked))
    return plot.chart(Words("movement", "xi over theta", "Rotation angle over the movement of the feed, with marks at "
                            "whole turns: from one turn to the next the feed moves by P(n).", _NOT_RECORDED))


def _ideal(report: Report, axes: TurnAxes) -> Chart:
    plot = Plot("turn n", "deviation [um]", axes)
    for thread, samples, name, style in recordings(report):
        found = curves.ideal_deviation(thread, samples)
        if found is not None:
            deviation = Curve(found.x, _um(found.y))
            plot.line(name, style, curves.decimated(deviation))
            plot.see(curves.of_the_thread(thread, deviation))
    return plot.chart(Words("ideal", "Deviation from the ideal line", "Where the feed and the groove are, less target "
                            "times angle; 0 where the thread proper begins.", _NOT_RECORDED))


def _speed(report: Report, axes: TurnAxes) -> Chart:
    def speed(thread: Thread) -> Curve | None:
        if thread.samples is None or thread.samples.speed is None:
            return None
        return Curve(thread.samples.turn, thread.samples.speed * from_si(1.0, "rpm"))

    return _samples_over_turns(report, Plot("turn n", "speed [rpm]", axes), speed, Words(
        "speed", "Spindle speed", "Speed of the spindle over the same revolutions.",
        "Not recorded: the log has no time, or the run no spindle speed."))


def _following(report: Report, axes: TurnAxes) -> Chart:
    def error(thread: Thread) -> Curve | None:
        if thread.samples is None or thread.samples.following_error is None:
            return None
        return Curve(thread.samples.turn, _um(thread.samples.following_error))

    return _samples_over_turns(report, Plot("turn n", "following error [um]", axes), error, Words(
        "following", "Following error", "Command less position of the feed drive, in the direction of the cut, over "
        "the same revolutions.", "Not recorded: the log does not hold the feed's command."))


def _samples_over_turns(report: Report, plot: Plot, curve: Callable[[Thread], Curve | None], words: Words) -> Chart:
    for thread, name, style in threads(report):
        found = curve(thread)
        if found is not None:
            plot.line(name, style, curves.decimated(found))
            plot.see(curves.of_the_thread(thread, found))
    return plot.chart(words)


def _spectrum(report: Report) -> Chart:
    plot = Plot("order [1/revolution]", "amplitude [um]")
    for thread, samples, name, style in recordings(report):
        found = curves.spectrum(thread, samples)
        if found is None:
            continue
        plot.line(name, style, curves.decimated(Curve(found.x, _um(found.y))))
        if thread.screw_lead is not None:
            plot.upright(thread.middle_target / thread.screw_lead, style.colour)
    return plot.chart(Words(
        "spectrum", "Spectrum per revolution", "Amplitudes of the deviation from the ideal line over how often they "
        "come in a revolution: whole orders make a drunken thread. A dashed line is one turn of the ball screw.",
        "Not recorded, or fewer than four turns of it."))


def _polar(report: Report) -> Chart:
    made = figure(frame_width=_POLAR_SIZE, frame_height=_POLAR_SIZE, tools="pan,wheel_zoom,reset,save",
                  active_scroll=None, toolbar_location="below")
    found = list(series(report))
    radius = draw_polar(made, found, list(threads(report)))
    text = ("The workpiece seen along its axis: angle zero on the dotted line, start angles counted in the turning "
            "direction, beside each the mean of P(n) less the target.")
    if radius:
        text += f" The closed curve is the mean error within the turn, for which the circle's radius is {radius}."
    return Chart("polar", "Start angles", text, quiet(made), tuple((one.name, one.style) for one in found))


def _over_turn(values: FloatArray) -> Curve:
    """Values (revolutions,) at their turns, from 1."""
    return Curve(np.arange(1.0, values.size + 1.0), values)


def _mm(values: FloatArray) -> FloatArray:
    return np.asarray(values * from_si(1.0, "mm"))


def _um(values: FloatArray) -> FloatArray:
    return np.asarray(values * from_si(1.0, "um"))
