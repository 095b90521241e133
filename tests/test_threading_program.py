"""Programs on the whole lathe: operations, parameters and passes as the words have them."""

from __future__ import annotations

import functools
import math
from pathlib import Path

import numpy as np
import pytest

from threadpitch import lathe
from threadpitch.cycles import (
    DIALECTS,
    ControlParameters,
    Indexing,
    Interpretation,
    Setup,
    interpret,
    read_program,
    read_program_file,
)
from threadpitch.program_parameters import Operation, OperationError, Workpiece, operations
from threadpitch.run_folder import run_document
from threadpitch.tables import pass_text
from threadpitch.trace import TURN

PROGRAMS = Path(__file__).parents[1] / "models" / "programs"
SHORT = """G97 S600 M3
G0 X26. Z5.
G76 P021060 Q50 R0.05
G76 X18.16 Z-8. P920 Q500 F1.5
M30
"""
TWO_BY_Z = "G97 S600 M3\nG0 X24. Z5.\nX18.2\nG32 Z-8. F3.\nG0 X24.\nZ6.5\nX18.2\nG32 Z-8. F3.\nG0 X24.\nM30\n"


def interpreted(name: str) -> Interpretation:
    indexing = Indexing.EVERY_BLOCK if name.startswith("special") else Indexing.ONCE
    return interpret(read_program_file(PROGRAMS / name), Setup(indexing=indexing))


def program(text: str, setup: Setup | None = None) -> tuple[Operation, ...]:
    return operations(interpret(read_program(text), setup))


@pytest.mark.parametrize("name", sorted(path.name for path in PROGRAMS.glob("*.nc")))
def test_every_program_runs_and_cuts_its_passes(name: str) -> None:
    """In the stop time that is given, at the kinds and depths of the words; the controller ends by itself."""
    cut = 0
    for operation in operations(interpreted(name)):
        # in aluminium: the chips of M68x6 in steel ask for more torque than this spindle has
        parameters = {**operation.parameters, "cutting.material": "almgsi1"}
        result = lathe.simulate(parameters=parameters, stop_time=operation.stop_time)
        assert result["controller.phase"][-1] == 8
        assert result["controller.alarm"].max() == 0
        assert len(result.passes) == len(operation.passes)
        for one, wanted in zip(result.passes, operation.passes, strict=True):
            assert one.start_number == wanted.start_number
            assert one.lead == pytest.approx(wanted.lead)
            assert one.start_angle == pytest.approx(wanted.start_angle, abs=TURN / 4096)
            if wanted.depth is not None:
                assert one.kind == wanted.kind
                assert one.depth == pytest.approx(wanted.depth, abs=1e-12)
            rows = (result["controller.pass_number"] == one.number) & (result["controller.threading"] == 1)
            x, z = result["controller.x_command"][rows], result["controller.z_command"][rows]
            assert (x[0], z[0]) == pytest.approx((wanted.start.x, wanted.start.z), abs=1e-3)
            assert z[-1] == pytest.approx(wanted.paths[-1].leaves_at.z, abs=1e-3)
        cut += len(operation.passes)
    assert cut == len(interpreted(name).passes)


def test_the_parameters_of_a_cycle_are_its_words() -> None:
    (operation,) = program(SHORT, Setup(dialect=DIALECTS["gsk988ta"]))
    parameters = operation.parameters
    assert parameters["controller.cycle"] == "multiple"
    assert parameters["controller.finishing"] == "first_takes_all"
    assert parameters["controller.clamping"] == "no_memory"
    assert parameters["controller.commanded_speed"] == pytest.approx(600.0 / 60.0 * TURN)
    wanted = {"x_clear": 13e-3, "z_start": 5e-3, "z_end": -8e-3, "x_thread": 9.08e-3, "thread_height": 0.92e-3,
              "first_cut": 0.5e-3, "least_cut": 0.05e-3, "allowance": 0.05e-3, "lead": 1.5e-3,
              "run_out_length": 1.5e-3, "tool_angle": math.radians(60.0), "x_surface": 10e-3}
    for name, value in wanted.items():
        assert parameters[f"controller.{name}"] == pytest.approx(value), name
    assert parameters["z_drive.initial_position"] == pytest.approx(5e-3)
    assert parameters["x_drive.initial_position"] == pytest.approx(13e-3)
    sticky = program(SHORT, Setup(dialect=DIALECTS["gsk980tdi"]))[0].parameters
    assert (sticky["controller.clamping"], sticky["controller.finishing"]) == ("sticky", "equal_parts")


def test_passes_that_differ_in_x_only_are_one_list() -> None:
    (operation,) = operations(interpreted("m20x1.5_g92.nc"), Workpiece(face=-1e-3, surface=10e-3))
    assert operation.parameters["controller.pass_count"] == 8
    depths = operation.parameters["controller.depth"]
    assert depths == pytest.approx([0.25e-3, 0.45e-3, 0.6e-3, 0.725e-3, 0.825e-3, 0.9e-3, 0.92e-3, 0.92e-3])
    assert operation.parameters["controller.z_face"] == -1e-3
    unknown = operations(interpreted("m20x1.5_g92.nc"))[0].parameters["controller.depth"]
    assert isinstance(unknown, list)
    assert unknown[-1] == pytest.approx(0.6134 * 1.5e-3, rel=1e-4)  # h3 of the metric thread


@functools.cache
def two_starts() -> tuple[Operation, lathe.Simulation]:
    (operation,) = program("G97 S600 M3\nG0 X26. Z5.\nG92 X19.4 Z-8. F3. L2\nX18.8\nM30\n")
    return operation, lathe.simulate(parameters=operation.parameters, stop_time=operation.stop_time)


def test_starts_of_one_block_are_cut_pass_by_pass() -> None:
    operation, result = two_starts()
    parameters = operation.parameters
    assert [one.start_number for one in operation.passes] == [1, 2, 1, 2]
    assert (parameters["controller.starts"], parameters["controller.pass_count"]) == (2, 2)
    assert [one.start_number for one in result.passes] == [1, 2, 1, 2]
    assert [one.kind for one in result.passes] == ["rough", "rough", "finish", "finish"]
    assert [one.final_flank for one in result.passes] == [False, False, True, True]
    for one in result.passes:
        assert (one.lead, one.pitch) == pytest.approx((3e-3, 1.5e-3))
        assert one.table.mean[0] == pytest.approx(3e-3, abs=2e-4)  # P(n) measures the lead


STARTS = "G97 S600 M3\nG0 X26. Z5.\n"


def cuts(*words: str) -> str:
    """G32 cuts, each with its X and Q: "19.4 Q180000"."""
    return STARTS + "".join(f"X{word.split()[0]}\nG32 Z-8. F3. {word.split()[1]}\nG0 X26.\nZ5.\n" for word in words)


@pytest.mark.parametrize(("words", "order"), [
    (("19.4 Q0", "19.4 Q180000", "18.8 Q0", "18.8 Q180000"), "pass_by_pass"),
    (("19.4 Q0", "18.8 Q0", "19.4 Q180000", "18.8 Q180000"), "start_by_start")])
def test_starts_by_q_are_one_thread(words: tuple[str, ...], order: str) -> None:
    """One workpiece, one operation: pitch = lead / starts; the order of the cuts is that of the program."""
    (operation,) = program(cuts(*words))
    values = operation.parameters
    assert (values["controller.starts"], values["controller.start_order"]) == (2, order)
    assert values["controller.pass_count"] == 2
    result = lathe.simulate(parameters=values, stop_time=operation.stop_time)
    assert [one.start_number for one in result.passes] == [1 + (word.endswith("Q180000")) for word in words]
    assert [one.start_angle for one in result.passes] == pytest.approx(
        [math.pi * word.endswith("Q180000") for word in words], abs=TURN / 4096)
    assert [(one.lead, one.pitch) for one in result.passes] == [pytest.approx((3e-3, 1.5e-3))] * 4
    for one, wanted in zip(result.passes, operation.passes, strict=True):
        rows = (result["controller.pass_number"] == one.number) & (result["controller.threading"] == 1)
        np.testing.assert_allclose(result["controller.x_command"][rows], wanted.start.x, atol=1e-9)


@pytest.mark.parametrize("words", [
    ("19.4 Q0", "19.4 Q90000"),  # not even
    ("19.4 Q0", "19.4 Q180000", "18.8 Q0"),  # one start misses a cut
    ("19.4 Q0", "19.3 Q180000", "18.8 Q0", "18.8 Q180000")])  # other depths
def test_starts_that_are_not_alike_are_threads_of_their_own(words: tuple[str, ...]) -> None:
    found = program(cuts(*words))
    assert [one.parameters["controller.starts"] for one in found] == [1] * len(found)
    assert sum(len(one.passes) for one in found) == len(words)


def test_three_starts_by_thousandths_of_a_degree() -> None:
    (operation,) = program(cuts("19.4 Q10000", "19.4 Q130000", "19.4 Q250000"))
    assert operation.parameters["controller.starts"] == 3
    assert operation.parameters["controller.first_start_angle"] == pytest.approx(math.radians(10.0))
    seven = program(cuts(*(f"19.4 Q{round(360000 * k / 7)}" for k in range(7))))
    assert [one.parameters["controller.starts"] for one in seven] == [7]


def test_another_place_or_speed_is_another_operation() -> None:
    first, second = program(TWO_BY_Z)
    assert (first.parameters["controller.z_start"], second.parameters["controller.z_start"]) == (5e-3, 6.5e-3)
    slow, fast = program(SHORT.replace("M30", "S700 M3\nG32 Z-6. F1.\nM30"))
    assert slow.parameters["controller.cycle"] == "multiple"
    assert fast.parameters["controller.commanded_speed"] == pytest.approx(700.0 / 60.0 * TURN)
    cuts = "".join(f"X{19.8 - 0.01 * n:.2f}\n" for n in range(1, 40))
    many = program(f"G97 S600 M3\nG0 X26. Z5.\nG92 X19.8 Z-8. F1.5\n{cuts}M30\n")
    assert [len(one.passes) for one in many] == [32, 8]


def test_a_surface_speed_follows_x_up_to_its_limit() -> None:
    """100 m/min is 1719 rpm at X18.52, the first pass, and 1753 at X18.16, the last; G50 S1740 lies between."""
    (operation,) = program(SHORT.replace("G97 S600", "G50 S1740\nG96 S100"))
    start = operation.passes[0].start.x
    assert operation.parameters["controller.commanded_speed"] == pytest.approx(100.0 / 60.0 / start)
    assert operation.parameters["controller.highest_speed"] == pytest.approx(1740.0 / 60.0 * TURN)
    parameters = {**operation.parameters, "z_drive.speed_limit": 1.0}
    result = lathe.simulate(parameters=parameters, stop_time=operation.stop_time)
    assert result["controller.phase"][-1] == 8
    for one in operation.passes:
        rows = (result["controller.pass_number"] == one.number) & (result["controller.threading"] == 1)
        rows &= result["controller.z_command"] > -6e-3  # before the run-out
        told = result["controller.spindle_speed_command"][rows]
        np.testing.assert_allclose(told, min(1740.0 / 60.0 * TURN, 100.0 / 60.0 / one.start.x))


def test_the_limit_of_a_surface_speed_holds_wherever_it_is_written() -> None:
    for text in ("G50 S600\nG96 S200 M3\n", "G96 S200 M3\nG50 S600\n"):
        (operation,) = program(SHORT.replace("G97 S600 M3\n", text))
        assert operation.parameters["controller.commanded_speed"] == pytest.approx(600.0 / 60.0 * TURN)
    (operation,) = program(SHORT.replace("G97", "G50 S300\nG97"))
    assert operation.parameters["controller.commanded_speed"] == pytest.approx(600.0 / 60.0 * TURN)  # of G97: as told


CHAIN = "G97 S600 M3\nG0 X26. Z5.\nX19.\nG32 Z-1. F1.5\n"


def test_a_run_out_amid_a_chain_is_a_block_of_its_own() -> None:
    """Z keeps the lead through it; steeper than 45 degrees X is the long axis, and the lead counts along it."""
    (operation,) = program(CHAIN.replace("F1.5", "F1.5 J0.5 K1.") + "Z-3. F2. J2. K1.\nZ-5.\nM30\n")
    values = {name.removeprefix("controller."): value for name, value in operation.parameters.items()}
    assert values["z_end"] == pytest.approx(0.0)
    assert values["further_blocks"] == 4
    assert values["further_z"] == pytest.approx([-1e-3, -2e-3, -3e-3, -5e-3])
    assert values["further_x"] == pytest.approx([10e-3, 10e-3, 12e-3, 12e-3])
    assert values["further_lead"] == pytest.approx([1.5e-3, 2e-3, 4e-3, 2e-3])
    assert [path.turns for path in operation.passes[0].paths] == pytest.approx([5 / 1.5, 1 / 1.5, 0.5, 0.5, 1.0])


def test_a_chain_of_thirty_blocks_is_cut() -> None:
    (operation,) = program(CHAIN + "".join(f"W-1. F{1 + n % 2}.\n" for n in range(30)) + "G0 X26.\nM30\n")
    assert operation.parameters["controller.further_blocks"] == 30
    result = lathe.simulate(parameters=operation.parameters, stop_time=operation.stop_time)
    assert result["controller.block"].max() == 31
    assert result["controller.z_command"].min() == pytest.approx(-31e-3, abs=1e-9)


def test_threads_across_a_face_are_left_along_z() -> None:
    (operation,) = program("G97 S300 M3\nG0 X60. Z2.\nZ-0.5\nG32 X20. F2.\nG0 Z2.\nX60.\nM30\n")
    values = operation.parameters
    assert (values["controller.infeed_axis"], values["controller.z_clear"]) == ("z", 2e-3)
    assert values["z_drive.initial_position"] == 2e-3
    (beside,) = program("G97 S300 M3\nG0 X60. Z-0.5\nG32 X20. F2.\nG0 X60.\nM30\n")
    assert beside.parameters["controller.infeed_axis"] == "x"


@pytest.mark.parametrize(("text", "slope"), [
    ("G97 S600 M3\nG0 X16. Z5.\nG76 P011060 Q50 R0.05\nG76 X20. Z-8. P920 Q500 F1.5\n", 0.0),
    ("G97 S600 M3\nG0 X30. Z5.\nG76 P011060 Q50 R0.05\nG76 X22. Z-8. R-2. P920 Q500 F1.5\n", -2.0 / 13.0)])
def test_the_workpiece_is_that_of_the_thread(text: str, slope: float) -> None:
    """Internal and tapered: the first chip has depth^2 tan(30 degrees), and the last pass is as deep as the words."""
    (operation,) = program(text)
    result = lathe.simulate(parameters={**operation.parameters, "cutting.material": "almgsi1"},
                            stop_time=operation.stop_time, record=["outputs", "cutting.taper"])
    assert result["cutting.taper"][0] == pytest.approx(slope)
    first, last = operation.passes[0], operation.passes[-1]
    rows = (result["controller.threading"] == 1) & (result["controller.z_command"] < -2e-3)
    rows &= result["controller.z_command"] > -6e-3
    for one in (first, last):
        cut = rows & (result["controller.pass_number"] == one.number)
        depth = np.median(result["cutting.groove_depth"][cut])
        assert depth == pytest.approx(one.depth, abs=0.03e-3)  # the tool and the workpiece yield
    chip = np.median(result["cutting.chip_area"][rows & (result["controller.pass_number"] == 1)])
    assert chip == pytest.approx((first.depth or 0.0) ** 2 * math.tan(math.radians(30.0)), rel=0.15)


def test_parameters_of_the_control_reach_the_machine() -> None:
    interpretation = interpret(read_program(SHORT))
    control = ControlParameters(speed_fluctuation_percent=10, acceleration_type=2)
    (operation,) = operations(interpretation, control=control)
    assert operation.parameters["controller.fluctuation_limit"] == pytest.approx(0.1)
    assert operation.parameters["controller.start_mode"] == "exponential"
    assert "controller.start_mode" not in operations(interpretation)[0].parameters


@pytest.mark.parametrize(("text", "what"), [
    ("G97 S600 M3\nG0 X26. Z5.\nM30\n", "cuts no thread"),
    (CHAIN + "".join(f"Z-{n}.\n" for n in range(2, 34)) + "M30\n", "a chain of 33 threading blocks"),
    (CHAIN.replace("G97 S600", "G96 S60").replace("X19.", "X0"), "write its highest spindle speed with G50 S"),
])
def test_what_the_controller_cannot_cut_is_refused(text: str, what: str) -> None:
    with pytest.raises(OperationError, match=what) as caught:
        program(text)
    assert "\n" not in str(caught.value)
    assert "; " in str(caught.value)


def test_tables_and_documents_tell_lead_and_pitch_apart() -> None:
    _, result = two_starts()
    last = result.passes[-1]
    text = pass_text(last).splitlines()
    assert text[0] == "Pass 4, start 2"
    assert text[1:3] == ["finish, depth 0.9202 mm, makes the final flank",
                         "start angle 180 deg, lead 3 mm, pitch 1.5 mm"]
    record = run_document(result)["passes"]
    assert isinstance(record, list)
    assert record[-1]["kind"] == "finish"
    assert (record[-1]["lead_mm"], record[-1]["groove_pitch_mm"]) == pytest.approx((3.0, 1.5))
    assert [one["final_flank"] for one in record] == [False, False, True, True]
    assert record[-1]["start_angle_deg"] == pytest.approx(180.0)
