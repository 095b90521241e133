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
    turning_speed,
)

M68X6 = ["G76 P020560 Q0.150 R0.1", "G76 X60.64 Z-62 P3.68 Q1.8 F6"]
KEYS = ["number", "kind", "depth_mm", "start_x_mm", "start_z_mm", "end_x_mm", "end_z_mm", "start_angle_deg", "hand"]


def gsk_example() -> Interpretation:
    return expand_cycle(M68X6, Setup(position=Point(0.040, 0.010)))


def test_the_document_has_the_keys_and_round_millimetres() -> None:
    document = json.loads(json.dumps(cycle_document(gsk_example())))
    assert list(document) == ["passes", "parameters"]
    assert all(list(record) == KEYS for record in document["passes"])
    first, last = document["passes"][0], document["passes"][-1]
    assert (first["depth_mm"], first["start_x_mm"], first["end_x_mm"]) == (1.8, 64.4, 64.4)
    assert (last["depth_mm"], last["end_x_mm"], last["end_z_mm"], last["kind"]) == (3.68, 60.64, -62.0, "finish")
    assert document["parameters"] == {"019": 5, "057": 2, "058": 60, "059": 150, "060": 100, "106": 0, "253": 0}


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


@pytest.mark.parametrize(("direction", "end", "hand"), [
    ("M3", "Z-30.", "right"), ("M4", "Z-30.", "left"), ("M3", "Z30.", "left"), ("M4", "Z30.", "right"),
    ("M3", "X20.", None)])
def test_the_hand_follows_from_the_turning_direction_and_the_feed(direction: str, end: str, hand: str | None) -> None:
    result = interpret(read_program(f"G97 S500 {direction}\nG0 X26. Z6.\nG32 {end} F2."))
    records = cycle_document(result)["passes"]
    assert isinstance(records, list)
    assert [record["hand"] for record in records] == [hand]
    title = str(cycle_table(result.passes, result.moves).title)
    assert ("left-hand" in title) == (hand == "left")


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


def test_a_surface_speed_has_the_limit_that_holds() -> None:
    for text in ("G50 S900\nG96 S60 M3\n", "G96 S60 M3\nG50 S900\n"):
        result = interpret(read_program(f"{text}G0 X26. Z6.\nG32 X2. Z-30. F2."))
        (command,) = spindle_of_passes(result.moves).values()
        assert command is not None
        assert turning_speed(command, result.passes[0]) == pytest.approx(900 * math.pi / 30)  # not 9549 rpm at X2
    (free,) = spindle_of_passes(interpret(read_program("G96 S60 M3\nG0 X26. Z6.\nG32 X0 F2.")).moves).values()
    assert free is not None
    assert turning_speed(free, result.passes[0]) == pytest.approx(1000.0)  # 1 m/s at X2


def test_an_alarm_crosses_processes_whole() -> None:
    with pytest.raises(ProgramError) as caught:
        interpret(read_program("G0 X"))
    copied = pickle.loads(pickle.dumps(caught.value))
    assert (str(copied), copied.place, copied.alarm) == (str(caught.value), caught.value.place, caught.value.alarm)
    assert isinstance(copied, CycleError)
    assert caught.value.__context__ is None  # Lark's error would come along where tracebacks are pickled too
