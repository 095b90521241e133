"""What the couplings, steps of their own and extrapolation mean, on slaves made of functions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.cosim.slaves import FunctionInstance, State, description, network, variable
from threadpitch.cosim import Method, Result, SystemStructureError, simulate
from threadpitch.cosim.check import Link, Plan, check
from threadpitch.cosim.extrapolation import Samples, add_sample, polynomial
from threadpitch.cosim.master import initialize, run
from threadpitch.cosim.method import check_method
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.system import Component, Connection, System

Factory = Callable[..., Path]
U, Y = variable("u", "input", interpolated=True), variable("y")
SEEN, RATE, BEND = variable("seen"), variable("rate"), variable("bend")


def clock(name: str = "clock") -> FunctionInstance:
    """y = t^2 + 3 t at the end of every step."""
    def step(state: State, time: float, step_size: float) -> None:
        end = time + step_size
        state["y"] = end * end + 3.0 * end

    return FunctionInstance(name, step, [Y])


def observer(name: str = "observer") -> FunctionInstance:
    def step(state: State, time: float, step_size: float) -> None:
        state["seen"], state["rate"], state["bend"] = state["u"], state.get("u'", 0.0), state.get("u''", 0.0)

    return FunctionInstance(name, step, [U, SEEN, RATE, BEND])


def watched(order: tuple[str, ...], method: Method, schedule: Schedule) -> Result:
    made = {"clock": clock(), "observer": observer()}
    record = [("clock", Y), ("observer", SEEN), ("observer", RATE), ("observer", BEND)]
    joined = network([made[name] for name in order], [Link("clock", Y, "observer", U)], record, schedule,
                     method=method)
    initialize(joined, schedule, ())
    run(joined, schedule)
    return Result(joined.recorder)


def law(time: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(time * time + 3.0 * time)


@pytest.mark.parametrize("order", [("clock", "observer"), ("observer", "clock")])
def test_jacobi_sees_the_beginning_of_the_step_in_any_order(order: tuple[str, ...]) -> None:
    result = watched(order, Method("jacobi"), Schedule(0.0, 0.25, 8))
    assert result["observer.seen"][1:].tolist() == law(result.time)[:-1].tolist()


def test_jacobi_steps_all_before_any_publishes() -> None:
    """x' = y and y' = -x by Euler's method: both take the other's value at t."""
    def turn(sign: float) -> Callable[[State, float, float], None]:
        def step(state: State, time: float, step_size: float) -> None:
            state["y"] += sign * step_size * state["u"]
        return step

    schedule = Schedule(0.0, 0.5, 6)
    joined = network([FunctionInstance("a", turn(1.0), [U, Y], y=1.0), FunctionInstance("b", turn(-1.0), [U, Y])],
                     [Link("b", Y, "a", U), Link("a", Y, "b", U)], [("a", Y), ("b", Y)], schedule,
                     method=Method("jacobi"))
    initialize(joined, schedule, ())
    run(joined, schedule)
    result = Result(joined.recorder)
    a, b = 1.0, 0.0
    for row in range(7):
        assert (result["a.y"][row], result["b.y"][row]) == (a, b)
        a, b = a + 0.5 * b, b - 0.5 * a


@pytest.mark.parametrize("coupling", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize("order", [("clock", "observer"), ("observer", "clock")])
def test_a_parabola_is_followed_exactly_once_three_samples_are_there(order: tuple[str, ...], coupling: str) -> None:
    result = watched(order, Method(coupling, 2), Schedule(0.0, 0.25, 8))
    begin = result.time[:-1]
    assert result["observer.seen"][1:] == pytest.approx(law(begin), abs=1e-12)
    assert result["observer.rate"][3:] == pytest.approx(2.0 * begin[2:] + 3.0, abs=1e-12)
    assert result["observer.bend"][3:].tolist() == pytest.approx([2.0] * 6)


def test_order_one_goes_through_the_two_newest_values() -> None:
    jacobi = watched(("clock", "observer"), Method("jacobi", 1), Schedule(0.0, 0.5, 4))
    assert jacobi["observer.rate"].tolist() == [0.0, 0.0, 3.5, 4.5, 5.5]  # backwards from the step's beginning
    seidel = watched(("clock", "observer"), Method("gauss-seidel", 1), Schedule(0.0, 0.5, 4))
    assert seidel["observer.rate"].tolist() == [0.0, 3.5, 4.5, 5.5, 6.5]  # over the step itself
    assert seidel["observer.seen"].tolist() == [0.0, *law(seidel.time[:-1])]


def test_a_component_with_a_step_of_its_own_steps_when_that_ends_and_holds_in_between() -> None:
    calls: list[tuple[float, float]] = []

    def step(state: State, time: float, step_size: float) -> None:
        if step_size:
            calls.append((time, step_size))
        state["y"] = time + step_size

    schedule = Schedule(1.0, 0.25, 8)
    slow, fast = FunctionInstance("slow", step, [Y]), observer("fast")
    joined = network([slow, fast], [Link("slow", Y, "fast", U)], [("slow", Y), ("fast", SEEN)], schedule,
                     method=Method(multiples={"slow": 4}))
    initialize(joined, schedule, ())
    run(joined, schedule)
    result = Result(joined.recorder)
    assert calls == [(1.0, 1.0), (2.0, 1.0)]
    assert result["slow.y"][1:].tolist() == [0.0] * 3 + [2.0] * 4 + [3.0]
    assert result["fast.seen"][1:].tolist() == [0.0] * 3 + [2.0] * 4 + [3.0]


def test_a_slow_component_in_jacobi_takes_the_values_at_its_own_beginning() -> None:
    result = watched(("clock", "observer"), Method("jacobi", 0, {"observer": 4}), Schedule(0.0, 0.25, 8))
    assert result["observer.seen"][[4, 8]].tolist() == [0.0, 4.0]  # law(0), law(1)


@settings(deadline=None)
@given(st.lists(st.floats(-10.0, 10.0), min_size=3, max_size=3), st.floats(0.01, 10.0), st.floats(0.01, 10.0),
       st.floats(-5.0, 5.0))
def test_the_polynomial_goes_through_its_samples_and_is_the_parabola(coefficients: list[float], first: float,
                                                                     second: float, time: float) -> None:
    a, b, c = coefficients
    samples = Samples.of(1)
    times = (-first - second, -first, 0.0)
    for at in times:
        add_sample(samples, 0, at, a + b * at + c * at * at)
        add_sample(samples, 0, at, a + b * at + c * at * at)  # of the same time: no sample more
    value, rate, bend = polynomial(samples, 0, 2, time)
    scale = 1e-9 * (1.0 + abs(a) / first / second) * 1e3
    assert value == pytest.approx(a + b * time + c * time * time, abs=scale)
    assert rate == pytest.approx(b + 2.0 * c * time, abs=scale)
    assert bend == pytest.approx(2.0 * c, abs=scale)
    assert polynomial(samples, 0, 0, time) == (a, 0.0, 0.0)
    assert polynomial(samples, 0, 1, 0.0)[0] == a


def plan() -> Plan:
    fmus = {"giver": description(variable("y")), "taker": description(variable("u", "input"))}
    components = tuple(Component(name, Path("Test.fmu")) for name in fmus)
    return check(System("two", components, (Connection("giver", "y", "taker", "u"),)), fmus)


@pytest.mark.parametrize(("method", "message"), [
    (Method("gauss"), "coupling 'gauss' is not known; choose one of gauss-seidel, jacobi, iterated"),
    (Method(extrapolation=3), "extrapolation of order 3 is not known; choose 0 to 2"),
    (Method(extrapolation={"tacker": 1}), "extrapolation: no component 'tacker'; did you mean taker?"),
    (Method(extrapolation={"taker": 1}),
     "extrapolation: taker (Test.fmu) cannot interpolate u (no canInterpolateInputs), which is held during a step"),
    (Method(multiples={"tacker": 2}), "multiple of the step: no component 'tacker'; did you mean taker?"),
    (Method(feedthrough=("giver", "taker")),
     "feedthrough: serves Jacobi's coupling, not gauss-seidel, which needs none; leave it out (and 2 more problems)"),
    (Method("jacobi", feedthrough=("taker",)),
     "taker (Test.fmu) cannot go back to a kept state (no canGetAndSetFMUstate) or change its step size (no "
     "canHandleVariableCommunicationStepSize), as direct feedthrough needs"),
    (Method("jacobi", feedthrough=("tacker",)), "feedthrough: no component 'tacker'; did you mean taker?"),
    (Method(iterations=1), "1 iterations cannot tell whether a loop comes to rest; give 2 or more"),
    (Method(tolerance=0.0), "a tolerance of 0.0 is not positive"),
    (Method(multiples={"taker": 0}), "taker: 0 is no multiple of the communication step; give 1 or more"),
    (Method(multiples={"taker": 4}), "taker: 10 steps are not a multiple of 4; stop 0.2 s later"),
])
def test_what_cannot_be_is_said_before_the_run(method: Method, message: str) -> None:
    with pytest.raises(SystemStructureError) as error:
        check_method(method, plan(), Schedule(0.0, 0.1, 10))
    assert str(error.value) == message


def test_what_some_cannot_is_a_warning(make_fmu: Factory, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    holding = make_fmu(tmp_path / "Hold.fmu", lambda text: text.replace(' canInterpolateInputs="true"', ""))
    system = System("two", (Component("a", holding), Component("b", holding)), (Connection("a", "x", "b", "u"),))
    held = simulate(system, stop_time=0.1, method=Method(extrapolation=1), parameters={"a.start_x": 1.0})
    text = "extrapolation: b (Hold.fmu) cannot interpolate u (no canInterpolateInputs), which is held during a step"
    assert held.warnings == (text,)
    assert text in caplog.text
    plain = simulate(system, stop_time=0.1, parameters={"a.start_x": 1.0})
    assert held["b.x"].tobytes() == plain["b.x"].tobytes()
