"""Bad programs: one line that says the place, the alarm and the mend. One row per class of error."""

from __future__ import annotations

from pathlib import Path

import pytest

from threadpitch.cycles import (
    Alarm,
    CycleError,
    ProgramError,
    Setup,
    dialect_named,
    expand_cycle,
    interpret,
    read_program,
    read_program_file,
)

READY = "G97 S500 M3\nG0 X26. Z6.\n"  # two lines; the cases begin in line 3
FIRST = "G76 P010060 Q50 R0.05\n"
GOOD = "G76 X18. Z-30. P1000 Q300 F1.5"

# text, line, column, alarm, words of the message
BAD = [
    # text that is no NC program
    ("G0 X", 1, 4, Alarm.NO_NUMBER, "address X has no number"),
    ("G0 X10. Z\nM30", 1, 9, Alarm.NO_NUMBER, "address Z has no number"),
    ("G0 X--5.", 1, 5, Alarm.NO_NUMBER, "digits have to follow -"),
    ("G0 X.", 1, 5, Alarm.NO_NUMBER, "digits have to follow ."),
    ("G0 10.", 1, 4, Alarm.NO_ADDRESS, "10. has no address"),
    ("G0 X1.2.3", 1, 8, Alarm.POINT, "two decimal points"),
    ("G0 X123456.789", 1, 4, Alarm.DIGITS, "more than 8 digits"),
    ("G0 X10. (no end", 1, 9, Alarm.COMMENT, "close it with )"),
    ("G0 X10. )", 1, 9, Alarm.ILLEGAL, "none of the NC code"),
    ("#1 = 5", 1, 1, Alarm.ILLEGAL, "macros"),
    ("G0 X[5]", 1, 5, Alarm.ILLEGAL, "macros"),
    ("G0 X10. /Z5.", 1, 9, Alarm.ILLEGAL, "skip sign leads"),
    ("G0 X10. %", 1, 9, Alarm.ILLEGAL, "line of its own"),
    ("G0 \u0416", 1, 4, Alarm.ILLEGAL, "none of the NC code"),
    # words and codes
    ("G0 X10. X12.", 1, 9, Alarm.REPEATED, "after X10."),
    ("G0 X10. U2.", 1, 9, Alarm.END_POINT, "one axis twice"),
    ("G0 X10. Y2.", 1, 9, Alarm.ILLEGAL, "means nothing in this block"),
    ("G77", 1, 1, Alarm.G_CODE, "not known here"),
    ("G2 X10. Z5. R2.", 1, 1, Alarm.G_CODE, "arcs are not simulated"),
    ("G50.2", 1, 1, Alarm.G_CODE, "whole number"),
    ("G0 G32 X10.", 1, 4, Alarm.G_CODE, "contradicts G0"),
    ("G20 G21", 1, 5, Alarm.G_CODE, "contradicts G20"),
    ("G91", 1, 1, Alarm.G_CODE, "write U and W"),
    ("M98 P1", 1, 1, Alarm.M_CODE, "subprograms"),
    ("S500 M3 M4", 1, 9, Alarm.M_CODE, "contradicts M3"),
    ("S500 M5 M3", 1, 9, Alarm.M_CODE, "contradicts M5"),
    ("M3.5 S500", 1, 1, Alarm.POINT, "no decimal point"),
    ("S-500 M3", 1, 1, Alarm.MINUS, "without sign"),
    ("S100000 M3", 1, 1, Alarm.RANGE, "write 0 to 99999"),
    ("T10000", 1, 1, Alarm.RANGE, "write 0 to 9999"),
    ("G4", 1, 1, Alarm.NO_NUMBER, "no duration"),
    ("G4 P1.5", 1, 4, Alarm.POINT, "no decimal point"),
    ("G50", 1, 1, Alarm.NO_NUMBER, "G50 has no word"),
    ("G0 X100000.", 1, 4, Alarm.RANGE, "out of its range"),
    # places and feeds
    ("G0 U5.", 1, 4, Alarm.POSITION, "write X before"),
    ("G1 X10. Z5. F0.2", 1, 1, Alarm.POSITION, "tool's X"),
    (READY + "G1 X10.", 3, 1, Alarm.NO_FEED, "no feed"),
    (READY + "G1 X10. F0", 3, 9, Alarm.RANGE, "out of its range"),
    # G32, G33, G34
    ("G0 X26. Z6.\nG32 Z-30. F1.5", 2, 1, Alarm.SPINDLE, "write S and M3"),
    ("S500\nG0 X26. Z6.\nG32 Z-30. F1.5", 3, 1, Alarm.SPINDLE, "stands still"),
    ("M3\nG0 X26. Z6.\nG32 Z-30. F1.5", 3, 1, Alarm.SPINDLE, "turning spindle"),
    (READY + "M5\nG32 Z-30. F1.5", 4, 1, Alarm.SPINDLE, "stands still"),
    ("S500 M3\nG32 Z-30. F1.5", 2, 1, Alarm.POSITION, "tool's X"),
    (READY + "G32 Z-30.", 3, 1, Alarm.NO_FEED, "no lead"),
    (READY + "G33 Z-40. K1.5", 3, 1, Alarm.NO_FEED, "no lead"),
    (READY + "G32 Z-30. F0", 3, 11, Alarm.NO_FEED, "is zero"),
    (READY + "G32 Z-30. F-1.5", 3, 11, Alarm.MINUS, "negative"),
    (READY + "G32 Z-30. F501.", 3, 11, Alarm.RANGE, "0.001 to 500 mm"),
    (READY + "G32 Z-30. I0.05", 3, 11, Alarm.RANGE, "threads per inch"),
    (READY + "G32 Z-30. I-8", 3, 11, Alarm.MINUS, "negative"),
    (READY + "G32 Z-30. F1.5 I8", 3, 16, Alarm.REPEATED, "both give the lead"),
    (READY + "G32 Z6. F1.5", 3, 1, Alarm.LENGTH, "does not move"),
    (READY + "G32 Z-30. F1.5 Q360001", 3, 16, Alarm.RANGE, "thousandths of a degree"),
    (READY + "G32 Z-30. F1.5 Q-5", 3, 16, Alarm.MINUS, "without sign"),
    (READY + "G32 Z-30. F1.5 Q90.0", 3, 16, Alarm.POINT, "thousandths"),
    (READY + "G32 Z-30. F1.5 J1. K40.", 3, 19 + 1, Alarm.RUN_OUT, "shorten"),
    (READY + "G32 Z-30. F1.5 J-1.", 3, 16, Alarm.MINUS, "without sign"),
    (READY + "G34 Z-30. F1.5", 3, 1, Alarm.VARIABLE_LEAD, "no change of lead"),
    (READY + "G34 Z-30. F1.5 R0.0005", 3, 16, Alarm.VARIABLE_LEAD, "0.001 to 500"),
    (READY + "G34 Z-30. F1.5 R-0.5", 3, 16, Alarm.VARIABLE_LEAD, "turns negative"),
    (READY + "G34 Z-9000. F400. R100.", 3, 19, Alarm.VARIABLE_LEAD, "beyond 500 mm"),
    # G92
    (READY + "G92 X18. Z-30.", 3, 1, Alarm.NO_FEED, "no lead"),
    (READY + "G92 X18. F1.5", 3, 1, Alarm.LENGTH, "give it a length"),
    (READY + "G92 Z-30. F1.5", 3, 1, Alarm.END_POINT, "ends at the X"),
    (READY + "G92 X18. Z-30. F1.5 L0", 3, 21, Alarm.RANGE, "1 to 99"),
    (READY + "G92 X18. Z-30. F1.5 L100", 3, 21, Alarm.RANGE, "1 to 99"),
    (READY + "G92 X18. Z-30. F1.5 Q90000", 3, 21, Alarm.ILLEGAL, "means nothing"),
    (READY + "G92 X18. Z-30. F1.5 R5.", 3, 21, Alarm.CYCLE, "past the start point"),
    (READY + "G92 X18. Z-30. F1.5 J1. K50.", 3, 25, Alarm.RUN_OUT, "run-out"),
    # G76, first block
    (READY + "G76", 3, 1, Alarm.CYCLE, "no word"),
    (READY + "G76 P0100605 Q50 R0.05", 3, 5, Alarm.DIGITS, "more than six digits"),
    (READY + "G76 P-10060 Q50 R0.05", 3, 5, Alarm.MINUS, "without a sign"),
    (READY + "G76 P0100.6 Q50 R0.05", 3, 5, Alarm.POINT, "without a point"),
    (READY + "G76 P010060 Q-50 R0.05", 3, 13, Alarm.MINUS, "without sign"),
    (READY + "G76 P010060 Q100000 R0.05", 3, 13, Alarm.RANGE, "0 to 99.999 mm"),
    (READY + "G76 P010060 Q50 R-0.05", 3, 17, Alarm.MINUS, "without sign"),
    (READY + "G76 P010060 Q50 R100.", 3, 17, Alarm.RANGE, "0 to 99.999 mm"),
    (READY + "G76 P010060 Q50 R0.05 L2", 3, 23, Alarm.ILLEGAL, "means nothing"),
    # G76, second block
    ("G0 X26. Z6.\n" + FIRST + GOOD, 3, 1, Alarm.SPINDLE, "turning spindle"),
    ("S500 M3\n" + FIRST + GOOD, 3, 1, Alarm.POSITION, "tool's X"),
    (READY + FIRST + "G76 Z-30. P1000 Q300 F1.5", 4, 1, Alarm.END_POINT, "neither X nor U"),
    (READY + FIRST + "G76 X18. P1000 Q300 F1.5", 4, 1, Alarm.END_POINT, "neither Z nor W"),
    (READY + FIRST + "G76 X18. U-8. Z-30. P1000 Q300 F1.5", 4, 10, Alarm.END_POINT, "one axis twice"),
    (READY + FIRST + "G76 X18. Z-30. Q300 F1.5", 4, 1, Alarm.CYCLE, "no thread height"),
    (READY + FIRST + "G76 X18. Z-30. P0 Q300 F1.5", 4, 16, Alarm.CYCLE, "P(k) is not positive"),
    (READY + FIRST + "G76 X18. Z-30. P-1000 Q300 F1.5", 4, 16, Alarm.MINUS, "without sign"),
    (READY + FIRST + "G76 X18. Z-30. P1000 F1.5", 4, 1, Alarm.CYCLE, "no first cut"),
    (READY + FIRST + "G76 X18. Z-30. P1000 Q0 F1.5", 4, 22, Alarm.CYCLE, "Q(dd) is not positive"),
    (READY + FIRST + "G76 X18. Z-30. P1000 Q300", 4, 1, Alarm.NO_FEED, "no lead"),
    (READY + FIRST + "G76 X18. Z-30. P40 Q30 F1.5", 4, 16, Alarm.CYCLE, "dmin"),
    (READY + "G76 P010060 Q10 R0.05\nG76 X18. Z-30. P40 Q30 F1.5", 4, 16, Alarm.CYCLE, "allowance"),
    (READY + FIRST + "G76 X18. Z6. P1000 Q300 F1.5", 4, 10, Alarm.LENGTH, "give it a length"),
    (READY + FIRST + "G76 X26. Z-30. P1000 Q300 F1.5", 4, 5, Alarm.END_POINT, "ends at the X"),
    (READY + FIRST + "G76 X18. Z5.5 P1000 Q300 F1.5", 4, 10, Alarm.LENGTH, "flank infeed"),
    (READY + FIRST + "G76 X18. Z-30. R5. P1000 Q300 F1.5", 4, 16, Alarm.CYCLE, "past the start point"),
    (READY + FIRST + "G76 X18. Z-30. P1000 Q300 F1.5 J1. K36.", 4, 36, Alarm.RUN_OUT, "run-out"),
    (READY + "G76 P019960 Q50 R0.05\nG76 X18. Z-3. P1000 Q300 F1.5", 4, 1, Alarm.RUN_OUT, "run-out"),
    (READY + "G76 P010060 Q0 R0\nG76 X18. Z-300. P90. Q1 F2", 4, 22, Alarm.PASSES, "deeper cut"),
]

# dialect, text, line, column, alarm, words
BAD_IN_DIALECT = [
    ("fanuc", "G76 P010050 Q50 R0.05\n" + GOOD, 3, 5, Alarm.CYCLE, "0, 29, 30, 55, 60, 80"),
    ("fanuc", "G76 P60 Q50 R0.05\n" + GOOD, 3, 5, Alarm.CYCLE, "0 finishing passes"),
    ("gsk988ta", "G76 P60 Q50 R0.05\n" + GOOD, 3, 5, Alarm.CYCLE, "leaves out a part"),
    ("gsk988ta", "G76 P010060 Q2000 R0.05\n" + GOOD, 4, 16, Alarm.CYCLE, "dmin"),
    ("gsk980tdi", "G92 X18. Z-30. F1.5 Q90000", 3, 21, Alarm.ILLEGAL, "means nothing"),
]


def check(error: ProgramError, place: tuple[int, int], alarm: Alarm, words: str) -> None:
    message = str(error)
    assert (error.place.line, error.place.column, error.alarm) == (*place, alarm), message
    assert words in message
    assert message.startswith(f"line {place[0]}, column {place[1]}: alarm")
    assert "\n" not in message
    assert ";" in message, "the mend is missing"


@pytest.mark.parametrize(("text", "line", "column", "alarm", "words"), BAD)
def test_a_bad_program_stops_with_its_alarm(text: str, line: int, column: int, alarm: Alarm, words: str) -> None:
    with pytest.raises(ProgramError) as caught:
        interpret(read_program(text))
    check(caught.value, (line, column), alarm, words)


@pytest.mark.parametrize(("dialect", "text", "line", "column", "alarm", "words"), BAD_IN_DIALECT)
def test_a_dialect_refuses_what_it_does_not_take(dialect: str, text: str, line: int, column: int, alarm: Alarm,
                                                 words: str) -> None:
    with pytest.raises(ProgramError) as caught:
        interpret(read_program(READY + text), Setup(dialect=dialect_named(dialect)))
    check(caught.value, (line, column), alarm, words)


def test_every_alarm_is_met_by_a_bad_program() -> None:
    met = {row[3] for row in BAD} | {row[4] for row in BAD_IN_DIALECT}
    assert met >= set(Alarm) - {Alarm.MOVES}


def test_the_good_program_of_the_table_is_good() -> None:
    assert interpret(read_program(READY + FIRST + GOOD)).passes


def test_a_program_that_only_fills_the_memory_is_stopped() -> None:
    cycle = "G76 X18. Z-30. P90. Q3. F1.5\n"  # 900 passes and more, 4 moves each
    with pytest.raises(ProgramError) as caught:
        interpret(read_program("S500 M3\nG0 X400. Z60.\nG76 P010060 Q0 R0\n" + cycle * 100))
    assert caught.value.alarm is Alarm.MOVES


def test_messages_lead_with_the_file(tmp_path: Path) -> None:
    path = tmp_path / "bad.nc"
    path.write_bytes(b"\xef\xbb\xbfG0 X10.\r\nG0 Y1\r\n")
    with pytest.raises(ProgramError) as caught:
        interpret(read_program_file(path))
    assert str(caught.value).startswith(f"{path}: line 2, column 4: alarm 009")


def test_files_that_are_no_programs(tmp_path: Path) -> None:
    with pytest.raises(CycleError, match="cannot be read"):
        read_program_file(tmp_path / "none.nc")
    with pytest.raises(CycleError, match="cannot be read"):
        read_program_file(tmp_path)
    large = tmp_path / "large.nc"
    large.write_bytes(b"(" + b"x" * (2 << 20) + b")")
    with pytest.raises(CycleError, match="larger than 2 MiB"):
        read_program_file(large)


def test_unknown_dialect_names_the_nearest() -> None:
    with pytest.raises(CycleError, match="did you mean fanuc"):
        dialect_named("fanucc")
    with pytest.raises(CycleError, match="choose one of tomatech"):
        dialect_named("zzz")


@pytest.mark.parametrize("blocks", [[], [""], ["G76 P010060 Q50 R0.05"], ["G0 X5."], ["\n\n"]])
def test_blocks_without_a_thread_are_no_cycle(blocks: list[str]) -> None:
    with pytest.raises(CycleError, match="cut no thread"):
        expand_cycle(blocks)


def test_a_line_of_a_cycle_alone_is_its_block() -> None:
    with pytest.raises(ProgramError, match="line 2, column 20: alarm 006"):
        expand_cycle(["G76 P010060\nQ50 R0.05", "G76 X18. Z-30. P1. Q-3 F2"])
