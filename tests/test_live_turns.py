"""Revolutions are heard of while a simulation runs, and are those that its passes have in the end."""

from __future__ import annotations

import numpy as np

from threadpitch import lathe
from threadpitch.live_turns import LiveTurn


def test_turns_are_heard_of_while_it_runs() -> None:
    heard: list[LiveTurn] = []
    times: list[int] = []
    steps: list[int] = []

    def turned(turns: list[LiveTurn]) -> None:
        heard.extend(turns)
        times.append(steps[-1] if steps else 0)

    result = lathe.simulate(start_angles=[0.0, np.pi / 2.0], turned=turned,
                            progress=lambda done, _: steps.append(done))
    expected = {(name, one.number, n + 1, float(angle), float(one.table.pitch[row, n])): one.target
                for name in result.calculators for one in result.passes_of(name)
                for row, angle in enumerate(one.table.start_angles) for n in range(one.table.pitch.shape[1])
                if not np.isnan(one.table.pitch[row, n])}
    found = {(one.calculator, one.number_of_pass, one.turn, one.start_angle, one.pitch): one.target for one in heard}
    assert found == expected
    assert len(heard) == len(expected)  # none twice
    assert len(times) > 1  # not all at the end
    assert min(times) < result.steps
