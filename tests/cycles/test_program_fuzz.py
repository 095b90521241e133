"""Any text, any bytes, any words: a program runs or stops with a one-line alarm at a place, soon."""

from __future__ import annotations

import math
import time

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tests.cycles.golden_programs import PROGRAMS
from threadpitch.cycles import (
    DIALECTS,
    CycleError,
    IncrementSystem,
    Indexing,
    Interpretation,
    Point,
    ProgramError,
    Setup,
    UnknownStart,
    cycle_document,
    expand_cycle,
    interpret,
    moves_text,
    read_program,
    tool_path,
)
from threadpitch.cycles.program import decoded

PATIENCE = 20.0  # s for one program of a few lines, on a slow and busy machine
TEXTS = [path.read_text(encoding="utf-8") for path in PROGRAMS]
setups = st.builds(
    Setup, dialect=st.sampled_from(list(DIALECTS.values())), increments=st.sampled_from(IncrementSystem),
    position=st.sampled_from([None, Point(0.013, 0.006)]), spindle_speed=st.sampled_from([None, 50.0]),
    starts=st.integers(1, 99), indexing=st.sampled_from(Indexing), unknown_start=st.sampled_from(UnknownStart))
numbers = st.one_of(
    st.integers(-99999999, 99999999).map(str), st.decimals(-200, 200, places=3).map(str),
    st.sampled_from(["0", "1", "2", "32", "34", "76", "92", "1.5", "-30.", "010060", "021060", "00000001", ".001"]))
words = st.tuples(st.sampled_from("GGGGXZUWPQRFIJKLSTMNOHY"), numbers).map("".join)
codes = st.sampled_from(["G0", "G32", "G33", "G34", "G76", "G92", "G90", "G50", "G20", "G96", "M3", "S500", "G1", "G4"])
blocks = st.lists(st.one_of(words, codes), max_size=8).map(" ".join)
characters = st.text(alphabet="GXZUWPQRFIJKM0123456789.-+ ();/%\n\r\t", max_size=200)


def runs_or_stops(text: str, setup: Setup) -> None:
    """A refusal is one line with a place inside the text; what runs has finite numbers only."""
    began = time.monotonic()
    outcome = outcome_of(text, setup)
    if isinstance(outcome, ProgramError):
        lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
        assert 1 <= outcome.place.line <= len(lines)
        assert 1 <= outcome.place.column <= len(lines[outcome.place.line - 1]) + 1
        assert "\n" not in str(outcome)
    else:
        document = cycle_document(outcome)
        assert all(math.isfinite(value) for record in document["passes"]  # type: ignore[attr-defined]
                   for value in record.values() if isinstance(value, float))
        assert moves_text(outcome.moves).count("\n") == len(outcome.moves)
        assert all(map(math.isfinite, tool_path(outcome.moves).x))
    assert time.monotonic() - began < PATIENCE


def outcome_of(text: str, setup: Setup) -> Interpretation | ProgramError:
    try:
        return interpret(read_program(text), setup)
    except ProgramError as error:
        return error


@given(text=st.text(max_size=300), setup=setups)
@settings(deadline=None, max_examples=150)
def test_any_text(text: str, setup: Setup) -> None:
    runs_or_stops(text, setup)


@given(content=st.binary(max_size=300))
@settings(deadline=None, max_examples=150)
@example(b"\xff\xfe\x00G0")
@example(b"\xef\xbb\xbfG0 X1.")
def test_any_bytes(content: bytes) -> None:
    runs_or_stops(decoded(content), Setup())


@given(text=characters, setup=setups)
@settings(deadline=None, max_examples=200)
def test_any_text_of_the_alphabet(text: str, setup: Setup) -> None:
    runs_or_stops(text, setup)


@given(lines=st.lists(blocks, max_size=8), setup=setups)
@settings(deadline=None, max_examples=300, suppress_health_check=[HealthCheck.too_slow])
def test_any_words(lines: list[str], setup: Setup) -> None:
    runs_or_stops("\n".join(["S500 M3", "G0 X26. Z6.", *lines]), setup)


@given(text=st.sampled_from(TEXTS), place=st.floats(0.0, 1.0), length=st.integers(0, 4), patch=characters, setup=setups)
@settings(deadline=None, max_examples=200, suppress_health_check=[HealthCheck.too_slow])
def test_good_programs_with_a_damaged_place(text: str, place: float, length: int, patch: str, setup: Setup) -> None:
    at = int(place * len(text))
    runs_or_stops(text[:at] + patch[:3] + text[at + length:], setup)


@given(lines=st.lists(st.one_of(blocks, st.text(max_size=30)), max_size=3), setup=setups)
@settings(deadline=None, max_examples=150)
def test_any_cycle_alone(lines: list[str], setup: Setup) -> None:
    try:
        message = ""
        assert expand_cycle(lines, setup).passes
    except CycleError as error:
        message = str(error)
    assert "\n" not in message


@pytest.mark.parametrize("text", ["G32 W-1. F1.\n" * 8000, "(" * 50000, "X" * 50000, "N1" * 20000, "1" * 50000,
                                  ";" * 100000, "G0 X" + "0" * 100000, "G0 U1.\n" * 8000, "%" * 50000, "-" * 50000])
def test_large_texts_end_soon(text: str) -> None:
    runs_or_stops("S500 M3\nG0 X26. Z6.\n" + text, Setup())
