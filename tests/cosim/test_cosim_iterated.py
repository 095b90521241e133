"""Loops that are iterated: on slaves made of functions, and the same bits in both engines."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.benchmarks import bench_iteration
from tests.cosim.slaves import FunctionInstance, State, network, variable
from threadpitch.cosim import Method, Result, StepError, SystemStructureError, simulate
from threadpitch.cosim.check import Link
from threadpitch.cosim.master import initialize, run
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.system import Component, Connection, System

Factory = Callable[..., Path]
U, Y = variable("u", "input", interpolated=True), variable("y")
WHOLE_IN, WHOLE_OUT = variable("n", "input", "Integer"), variable("m", "output", "Integer")


def gain(name: str, factor: float, offset: float = 0.0) -> FunctionInstance:
    """y = factor u + offset: nothing but direct feedthrough."""
    def step(state: State, time: float, step_size: float) -> None:
        state["y"] = factor * state["u"] + offset

    return FunctionInstance(name, step, [U, Y])


def looped(a: FunctionInstance, b: FunctionInstance, method: Method) -> Result:
    schedule = Schedule(0.0, 0.5, 4)
    joined = network([a, b], [Link(b.name, Y, a.name, U), Link(a.name, Y, b.name, U)], [(a.name, Y), (b.name, Y)],
                     schedule, method=method)
    initialize(joined, schedule, ())
    run(joined, schedule)
    return Result(joined.recorder)


@settings(deadline=None, max_examples=50)
@example(-20.0, 2.2e-311)  # numbers that have lost their digits
@example(-2.0, 5e-324)
@given(st.floats(-20.0, 0.9), st.floats(-5.0, 5.0))
def test_an_algebraic_loop_is_solved_even_where_repetition_runs_away(factor: float, offset: float) -> None:
    """y = g y + c has the solution c / (1 - g); repetition converges for |g| < 1 only."""
    result = looped(gain("a", 1.0), gain("b", factor, offset), Method("iterated", tolerance=1e-12))
    assert result["b.y"] == pytest.approx(np.full(5, offset / (1.0 - factor)), rel=1e-9, abs=1e-9)


def test_the_trapezoidal_rule_is_what_a_linear_input_makes_of_two_integrators() -> None:
    """x' = y, y' = -x, each exact for its linear input: both agree with the other's value at t + h."""
    def integrator(sign: float) -> Callable[[State, float, float], None]:
        def step(state: State, time: float, step_size: float) -> None:
            state["y"] += sign * (step_size * state["u"] + 0.5 * step_size**2 * state.get("u'", 0.0))
        return step

    h = 0.5
    result = looped(FunctionInstance("a", integrator(1.0), [U, Y], y=1.0),
                    FunctionInstance("b", integrator(-1.0), [U, Y]), Method("iterated", 1, tolerance=1e-14))
    x, y, q = 1.0, 0.0, 0.25 * h * h
    for row in range(5):
        assert (result["a.y"][row], result["b.y"][row]) == pytest.approx((x, y), abs=1e-12)
        x, y = ((1.0 - q) * x + h * y) / (1.0 + q), ((1.0 - q) * y - h * x) / (1.0 + q)


def test_a_loop_that_never_rests_is_named() -> None:
    def flip(state: State, time: float, step_size: float) -> None:
        state["m"] = 1 - state["n"]

    def same(state: State, time: float, step_size: float) -> None:
        state["m"] = state["n"]

    made = [FunctionInstance(name, step, [WHOLE_IN, WHOLE_OUT]) for name, step in (("flip", flip), ("same", same))]
    schedule = Schedule(0.0, 0.5, 4)
    joined = network(made, [Link("same", WHOLE_OUT, "flip", WHOLE_IN), Link("flip", WHOLE_OUT, "same", WHOLE_IN)],
                     [("flip", WHOLE_OUT)], schedule, method=Method("iterated", iterations=7))
    with pytest.raises(StepError, match="initial values of the loop flip -> same -> flip do not come to rest") as error:
        initialize(joined, schedule, ())
    assert error.value.status == "loop"
    with pytest.raises(StepError, match=r"^the loop flip -> same -> flip does not come to rest at t = 0.5 s after 7 "):
        run(joined, schedule)


@settings(deadline=None, max_examples=100)
@example([0.0] * 9, [0.0, 0.0, 3.7e-308])
@given(st.lists(st.floats(-0.5, 0.5), min_size=9, max_size=9), st.lists(st.floats(-9.0, 9.0), min_size=3, max_size=3))
def test_every_contraction_comes_to_rest_at_its_fixed_point(matrix: list[float], offset: list[float]) -> None:
    slope = np.reshape(matrix, (3, 3))
    slope *= 0.9 / max(0.9, float(np.linalg.norm(slope, 2)))
    reals, sweeps = bench_iteration.repeated(slope, np.array(offset))
    assert sweeps <= Method().iterations
    assert reals == pytest.approx(np.linalg.solve(np.eye(3) - slope, offset), rel=1e-9, abs=1e-9)


def test_random_contractions_come_to_rest_within_the_sweeps_of_the_default() -> None:
    for size in bench_iteration.SIZES:
        assert max(bench_iteration.sweeps_of_contractions(size, 150)) <= Method().iterations


def test_what_lies_outside_of_loops_is_computed_once() -> None:
    counts = dict.fromkeys("abcd", 0)

    def counted(name: str) -> FunctionInstance:
        def step(state: State, time: float, step_size: float) -> None:
            counts[name] += step_size > 0.0
            state["y"] = 0.25 * state["u"] + 1.0
        return FunctionInstance(name, step, [U, variable("v", "input"), Y])

    schedule = Schedule(0.0, 0.5, 10)
    joined = network([counted(name) for name in "abcd"], [
        Link("a", Y, "b", U), Link("b", Y, "c", variable("v", "input")), Link("c", Y, "b", variable("v", "input")),
        Link("c", Y, "d", U)], [("d", Y)], schedule, method=Method("iterated"))
    initialize(joined, schedule, ())
    run(joined, schedule)
    assert counts["a"] == counts["d"] == 10
    assert counts["b"] == counts["c"] >= 20


def test_fmus_that_keep_no_state_are_named(make_fmu: Factory, tmp_path: Path) -> None:
    plain = make_fmu(tmp_path / "Plain.fmu", lambda text: text.replace(' canGetAndSetFMUstate="true"', ""))
    system = System("two", (Component("a", plain), Component("b", plain)),
                    (Connection("a", "x", "b", "u"), Connection("b", "x", "a", "u")))
    with pytest.raises(SystemStructureError) as error:
        simulate(system, stop_time=1.0, method=Method("iterated", multiples={"a": 2}))
    assert error.value.problems == (
        "a: iterated steps and steps of its own do not go together; leave out one of them",
        "a (Plain.fmu) cannot go back to a kept state (no canGetAndSetFMUstate), as iterated steps need",
        "b (Plain.fmu) cannot go back to a kept state (no canGetAndSetFMUstate), as iterated steps need")
    one_way = System("two", system.components, system.connections[:1])
    assert simulate(one_way, stop_time=1.0, method=Method("iterated")).completed


@pytest.mark.parametrize("engine", ["python", "kernel"])
def test_a_fault_inside_an_iteration_tells_as_much_as_elsewhere(probe_fmu: Path, engine: str) -> None:
    system = System("two", (Component("a", probe_fmu), Component("b", probe_fmu)),
                    (Connection("a", "x", "b", "u"), Connection("b", "x", "a", "u")))
    with pytest.raises(StepError, match=r"^b: the step failed at t = 0.25 s \(error\)") as error:
        simulate(system, stop_time=1.0, method=Method("iterated"), engine=engine,
                 parameters={"a.start_x": 1.0, "b.fault": 3, "b.fault_time": 0.25})
    assert error.value.result is not None
    assert error.value.result.steps == 25
    with pytest.raises(StepError, match=r"^the loop a -> b -> a does not come to rest at t = 0.01 s after 2 ") as odd:
        simulate(system, stop_time=1.0, method=Method("iterated", iterations=2, tolerance=1e-15), engine=engine,
                 parameters={"a.start_x": 1.0, "b.start_x": math.pi})
    assert odd.value.component == "a"
