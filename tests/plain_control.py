"""The controller alone under a steady spindle and drives without lag: what it commands, period by period."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_src.threading_controller import ThreadingController

TURN = 2.0 * math.pi
PERIOD = 1e-3
COUNTS = 4096
DONE, ALARMED = 8, 9
COLUMNS = ("angle", "phase", "pass_number", "start_number", "pass_kind", "cut_depth", "z_command", "x_command", "gate",
           "threading", "block", "coincidence", "counter", "start_angle", "z_pulses", "x_pulses", "rotation", "alarm",
           "holding")


@dataclass
class Commands:
    """Columns over the periods, and the controller as it stands at the end."""

    columns: dict[str, NDArray[np.float64]]
    controller: ThreadingController

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.columns[name]

    def of_pass(self, number: int) -> Commands:
        """The rows in which this pass is in step with the spindle."""
        rows = (self["pass_number"] == number) & (self["threading"] == 1.0)
        return Commands({name: column[rows] for name, column in self.columns.items()}, self.controller)

    @property
    def passes(self) -> list[Commands]:
        return [self.of_pass(number + 1) for number in range(self.controller.pass_number)]


def controller_of(**parameters: Any) -> ThreadingController:
    """A controller whose start mode is as good as none, at any speed, with array parameters filled up."""
    made = ThreadingController(**{"acceleration_limit": 1e6, "speed_settling": 0.0, "speed_tolerance": 1.0,
                                  "detector": 0, **parameters})
    for name, size in (("depth", 32), *((f"further_{one}", 31) for one in (
            "z", "x", "lead", "lead_change", "start_angle"))):
        values = getattr(made, name)
        setattr(made, name, [*values, *[0.0] * (size - len(values))])
    made.z_position, made.x_position = made.z_start, made.x_clear
    return made


def commanded(controller: ThreadingController, *, rpm: float | None = None, periods: int = 200000,
              before: Callable[[ThreadingController, int], float | None] | None = None) -> Commands:
    """Run until done or stopped by an alarm; ``before`` may set inputs and return another speed, in rpm."""
    speed = controller.commanded_speed if rpm is None else rpm / 60.0 * TURN
    assert controller.check() == 0
    controller.initialize()
    rows = []
    angle = 0.3
    for n in range(periods):
        if before is not None:
            other = before(controller, n)
            speed = speed if other is None else other / 60.0 * TURN
        angle += speed * PERIOD
        count = math.floor(angle / TURN * COUNTS)
        controller.spindle_angle = angle
        controller.encoder_count = float(count)
        controller.index_count = count // COUNTS
        controller.index_latch = float(count // COUNTS * COUNTS)
        assert controller.step(n * PERIOD, PERIOD) == 0
        controller.z_position, controller.x_position = controller.z_command, controller.x_command
        rows.append((angle, *(float(getattr(controller, name)) for name in COLUMNS[1:])))
        if controller.phase in (DONE, ALARMED):
            break
    return Commands(dict(zip(COLUMNS, np.array(rows).T, strict=True)), controller)
