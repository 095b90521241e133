"""How components are coupled, as the command line says it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.conftest import Command, assert_one_line

QUICK = ("--stop-time", "0.7", "--start-angle", "0")
EVENTS = ("--event", "spindle.angle=720deg:rising", "z_drive.position=3mm")


def test_events_are_told_and_a_resumed_run_tells_the_same(threadpitch: Command, workplace: Path) -> None:
    assert threadpitch("run", "--stop-time", "0.6", "--start-angle", "0", *EVENTS, "--checkpoint", "state").status == 0
    resumed = threadpitch("resume", "state", "--stop-time", "0.7", "--output", "resumed", "--json")
    whole = threadpitch("run", *QUICK, *EVENTS)
    assert (resumed.status, whole.status, whole.err) == (0, 0, "")
    document = json.loads((workplace / "threadpitch-run" / "result.json").read_text())
    assert [(one["variable"], one["direction"]) for one in document["events"]] == [
        ("spindle.angle", "rising"), ("z_drive.position", "falling")]
    assert json.loads(resumed.out)["events"] == document["events"]
    for name in ("trace.csv", "pitch.csv", "tables.txt"):
        assert (workplace / "resumed" / name).read_bytes() == (workplace / "threadpitch-run" / name).read_bytes()
    times = [float(line.partition(",")[0])
             for line in (workplace / "threadpitch-run" / "trace.csv").read_text().splitlines()[1:]]
    for one in document["events"]:
        assert one["time_s"] in times
        assert f"event: {one['variable']} {one['direction']} at t = {one['time_s']:.9g} s" in whole.out


@pytest.mark.parametrize(("options", "wanted"), [
    (("--coupling", "jacobi"), {"coupling": "jacobi"}),
    (("--coupling", "iterated", "--tolerance", "1e-6"), {"coupling": "iterated", "tolerance": 1e-6}),
    (("--extrapolation", "2"), {"extrapolation": 2}),
    (("--multiple", "nominal_pitch=2", "actual_pitch=7"), {"multiples": {"nominal_pitch": 2, "actual_pitch": 7}}),
    (("--adaptive", "0.01"), {"step_control": {"relative": 0.01, "absolute": 0.0, "smallest": 1e-9}}),
])
def test_the_method_is_the_one_that_was_asked_for(threadpitch: Command, workplace: Path, options: tuple[str, ...],
                                                  wanted: dict[str, object]) -> None:
    assert threadpitch("run", *QUICK, *options, "--results", "rows.csv").status == 0
    method = json.loads((workplace / "rows.csv.json").read_text())["method"]
    assert {name: method[name] for name in wanted} == wanted


@pytest.mark.parametrize(("options", "message"), [
    (("--coupling", "seidel"), "coupling 'seidel' is not known; choose one of gauss-seidel, jacobi, iterated"),
    (("--extrapolation", "3"), "extrapolation of order 3 is not known; choose 0 to 2"),
    (("--multiple", "nominal_pitch=x"), "write it like nominal_pitch=4"),
    (("--multiple", "pitch=2"), "no component 'pitch'"),
    (("--multiple", "nominal_pitch=3"), "700 steps are not a multiple of 3; stop 0.002 s later"),
    (("--coupling", "iterated", "--multiple", "nominal_pitch=2"), "iterated steps and steps of its own do not go"),
    (("--adaptive", "1e-3", "--multiple", "nominal_pitch=2"), "whose size is free and steps of its own do not go"),
    (("--tolerance", "1e-3"), "--tolerance serves --coupling iterated"),
    (("--adaptive", "0"), "allow no step"),
    (("--event", "spindle.angle"), "write it like spindle.angle=90deg:rising"),
    (("--event", "spindle.angel=1deg"), "did you mean angle"),
    (("--event", "spindle.angle=90V"), "unit 'V' cannot be converted to 'rad'"),
    (("--event", "spindle.angle=90deg:up"), "direction 'up' is not known; choose one of both, rising, falling"),
])
def test_what_cannot_be_is_said_in_one_line(threadpitch: Command, workplace: Path, options: tuple[str, ...],
                                            message: str) -> None:
    outcome = threadpitch("run", *QUICK, *options)
    assert outcome.status == 2
    assert_one_line(outcome.err, message)
    assert not (workplace / "threadpitch-run").exists()
