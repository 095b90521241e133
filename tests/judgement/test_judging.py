"""Several rows, one verdict."""

from __future__ import annotations

import numpy as np
import pytest

import threadpitch as tp


def test_what_is_negligible_is_so_in_every_row() -> None:
    """One row alone would be the control's with this limit, another excludes less: the whole is undetermined."""
    draw = np.random.default_rng(3)
    dip = 1.5e-3 - 12e-6 * np.exp(-np.arange(30) / 3.0)
    shown = np.stack([dip, dip]) + 1e-6 * draw.normal(size=(2, 30))
    least, most = sorted(tp.judge(dip, one, target=1.5e-3, uncertainty=1e-6).evidence.bound for one in shown)
    limits = {0.5 * (least + most): "undetermined", 1.05 * most: "control"}
    for limit, cause in limits.items():
        verdict = tp.judge(np.stack([dip, dip]), shown, target=1.5e-3, uncertainty=1e-6, negligible=limit)
        assert verdict.cause == cause
        assert verdict.evidence.bound == pytest.approx(most, rel=0.05)
    assert "control" in {row.cause for row in verdict.rows}
