"""Measured pitches from CSV: columns by their names, units from the header, faults with file and line."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from threadpitch.judgement import JudgementError
from threadpitch.judgement.measured_file import read_measured
from threadpitch.trace import TraceError


def written(folder: Path, text: str) -> Path:
    path = folder / "measured.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_every_column_is_read_in_its_unit(tmp_path: Path) -> None:
    one, = read_measured(written(tmp_path, "turn,z_mm,pitch_um,uncertainty_um,flank,start_angle_deg\n"
                                           "1,-2.25,1500.5,0.5,left,90\n2,-3.75,,0.7,left,90\n"))
    np.testing.assert_allclose(one.pitch, [1.5005e-3, math.nan], rtol=1e-12)
    assert one.turn is not None
    assert one.position is not None
    assert one.uncertainty is not None
    np.testing.assert_allclose(one.turn, [1.0, 2.0])
    np.testing.assert_allclose(one.position, [-2.25e-3, -3.75e-3], rtol=1e-12)
    np.testing.assert_allclose(one.uncertainty, [0.5e-6, 0.7e-6], rtol=1e-12)
    assert one.start_angle == pytest.approx(0.5 * math.pi)
    assert (one.flank, one.source) == ("left", str(tmp_path / "measured.csv"))


def test_the_pitch_alone_is_enough_and_is_mm(tmp_path: Path) -> None:
    one, = read_measured(written(tmp_path, "Pitch;remark\n1.5;good\n-;not seen\n"))
    np.testing.assert_allclose(one.pitch, [1.5e-3, math.nan])
    assert [one.turn, one.position, one.uncertainty, one.start_angle] == [None] * 4


def test_a_decimal_comma_is_read_where_it_separates_nothing(tmp_path: Path) -> None:
    one, = read_measured(written(tmp_path, "turn;pitch_mm\n1;1,5\n2;1,501\n"))
    np.testing.assert_allclose(one.pitch, [1.5e-3, 1.501e-3])


def test_units_may_stand_in_brackets(tmp_path: Path) -> None:
    one, = read_measured(written(tmp_path, "n,Pitch [um]\n1,1500\n"))
    assert one.pitch[0] == pytest.approx(1.5e-3)


def test_flanks_and_start_angles_are_threads_of_their_own(tmp_path: Path) -> None:
    found = read_measured(written(tmp_path, "turn,pitch_mm,flank,start_angle_deg\n1,1.5,left,0\n1,1.6,right,0\n"
                                            "2,1.7,left,0\n1,1.8,left,90\n"))
    assert [(one.flank, one.start_angle) for one in found] == [("left", 0.0), ("right", 0.0),
                                                               ("left", pytest.approx(0.5 * math.pi))]
    np.testing.assert_allclose(found[0].pitch, [1.5e-3, 1.7e-3])


@pytest.mark.parametrize(("text", "message"), [
    ("turn,width\n1,2\n", r"measured.csv:1: there is no column of pitches among 'turn', 'width'; call it pitch_mm"),
    ("pitch_mm,pitch_um\n1,2\n", r":1: columns 'pitch_mm' and 'pitch_um' both give the pitch"),
    ("turn,pitch_deg\n1,2\n", r":1: 'deg' is no unit of the pitch; write it like pitch_mm"),
    ("turn,pitch_mm\n1,abc\n", r":2: column 'pitch_mm' holds 'abc', not a number; mend this row"),
    ("turn,pitch_mm\n1,1.5\n,1.5\n", r":3: column 'turn' is empty; only pitches may be missing"),
    ("turn,pitch_mm\n1,inf\n", r":2: column 'pitch_mm' holds 'inf'"),
    ("turn,pitch_mm\n", r"measured.csv: there are no rows below the header"),
])
def test_faults_are_named_with_their_place(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(JudgementError, match=message) as caught:
        read_measured(written(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read_are_refused_as_logs_are(tmp_path: Path) -> None:
    with pytest.raises(TraceError, match="there is no such file"):
        read_measured(tmp_path / "none.csv")
