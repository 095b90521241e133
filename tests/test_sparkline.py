"""The line of characters that shows a deviation, and how the tables look on terminals of every width."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

from threadpitch.pitch import GroupPitch, PitchTable
from threadpitch.sparkline import BLOCKS, PLAIN, deviation_lines, sparkline, verdict_line
from threadpitch.tables import show_groups
from threadpitch.trace import Trace


def table(turns: int = 12) -> PitchTable:
    wave = 1e-6 * np.sin(np.arange(turns))
    return PitchTable.of_pitches([1.5e-3 + wave, 1.5e-3 - wave], [0.0, np.pi])


def shown(width: int, *, terminal: bool) -> str:
    text = io.StringIO()
    console = Console(file=text, width=width, force_terminal=terminal, color_system="standard" if terminal else None)
    trace = Trace(np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    show_groups(console, [GroupPitch("1", trace, table())], target=1.5e-3)
    return text.getvalue()


def test_levels_rise_with_the_values() -> None:
    line = sparkline(1e-6 * np.arange(8.0), 80)
    assert line == PLAIN.levels
    assert sparkline(-1e-6 * np.arange(8.0), 80) == PLAIN.levels[::-1]


def test_a_turn_far_outside_is_an_arrow_and_the_others_keep_their_scale() -> None:
    values = 1e-6 * np.array([-300.0, *np.tile([-1.0, 1.0], 10), 400.0])
    line = sparkline(values, 80, BLOCKS)
    assert line[0] == BLOCKS.below
    assert line[-1] == BLOCKS.above
    assert set(line[1:-1]) == {BLOCKS.levels[0], BLOCKS.levels[-1]}


def test_a_missing_turn_is_a_gap_and_nothing_is_an_empty_line() -> None:
    assert sparkline(np.array([0.0, np.nan, 1.0]), 80)[1] == " "
    assert sparkline(np.full(3, np.nan), 80) == ""


@settings(deadline=None)
@given(st.lists(st.floats(-1e-3, 1e-3), min_size=1, max_size=300), st.integers(8, 100))
def test_a_line_keeps_to_its_width_and_shows_the_extremes(values: list[float], width: int) -> None:
    line = sparkline(np.array(values), width)
    assert len(line) == min(len(values), width)
    assert set(line) <= {*PLAIN.levels, PLAIN.below, PLAIN.above}


def test_the_farthest_turn_of_a_stretch_stands_for_it() -> None:
    values = 1e-6 * np.sin(np.arange(1000.0))
    values[777] = 5e-5
    assert sparkline(values, 20).count(PLAIN.above) == 1


@pytest.mark.parametrize("width", [24, 30, 40, 60, 80, 120, 250])
@pytest.mark.parametrize("terminal", [False, True])
def test_tables_keep_every_figure_in_every_width(width: int, terminal: bool) -> None:
    text = shown(width, terminal=terminal)
    assert "…" not in text
    plain = re.sub(r"\x1b\[[0-9;]*m", "", text)
    assert max(len(line.rstrip()) for line in plain.splitlines()) <= width
    assert len(re.findall(r"\b1\.(?:5|49)\d+\b", plain)) == 2 * 12 + 2 * 3


def test_colours_stay_out_of_a_pipe() -> None:
    assert "\x1b" in shown(80, terminal=True)
    assert "\x1b" not in shown(80, terminal=False)
    assert shown(80, terminal=False).isascii()


def test_deviations_are_from_the_target_or_from_the_median() -> None:
    console = Console(file=io.StringIO(), width=80)
    pitches = PitchTable.of_pitches([[1.499e-3, 1.5e-3, 1.501e-3]], [0.0])
    assert deviation_lines(console, pitches, 1.5e-3)[1].plain.endswith("-1.00..+1.00")
    assert "1.5 mm" in deviation_lines(console, pitches, 1.5e-3)[0].plain
    unknown = PitchTable.of_pitches([[1.5e-3, 1.6e-3]], [0.0])
    assert deviation_lines(console, unknown)[1].plain.endswith("-50.00..+50.00")
    assert deviation_lines(console, PitchTable.of_pitches([[np.nan]], [0.0])) == []


def test_the_verdict_is_one_line_whose_cause_has_a_colour() -> None:
    line = verdict_line("mechanical", "Mechanical: the fluctuation is not in the nominal pitches.")
    assert line.plain == "Verdict: Mechanical: the fluctuation is not in the nominal pitches."
    assert [span.style for span in line.spans] == ["bold", "bold red"]
