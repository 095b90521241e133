"""Input and output derivatives: FMI 2 functions, FMI 3 intermediate updates, and both equal."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException

from tests.fmu.native.wrapper import (
    ERROR,
    FORCE,
    FORCE_CURVATURE,
    FORCE_RATE,
    HISTORY_1,
    LOAD_1,
    OK,
    POSITION,
    VELOCITY,
    Slave3,
    needs_compiler,
    slave2,
    slave3,
)

pytestmark = needs_compiler

H = 0.125


def polynomial(time: float) -> float:
    return 3.0 - 2.0 * time + 8.0 * time * time


def exact(end: float) -> tuple[float, float]:
    """Position and velocity of 1 kg under the polynomial, started at rest at half the first force."""
    velocity = 3.0 * end - end**2 + 8.0 / 3.0 * end**3
    position = 1.5 + 1.5 * end**2 - end**3 / 3.0 + 2.0 / 3.0 * end**4
    return position, velocity


# FMI 2 --------------------------------------------------------------------------------------------------------------


def test_input_derivatives_are_followed_inside_the_step() -> None:
    with slave2() as slave:
        slave.fmu.setReal([FORCE], [3.0])
        slave.initialize()
        for number in range(8):
            time = number * H
            slave.derive([FORCE, FORCE], [2, 1], [16.0, -2.0 + 16.0 * time])
            slave.fmu.setReal([FORCE], [polynomial(time)])
            slave.fmu.doStep(time, H)
            assert slave.fmu.getReal([FORCE_RATE, FORCE_CURVATURE]) == [0.0, 0.0]  # they were for that step
        assert slave.fmu.getReal([POSITION, VELOCITY]) == pytest.approx(exact(1.0), rel=1e-14)


def test_derivatives_outlive_a_discarded_step() -> None:
    with slave2() as slave, slave2() as straight:
        for one in (slave, straight):
            one.initialize()
            one.derive([FORCE], [1], [4.0])
        slave.fmu.setReal([LOAD_1], [math.nan])
        with pytest.raises(FMICallException, match="discard"):
            slave.fmu.doStep(0.0, H)
        slave.fmu.setReal([LOAD_1], [0.0])
        slave.fmu.doStep(0.0, H)
        straight.fmu.doStep(0.0, H)
        assert slave.everything() == straight.everything()


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_derivative_that_is_not_finite_discards_the_step(order: int, value: float) -> None:
    with slave2() as slave:
        slave.initialize()
        slave.derive([FORCE], [order], [value])
        with pytest.raises(FMICallException, match="discard"):
            slave.fmu.doStep(0.0, H)
        assert f"derivative {order} of input force is {value!r}; give a finite one" in slave.log[-1][2]


def test_orders_beyond_the_model_are_left_out() -> None:
    with slave2() as slave, slave2() as held:
        for one in (slave, held):
            one.initialize()
        slave.derive([FORCE, LOAD_1], [3, 1], [1e3, 1e3])
        slave.fmu.doStep(0.0, H)
        held.fmu.doStep(0.0, H)
        assert slave.everything() == held.everything()


@pytest.mark.parametrize(("reference", "order", "message"), [
    (FORCE, 0, "force has no derivative of order 0 to be set; name inputs, and orders from 1"),
    (FORCE, -1, "force has no derivative of order -1"),
    (POSITION, 1, "position has no derivative of order 1 to be set"),
    (3, 1, "value reference 3 is not of type float"),
])
def test_wrong_input_derivatives_are_refused(reference: int, order: int, message: str) -> None:
    with slave2() as slave:
        slave.initialize()
        with pytest.raises(FMICallException, match="error"):
            slave.derive([reference], [order], [1.0])
        assert message in slave.log[-1][2]


def test_output_derivatives() -> None:
    with slave2() as slave:
        slave.fmu.setReal([FORCE], [2.0])
        slave.initialize()
        slave.fmu.doStep(0.0, H)
        orders = [1, 2, 1]
        assert slave.fmu.getRealOutputDerivatives([POSITION, POSITION, HISTORY_1], orders) == [2.0 * H, 0.0, 0.0]
        with pytest.raises(FMICallException, match="error"):
            slave.fmu.getRealOutputDerivatives([FORCE], [1])
        assert "force has no derivative of order 1 to be got; name outputs" in slave.log[-1][2]


# FMI 3 --------------------------------------------------------------------------------------------------------------

IN_FORCE, IN_LOADS, OUT_POSITION, OUT_HISTORY, VELOCITY_3, RATE_3 = 0, 1, 4, 5, 9, 15
Update = tuple[float, bool, bool, bool, bool]


class Importer:
    """An importer that extrapolates the force by a function of time, and looks at the outputs."""

    def __init__(self, force: Callable[[float], float | None]) -> None:
        self.force = force
        self.updates: list[Update] = []
        self.seen: list[float] = []
        self.slopes: list[float] = []
        self.slave: Slave3 | None = None

    def __call__(self, _environment: Any, time: float, set_requested: bool, get_allowed: bool, finished: bool,
                 can_return_early: bool, _requested: Any, _return_time: Any) -> None:
        assert self.slave is not None
        self.updates.append((time, set_requested, get_allowed, finished, can_return_early))
        if get_allowed:
            self.seen += self.slave.fmu.getFloat64([OUT_POSITION])
            self.slopes += self.slave.fmu.getOutputDerivatives([OUT_POSITION], [1])
        value = self.force(time) if set_requested else None
        if value is not None:
            self.slave.fmu.setFloat64([IN_FORCE], [value])


def extrapolated(force: Callable[[float], float | None], required: Sequence[int] = (IN_FORCE, OUT_POSITION),
                 ) -> tuple[Importer, list[float]]:
    importer = Importer(force)
    with slave3(update=importer, required=required) as slave:
        importer.slave = slave
        slave.fmu.setFloat64([IN_FORCE], [3.0])
        slave.initialize()
        for number in range(8):
            slave.fmu.doStep(number * H, H)
        assert slave.fmu.getFloat64([RATE_3, RATE_3 + 1]) == [0.0, 0.0]
        result = slave.fmu.getFloat64([OUT_POSITION, VELOCITY_3, IN_FORCE])
    return importer, result


def test_intermediate_updates_extrapolate_inputs() -> None:
    importer, (position, velocity, last) = extrapolated(polynomial)
    assert (position, velocity) == pytest.approx(exact(1.0), rel=1e-13)
    assert last == polynomial(1.0)  # the value set last remains
    assert importer.updates[:4] == [(0.0, True, False, False, False), (H / 2, True, False, False, False),
                                    (H, True, False, False, False), (H, False, True, True, False)]
    assert len(importer.updates) == 4 * 8
    assert (importer.seen[-1], importer.slopes[-1]) == (position, velocity)


def test_importer_that_holds_its_inputs_gets_the_bits_of_one_without_updates() -> None:
    with slave3() as slave:
        slave.fmu.setFloat64([IN_FORCE], [3.0])
        slave.initialize()
        for number in range(8):
            slave.fmu.doStep(number * H, H)
        held = slave.fmu.getFloat64([OUT_POSITION, VELOCITY_3, IN_FORCE])
    assert extrapolated(lambda time: None)[1] == held
    assert extrapolated(lambda time: 3.0)[1] == held


def test_only_outputs_required_means_one_update_at_the_end_of_each_step() -> None:
    importer, _ = extrapolated(polynomial, required=(OUT_POSITION,))
    assert importer.updates == [((number + 1) * H, False, True, True, False) for number in range(8)]


def test_nothing_required_means_no_updates() -> None:
    assert extrapolated(polynomial, required=())[0].updates == []


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_intermediate_input_that_is_not_finite_discards_the_step(value: float) -> None:
    importer = Importer(lambda time: value if time > 0.0 else 1.0)
    with slave3(update=importer, required=[IN_FORCE, OUT_POSITION]) as slave:
        importer.slave = slave
        slave.initialize()
        before = slave.fmu.serializeFMUState(slave.fmu.getFMUState())
        with pytest.raises(FMICallException, match="discard"):
            slave.fmu.doStep(0.0, H)
        assert slave.fmu.serializeFMUState(slave.fmu.getFMUState()) == before
        importer.force = polynomial
        slave.fmu.doStep(0.0, H)


@pytest.mark.parametrize(("misuse", "message"), [
    (lambda slave: slave.fmu.setFloat64([IN_LOADS], [1.0, 1.0]), "loads cannot be accessed in this intermediate"),
    (lambda slave: slave.fmu.getFloat64([OUT_POSITION]), "position cannot be accessed in this intermediate"),
    (lambda slave: slave.fmu.getFMUState(), "fmi3GetFMUState is not allowed: the FMU is in an intermediate update"),
    (lambda slave: slave.fmu.reset(), "fmi3Reset is not allowed"),
    (lambda slave: slave.fmu.terminate(), "fmi3Terminate is not allowed"),
    (lambda slave: slave.fmu.doStep(0.0, H), "fmi3DoStep is not allowed"),
])
def test_misuse_inside_an_update_fails_the_step(misuse: Callable[[Slave3], Any], message: str) -> None:
    def update(*_: Any) -> None:
        if not slave.log:
            with pytest.raises(FMICallException, match="error"):
                misuse(slave)

    with slave3(update=update, required=[IN_FORCE, OUT_POSITION]) as slave:
        slave.initialize()
        with pytest.raises(FMICallException, match="error"):
            slave.fmu.doStep(0.0, H)
        assert message in slave.log[0][2]
        slave.fmu.reset()


def test_instance_is_not_freed_inside_its_own_step() -> None:
    def update(*_: Any) -> None:
        slave.fmu.dll.fmi3FreeInstance(slave.fmu.component)

    with slave3(update=update, required=[IN_FORCE]) as slave:
        slave.initialize()
        with pytest.raises(FMICallException, match="error"):
            slave.fmu.doStep(0.0, H)
        assert "fmi3FreeInstance is not allowed" in slave.log[0][2]


def test_variables_without_intermediate_update_are_refused() -> None:
    for reference in (IN_LOADS, VELOCITY_3, 17, 99):
        with pytest.raises(Exception, match="instantiate"), slave3(required=[reference], update=lambda *_: None):
            pass


def test_output_derivatives_of_arrays() -> None:
    with slave3() as slave:
        slave.fmu.setFloat64([IN_FORCE], [2.0])
        slave.initialize()
        slave.fmu.doStep(0.0, H)
        values = (ctypes.c_double * 6)(*[9.0] * 6)
        references, orders = (ctypes.c_uint * 3)(OUT_POSITION, OUT_HISTORY, OUT_POSITION), (ctypes.c_int * 3)(1, 1, 2)
        function, component = slave.fmu.dll.fmi3GetOutputDerivatives, slave.fmu.component
        assert function(component, references, 3, orders, values, 6) == OK
        assert list(values) == [2.0 * H, 0.0, 0.0, 0.0, 0.0, 0.0]
        assert function(component, references, 3, orders, values, 5) == ERROR
        assert "5 values are not enough for position" in slave.log[-1][2]
