"""One recording in every format gives the same pitches."""

from __future__ import annotations

import gc
import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import Command, assert_one_line
from threadpitch.pitch import pitch_tables, thread_pitch
from threadpitch.trace import TURN, ColumnChoice, FloatArray, TraceError, array_files
from threadpitch.trace.cut_off import cut_off

TIME: FloatArray = 1e-3 * np.arange(2000.0)
REVS: FloatArray = 8.0 * TIME + 0.01 * np.sin(9.0 * TIME)
Z: FloatArray = -1.5 * REVS + 0.002 * np.sin(5.0 * REVS)  # mm
PASS = np.where(TIME < 0.2, 0, np.where(TIME < 1.1, 1, np.where(TIME < 1.2, 0, 2)))


def expected() -> list[FloatArray]:
    """Of both passes, counted from where each begins."""
    pitches = [thread_pitch(TURN * REVS[k == PASS], 1e-3 * Z[k == PASS]).pitch for k in (1, 2)]
    return [pitch[:, ~np.isnan(pitch[0])] for pitch in pitches]


def assert_read(path: Path, choice: ColumnChoice | None = None, within: float = 1e-12) -> tuple[str, ...]:
    groups = pitch_tables(path, choice or ColumnChoice())
    assert [group.label for group in groups] == ["1", "2"]
    for group, pitch in zip(groups, expected(), strict=True):
        np.testing.assert_allclose(group.table.pitch, pitch, rtol=0.0, atol=within)
    return groups[0].table.notes


def parquet(path: Path) -> None:
    import pyarrow
    import pyarrow.parquet
    table = pyarrow.table({"time_s": TIME, "spindle_revs": REVS, "z_mm": Z, "pass": PASS})
    pyarrow.parquet.write_table(table, path, row_group_size=300)


def parquet_folder(path: Path) -> None:
    path.mkdir()
    import pyarrow
    import pyarrow.parquet
    for number, part in enumerate(np.array_split(np.arange(TIME.size), 3)):
        fields = [("spindle", "rev"), ("z", "mm"), ("pass", "")]
        schema = pyarrow.schema([pyarrow.field(name, pyarrow.float64(), metadata={"unit": unit})
                                 for name, unit in fields])
        columns = [REVS[part], Z[part], PASS[part].astype(float)]
        pyarrow.parquet.write_table(pyarrow.table(columns, schema=schema), path / f"part-{number}.parquet")


def hdf5(path: Path) -> None:
    import h5py
    with h5py.File(path, "w") as file:
        run = file.create_group("run")
        for name, values in {"spindle angle": 360.0 * REVS, "z": 1e3 * Z, "pass": PASS, "time": TIME}.items():
            run[name] = values
        run["spindle angle"].attrs["unit"] = "deg"
        run["z"].attrs["unit"] = "um"
        run["scalar"] = 3.0


def mat(path: Path) -> None:
    from scipy.io import savemat
    savemat(path, {"spindle_revs": REVS[:, np.newaxis], "z_mm": Z, "pass": PASS, "note": "text"})


def tdms(path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter
    columns = {"SpindleAngle": (REVS, "rev"), "Z": (Z, "mm"), "pass": (PASS, "")}
    with TdmsWriter(path) as file:
        file.write_segment([ChannelObject("Trace", name, values, {"unit_string": unit, "wf_increment": 1e-3})
                            for name, (values, unit) in columns.items()])


def mdf(path: Path) -> None:
    from asammdf import MDF, Signal
    with MDF(version="4.10") as file:
        file.append([Signal(REVS, TIME, "rev", "SpindleAngle"), Signal(Z, TIME, "mm", "ActPosZ"),
                     Signal(PASS, TIME, "", "pass")])
        file.save(path, overwrite=True)


def mdf3(path: Path) -> None:
    """The units are in the conversions of the channels."""
    from asammdf import MDF, Signal
    with MDF(version="3.30") as file:
        file.append([Signal(360.0 * REVS, TIME, "deg", "SpindleAngle"), Signal(1e-3 * Z, TIME, "m", "ActPosZ"),
                     Signal(PASS, TIME, "", "pass")])
        file.save(path, overwrite=True)


def structure(path: Path) -> None:
    from scipy.io import savemat
    feed = {"z_mm": Z, "name": "Z"}
    savemat(path, {"log": {"time": TIME, "spindle_revs": REVS, "feed": feed, "pass": PASS, "rate": 1000.0}})


def csv(lines: list[str], separator: str = ",", comma: bool = False) -> str:
    for row in zip(TIME, REVS, Z, PASS, strict=True):
        fields = [f"{value:.12g}" for value in row]
        lines.append(separator.join(field.replace(".", ",") if comma else field for field in fields))
    return "\n".join(lines) + "\n"


WRITERS: dict[str, Callable[[Path], None]] = {
    "log.parquet": parquet, "folder": parquet_folder, "log.h5": hdf5, "log.mat": mat, "log.tdms": tdms,
    "log.mf4": mdf, "log.mdf": mdf3, "structure.mat": structure,
}


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("chunk", [1 << 18, 77])
def test_every_format_gives_the_same_pitches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str,
                                             chunk: int) -> None:
    monkeypatch.setattr(array_files, "CHUNK", chunk)
    WRITERS[name](tmp_path / name)
    notes = assert_read(tmp_path / name)
    assert any(note.startswith("columns by their names: angle ") for note in notes)


TEXTS = {
    "units in brackets": csv(["Time [s],Spindle angle [rev],Z [mm],Pass"]),
    "decimal comma": csv(["Zeit [s];Spindelwinkel (rev);Z (mm);Pass"], ";", comma=True),
    "comments": csv(["# made by hand", "# at noon", "time,spindle_revs,z_mm,pass", "% 1.5 mm", "", "// begin"]),
    "row of units": csv(["time\tspindle\tz\tpass", "s\trev\tmm\t-"], "\t"),
    "blanks": csv(["time  spindle_revs z_mm   pass"], "  "),
    "blanks and brackets": csv(["Time [s]  Spindle angle [rev]  Z [mm]  Pass"], "   "),
    "single blanks": csv(["Time (s) Spindle angle (rev) Z axis (mm) Pass [-]"], " "),
    "commas in the header": csv(["Zeit, s   Spindelwinkel, rev   Z, mm   Pass"], "  ", comma=True),
    "units below blanks": csv(["time  spindle angle  z axis  pass", "  s    rev   mm  -"], "    "),
    "comment over decimal commas": csv(["# Zeit [s]  Spindel [rev]  Z [mm]  Pass [-]"], "  ", comma=True),
    "header in a comment": csv(["# LinuxCNC", "# time spindle_revs z_mm pass"], " "),
}


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("packed", [False, True])
def test_texts_as_machines_write_them(tmp_path: Path, name: str, packed: bool) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(gzip.compress(TEXTS[name].encode()) if packed else TEXTS[name].encode())
    assert_read(path, within=1e-12)


@pytest.mark.parametrize("form", ["MAT", "HDF5", "HDF5, a row per signal"])
def test_the_columns_of_a_table_are_chosen_by_number(tmp_path: Path, form: str) -> None:
    path, table = tmp_path / "log", np.column_stack([TIME, REVS, Z, PASS])
    if form == "MAT":
        from scipy.io import savemat
        savemat(path, {"trace": table}, appendmat=False)
    else:
        import h5py
        with h5py.File(path, "w") as file:
            file["trace"] = table if form == "HDF5" else table.T
    assert_read(path, ColumnChoice("2", "trace/3", time="1", group="4"))
    with pytest.raises(TraceError, match="out of 1 'trace/1', 2 'trace/2', 3 'trace/3', 4 'trace/4'"):
        pitch_tables(path, ColumnChoice())


def test_columns_by_number_where_there_is_no_header(tmp_path: Path) -> None:
    path = tmp_path / "halsampler.txt"
    path.write_text(csv([], " "))
    assert_read(path, ColumnChoice("2", "3", "rev", "mm", "4"))
    with pytest.raises(TraceError, match=r"the first row holds numbers; give a header .* or choose the columns by"):
        pitch_tables(path, ColumnChoice("revs", "z"))


def test_an_export_of_twincat_scope(tmp_path: Path) -> None:
    channels = {"SpindleRevs": REVS, "AxisZ": Z, "Pass": PASS}
    head = ["Name\tThreading", "File\tscope.svdx", "Start-Time of export\t01.02.2020 10:00:00", ""]
    for field, values in {"Name": list(channels), "SymbolName": list(channels), "Data-Type": ["LREAL"] * 3,
                          "SampleTime[ms]": ["1"] * 3, "Unit": ["rev", "mm", ""]}.items():
        head.append("\t".join(f"{field}\t{value}" for value in values))
    rows = ["\t".join(f"{1e3 * t:.9g}\t{values[i]:.12g}" for values in channels.values()) for i, t in enumerate(TIME)]
    path = tmp_path / "scope.csv"
    path.write_text("\n".join([*head, "", *rows]) + "\n")
    assert "read as an export of TwinCAT Scope" in assert_read(path)


def test_a_missing_library_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hdf5(tmp_path / "log.h5")
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(TraceError, match=r"needs h5py, .*pip install 'threadpitch\[hdf5\]'"):
        pitch_tables(tmp_path / "log.h5", ColumnChoice())


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # asammdf leaves its scratch file open
@pytest.mark.parametrize("name", ["log.parquet", "log.h5", "log.mat", "log.tdms", "log.mf4"])
def test_damaged_files_of_every_format_are_refused_in_one_line(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / name)
    whole = (tmp_path / name).read_bytes()
    for damaged in (whole[: len(whole) // 3], whole[:200], whole[:12] + b"\xff" * 300 + whole[312:]):
        (tmp_path / name).write_bytes(damaged)
        try:
            pitch_tables(tmp_path / name, ColumnChoice())
        except ValueError as error:
            assert str(error).startswith(str(tmp_path / name))  # noqa: PT017 -- what can be saved may be read
            assert str(error).isprintable()  # noqa: PT017
    gc.collect()


@pytest.mark.parametrize("name", ["log.parquet", "log.h5", "log.mat", "log.tdms", "log.mf4"])
def test_a_file_that_is_cut_off_is_refused_as_such(tmp_path: Path, threadpitch: Command, name: str) -> None:
    WRITERS[name](tmp_path / name)
    whole = (tmp_path / name).read_bytes()
    assert cut_off(tmp_path / name, array_files.array_format(tmp_path / name)) == ""
    for size in (len(whole) - 1, len(whole) - 100, len(whole) // 2, len(whole) // 50):
        (tmp_path / name).write_bytes(whole[:size])
        assert_one_line(threadpitch("analyze", tmp_path / name).err,
                        f"the {array_files.array_format(tmp_path / name)} file is cut off: .*{size}.*bytes")


def test_segments_and_superblocks_of_every_kind_are_seen_as_whole(tmp_path: Path) -> None:
    import h5py
    from nptdms import ChannelObject, TdmsWriter
    for version in ("earliest", "v108", "latest"):
        with h5py.File(tmp_path / "log.h5", "w", libver=version, userblock_size=512) as file:
            file["revs"] = REVS
        assert cut_off(tmp_path / "log.h5", "HDF5") == ""
        text = (tmp_path / "log.h5").read_bytes()
        (tmp_path / "log.h5").write_bytes(text[:-1])
        assert cut_off(tmp_path / "log.h5", "HDF5")
    path = tmp_path / "log.tdms"
    with TdmsWriter(path) as file:
        for part in np.split(REVS, 4):
            file.write_segment([ChannelObject("Trace", "revs", part)])
    assert cut_off(path, "TDMS") == ""
    whole = path.read_bytes()
    last = whole.rindex(b"TDSm")
    path.write_bytes(whole[:last] + whole[last : last + 12] + b"\xff" * 8 + whole[last + 20 :])
    assert cut_off(path, "TDMS") == ""  # of a recorder that was switched off: what is there can be read
    path.write_bytes(whole[:-7])
    assert cut_off(path, "TDMS") == f"{len(whole) - 7} of at least {len(whole)} bytes are there"
