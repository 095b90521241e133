"""Steps of free size: the error asks for them, or an event does."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cosim.slaves import FunctionInstance, State, variable
from tests.cosim.test_cosim_accuracy import exact, oscillator
from threadpitch.cosim import (
    CosimError,
    Event,
    Method,
    Result,
    StepControl,
    StepError,
    SystemStructureError,
    resume,
    simulate,
)
from threadpitch.cosim.block import Channel
from threadpitch.cosim.engine import choose_engine
from threadpitch.cosim.events import Level
from threadpitch.cosim.master import initialize, run
from threadpitch.cosim.method import read_method
from threadpitch.cosim.network import Network
from threadpitch.cosim.recording import Recorder
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.system import Component, Connection, System
from threadpitch.fmu import available_compiler, cached_fmu

Factory = Callable[..., Path]
Y = variable("y")
FLAG = variable("flag", "output", "Boolean")
native = pytest.mark.skipif(available_compiler() is None, reason="no C compiler and no ziglang")


def clock(law: Callable[[float], float]) -> FunctionInstance:
    """y = law(t), and flag = y > 0, at the end of every step."""
    def step(state: State, time: float, step_size: float) -> None:
        state["y"] = law(time + step_size)
        state["flag"] = float(state["y"] > 0.0)

    return FunctionInstance("clock", step, [Y, FLAG])


def waited(law: Callable[[float], float], events: Sequence[Event], schedule: Schedule) -> Result:
    variables = {"clock.y": Y, "clock.flag": FLAG}
    recorder = Recorder([Channel("clock", Y)], schedule)
    levels = [Level(event, "clock", variables[event.variable], float(event.level)) for event in events]
    joined = Network([clock(law)], [], recorder, Method(events=tuple(events)), levels)
    algorithm = choose_engine(joined)
    initialize(joined, schedule, ())
    run(joined, schedule, algorithm)
    return Result(recorder)


@pytest.mark.parametrize("step_size", [2.0, 0.5, 0.01])
def test_a_crossing_is_located_whatever_the_step(step_size: float) -> None:
    schedule = Schedule(0.0, step_size, round(8 / step_size))
    result = waited(lambda t: math.sin(t) - 0.25 * t, [Event("clock.y")], schedule)
    last = result.events[-1]
    assert last.time == pytest.approx(2.4745767873698290, abs=1e-9)
    assert last.direction == "falling"
    assert last.time in result.time
    assert result.time.size == schedule.steps + 1 + len(result.events)
    assert (np.diff(result.time) > 0.0).all()
    assert result["clock.y"][result.time == last.time][0] == pytest.approx(0.0, abs=1e-8)
    assert result["clock.y"][result.time == last.time][0] <= 0.0


def test_directions_and_several_events_in_one_step() -> None:
    rising, falling = Event("clock.y", 0.5, "rising"), Event("clock.y", 0.5, "falling")
    found = waited(math.sin, [rising], Schedule(0.0, 1.0, 12)).events
    expected = [(math.pi / 6 + turn * 2 * math.pi, "rising") for turn in range(2)]
    assert [one.direction for one in found] == ["rising"] * 2
    assert [one.time for one in found] == pytest.approx([time for time, _ in expected], abs=1e-9)
    both = waited(lambda t: -math.cos(t), [rising, falling, Event("clock.y", 0.9)], Schedule(0.0, 1.0, 6)).events
    times = [math.acos(-0.5), math.acos(-0.9), 2 * math.pi - math.acos(-0.9), 2 * math.pi - math.acos(-0.5)]
    assert [one.time for one in both] == pytest.approx(times, abs=1e-9)


def test_a_boolean_switches_where_it_does() -> None:
    found = waited(lambda t: t - math.e, [Event("clock.flag", 0.5)], Schedule(0.0, 1.0, 4)).events
    assert [one.time for one in found] == pytest.approx([math.e], abs=1e-9)


@native
@pytest.mark.parametrize("step_size", [0.05, 0.01])
def test_events_of_a_coupled_system_come_nearer_with_the_step(step_size: float) -> None:
    """x1 = 0 of the exact solution, found with a method of order 3: an error of 1e-3 at 50 ms, 125 times less at 10."""
    start = exact(0.0).tolist()
    result = simulate(oscillator(2), step_size=step_size, stop_time=2.0,
                      parameters={"first.start": start, "second.start": start},
                      method=Method("iterated", 2, events=(Event("first.x1", 0.0),)))
    assert len(result.events) == 2
    for event in result.events:
        slope = exact(event.time)[1]
        assert abs(exact(event.time)[0] / slope) < 30.0 * step_size**3
        assert abs(result["first.x1"][result.time == event.time][0]) < 1e-9 * abs(slope)
    again = simulate(oscillator(2), step_size=step_size, stop_time=2.0,
                     parameters={"first.start": start, "second.start": start}, method=read_method(
                         json.loads(json.dumps(asdict(Method("iterated", 2, events=(Event("first.x1", 0.0),)))))))
    assert again.time.tobytes() == result.time.tobytes()
    assert again["second.force"].tobytes() == result["second.force"].tobytes()


@native
@pytest.mark.parametrize("coupling", ["gauss-seidel", "iterated"])
def test_a_smaller_error_costs_more_steps(coupling: str) -> None:
    start, found = exact(0.0).tolist(), []
    for relative in (1e-3, 1e-4, 1e-5):
        result = simulate(oscillator(2), step_size=0.1, stop_time=2.0,
                          parameters={"first.start": start, "second.start": start},
                          method=Method(coupling, 1, step_control=StepControl(relative)))
        state = [result[name][-1] for name in ("first.x1", "first.v1", "second.x2", "second.v2")]
        found.append((np.linalg.norm(state - exact(2.0)) / np.linalg.norm(exact(2.0)), result.time.size))
        grid = np.round(result.time / 0.1, 9) % 1.0 == 0.0
        assert grid.sum() == 21  # the points of the schedule are among them
        assert result.completed
        assert np.diff(result.time).max() <= 0.1
    for (coarse, few), (fine, many) in pairwise(found):
        assert fine < 0.5 * coarse
        assert 1.3 * few < many < 10 * few


@pytest.mark.parametrize("announced", [True, False])
@pytest.mark.parametrize("control", [None, StepControl(0.1)])
def test_fmus_of_fmi_3_end_steps_where_they_have_events(probe_fmu: Path, probe3_fmu: Path, announced: bool,
                                                        control: StepControl | None) -> None:
    """Every 0.03 s, in steps of 0.02 s: announced beforehand, or found in the step, which then returns early."""
    system = System("two", (Component("a", probe3_fmu), Component("b", probe_fmu)), (
        Connection("a", "events", "b", "number"), Connection("a", "x", "b", "u")))
    given = {"a.period": 0.03, "a.announced": announced, "a.u": 1.0}
    result = simulate(system, step_size=0.02, stop_time=0.2, parameters=given, record=("outputs",),
                      method=Method(event_mode=True, step_control=control))
    times = [0.03 * n for n in range(1, 7)]
    assert [one.time for one in result.events] == pytest.approx(times, abs=1e-12)
    assert {(one.variable, one.direction) for one in result.events} == {("a.tick", "tick")}
    counts = [int(np.floor(time / 0.03 + 1e-9)) for time in result.time]
    assert result["a.events"].tolist() == counts
    assert all(any(abs(time - one.time) < 1e-12 for time in result.time) for one in result.events)
    assert (np.diff(result.time) > 1e-9).all()
    assert result["b.number_out"][1:].tolist() == counts[:-1]  # it takes part in the next step
    plain = simulate(system, step_size=0.02, stop_time=0.2, parameters=given)
    assert plain.events == ()
    assert set(plain["a.events"].tolist()) == {0}


def test_announced_events_survive_a_checkpoint(probe3_fmu: Path, tmp_path: Path) -> None:
    """An FMU tells its next event once, when the one before is dealt with."""
    system = System("one", (Component("a", probe3_fmu),), ())
    arguments: dict[str, Any] = {"step_size": 0.02, "method": Method(event_mode=True), "parameters": {
        "a.period": 0.05, "a.announced": True, "a.u": 1.0}}
    whole = simulate(system, stop_time=0.4, **arguments)
    simulate(system, stop_time=0.18, checkpoint=tmp_path / "state", **arguments)
    resumed = resume(tmp_path / "state", system=system, stop_time=0.4)
    assert resumed.events == whole.events
    assert len(whole.events) == 8
    for name in ("time", *whole):
        assert resumed[name].tobytes() == whole[name].tobytes()


@native
def test_the_clock_of_the_pitch_calculator_ticks_once_a_revolution() -> None:
    fmus = {name: cached_fmu(f"fmu_src/{file}.py", "native", fmi=3)
            for name, file in (("spindle", "spindle_drive"), ("calculator", "pitch_calculator"))}
    system = System("clock", tuple(Component(name, fmu) for name, fmu in fmus.items()), (
        Connection("spindle", "angle", "calculator", "spindle_angle"),
        Connection("spindle", "angle", "calculator", "feed_position", convert_units=False)))
    result = simulate(system, step_size=1e-3, stop_time=0.5, method=Method(event_mode=True), parameters={
        "spindle.detector": 0, "spindle.initial_speed": 50.0, "spindle.speed_command": 50.0,
        "calculator.threading": True})
    ticks = [event.time for event in result.events if event.variable == "calculator.revolution_clock"]
    rises = result.time[1:][np.diff(result["calculator.revolution[1]"]) > 0]
    assert ticks == rises.tolist()
    assert len(ticks) == int(0.5 * 50.0 / (2.0 * math.pi))


def test_what_cannot_be_is_said_before_the_run(make_fmu: Factory, tmp_path: Path) -> None:
    stiff = make_fmu(tmp_path / "Stiff.fmu", lambda text: text.replace(
        'canHandleVariableCommunicationStepSize="true"', ""))
    system = System("two", (Component("a", stiff), Component("b", stiff)), (Connection("a", "x", "b", "u"),))
    method = Method(multiples={"b": 2}, step_control=StepControl(0.0, 0.0), event_tolerance=0.0,
                    events=(Event("a.z"), Event("c.x"), Event("a.x", "1V", "up"), Event("a.label")))
    with pytest.raises(SystemStructureError) as error:
        simulate(system, stop_time=1.0, method=method)
    text = "\n".join(error.value.problems)
    for part in ("errors of 0.0 (relative) and 0.0 (absolute) allow no step",
                 "a event tolerance of 0.0 is not positive",
                 "b: steps whose size is free and steps of its own do not go together",
                 "a (Stiff.fmu) cannot change its step size (no canHandleVariableCommunicationStepSize), as steps",
                 "event a.z: a has no variable 'z'", "event c.x: no component 'c'", "direction 'up' is not known",
                 "event a.x: 1 V", "event a.label: a.label is String, which has no level"):
        assert part in text
    with pytest.raises(SystemStructureError, match="event mode: no FMU of this system has one"):
        simulate(system, stop_time=1.0, method=Method(event_mode=True))
    with pytest.raises(CosimError, match="run in plain Python"):
        simulate(System("one", (Component("a", make_fmu(tmp_path / "Free.fmu")),)), stop_time=1.0, engine="kernel",
                 method=Method(events=(Event("a.x"),)))


def test_an_error_that_no_step_makes_small_ends_the_run(probe_fmu: Path) -> None:
    """x' = -100 x by Euler's method, to nine digits, is not to be had with steps of a millisecond."""
    system = System("two", (Component("a", probe_fmu), Component("b", probe_fmu)), (Connection("a", "x", "b", "u"),))
    with pytest.raises(StepError, match="with the smallest step of ") as error:
        simulate(system, stop_time=1.0, step_size=0.1, parameters={"a.start_x": 1.0, "a.k": 100.0},
                 method=Method(step_control=StepControl(1e-9, smallest=1e-3)))
    assert error.value.result is not None


def test_a_discarded_step_is_tried_again_smaller(probe_fmu: Path) -> None:
    """The probe discards all steps from a time on: control divides them down to the smallest, then it is an error."""
    system = System("two", (Component("a", probe_fmu), Component("b", probe_fmu)), (Connection("a", "x", "b", "u"),))
    with pytest.raises(StepError) as error:
        simulate(system, stop_time=1.0, step_size=0.1,
                 parameters={"a.start_x": 1.0, "b.fault": 2, "b.fault_time": 0.35},
                 method=Method(step_control=StepControl(1e-2, smallest=1e-3)))
    assert error.value.status == "discard"
    assert error.value.result is not None
    assert 0.35 - 1e-9 <= error.value.time == error.value.result.time[-1] < 0.4
