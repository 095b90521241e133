"""What words are worth: decimal points, increments, inch, start angles, packed digits, modality."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from threadpitch.cycles import (
    DIALECTS,
    FANUC,
    GSK980TDI,
    GSK988TA,
    TOMATECH,
    Dialect,
    IncrementSystem,
    Indexing,
    Interpretation,
    Point,
    Setup,
    Wait,
    expand_cycle,
    interpret,
    read_program,
)
from threadpitch.cycles.dialect import BareNumber
from threadpitch.cycles.moves import Dwell, Feed, SpindleSpeed, SurfaceSpeed, Thread

MM = 1e-3
READY = "G97 S500 M3\nG0 X26. Z6.\n"


def run(text: str, setup: Setup | None = None) -> Interpretation:
    return interpret(read_program(READY + text), setup)


def threads(text: str, setup: Setup | None = None) -> list[Thread]:
    return [move for move in run(text, setup).moves if isinstance(move, Thread)]


@pytest.mark.parametrize(("words", "increments", "depth_mm"), [
    ("P1. Q0.3", IncrementSystem.IS_B, (0.3, 1.0)), ("P1000 Q300", IncrementSystem.IS_B, (0.3, 1.0)),
    ("P1000 Q300", IncrementSystem.IS_C, (0.03, 0.1)), ("P1. Q.3", IncrementSystem.IS_C, (0.3, 1.0)),
])
def test_heights_and_cuts_count_increments_without_a_point(words: str, increments: IncrementSystem,
                                                           depth_mm: tuple[float, float]) -> None:
    result = expand_cycle(["G76 P010060 Q0 R0", f"G76 X18 Z-30 {words} F2"], Setup(increments=increments))
    assert result.passes[0].depth == pytest.approx(depth_mm[0] * MM, abs=1e-15)
    assert result.passes[-1].depth == pytest.approx(depth_mm[1] * MM, abs=1e-15)


def test_other_lengths_are_millimetres_with_and_without_a_point() -> None:
    assert threads("G32 X20 Z-30 F2")[0].path.end == threads("G32 X20. Z-30. F2.")[0].path.end == Point(0.01, -0.03)


def test_a_fanuc_without_calculator_input_counts_increments() -> None:
    setup = Setup(dialect=replace(FANUC, bare_number=BareNumber.INCREMENT))
    assert threads("G32 X20000 Z-30000 F2.", setup)[0].path.end == Point(0.01, -0.03)


def test_inch_holds_for_lengths_leads_increments_and_feeds() -> None:
    result = interpret(read_program("G20 G97 S500 M3\nG0 X1. Z.2\nG1 X.9 F.01\nG76 P010060 Q20 R.001\n"
                                    "G76 X.8 Z-1. P300 Q100 I10\nG32 X.7 F.1"))
    feed = next(move for move in result.moves if isinstance(move, Feed))
    assert feed.per_turn == pytest.approx(0.254 * MM)
    assert result.cycles[0].height == pytest.approx(0.03 * 25.4 * MM)
    assert result.cycles[0].helix.lead == pytest.approx(2.54 * MM)
    assert result.passes[-1].lead == pytest.approx(2.54 * MM)
    assert result.rewritten["059"] == pytest.approx(50.8)
    assert result.rewritten["060"] == pytest.approx(25.4)


def test_differences_count_from_where_the_tool_is_and_u_is_a_diameter() -> None:
    move = threads("G0 U-2. W1.\nG32 U-1. W-30. F2.")[0]
    assert move.path.start == Point(12 * MM, 7 * MM)
    assert (move.path.end.x, move.path.end.z) == pytest.approx((11.5 * MM, -23 * MM))


@pytest.mark.parametrize(("dialect", "word", "angle"), [
    (TOMATECH, "Q90000", 90.0), (TOMATECH, "", 0.0), (FANUC, "Q360000", 0.0), (GSK980TDI, "Q1", 0.001),
    (GSK988TA, "Q90", 90.0), (GSK988TA, "Q450", 90.0), (GSK988TA, "Q22.5", 22.5), (GSK988TA, "Q-90", 270.0)])
def test_start_angles(dialect: Dialect, word: str, angle: float) -> None:
    path = threads(f"G32 Z-30. F2. {word}", Setup(dialect=dialect))[0].path
    assert math.degrees(path.start_angle) == pytest.approx(angle, abs=1e-9)
    assert 0.0 <= path.start_angle < 2.0 * math.pi


def test_only_the_first_block_of_a_chain_waits_and_the_lead_is_modal() -> None:
    first, second, third, fourth = threads("G32 Z-10. F2. Q90000\nW-5. Q45000\nG33 W-5. F0.5\nG0 X30.\nX26.\nG32 W-5.")
    assert [move.path.wait for move in (first, second, third, fourth)] == [Wait.INDEX, Wait.NONE, Wait.NONE, Wait.INDEX]
    assert [move.path.lead / MM for move in (first, second, third, fourth)] == pytest.approx([2.0, 2.0, 0.5, 0.5])
    assert [move.pass_number for move in (first, second, third, fourth)] == [1, 1, 1, 2]
    assert math.degrees(fourth.path.start_angle) == 0.0


def test_a_dwell_breaks_a_chain() -> None:
    first, second = threads("G32 Z-10. F2.\nG4 X0.5\nG32 W-5.")
    assert first.path.wait is second.path.wait is Wait.INDEX


def test_special_grooves_wait_for_every_start_angle_without_a_new_index() -> None:
    text = "G32 W-2. F4. Q0\nW-1. Q270000\nW0 F0 Q90000"
    moves = threads(text, Setup(indexing=Indexing.EVERY_BLOCK))
    assert [move.path.wait for move in moves] == [Wait.INDEX, Wait.START_ANGLE, Wait.START_ANGLE]
    assert [math.degrees(move.path.start_angle) for move in moves] == pytest.approx([0.0, 270.0, 90.0])
    assert (moves[2].path.lead, moves[2].path.turns) == (0.0, 0.0)


@pytest.mark.parametrize(("dialect", "word", "changed"), [
    (TOMATECH, "P021060", {"057": 2, "019": 10, "058": 60}), (TOMATECH, "P55", {"058": 55}),
    (TOMATECH, "P5", {"058": 5}), (GSK980TDI, "P1055", {"019": 10, "058": 55}),
    (TOMATECH, "P31055", {"057": 3, "019": 10, "058": 55}), (GSK988TA, "P21060", {"057": 2, "019": 10, "058": 60}),
    (FANUC, "P10060", {"057": 1, "019": 0, "058": 60})])
def test_packed_digits(dialect: Dialect, word: str, changed: dict[str, int]) -> None:
    result = run(f"G76 {word}\nG76 X18. Z-30. P1. Q.3 F2.", Setup(dialect=dialect))
    expected = Setup().parameters.changed(changed).by_number()
    cycle = result.cycles[0]
    assert cycle.infeed.finishing_passes == expected["057"]
    assert math.degrees(cycle.tool_angle) == pytest.approx(expected["058"])
    width = cycle.helix.run_out.length if cycle.helix.run_out else 0.0
    assert width == pytest.approx(0.1 * expected["019"] * 2 * MM)
    assert result.rewritten == (changed if dialect.rewrites_parameters else {})


@pytest.mark.parametrize("dialect", DIALECTS.values(), ids=lambda dialect: dialect.name)
def test_execution_rewrites_parameters_that_the_next_cycle_uses(dialect: Dialect) -> None:
    again = "G76 X18. Z-30. P1. Q.3 F2.\n"
    result = run("G76 P020029 Q70 R0.08\n" + again + again, Setup(dialect=dialect))
    first, second = result.cycles
    assert first.infeed.finishing_passes == 2
    assert first.infeed.least_cut == pytest.approx(0.07 * MM)
    if dialect.rewrites_parameters:
        assert second == first
        assert result.rewritten == {"057": 2, "019": 0, "058": 29, "059": 70.0, "060": 80.0}
        assert result.parameters.by_number()["060"] == 80
    else:
        assert second.infeed.finishing_passes == Setup().parameters.finishing_passes
        assert result.parameters == Setup().parameters


@pytest.mark.parametrize(("words", "run_out_mm"), [
    ("", (1.0, 1.0)), ("J1.5", (1.5, 1.5)), ("J1.5 K3.", (3.0, 1.5)), ("K2.", (2.0, 2.0)), ("J0", None),
    ("J0 K3.", None)])
def test_run_out_words(words: str, run_out_mm: tuple[float, float] | None) -> None:
    for block in (f"G92 X18. Z-30. F2. {words}", f"G76 P0560\nG76 X18. Z-30. P1. Q.3 F2. {words}"):
        made = run(block).passes[0].run_out
        assert (None if made is None else (made.length / MM, made.height / MM)) == (
            None if run_out_mm is None else pytest.approx(run_out_mm))


def test_g92_takes_its_run_out_from_the_parameter_that_is_kept() -> None:
    text = "G76 P011260 Q50 R0.05\nG92 X18. Z-30. F2."
    for dialect, length in ((TOMATECH, 2.4), (GSK980TDI, 1.0)):
        made = run(text, Setup(dialect=dialect)).passes[0].run_out
        assert made is not None
        assert made.length == pytest.approx(length * MM)


def test_g92_takes_starts_and_taper_and_keeps_its_end_point() -> None:
    cuts = run("G92 X18. Z-30. F3. R-1. L3\nX17.5\nG0 X30.\nG92 X17. Z-30.").passes
    assert [cut.start_number for cut in cuts] == [1, 2, 3, 1, 2, 3, 1]
    assert [round(math.degrees(cut.start_angle)) for cut in cuts[:3]] == [0, 120, 240]
    assert cuts[3].end == Point(8.75 * MM, -30 * MM)
    assert cuts[3].start.x == pytest.approx(7.75 * MM)
    assert cuts[6].paths[0].taper == 0.0


def test_spindle_words() -> None:
    moves = interpret(read_program("G96 S120\nM3\nG97 S300\nM4\nG4 P1500\nM5\nM3")).moves
    speeds = [(type(move), move.speed, move.direction) for move in moves
              if isinstance(move, SpindleSpeed | SurfaceSpeed)]
    rpm_300 = pytest.approx(10.0 * math.pi)
    assert speeds == [(SurfaceSpeed, 2.0, "forward"), (SpindleSpeed, rpm_300, "forward"),
                      (SpindleSpeed, rpm_300, "reverse"), (SpindleSpeed, rpm_300, "forward")]
    assert next(move.duration for move in moves if isinstance(move, Dwell)) == 1.5


@pytest.mark.parametrize(("text", "words"), [
    ("T0101\nG76 P010055\nG76 X18. Z-30. P1. Q.3 F2.", "tool's own angle is 60"),
    ("G96 S100\nG32 Z-30. F2.", "write G97"), ("M41", "belongs to the machine"),
    ("G0 X20.0005", "finer than the least input increment"),
    ("G32 Z-3. F2.\nS700\nG32 Z-9.", "waits for the one-turn signal anew"),
    ("G32 Z-3. F2.\nG4 P100\nG32 Z-9.", "waits for the one-turn signal anew"),
    ("G92 X20. Z-9. F2.\nM4\nX19.", "pass 2 turns the other way than pass 1 in the same groove"),
    ("G92 X20. Z-9. F2.\nS700\nX19.", "passes 1 and 2 cut one groove at 500 and 700 rpm")])
def test_notes(text: str, words: str) -> None:
    notices = run(text, Setup(tool_angles={1: math.radians(60.0)})).notices
    assert any(words in notice.text for notice in notices)
    assert all("\n" not in str(notice) and str(notice).startswith("line ") for notice in notices)


def test_a_lone_g90_is_no_cycle_and_text_may_be_dense_or_loose() -> None:
    loose = run("g21 g90 g40\nn10 g 32 (to the end) z -30. f2. ; g0 x30.")
    dense = run("G32Z-30.F2.;G0X30.")
    assert [type(move) for move in loose.moves] == [type(move) for move in dense.moves]
    assert loose.passes == dense.passes


def test_a_cycle_alone_assumes_a_start_point_clear_of_the_thread_and_says_so() -> None:
    blocks = ["G76 P010060 Q50 R0.05", "G76 X18. Z-30. P1. Q.3 F2."]
    result = expand_cycle(blocks)
    assert any("start point" in notice.text for notice in result.notices)
    assert result.passes[0].approach.x > 10 * MM
    told = expand_cycle(blocks, Setup(position=Point(12 * MM, 4 * MM)))
    assert told.passes[0].approach == Point(12 * MM, 4 * MM)
    assert not any("start point" in notice.text for notice in told.notices)
