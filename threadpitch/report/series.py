"""What tells the curves of a report apart: colour, dashes and marker, so that they are known without colour too."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from threadpitch.report.content import Report, Samples, Thread
from threadpitch.tables import printable, start_angles_deg

# Okabe and Ito, Color Universal Design (2008): told apart by people with any kind of colour vision; yellow left out.
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000")
_DASHES: tuple[tuple[int, ...], ...] = ((), (6, 3), (2, 2), (8, 3, 2, 3), (12, 4))
_MARKERS = ("circle", "square", "triangle", "diamond", "inverted_triangle", "plus", "x", "star")
_GLYPHS = "○□△◇▽+×☆"
_SHORT = 60  # characters of a name in a legend


@dataclass(frozen=True)
class Style:
    """How a curve is drawn."""

    colour: str
    dash: tuple[int, ...]  # points on and off; empty = solid
    marker: str
    glyph: str  # the marker as a letter, for a legend

    @classmethod
    def of(cls, number: int) -> Style:
        """The style of the curve with this number, from 0."""
        return cls(_COLOURS[number % len(_COLOURS)], _DASHES[number % len(_DASHES)], _MARKERS[number % len(_MARKERS)],
                   _GLYPHS[number % len(_GLYPHS)])


TARGET = Style("#000000", (), "dot", " ")


@dataclass(frozen=True)
class Series:
    """The pitches of one start angle of one thread."""

    thread: Thread
    row: int
    name: str
    style: Style


def series(report: Report) -> Iterator[Series]:
    """Every start angle of every thread; the thread is named where there are several."""
    number = 0
    for thread in report.threads:
        for row, angle in enumerate(start_angles_deg(thread.nominal)):
            angle_name = f"theta_S{row + 1} = {angle:.6g} deg"
            name = angle_name if len(report.threads) == 1 else f"{shown(thread.name)}, {angle:.6g} deg"
            yield Series(thread, row, name, Style.of(number))
            number += 1


def threads(report: Report) -> Iterator[tuple[Thread, str, Style]]:
    """Every thread with its name for a legend and the style of its curves."""
    for number, thread in enumerate(report.threads):
        yield thread, shown(thread.name), Style.of(number)


def recordings(report: Report) -> Iterator[tuple[Thread, Samples, str, Style]]:
    """What is recorded of every thread, by detectors and of the groove, with its name and style."""
    found = [(thread, samples, f"{name}, {of}") for thread, name, _ in threads(report)
             for samples, of in ((thread.samples, "detectors"), (thread.groove, "groove")) if samples is not None]
    for number, one in enumerate(found):
        yield *one, Style.of(number)


def shown(name: str) -> str:
    """A name from a file as a legend takes it: printable, and not too long."""
    text = printable(name)
    return text if len(text) <= _SHORT else f"{text[:_SHORT - 3]}..."
