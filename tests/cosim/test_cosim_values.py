from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.cosim.slaves import variable
from threadpitch.cosim.system import ParameterValue
from threadpitch.cosim.values import VariableValueError, from_parameter_set, from_si, parse_value

METRE = variable("length", "parameter", unit="m", minimum=0.0, maximum=1.0)
MILLIMETRE = variable("length", "parameter", unit="mm")
SPEED = variable("speed", "parameter", unit="rad/s")
CELSIUS = variable("temperature", "parameter", unit="degC")
PLAIN = variable("ratio", "parameter")
COUNT = variable("count", "parameter", "Integer", minimum=1, maximum=4096)
SWITCH = variable("switch", "parameter", "Boolean")
DRIVE = variable("drive", "parameter", "Enumeration", choices={"ball_screw": 1, "linear_motor": 2})
LABEL = variable("label", "parameter", "String")


@pytest.mark.parametrize(("text", "of", "expected"), [
    ("10mm", METRE, 0.010),
    ("10 mm", METRE, 0.010),
    (" 1e1mm ", METRE, 0.010),
    ("0.01", METRE, 0.01),
    ("0.01", MILLIMETRE, 10.0),  # a number alone is SI
    ("1.5 inch", MILLIMETRE, 38.1),
    ("10mm", MILLIMETRE, 10.0),
    ("500 rpm", SPEED, 500.0 * 2.0 * math.pi / 60.0),
    ("293.15", CELSIUS, 20.0),
    ("20degC", CELSIUS, 20.0),
    (".5", PLAIN, 0.5),
    ("4096", COUNT, 4096),
    ("1e3", COUNT, 1000),
    ("True", SWITCH, True),
    ("0", SWITCH, False),
    ("linear_motor", DRIVE, 2),
    ("1", DRIVE, 1),
    ("10mm", LABEL, "10mm"),
])
def test_texts_become_values_in_the_variables_unit(text: str, of: Any, expected: object) -> None:
    value = parse_value(text, of)
    assert type(value) is type(expected)
    assert value == (pytest.approx(expected, rel=1e-14) if isinstance(expected, float) else expected)


@pytest.mark.parametrize(("text", "of", "message"), [
    ("2", METRE, "2 m is above the maximum of 1 m"),
    ("-1mm", METRE, "-0.001 m is below the minimum of 0 m"),
    ("10 rpm", METRE, "10 rpm: unit 'rpm' cannot be converted to 'm'"),
    ("10 mmm", METRE, "did you mean mm"),
    ("ten", METRE, "'ten' is not a number; write it like 10 or 10mm"),
    ("nan", METRE, "not a number"),
    ("1e999", METRE, "not a finite number"),
    ("10mm", PLAIN, "the variable has no unit"),
    ("1.5", COUNT, "1.5 is not a whole number"),
    ("10mm", COUNT, "a plain Integer; write 10"),
    ("5000", COUNT, "above the maximum"),
    ("1e12", variable("n", "parameter", "Integer"), "does not fit into 32 bits"),
    ("yes", SWITCH, "not a Boolean; write true or false"),
    ("linear_motr", DRIVE, "did you mean linear_motor"),
    ("3", DRIVE, "known are ball_screw (1), linear_motor (2)"),
    ("1", variable("x", "parameter", unit="bushel"), ""),
])
def test_what_does_not_fit_is_refused_with_the_reason(text: str, of: Any, message: str) -> None:
    if not message:  # nobody knows the unit: the number is meant in it
        assert parse_value(text, of) == 1.0
        return
    with pytest.raises(VariableValueError) as error:
        parse_value(text, of)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("value", "of", "expected"), [
    (np.float64(0.5), METRE, 0.5), (np.int64(3), COUNT, 3), (np.True_, SWITCH, True), (1, SWITCH, True),
    (2.0, COUNT, 2), (1, METRE, 1.0), ("10mm", METRE, 0.01),
])
def test_python_and_numpy_values_are_taken(value: object, of: Any, expected: object) -> None:
    assert from_si(value, of) == expected


@pytest.mark.parametrize(("value", "of"), [
    (True, METRE), (True, COUNT), (0.5, SWITCH), (1.0, LABEL), (math.nan, METRE), (math.inf, COUNT), (None, METRE),
    ([1.0], METRE),
])
def test_other_types_are_refused(value: object, of: Any) -> None:
    with pytest.raises(VariableValueError):
        from_si(value, of)


def test_a_parameter_set_means_the_variables_own_unit() -> None:
    assert from_parameter_set(ParameterValue("a.length", 3.0), MILLIMETRE) == 3.0
    assert from_parameter_set(ParameterValue("a.length", 0.003, "m"), MILLIMETRE) == pytest.approx(3.0)
    with pytest.raises(VariableValueError, match="is a text, but the variable is Real"):
        from_parameter_set(ParameterValue("a.length", "3"), MILLIMETRE)


@settings(deadline=None)
@given(st.floats(min_value=-1e6, max_value=1e6), st.sampled_from(["m", "mm", "um", "inch"]))
def test_a_written_unit_and_si_agree(number: float, unit: str) -> None:
    factor = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "inch": 0.0254}[unit]
    written = parse_value(f"{number!r} {unit}", variable("x", unit="m"))
    assert written == pytest.approx(number * factor, rel=1e-14, abs=1e-300)
