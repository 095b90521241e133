"""The two-mass oscillator of native FMUs against its exact solution: what each method costs in accuracy.

m1 = m2 = 1 kg, walls 10 N/m and 0.5 N s/m, coupling 30 N/m and 1 N s/m; x1 = 1 m, all at rest, at t = 0, exact history
before. Error: norm of the state's difference at 2 s over the norm of the state.
"""

from __future__ import annotations

import functools
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from threadpitch.cosim import Method, simulate
from threadpitch.cosim.system import Component, Connection, System
from threadpitch.fmu import available_compiler, cached_fmu

pytestmark = pytest.mark.skipif(available_compiler() is None, reason="no C compiler and no ziglang")
MODELS = Path(__file__).parent / "models"
HISTORY = 4  # steps before t = 0
WHOLE = np.array([[0.0, 1.0, 0.0, 0.0], [-40.0, -1.5, 30.0, 1.0], [0.0, 0.0, 0.0, 1.0], [30.0, 1.0, -40.0, -1.5]])

# Relative errors at H = 2.5 ms by coupling and order of extrapolation, known from an independent computation, which
# evaluates the force anew with the positions at t + h. Jacobi's coupling does so where it is told of direct
# feedthrough; else the force is as old as its inputs.
KNOWN = {("jacobi", 0): 4.9e-2, ("jacobi", 1): 4.6e-4, ("jacobi", 2): 1.7e-5,
         ("jacobi as published", 0): 9.9e-2, ("jacobi as published", 1): 4.1e-4, ("jacobi as published", 2): 3.7e-5,
         ("gauss-seidel", 0): 6.8e-2, ("gauss-seidel", 1): 2.6e-4, ("gauss-seidel", 2): 1.5e-5,
         ("iterated", 0): 4.7e-2, ("iterated", 1): 9.1e-5, ("iterated", 2): 1.9e-6}


def exact(time: float) -> NDArray[np.float64]:
    """x1, v1, x2, v2."""
    return np.asarray(expm(WHOLE * time) @ np.array([1.0, 0.0, 0.0, 0.0]))


def oscillator(fmi: int) -> System:
    first = cached_fmu(MODELS / "oscillator_first.py", "native", fmi=fmi)
    second = cached_fmu(MODELS / "oscillator_second.py", "native", fmi=fmi)
    return System("oscillator", (Component("first", first), Component("second", second)), (
        Connection("first", "x1", "second", "x1"), Connection("first", "v1", "second", "v1"),
        Connection("second", "force", "first", "force")))


@functools.cache
def error(method: tuple[str, int], step_size: float, fmi: int, engine: str = "kernel") -> float:
    coupling, order = method
    start = exact(-HISTORY * step_size).tolist()
    feedthrough = ("second",) if coupling == "jacobi" else ()
    how = Method(coupling.partition(" ")[0], order, feedthrough=feedthrough)
    result = simulate(oscillator(fmi), engine=engine, method=how, step_size=step_size,
                      start_time=-HISTORY * step_size, stop_time=2.0,
                      parameters={"first.start": start, "second.start": start})
    assert result.warnings == ()
    state = np.array([result[name][-1] for name in ("first.x1", "first.v1", "second.x2", "second.v2")])
    return float(np.linalg.norm(state - exact(2.0)) / np.linalg.norm(exact(2.0)))


@pytest.mark.parametrize("method", KNOWN)
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_order_of_the_error_is_one_above_that_of_the_extrapolation(method: tuple[str, int], fmi: int) -> None:
    errors = [error(method, step_size, fmi) for step_size in (5e-3, 2.5e-3, 1.25e-3)]
    orders = [math.log2(coarse / fine) for coarse, fine in pairwise(errors)]
    print(f"FMI {fmi} {method}: {errors[1]:.2e} at 2.5 ms, orders {orders[0]:.2f} {orders[1]:.2f}")
    assert errors[1] < 1.05 * KNOWN[method]  # they are known to two digits
    assert orders[-1] == pytest.approx(method[1] + 1, abs=0.15)


@pytest.mark.parametrize("method", KNOWN)
def test_intermediate_updates_and_input_derivatives_say_the_same(method: tuple[str, int]) -> None:
    assert error(method, 2.5e-3, 3) == pytest.approx(error(method, 2.5e-3, 2), rel=1e-6)
    assert error(method, 5e-3, 3, "python") == error(method, 5e-3, 3)
    assert error(method, 5e-3, 2, "python") == error(method, 5e-3, 2)


def test_a_slow_component_costs_accuracy_by_its_own_step() -> None:
    """Twice the step in one half: between the errors of both halves' small and both halves' large steps."""
    start = exact(-0.02).tolist()
    method = Method("jacobi", 2, {"second": 2}, feedthrough=("second",))
    result = simulate(oscillator(2), method=method, step_size=2.5e-3, start_time=-0.02, stop_time=2.0,
                      parameters={"first.start": start, "second.start": start})
    state = np.array([result[name][-1] for name in ("first.x1", "first.v1", "second.x2", "second.v2")])
    slow = float(np.linalg.norm(state - exact(2.0)) / np.linalg.norm(exact(2.0)))
    assert error(("jacobi", 2), 2.5e-3, 2) < slow < 1.5 * error(("jacobi", 2), 5e-3, 2)


@functools.cache
def load(order: int, step_size: float) -> float:
    """The force of an elastic load on a feed drive with its sampled loops, 64 ms after it was let go."""
    fmus = {"drive": cached_fmu(MODELS.parents[2] / "fmu_src" / "feed_drive.py", "native"),
            "load": cached_fmu(MODELS / "elastic_load.py", "native")}
    system = System("loaded", tuple(Component(name, fmu) for name, fmu in fmus.items()), (
        Connection("drive", "position", "load", "position"), Connection("load", "force", "drive", "load_force")))
    result = simulate(system, step_size=step_size, stop_time=0.064, method=Method("iterated", order), parameters={
        "drive.encoder_counts": 0, "load.rest": -1e-4, "load.lag": 0.02})
    return float(result["load.force"][-1])


@pytest.mark.parametrize("order", [0, 1, 2])
def test_the_drive_of_the_lathe_converges_with_the_same_orders(order: int) -> None:
    """Against steps of 25 us, where the loops are sampled every 125 us."""
    reference = load(2, 2.5e-5)
    errors = [abs(load(order, step_size) / reference - 1.0) for step_size in (4e-3, 2e-3, 1e-3)]
    orders = [math.log2(coarse / fine) for coarse, fine in pairwise(errors)]
    print(f"order {order}: {', '.join(f'{one:.2e}' for one in errors)}, orders {orders[0]:.2f} {orders[1]:.2f}")
    assert orders[-1] == pytest.approx(order + 1, abs=0.15)
