"""Response plots of a study: every outcome over every parameter, with the rows, their mean and its spread."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from threadpitch.report.figure import figure
from threadpitch.studies import Response, StudyResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_PANELS = 6  # outcomes, and parameters: more cannot be read
_WIDTH, _HEIGHT, _MARGIN = 2.8, 2.1, 0.5  # inch
_POINTS = 5000  # rows that are drawn


def plot_study(result: StudyResult, path: Path) -> None:
    """Draw the responses of the first outcomes to the parameters that explain most of them.

    Raises:
        PlotError: the format is not known, or matplotlib is not installed.
        OSError: the file cannot be written.
    """
    outcomes = list(dict.fromkeys(one.outcome for one in result.analysis.responses))[:MOST_PANELS]
    weight: dict[str, float] = {}
    for one in result.analysis.responses:
        weight[one.parameter] = max(weight.get(one.parameter, 0.0), one.share)
    parameters = sorted(weight, key=lambda name: -weight[name])[:MOST_PANELS]
    rows, columns = max(1, len(outcomes)), max(1, len(parameters))
    with figure(path, (_WIDTH * columns + _MARGIN, _HEIGHT * rows + _MARGIN)) as made:
        panels = made.subplots(rows, columns, squeeze=False, sharey="row")
        for one in result.analysis.responses:
            if one.outcome in outcomes and one.parameter in parameters:
                axes = panels[outcomes.index(one.outcome)][parameters.index(one.parameter)]
                _draw(axes, one, result)
        for row, outcome in enumerate(outcomes):
            panels[row][0].set_ylabel(outcome)
        for column, parameter in enumerate(parameters):
            panels[-1][column].set_xlabel(parameter)


def _draw(axes: Axes, response: Response, result: StudyResult) -> None:
    values: list[Any] = result.table[response.parameter].to_pylist()
    outcomes: list[Any] = result.table[response.outcome].to_pylist()
    drawn = [(value, outcome) for value, outcome in zip(values, outcomes, strict=True) if outcome is not None][:_POINTS]
    named = not all(isinstance(value, float) for value in values)
    places = np.arange(len(response.places)) if named else np.array(response.places)
    x = [response.places.index(value) if named else value for value, _ in drawn]
    axes.plot(x, [float(outcome) for _, outcome in drawn], ".", color="0.7", markersize=3, zorder=1)
    axes.errorbar(places, response.mean, response.spread, color="C0", marker="o", markersize=3, linewidth=1.2,
                  capsize=2, zorder=2)
    limit = result.study.limits.get(response.outcome)
    if limit is not None:
        axes.axhline(limit, color="C3", linewidth=1.0, linestyle="--")
    axes.set_title(f"{response.share:.0%} of the variance", fontsize=8)
    axes.ticklabel_format(axis="y", scilimits=(-3, 4))
    if named:
        axes.set_xticks(places, [str(place) for place in response.places])
    else:
        axes.ticklabel_format(axis="x", scilimits=(-3, 4))
