"""The master on slaves made of functions: what order means, what accuracy follows, how runs end."""

from __future__ import annotations

import math
import signal
import time as clock
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import expm

from tests.cosim.slaves import FunctionInstance, State, network, variable
from threadpitch.cosim.check import Link, Setting
from threadpitch.cosim.errors import SimulationInterrupted, StepError
from threadpitch.cosim.master import initialize, run
from threadpitch.cosim.result import Result
from threadpitch.cosim.schedule import Schedule

U, Y, X = variable("u", "input"), variable("y"), variable("x")
COUNT, FLAG = variable("count", type_="Integer"), variable("flag", type_="Boolean")
N, ON = variable("n", "input", "Integer"), variable("on", "input", "Boolean")


def simulate(instances: list[FunctionInstance], links: list[Link], schedule: Schedule, *,
             values: tuple[Setting, ...] = ()) -> Result:
    record = [(instance.name, found) for instance in instances for found in (Y, X, COUNT, FLAG)
              if found.name in instance.state]
    joined = network(instances, links, record, schedule)
    initialize(joined, schedule, values)
    run(joined, schedule)
    return Result(joined.recorder)


def clock_slave(name: str = "clock", offset: float = 0.0) -> FunctionInstance:
    def step(state: State, time: float, step_size: float) -> None:
        state["y"] = time + step_size + offset

    return FunctionInstance(name, step, [Y])


def pass_on(state: State, time: float, step_size: float) -> None:
    state["y"] = state["u"]


def test_forward_links_bring_the_end_of_the_step_and_feedback_its_beginning() -> None:
    schedule = Schedule(0.0, 0.25, 8)
    forward = simulate([clock_slave(), FunctionInstance("follower", pass_on, [U, Y])],
                       [Link("clock", Y, "follower", U)], schedule)
    assert forward["follower.y"].tolist() == forward.time.tolist()
    back = simulate([FunctionInstance("follower", pass_on, [U, Y]), clock_slave()],
                    [Link("clock", Y, "follower", U)], schedule)
    assert back["follower.y"][1:].tolist() == back.time[:-1].tolist()


def test_time_is_never_added_up() -> None:
    times: list[float] = []
    schedule = Schedule(0.3, 0.1, 10_000)
    slave = FunctionInstance("slave", lambda state, time, step_size: times.append(time), [Y])
    result = simulate([slave], [], schedule)
    stepped = times[-10_000:]  # earlier calls belong to the initialisation
    assert stepped == [0.3 + n * 0.1 for n in range(10_000)]
    assert result.time[-1] == 0.3 + 10_000 * 0.1


def test_row_zero_holds_the_initial_values_and_rows_are_communication_points() -> None:
    def decay(state: State, time: float, step_size: float) -> None:
        state["x"] *= math.exp(-step_size)

    result = simulate([FunctionInstance("decay", decay, [X], x=2.0)], [], Schedule(0.0, 0.5, 4))
    assert result["decay.x"] == pytest.approx(2.0 * np.exp(-result.time), rel=1e-15)
    assert result["decay.x"].shape == (5,)
    assert result.completed


def test_integers_and_booleans_travel_too() -> None:
    def count(state: State, time: float, step_size: float) -> None:
        state["count"] += step_size > 0
        state["flag"] = int(state["count"]) % 2

    def repeat(state: State, time: float, step_size: float) -> None:
        state["count"], state["flag"] = state["n"], state["on"]

    result = simulate([FunctionInstance("counter", count, [COUNT, FLAG]),
                       FunctionInstance("mirror", repeat, [N, ON, COUNT, FLAG])],
                      [Link("counter", COUNT, "mirror", N), Link("counter", FLAG, "mirror", ON)],
                      Schedule(0.0, 1.0, 5))
    assert result["mirror.count"].tolist() == [0, 1, 2, 3, 4, 5]
    assert result["mirror.count"].dtype == np.int32
    assert result["mirror.flag"].tolist() == [False, True, False, True, False, True]
    assert result["mirror.flag"].dtype == np.bool_


def test_links_convert() -> None:
    result = simulate([clock_slave(), FunctionInstance("follower", pass_on, [U, Y])],
                      [Link("clock", Y, "follower", U, 1000.0, 5.0)], Schedule(0.0, 1.0, 3))
    assert result["follower.y"].tolist() == [5.0, 1005.0, 2005.0, 3005.0]


@settings(deadline=None)
@given(st.floats(allow_nan=False), st.booleans())
def test_a_link_without_conversion_keeps_every_bit(value: float, beside_a_conversion: bool) -> None:
    source = FunctionInstance("source", lambda state, time, step_size: None, [Y], y=value)
    other = variable("other", "input")
    links = [Link("source", Y, "sink", U)]
    if beside_a_conversion:
        links.append(Link("source", Y, "sink", other, 2.0 if abs(value) < 1e300 else 0.5, 1.0))
    result = simulate([source, FunctionInstance("sink", pass_on, [U, other, Y])], links, Schedule(0.0, 1.0, 1))
    assert result["sink.y"].tobytes() == np.array([value, value]).tobytes()


@st.composite
def systems(draw: st.DrawFn) -> tuple[list[list[float]], list[tuple[int, int, int, int, float]]]:
    """Start values (components, 2) and links (giver, output, taker, input, factor), each input fed at most once."""
    count = draw(st.integers(1, 5))
    number = st.sampled_from([-1.0, -0.5, 0.0, 0.25, 1.0])
    start = [[draw(number), draw(number)] for _ in range(count)]
    place = st.integers(0, count - 1)
    links = draw(st.lists(st.tuples(place, st.integers(0, 1), place, st.integers(0, 1), number), max_size=10,
                          unique_by=lambda link: (link[2], link[3])))
    return start, links


@settings(deadline=None)
@given(systems())
def test_any_network_does_what_the_sentence_says(
        system: tuple[list[list[float]], list[tuple[int, int, int, int, float]]]) -> None:
    """y0 += h u0, y1 -= h u1 / 2: against the definition written with plain lists."""
    start, links = system
    outputs = [variable("y"), variable("x")]
    inputs = [variable("u"), variable("w")]

    def step(state: State, time: float, step_size: float) -> None:
        state["y"] += step_size * state["u"]
        state["x"] -= step_size * state["w"] / 2.0

    instances = [FunctionInstance(str(number), step, [*outputs, *inputs], y=pair[0], x=pair[1])
                 for number, pair in enumerate(start)]
    result = simulate(instances, [Link(str(giver), outputs[o], str(taker), inputs[i], factor)
                                  for giver, o, taker, i, factor in links], Schedule(0.0, 0.5, 6))
    values = [list(pair) for pair in start]
    for row in range(7):
        assert [[result[f"{n}.y"][row], result[f"{n}.x"][row]] for n in range(len(start))] == values
        for number, pair in enumerate(values):
            taken = [0.0, 0.0]
            for giver, o, taker, i, factor in links:
                if taker == number:
                    taken[i] = factor * values[giver][o]
            pair[0] += 0.5 * taken[0]
            pair[1] -= 0.5 * taken[1] / 2.0


def oscillator_error(step_size: float) -> float:
    """Two masses, force-displacement: the relative error of the state at 2 s. Each slave integrates exactly.

    m1 = m2 = 1 kg, walls 10 N/m and 0.5 N s/m, coupling 30 N/m and 1 N s/m; x1 = 1 m at rest.
    """
    wall, wall_damping, coupling, damping = 10.0, 0.5, 30.0, 1.0
    names = {name: variable(name) for name in ("x1", "v1", "force")}
    inputs = {name: variable(name, "input") for name in ("x1_in", "v1_in", "force_in")}

    def exact(matrix: NDArray[np.float64], step: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(expm(matrix * step) @ state)

    first = np.array([[0.0, 1.0, 0.0], [-wall, -wall_damping, 1.0], [0.0, 0.0, 0.0]])
    second = np.array([[0.0, 1.0, 0.0, 0.0], [-wall - coupling, -wall_damping - damping, coupling, damping],
                       [0.0] * 4, [0.0] * 4])
    first_step, second_step = expm(first * step_size), expm(second * step_size)
    whole = np.array([[0.0, 1.0, 0.0, 0.0], [-wall - coupling, -wall_damping - damping, coupling, damping],
                      [0.0, 0.0, 0.0, 1.0], [coupling, damping, -wall - coupling, -wall_damping - damping]])

    def mass_one(state: State, time: float, step: float) -> None:
        if step:
            now = first_step @ np.array([state["x1"], state["v1"], state["force_in"]])
            state["x1"], state["v1"] = float(now[0]), float(now[1])

    def mass_two(state: State, time: float, step: float) -> None:
        if step:
            now = second_step @ np.array([state["x2"], state["v2"], state["x1_in"], state["v1_in"]])
            state["x2"], state["v2"] = float(now[0]), float(now[1])
        state["force"] = (coupling * (state["x2"] - state["x1_in"]) + damping * (state["v2"] - state["v1_in"]))

    one = FunctionInstance("one", mass_one, [names["x1"], names["v1"], inputs["force_in"]], x1=1.0)
    two = FunctionInstance("two", mass_two, [inputs["x1_in"], inputs["v1_in"], names["force"]], x2=0.0, v2=0.0)
    schedule = Schedule.between(0.0, 2.0, step_size)
    links = [Link("one", names["x1"], "two", inputs["x1_in"]), Link("one", names["v1"], "two", inputs["v1_in"]),
             Link("two", names["force"], "one", inputs["force_in"])]
    joined = network([one, two], links, [], schedule)
    initialize(joined, schedule, ())
    run(joined, schedule)
    reference = exact(whole, 2.0, np.array([1.0, 0.0, 0.0, 0.0]))
    state = np.array([one.state["x1"], one.state["v1"], two.state["x2"], two.state["v2"]])
    return float(np.linalg.norm(state - reference) / np.linalg.norm(reference))


def test_two_mass_oscillator_converges_with_order_one() -> None:
    errors = [oscillator_error(step_size) for step_size in (2.5e-3, 1.25e-3, 0.625e-3)]
    assert errors[0] < 7.5e-2  # 6.8e-2 is known for Gauss-Seidel with held inputs at 2.5 ms
    for coarse, fine in pairwise(errors):
        assert math.log2(coarse / fine) == pytest.approx(1.0, abs=0.1)


def test_initial_values_go_along_the_links_until_they_rest() -> None:
    """source -> a -> b -> c with the chain in the worst order: each holds the source's value before the first step."""
    source = FunctionInstance("source", lambda state, time, step_size: None, [Y], y=7.0)
    followers = [FunctionInstance(name, pass_on, [U, Y]) for name in "cba"]
    links = [Link("source", Y, "a", U), Link("a", Y, "b", U), Link("b", Y, "c", U)]
    result = simulate([*followers, source], links, Schedule(0.0, 1.0, 1))
    assert [result[f"{name}.y"][0] for name in "abc"] == [7.0, 7.0, 7.0]


def test_an_algebraic_loop_that_does_not_rest_is_told(caplog: pytest.LogCaptureFixture) -> None:
    def grow(state: State, time: float, step_size: float) -> None:
        state["y"] = state["u"] + 1.0

    simulate([FunctionInstance("a", grow, [U, Y]), FunctionInstance("b", grow, [U, Y])],
             [Link("a", Y, "b", U), Link("b", Y, "a", U)], Schedule(0.0, 1.0, 1))
    assert "initial values of the loop a -> b -> a do not come to rest; it starts with the last values" in caplog.text


def test_settings_and_life_cycle() -> None:
    text = variable("label", "parameter", "String")
    gain = variable("gain", "parameter")
    slave = FunctionInstance("slave", lambda state, time, step_size: None, [gain, text, Y])
    simulate([slave], [], Schedule(2.0, 0.5, 2),
             values=(Setting("slave", gain, 3.0), Setting("slave", text, "left")))
    assert slave.state["gain"] == 3.0
    assert slave.calls == ["setup 2.0", "text left", "enter", "exit"]  # some FMUs begin anew with the set-up


@pytest.mark.parametrize("value", [math.nan, -math.nan])
def test_a_value_that_is_not_a_number_is_named_and_not_passed_on(value: float) -> None:
    def fail(state: State, time: float, step_size: float) -> None:
        state["y"] = value if time > 0.7 else 1.0

    follower = FunctionInstance("follower", pass_on, [U, Y])
    schedule = Schedule(0.0, 0.25, 8)
    joined = network([FunctionInstance("source", fail, [X, Y]), follower], [Link("source", Y, "follower", U)],
                     [("source", X)], schedule)
    initialize(joined, schedule, ())
    with pytest.raises(StepError, match=r"source: y is not a number \(NaN\) at t = 1 s") as error:
        run(joined, schedule)
    assert (error.value.component, error.value.time, error.value.status) == ("source", 1.0, "nan")
    assert follower.state["u"] == 1.0
    assert joined.recorder.filled == 4
    assert not Result(joined.recorder).completed


@pytest.mark.parametrize("values", [(math.inf, -math.inf), (1e308, 1e308), (-1e200, 1e200)])
def test_infinite_and_huge_values_are_numbers(values: tuple[float, float]) -> None:
    slave = FunctionInstance("slave", lambda state, time, step_size: None, [X, Y], x=values[0], y=values[1])
    assert simulate([slave], [], Schedule(0.0, 1.0, 2))["slave.y"].tolist() == [values[1]] * 3


def test_ctrl_c_ends_between_steps_and_keeps_the_rows() -> None:
    def interrupt(state: State, time: float, step_size: float) -> None:
        state["y"] += 1.0
        if state["y"] == 60.0:
            signal.raise_signal(signal.SIGINT)

    schedule = Schedule(0.0, 1.0, 10**7)
    joined = network([FunctionInstance("slave", interrupt, [Y])], [], [], schedule)
    initialize(joined, schedule, ())
    began = clock.perf_counter()
    with pytest.raises(SimulationInterrupted):
        run(joined, schedule)
    assert clock.perf_counter() - began < 5.0
    assert 50 <= joined.recorder.filled < 10**7
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_the_second_ctrl_c_does_not_wait() -> None:
    def hang(state: State, time: float, step_size: float) -> None:
        if step_size:
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)
            raise AssertionError("not reached")

    schedule = Schedule(0.0, 1.0, 10)
    joined = network([FunctionInstance("slave", hang, [Y])], [], [], schedule)
    initialize(joined, schedule, ())
    with pytest.raises(KeyboardInterrupt):
        run(joined, schedule)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_progress_rises_to_the_end() -> None:
    told: list[tuple[int, int]] = []
    schedule = Schedule(0.0, 1.0, 1000)
    joined = network([clock_slave()], [], [], schedule)
    initialize(joined, schedule, ())
    run(joined, schedule, progress=lambda done, steps: told.append((done, steps)))
    assert told == sorted(told)
    assert told[-1] == (1000, 1000)
