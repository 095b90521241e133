"""Response plots of a study: every outcome over every parameter, with the rows, their mean and its spread."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from threadpitch.report.figure import figure
from threadpitch.studies import Response, StudyResult
from threadpitch.studies.shown_units import headed, shown, shown_width
from threadpitch.tables import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_PANELS = 6  # outcomes, and parameters: more cannot be read
_WIDTH, _HEIGHT, _MARGIN = 2.8, 2.1, 0.5  # inch
_POINTS = 5000  # rows that are drawn


def plot_study(result: StudyResult, path: Path) -> None:
    """Draw the responses of the first outcomes to the parameters that explain most of them.

    Raises:
        PlotError: the format is not known, or matplotlib is not installed.
        OSError: the file cannot be written.
    """
    rows, columns = panels_of(result)
    with figure(path, (_WIDTH * columns + _MARGIN, _HEIGHT * rows + _MARGIN)) as made:
        draw_responses(made, result)


def panels_of(result: StudyResult) -> tuple[int, int]:
    """How many panels lie below and beside each other."""
    outcomes, parameters = _chosen(result)
    return max(1, len(outcomes)), max(1, len(parameters))


def draw_responses(made: Figure, result: StudyResult) -> None:
    """Draw them into a figure, a row of panels for every outcome."""
    outcomes, parameters = _chosen(result)
    panels = made.subplots(max(1, len(outcomes)), max(1, len(parameters)), squeeze=False, sharey="row")
    for one in result.analysis.responses:
        if one.outcome in outcomes and one.parameter in parameters:
            axes = panels[outcomes.index(one.outcome)][parameters.index(one.parameter)]
            _draw(axes, one, result)
    for row, outcome in enumerate(outcomes):
        panels[row][0].set_ylabel(printable(headed(outcome, result.units)))
    for column, parameter in enumerate(parameters):
        panels[-1][column].set_xlabel(printable(headed(parameter, result.units)))


def _chosen(result: StudyResult) -> tuple[list[str], list[str]]:
    """The outcomes that vary, and the parameters that explain most of them."""
    outcomes = list(dict.fromkeys(one.outcome for one in result.analysis.responses
                                 if np.ptp(one.mean) > 0.0))[:MOST_PANELS]
    weight: dict[str, float] = {}
    for one in result.analysis.responses:
        weight[one.parameter] = max(weight.get(one.parameter, 0.0), float(np.nan_to_num(one.share)))
    parameters = sorted(weight, key=lambda name: -weight[name])[:MOST_PANELS]
    return outcomes, parameters


def _draw(axes: Axes, response: Response, result: StudyResult) -> None:
    values: list[Any] = result.table[response.parameter].to_pylist()
    outcomes: list[Any] = result.table[response.outcome].to_pylist()
    drawn = [(value, outcome) for value, outcome in zip(values, outcomes, strict=True) if outcome is not None][:_POINTS]
    named = not all(isinstance(value, float) for value in values)
    across, up = result.units.get(response.parameter), result.units.get(response.outcome)
    places = np.arange(len(response.places)) if named else np.array([shown(one, across) for one in response.places])
    x = [response.places.index(value) if named else shown(value, across) for value, _ in drawn]
    axes.plot(x, [shown(float(outcome), up) for _, outcome in drawn], ".", color="0.7", markersize=3, zorder=1)
    axes.errorbar(places, [shown(one, up) for one in response.mean.tolist()],
                  [shown_width(one, up) for one in response.spread.tolist()], color="C0", marker="o", markersize=3,
                  linewidth=1.2, capsize=2, zorder=2)
    limit = result.study.limits.get(response.outcome)
    if limit is not None:
        axes.axhline(shown(limit, up), color="C3", linewidth=1.0, linestyle="--")
    if not math.isnan(response.share):
        axes.set_title(f"{response.share:.0%} of the variance", fontsize=8)
    axes.ticklabel_format(axis="y", scilimits=(-3, 4))
    if named:
        axes.set_xticks(places, [str(place) for place in response.places])
    else:
        axes.ticklabel_format(axis="x", scilimits=(-3, 4))
