"""The shapes that a mechanical cause leaves in the pitches: a dictionary of candidate columns over the turns."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from threadpitch.trace import FloatArray, IntArray

PROGRESSIVE, DRIFT, PERIODIC, SCREW = "progressive", "drift", "periodic", "once per screw turn"
EVENT, DISPLACED, SECTION, START, END = "event", "displaced turn", "section", "start", "end"
IRREGULAR = "irregular"

LENGTHS = (2, 3, 4, 6, 8, 12, 16, 24, 32)  # turns of a section
WIDTHS = (1.0, 2.0, 4.0, 8.0, 16.0)  # turns, standard deviation of a groove that is displaced smoothly
DECAYS = (0.5, 1.0, 2.0, 4.0, 8.0)  # turns in which an effect of the start or the end falls to 1/e
FINER = 4  # frequencies tried per resolvable one
_WHOLE = 1e-3  # of a turn: what the screw turns beyond whole turns, below which nothing is left of its period


@dataclass(frozen=True)
class Shape:
    """One candidate: its columns in the dictionary, and what it means."""

    kind: str
    columns: tuple[int, ...]
    turns: tuple[float, float]  # first and last turn that it touches
    period: float = math.nan  # turns
    decay: float = math.nan  # turns


@dataclass(frozen=True, eq=False)
class Dictionary:
    """All candidates over the turns of one thread; the penalty of one is what its whole kind has to choose from."""

    columns: FloatArray  # (turns, columns), of length 1
    shapes: tuple[Shape, ...]
    single: IntArray  # (single shapes,) column of each shape that has one; they come first
    pairs: IntArray  # (periodic shapes, 2) columns of each shape that has two
    choices: dict[str, float]  # by kind: how many independent candidates it has
    bonferroni: FloatArray  # (shapes,) 2 ln of that


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A shape before it has its place in the dictionary."""

    kind: str
    columns: tuple[FloatArray, ...]  # one or two of (turns,)
    turns: tuple[float, float]
    period: float = math.nan
    decay: float = math.nan


@functools.lru_cache(maxsize=8)
def dictionary(turns: tuple[float, ...], screw_turns: float | None = None, parts: int = 1) -> Dictionary:
    """The candidates for these turns; ``screw_turns`` are the turns of the ball screw per turn of the spindle.

    Where the turns are one of several ``parts`` of a thread (start angles, flanks, stretches), there are as many times
    the candidates to choose from.
    """
    place = np.array(turns, dtype=np.float64)
    first, last = turns[0], turns[-1]
    along = (place - place.mean()) / max(last - first, 1.0)
    found = [_Candidate(PROGRESSIVE, (np.ones_like(place),), (first, last))]
    found += [_Candidate(DRIFT, (along**power,), (first, last)) for power in (1, 2, 3)]
    for decay in DECAYS:
        touched = min(2.0 * decay, last - first)
        found.append(_Candidate(START, (np.exp((first - place) / decay),), (first, first + touched), decay=decay))
        found.append(_Candidate(END, (np.exp((place - last) / decay),), (last - touched, last), decay=decay))
    found += [*_single_turns(place), *_stretches(place), *_smooth_sections(place)]
    frequencies = _frequencies(last - first + 1.0)
    found += [_wave(PERIODIC, place, frequency) for frequency in frequencies.tolist()]
    if screw_turns is not None:
        beyond = abs(screw_turns - round(screw_turns))
        if beyond > _WHOLE:
            found.append(_wave(SCREW, place, beyond))
    return _assembled(found, len(frequencies) / FINER, parts)


def _single_turns(place: FloatArray) -> Iterator[_Candidate]:
    """A turn that is longer or shorter, and a groove that is displaced and the next one back."""
    turns = place.tolist()
    for i, turn in enumerate(turns):
        yield _Candidate(EVENT, (_bump(place.size, {i: 1.0}),), (turn, turn))
        if i + 1 < len(turns):
            yield _Candidate(DISPLACED, (_bump(place.size, {i: 1.0, i + 1: -1.0}),), (turn, turns[i + 1]))


def _stretches(place: FloatArray) -> Iterator[_Candidate]:
    """Sections of some turns: a longer or shorter pitch there, or grooves that are displaced there and come back."""
    turns = place.tolist()
    for length in LENGTHS:
        for i in range(len(turns) - length + 1):
            for column in _sections(len(turns), i, length):
                yield _Candidate(SECTION, (column,), (turns[i], turns[i + length - 1]))


def _smooth_sections(place: FloatArray) -> Iterator[_Candidate]:
    """Grooves that are displaced by exp(-((n - centre) / width)^2 / 2)."""
    first, last = float(place[0]), float(place[-1])
    for width in WIDTHS:
        for centre in np.arange(first, last + 0.5, max(0.5, 0.5 * width)).tolist():
            since = (place - centre) / width
            column = np.exp(-0.5 * since**2) - np.exp(-0.5 * (since - 1.0 / width) ** 2)
            yield _Candidate(SECTION, (column,), (max(centre - 2.0 * width, first), min(centre + 2.0 * width, last)))


def _sections(size: int, first: int, length: int) -> list[FloatArray]:
    """Pitch changed all along; groove displaced between two turns; groove displaced as a slope up and down."""
    along = np.zeros(size)
    along[first:first + length] = 1.0
    columns = [along] if length < size else []
    if length > 2:
        columns.append(_bump(size, {first: 1.0, first + length - 1: -1.0}))
    if length > 2 and length % 2 == 0:
        slope = along.copy()
        slope[first + length // 2:] *= -1.0
        columns.append(slope)
    return columns


def _bump(size: int, values: dict[int, float]) -> FloatArray:
    column = np.zeros(size)
    for index, value in values.items():
        column[index] = value
    return column


def _frequencies(span: float) -> FloatArray:
    """(frequencies,) 1/turn, from one period in the thread to one in two turns."""
    return np.arange(1.0, span / 2.0 + 1e-9, 1.0 / FINER) / span


def _wave(kind: str, place: FloatArray, frequency: float) -> _Candidate:
    angle = 2.0 * math.pi * frequency * place
    touched = (float(place[0]), float(place[-1]))
    return _Candidate(kind, (np.cos(angle), np.sin(angle)), touched, period=1.0 / frequency)


def _assembled(found: list[_Candidate], waves: float, parts: int) -> Dictionary:
    columns: list[FloatArray] = []
    shapes: list[Shape] = []
    choices: dict[str, float] = {}
    for one in sorted(found, key=lambda one: len(one.columns)):
        indices = tuple(range(len(columns), len(columns) + len(one.columns)))
        columns += [_of_length_one(column) for column in one.columns]
        shapes.append(Shape(one.kind, indices, one.turns, one.period, one.decay))
        choices[one.kind] = choices.get(one.kind, 0.0) + 1.0
    if PERIODIC in choices:
        choices[PERIODIC] = max(waves, 1.0)
    choices = {kind: count * parts for kind, count in choices.items()}
    single = np.array([shape.columns[0] for shape in shapes if len(shape.columns) == 1])
    pairs = np.array([shape.columns for shape in shapes if len(shape.columns) == 2], dtype=np.int64).reshape(-1, 2)
    bonferroni = np.array([2.0 * math.log(choices[shape.kind]) for shape in shapes])
    return Dictionary(np.column_stack(columns), tuple(shapes), single, pairs, choices, bonferroni)


def _of_length_one(column: FloatArray) -> FloatArray:
    """Nothing where only rounding is left: the sine of two turns' period is zero at every turn."""
    length = float(np.linalg.norm(column))
    return column / length if length > 1e-9 else np.zeros_like(column)
