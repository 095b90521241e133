"""A threading cycle drawn: the infeed scheme across the groove, and the path of the tool."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from threadpitch.cycles import Interpretation, Pass, groove_locus, infeed_scheme, tool_path
from threadpitch.cycles.moves import TURN
from threadpitch.report.figure import figure
from threadpitch.units import from_si

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS = {"rough": "#3b6ea5", "finish": "#c0392b", "spring": "#7f8c8d"}
_SHADES = {"rough": ("#8fb3d9", "#b9d1ea"), "finish": ("#d98880", "#e6b0aa"), "spring": ("#b2babb", "#d5dbdb")}
_LEAST_MARGIN = 0.1  # mm
_FEW_TURNS = 3.0  # up to here quarters of a turn are marked
_QUARTER = 90.0  # degrees
_ROOM = 0.05  # of the groove's width, for a number


def plot_cycle(result: Interpretation, path: Path) -> None:
    """Draw the infeed scheme of the first G76, or Z over the spindle's angle of the first chain of blocks, where there
    is one, and the tool path of all moves; mm, degrees.

    Raises:
        PlotError, OSError: as ``figure``.
    """
    chain = next((cut for cut in result.passes if len(cut.paths) > 1), None)
    with figure(path, (9.0, 4.0 if result.cycles or chain else 3.2)) as made:
        if result.cycles:
            left, right = made.subplots(1, 2, width_ratios=(1.0, 1.5))
            _draw_scheme(left, result)
        elif chain is not None:
            left, right = made.subplots(1, 2)
            _draw_locus(left, chain)
        else:
            right = made.subplots()
        _draw_path(right, result)


def _draw_scheme(axes: Axes, result: Interpretation) -> None:
    """What every pass takes away, the number of the pass in it where there is room."""
    scheme = infeed_scheme(result.cycles[0])
    for n in reversed(range(len(scheme.kinds))):  # what a later pass takes lies behind what the former took
        axes.fill(from_mm(scheme.offset[n]), from_mm(scheme.depth[n]), facecolor=_SHADES[scheme.kinds[n]][n % 2],
                  edgecolor="white", linewidth=0.6)
    widest = float(np.max(scheme.offset))
    former = 0.0
    for n, (kind, (_, _, edge)) in enumerate(zip(scheme.kinds, scheme.offset, strict=True)):
        if edge - former > _ROOM * widest:
            place = from_mm(np.array([0.5 * (former + edge), 0.0]))
            axes.annotate(str(n + 1), (place[0], place[1]), xytext=(0, -9), textcoords="offset points", fontsize=7,
                          ha="center", color=_COLOURS[kind])
        former = float(edge)
    axes.invert_yaxis()
    axes.set_aspect("equal")
    axes.set_title("Infeed, pass by pass")
    axes.set_xlabel("along Z from the cut-in point [mm]")
    axes.set_ylabel("depth, radius [mm]")


def _draw_locus(axes: Axes, chain: Pass) -> None:
    """How far the groove runs along Z while the spindle turns; a block begins at each dot."""
    angle, z = groove_locus(chain)
    axes.plot(from_deg(angle), from_mm(z), color=_COLOURS[chain.kind], linewidth=1.2)
    begins = np.linspace(0, angle.size, len(chain.paths) + 1, dtype=int)[:-1]
    axes.plot(from_deg(angle[begins]), from_mm(z[begins]), "o", markersize=3.5, color=_COLOURS[chain.kind])
    if angle[-1] - angle[0] < _FEW_TURNS * TURN:
        axes.set_xticks(np.arange(from_deg(angle)[0] // _QUARTER, from_deg(angle)[-1] // _QUARTER + 2) * _QUARTER)
    axes.set_title(f"Groove of pass {chain.number}, block by block")
    axes.set_xlabel("spindle angle from the one-turn signal [deg]")
    axes.set_ylabel("Z [mm]")


def _draw_path(axes: Axes, result: Interpretation) -> None:
    """Rapid and feed moves thin and dashed, threading in the colour of its pass's kind."""
    path = tool_path(result.moves)
    kinds = {cut.number: cut.kind for cut in result.passes}
    shown: set[str] = set()
    for n, threading in enumerate(path.threading):
        z, diameter = from_mm(path.z[n:n + 2]), from_mm(2.0 * path.x[n:n + 2])
        if not threading:
            axes.plot(z, diameter, color="#999999", linewidth=0.6, linestyle="--",
                      label="_" if "rapid" in shown else "rapid")
            shown.add("rapid")
            continue
        kind = kinds[getattr(result.moves[path.move[n]], "pass_number")]  # noqa: B009 -- a threading piece has one
        axes.plot(z, diameter, color=_COLOURS[kind], linewidth=1.2, label="_" if kind in shown else kind)
        shown.add(kind)
    _look_at_threads(axes, result)
    axes.set_title("Path of the tool")
    axes.set_xlabel("Z [mm]")
    axes.set_ylabel("X, diameter [mm]")
    axes.legend(loc="best", fontsize=8)


def _look_at_threads(axes: Axes, result: Interpretation) -> None:
    """The passes with the points that they come from fill the axes; rapid moves from elsewhere are cut off."""
    points = [point for cut in result.passes for point in (cut.approach, cut.start, cut.end)]
    for look, values in ((axes.set_xlim, [point.z for point in points]),
                         (axes.set_ylim, [2.0 * point.x for point in points])):
        low, high = from_mm(np.array([min(values), max(values)]))
        margin = max(0.08 * (high - low), _LEAST_MARGIN)
        look(low - margin, high + margin)


def from_deg(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[float]:
    """rad -> degrees for drawing."""
    return [from_si(float(value), "deg") for value in values]


def from_mm(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[float]:
    """m -> mm for drawing."""
    return [from_si(float(value), "mm") for value in values]
