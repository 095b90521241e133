"""Columns that are found by the names of other languages and of controls, and the following error beside them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import Command
from threadpitch.pitch import pitch_tables
from threadpitch.trace import ColumnChoice, FloatArray, TraceError, chosen_columns
from threadpitch.trace.choice import choose

NCK = "/Nck/!SD/nckServoData"


@pytest.mark.parametrize(("names", "angle", "position", "error", "command"), [
    (["Zeit [s]", "Spindelwinkel [°]", "Achsposition Z [mm]", "Drehzahl [1/min]"], 1, 2, None, None),
    (["Zeit", "Drehwinkel", "Lageistwert Z [mm]", "Lagesollwert Z [mm]", "Schleppabstand Z [µm]", "Drehzahl",
      "Vorschub [mm/min]"], 1, 2, 4, 3),
    (["Zeit", "Spindel Umdrehungen", "Istwert Z", "Sollwert Z", "Schleppfehler Z", "Schleppfehler X"], 1, 2, 4, 3),
    (["Zeit", "C1 Lageistwert [Grad]", "Z1 Lageistwert [mm]", "Motortemperatur"], 1, 2, None, None),
    (["Zeit", "Winkel Spindel", "Istwert X", "Istwert Z"], 1, 3, None, None),
    (["Time", "Spindle.NcToPlc.ActPos", "Z.NcToPlc.ActPos", "Z.NcToPlc.SetPos", "Z.NcToPlc.PosDiff"], 1, 2, 4, 3),
    (["Time", "Spindle.fPosIst", "Z.fPosIst", "Z.fPosSoll", "Z.fPosDiff", "Z.fVeloIst"], 1, 2, 4, 3),
    (["time", "spindle.0.revs", "joint.2.pos-fb", "joint.2.pos-cmd", "joint.2.f-error"], 1, 2, 4, 3),
    (["Time [s]", "S Actual pos [°]", "Z Actual pos [mm]", "Z Noml. pos [mm]", "Z Lag [um]"], 1, 2, 4, 3),
    ([f"Spindle position: {NCK}ActPos1stEnc64 [u1, 4]", f"Lageistwert: {NCK}ActPos1stEnc64 [u1, 3]",
      f"Following Error (64 bit): {NCK}FlwErr64 [u1, 3]", f"Following Error (64 bit): {NCK}FlwErr64 [u1, 1]",
      f"Position setpoint (64 bit): {NCK}CmdPos1stEnc64 [u1, 3]"], 0, 1, 2, 4),
    (["Temps [s]", "Angle broche [°]", "Position Z [mm]", "Erreur de poursuite Z", "Vitesse"], 1, 2, 3, None),
    (["Tempo", "Angolo mandrino [gradi]", "Posizione Z", "Errore di inseguimento Z"], 1, 2, 3, None),
    (["Tiempo", "Ángulo husillo", "Posición Z", "Error de seguimiento Z"], 1, 2, 3, None),
    (["時間", "主軸角度", "Z位置", "Z速度", "Z位置偏差"], 1, 2, 4, None),
    (["time_s", "spindle_angle_deg", "z_actual_mm", "z_command_mm", "following_error_mm", "speed_rpm"], 1, 2, 4, 3),
    (["revs", "z_mm", "z_lag_um", "z_following_error_um"], 0, 1, None, None),  # which of the two is not told
])
def test_columns_by_the_names_of_controls(names: list[str], angle: int, position: int, error: int | None,
                                          command: int | None) -> None:
    chosen = choose("log", names, ColumnChoice())
    assert (names[chosen.angle], names[chosen.position]) == (names[angle], names[position])
    assert chosen.following_error == (None if error is None else names[error])
    assert chosen.command == (None if command is None else names[command])


@pytest.mark.parametrize(("names", "units"), [
    (["Zeit in s", "Spindelwinkel in Grad", "Weg Z in µm"], ("deg", "um", "s")),
    (["Time, ms", "Spindle angle, deg", "Z, m"], ("deg", "m", "ms")),
    (["t", "S1 [°]", "Z1 [mm]"], ("deg", "mm", "s")),
    (["Zeit (ms)", "Rotorlage [Grad]", "Schlittenposition"], ("deg", "mm", "ms")),
    (["Time in spindle revs", "spindle in motion", "z"], ("rev", "mm", "s")),  # words that are no units
])
def test_units_as_they_are_written_and_an_angle_by_its_unit(names: list[str], units: tuple[str, str, str]) -> None:
    chosen = choose("log", names, ColumnChoice(angle="2" if "motion" in names[1] else None))
    assert (chosen.angle, chosen.position) == (1, 2)
    assert (chosen.angle_unit, chosen.position_unit, chosen.time_unit) == units
    assert chosen.time == (None if "revs" in names[0] else 0)


def test_two_columns_with_a_unit_of_angles_are_not_guessed() -> None:
    with pytest.raises(TraceError, match="no column is called like the angle"):
        choose("log", ["A [deg]", "B [deg]", "Z [mm]"], ColumnChoice())


TIME: FloatArray = 1e-3 * np.arange(4500.0)
REVS: FloatArray = 6.0 * TIME
ERROR: FloatArray = 0.02 + 0.004 * np.sin(0.9 * REVS)  # mm, a fluctuation that the spindle's speed does not explain


def german(path: Path, *, with_error: bool, encoding: str = "utf-8") -> Path:
    z = 1.5 * REVS - ERROR
    columns = {"Zeit [s]": TIME, "Spindelwinkel [°]": 360.0 * REVS, "Lageistwert Z [mm]": z,
               "Lagesollwert Z [mm]": z + ERROR, "Drehzahl [1/min]": np.full(TIME.size, 360.0)}
    if with_error:
        columns["Schleppabstand Z [µm]"] = 1e3 * ERROR
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    lines = [";".join(f"{value:.7f}".replace(".", ",") for value in row) for row in rows]
    path.write_text("\n".join([";".join(columns), *lines, ""]), encoding=encoding)
    return path


@pytest.mark.parametrize(("with_error", "told"), [(True, "following error by its name: 'Schleppabstand Z [µm]'"),
                                                  (False, "from the command by its name: 'Lagesollwert Z [mm]'")])
def test_the_following_error_of_a_german_log_tells_where_in_the_control(
        tmp_path: Path, threadpitch: Command, *, with_error: bool, told: str) -> None:
    log = german(tmp_path / "schnitt.csv", with_error=with_error)
    nominal = json.loads(threadpitch("analyze", log, "--json").out)["groups"][0]["pitch_mm"][0]
    measured = tmp_path / "measured.csv"
    measured.write_text("turn,pitch_mm\n" + "".join(f"{n},{pitch:.6f}\n" for n, pitch in enumerate(nominal, 1)
                                                    if pitch is not None))
    asked = ["analyze", log, "--measured", measured, "--target", 1.5, "--uncertainty", 0.5, "--json"]
    outcome = threadpitch(*asked)
    assert told in outcome.err
    shares = json.loads(outcome.out)["verdict"]["control"]["shares"]
    assert shares["following"] > 0.95
    without = threadpitch(*asked, "--following-error", "none")
    assert "by its name" not in without.err
    assert json.loads(without.out)["verdict"]["control"]["shares"]["following"] == 0.0
    named = threadpitch(*asked, "--following-error", "Drehzahl [1/min]")
    assert json.loads(named.out)["verdict"]["control"]["shares"]["following"] == pytest.approx(0.0, abs=1e-9)


def test_units_in_the_letters_of_older_windows_are_known(tmp_path: Path) -> None:
    path = german(tmp_path / "schnitt.csv", with_error=True, encoding="cp1252")
    chosen = chosen_columns(path, ColumnChoice())
    assert (chosen.angle_unit, chosen.position_unit) == ("deg", "mm")
    assert chosen.following_error is not None
    unit = chosen_columns(path, ColumnChoice(position=chosen.following_error, angle="2")).position_unit
    assert unit == "um"
    (group,) = pitch_tables(path, ColumnChoice())
    (wanted,) = pitch_tables(german(tmp_path / "utf8.csv", with_error=True), ColumnChoice())
    np.testing.assert_array_equal(group.table.pitch, wanted.table.pitch)


@pytest.mark.parametrize("group", ["angle [deg]", "z [mm]"])
def test_passes_by_the_column_of_a_signal_are_refused(group: str) -> None:
    with pytest.raises(TraceError, match=r"log:1: the group is column .*, which is the angle or the position; name"):
        choose("log:1", ["angle [deg]", "z [mm]", "pass"], ColumnChoice(group=group))


def test_a_name_is_known_without_its_unit_where_it_is_the_only_one() -> None:
    names = ["t [s]", "Z [mm]", "Z [inch]", "A [deg]", "X [mm]", "X"]
    found = choose("log", names, ColumnChoice("A", "X"))
    assert (found.angle, found.position) == (3, 5)
    with pytest.raises(TraceError, match="there is no column 'Z'; nearest are"):
        choose("log", names, ColumnChoice("A", "Z"))
