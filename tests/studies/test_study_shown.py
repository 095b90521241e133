"""What people see of a study: units, where the yield is best, words, reports; and Ctrl-C in its command."""

from __future__ import annotations

import html
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import Command
from threadpitch import studies
from threadpitch.studies import Place, StudyError, kept, study, study_of
from threadpitch.studies.evaluation import Evaluator
from threadpitch.studies.expression import Expression
from threadpitch.studies.shown_units import expression_unit
from threadpitch.study_report import sentences, study_tables

HERE = Place(workers=0)
LENGTHS: dict[str, Any] = {
    "study": {"system": "none", "name": "<b>lengths</b> $x$", "design": "latin_hypercube", "samples": 64, "seed": 3},
    "parameters": {"gap": {"from": "1mm", "to": "2mm"}, "speed": {"from": "300rpm", "to": "600rpm"}},
    "outcomes": {"twice": "gap + gap", "word": "'wide' if gap > 0.0015 else 'narrow'", "far": "1 / (gap > 0.0011)"},
    "limits": {"twice": "3000um"}}


@pytest.mark.parametrize(("text", "unit"), [
    ("max(abs(a.x))", "mm"), ("max(abs(a.x) * a.on)", "mm"), ("max(a.x, 0)", "mm"), ("a.x + a.y", "mm"),
    ("a.x / a.y", "1"), ("a.x > 3", "1"), ("-percentile(a.x, 95)", "mm"), ("a.x if a.on else a.y", "mm"),
    ("max(a.x) * 1e6", None), ("a.x * a.speed", None), ("a.x + a.speed", None), ("unknown", None), ("a.x ** 2", None),
    ("sqrt(a.on)", "1"), ("nominal", "um")])
def test_unit_of_an_expression(text: str, unit: str | None) -> None:
    known = {"a.x": "mm", "a.y": "um", "a.on": "1", "a.speed": "rpm", "nominal": "um"}
    assert expression_unit(Expression(text, "y"), known.get) == unit


def test_a_study_is_read_in_the_units_that_it_was_written_in(tmp_path: Path) -> None:
    result = study(LENGTHS, output=tmp_path, place=HERE)
    assert dict(result.units) == {"gap": "mm", "speed": "rpm", "twice": "um", "far": "1"}
    twice = result.document["outcomes"]["twice"]
    assert twice["unit"] == "um"
    assert twice["limit"] == pytest.approx(3000.0)
    assert twice["max"] == pytest.approx(1e6 * max(result.table["twice"].to_pylist()))
    assert json.loads((tmp_path / "analysis.json").read_text()) == result.document
    assert result.document["outcomes"]["far"]["infinite"] > 0
    words = result.document["outcomes"]["word"]["words"]
    assert set(words) == {"wide", "narrow"}
    assert sum(words.values()) == 64


def test_where_the_yield_is_best_is_told(tmp_path: Path) -> None:
    """|2 gap| <= 3 mm holds below gap = 1.5 mm: of 8 bins of equal count the first half is good, the others are bad."""
    document = study(LENGTHS, output=tmp_path, place=HERE).document
    over_gap, over_speed = document["yield_responses"]
    assert [one["value"] for one in over_gap["yields"]] == [1.0] * 4 + [0.0] * 4
    assert over_gap["yields"][0]["low"] == pytest.approx(0.025 ** (1.0 / 8.0))  # 8 of 8: low^8 = (1 - 0.95) / 2
    assert over_gap["ends"][3][1] < 1.5 < over_gap["ends"][4][0]
    assert sum(over_speed["rows"]) == 64
    assert sentences(document)[0].startswith("Within all limits: 50.00 % of 64 rows; 95% confidence interval")
    assert "depends most on gap: 0.00 % at 1.5" in sentences(document)[1]
    assert "Yield within all limits over gap" in [one.heading for one in study_tables(document)]


def test_one_at_a_time_compares_what_differs_in_nothing_else(tmp_path: Path) -> None:
    result = study({"study": {"system": "none", "design": "one_at_a_time"},
                    "parameters": {"a": [1, 2, 3], "b": [0, 10]}, "outcomes": {"y": "a + b"}},
                   output=tmp_path, place=HERE)
    assert [one.mean.tolist() for one in result.analysis.responses] == [[1.0, 2.0, 3.0], [2.0, 12.0]]
    assert not any(one.spread.any() for one in result.analysis.responses)


@pytest.mark.parametrize(("tables", "why"), [
    ({"parameters": {"z_drive.position_gain": ["30mm", "60mm"]}}, "a unit like 1/s"),
    ({"parameters": {"z_drive.position_gain": ["30 1/s", "60mm"]}}, "mixes"),
    ({"limits": {"worst": "5rpm"}}, "a unit like um"),
    ({"study": {"pitch_limit": "5rpm"}}, "a unit like m"),
    ({"outcomes": {"worst": "actual.max_deviatio"}}, "did you mean actual.max_deviation"),
    ({"outcomes": {"worst": "actual.share_out_of_limit"}}, "pitch_limit"),
])
def test_what_does_not_fit_is_refused_before_anything_runs(tmp_path: Path, tables: dict[str, Any], why: str) -> None:
    definition = {"parameters": {"z_drive.position_gain": [30, 60]}, "outcomes": {"worst": "actual.max_deviation"}}
    with pytest.raises(StudyError, match=re.escape(why)):
        study({**definition, **tables}, output=tmp_path / "study", place=HERE)
    assert not (tmp_path / "study").exists()


def test_a_value_out_of_its_range_fails_its_row_alone_the_first_too(tmp_path: Path) -> None:
    result = study({"study": {"stop_time": 0.01}, "parameters": {"z_drive.position_gain": [-5, 30]},
                    "outcomes": {"lag": "last(z_drive.following_error)"}}, output=tmp_path, place=HERE)
    assert result.table["status"].to_pylist() == ["failed", "ok"]
    assert "below the minimum" in result.table["reason"].to_pylist()[0]


def test_a_folder_is_a_study_again_with_the_limits_of_its_last_call(tmp_path: Path) -> None:
    study(LENGTHS, output=tmp_path, place=HERE)
    other = study({**LENGTHS, "limits": {"twice": "2500um"}}, output=tmp_path, place=HERE)
    again = kept(tmp_path)
    assert again.document == other.document
    assert again.table.equals(other.table, check_metadata=True)
    (tmp_path / "study.json").write_text("{")
    with pytest.raises(StudyError, match="is damaged"):
        kept(tmp_path)


def test_report_of_a_study(threadpitch: Command, workplace: Path) -> None:
    pytest.importorskip("matplotlib")
    pytest.importorskip("bokeh")
    study(LENGTHS, output="lengths", place=HERE)
    for name in ("study.html", "study.pdf"):
        told = threadpitch("report", "lengths", "-o", name)
        assert told.status == 0
        assert "Within all limits: 50.00 %" in told.out
    page = Path("study.html").read_text(encoding="utf-8")
    assert "<script" not in page
    assert "script-src 'none'" in html.unescape(page)
    assert "<b>lengths" not in page
    assert "&lt;b&gt;lengths" in page
    assert page.count("data:image/svg+xml") == 2
    for heading in ("Yield within all limits over gap", "Main effects on twice [um]", "speed [rpm]"):
        assert heading in page
    assert Path("study.pdf").read_bytes().startswith(b"%PDF")
    shutil.rmtree("lengths/rows")
    Path("lengths/rows").mkdir()
    refused = threadpitch("report", "lengths", "-o", "study.html")
    assert refused.status == 2
    assert "no row of the study is done" in refused.err
    assert threadpitch("report", "lengths", "lengths").status == 2


def test_store_shows_what_a_study_came_to(threadpitch: Command, workplace: Path) -> None:
    pytest.importorskip("sqlalchemy")
    Path("study.toml").write_text('[study]\nsystem = "none"\n[parameters]\na = ["1mm", "2mm"]\n[outcomes]\n'
                                  'y = "a"\n[limits]\ny = "1.5mm"\n')
    assert threadpitch("study", "study.toml", "--workers", 0, "--store", "runs.db").status == 0
    shown = threadpitch("store", "show", 1, "--store", "runs.db")
    assert "y <= 1.5 mm" in shown.out
    assert "50.00 %" in shown.out
    wrong = threadpitch("study", "study.toml", "--workers", 0, "--output", "other", "--plot", "y.xyz")
    assert wrong.status == 2
    assert not Path("other").exists()


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_interrupt_keeps_what_is_done_and_the_same_command_goes_on(workplace: Path) -> None:
    """Rows wait at most two seconds before they are written; Ctrl-C comes while others are computed."""
    Path("study.toml").write_text('[study]\nstop_time = 0.4\ndesign = "random"\nsamples = 400\n'
                                  '[parameters]\n"z_drive.position_gain" = { from = 20, to = 80 }\n'
                                  '[outcomes]\nlag = "last(z_drive.following_error)"\n')
    with subprocess.Popen([sys.executable, "-m", "threadpitch", "study", "study.toml", "--workers", "0"],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        until = time.monotonic() + 120.0
        while not list(Path().glob("threadpitch-study/rows/part-*")) and time.monotonic() < until:
            time.sleep(0.02)
        running.send_signal(signal.SIGINT)
        _, told = running.communicate(timeout=60)
    assert running.returncode == 130, told
    assert "rows that are done are kept in threadpitch-study" in told
    assert "Traceback" not in told
    interrupted = kept("threadpitch-study")
    assert 0 < interrupted.table.num_rows < 400
    computed: list[int] = []
    whole = study("study.toml", place=HERE, progress=lambda done, rows: computed.append(done))
    assert whole.complete
    assert len(computed) == interrupted.missing
    for number in (interrupted.table["row"][0].as_py(), 399):
        assert studies.row("study.toml", number)[1].values["lag"] == whole.table["lag"][number].as_py()


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_interrupt_does_not_wait_for_a_long_row() -> None:
    """The row ends between two of its steps, and the same evaluator computes it to the same bits afterwards."""
    document = {"study": {"stop_time": 30.0}, "parameters": {"spindle.inertia": [0.1, 0.2]},
                "outcomes": {"angle": "last(spindle.angle)"}}
    with Evaluator(study_of(document)) as evaluator, Evaluator(study_of(document)) as quiet:
        evaluator.outcome(0, evaluator.study.rows[0])  # loads and compiles
        whole = quiet.outcome(1, quiet.study.rows[1])
        began = time.monotonic()
        evaluator.outcome(0, evaluator.study.rows[0])
        lasted = time.monotonic() - began
        threading.Timer(0.1 * lasted, os.kill, (os.getpid(), signal.SIGINT)).start()
        began = time.monotonic()
        with pytest.raises(KeyboardInterrupt):
            evaluator.outcome(1, evaluator.study.rows[1])
        assert time.monotonic() - began < 0.8 * lasted
        assert evaluator.outcome(1, evaluator.study.rows[1]) == whole
