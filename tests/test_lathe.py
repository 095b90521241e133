"""Simulated lathe: passes and their pitches against the recorded trace; what is shipped; what is refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray

import threadpitch as tp
from threadpitch import cosim, lathe
from threadpitch.trace import TURN

FloatArray = NDArray[np.float64]
ROOT = Path(__file__).parents[1]
STARTS_DEG = (0.0, 90.0, 180.0, 270.0)
FAST = {"controller.commanded_speed": "3000rpm"}


def crossings_in(result: lathe.Simulation, start_angle: float) -> FloatArray:
    """xi (crossings,) m where the detector's angle passes theta_S + 2 pi k, from the trace by straight lines.

    Only crossings after the step in which threading began: within that step the feed stands still for a while.
    """
    threading = result["controller.threading"]
    first, last = int(np.argmax(threading)), int(np.flatnonzero(threading)[-1])
    angle = result["spindle.encoder_angle"][first : last + 1]
    position = result["z_drive.measured_position"][first : last + 1]
    begin, end = (math.ceil((angle[0] - start_angle) / TURN), math.floor((angle[-1] - start_angle) / TURN))
    levels = start_angle + TURN * np.arange(begin, end + 1)
    return np.interp(levels, angle, position)


def assert_pitches_as_in_the_trace(result: lathe.Simulation, row: int, start_angle: float) -> None:
    """The last turns one by one; the calculator may have more, which begin in the step in which threading does."""
    (one,) = result.passes
    begin = int(np.argmax(result["controller.threading"]))
    turned = float(result["spindle.encoder_angle"][begin] - result["spindle.encoder_angle"][begin - 1]) / TURN
    found = one.table.pitch[row][~np.isnan(one.table.pitch[row])]
    expected = -np.diff(crossings_in(result, start_angle))  # the cut goes towards negative z
    assert 0 <= found.size - expected.size <= 1 + math.floor(turned)
    np.testing.assert_allclose(found[found.size - expected.size :], expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(("row", "start_deg"), list(enumerate(STARTS_DEG)))
def test_pitches_are_those_of_the_trace(short_run: lathe.Simulation, row: int, start_deg: float) -> None:
    assert_pitches_as_in_the_trace(short_run, row, math.radians(start_deg))


def test_a_step_of_several_turns_keeps_all_of_them() -> None:
    result = lathe.simulate(parameters=FAST, start_angles=[0.0, 0.5 * math.pi], stop_time=3.0, step_size=0.04)
    assert result["nominal_pitch.completed[1]"].max() >= 2
    for row, start_angle in enumerate((0.0, 0.5 * math.pi)):
        assert_pitches_as_in_the_trace(result, row, start_angle)
    (one,) = result.passes
    turns = np.count_nonzero(~np.isnan(one.table.pitch[0]))
    assert turns == result["nominal_pitch.revolution[1]"][-1] >= 20
    assert one.table.mean[0] == pytest.approx(result["nominal_pitch.pitch_mean[1]"][-1], abs=1e-12)


def test_the_crossings_are_where_the_turns_begin_and_end(short_run: lathe.Simulation) -> None:
    """Of a thread towards negative z: P(n) is positive in the direction of the cut."""
    table = short_run.pitch_table
    known = ~np.isnan(table.pitch)
    np.testing.assert_allclose(-np.diff(table.crossings, axis=1)[known], table.pitch[known], rtol=0.0, atol=1e-15)
    assert table.crossings[0, known[0].sum()] == short_run["nominal_pitch.crossing_position[1]"][-1]


def test_the_effective_thread_are_the_turns_that_begin_in_the_metal(short_run: lathe.Simulation) -> None:
    (one,) = short_run.passes
    assert one.effective is not None
    face = short_run["controller.z_face"][0]
    for row, start_deg in enumerate(STARTS_DEG):
        crossings = crossings_in(short_run, math.radians(start_deg))
        pitch = -np.diff(crossings)[crossings[:-1] <= face]
        assert 2 <= pitch.size < one.table.pitch.shape[1]
        assert np.count_nonzero(one.in_metal[row]) == pitch.size
        assert one.effective.minimum[row] == pytest.approx(pitch.min(), abs=1e-12)
        assert one.effective.maximum[row] == pytest.approx(pitch.max(), abs=1e-12)
        assert one.effective.mean[row] == pytest.approx(pitch.mean(), abs=1e-12)
    assert (one.effective.minimum > one.table.minimum).all()  # the run-up was cut in the air


def test_deviations_are_from_the_target(short_run: lathe.Simulation) -> None:
    (one,) = short_run.passes
    np.testing.assert_array_equal(one.deviation, one.table.pitch - 1.5e-3)


def test_nominal_and_actual_pitches_differ_by_the_error_of_the_screw(short_run: lathe.Simulation) -> None:
    """The motor encoder does not see the screw's A sin(2 pi xi/p): 2 A sin(pi lead/p) per turn, and its slope."""
    (nominal,) = short_run.passes_of("nominal_pitch")
    (actual,) = short_run.passes_of("actual_pitch")
    np.testing.assert_array_equal(short_run.passes[0].table.pitch, nominal.table.pitch)
    both = nominal.in_metal & actual.in_metal
    difference = (actual.table.pitch - nominal.table.pitch)[both]
    bound = 2.0 * 2e-6 * math.sin(math.pi * 1.5 / 10.0) + 23e-6 / 0.3 * 1.5e-3
    assert 0.5 * bound < abs(difference).max() < bound + 0.2e-6  # 0.2 um: elastic deflection under friction


def test_the_result_is_a_mapping_of_recorded_variables(short_run: lathe.Simulation) -> None:
    assert short_run.steps == 1200
    assert short_run.time.shape == short_run["nominal_pitch.pitch[1]"].shape == (1201,)
    np.testing.assert_array_equal(short_run.time, np.arange(1201) * 1e-3)
    assert set(short_run) >= {"spindle.angle", "z_drive.position", "controller.z_command", "actual_pitch.pitch[8]"}
    assert len(short_run) == len(list(short_run))
    with pytest.raises(KeyError, match=r"was not recorded; did you mean .*spindle\.speed"):
        short_run["spindle.speeed"]
    assert short_run.pitch_table is short_run.passes[0].table
    assert tp.Simulation is lathe.Simulation


def test_progress_is_told_up_to_the_end() -> None:
    told: list[tuple[int, int]] = []
    lathe.simulate(stop_time=0.1, progress=lambda done, steps: told.append((done, steps)))
    assert told[-1] == (100, 100)
    assert [done for done, _ in told] == sorted({done for done, _ in told})
    assert {steps for _, steps in told} == {100}


def test_a_stop_before_threading_gives_no_passes_and_says_why() -> None:
    result = lathe.simulate(stop_time=0.1)
    assert result.passes == ()
    assert result.why_no_turn().startswith("no threading until the stop at 0.1 s; the spindle reached ")
    with pytest.raises(lathe.LatheError, match=r"no threading until the stop at 0\.1 s"):
        _ = result.pitch_table


def test_a_stop_within_the_first_turn_says_when_threading_began(short_run: lathe.Simulation) -> None:
    began = float(short_run.time[int(np.argmax(short_run["controller.threading"]))])
    result = lathe.simulate(stop_time=round(began + 0.05, 3), start_angles=[0.0])
    assert result.passes == ()
    assert result.why_no_turn() == (f"no whole turn until the stop at {round(began + 0.05, 3):g} s: threading began at "
                                    f"{began:g} s; choose a longer stop time")


def test_unknown_calculator(short_run: lathe.Simulation) -> None:
    with pytest.raises(lathe.LatheError, match="'actual_pich' calculates no pitches; did you mean actual_pitch"):
        short_run.passes_of("actual_pich")


@pytest.mark.parametrize("count", [0, 9])
def test_number_of_start_angles(count: int) -> None:
    with pytest.raises(lathe.LatheError, match=f"{count} start angles; a pitch calculator takes 1 to 8"):
        lathe.simulate(start_angles=[0.0] * count)


@pytest.mark.parametrize("start_angle", [math.nan, math.inf, 7.0])
def test_start_angles_that_are_none(start_angle: float) -> None:
    with pytest.raises(cosim.CosimError, match=r"parameter \w+_pitch\.start_angle\[2\]: "):
        lathe.simulate(start_angles=[0.0, start_angle])


def test_eight_start_angles() -> None:
    starts = [math.radians(degrees) for degrees in (0, 45, 90, 135, 180, -135, -90, -45)]
    result = lathe.simulate(start_angles=starts, stop_time=0.9)
    (one,) = result.passes
    np.testing.assert_allclose(one.table.start_angles, starts, rtol=0.0, atol=1e-15)
    assert one.table.pitch.shape[0] == 8
    assert not np.isnan(one.table.pitch[:, 0]).any()


class Recorded(dict[str, NDArray[np.generic]]):
    """Two passes of two and one turns, as a calculator with one start angle records them; a row is 1 s."""

    def __init__(self) -> None:
        rows = 9
        self.time = np.arange(float(rows))
        self.steps = rows - 1
        self.wall_time = 0.0
        self.watched = None
        flat = dict.fromkeys((f"calculator.completed_pitch[{turn}]" for turn in range(1, 9)), np.zeros(rows))
        super().__init__({
            **flat,
            "calculator.threading": np.array([0, 1, 1, 0, 0, 1, 1, 1, 0], dtype=np.bool_),
            "calculator.start_angle_count": np.full(rows, 1),
            "calculator.start_angle[1]": np.zeros(rows),
            "calculator.pitch_target": np.full(rows, 2e-3),
            "calculator.direction": np.full(rows, -1.0),
            "calculator.completed[1]": np.array([0, 0, 2, 0, 0, 0, 0, 1, 0]),
            "calculator.completed_pitch[1]": np.array([0, 0, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 4e-3, 4e-3]),
            "calculator.completed_pitch[2]": np.array([0, 0, 3e-3, 3e-3, 3e-3, 3e-3, 3e-3, 3e-3, 3e-3]),
            "calculator.crossing_position[1]": -np.array([0, 0, 4e-3, 4e-3, 4e-3, 0, 0, 4e-3, 4e-3]),
            "controller.z_face": np.full(rows, -1e-3),
            "controller.z_start": np.zeros(rows),
            "controller.z_end": np.full(rows, -9e-3),
            "controller.start_number": np.array([1, 1, 1, 1, 1, 2, 2, 2, 2]),
        })


def test_every_rise_of_threading_begins_a_pass() -> None:
    first, second = lathe.Simulation(cast("cosim.Result", Recorded()), "python").passes
    assert (first.number, first.start_number, second.number, second.start_number) == (1, 1, 2, 2)
    np.testing.assert_array_equal(first.table.pitch, [[1e-3, 3e-3]])
    np.testing.assert_array_equal(second.table.pitch, [[4e-3]])
    np.testing.assert_allclose(first.deviation, [[-1e-3, 1e-3]], rtol=0.0, atol=1e-18)
    np.testing.assert_array_equal(first.in_metal, [[False, True]])  # from 0 to -1 mm, then from the face on
    np.testing.assert_array_equal(second.in_metal, [[False]])
    assert first.effective is not None
    assert first.effective.mean.tolist() == [3e-3]


def test_a_system_without_a_face_has_no_effective_thread() -> None:
    recorded = Recorded()
    del recorded["controller.z_face"]
    for one in lathe.Simulation(cast("cosim.Result", recorded), "python").passes:
        assert one.effective is None
        assert one.in_metal.all()


def test_a_system_without_calculators_has_no_passes() -> None:
    recorded = Recorded()
    for name in [name for name in recorded if name.startswith("calculator")]:
        del recorded[name]
    result = lathe.Simulation(cast("cosim.Result", recorded), "python")
    assert result.passes == ()
    with pytest.raises(lathe.LatheError, match="no component of this system calculates pitches; add a PitchCalculator"):
        _ = result.pitch_table


def test_shipped_systems_are_found_from_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shipped = lathe.shipped("models") / "threading_lathe"
    assert (shipped / "SystemStructure.ssd").is_file()
    assert lathe.find_system("models/threading_lathe") == lathe.find_system("threading_lathe") == shipped
    for unknown in ("nosuch", "models", "models/../pyproject.toml", "../threading_lathe"):
        assert lathe.find_system(unknown) == Path(unknown)
    own = tmp_path / "models" / "threading_lathe"
    own.mkdir(parents=True)
    assert lathe.find_system("models/threading_lathe").resolve() == own.resolve()


def test_fmus_beside_the_system_come_first(tmp_path: Path) -> None:
    beside = tmp_path / "FeedDrive.fmu"
    beside.write_bytes(b"")
    assert lathe.locate_fmu("python", "FeedDrive.fmu", tmp_path) == beside
    built = lathe.locate_fmu("python", "resources/FeedDrive.fmu", tmp_path)
    assert built.name == "FeedDrive.fmu"
    assert tmp_path not in built.parents
    with pytest.raises(cosim.SystemStructureError, match="no shipped model is called 'FedDrive'; did you mean FeedDr"):
        lathe.locate_fmu("python", "FedDrive.fmu", tmp_path)


def test_model_files_carry_the_names_of_their_classes() -> None:
    assert lathe.model_file("FeedDrive").name == "feed_drive.py"
    for path in lathe.model_files():
        name = "".join(word.capitalize() for word in path.stem.split("_"))
        assert lathe.model_file(name) == path
        assert f"\nclass {name}" in path.read_text(encoding="utf-8")
