"""The communication points of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.errors import CosimError

MOST_STEPS = 1e15  # beyond, a step is lost in the rounding of the time
_ROUNDING = 1e-6  # of a step: more than floating point leaves over in 10^9 steps, less than anybody means


@dataclass(frozen=True)
class Schedule:
    """``time = start + n * step_size``, n = 0 ... steps; never added up. Seconds."""

    start_time: float
    step_size: float
    steps: int

    @classmethod
    def between(cls, start_time: float, stop_time: float, step_size: float) -> Schedule:
        """The steps from start to stop, which the step size must divide to rounding.

        A last, shorter step would be a second step size, which FMUs may refuse and which makes results differ.

        Raises:
            CosimError: a time is not finite, the stop does not lie after the start, or the step does not divide.
        """
        if not all(map(math.isfinite, (start_time, stop_time, step_size))):
            raise CosimError(f"start {start_time}, stop {stop_time} and step size {step_size} s must be finite")
        if step_size <= 0.0:
            raise CosimError(f"the step size of {step_size:g} s is not positive")
        if stop_time <= start_time:
            raise CosimError(f"the stop time of {stop_time:g} s does not lie after the start at {start_time:g} s")
        ratio = (stop_time - start_time) / step_size
        if ratio > MOST_STEPS:
            raise CosimError(f"{ratio:.3g} steps of {step_size:g} s from {start_time:g} to {stop_time:g} s are too "
                             "many; take a larger step")
        steps = round(ratio)
        if steps < 1 or abs(ratio - steps) > _ROUNDING:
            whole = max(math.floor(ratio), 1)
            near = f"{start_time + whole * step_size:.9g} or {start_time + (whole + 1) * step_size:.9g} s"
            raise CosimError(f"the step size of {step_size:g} s does not divide the time from {start_time:g} to "
                             f"{stop_time:g} s; stop at {near}, or take a step of "
                             f"{(stop_time - start_time) / max(math.ceil(ratio), 1):.9g} s")
        return cls(start_time, step_size, steps)

    @property
    def stop_time(self) -> float:
        """The last communication point."""
        return self.time(self.steps)

    def time(self, step: int) -> float:
        """The communication point where step number ``step`` begins."""
        return self.start_time + step * self.step_size

    def times(self, count: int, every: int = 1) -> NDArray[np.float64]:
        """The first ``count`` communication points, or of every so many one."""
        return self.start_time + np.arange(count, dtype=np.float64) * every * self.step_size
