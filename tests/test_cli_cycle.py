"""``threadpitch cycle``: passes as a table, as JSON, as moves and drawn; the control's parameters kept in a file."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.conftest import Command, assert_one_line

M68X6 = ("G76 P020560 Q0.150 R0.1", "G76 X60.64 Z-62 P3.68 Q1.8 F6")
PROGRAMS = Path(__file__).parents[1] / "models" / "programs"


def test_the_table_of_the_manual_s_example(threadpitch: Command) -> None:
    done = threadpitch("cycle", *M68X6, "--at", "80,10")
    assert (done.status, done.err) == (0, "")
    rows = [[cell.strip() for cell in line.strip("|").split("|")]
            for line in done.out.splitlines() if line[2:6].strip().isdigit()]
    assert [row[2] for row in rows] == ["1.8000", "2.5456", "3.1177", "3.5800", "3.6300", "3.6800"]
    assert {row[6] for row in rows} == {"-62.0000"}
    assert done.out.endswith("Pass 6 makes the final flank.\n")
    assert max(map(len, done.out.splitlines())) <= 80


def test_json_has_passes_and_parameters(threadpitch: Command) -> None:
    done = threadpitch("cycle", *M68X6, "--at", "80,10", "--starts", "2", "--json")
    document = json.loads(done.out)
    assert list(document) == ["passes", "parameters"]
    assert [one["start_angle_deg"] for one in document["passes"]] == [0.0] * 6 + [180.0] * 6
    assert document["parameters"]["059"] == 150


@pytest.mark.parametrize(("dialect", "depths"), [
    ("tomatech", [0.4, 0.565685425, 0.692820323, 0.8, 0.894427191, 0.979795897, 1.059795897, 1.138300524, 1.199]),
    ("gsk980tdi", [0.4, 0.565685425, 0.692820323, 0.8, 0.894427191, 0.979795897, 1.059795897, 1.139795897, 1.199]),
])
def test_dialects_differ_in_what_follows_a_clamped_cut(
        dialect: str, depths: list[float], threadpitch: Command) -> None:
    done = threadpitch("cycle", "G76 P010060 Q80 R0.1", "G76 X17. Z-30. P1299 Q400 F1.5", "--at", "22,5",
                       "--dialect", dialect, "--json")
    passes = json.loads(done.out)["passes"]
    assert [one["depth_mm"] for one in passes if one["kind"] == "rough"] == depths


def test_the_parameter_file_is_rewritten_and_read_by_the_next_run(threadpitch: Command, tmp_path: Path) -> None:
    kept = tmp_path / "control.toml"
    threadpitch("cycle", *M68X6, "--at", "80,10", "--parameters", kept)
    assert tomllib.loads(kept.read_text(encoding="utf-8"))["059"] == 150
    # without its first block the cycle takes what the former run left
    done = threadpitch("cycle", M68X6[1], "--at", "80,10", "--parameters", kept, "--json")
    assert [one["depth_mm"] for one in json.loads(done.out)["passes"]][-2:] == [3.63, 3.68]


def test_a_bad_program_leaves_the_parameter_file_alone(threadpitch: Command, tmp_path: Path) -> None:
    kept = tmp_path / "control.toml"
    threadpitch("cycle", *M68X6, "--at", "80,10", "--parameters", kept)
    before = kept.read_bytes()
    done = threadpitch("cycle", "G76 P030580 Q0.2 R0.2", "G76 X60.64 Z-62 Q1.8 F6", "--at", "80,10",
                       "--parameters", kept)
    assert done.status == 2
    assert_one_line(done.err, r"line 2, column 1: alarm 062")
    assert kept.read_bytes() == before


def test_a_program_and_its_moves(threadpitch: Command) -> None:
    done = threadpitch("cycle", "--program", PROGRAMS / "special_groove_g32.nc", "--wait", "every-block", "--moves")
    assert done.status == 0
    assert [line.split("angle ")[1].split()[0] for line in done.out.splitlines() if "thread" in line] == [
        "0.000", "270.000", "90.000", "180.000"]


def test_a_pass_that_no_axis_can_follow_is_warned_of(threadpitch: Command) -> None:
    done = threadpitch("cycle", *M68X6, "--at", "80,10", "--speed", "6000")
    assert done.status == 0
    assert_one_line(done.err, r"warning: pass 1 needs 36 m/min of an axis that does 30; turn at most 5000 rpm")
    slow = threadpitch("cycle", *M68X6, "--at", "80,10", "--speed", "5000")
    assert slow.err == ""
    surface = threadpitch("cycle", "G96 S500 M3", "G0 X80 Z10", *M68X6)  # 500 m/min at X60.64: 2624 rpm
    assert "turn at most" not in surface.err
    assert "turn at most 5000 rpm" in threadpitch("cycle", "G96 S1000 M3", "G0 X80 Z10", *M68X6).err


@pytest.mark.parametrize("suffix", ["svg", "png", "pdf"])
def test_the_drawing_is_written_and_reproducible(suffix: str, threadpitch: Command, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    first, second = tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}"
    for path in (first, second):
        assert threadpitch("cycle", *M68X6, "--at", "80,10", "--plot", path).status == 0
    signature = {"svg": b"<?xml", "png": b"\x89PNG", "pdf": b"%PDF"}[suffix]
    assert first.read_bytes().startswith(signature)
    assert first.read_bytes() == second.read_bytes()
    groove = threadpitch("cycle", "--program", PROGRAMS / "special_groove_g32.nc", "--wait", "every-block", "--plot",
                         first)
    assert groove.status == 0
    assert first.read_bytes() != second.read_bytes()
    if suffix == "svg":
        assert "<!-- Groove of pass 1, block by block -->" in first.read_text(encoding="utf-8")
        first = second
        text = first.read_text(encoding="utf-8")
        assert "Infeed, pass by pass" in text or "<!-- Infeed, pass by pass -->" in text


@pytest.mark.parametrize(("arguments", "message"), [
    ((), "give either the blocks of a cycle, each in quotes, or --program FILE"),
    ((*M68X6, "--program", "x.nc"), "give either the blocks"),
    (("G76 P020560 Q0.15",), "the blocks cut no thread"),
    ((*M68X6, "--at", "80"), r"the start point '80' is not X,Z"),
    ((*M68X6, "--dialect", "fanuk"), "did you mean fanuc"),
    ((*M68X6, "--increments", "IS-D"), "increment system 'IS-D' is not known"),
    ((*M68X6, "--wait", "never"), "choose once or every-block"),
    ((*M68X6, "--speed", "0"), "0 rpm cuts no thread"),
    ((*M68X6, "--plot", "a.doc"), r"a figure can be \.svg"),
    ((*M68X6, "--plot", "nowhere/a.svg"), "there is no such folder"),
    (("--program", "missing.nc"), "missing.nc"),
])
def test_bad_input_is_one_line(
        arguments: tuple[str, ...], message: str, threadpitch: Command, workplace: Path) -> None:
    done = threadpitch("cycle", *arguments)
    assert (done.status, done.out) == (2, "")
    assert_one_line(done.err, message)
    assert list(workplace.iterdir()) == []


def test_without_matplotlib_the_extra_is_named(tmp_path: Path) -> None:
    script = ("import importlib.util, sys\nfind = importlib.util.find_spec\n"
              "importlib.util.find_spec = lambda name, *a: None if name == 'matplotlib' else find(name, *a)\n"
              "from threadpitch.cli import invoke\nsys.exit(invoke(sys.argv[1:]))")
    done = subprocess.run([sys.executable, "-c", script, "cycle", *M68X6, "--at", "80,10", "--plot", "a.svg"],
                          cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert_one_line(done.stderr, r"pip install 'threadpitch\[plot\]'")
