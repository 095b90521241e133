"""The drawn control chart."""

from __future__ import annotations

from datetime import UTC, datetime

from threadpitch.control_chart import WITHIN, Part
from threadpitch.serve.control_page import made_charts
from threadpitch.store import RunSummary


def run(number: int) -> RunSummary:
    return RunSummary(number=number, uid=str(number), recorded_at=datetime(2026, 1, number, tzinfo=UTC), kind="log",
                      source="", machine="", program="", thread="", serial_number="", note="", cause=None,
                      sentence=None, trace_sha256=None, series=())


def test_a_part_far_beyond_its_limits_is_in_the_chart() -> None:
    means = [1.5e-3 + 1e-8 * (number % 3) for number in range(12)]
    means[5] = 3e-3
    parts = [(run(number + 1), Part(f"S-{number}", 20, mean, 1e-7)) for number, mean in enumerate(means)]
    (mean, _), rows = made_charts(parts, WITHIN)
    assert "mean" in rows[5].outside
    assert mean.figure is not None
    assert mean.figure.y_range.start < 1.5 < 3.0 < mean.figure.y_range.end
