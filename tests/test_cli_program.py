"""``threadpitch run --program``: every pass of a program is cut, numbered and named as the words have it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.conftest import Command, assert_one_line
from threadpitch.run_folder import FILES

PROGRAMS = Path(__file__).parents[1] / "models" / "programs"
# two threads, so that there are two operations; the first G76 has two starts
TWO_THREADS = """G97 S600 M3
G0 X26. Z5.
G76 P011060 Q100 R0.05
G76 X18.16 Z-6. P920 Q700 F3.
G0 X24. Z5.
X18.2
G32 Z-6. F1.5
G0 X24.
M30
"""


def test_passes_of_a_program_are_reported_one_by_one(threadpitch: Command, workplace: Path) -> None:
    (workplace / "two.nc").write_text(TWO_THREADS, encoding="utf-8")
    done = threadpitch("run", "--program", "two.nc", "--starts", "2", "--json")
    assert done.status == 0
    document = json.loads(done.out)
    assert document["operations"] == 2
    planned = json.loads(threadpitch("cycle", "--program", "two.nc", "--starts", "2", "--json").out)["passes"]
    assert [one["pass"] for one in document["passes"]] == [one["number"] for one in planned]
    assert [one["kind"] for one in document["passes"][:-1]] == [one["kind"] for one in planned[:-1]]
    for one, words in zip(document["passes"][:-1], planned, strict=False):
        assert one["depth_mm"] == pytest.approx(words["depth_mm"], abs=1e-9)
    assert [one["start_number"] for one in document["passes"]] == [1, 1, 1, 2, 2, 2, 1]
    assert [one["lead_mm"] for one in document["passes"]] == pytest.approx([3.0] * 6 + [1.5])
    assert [one["groove_pitch_mm"] for one in document["passes"]] == pytest.approx([1.5] * 7)
    assert [one["pass"] for one in document["passes"] if one["final_flank"]] == [3, 6, 7]
    for name in ("operation-1", "operation-2"):
        assert {path.name for path in (workplace / "threadpitch-run" / name).iterdir()} == set(FILES)


def test_one_operation_lies_in_the_folder_itself_and_set_wins(threadpitch: Command, workplace: Path) -> None:
    done = threadpitch("run", "--program", PROGRAMS / "m20x1.5_g32.nc", "--set", "controller.z_end=-8mm")
    assert done.status == 0
    assert "the final flank" in done.out
    assert {path.name for path in (workplace / "threadpitch-run").iterdir()} == set(FILES)
    rows = (workplace / "threadpitch-run" / "pitch.csv").read_text(encoding="utf-8").splitlines()
    turns = max(int(row.split(",")[4]) for row in rows[1:])
    assert 8 <= turns <= 9  # 14 mm of lead 1.5 mm


def test_more_than_the_axis_does_is_warned_of(threadpitch: Command, workplace: Path) -> None:
    done = threadpitch("run", "--stop-time", "1.3", "--set", "z_drive.speed_limit=10mm/s", "--json")
    assert done.status == 0
    assert_one_line(done.err, r"warning: 1.5 mm a turn at 500 rpm is more than the Z axis does; turn at most 400 rpm")


def test_an_alarm_is_told_beside_what_was_cut_and_in_the_document(threadpitch: Command, workplace: Path) -> None:
    """The spindle gives way in the first cut: its turns are reported, and why there are no more."""
    (workplace / "p.nc").write_text("G97 S600 M3\nG0 X26. Z5.\nG92 X18. Z-20. F1.5\nX18.\nM30\n", encoding="utf-8")
    (workplace / "control.toml").write_text('"106" = 5\n"253" = 2\n', encoding="utf-8")
    done = threadpitch("run", "--program", "p.nc", "--control", "control.toml", "--set", "spindle.torque_limit=9",
                       "spindle.initial_speed=600rpm", "--json")
    assert done.status == 0
    document = json.loads(done.out)
    assert len(document["passes"]) == 1
    assert "parameter 106" in document["alarm"]
    assert_one_line(done.err, r"warning: alarm 1 at [\d.]+ s: the spindle's speed varied")


def test_why_no_turn_names_the_alarm(threadpitch: Command, workplace: Path) -> None:
    done = threadpitch("run", "--set", "controller.commanded_speed=9000rpm", "controller.longest_wait=0.4",
                       "--stop-time", "1", "--record", "spindle.speed")
    assert (done.status, done.out) == (2, "")
    assert_one_line(done.err, r"no threading until the stop at 1 s; alarm 4 at 0\.4\d* s: the spindle does not reach")


def test_the_control_s_parameters_act_and_are_kept(threadpitch: Command, workplace: Path) -> None:
    """G76 rewrites 057 to 060 and 019; IS-C makes P9200 0.92 mm; M4 makes the thread left-handed."""
    (workplace / "p.nc").write_text("G97 S600 M4\nG0 X26. Z5.\nG76 P011055 Q1000 R0.05\nG76 X18.16 Z-3. P9200 Q8000 "
                                    "F1.5\nM30\n", encoding="utf-8")
    done = threadpitch("run", "--program", "p.nc", "--control", "control.toml", "--increments", "IS-C", "--json")
    assert done.status == 0
    kept = (workplace / "control.toml").read_text(encoding="utf-8")
    assert '"058" = 55' in kept
    assert '"059" = 100' in kept
    document = json.loads(done.out)
    assert [one["depth_mm"] for one in document["passes"]] == pytest.approx([0.8, 0.87, 0.92])
    assert {one["hand"] for one in document["passes"]} == {"left"}
    assert document["alarm"] is None


def test_passes_that_the_stop_time_leaves_out_are_told(threadpitch: Command, workplace: Path) -> None:
    (workplace / "two.nc").write_text(TWO_THREADS.split("X18.2")[0] + "M30\n", encoding="utf-8")
    done = threadpitch("run", "--program", "two.nc", "--stop-time", "1.3", "--json")
    assert done.status == 0
    assert_one_line(done.err, r"warning: [12] of 3 passes were begun until the stop; choose a longer --stop-time")


def test_a_lead_along_x_is_noted(threadpitch: Command, workplace: Path) -> None:
    (workplace / "p.nc").write_text("G97 S300 M3\nG0 X60. Z2.\nZ-0.5\nG32 X40. F2.\nG0 Z2.\nX60.\nM30\n",
                                    encoding="utf-8")
    done = threadpitch("run", "--program", "p.nc", "--json")
    assert done.status == 0
    assert_one_line(done.err, "note: pass 1 has its lead along X")
    assert json.loads(done.out)["passes"][0]["hand"] is None


def test_a_feed_hold_is_named_where_no_turn_is_cut(threadpitch: Command, workplace: Path) -> None:
    done = threadpitch("run", "--set", "controller.feed_hold=true", "--stop-time", "0.5")
    assert (done.status, done.out) == (2, "")
    assert_one_line(done.err, "the feed is held; release controller.feed_hold")


def test_the_largest_lead_of_a_program_is_compared_with_the_axis(threadpitch: Command, workplace: Path) -> None:
    """The lead grows to 4.24 mm: 3 mm a turn the axis would do."""
    (workplace / "p.nc").write_text("G97 S600 M3\nG0 X26. Z2.\nX19.\nG34 Z-7. F3. R0.5\nG0 X26.\nM30\n",
                                    encoding="utf-8")
    done = threadpitch("run", "--program", "p.nc", "--set", "z_drive.speed_limit=40mm/s", "--json")
    assert done.status == 0
    assert_one_line(done.err, r"warning: 4\.24264 mm a turn at 600 rpm is more than the Z axis does; turn at most "
                    "566 rpm")


def test_a_thread_of_variable_lead_has_a_verdict(threadpitch: Command, workplace: Path) -> None:
    """P_target(n) = lead + change (n - 1/2 + o); the feed lags by 1 / Kv: P(n) - P_target(n) = -change rps / Kv."""
    (workplace / "p.nc").write_text("G97 S300 M3\nG0 X26. Z8.\nX19.4\nG34 Z-30. F2. R0.1\nG0 X26.\nM30\n",
                                    encoding="utf-8")
    shaking = "spindle.ripple_amplitude[1]=0"
    done = threadpitch("run", "--program", "p.nc", "--set", shaking, "--json")
    assert done.status == 0, done.err
    document = json.loads(done.out)
    (verdict,) = document["verdicts"]
    assert verdict["cause"] in {"control", "both"}
    steady = -100.0 * 5.0 / 50.0  # um
    for one in verdict["control"]["start_angles"]:
        assert one["deviation_um"][-1] == pytest.approx(steady, abs=0.5)
        assert one["lag_ms"] == pytest.approx(20.0, rel=0.05)
    done = threadpitch("run", "--program", "p.nc", "--set", shaking, "z_drive.feedforward=1", "z_drive.lead_slope=0",
                       "z_drive.lead_amplitude=0", "--json")
    (verdict,) = json.loads(done.out)["verdicts"]
    assert verdict["evidence"]["fluctuation_um"] < 2.0  # of leads from 2.3 to 3.4 mm


@pytest.mark.parametrize(("text", "options", "message"), [
    ("G0 X1 Z1\nM30\n", (), "the program cuts no thread"),
    ("G97 S600 M3\nG0 X24. Z5.\nG32 Z-6.\nM30\n", (), r"p\.nc: line 3, column \d+: alarm"),
    (TWO_THREADS, ("--results", "a.csv"), "leave them out"),
    (TWO_THREADS, ("--dialect", "fanuk"), "did you mean fanuc"),
    (TWO_THREADS, ("--increments", "D"), "choose IS-B or IS-C"),
    (TWO_THREADS, ("--control", "."), "no parameter file"),
    (TWO_THREADS, ("--wait", "never"), "choose once or every-block"),
])
def test_bad_programs_are_one_line(
        text: str, options: tuple[str, ...], message: str, threadpitch: Command, workplace: Path) -> None:
    (workplace / "p.nc").write_text(text, encoding="utf-8")
    done = threadpitch("run", "--program", "p.nc", *options)
    assert (done.status, done.out) == (2, "")
    assert_one_line(done.err, message)
    assert not (workplace / "threadpitch-run").exists()
