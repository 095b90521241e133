"""G76: the worked examples of the sheets to the last digit, both clamping rules, both ways of finishing."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from threadpitch.cycles import (
    DIALECTS,
    FANUC,
    GSK980TDI,
    GSK988TA,
    TOMATECH,
    Dialect,
    Infeed,
    ProgramError,
    Setup,
    ThreadError,
    expand_cycle,
)
from threadpitch.cycles.dialect import Clamping, Finishing
from threadpitch.cycles.multiple import pass_depths, roughing_depths, thinner_than_least

MM = 1e-3
ONE_299 = ["G76 P010060 Q80 R0.1", "G76 X10 Z-20 P1299 Q400 F2"]
ONE_299_START = [0.4, 0.5657, 0.6928, 0.8, 0.8944, 0.9798, 1.0598]
COARSE = ["G76 P010060 Q0.1 R0.05", "G76 X10 Z-20 P1. Q0.25 F2"]
M68X6 = ["G76 P020560 Q0.150 R0.1", "G76 X60.64 Z-62 P3.68 Q1.8 F6"]


def depths_mm(blocks: list[str], dialect: Dialect, kind: str = "rough") -> list[float]:
    passes = expand_cycle(blocks, Setup(dialect=dialect)).passes
    return [round(cut.depth / MM, 4) for cut in passes if cut.kind == kind and cut.depth is not None]


@pytest.mark.parametrize(("dialect", "last"), [
    (TOMATECH, [1.1383, 1.199]), (GSK988TA, [1.1383, 1.199]), (GSK980TDI, [1.1398, 1.199]), (FANUC, [1.1398, 1.199])])
def test_height_1_299(dialect: Dialect, last: list[float]) -> None:
    assert depths_mm(ONE_299, dialect) == ONE_299_START + last
    assert depths_mm(ONE_299, dialect, "finish") == [1.299]


def test_clamped_once_the_rule_cuts_thinner_than_dmin_and_says_so() -> None:
    notices = expand_cycle(ONE_299, Setup(dialect=TOMATECH)).notices
    assert any("0.0785" in notice.text for notice in notices)
    assert not any("dmin" in notice.text for notice in expand_cycle(ONE_299, Setup(dialect=GSK980TDI)).notices)


def test_coarse_cycle_takes_13_or_8_roughing_passes() -> None:
    assert len(depths_mm(COARSE, TOMATECH)) == 13
    assert depths_mm(COARSE, GSK980TDI) == [0.25, 0.3536, 0.4536, 0.5536, 0.6536, 0.7536, 0.8536, 0.95]


@pytest.mark.parametrize("dialect", DIALECTS.values(), ids=lambda dialect: dialect.name)
def test_gsk_example_m68x6(dialect: Dialect) -> None:
    result = expand_cycle(M68X6, Setup(dialect=dialect))
    assert depths_mm(M68X6, dialect) == [1.8, 2.5456, 3.1177, 3.58]
    assert result.passes[-1].depth == pytest.approx(3.68 * MM, abs=1e-15)
    assert len(result.passes) == 6
    run_out = result.passes[0].run_out
    assert run_out is not None
    assert run_out.length == pytest.approx(3.0 * MM, abs=1e-15)
    assert math.degrees(run_out.angle) == pytest.approx(45.0)


def test_finishing_shares_the_allowance_or_springs() -> None:
    assert depths_mm(M68X6, TOMATECH, "finish") == [3.63, 3.68]
    assert depths_mm(M68X6, GSK988TA, "finish") == [3.68]
    assert depths_mm(M68X6, GSK988TA, "spring") == [3.68]


def test_first_cut_deeper_than_the_thread_is_one_roughing_pass() -> None:
    assert depths_mm(["G76 P010060 Q50 R0.1", "G76 X10 Z-20 P1000 Q5000 F2"], TOMATECH) == [0.9]


def test_without_allowance_roughing_goes_to_the_bottom_and_finishing_springs() -> None:
    blocks = ["G76 P030060 Q0 R0", "G76 X10 Z-20 P1000 Q600 F2"]
    assert depths_mm(blocks, TOMATECH) == [0.6, 0.8485, 1.0]
    assert depths_mm(blocks, TOMATECH, "spring") == [1.0, 1.0, 1.0]


def test_all_allowance_leaves_nothing_to_rough() -> None:
    assert pass_depths(Infeed(0.5 * MM, 0.0, 1.0 * MM, 2), 1.0 * MM) == (("finish", 0.5 * MM), ("finish", 1.0 * MM))


def test_no_finishing_pass_leaves_the_allowance_and_says_so() -> None:
    result = expand_cycle(["G76 P000060 Q0 R0.1", "G76 X10 Z-20 P1000 Q600 F2"])
    assert result.passes[-1].depth == pytest.approx(0.9 * MM)
    assert any("allowance" in notice.text for notice in result.notices)


def test_passes_are_bounded() -> None:
    with pytest.raises(ThreadError, match="10000 passes"):
        roughing_depths(Infeed(1e-6, 0.0), 0.09)
    with pytest.raises(ProgramError, match=r"line 2, column .*more than 10000 passes"):
        expand_cycle(["G76 P010060 Q0 R0", "G76 X10 Z-200 P90. Q1 F2"])


micrometres = st.integers(min_value=1, max_value=5000).map(lambda number: number / 1e6)


@given(first=micrometres, least=micrometres, height=micrometres, share=st.floats(0.0, 1.0),
       count=st.integers(0, 99), clamping=st.sampled_from(Clamping), finishing=st.sampled_from(Finishing))
@settings(deadline=None)
def test_depths_grow_to_the_height(first: float, least: float, height: float, share: float, count: int,
                                   clamping: Clamping, finishing: Finishing) -> None:
    infeed = Infeed(max(first, height / 50.0), min(least, height), share * height, count, clamping, finishing)
    cuts = pass_depths(infeed, height)
    depths = [0.0, *(depth for _, depth in cuts)]
    assert all(later >= earlier for earlier, later in pairwise(depths))
    assert all(kind == "spring" or later > earlier
               for (kind, later), earlier in zip(cuts, depths[:-1], strict=True) if later < height)
    assert [kind for kind, _ in cuts].count("rough") + count == len(cuts)
    if count:
        assert depths[-1] == height
    rough = [depth for kind, depth in cuts if kind == "rough"]
    if rough:
        bottom = height - infeed.allowance
        assert rough[-1] == pytest.approx(bottom, abs=1e-12)
        assert rough[0] == pytest.approx(min(max(infeed.first_cut, infeed.least_cut), bottom), abs=1e-12)


@given(first=micrometres, least=micrometres, height=micrometres)
@settings(deadline=None)
def test_sticky_cuts_never_fall_below_dmin_before_the_last(first: float, least: float, height: float) -> None:
    infeed = Infeed(max(first, height / 50.0), min(least, height), 0.0, 0, Clamping.STICKY)
    assert thinner_than_least(infeed, height) is None
