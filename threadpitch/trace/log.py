"""Logs of machines in any format -> the ``Trace`` of every group."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol

from threadpitch.trace.ahead import ReadAhead
from threadpitch.trace.angle_unit import assumed, with_angle_unit
from threadpitch.trace.array_files import array_format, array_log
from threadpitch.trace.choice import Chosen, ColumnChoice
from threadpitch.trace.conditioned import Samples
from threadpitch.trace.csv_log import TextLog
from threadpitch.trace.found_passes import chief_leads, found_passes, with_chief_lead, with_leads
from threadpitch.trace.groups import Group, grouped
from threadpitch.trace.live import live_texts
from threadpitch.trace.mended import mended
from threadpitch.trace.passes import Piece
from threadpitch.trace.recording import Trace
from threadpitch.trace.scope_file import scope_log
from threadpitch.trace.signals import Signals
from threadpitch.trace.text_rows import STANDARD_INPUT, Place, texts_of
from threadpitch.trace.wholes import traces


class Log(Protocol):
    """A file whose columns are chosen, and its pieces, which can be read once."""

    source: str
    chosen: Chosen

    @property
    def share(self) -> float | None:
        """Of the log that is read, 0 to 1; None where that is not known."""

    def pieces(self) -> Iterator[Piece]:
        """Neighbouring samples of one group, one piece after the other."""

    def close(self) -> None:
        """Close the file."""


def open_log(path: Path, choice: ColumnChoice) -> Log:
    """The log in a file, by what it begins with; ``-`` is the text on standard input.

    Raises:
        TraceError: whatever keeps the file from being read, a column that is not there or cannot be told.
    """
    name = "" if str(path) == STANDARD_INPUT else array_format(path)
    if name:
        return array_log(path, name, choice)
    place = Place()
    log = TextLog(str(path), texts_of(path, place), choice, place)
    if not log.head.sample_times or not path.is_file():
        return log
    log.close()
    return scope_log(path, log.head, choice)


def chosen_columns(path: str | Path, choice: ColumnChoice) -> Chosen:
    """Which columns of a log are which.

    Raises:
        TraceError: the file cannot be read; a column is not there or cannot be told.
    """
    with closing(open_log(Path(path), choice)) as log:
        return log.chosen


@contextmanager
def read_pieces(path: str | Path, choice: ColumnChoice, signals: Signals | None = None, *,
                read: Callable[[float], None] | None = None) -> Generator[Iterator[tuple[Group, Samples]]]:
    """The samples of a log piece by piece, rad, m and s, each with its group; nothing of them is kept.

        with read_pieces(path, choice) as pieces:
            for group, samples in pieces:
                ...

    The file is read by a second thread meanwhile. Where the lead of synchronous motion is to be found, a file is read
    twice; of a pipe, or standard input, which can be read once only, all samples are kept then. ``read`` hears what
    share of the log is read, 0 to 1, where that is known.

    Raises:
        TraceError: as ``read_groups``, but for what needs a whole group: the turning of the spindle.
    """
    path, signals = Path(path), signals or Signals()
    log = open_log(path, choice)
    led = with_chief_lead
    if _seeks_lead(log.chosen, signals) and (path.is_file() or path.is_dir()):
        with ReadAhead(log.pieces(), log.close) as pieces:
            first = _Recorded.of(log, _sharing(log, pieces, _half(read, 0.0)), signals)
            led = partial(with_leads, leads=chief_leads(first.grouped()))
        log, read = open_log(path, choice), _half(read, 0.5)
    with ReadAhead(log.pieces(), log.close) as pieces:
        yield _owned(_Recorded.of(log, _sharing(log, pieces, read), signals), led)


def watch_pieces(path: Path, choice: ColumnChoice, signals: Signals | None = None, *, idle: float = math.inf) \
        -> Iterator[tuple[Group, Samples]]:
    """``read_pieces`` of a text log that still grows, every line as soon as it is there; ``-`` is standard input.

    It ends with standard input, and with a file when that has not grown for ``idle`` seconds. An angle without a unit
    is taken in rev: the samples that would tell it are not there yet.

    Raises:
        TraceError: as ``read_pieces``; the file became shorter.
    """
    with closing(TextLog(str(path), live_texts(path, idle), choice)) as log:
        yield from _owned(_Recorded(log.source, assumed(log.chosen), log.pieces(), signals or Signals()))


def read_groups(path: str | Path, choice: ColumnChoice, signals: Signals | None = None, *,
                told: Callable[[int], None] | None = None,
                read: Callable[[float], None] | None = None) -> list[Trace]:
    """The groups of a log, in the order of the file; ``Trace.name`` is the group's value.

    Rows whose group value is 0, empty or false are not threading and are left out. A group is a stretch of such rows
    with one value; where a value comes again after other rows, a new group begins (a flag that is true in every pass),
    called ``true (2)``. Angle and time may restart with every group. An angle that counts down in a group is turned
    around, which ``Trace.notes`` says; start angles then count in the turning direction too. ``told`` hears the number
    of samples of each piece, ``read`` what share of the log is read, 0 to 1, where that is known.

    Raises:
        TraceError: with file and line: whatever keeps the file from being read, a column that is not there, text or
            NaN in a number, rows of unequal length, no threading row, and all that ``Trace`` refuses.
    """
    log = open_log(Path(path), choice)
    with ReadAhead(log.pieces(), log.close) as pieces:
        recorded = _Recorded.of(log, _sharing(log, pieces, read), signals or Signals())
        return list(traces(_owned(recorded, with_chief_lead, told)))


_Owned = Iterator[tuple[Group, Samples]]


@dataclass(frozen=True)
class _Recorded:
    """What a log holds, and what is known of it."""

    source: str
    chosen: Chosen
    pieces: Iterator[Piece]
    signals: Signals

    @classmethod
    def of(cls, log: Log, pieces: Iterator[Piece], signals: Signals) -> _Recorded:
        """With the unit of the angle, which the first pieces tell where nothing else does."""
        coming, chosen = with_angle_unit(pieces, log.chosen, signals)
        return cls(log.source, chosen, coming, signals)

    def grouped(self) -> _Owned:
        """The samples with their group."""
        return grouped(self.pieces, self.source, self.chosen, self.signals)


def _owned(log: _Recorded, led: Callable[[_Owned], _Owned] | None = None,
           told: Callable[[int], None] | None = None) -> _Owned:
    """The samples of a log, with their group, or with the pass that is found by the motion of the feed.

    ``led`` gives the groups the lead of synchronous motion; without it, it is found so far as the samples have come.
    """
    owned = _told(log.grouped(), told)
    if led is not None and _seeks_lead(log.chosen, log.signals):
        owned = led(owned)
    if log.chosen.index_enable is not None or log.signals.synchronous:
        owned = found_passes(owned)
    return mended(owned)


def _seeks_lead(chosen: Chosen, signals: Signals) -> bool:
    return signals.synchronous and signals.lead is None and chosen.index_enable is None


def _half(read: Callable[[float], None] | None, begin: float) -> Callable[[float], None] | None:
    """Of a log that is read twice."""
    return None if read is None else lambda share: read(begin + 0.5 * share)


def _sharing(log: Log, pieces: Iterator[Piece], read: Callable[[float], None] | None) -> Iterator[Piece]:
    for piece in pieces:
        if read is not None and log.share is not None:
            read(log.share)
        yield piece


def _told(owned: _Owned, told: Callable[[int], None] | None) -> _Owned:
    for group, samples in owned:
        if told is not None:
            told(samples.size)
        yield group, samples
