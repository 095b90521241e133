"""Traces of SINUMERIK Operate, saved as XML.

    <traceSession>
      <traceData>
        <dataFrame>
          <frameHeader startTime="..." dropOuts="0" stopInc="..."/>
          <dataSignal id="f1" interval="0.002" name="/Nck/!SD/nckServoDataActPos1stEnc64 [u1, 3]" key="..."/>
          <rec time="0.000" f1="12.5" f2="359.1"/>

Siemens does not publish the layout. This is what a trace that a control of version 01.00.03.02 wrote shows, and what
public readers of such files agree on:

- ``time`` is in seconds. Each signal has an ``interval`` of its own, that of the servo or of the interpolator.
- A record has the signals that were sampled and have changed. One that is missing at an instant of its own holds the
  value it had, so it is put in there; where nothing changed the whole record is missing.
- A switch is ``true`` or ``false``; ``dataType`` is float or double, else a whole number that holds between samples.
- ``dropOuts`` counts what was lost.
- Older files have the description of a signal in ``dataSignal``, newer ones under ``traceDisplaySetup``, by the
  ``key``.
- ``unitsType`` tells the kind of a unit (posn, velo), not the unit: positions of linear axes are mm, of rotary axes and
  spindles degrees (SINUMERIK Operate's commissioning manual, Trace).
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from threadpitch.trace.choice import brief
from threadpitch.trace.passes import Array
from threadpitch.trace.recording import TraceError
from threadpitch.trace.soundness import FloatArray

ROOT = b"<traceSession"
ANGLE_UNIT = "deg"
_FRAME, _HEADER, _SIGNAL, _RECORD = "dataFrame", "frameHeader", "dataSignal", "rec"
_FLOATING = ("", "float", "double")
_LEVELS = {"true": 1.0, "false": 0.0}
_MOST_FILLED = 10_000  # instants for every value that is there: no file makes more of itself than memory can hold
_OFF_GRID = 0.25  # of the interval; farther from its instants a signal is taken as it is


@dataclass
class Signal:
    """A recorded variable: its address in the control, and its samples."""

    address: str
    description: str = ""
    interval: float = math.nan  # s, between its instants; NaN = not told
    floating: bool = True
    time: array[float] = field(default_factory=lambda: array("d"))  # (samples,) s
    values: array[float] = field(default_factory=lambda: array("d"))  # (samples,)

    @property
    def name(self) -> str:
        """Description and address, as far as they are there."""
        return f"{self.description}: {self.address}" if self.description else self.address

    def sampled(self, end: float) -> tuple[FloatArray, Array]:
        """(time (samples,) s, values (samples,)) at every instant of the signal, up to the last record at ``end`` s.

        Where there was no record of it, it has the value of the one before.
        """
        time, values = np.array(self.time), np.array(self.values)
        if not self.floating and np.all(values == np.rint(values)):
            values = values.astype(np.int64)
        steps = np.diff(time)
        interval = self.interval if self.interval > 0.0 else float(steps[steps > 0.0].min(initial=math.inf))
        if time.size < 2 or not math.isfinite(interval):
            return time, values
        places = np.rint((time - time[0]) / interval)
        off = float(np.max(np.abs(time - time[0] - places * interval)))
        if off > _OFF_GRID * interval or np.any(np.diff(places) < 1.0) or places[-1] > _MOST_FILLED * time.size + 1e6:
            return time, values
        size = 1 + int(places[-1]) + max(math.floor((end - time[-1]) / interval + _OFF_GRID), 0)
        last = np.searchsorted(places, np.arange(size), side="right") - 1
        filled = time[0] + interval * np.arange(size)
        filled[places.astype(np.int64)] = time
        return filled, values[last]


@dataclass(frozen=True)
class Session:
    """The signals of a trace, the time of its last record, s, and the data frames, of which the first is read."""

    signals: list[Signal]
    end: float
    frames: int
    drop_outs: str


def read_session(path: Path) -> Session:
    """The signals of a saved trace; the file is gone through once, record by record.

    Raises:
        TraceError: the XML is damaged, there is no record, or a record holds what is no number.
    """
    session = _Reading(path)
    with closing(_elements(path)) as elements:
        for element in elements:
            session.take(element)
    for own, signal in session.signals.items():
        signal.description = signal.description or session.texts.get(session.keys[own], "")
    if not any(signal.values for signal in session.signals.values()):
        raise TraceError(f"{path}: the trace holds no records; record it, and save it with its data")
    return Session(list(session.signals.values()), session.end, session.frames, session.drop_outs)


@dataclass
class _Reading:
    """A session while its elements come."""

    path: Path
    signals: dict[str, Signal] = field(default_factory=dict)  # by their id: f1, f2, ...
    keys: dict[str, str] = field(default_factory=dict)  # of the signals
    texts: dict[str, str] = field(default_factory=dict)  # key: description
    frames: int = 0
    end: float = 0.0
    drop_outs: str = "0"

    def take(self, element: Any) -> None:
        name, given = etree.QName(element).localname, element.attrib
        if name == _FRAME:
            self.frames += 1
        elif name == _SIGNAL and self.frames == 0:
            own = given.get("id", f"f{len(self.signals) + 1}")
            self.keys[own] = given.get("key", "")
            self.signals[own] = Signal(given.get("name", own), given.get("description", ""),
                                       _interval(given.get("interval", "")), given.get("dataType", "") in _FLOATING)
        elif name == _HEADER and self.frames == 0:
            self.drop_outs = given.get("dropOuts", "0")
        elif name == _RECORD and self.frames == 0:
            self._take_record(element)
        elif name != _SIGNAL and "description" in given and "key" in given:
            self.texts[given["key"]] = given["description"]

    def _take_record(self, record: Any) -> None:
        place = f"{self.path}:{record.sourceline}"
        time = self.end = _number(record.attrib.get("time", ""), "time", place)
        for name, text in record.attrib.items():
            if name in self.signals:
                self.signals[name].time.append(time)
                self.signals[name].values.append(_number(text, name, place))


def _elements(path: Path) -> Generator[Any]:
    """All elements at their ends; what was seen is forgotten. Entities are not followed: a file may bring none in."""
    try:
        with open(path, "rb") as file:
            for _, element in etree.iterparse(file, resolve_entities=False, no_network=True, load_dtd=False):
                yield element
                if etree.QName(element).localname == _RECORD:
                    element.clear()
                    while element.getprevious() is not None:
                        del element.getparent()[0]
    except etree.XMLSyntaxError as error:
        raise TraceError(f"{path}:{error.lineno}: the XML is damaged ({error.msg}); copy or save it again") from None


def _interval(text: str) -> float:
    """s; NaN where it is not told."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _number(text: str, name: str, place: str) -> float:
    try:
        return _LEVELS[text] if text in _LEVELS else float(text if "_" not in text else "")
    except ValueError:
        raise TraceError(f"{place}: {brief(name)} holds {brief(text)}, not a number; mend or leave out this record") \
            from None
