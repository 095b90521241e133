"""Numbers in messages are written as Python writes them, and long texts stay whole characters."""

from __future__ import annotations

import ctypes
import functools
import locale

import hypothesis.strategies as st
import pytest
from hypothesis import example, given, settings

from tests.fmu.native.wrapper import C_SOURCES, WRAPPER, compiled, needs_compiler

pytestmark = needs_compiler

SIZE = 1024


@functools.cache
def shown() -> ctypes.CDLL:
    library = ctypes.CDLL(str(compiled("show.so", (C_SOURCES / "show.c", WRAPPER / "text.c"),
                                       ("-O2", "-fPIC", "-shared"))))
    library.show_real.argtypes = [ctypes.c_double, ctypes.c_char_p]
    library.show_twice.argtypes = [ctypes.c_char_p, ctypes.c_char_p]
    return library


def real(value: float) -> str:
    buffer = ctypes.create_string_buffer(SIZE)
    shown().show_real(value, buffer)
    return buffer.value.decode()


@given(st.floats(allow_nan=True, allow_infinity=True))
@example(0.0)
@example(-0.0)
@example(5e-324)
@example(1.7976931348623157e308)
@example(1e16)
@example(9999999999999998.0)
@example(123456789012345680.0)
@example(0.0001)
@example(0.00001)
@example(0.1)
@example(100.0)
@example(2.5e-310)
@example(2.0**-24)
@example(-(2.0**-1000))
@example(9.5)
@settings(deadline=None, max_examples=2000)
def test_numbers_are_written_as_python_writes_them(value: float) -> None:
    assert real(value) == repr(value)


def test_powers_of_two_and_ten() -> None:
    twos = [2.0**exponent for exponent in range(-1074, 1024)]
    tens = [10.0**exponent for exponent in range(-323, 309)]
    assert [real(value) for value in twos + tens] == [repr(value) for value in twos + tens]


def test_decimal_point_does_not_follow_the_locale() -> None:
    before = locale.setlocale(locale.LC_NUMERIC)
    for name in ("de_DE.UTF-8", "fr_FR.UTF-8", "de_DE", "German_Germany"):
        try:
            locale.setlocale(locale.LC_NUMERIC, name)
        except locale.Error:
            continue
        try:
            assert real(0.25) == "0.25"
        finally:
            locale.setlocale(locale.LC_NUMERIC, before)
        return
    pytest.skip("no locale with a decimal comma on this machine")


@given(st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=1000))
@settings(deadline=None)
def test_long_texts_end_with_a_whole_character(text: str) -> None:
    buffer = ctypes.create_string_buffer(SIZE)
    text = text[:250]  # so that one always fits
    shown().show_twice(text.encode(), buffer)
    assert (text + text).startswith(buffer.value.decode())
    assert len(buffer.value) >= min(2 * len(text.encode()), SIZE - 4)
