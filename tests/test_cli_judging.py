"""``threadpitch analyze --measured --thread``: the verdict as text and as JSON, and what is missing in one line."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import Command, assert_one_line

COLUMNS = ("--angle", "angle", "--position", "z")
TURNS = 30


@pytest.fixture
def log(workplace: Path) -> Path:
    """A feed that leaves 10 um around turn 12, and 0.2 um of nothing."""
    angle = np.linspace(0.0, TURNS, 60 * TURNS + 1)
    movement = 1.5 * angle + 0.01 / (1.0 + np.exp(-(angle - 11.5) / 1.5))
    rows = "\n".join(f"{a:.9f},{z:.9f}" for a, z in zip(angle, movement, strict=True))
    path = workplace / "log.csv"
    path.write_text(f"angle,z\n{rows}\n", encoding="utf-8")
    return path


@pytest.fixture
def measured(workplace: Path) -> Path:
    draw = np.random.default_rng(1)
    ends = np.arange(TURNS + 1.0)
    grooves = 1.5 * ends + 0.01 / (1.0 + np.exp(-(ends - 11.5) / 1.5)) + 0.0003 * draw.normal(size=TURNS + 1)
    wave = 0.006 * np.sin(2.0 * math.pi * 0.15 * np.arange(TURNS))
    rows = "\n".join(f"{n + 1},{p:.7f},0.5" for n, p in enumerate(np.diff(grooves) + wave))
    path = workplace / "measured.csv"
    path.write_text(f"turn,pitch_mm,uncertainty_um\n{rows}\n", encoding="utf-8")
    return path


def test_the_verdict_is_printed(threadpitch: Command, log: Path, measured: Path) -> None:
    outcome = threadpitch("analyze", log, *COLUMNS, "--measured", measured, "--thread", "M20x1.5-6g",
                          "--ball-screw", 10)
    assert (outcome.status, outcome.err) == (0, "")
    text = " ".join(outcome.out.split())
    assert "Verdict on the measured pitches, against group 1" in text
    assert "Both: " in text
    assert "once per screw turn, amplitude" in text
    assert "Error within the turn that repeats: not observable from P(n)" in text
    assert "Tolerance, measured pitches" in text
    assert "of the pitch-diameter tolerance of 140 um" in text


def test_the_verdict_is_in_the_document(threadpitch: Command, log: Path, measured: Path) -> None:
    outcome = threadpitch("analyze", log, *COLUMNS, "--measured", measured, "--target", 1.5, "--json")
    document = json.loads(outcome.out)
    assert set(document) == {"groups", "verdict"}
    assert document["verdict"]["cause"] == "both"
    assert document["verdict"]["evidence"]["turns"] == TURNS
    assert document["verdict"]["evidence"]["uncertainty_um"] == pytest.approx(0.5)


def test_the_nominal_pitches_have_their_tolerance_too(threadpitch: Command, log: Path) -> None:
    outcome = threadpitch("analyze", log, *COLUMNS, "--thread", "M20x1.5-6g", "--limit", 10, "--start-angle", 0, 90,
                          "--json")
    tolerances = json.loads(outcome.out)["tolerance"]
    assert [one["of"] for one in tolerances] == ["nominal pitches of group 1, start angle 0 deg",
                                                 "nominal pitches of group 1, start angle 90 deg"]
    assert tolerances[0]["limit_um"] == pytest.approx(8.083, abs=1e-3)
    assert tolerances[0]["verdict"] == "not conform"
    assert tolerances[0]["cumulative_um"] == pytest.approx(9.3, abs=0.5)


@pytest.mark.parametrize(("options", "text"), [
    (("--measured", "measured.csv"), "give --target in mm, or --thread like M20x1.5-6g"),
    (("--thread", "Whitworth"), "no thread designation"),
    (("--thread", "M20x3(P1.5)-6g", "--target", "1.5"),
     r"the target is 1.5 mm and the lead of M20x3\(P1.5\)-6g is 3 mm"),
    (("--measured", "none.csv", "--target", "1.5"), "there is no such file"),
    (("--measured", "measured.csv", "--target", "-1.5"), "give a positive"),
    (("--thread", "M20x1.5-6g", "--limit", "0"), "--limit is .* %; give a share of the tolerance above 0"),
])
def test_what_is_missing_is_said_in_one_line(threadpitch: Command, log: Path, measured: Path,
                                             options: tuple[str, ...], text: str) -> None:
    assert measured.is_file()
    outcome = threadpitch("analyze", log, *COLUMNS, *options)
    assert (outcome.status, outcome.out) == (2, "")
    assert_one_line(outcome.err, text)


def test_a_lead_that_changes_is_judged_turn_by_turn(threadpitch: Command, workplace: Path) -> None:
    """The measured thread has the lead of every turn: from F at the first sample on, F + K (n - 1/2 + o)."""
    angle = np.linspace(0.0, TURNS, 60 * TURNS + 1)
    rows = "\n".join(f"{a / 8.0:.9f},{a:.9f},{1.5 * a + 0.01 * a * a:.9f}" for a in angle)
    (workplace / "log.csv").write_text(f"time_s,angle,z\n{rows}\n", encoding="utf-8")
    draw, lines = np.random.default_rng(3), []
    for offset in (0.0, 0.25):
        ends = np.arange(TURNS) + offset
        grooves = 1.5 * ends + 0.01 * ends**2 + 0.0003 * draw.normal(size=ends.size)
        lines += [f"{n + 1},{p:.7f},0.5,{360 * offset:g}" for n, p in enumerate(np.diff(grooves))]
    text = "turn,pitch_mm,uncertainty_um,start_angle_deg\n" + "\n".join(lines) + "\n"
    (workplace / "measured.csv").write_text(text, encoding="utf-8")
    options = ("analyze", workplace / "log.csv", *COLUMNS, "--measured", workplace / "measured.csv", "--start-angle", 0,
               90, "--target", 1.5, "--lead-change", 0.02)
    document = json.loads(threadpitch(*options, "--json").out)["verdict"]
    assert document["cause"] == "none", document["sentence"]
    assert document["evidence"]["largest_um"] == pytest.approx(0.0, abs=2.5)
    assert [one["cause"] for one in document["rows"]] == ["none", "none"]
    text = " ".join(threadpitch(*options).out.split())
    assert "Measured at 0 deg: None: " in text
    assert "Measured at 90 deg: None: " in text
    for more, message in ((("--thread", "M20x1.5-6g"), "leave --thread or --lead-change out"),
                          (("--lead-change", "-0.1"), "give a smaller --lead-change")):
        outcome = threadpitch(*options, *more)
        assert outcome.status == 2
        assert_one_line(outcome.err, message)
    outcome = threadpitch("analyze", workplace / "log.csv", *COLUMNS, "--target", 1.5, "--lead-change", 0.02)
    assert outcome.status == 2
    assert_one_line(outcome.err, "give them with --measured FILE")
