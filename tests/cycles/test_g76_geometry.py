"""G76 and G92: the points A B C D E Bn, taper, run-out, starts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from threadpitch.cycles import (
    G76Cycle,
    G92Cycle,
    Helix,
    Indexing,
    Infeed,
    Point,
    RunOut,
    Setup,
    ThreadError,
    ThreadPath,
    expand_cycle,
    groove_locus,
    infeed_scheme,
    interpret,
    passes,
    read_program,
    tool_path,
)
from threadpitch.cycles import single as single_cycle

MM = 1e-3
DEGREE = math.pi / 180.0
INFEED = Infeed(0.3 * MM, 0.05 * MM, 0.05 * MM, 2)


def cycle(taper: float = 0.0, angle: float = 60.0 * DEGREE, start: Point | None = None, **helix: object) -> G76Cycle:
    shared = Helix(1.5 * MM, taper, **helix)  # type: ignore[arg-type]  # tests give what Helix takes
    return G76Cycle(start or Point(15 * MM, 6 * MM), Point(9 * MM, -30 * MM), shared, 1.0 * MM, angle, INFEED)


def test_straight_thread_is_fed_in_along_the_flank() -> None:
    for cut in passes(cycle()):
        assert cut.depth is not None
        assert cut.start.x == pytest.approx(10 * MM - cut.depth, abs=1e-15)
        assert cut.start.z == pytest.approx(6 * MM - cut.depth * math.tan(30 * DEGREE), abs=1e-15)
        assert cut.end.x == pytest.approx(cut.start.x, abs=1e-15)
        assert cut.end.z == -30 * MM


def test_angle_zero_feeds_in_along_x_only() -> None:
    assert {cut.start.z for cut in passes(cycle(angle=0.0))} == {6 * MM}


def test_internal_thread_is_the_mirror_image() -> None:
    inside = G76Cycle(Point(7 * MM, 6 * MM), Point(10 * MM, -30 * MM), Helix(1.5 * MM), 1.0 * MM, 60 * DEGREE, INFEED)
    for cut in passes(inside):
        assert cut.depth is not None
        assert cut.end.x == pytest.approx(9 * MM + cut.depth, abs=1e-15)


def test_thread_towards_plus_z_shifts_the_other_way() -> None:
    back = G76Cycle(Point(15 * MM, -30 * MM), Point(9 * MM, 6 * MM), Helix(1.5 * MM), 1.0 * MM, 60 * DEGREE, INFEED)
    last = passes(back)[-1]
    assert last.start.z == pytest.approx(-30 * MM + math.tan(30 * DEGREE) * MM, abs=1e-15)


@given(taper=st.floats(-4.0, 4.0).map(lambda value: value * MM), angle=st.floats(0.0, 99.0).map(math.radians))
@settings(deadline=None)
def test_every_pass_is_parallel_to_c_d_and_its_depth_away_from_the_top(taper: float, angle: float) -> None:
    made = cycle(taper, angle)
    slope = -taper / (-36 * MM)  # (D.x - C.x) / (D.z - A.z)
    for cut in passes(made):
        assert cut.depth is not None
        assert cut.end.x - cut.start.x == pytest.approx(slope * (cut.end.z - cut.start.z), abs=1e-15)
        top = made.end.x + made.height + slope * (cut.start.z - made.end.z)  # the line through B at depth 0
        assert top - cut.start.x == pytest.approx(cut.depth, abs=1e-15)
        assert cut.end.z == made.end.z


def test_lead_runs_along_z_up_to_45_degrees_then_along_x_never_along_the_path() -> None:
    flat = ThreadPath(Point(0.0, 0.0), Point(10 * MM, -10 * MM), 2 * MM)
    steep = ThreadPath(Point(0.0, 0.0), Point(20 * MM, -10 * MM), 2 * MM)
    assert (flat.long_axis, flat.lead_along_z) == ("z", 2 * MM)
    assert (steep.long_axis, steep.lead_along_z) == ("x", 1 * MM)
    assert steep.turns == pytest.approx(10.0)


def test_run_out_leaves_the_line_on_its_last_piece() -> None:
    made = cycle(run_out=RunOut(2 * MM, 1 * MM))
    path = passes(made)[-1].paths[0]
    assert path.leaves_line_at.z == pytest.approx(-28 * MM)
    assert (path.leaves_at.x, path.leaves_at.z) == pytest.approx((10 * MM, -30 * MM))
    assert path.run_out is not None
    assert math.degrees(path.run_out.angle) == pytest.approx(math.degrees(math.atan(0.5)))


def test_run_out_of_a_steep_taper_runs_along_x() -> None:
    steep = G92Cycle(Point(60 * MM, 5 * MM), Point(10 * MM, -5 * MM), Helix(1.5 * MM, 30 * MM, RunOut(2 * MM, 1 * MM)))
    path = single_cycle.passes(steep)[0].paths[0]
    assert path.leaves_line_at.x == pytest.approx(12 * MM)
    assert path.leaves_at.z == pytest.approx(-4 * MM)


def test_starts_are_whole_parts_of_a_turn_apart() -> None:
    made = passes(cycle(starts=3, first_start_angle=200 * DEGREE))
    angles = {cut.start_number: math.degrees(cut.start_angle) for cut in made}
    assert angles == {1: pytest.approx(200.0), 2: pytest.approx(320.0), 3: pytest.approx(80.0)}
    assert [cut.number for cut in made] == list(range(1, len(made) + 1))
    one = [cut.start for cut in made if cut.start_number == 1]
    assert one == [cut.start for cut in made if cut.start_number == 3]


def test_lead_grows_by_the_change_in_every_turn() -> None:
    path = ThreadPath(Point(0.0, 0.0), Point(0.0, -33 * MM), 2 * MM, lead_change=0.5 * MM)
    turns = path.turns
    assert 2.0 * turns + 0.25 * turns**2 == pytest.approx(33.0)
    assert path.end_lead == pytest.approx(path.lead + 0.5 * MM * turns)


def test_a_return_through_the_metal_is_noted() -> None:
    blocks = ["G76 P010060 Q50 R0.05", "G76 X18. Z-30. P1000 Q300 F1.5"]
    near = expand_cycle(blocks, Setup(position=Point(9.5 * MM, 6 * MM)))
    clear = expand_cycle(blocks, Setup(position=Point(12 * MM, 6 * MM)))
    assert any("through the metal" in notice.text for notice in near.notices)
    assert not any("through the metal" in notice.text for notice in clear.notices)


def test_scheme_keeps_one_flank_and_reaches_every_depth() -> None:
    made = cycle()
    scheme = infeed_scheme(made)
    depths = [cut.depth for cut in passes(made)]
    assert scheme.depth[:, 1] == pytest.approx(np.array(depths))
    assert scheme.offset[:, 0] == pytest.approx(np.zeros(len(depths)), abs=1e-15)
    assert scheme.offset[:, 2] == pytest.approx(2.0 * scheme.offset[:, 1])
    assert len(scheme.kinds) == len(depths)


def test_tool_path_is_closed_and_threads_only_between_bn_and_the_run_out() -> None:
    result = expand_cycle(["G76 P010560 Q50 R0.05", "G76 X18. Z-30. P1000 Q300 F1.5"],
                          Setup(position=Point(15 * MM, 6 * MM)))
    path = tool_path(result.moves)
    assert len(path.threading) == len(path.move) == len(path.x) - 1
    assert (path.x[-1], path.z[-1]) == (15 * MM, 6 * MM)
    assert path.threading.sum() == 2 * len(result.passes)  # the line and its run-out
    assert path.z[:-1][path.threading].max() <= 6 * MM


def test_the_groove_over_the_spindle_angle_is_that_of_the_seed_s_figure_3() -> None:
    """Inclined, standing until the next start angle, inclined by another lead; a lead that grows is a parabola."""
    text = ("G97 S60 M3\nG0 X26. Z0.\nG32 W-2. F4. Q0\nW-1. Q270000\nW0 F0 Q90000\nW-2. F4. Q180000\n"
            "G34 W-3. F2. R1. Q0")
    (one,) = interpret(read_program(text), Setup(indexing=Indexing.EVERY_BLOCK)).passes
    angle, z = groove_locus(one)
    assert np.all(np.diff(angle) >= 0.0)
    corners = {0: 0.0, 90: -1.0, 180: -2.0, 270: -2.0, 360: -3.0, 450: -3.0, 540: -3.0, 720: -5.0}
    for degrees, wanted in corners.items():
        assert np.interp(math.radians(degrees), angle, z) == pytest.approx(wanted * MM, abs=1e-9)
    turns = (angle[-33:] - angle[-33]) / (2.0 * math.pi)
    assert z[-33:] == pytest.approx(-5 * MM - (2.0 * turns + 0.5 * turns**2) * MM)
    assert z[-1] == pytest.approx(-8 * MM)


@pytest.mark.parametrize(("change", "words"), [
    ({"start": Point(9 * MM, 6 * MM)}, "ends at the X"),
    ({"start": Point(15 * MM, -30 * MM)}, "ends at the Z"),
    ({"start": Point(15 * MM, -29.9 * MM)}, "flank infeed"),
    ({"start": Point(math.nan, 6 * MM)}, "start point"),
    ({"taper": 6 * MM}, "past the start point"),
    ({"run_out": RunOut(36 * MM, 1 * MM)}, "run-out takes 36"),
    ({"angle": math.pi}, "tool angle"),
])
def test_impossible_geometry_is_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(ThreadError, match=words):
        cycle(**change)  # type: ignore[arg-type]  # each case gives what its name says


@pytest.mark.parametrize("lead", [0.0, -1.0, math.nan])
def test_no_helix_without_a_lead(lead: float) -> None:
    with pytest.raises(ThreadError, match="lead is not positive"):
        Helix(lead)
