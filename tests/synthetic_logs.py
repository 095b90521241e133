"""Recordings whose true pitches are known, under conditions drawn at random."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from threadpitch.trace import TURN, FloatArray, Trace

LEAD = 1.5e-3


@dataclass(frozen=True)
class Conditions:
    """Of a recording."""

    counts_per_turn: float
    samples_per_turn: float
    turns: float
    jitter: float  # of the instants, standard deviation in samples
    lateness: float  # of the position, scatter from sample to sample, standard deviation in samples
    ripple: float  # of the spindle, turns
    ramp: float  # of the speed, share over the recording
    noise: float  # of the position, standard deviation in m
    position_count: float  # m; 0 = not rounded
    count_given: float  # 1: the trace knows the count of the angle

    @property
    def counts_per_sample(self) -> float:
        return self.counts_per_turn / self.samples_per_turn


@dataclass(frozen=True, eq=False)
class SyntheticLog:
    """A recording and the truth."""

    trace: Trace
    pitch: FloatArray  # (revolutions,) m
    conditions: Conditions


def drawn(random: np.random.Generator) -> Conditions:
    """Conditions of one recording."""
    def one_of(*values: float) -> float:
        return float(random.choice(values))

    return Conditions(
        counts_per_turn=one_of(100.0, 360.0, 1024.0, 4096.0, 16384.0),
        samples_per_turn=float(np.exp(random.uniform(np.log(60.0), np.log(1200.0)))),
        turns=one_of(3.0, 6.0, 12.0), jitter=one_of(0.0, 0.02, 0.2), lateness=one_of(0.0, 0.02, 0.1),
        ripple=one_of(0.0, 0.0005, 0.003), ramp=one_of(0.0, 0.2), noise=one_of(0.0, 1e-7, 5e-7, 2e-6),
        position_count=one_of(0.0, 1e-7, 1e-6), count_given=one_of(0.0, 1.0))


def log_with_truth(seed: int) -> SyntheticLog:
    """A recording of a quantised angle; jitter keeps the order of the samples (it is evenly distributed)."""
    random = np.random.default_rng(seed)
    given = drawn(random)
    begin, (phase, wave) = random.uniform(0.0, 1.0), random.uniform(0.0, TURN, 2)
    order = random.uniform(0.2, 1.2)

    def revolutions(instants: FloatArray) -> FloatArray:
        turns = instants / given.samples_per_turn
        ripple: FloatArray = given.ripple * np.sin(TURN * order * turns + phase)
        return begin + turns + 0.5 * given.ramp * turns**2 / given.turns + ripple

    def position(turns: FloatArray) -> FloatArray:
        of_screw: FloatArray = 2e-6 * np.sin(TURN * 0.23 * turns + wave)
        return LEAD * turns + of_screw

    instants = np.arange(given.turns * given.samples_per_turn)
    instants += given.jitter * np.sqrt(3.0) * random.uniform(-1.0, 1.0, instants.size)
    late = instants - given.lateness * random.normal(size=instants.size)
    measured = position(revolutions(late)) + given.noise * random.normal(size=instants.size)
    if given.position_count > 0.0:
        measured = np.rint(measured / given.position_count) * given.position_count
    count = TURN / given.counts_per_turn
    trace = Trace(np.floor(revolutions(instants) * given.counts_per_turn) * count, measured,
                  resolution=count * given.count_given)
    return SyntheticLog(trace, np.diff(position(np.arange(20.0))), given)
