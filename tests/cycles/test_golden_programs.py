"""Whole programs against golden text: canonical moves, kinds of the passes, rewritten parameters, notes.

``python -m tests.cycles.golden_programs`` writes the text anew; read the difference before you keep it.
"""

from __future__ import annotations

import csv
import gzip
from itertools import groupby
from pathlib import Path

import pytest

from tests.cycles.golden_programs import EXAMPLES, GOLDEN, PROGRAMS, golden_text, run
from threadpitch.cycles import Program, ProgramError, final_flank, interpret, read_program_file
from threadpitch.cycles.moves import Rapid, Thread

LOGS = EXAMPLES.parent / "logs" / "linuxcnc"


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_moves_are_those_of_the_golden_text(path: Path) -> None:
    assert golden_text(path) == (GOLDEN / f"{path.stem}.txt").read_text(encoding="utf-8")


def test_there_are_programs_enough_and_no_text_without_one() -> None:
    assert len(PROGRAMS) >= 12
    assert {path.stem for path in PROGRAMS} == {path.stem for path in GOLDEN.glob("*.txt")}


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_each_threading_block_begins_where_the_move_before_it_ended(path: Path) -> None:
    place = None
    for move in run(path).moves:
        if isinstance(move, Thread):
            assert place == (move.path.start.x, move.path.start.z)
            place = (move.path.leaves_at.x, move.path.leaves_at.z)
        elif isinstance(move, Rapid):
            place = (move.x, move.z)
        elif hasattr(move, "end"):
            place = (move.end.x, move.end.z)


def test_linuxcnc_cut_its_g76_at_the_same_depths() -> None:
    """The log of LinuxCNC's own G76: X of every pass, 23 of them, to its planner's tenth of a micrometre."""
    with gzip.open(LOGS / "I_g76_ripple_400.csv.gz", "rt", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["pass"] != "0"]
    logged = [min(float(row["x_mm"]) for row in cut) for _, cut in groupby(rows, key=lambda row: row["pass"])]
    ours = [cut.end.x * 1e3 for cut in run(EXAMPLES / "linuxcnc_g76.nc").passes]
    assert len(logged) == 23
    assert ours == pytest.approx(logged, abs=1e-4)


@pytest.mark.parametrize("name", ["g33_500", "g33_2start", "g76"])
def test_linuxcnc_words_that_are_not_shared_are_refused_at_their_place(name: str) -> None:
    with pytest.raises(ProgramError, match=r"line 2, column \d+: alarm 010"):
        interpret(read_program_file(LOGS / f"{name}.ngc"))


def test_the_last_cut_of_each_groove_leaves_its_flank() -> None:
    assert final_flank(run(EXAMPLES / "m20x1.5_g92.nc").passes) == (7,)
    assert final_flank(run(EXAMPLES / "two_start_g32.nc").passes) == (1, 2)
    assert final_flank(run(EXAMPLES / "linuxcnc_g76.nc").passes) == (22,)
    assert final_flank(run(GOLDEN / "is_c_run_out_g76.nc").passes) == (5, 10)


def test_a_program_without_blocks_makes_no_moves() -> None:
    assert interpret(Program(())).moves == ()
