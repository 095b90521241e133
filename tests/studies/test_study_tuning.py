"""The least value within limits is found, the same way each time, and a search that was stopped goes on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import Command
from threadpitch.studies import StudyError, tune

# Rosenbrock's function within a circle: the least value lies on it, at (0.7864, 0.6177).
VALLEY: dict[str, Any] = {
    "study": {"system": "none", "seed": 3}, "parameters": {"a": {"from": -5, "to": 5}, "b": {"from": -5, "to": 5}},
    "outcomes": {"y": "(1 - a) ** 2 + 100 * (b - a ** 2) ** 2", "r": "hypot(a, b)"}, "limits": {"r": 1.0},
    "tune": {"minimise": "y", "evaluations": 1000}}


def test_the_least_value_within_a_limit(tmp_path: Path) -> None:
    found = tune(VALLEY, output=tmp_path, workers=0)
    assert found.within_limits
    assert found.parameters == pytest.approx({"a": 0.7864, "b": 0.6177}, abs=0.02)
    assert found.outcomes["y"] == pytest.approx(0.0457, abs=0.003)
    assert found.evaluations <= 1000
    assert json.loads((tmp_path / "best.json").read_text())["parameters"] == found.parameters


def test_a_search_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    whole = tune(VALLEY, output=tmp_path / "whole", workers=0)

    def stop(done: int, most: int) -> None:
        if done > 300:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tune(VALLEY, output=tmp_path / "parts", workers=0, progress=stop)
    history = tmp_path / "parts" / "points.jsonl"
    kept = len(history.read_text().splitlines()) - 1
    assert kept > 250
    with history.open("a") as file:
        file.write("[[1.0, ")  # killed while it wrote
    again = tune(VALLEY, output=tmp_path / "parts", workers=0)
    assert (again.parameters, again.evaluations) == (whole.parameters, whole.evaluations)


def test_where_no_point_keeps_the_limits_the_nearest_is_told(tmp_path: Path) -> None:
    document = {**VALLEY, "parameters": {"a": {"from": 2, "to": 5}, "b": {"from": 2, "to": 5}}}
    found = tune(document, output=tmp_path, workers=0)
    assert not found.within_limits
    assert found.parameters == pytest.approx({"a": 2.0, "b": 2.0}, abs=0.01)


def test_the_search_goes_the_same_way_wherever_its_points_are_computed(tmp_path: Path) -> None:
    from distributed import LocalCluster

    document = {**VALLEY, "tune": {"minimise": "y", "evaluations": 60}}
    here = tune(document, output=tmp_path / "here", workers=0)
    workers = tune(document, output=tmp_path / "workers", workers=2)
    with LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address="127.0.0.1:0",
                      scheduler_kwargs={"dashboard": False}) as cluster:
        there = tune(document, output=tmp_path / "there", scheduler=cluster.scheduler_address)
    points = {(tmp_path / name / "points.jsonl").read_bytes() for name in ("here", "workers", "there")}
    assert len(points) == 1
    assert here.parameters == workers.parameters == there.parameters
    assert here.evaluations == 60  # as many as were granted: points that the simplex comes back to count once
    assert points.pop().count(b"\n") == 61  # and the head
    more = tune({**VALLEY, "tune": {"minimise": "y", "evaluations": 80}}, output=tmp_path / "here", workers=0)
    assert more.evaluations == 80


@pytest.mark.parametrize(("changed", "why"), [
    ({"tune": {}}, "there is no"), ({"tune": {"minimise": "z"}}, "no outcome is called 'z'"),
    ({"tune": {"minimise": "y", "evaluations": 0}}, "no number of points"),
    ({"tune": {"minimise": "y", "rounds": 3}}, "'rounds' is not known"),
    ({"parameters": {"a": {"distribution": "norm"}, "b": [1, 2]}}, "has no bounds"),
    ({"outcomes": {"y": "sqrt(-1 - a ** 2)", "r": "b"}}, "no point could be computed"),
])
def test_what_cannot_be_tuned_is_refused(tmp_path: Path, changed: dict[str, Any], why: str) -> None:
    with pytest.raises(StudyError, match=why):
        tune({**VALLEY, **changed}, output=tmp_path, workers=0)


def test_a_queue_that_is_not_configured_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"no \[cluster\]"):
        tune(VALLEY, output=tmp_path, queue=True)


def test_command_tunes_a_lathe(threadpitch: Command, workplace: Path) -> None:
    """The lag at the end of a short run falls with the gain, which the torque of the drive limits."""
    Path("tune.toml").write_text(
        '[study]\nstop_time = 0.4\n[parameters.z_drive]\nposition_gain = { from = 20, to = 80 }\n[outcomes]\n'
        'lag = "max(abs(z_drive.following_error))"\ntorque = "max(abs(z_drive.torque))"\n[limits]\ntorque = 100\n'
        '[tune]\nminimise = "lag"\nevaluations = 14\n')
    told = threadpitch("tune", "tune.toml", "--workers", 0, "--parameters", "best.toml", "--json")
    assert json.loads(told.out)["parameters"]["z_drive.position_gain"]["si"] > 60.0
    assert Path("best.toml").read_text().startswith('"z_drive.position_gain" = ')
    assert threadpitch("run", "--parameters", "best.toml", "--stop-time", "0.3").status in (0, 2)
    refused = threadpitch("tune", "nowhere.toml")
    assert refused.status == 2
    assert refused.err.count("\n") == 1
