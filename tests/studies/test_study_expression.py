"""Outcomes are arithmetic over named quantities; nothing else of Python gets in."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from threadpitch.studies.errors import StudyError
from threadpitch.studies.expression import Expression

KNOWN = {"a": 2.0, "b": -3.0, "drive.error": np.array([1.0, -4.0, 2.0]), "c.pitch[1]": 1.5, "c.groove[2,1]": 7.0,
         "name": "control", "on": True}


@pytest.mark.parametrize(("text", "value"), [
    ("a + b * 2", -4.0), ("max(abs(drive.error)) / a", 2.0), ("max(a, b, 5)", 5.0), ("last(drive.error)", 2.0),
    ("c.pitch[1] ** 2", 2.25), ("c.groove[2, 1]", 7.0), ("rms(drive.error) ** 2 * 3", 21.0), ("sin(pi / 2)", 1.0),
    ("1 < a < 3 and on", True), ("not on or name == 'control'", True), ("a if on else b", 2.0), ("name", "control"),
    ("range(drive.error)", 6.0), ("mean(drive.error > 0)", 2.0 / 3.0), ("percentile(drive.error, 50)", 1.0),
    ("a / 0", math.inf), ("-a % 3", 1.0),
])
def test_what_is_computed(text: str, value: object) -> None:
    found = Expression(text, "here")(KNOWN.__getitem__)
    assert found == pytest.approx(value) if isinstance(value, float) else found == value
    assert type(found) is type(value)


def test_names_are_those_of_variables() -> None:
    text = "max(abs(z_drive.following_error)) / controller.lead + nominal_pitch.pitch[1] * pi"
    assert Expression(text, "here").names == {"z_drive.following_error", "controller.lead", "nominal_pitch.pitch[1]"}


@pytest.mark.parametrize("text", [
    "__import__('os').system('true')", "a.__class__()", "(lambda: 1)()", "[1, 2]", "{'a': 1}", "a := 2", "f'{a}'",
    "open('x')", "max(a, key=abs)", "a[b]", "a['x']", "(a).b.c()", "1j", "b'x'", "a; b", "a @ b", "a << 3", "", "a +",
    "*a", "yield a", "a[1:2]", "(a + b).real", "abs", "max(*drive.error)", "(" * 500 + "a" + ")" * 500, "a" * 3000,
])
def test_all_else_is_refused(text: str) -> None:
    with pytest.raises(StudyError, match="here"):
        Expression(text, "here")(KNOWN.__getitem__)


@pytest.mark.parametrize(("text", "why"), [
    ("maxx(a)", "did you mean max"), ("drive.error", "gives 3 values; take one"), ("name + 1", "cannot be computed"),
])
def test_messages_tell_the_mend(text: str, why: str) -> None:
    with pytest.raises(StudyError, match=why):
        Expression(text, "here")(KNOWN.__getitem__)


@settings(deadline=None)
@given(st.text(max_size=40))
def test_any_text_is_computed_or_refused(text: str) -> None:
    try:
        found = Expression(text, "here")(KNOWN.__getitem__)
    except (StudyError, KeyError):
        return
    assert isinstance(found, float | bool | str)
