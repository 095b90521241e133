"""Traces of SINUMERIK Operate, saved as XML.

    <traceSession>
      <traceData>
        <dataFrame>
          <frameHeader startTime="..."/>
          <dataSignal id="f1" name="/Nck/!SD/nckServoDataActPos1stEnc64 [u1, 3]" key="..."/>
          <rec time="0.000" f1="12.5" f2="359.1"/>

Siemens does not publish the layout; this is what three public readers of such files agree on (SinumerikTraceHandler,
eliasrhoden/Trace-Tools, and one built on xmltodict). What they tell differently is taken so: ``time`` is in seconds; a
record in which a signal is missing has no sample of it, and between its samples a signal is interpolated. Older files
have the description of a signal in ``dataSignal``, newer ones under ``traceDisplaySetup``, by the ``key``. Units are
not in the file: positions of linear axes are mm, of rotary axes and spindles degrees (SINUMERIK Operate's
commissioning manual, Trace).
"""

from __future__ import annotations

from array import array
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from threadpitch.trace.choice import brief
from threadpitch.trace.recording import TraceError
from threadpitch.trace.soundness import FloatArray

ROOT = b"<traceSession"
ANGLE_UNIT = "deg"
_FRAME, _SIGNAL, _RECORD = "dataFrame", "dataSignal", "rec"


@dataclass
class Signal:
    """A recorded variable: its address in the control, and its samples."""

    address: str
    description: str = ""
    time: array[float] = field(default_factory=lambda: array("d"))  # (samples,) s
    values: array[float] = field(default_factory=lambda: array("d"))  # (samples,)

    @property
    def name(self) -> str:
        """Description and address, as far as they are there."""
        return f"{self.description}: {self.address}" if self.description else self.address

    @property
    def instants(self) -> FloatArray:
        """(samples,) s."""
        return np.array(self.time)

    @property
    def samples(self) -> FloatArray:
        """(samples,) in the control's unit."""
        return np.array(self.values)


@dataclass(frozen=True)
class Session:
    """The signals of a trace, and the number of data frames, of which the first is read."""

    signals: list[Signal]
    frames: int


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
    return Session(list(session.signals.values()), session.frames)


@dataclass
class _Reading:
    """A session while its elements come."""

    path: Path
    signals: dict[str, Signal] = field(default_factory=dict)  # by their id: f1, f2, ...
    keys: dict[str, str] = field(default_factory=dict)  # of the signals
    texts: dict[str, str] = field(default_factory=dict)  # key: description
    frames: int = 0

    def take(self, element: Any) -> None:
        name, given = etree.QName(element).localname, element.attrib
        if name == _FRAME:
            self.frames += 1
        elif name == _SIGNAL and self.frames == 0:
            own = given.get("id", f"f{len(self.signals) + 1}")
            self.keys[own] = given.get("key", "")
            self.signals[own] = Signal(given.get("name", own), given.get("description", ""))
        elif name == _RECORD and self.frames == 0:
            self._take_record(element)
        elif name != _SIGNAL and "description" in given and "key" in given:
            self.texts[given["key"]] = given["description"]

    def _take_record(self, record: Any) -> None:
        place = f"{self.path}:{record.sourceline}"
        time = _number(record.attrib.get("time", ""), "time", place)
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


def _number(text: str, name: str, place: str) -> float:
    try:
        return float(text if "_" not in text else "")
    except ValueError:
        raise TraceError(f"{place}: {brief(name)} holds {brief(text)}, not a number; mend or leave out this record") \
            from None
