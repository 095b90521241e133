"""Parameters from files and from assignments: equal content, equal values; what is wrong is named."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from threadpitch import cosim, lathe
from threadpitch.parameters import ParameterFileError, read_assignments, read_parameters

SSV = """<?xml version="1.0" encoding="UTF-8"?>
<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
                  xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="test">
  <ssv:Parameters>{parameters}</ssv:Parameters>
  <ssv:Units>{units}</ssv:Units>
</ssv:ParameterSet>
"""
SCREW = '<ssv:Parameter name="z_drive.screw_lead"><ssv:Real value="{value}"{unit}/></ssv:Parameter>'
WritePath = Callable[[str, str], Path]


@pytest.fixture
def write(tmp_path: Path) -> WritePath:
    def written(name: str, text: str) -> Path:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return written


def ssv(parameters: str, units: str = "") -> str:
    return SSV.format(parameters=parameters, units=units or '<ssc:Unit name="s"><ssc:BaseUnit s="1"/></ssc:Unit>')


def test_tables_and_dotted_names_say_the_same(write: WritePath) -> None:
    expected = {"z_drive.screw_lead": "10mm", "z_drive.position_gain": 40, "z_drive.table_mass": 2.5e2,
                "nominal_pitch.use_threading_start": True, "nominal_pitch.start_angle": [0.0, "90deg"]}
    nested = """
    [z_drive]
    screw_lead = "10mm"
    position_gain = 40
    table_mass = 2.5e2
    [nominal_pitch]
    use_threading_start = true
    start_angle = [0.0, "90deg"]
    """
    assert read_parameters(write("nested.toml", nested)) == expected
    assert read_parameters(write("dotted.toml", '"z_drive.screw_lead" = "10mm"\n')) == {"z_drive.screw_lead": "10mm"}
    assert read_parameters(write("flat.json", json.dumps(expected))) == expected
    assert read_parameters(write("EMPTY.JSON", "{}")) == {}
    table = {"z_drive": {"screw_lead": "10mm", "position_gain": 40, "table_mass": 250.0},
             "nominal_pitch": {"use_threading_start": True, "start_angle": [0.0, "90deg"]}}
    assert read_parameters(write("nested.json", json.dumps(table))) == expected


def test_numbers_of_an_ssv_keep_their_units(write: WritePath) -> None:
    entries = (SCREW.format(value="10.0", unit=' unit="mm"')
               + '<ssv:Parameter name="z_drive.table_mass"><ssv:Real value="250.0"/></ssv:Parameter>'
               + '<ssv:Parameter name="spindle.encoder_lines"><ssv:Integer value="1024"/></ssv:Parameter>'
               + '<ssv:Parameter name="nominal_pitch.use_threading_start"><ssv:Boolean value="true"/></ssv:Parameter>')
    values = read_parameters(write("set.ssv", ssv(entries)))
    assert values == {"z_drive.screw_lead": "10.0 mm", "z_drive.table_mass": 250.0, "spindle.encoder_lines": 1024,
                      "nominal_pitch.use_threading_start": True}
    assert values["nominal_pitch.use_threading_start"] is True


@pytest.mark.parametrize(("base", "factor", "expected"), [
    ('m="1" factor="0.2"', "thumb", "0.4 m"),
    ('m="1" factor="1.0"', "mm", "2.0 m"),  # the file's own definition holds, whatever the name says elsewhere
    ('K="1" offset="250.0"', "cool", "252.0 K"),
])
def test_a_unit_that_the_file_defines_holds(write: WritePath, base: str, factor: str, expected: str) -> None:
    units = f'<ssc:Unit name="{factor}"><ssc:BaseUnit {base}/></ssc:Unit>'
    path = write("set.ssv", ssv(SCREW.format(value="2.0", unit=f' unit="{factor}"'), units))
    assert read_parameters(path) == {"z_drive.screw_lead": expected}


def test_the_lathe_s_own_parameters_as_a_file_change_nothing(short_run: lathe.Simulation) -> None:
    values = read_parameters(lathe.shipped("models") / "threading_lathe" / "resources" / "lathe.ssv")
    assert len(values) > 15
    again = lathe.simulate(parameters=values, stop_time=0.7)
    for name in ("nominal_pitch.pitch[1]", "z_drive.position", "spindle.angle"):
        np.testing.assert_array_equal(again[name], short_run[name][: again.steps + 1])


@pytest.mark.parametrize(("name", "text", "message"), [
    ("broken.toml", "x = ?\n", r"broken\.toml: is not TOML: .*line 1"),
    ("digits.toml", "x = 1" + "0" * 5000, r"digits\.toml: is not TOML: "),
    ("deep.toml", "x = " + "[" * 20000, r"deep\.toml: is not TOML: "),
    ("date.toml", "[z_drive]\nscrew_lead = 2020-01-01", r"date\.toml: z_drive\.screw_lead: .*2020.* is not a number"),
    ("broken.json", '{"x": ', r"broken\.json: is not JSON: .*line 1"),
    ("digits.json", '{"x.y": 1' + "0" * 5000 + "}", r"digits\.json: is not JSON: "),
    ("long.json", '{"x.y": 1' + "0" * 400 + "}", r"long\.json: x\.y: 1000\d+\.\.\.\d+0 is not a number"),
    ("deep.json", '{"x":' * 20000, r"deep\.json: is not JSON: "),
    ("list.json", "[1]", r'list\.json: holds no object; write \{"z_drive": '),
    ("null.json", '{"z_drive": {"screw_lead": null}}', r"null\.json: z_drive\.screw_lead: None is not a number"),
    ("mixed.json", '{"z_drive.x": [1, [2]]}', r"mixed\.json: z_drive\.x: \[1, \[2\]\] is not a number"),
    ("twice.json", '{"x": {"y": 1, "y": 2}}', r"twice\.json: 'y' stands twice; keep one of them"),
    ("both.json", '{"x": {"y": 1}, "x.y": 2}', r"both\.json: 'x\.y' stands twice; keep one of them"),
    ("both.toml", 'x.y = 1\n"x.y" = 2\n', r"both\.toml: 'x\.y' stands twice; keep one of them"),
    ("twice.ssv", ssv('<ssv:Parameter name="a.b"><ssv:Real value="1"/></ssv:Parameter>' * 2),
     r"twice\.ssv: 'a\.b' stands twice; keep one of them"),
    ("tables.toml", "x." * 3000 + "y = 1", r"tables\.toml: x\.x\.x\..* has more than 20 tables within tables; write"),
    ("notes.txt", "x", r"notes\.txt: is not a parameter file; give an \.ssv, \.toml or \.json"),
])
def test_files_that_hold_no_parameters(write: WritePath, name: str, text: str, message: str) -> None:
    with pytest.raises(ParameterFileError, match=message) as caught:
        read_parameters(write(name, text))
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize(("name", "text"), [("a.json", '{"x.y": 1}'), ("a.toml", "x.y = 1")])
def test_files_of_windows_may_begin_with_a_mark(write: WritePath, name: str, text: str) -> None:
    assert read_parameters(write(name, "\ufeff" + text)) == {"x.y": 1}


@pytest.mark.parametrize(("text", "message"), [
    ("<x", r"set\.ssv: line 1: is not XML"),
    ("<x/>", r"set\.ssv: holds <x>, not a ParameterSet of SSP"),
    (ssv('<ssv:Parameter name="a.b"><ssv:Real/></ssv:Parameter>'), r"set\.ssv.*value"),
])
def test_broken_parameter_sets(write: WritePath, text: str, message: str) -> None:
    with pytest.raises(cosim.SystemStructureError, match=message):
        read_parameters(write("set.ssv", text))


def test_files_that_are_not_there(tmp_path: Path) -> None:
    with pytest.raises(ParameterFileError, match=r"nosuch\.toml: no such file; give an \.ssv, \.toml or \.json"):
        read_parameters(tmp_path / "nosuch.toml")
    (tmp_path / "folder.json").mkdir()
    with pytest.raises(ParameterFileError, match=r"folder\.json: is a folder; give an"):
        read_parameters(tmp_path / "folder.json")
    (tmp_path / "latin.toml").write_bytes('x = "°"'.encode("latin-1"))
    with pytest.raises(ParameterFileError, match=r"latin\.toml: is not TOML: .*utf-8"):
        read_parameters(tmp_path / "latin.toml")


@given(name=st.from_regex(r"[a-z_]+\.[a-z_]+(\[[1-9]\])?", fullmatch=True),
       value=st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1))
@settings(deadline=None)
def test_assignments_part_at_the_first_sign(name: str, value: str) -> None:
    assert read_assignments([f" {name} = {value} "]) == {name: value}


def test_of_equal_assignments_the_last_one_holds() -> None:
    assert read_assignments(["a.b=1", "a.c=x=y", "a.b=2mm"]) == {"a.b": "2mm", "a.c": "x=y"}


@pytest.mark.parametrize("assignment", ["", "z_drive", "z_drive.screw_lead", "=3", " =3",
                                        "z_drive.screw_lead=", "z_drive.screw_lead= "])
def test_assignments_that_set_nothing(assignment: str) -> None:
    with pytest.raises(ParameterFileError, match=r"sets nothing; write it like z_drive\.screw_lead=10mm"):
        read_assignments([assignment])


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_values_that_are_not_finite_are_refused_with_their_names(write: WritePath, value: float) -> None:
    path = write("values.json", json.dumps({"z_drive": {"screw_lead": value}}))
    with pytest.raises(cosim.SystemStructureError, match=r"z_drive\.screw_lead: (nan|inf) is not a finite number"):
        lathe.simulate(parameters=read_parameters(path))
