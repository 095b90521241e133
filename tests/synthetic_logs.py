"""Recordings whose true pitches are known."""

from __future__ import annotations

import numpy as np

from threadpitch.trace import TURN, FloatArray, Trace

LEAD = 1.5e-3


def log_with_truth(seed: int) -> tuple[Trace, FloatArray]:
    """A quantised recording with jitter of the sampling and noise of the position; its true P(n) (revolutions,) m."""
    random = np.random.default_rng(seed)
    per_turn = float(random.integers(100, 400))
    counts = float(random.choice([100, 360, 1024, 4096]))
    instants = np.arange(12.0 * per_turn) + random.normal(0.0, 0.02, int(12.0 * per_turn))
    begin, phase, wave = random.uniform(0.0, 1.0), random.uniform(0.0, TURN), random.uniform(0.0, TURN)
    revs = begin + instants / per_turn + 0.003 * np.sin(TURN * 0.37 * instants / per_turn + phase)

    def position(turns: FloatArray) -> FloatArray:
        return LEAD * turns + 2e-6 * np.sin(TURN * 0.23 * turns + wave)

    noise = random.normal(0.0, random.choice([0.0, 1e-7, 5e-7]), revs.size)
    trace = Trace(np.floor(revs * counts) / counts * TURN, position(revs) + noise, resolution=TURN / counts)
    turns = np.arange(15.0)
    return trace, position(turns[1:]) - position(turns[:-1])
