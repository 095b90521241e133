"""The JSON document, the table and the text of a cycle."""

from __future__ import annotations

import io
import json
import math
import pickle

import pytest
from rich.console import Console

from threadpitch.cycles import (
    CycleError,
    Interpretation,
    Point,
    ProgramError,
    Setup,
    cycle_document,
    cycle_table,
    expand_cycle,
    interpret,
    read_program,
    spindle_of_passes,
    start_point,
)

M68X6 = ["G76 P020560 Q0.150 R0.1", "G76 X60.64 Z-62 P3.68 Q1.8 F6"]
KEYS = ["number", "kind", "depth_mm", "start_x_mm", "start_z_mm", "end_x_mm", "end_z_mm", "start_angle_deg"]


def gsk_example() -> Interpretation:
    return expand_cycle(M68X6, Setup(position=Point(0.040, 0.010)))


def test_the_document_has_the_keys_and_round_millimetres() -> None:
    document = json.loads(json.dumps(cycle_document(gsk_example())))
    assert list(document) == ["passes", "parameters"]
    assert all(list(record) == KEYS for record in document["passes"])
    first, last = document["passes"][0], document["passes"][-1]
    assert (first["depth_mm"], first["start_x_mm"], first["end_x_mm"]) == (1.8, 64.4, 64.4)
    assert (last["depth_mm"], last["end_x_mm"], last["end_z_mm"], last["kind"]) == (3.68, 60.64, -62.0, "finish")
    assert document["parameters"] == {"019": 5, "057": 2, "058": 60, "059": 150, "060": 100, "106": 0, "253": 2}


def test_depths_that_the_words_do_not_tell_are_null() -> None:
    result = interpret(read_program("S500 M3\nG0 X26. Z6.\nG92 X18. Z-30. F2.\nG32 Z-30."))
    records = cycle_document(result)["passes"]
    assert [record["depth_mm"] for record in records] == [None, None]  # type: ignore[attr-defined]


def test_the_table_fits_80_characters() -> None:
    console = Console(file=io.StringIO(), width=80)
    console.print(cycle_table(gsk_example().passes))
    assert isinstance(console.file, io.StringIO)
    text = console.file.getvalue()
    assert "lead 6.0000 mm" in text
    assert "…" not in text
    assert "| 64.4000 |" in text
    assert all(len(line) <= 80 for line in text.splitlines())


def test_start_points_are_millimetres_with_x_as_diameter() -> None:
    point = start_point("26, 6.5")
    assert (point.x, point.z) == pytest.approx((0.013, 0.0065))
    for text in ("26", "26,", "a,b", "1,2,3", "nan,1", ""):
        with pytest.raises(CycleError, match="write two numbers"):
            start_point(text)


def test_passes_know_the_spindle_they_begin_with() -> None:
    result = interpret(read_program("S500 M3\nG0 X26. Z6.\nG92 X18. Z-30. F2.\nG96 S60\nX17.\nG97 S300\nX16."))
    spindles = spindle_of_passes(result.moves)
    speeds = [spindle.speed for spindle in spindles.values() if spindle is not None]
    assert speeds == pytest.approx([500 * math.pi / 30, 1.0, 10 * math.pi])
    alone = gsk_example()
    assert set(spindle_of_passes(alone.moves).values()) == {None}


def test_an_alarm_crosses_processes_whole() -> None:
    with pytest.raises(ProgramError) as caught:
        interpret(read_program("G0 X"))
    copied = pickle.loads(pickle.dumps(caught.value))
    assert (str(copied), copied.place, copied.alarm) == (str(caught.value), caught.value.place, caught.value.alarm)
    assert isinstance(copied, CycleError)
