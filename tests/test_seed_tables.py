"""Tables 1 to 4 of US 2016/0008901 A1, from xi at 0, 360, 720, ... degrees (and at every 90 degrees).

The seed prints P(1), P(2), P(3), "...", P(n) to 0.01 mm, not the turns between, and not n. Where its figures do not
follow from each other:
- Table 2 has the maximum 1.52 and the mean 1.50; the printed turns of Table 1 reach 1.51 and have the mean 1.48. Both
  need unprinted turns: one of 1.52 at least.
- The same holds in Table 4 for theta_S1. The maxima of theta_S2, theta_S3, theta_S4 and all minima are printed turns.
- Mean 1.51 beside maximum 1.51 for theta_S4 is possible only in the rounding: P(1) = 1.43 has to be made up for by at
  least nine unprinted turns between 1.505 and 1.515.
- P(n) is 1.49 in Table 1 and 1.48 for theta_S1 in Table 3: with theta_S1 = 0 these are not the same thread, or not the
  same n.
So the turns between are chosen here such that the printed statistics come out.
"""

import json
import math

import numpy as np
import pytest
from rich.console import Console

from threadpitch.pitch import GroupPitch, PitchTable, thread_pitch
from threadpitch.tables import Layout, analysis_document, pitch_tables_text, show_groups
from threadpitch.trace import FloatArray, Trace

TURN = 2.0 * math.pi
TABLE_1 = [1.43, 1.48, 1.51, *[1.52, 1.51, 1.52, 1.51, 1.51, 1.50, 1.51, 1.50], 1.49]  # mm; from the fourth on chosen
TABLE_3 = np.array([  # (start_angles, revolutions) mm; columns 4 to 15 are chosen
    [1.43, 1.48, 1.51, *[1.52, 1.51, 1.51, 1.51, 1.51, 1.50, 1.51, 1.50, 1.51, 1.50, 1.51, 1.50], 1.48],
    [1.42, 1.47, 1.51, *[1.51, 1.50, 1.50, 1.50, 1.49, 1.50, 1.50, 1.50, 1.49, 1.50, 1.50, 1.49], 1.47],
    [1.42, 1.48, 1.52, *[1.51, 1.51, 1.51, 1.50, 1.51, 1.50, 1.51, 1.50, 1.51, 1.50, 1.51, 1.50], 1.48],
    [1.434, 1.494, 1.514, *[1.514] * 12, 1.494],
])
TABLE_4 = {"max": [1.52, 1.51, 1.52, 1.51], "min": [1.43, 1.42, 1.42, 1.43], "mean": [1.50, 1.49, 1.50, 1.51]}
SPINDLE = np.radians((0.0, 90.0, 180.0, 270.0))


def table_1() -> PitchTable:
    """xi at 0, 360, 720, ... degrees."""
    position = 1e-3 * np.concatenate(([0.0], np.cumsum(TABLE_1)))
    return thread_pitch(TURN * np.arange(position.size), position)


def table_3() -> PitchTable:
    """xi at every 90 degrees; the start angles begin a quarter of the first turn apart."""
    begins = np.array([[0.0], [0.36], [0.72], [1.08]])  # mm
    crossings: FloatArray = 1e-3 * (begins + np.concatenate((np.zeros((4, 1)), np.cumsum(TABLE_3, axis=1)), axis=1))
    position = crossings.T.ravel()
    return thread_pitch(0.25 * TURN * np.arange(position.size), position, SPINDLE)


def two_decimals(values_m: FloatArray) -> list[float]:
    return [round(float(value), 2) for value in 1e3 * np.ravel(values_m)]


def cells(text: str) -> list[list[str]]:
    """The rows of figures of a printed table."""
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    return [row for row in rows if row[-1].replace(".", "").isdigit()]


def test_table_1_movement_for_each_rotation() -> None:
    pitch = table_1().pitch
    np.testing.assert_allclose(pitch[0], 1e-3 * np.array(TABLE_1), rtol=0.0, atol=1e-17)
    assert two_decimals(pitch[0, [0, 1, 2, -1]]) == [1.43, 1.48, 1.51, 1.49]


def test_table_2_maximum_minimum_mean() -> None:
    table = table_1()
    assert two_decimals(np.stack([table.maximum, table.minimum, table.mean])) == [1.52, 1.43, 1.50]


def test_table_3_several_start_angles() -> None:
    pitch = table_3().pitch
    assert pitch.shape == (4, 16)
    assert two_decimals(pitch[:, 0]) == [1.43, 1.42, 1.42, 1.43]
    assert two_decimals(pitch[:, 1]) == [1.48, 1.47, 1.48, 1.49]
    assert two_decimals(pitch[:, 2]) == [1.51, 1.51, 1.52, 1.51]
    assert two_decimals(pitch[:, -1]) == [1.48, 1.47, 1.48, 1.49]


def test_table_4_statistics_of_every_start_angle() -> None:
    table = table_3()
    found = {"max": table.maximum, "min": table.minimum, "mean": table.mean}
    assert {name: two_decimals(values) for name, values in found.items()} == TABLE_4


def test_the_printed_tables_hold_the_figures_of_the_seed() -> None:
    single = cells(pitch_tables_text(table_1(), Layout(decimals=2)))
    assert single[:3] == [["360", "1", "1.43"], ["720", "2", "1.48"], ["1080", "3", "1.51"]]
    assert single[-2:] == [["4320", "12", "1.49"], ["theta_S1 = 0 deg", "1.52", "1.43", "1.50"]]
    several = cells(pitch_tables_text(table_3(), Layout(decimals=2)))
    assert several[0] == ["360", "1", "1.43", "1.42", "1.42", "1.43"]
    assert several[15] == ["5760", "16", "1.48", "1.47", "1.48", "1.49"]
    assert several[-1] == ["theta_S4 = 270 deg", "1.51", "1.43", "1.51"]


def test_many_start_angles_are_folded_into_the_width_and_nothing_is_lost() -> None:
    table = thread_pitch(TURN * np.arange(12.0), 1.5e-3 * np.arange(12.0), np.radians(np.arange(0.0, 360.0, 30.0)))
    text = pitch_tables_text(table)
    assert max(map(len, text.splitlines())) <= 80
    assert all(f"theta_S{k}" in text for k in range(1, 13))
    assert sum(row[0] == "360" for row in cells(text)) == 3
    assert " - " in text  # the end of the later start angles


def test_a_pipe_gets_plain_text_and_a_terminal_no_control_characters_of_the_log() -> None:
    trace = Trace(np.array([0.1, 0.25, 20.0]), np.arange(3.0), notes=("note \x1b[2J",))
    table = thread_pitch(trace.angle, trace.position)
    group = GroupPitch("pass \x1b[31m[red]", trace, PitchTable(table.start_angles, table.pitch, table.crossings,
                                                              table.extrapolated, notes=trace.notes))
    console = Console(width=80, color_system=None)
    with console.capture() as captured:
        show_groups(console, [group])
    text = captured.get()
    assert text.isascii()
    assert "\x1b" not in text
    assert "Group pass ?[31m[red]" in text
    assert "* begins before the first sample" in text
    assert "note ?[2J" in text


def test_the_document_has_units_in_its_names_and_null_where_no_crossing_is() -> None:
    trace = Trace(TURN * np.arange(0.0, 2.6, 0.5), 1.5e-3 * np.arange(0.0, 2.6, 0.5))
    table = thread_pitch(trace.angle, trace.position, (0.0, np.radians(300.0)))
    document = json.loads(json.dumps(analysis_document([GroupPitch("1", trace, table)]), allow_nan=False))
    (group,) = document["groups"]
    assert group["group"] == "1"
    assert group["start_angles_deg"] == [0.0, 300.0]
    assert group["pitch_mm"][0] == pytest.approx([1.5, 1.5], abs=1e-12)
    assert group["pitch_mm"][1] == [pytest.approx(1.5), None]
    assert group["min_mm"] == group["max_mm"] == group["mean_mm"] == pytest.approx([1.5, 1.5])
    assert group["extrapolated"] == [False, False]
    assert group["turns_before"] == 0
