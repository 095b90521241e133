"""Threading passes on paper: a spindle at constant speed, a tool exactly on its helix, and what ThreadCutting tells."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_src.thread_cutting import ThreadCutting

TURN = 2.0 * math.pi
LEAD = 1.5e-3
RADIUS = 0.010
APPROACH = 4.0  # turns
STEP_SIZE = 1e-3
Array = NDArray[np.float64]

# M20x1.5 by dd sqrt(n), k 0.92 mm, dd 0.3 mm, dmin 0, d 0
DEPTHS = [min(0.3e-3 * math.sqrt(n), 0.92e-3) for n in range(1, 11)]
RIGID: dict[str, Any] = {"tool_axial_stiffness": 1e15, "tool_radial_stiffness": 1e15, "chuck_stiffness": 1e15,
                           "bending_stiffness": 1e15}
EXAMPLE: dict[str, Any] = {**RIGID, "material": 0, "specific_cutting_force": 1500e6, "chip_exponent": 0.25}


@dataclass(frozen=True)
class Cut:
    """One pass: depth and shift of the tip along Z at the start, m; which of ``starts`` is cut; length, turns."""

    depth: float
    shift: float = 0.0
    start: int = 0
    turns: float = 16.0


@dataclass
class PassRecord:
    """What ThreadCutting told at the communication points of one pass; angle counts from the pass's start."""

    rows: dict[str, list[Any]] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Array:
        return np.array(self.rows[name], dtype=np.float64)


def cut_passes(cutting: ThreadCutting, cuts: list[Cut], *, starts: int = 1, degrees: float = 3.0,
               lead: float = LEAD) -> list[PassRecord]:
    """The passes one after another, the tool on z = shift + lead (APPROACH - turns), seen every so many degrees."""
    names = ("torque", "axial_force", "radial_force", "cutting_force", "groove_position", "flank_position",
             "chip_thickness", "chip_area", "groove_depth", "tool_z", "chip_radius", "axial_shift", "radial_shift",
             "helix")
    cutting.tool_x = 2.0 * RADIUS
    assert cutting.check() == 0
    cutting.initialize()
    step = math.radians(degrees)
    number = 0
    records = []
    for index, cut in enumerate(cuts):
        begin = TURN * (100.0 * index + cut.start / starts)
        record = PassRecord({name: [] for name in ("angle", *names)})
        for i in range(round((APPROACH + cut.turns) * TURN / step)):
            turned = i * step
            cutting.spindle_angle = begin + turned
            cutting.tool_z = cut.shift + lead * (APPROACH - turned / TURN)
            cutting.tool_x = RADIUS - cut.depth
            cutting.threading = i > 0
            assert cutting.step(number * STEP_SIZE, STEP_SIZE) == 0
            number += 1
            record.rows["angle"].append(turned)
            for name in names:
                value = getattr(cutting, name)
                record.rows[name].append(list(value) if isinstance(value, list) else value)
        records.append(record)
        cutting.threading = False
        assert cutting.step(number * STEP_SIZE, STEP_SIZE) == 0
    return records


def in_metal(record: PassRecord, turns: float = 2.0) -> NDArray[np.bool_]:
    """Points at least so many turns behind the face."""
    return np.asarray(record["angle"] > (APPROACH + turns) * TURN)


def pitches(record: PassRecord, position: Array, first: float, count: int) -> Array:
    """P(n) of ``count`` turns from the ``first`` turn on, counted from where the pass began."""
    marks = (first + np.arange(count + 1)) * TURN
    return np.asarray(-np.diff(np.interp(marks, record["angle"], position)))
