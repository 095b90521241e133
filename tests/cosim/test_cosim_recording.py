"""What a run leaves behind, and the communication points it belongs to."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tests.cosim.slaves import FunctionInstance, State, network, variable
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.master import initialize, run
from threadpitch.cosim.result import Result
from threadpitch.cosim.schedule import Schedule

Y = variable("y")
COUNT, FLAG = variable("count", type_="Integer"), variable("flag", type_="Boolean")


def tick(state: State, time: float, step_size: float) -> None:
    state["y"] = time + step_size


@pytest.mark.parametrize(("start", "stop", "step_size", "steps"), [
    (0.0, 3.0, 1e-3, 3000), (0.0, 0.3, 0.1, 3), (1.0, 2.0, 1.0 / 3.0, 3), (0.0, 1000.0, 1e-5, 10**8),
])
def test_steps_that_divide(start: float, stop: float, step_size: float, steps: int) -> None:
    assert Schedule.between(start, stop, step_size).steps == steps


@pytest.mark.parametrize(("start", "stop", "step_size", "message"), [
    (0.0, 1.0, 0.3, r"stop at 0.9 or 1.2 s, or take a step of 0.25 s"),
    (0.0, 1.0, 2.0, r"does not divide"),
    (0.0, 1.0, 0.0, "not positive"), (0.0, 1.0, -1e-3, "not positive"), (1.0, 1.0, 0.1, "does not lie after"),
    (0.0, math.inf, 0.1, "must be finite"), (0.0, 1.0, math.nan, "must be finite"),
])
def test_steps_that_do_not(start: float, stop: float, step_size: float, message: str) -> None:
    with pytest.raises(CosimError, match=message):
        Schedule.between(start, stop, step_size)


def test_result_names_units_and_saves(tmp_path: Path) -> None:
    speed = variable("speed[1,2]", unit="rad/s")

    def turn(state: State, time: float, step_size: float) -> None:
        state["speed[1,2]"] = 0.1 * (time + step_size)
        state["flag"] = 1
        state["count"] = 3

    schedule = Schedule(0.0, 0.1, 5000)
    joined = network([FunctionInstance("a", turn, [speed, FLAG, COUNT])], [],
                     [("a", speed), ("a", FLAG), ("a", COUNT)], schedule)
    initialize(joined, schedule, ())
    run(joined, schedule)
    result = Result(joined.recorder)
    assert list(result) == ["a.speed[1,2]", "a.count", "a.flag"]
    assert result.units["a.speed[1,2]"] == "rad/s"
    assert len(result) == 3
    assert "a.flag" in result
    with pytest.raises(KeyError, match=r"did you mean a\.speed"):
        result["a.sped[1,2]"]
    path = result.save(tmp_path / "new" / "folder")
    assert [found.name for found in path.parent.iterdir()] == ["trace.csv"]
    lines = path.read_text().splitlines()
    assert lines[0] == 'time [s],"a.speed[1,2] [rad/s]",a.count,a.flag'
    table = np.array([[float(number) for number in line.split(",")] for line in lines[1:]])
    assert table[:, 0].tobytes() == result.time.tobytes()
    assert table[:, 1].tobytes() == result["a.speed[1,2]"].tobytes()
    assert table[-1, 2:].tolist() == [3.0, 1.0]
    assert result.save(path.parent) == path


def test_a_failed_save_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    schedule = Schedule(0.0, 1.0, 2)
    joined = network([FunctionInstance("clock", tick, [Y])], [], [("clock", Y)], schedule)
    initialize(joined, schedule, ())
    run(joined, schedule)
    result = Result(joined.recorder)
    path = result.save(tmp_path)
    before = path.read_bytes()

    def fail(path: Path) -> None:
        path.write_text("half of it")
        raise OSError("disk full")

    monkeypatch.setattr(result, "_write_csv", fail)
    with pytest.raises(OSError, match="disk full"):
        result.save(tmp_path)
    assert path.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


def test_more_rows_than_memory_is_told() -> None:
    with pytest.raises(CosimError, match="do not fit into the memory"):
        network([FunctionInstance("clock", tick, [Y])], [], [("clock", Y)], Schedule(0.0, 1.0, 10**15))
