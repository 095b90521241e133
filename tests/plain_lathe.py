"""The threading lathe of plain model objects, stepped in the order of the data: for tests of the physics."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_src.feed_drive import FeedDrive
from fmu_src.pitch_calculator import PitchCalculator
from fmu_src.spindle_drive import SpindleDrive
from fmu_src.threading_controller import ThreadingController

TURN = 2.0 * math.pi
Array = NDArray[np.float64]

IDEAL_DETECTORS: dict[str, dict[str, Any]] = {
    "spindle": {"detector": 0},
    "controller": {"detector": 0},
    "drive": {"encoder_counts": 0.0, "initial_position": 0.006},
}


def merged(*parameter_sets: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Parameter sets by component, the later ones winning."""
    result: dict[str, dict[str, Any]] = {}
    for one in parameter_sets:
        for component, values in one.items():
            result[component] = {**result.get(component, {}), **values}
    return result


@dataclass
class Recording:
    """What a run leaves: arrays over the communication points, and P(n) of start angle i as lists."""

    time: Array
    angle: Array
    detected_angle: Array
    speed: Array
    command: Array
    position: Array
    measured: Array
    threading: NDArray[np.bool_]
    nominal: list[list[float]]
    actual: list[list[float]]


class Lathe:
    """spindle -> controller -> drive -> two pitch calculators."""

    def __init__(self, parameters: dict[str, dict[str, Any]]) -> None:
        self.spindle = SpindleDrive(**parameters.get("spindle", {}))
        self.controller = ThreadingController(**parameters.get("controller", {}))
        self.drive = FeedDrive(**parameters.get("drive", {}))
        self.nominal = PitchCalculator(**parameters.get("calculator", {}))
        self.actual = PitchCalculator(**parameters.get("calculator", {}))
        for model in (self.spindle, self.controller, self.drive, self.nominal, self.actual):
            assert model.check() == 0
        self.spindle.initialize()
        self.drive.initialize()
        self.controller.z_position = self.drive.measured_position
        self.controller.x_position = self.controller.x_clear
        self._connect_controller()
        self.controller.initialize()
        self.spindle.speed_command = self.controller.spindle_speed_command
        self.drive.position_command = self.controller.z_command
        self.spindle.initialize()
        self.drive.initialize()
        for calculator in (self.nominal, self.actual):
            self._connect(calculator)
            calculator.initialize()

    def _connect_controller(self) -> None:
        self.controller.spindle_angle = self.spindle.encoder_angle
        self.controller.encoder_count = self.spindle.encoder_count
        self.controller.index_count = self.spindle.index_count
        self.controller.index_latch = self.spindle.index_latch
        self.controller.z_position = self.drive.measured_position

    def _connect(self, calculator: PitchCalculator) -> None:
        true = calculator is self.actual
        calculator.spindle_angle = self.spindle.angle if true else self.spindle.encoder_angle
        calculator.feed_position = self.drive.position if true else self.drive.measured_position
        calculator.threading = self.controller.threading
        calculator.threading_angle = self.controller.start_angle

    def step(self, time: float, step_size: float) -> None:
        """One communication step in the order of the data."""
        self.spindle.speed_command = self.controller.spindle_speed_command
        assert self.spindle.step(time, step_size) == 0
        self._connect_controller()
        assert self.controller.step(time, step_size) == 0
        self.controller.x_position = self.controller.x_command  # an ideal X axis
        self.drive.position_command = self.controller.z_command
        assert self.drive.step(time, step_size) == 0
        for calculator in (self.nominal, self.actual):
            self._connect(calculator)
            assert calculator.step(time, step_size) == 0

    def run(self, stop_time: float, step_size: float = 1e-3,
            before: Callable[[Lathe, float], None] | None = None) -> Recording:
        """Steps to stop_time; `before(lathe, time)` may change inputs before each step."""
        rows = []
        pitches: tuple[list[list[float]], list[list[float]]] = ([[] for _ in range(8)], [[] for _ in range(8)])
        for n in range(round(stop_time / step_size)):
            if before is not None:
                before(self, n * step_size)
            self.step(n * step_size, step_size)
            for calculator, lists in zip((self.nominal, self.actual), pitches, strict=True):
                for i in range(8):
                    lists[i] += [calculator.completed_pitch[8 * i + j] for j in range(calculator.completed[i])]
            rows.append(((n + 1) * step_size, self.spindle.angle, self.spindle.encoder_angle, self.spindle.speed,
                         self.controller.z_command, self.drive.position, self.drive.measured_position,
                         self.controller.threading))
        columns = [np.array(column) for column in zip(*rows, strict=True)]
        names = [one.name for one in fields(Recording)]
        found: dict[str, Any] = dict(zip(names, [*columns, *pitches], strict=True))
        return Recording(**found)


def start_angles(*degrees: float) -> dict[str, Any]:
    """Calculator parameters for these start angles."""
    padded = [math.radians(angle) for angle in degrees] + [0.0] * (8 - len(degrees))
    return {"start_angle": padded, "start_angle_count": len(degrees)}
