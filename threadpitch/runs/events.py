"""What happens while a machine or a simulation runs, as documents: "begin", "revolution", "result".

Lengths in mm and um, angles in degrees, units in the key names: these documents leave the house as they are, by the
live page and to receivers outside. docs/messages.schema.json describes them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from threadpitch.store import NewEvent, NewRun, StoredPass
from threadpitch.store.records import MEASURED, new_uid
from threadpitch.store.texts import storable
from threadpitch.tables import start_angles_deg
from threadpitch.units import from_si


@dataclass(frozen=True)
class Labels:
    """What an operator says of a run."""

    machine: str = ""
    program: str = ""
    thread: str = ""
    serial_number: str = ""
    note: str = ""


@dataclass(frozen=True)
class Turn:
    """A revolution that is complete; lengths in m."""

    calculator: str
    group: str
    number: int
    start_angle: float  # rad
    pitch: float
    target: float | None = None


class Running:
    """Least, greatest and mean of P(n) of one start angle so far."""

    def __init__(self) -> None:
        self.least, self.greatest, self.total, self.count = math.inf, -math.inf, 0.0, 0

    def add(self, pitch: float) -> tuple[float, float, float]:
        """(minimum, maximum, mean) with this pitch."""
        self.least, self.greatest = min(self.least, pitch), max(self.greatest, pitch)
        self.total, self.count = self.total + pitch, self.count + 1
        return self.least, self.greatest, self.total / self.count


@dataclass
class RunEvents:
    """Makes the events of one run, in their order."""

    kind: str  # "simulation" | "log"
    source: str
    labels: Labels
    uid: str = field(default_factory=new_uid)
    running: dict[tuple[str, str, float], Running] = field(default_factory=dict)

    def begin(self) -> NewEvent:
        """The run begins."""
        return NewEvent("begin", self._about(), self.uid)

    def revolution(self, turn: Turn) -> NewEvent:
        """A revolution is complete."""
        running = self.running.setdefault((turn.calculator, turn.group, turn.start_angle), Running())
        least, greatest, mean = (from_si(value, "mm") for value in running.add(turn.pitch))
        return NewEvent("revolution", {
            "machine": storable(self.labels.machine), "serial_number": storable(self.labels.serial_number),
            "calculator": storable(turn.calculator), "group": storable(turn.group), "turn": turn.number,
            "start_angle_deg": round(from_si(turn.start_angle, "deg"), 9), "pitch_mm": from_si(turn.pitch, "mm"),
            "min_mm": least, "max_mm": greatest, "mean_mm": mean,
            "target_mm": None if turn.target is None else from_si(turn.target, "mm"),
        }, self.uid)

    @staticmethod
    def turns(run: NewRun) -> Iterator[Turn]:
        """All revolutions of a run that is complete, turn by turn; measured pitches are none."""
        for one in run.passes:
            for n in range(0 if one.calculator == MEASURED else one.table.pitch.shape[1]):
                for row, angle in enumerate(one.table.start_angles.tolist()):
                    pitch = float(one.table.pitch[row, n])
                    if not math.isnan(pitch):
                        yield Turn(one.calculator, one.label, n + 1, angle, pitch, one.target)

    def result(self, run: NewRun, number: int) -> NewEvent:
        """The run is complete, and kept under a number."""
        return NewEvent("result", {
            "run_number": number, **self._about(),
            "statistics": [line for one in run.passes for line in statistics_documents(one)],
            "verdict": None if run.verdict is None else {
                key: run.verdict.get(key) for key in ("cause", "sentence", "advice")},
        }, self.uid)

    def _about(self) -> dict[str, Any]:
        texts = {"source": self.source} | {key: text for key, text in vars(self.labels).items() if key != "note"}
        return {"kind": self.kind, **{key: storable(text) for key, text in texts.items()}}


def statistics_documents(one: StoredPass) -> Sequence[dict[str, Any]]:
    """Statistics of a pass over all turns, and over those in the metal where they are known, per start angle."""
    everything, effective = one.table.statistics, one.effective
    found = []
    for row, angle in enumerate(start_angles_deg(one.table)):
        line = {"calculator": storable(one.calculator), "group": storable(one.label), "start_angle_deg": angle,
                "target_mm": _mm(one.target),
                "turns": sum(not math.isnan(value) for value in one.table.pitch[row].tolist())}
        for prefix, values in (("", everything), *([("effective_", effective)] if effective else [])):
            line |= {f"{prefix}min_mm": _mm(values.minimum[row]), f"{prefix}max_mm": _mm(values.maximum[row]),
                     f"{prefix}mean_mm": _mm(values.mean[row])}
        found.append(line)
    return found


def _mm(value: float | None) -> float | None:
    return None if value is None or math.isnan(value) else from_si(float(value), "mm")
