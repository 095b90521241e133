"""``threadpitch check`` and ``--replace``: what a system is made of, and everything that is wrong with it."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import Command
from threadpitch import lathe
from threadpitch.fmu import cached_fmu
from threadpitch.system_archive import FmuKind, build_system
from threadpitch.system_report import check_system

DRIVE = '''"""A drive without any dynamics."""

from dataclasses import dataclass

from threadpitch.fmu.variable import input_, output, parameter


@dataclass
class {name}:
    """x = command, and the following error is what the gain leaves."""

    position_gain: float = parameter("1/s", "Gain", start=30.0, min=1.0)
    {command}: float = input_("m", "Commanded position")
    load_force: float = input_("N", "Load")
    position: float = output("m", "Position")
    velocity: float = output("m/s", "Velocity")
    measured_position: float = output("m", "Measured position")
    motor_angle: float = output("rad", "Motor angle")
    following_error: float = output("m", "Following error")
    torque: float = output("N.m", "Torque")

    def check(self) -> int:
        return 0

    def initialize(self) -> None:
        self.position = self.{command}
        self.measured_position = self.{command}

    def step(self, time: float, step_size: float) -> int:
        self.velocity = (self.{command} - self.position) / step_size
        self.position = self.{command}
        self.measured_position = self.{command}
        return 0
'''


@pytest.fixture
def drive(workplace: Path) -> Path:
    path = workplace / "ideal_drive.py"
    path.write_text(DRIVE.format(name="IdealDrive", command="position_command"))
    return path


def test_the_shipped_lathe_is_sound(threadpitch: Command, workplace: Path) -> None:
    done = threadpitch("check")
    assert (done.status, done.err) == (0, "")
    for text in ("| z_drive", "FeedDrive.fmu", "state, saved state", "spindle.encoder_angle [rad]",
                 "cut: of the step before", "order: spindle -> controller -> z_drive -> x_drive -> ",
                 "nominal_pitch -> actual_pitch\n",
                 "feed each other: spindle, controller, z_drive, x_drive", "no loop of direct feedthrough"):
        assert text in done.out
    assert list(workplace.iterdir()) == []


def test_the_document_tells_the_same(threadpitch: Command, workplace: Path) -> None:
    found = json.loads(threadpitch("check", "--json", "--set", "z_drive.backlash=5um").out)
    assert [one["name"] for one in found["components"]] == found["order"]
    assert {one["step_size_s"] for one in found["components"]} == {0.001}
    cut = [one["to"] for one in found["connections"] if one["cut"]]
    assert {"spindle.speed_command", "controller.z_position", "controller.x_position"} <= set(cut)
    backlash, = [one for one in found["parameters"] if one["name"] == "z_drive.backlash"]
    assert backlash == {"name": "z_drive.backlash", "value": pytest.approx(5e-6), "unit": "m"}
    assert (found["problems"], found["feedthrough_loops"], found["stop_s"]) == ([], [], 4.0)


def test_every_problem_at_once(threadpitch: Command, workplace: Path, drive: Path) -> None:
    """A drive that lacks a variable under the name that is asked for, and values that cannot be."""
    drive.write_text(DRIVE.format(name="IdealDrive", command="position_comand"))
    done = threadpitch("check", "--set", "spindle.inertia=-1", "z_drive.position_gian=3", "zdrive.backlash=1um",
                       "--replace", f"z_drive={drive}", "xdrive=x.fmu")
    assert done.status == 2
    for text in ("connector z_drive.position_command: IdealDrive.fmu has no such variable; did you mean position_co",
                 "spindle.inertia: ", "no variable 'position_gian'; did you mean position_gain",
                 "no component 'zdrive'; did you mean z_drive", "no component 'xdrive'; did you mean x_drive"):
        assert text in done.err
    assert done.err.count("position_command") == 1  # the connection does not tell it again
    assert "Traceback" not in done.err
    document = json.loads(threadpitch("check", "--json", "--replace", f"z_drive={drive}").out)
    assert len(document["problems"]) == 1


@pytest.mark.parametrize("arguments", [
    ("--replace", "z_drive"), ("--replace", "=x.fmu"), ("--replace", "z_drive=x.txt"),
    ("--replace", "z_drive=gone.fmu"), ("nowhere.ssp",)])
def test_what_cannot_be_checked_is_told_in_one_line(threadpitch: Command, workplace: Path,
                                                    arguments: tuple[str, ...]) -> None:
    done = threadpitch("check", *arguments)
    assert done.status == 2
    assert done.err.startswith("threadpitch: ")
    assert done.err.count("\n") == 1


def test_a_drive_of_ones_own_runs(threadpitch: Command, workplace: Path, drive: Path) -> None:
    """As a model file and as an FMU, with equal bits: without dynamics the pitch is the lead."""
    flavor = lathe.choose_flavor()
    as_model = lathe.simulate(replace={"z_drive": drive}, stop_time=1.5, parameters={"z_drive.position_gain": 9.0})
    as_fmu = lathe.simulate(replace={"z_drive": cached_fmu(drive, flavor)}, stop_time=1.5,
                            parameters={"z_drive.position_gain": 9.0})
    assert np.array_equal(as_model["z_drive.position"], as_fmu["z_drive.position"])
    assert np.array_equal(as_model["z_drive.position"][2:], as_model["controller.z_command"][2:])
    # the parameter sets of the shipped drive name nothing in this one, which is told
    assert any("z_drive.backlash names nothing" in text or "z_drive.screw_lead names nothing" in text
               for text in as_model.result.warnings)
    done = threadpitch("run", "--replace", f"z_drive={drive}", "--stop-time", "1.5", "--json")
    assert done.status == 0
    assert json.loads(done.out)["passes"]


def test_an_ssp_without_an_fmu_tells_which_model_was_taken(tmp_path: Path) -> None:
    kind = FmuKind(lathe.choose_flavor())
    whole = build_system(lathe.DEFAULT_SYSTEM, tmp_path, kind)
    lacking = tmp_path / "lacking.ssp"
    with zipfile.ZipFile(whole) as packed, zipfile.ZipFile(lacking, "w") as less:
        for member in packed.infolist():
            if not member.filename.endswith("FeedDrive.fmu"):
                less.writestr(member, packed.read(member))
    assert check_system(whole).problems == ()
    found = check_system(lacking)
    assert found.plan is not None
    notes = [note for note in found.plan.notes if "FeedDrive" in note]
    assert [note.partition(" runs ")[0] for note in notes] == [
        f"lacking.ssp holds no resources/FeedDrive.fmu; component {name!r}" for name in ("z_drive", "x_drive")]
