"""An option that would do nothing is refused before anything is read, in one line that says what it needs."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import Command, assert_one_line
from threadpitch.studies.keeping import DOCUMENT, ROWS

MEASURED = "belongs to measured pitches; give them with --measured FILE, or leave it out"
TOLERANCE = "belongs to the tolerance of a thread; give it with --thread like M20x1.5-6g, or leave it out"
KEPT = "is kept with a run; give --store or --publish too, or leave it out"
FOUND = "is of passes that are found; give --synchronous or --index-enable too, or leave it out"
PROGRAM = "belongs to --program; for a run without one use --set controller.starts=2 and the like"
LOG = "belongs to a log, not to a run; leave it out"
STUDY = "belongs to runs and logs, not to a study; leave it out"


@pytest.mark.parametrize(("command", "option", "value", "why"), [
    ("analyze", "--uncertainty", "1", MEASURED), ("analyze", "--negligible", "1", MEASURED),
    ("analyze", "--ball-screw", "10", MEASURED), ("analyze", "--lead-change", "0.1", MEASURED),
    ("analyze", "--lead-change", "0", MEASURED), ("analyze", "--following-error", "none", MEASURED),
    ("analyze", "--expected-lag", "20", MEASURED), ("analyze", "--limit", "25", TOLERANCE),
    ("analyze", "--engagement", "12", TOLERANCE), ("analyze", "--machine", "Lathe 3", KEPT),
    ("analyze", "--program-name", "O1", KEPT), ("analyze", "--serial", "S-1", KEPT), ("analyze", "--note", "x", KEPT),
    ("watch", "--target", "1.5", FOUND), ("watch", "--thread", "M20", KEPT), ("watch", "--serial", "S-1", KEPT),
    ("run", "--thread", "M20", KEPT), ("run", "--machine", "Lathe 3", KEPT), ("run", "--starts", "1", PROGRAM),
    ("run", "--dialect", "fanuc", PROGRAM), ("run", "--wait", "once", PROGRAM),
    ("run", "--increments", "IS-B", PROGRAM), ("run", "--control", "19.toml", PROGRAM),
    ("report", "--ball-screw", "10", MEASURED), ("report", "--limit", "25", TOLERANCE),
    ("report", "--engagement", "12", TOLERANCE),
])
def test_what_would_do_nothing_is_refused(threadpitch: Command, workplace: Path, command: str, option: str, value: str,
                                          why: str) -> None:
    files = [] if command == "run" else ["no such log.csv"]
    outcome = threadpitch(command, *files, option, value)
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err == f"threadpitch: {option} {why}\n"
    assert list(workplace.iterdir()) == []


@pytest.mark.parametrize("option", ["--angle", "--latency", "--start-angle", "--target", "--counts-per-turn"])
def test_a_report_of_a_run_takes_nothing_of_a_log(threadpitch: Command, workplace: Path, option: str) -> None:
    assert_one_line(threadpitch("report", workplace, option, "1").err, f"{option} {LOG}")


def test_a_report_of_a_study_takes_nothing_of_runs(threadpitch: Command, workplace: Path) -> None:
    (workplace / DOCUMENT).write_text("{}", encoding="utf-8")
    (workplace / ROWS).mkdir()
    for option in ("--measured", "--thread", "--angle", "--pass"):
        assert_one_line(threadpitch("report", workplace, option, "1").err, f"{option} {STUDY}")


def test_with_what_they_need_options_are_taken(threadpitch: Command, workplace: Path) -> None:
    for more in (("--uncertainty", "1", "--measured", "m.csv"), ("--limit", "20", "--thread", "M20x1.5-6g"),
                 ("--serial", "S-1", "--store", "runs.db")):
        assert_one_line(threadpitch("analyze", "no such log.csv", *more).err, "there is no such file")
