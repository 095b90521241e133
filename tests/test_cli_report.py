"""``threadpitch report`` on the command line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.conftest import Command, assert_one_line

LOG = Path(__file__).parent.parent / "models" / "logs" / "linuxcnc" / "C_ripple_500.csv.gz"


@pytest.fixture
def measured(workplace: Path) -> Path:
    pitch = 1.5 + 0.004 * np.sin(2.0 * np.pi * np.arange(30.0) / 6.7)
    path = workplace / "measured.csv"
    path.write_text("turn,pitch_mm\n" + "".join(f"{n},{value:.6f}\n" for n, value in enumerate(pitch, start=1)))
    return path


def test_a_log_with_measured_pitches_and_a_tolerance(threadpitch: Command, workplace: Path, measured: Path) -> None:
    outcome = threadpitch("report", LOG, "--start-angle", 0, 90, "--measured", measured, "--uncertainty", 0.5,
                          "--thread", "M20x1.5-6g", "--ball-screw", 10, "-o", "log.html", "--title", "My <log>")
    assert (outcome.status, outcome.err) == (0, "")
    assert "Verdict: Mechanical" in outcome.out
    assert outcome.out.endswith("saved in log.html\n")
    text = (workplace / "log.html").read_text()
    for words in ("My &lt;log&gt;", "Table 3: movement per revolution", "Permutation test", "What to do", "20.21 um",
                  "SHA-256 of the log", "All passes, every one"):
        assert words in text, words
    assert "http://" not in text[:text.index("<script>")].replace("http://www.w3.org/2000/svg", "")


def test_a_group_on_paper(threadpitch: Command, workplace: Path) -> None:
    outcome = threadpitch("report", LOG, "--pass", "1", "-o", "log.pdf")
    assert (outcome.status, outcome.err) == (0, "")
    assert (workplace / "log.pdf").read_bytes().startswith(b"%PDF")


def test_a_thread_that_cannot_be_judged_is_reported_with_a_note(threadpitch: Command, workplace: Path,
                                                                measured: Path) -> None:
    outcome = threadpitch("report", LOG, "--measured", measured, "--target", 1.5, "-o", "log.html")
    assert outcome.status == 0
    assert "No verdict: " in (workplace / "log.html").read_text()
    assert "No verdict: " in outcome.out


@pytest.mark.parametrize(("options", "message"), [
    (("nosuch.csv",), "nosuch.csv: there is no such file"),
    ((LOG, "-o", "report.txt"), r"report\.txt: a report can be \.html or \.pdf"),
    ((LOG, "-o", "nosuch/report.html"), "nosuch: there is no such folder"),
    ((LOG, "--pass", "7"), "there is no group '7'; the groups are 1, 2"),
    ((LOG, "--crossing", "cubic"), "crossing 'cubic' is not known"),
    ((LOG, "--thread", "X20"), "X20"),
    ((LOG, "--uncertainty", "-1"), "uncertainty -1 um is not positive"),
    ((".", "--measured", LOG), "--measured belongs to a log"),
    ((".",), r"without pitch\.csv; give the folder of a run, or a log"),
    ((), "Missing argument"),
])
def test_what_cannot_be_reported_is_told_in_one_line(threadpitch: Command, workplace: Path,
                                                     options: tuple[object, ...], message: str) -> None:
    outcome = threadpitch("report", *options)
    assert outcome.status == 2
    assert_one_line(outcome.err, message)
    assert not list(workplace.glob("report.*"))


def test_a_thread_whose_lead_changes_has_targets_turn_by_turn(threadpitch: Command, workplace: Path) -> None:
    """xi = F x + K x^2 / 2 from the first sample on is no deviation at all; a log that begins half a turn late too."""
    turns = np.linspace(0.5, 20.0, 2000)
    way = 1.5 * (turns - 0.5) + 0.01 * (turns - 0.5) ** 2 + 0.002 * np.sin(2.0 * np.pi * turns / 5.0)
    rows = "\n".join(f"{a:.9f},{z:.9f}" for a, z in zip(turns, way, strict=True))
    (workplace / "log.csv").write_text(f"angle,z\n{rows}\n")
    grooves = np.interp(np.arange(1.0, 20.0) + 0.25, turns, way)
    (workplace / "measured.csv").write_text("turn,pitch_mm,start_angle_deg\n" + "".join(
        f"{n},{pitch:.7f},90\n" for n, pitch in enumerate(np.diff(grooves), start=2)))
    options = ("log.csv", "--angle-unit", "rev", "--position-unit", "mm", "--start-angle", 0, 90, "--target", 1.5,
               "--lead-change", 0.02)
    outcome = threadpitch("report", *options, "--measured", "measured.csv", "--uncertainty", 0.5)
    assert (outcome.status, outcome.err) == (0, "")
    assert "Deviation of P(n) from the lead of its turn over n [um]" in outcome.out
    for line, offset in zip([line for line in outcome.out.splitlines() if " deg  " in line], (0.0, 0.25), strict=True):
        wave = np.diff(2.0 * np.sin(2.0 * np.pi * (np.arange(1.0, 20.0) + offset) / 5.0))  # um
        told = [float(text) for text in line.split()[-1].split("..")]
        assert told == pytest.approx([wave.min(), wave.max()], abs=0.02)
    assert "Verdict: Control" in outcome.out
    assert "target 1.5 mm at the first sample, +0.02 mm a turn" in (workplace / "report.html").read_text()
    assert threadpitch("report", *options, "-o", "log.pdf").status == 0
    for changed, message in (((*options[:-4], "--lead-change", 0.02), "give it with --target in mm"),
                             ((*options, "--thread", "M20x1.5-6g"), "leave --thread or --lead-change out"),
                             ((*options[:-1], -0.1), "falls to nothing within 20 turns"),
                             ((".", *options[-2:]), "--lead-change belongs to a log")):
        assert_one_line(threadpitch("report", *changed).err, message)
