"""The charts of a report on paper: the same curves as on the page, drawn by matplotlib into given axes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from threadpitch.pitch import usual
from threadpitch.report import curves
from threadpitch.report.content import Report, Samples, Thread
from threadpitch.report.curves import Curve
from threadpitch.report.series import Style, recordings, series, threads
from threadpitch.tables import printable
from threadpitch.trace import TURN, FloatArray
from threadpitch.units import from_si

_MARKERS = {"circle": "o", "square": "s", "triangle": "^", "diamond": "D", "inverted_triangle": "v", "plus": "+",
            "x": "x", "star": "*"}
_MOST_MARKERS = 40  # of a curve
_MOST_NAMES = 10  # in a legend
_LIMIT_COLOUR = "#b00020"
_SWING = 0.3  # of the radius, for the largest error within the turn


def chart_pages(report: Report, size: tuple[float, float]) -> Iterator[Figure]:
    """Pages of this size (inch) with all charts; maps have a page for every thread."""
    yield _page(size, report, (_pitches, _judged, _cumulative))
    yield _page(size, report, (_ideal, _speed, _following))
    yield _page(size, report, (_movement, _spectrum, _polar))
    for thread in report.threads:
        samples, _ = thread.truest
        if samples is not None:
            yield _map_page(size, thread, samples)


def _page(size: tuple[float, float], report: Report, draw: Sequence[Callable[[Axes, Report], None]]) -> Figure:
    figure = Figure(figsize=size)
    figure.subplots_adjust(left=0.11, right=0.95, top=0.95, bottom=0.07, hspace=0.32)
    for place, one in enumerate(draw):
        axes = figure.add_subplot(len(draw), 1, place + 1, projection="polar" if one is _polar else None)
        one(axes, report)
    return figure


def _map_page(size: tuple[float, float], thread: Thread, samples: Samples) -> Figure:
    figure = Figure(figsize=size)
    for place, (title, within_turn) in enumerate((("Deviation over angle and turn", False),
                                                  ("Error within the turn", True))):
        found = curves.error_map(thread, samples, within_turn=within_turn)
        axes = figure.add_axes((0.11, 0.54 - 0.46 * place, 0.74, 0.38))
        axes.set_title(f"{title}, {thread.truest[1]}: {printable(thread.name)} [um]")
        if found is None:
            _missing(axes)
            continue
        values = found.values * from_si(1.0, "um")
        most = float(np.abs(values).max()) or 1e-6
        image = axes.imshow(values, origin="lower", aspect="auto", cmap="cividis", vmin=-most, vmax=most,
                            interpolation="nearest", extent=(0.0, 360.0, found.first_turn, found.last_turn))
        axes.grid(visible=False)
        axes.set_xticks(range(0, 361, 45))
        axes.set_xlabel("angle in the turn [deg]")
        axes.set_ylabel("turn n")
        figure.colorbar(image, cax=figure.add_axes((0.88, 0.54 - 0.46 * place, 0.02, 0.38)))
    return figure


def _pitches(axes: Axes, report: Report) -> None:
    seen: list[FloatArray] = []
    levels: list[float] = []
    for one in series(report):
        pitch = one.thread.nominal.pitch[one.row] * from_si(1.0, "mm")
        _marked(axes, one.name, one.style, _over_turn(pitch))
        seen.append(pitch[one.thread.chosen[one.row]])
    for thread in report.threads:
        targets = thread.targets[0] * from_si(1.0, "mm")
        if thread.lead_change:
            axes.plot(np.arange(1.0, targets.size + 1.0), targets, color="black", linewidth=0.8)
        else:
            axes.axhline(float(targets[0]), color="black", linewidth=0.8)
        levels += [float(targets.min()), float(targets.max())]
        for bound in () if thread.limit is None else (thread.target - thread.limit, thread.target + thread.limit):
            axes.axhline(from_si(bound, "mm"), color=_LIMIT_COLOUR, linewidth=0.8, linestyle=(0, (8, 3)))
            levels.append(from_si(bound, "mm"))
    _finish(axes, ("P(n) over n; black: target, dashed: limits", "turn n", "P(n) [mm]"), seen)
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, *levels), max(high, *levels))
    axes.ticklabel_format(axis="y", useOffset=False)


def _judged(axes: Axes, report: Report) -> None:
    seen: list[FloatArray] = []
    number = 0
    for one in series(report):
        if one.thread.measured and one.row < len(one.thread.measured):
            deviation = np.where(one.thread.chosen, one.thread.deviation, np.nan)[one.row] * from_si(1.0, "um")
            _marked(axes, f"nominal, {one.name}", Style.of(number), _over_turn(deviation))
            seen.append(deviation)
            number += 1
    for thread, name, _ in threads(report):
        for measured in thread.measured:
            deviation = thread.measured_deviation(measured) * from_si(1.0, "um")
            _marked(axes, f"{name}: {measured.name}", Style.of(number), Curve(measured.turn, deviation))
            seen.append(deviation)
            number += 1
    _finish(axes, ("Nominal and measured, less target", "turn n", "deviation [um]"), seen)


def _cumulative(axes: Axes, report: Report) -> None:
    seen = []
    for one in series(report):
        total = curves.cumulative(one.thread)[one.row] * from_si(1.0, "um")
        _marked(axes, one.name, one.style, _over_turn(total))
        seen.append(total)
    _finish(axes, ("Cumulative deviation", "turn n", "sum of P(n) - target [um]"), seen)


def _ideal(axes: Axes, report: Report) -> None:
    seen = []
    for thread, samples, name, style in recordings(report):
        found = curves.ideal_deviation(thread, samples)
        if found is not None:
            deviation = Curve(found.x, found.y * from_si(1.0, "um"))
            _line(axes, name, style, curves.decimated(deviation))
            seen.append(curves.of_the_thread(thread, deviation))
    _finish(axes, ("Deviation from the ideal line", "turn n", "deviation [um]"), seen)


def _speed(axes: Axes, report: Report) -> None:
    _samples(axes, report, lambda samples: samples.speed, "rpm")
    _titles(axes, ("Spindle speed", "turn n", "speed [rpm]"))


def _following(axes: Axes, report: Report) -> None:
    _samples(axes, report, lambda samples: samples.following_error, "um")
    _titles(axes, ("Following error", "turn n", "following error [um]"))


def _samples(axes: Axes, report: Report, values_of: Callable[[Samples], FloatArray | None], unit: str) -> None:
    seen = []
    for thread, name, style in threads(report):
        values = None if thread.samples is None else values_of(thread.samples)
        if values is not None and thread.samples is not None:
            curve = Curve(thread.samples.turn, values * from_si(1.0, unit))
            _line(axes, name, style, curves.decimated(curve))
            seen.append(curves.of_the_thread(thread, curve))
    _finish(axes, ("", "turn n", ""), seen)


def _movement(axes: Axes, report: Report) -> None:
    drawn = False
    for thread, name, style in threads(report):
        if thread.samples is not None:
            thin = curves.decimated(Curve(thread.samples.turn, thread.samples.position
                                          - thread.ideal(thread.samples.turn)))
            position = (thin.y + thread.ideal(thin.x)) * from_si(1.0, "mm")
            _line(axes, name, style, Curve(position, 360.0 * thin.x))
            drawn = True
    _finish(axes, ("xi over theta", "movement xi [mm]", "rotation angle theta [deg]"), [] if drawn else None)


def _spectrum(axes: Axes, report: Report) -> None:
    drawn = False
    for thread, samples, name, style in recordings(report):
        found = curves.spectrum(thread, samples)
        if found is not None:
            _line(axes, name, style, curves.decimated(Curve(found.x, found.y * from_si(1.0, "um"))))
            drawn = True
            if thread.screw_lead is not None:
                axes.axvline(thread.middle_target / thread.screw_lead, color=style.colour, linestyle="--",
                             linewidth=0.8)
    _finish(axes, ("Spectrum per revolution; dashed: one turn of the ball screw", "order [1/revolution]",
                   "amplitude [um]"), [] if drawn else None)


def _polar(axes: Axes, report: Report) -> None:
    """Start angles as rays; the mean error within the turn about a circle."""
    assert isinstance(axes, PolarAxes)  # the page makes it so
    axes.set_title("Start angles; about the circle the mean error within the turn")
    axes.set_ylim(0.0, 1.3 + _SWING)
    axes.set_yticks([1.0], labels=[""])
    for one in series(report):
        angle = float(one.thread.nominal.start_angles[one.row])
        axes.plot([angle, angle], [0.0, 1.25], color=one.style.colour, linestyle=_dash(one.style),
                  marker=_MARKERS[one.style.marker], markevery=[1], fillstyle="none", label=one.name)
    found = [(curve, style) for thread, _, style in threads(report)
             if (curve := curves.mean_within_turn(thread, thread.truest[0])) is not None]
    largest = max((float(np.abs(curve.y).max()) for curve, _ in found), default=0.0)
    for curve, style in found if largest > 0.0 else []:
        axes.plot(TURN * curve.x, 1.0 + _SWING * curve.y / largest, color=style.colour, linestyle=_dash(style))
    if largest > 0.0:
        axes.set_xlabel(f"the circle's radius stands for {from_si(largest / _SWING, 'um'):.3g} um")
    axes.legend(loc="upper left", bbox_to_anchor=(1.1, 1.0))


def _over_turn(values: FloatArray) -> Curve:
    return Curve(np.arange(1.0, values.size + 1.0), values)


def _marked(axes: Axes, name: str, style: Style, curve: Curve) -> None:
    axes.plot(curve.x, curve.y, color=style.colour, linestyle=_dash(style), marker=_MARKERS[style.marker],
              markevery=max(1, curve.x.size // _MOST_MARKERS), fillstyle="none", label=name)


def _line(axes: Axes, name: str, style: Style, curve: Curve) -> None:
    axes.plot(curve.x, curve.y, color=style.colour, linestyle=_dash(style), label=name)


def _dash(style: Style) -> tuple[int, tuple[int, ...] | None]:
    return 0, style.dash or None


def _finish(axes: Axes, titles: tuple[str, str, str], seen: Sequence[FloatArray] | None) -> None:
    """Titles and legend, and the range of the values that are not far outside; None: nothing was drawn."""
    _titles(axes, titles)
    if seen is None or not axes.lines:
        _missing(axes)
        return
    known = [one[~np.isnan(one)] for one in seen]  # each by itself: a steady curve does not cut off the others
    near = np.concatenate([one[usual(one)] for one in known]) if known else np.zeros(0)
    if near.size:
        low, high = float(near.min()), float(near.max())
        margin = 0.08 * (high - low) or max(1e-6, 1e-6 * abs(high))
        axes.set_ylim(low - margin, high + margin)
    handles, names = axes.get_legend_handles_labels()
    axes.legend(handles[:_MOST_NAMES], names[:_MOST_NAMES], ncols=2, loc="best")


def _titles(axes: Axes, titles: tuple[str, str, str]) -> None:
    axes.set_title(titles[0])
    axes.set_xlabel(titles[1])
    axes.set_ylabel(titles[2])


def _missing(axes: Axes) -> None:
    axes.text(0.5, 0.5, "not recorded, or nothing measured", transform=axes.transAxes, ha="center", va="center",
              color="#777777")
