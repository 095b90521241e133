"""The figures of a study's report: yield over each parameter, responses, Sobol indices; the same on page and paper."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from threadpitch.report.study_plot import draw_responses, panels_of
from threadpitch.studies import StudyResult
from threadpitch.study_report import named
from threadpitch.tables import printable
from threadpitch.units import from_si

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH, _HIGHEST = 8.0, 11.0  # inch, of what fits on a page
_BESIDE = 3  # panels of yields
_PANEL = 2.3  # inch, height of a panel
_COLOURS = ("#0072b2", "#d55e00")  # told apart by everybody, and by their marks
Drawn = Mapping[str, Any]  # a part of the study's document


@dataclass(frozen=True)
class StudyFigure:
    """A figure with its title and what is seen in it."""

    title: str
    text: str
    figure: Figure


def study_figures(result: StudyResult) -> Iterator[StudyFigure]:
    """The figures that a study has something for."""
    document = result.document
    told = [one for one in document["yield_responses"] if one["places"]]
    if told:
        yield StudyFigure("Yield", "Share of the rows within all limits over each parameter; bars are its confidence "
                          f"interval of {document['confidence']:.0%}, where the design is a sample.", _yields(told))
    if any(np.ptp(one.mean) > 0.0 for one in result.analysis.responses):
        yield StudyFigure("Responses", "Every outcome over every parameter: rows (grey), mean and standard deviation "
                          "at each place; the dashed level is the limit.", _responses(result))
    if document["sobol_indices"]:
        yield StudyFigure("Sobol indices", "The part of an outcome's variance that comes from a parameter alone (first "
                          "order) and with all in which it takes part (total); bars are confidence intervals.",
                          _indices(document["sobol_indices"]))


def _figure(height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(_WIDTH, min(height, _HIGHEST)), layout="constrained")


def _yields(told: Sequence[Drawn]) -> Figure:
    rows = -(-len(told) // _BESIDE)
    made = _figure(_PANEL * rows + 0.4)
    panels = made.subplots(rows, min(_BESIDE, len(told)), squeeze=False, sharey=True)
    for number, axes in enumerate(panels.flat):
        if number >= len(told):
            axes.set_visible(False)
            continue
        one = told[number]
        _with_intervals(axes, _places(axes, one["places"]), one["yields"], _COLOURS[0], "o", percent=True)
        axes.set_ylim(-5.0, 105.0)
        axes.set_xlabel(named(one["parameter"], one["unit"]))
    for first in panels[:, 0]:
        first.set_ylabel("within all limits [%]")
    return made


def _places(axes: Axes, places: Sequence[Any]) -> list[float]:
    """Where the places of a parameter lie on the axis; names one beside the other."""
    if all(isinstance(place, float) for place in places):
        return list(places)
    axes.set_xticks(range(len(places)), [printable(str(place)) for place in places])
    axes.set_xlim(-0.5, len(places) - 0.5)
    return [float(place) for place in range(len(places))]


def _with_intervals(axes: Axes, places: Sequence[float], shares: Sequence[Drawn], colour: str, marker: str, *,
                    percent: bool = False, name: str | None = None) -> None:
    scale = from_si(1.0, "%") if percent else 1.0
    values = scale * np.array([one["value"] for one in shares])
    low, high = (scale * np.array([one["value"] if one[end] is None else one[end] for one in shares])
                 for end in ("low", "high"))
    lengths = [np.maximum(values - low, 0.0), np.maximum(high - values, 0.0)]
    axes.errorbar(places, values, lengths, color=colour, marker=marker, markersize=4, capsize=3, linewidth=1.2,
                  linestyle="-" if percent else "none", label=name)


def _responses(result: StudyResult) -> Figure:
    made = _figure(_PANEL * panels_of(result)[0] + 0.4)
    draw_responses(made, result)
    return made


def _indices(found: Sequence[Drawn]) -> Figure:
    made = _figure(_PANEL * len(found) + 0.4)
    panels = made.subplots(len(found), 1, squeeze=False, sharex=True)[:, 0]
    for one, axes in zip(found, panels, strict=True):
        places = np.arange(len(one["parameters"]), dtype=np.float64)
        for shift, order, marker, colour in ((-0.1, "first", "o", _COLOURS[0]), (0.1, "total", "s", _COLOURS[1])):
            _with_intervals(axes, (places + shift).tolist(), [index[order] for index in one["parameters"].values()],
                            colour, marker, name={"first": "first order", "total": "total"}[order])
        axes.set_xticks(places, [printable(name) for name in one["parameters"]])
        axes.set_ylabel(printable(one["outcome"]))
        axes.axhline(0.0, color="black", linewidth=0.6)
    panels[0].legend(loc="best")
    return made
