"""Revolutions are heard of while a simulation runs, and are those that its passes have in the end."""

from __future__ import annotations

from pathlib import Path

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


def test_a_resumed_run_tells_all_its_turns_once(short_run: lathe.Simulation, tmp_path: Path) -> None:
    """Those before the checkpoint too; the numbers of its passes go on."""
    assert lathe.simulate(stop_time=0.7, checkpoint=tmp_path / "state").passes  # turns are complete, the pass is not
    heard: list[LiveTurn] = []
    result = lathe.resume(tmp_path / "state", stop_time=1.2, turned=heard.extend)
    told = sorted((one.calculator, one.number_of_pass, one.turn, one.start_angle, one.pitch) for one in heard)
    assert told == sorted((name, one.number, n + 1, float(angle), float(one.table.pitch[row, n]))
                          for name in short_run.calculators for one in short_run.passes_of(name)
                          for row, angle in enumerate(one.table.start_angles)
                          for n in np.flatnonzero(~np.isnan(one.table.pitch[row])).tolist())
    assert told
    assert result.steps == short_run.steps
