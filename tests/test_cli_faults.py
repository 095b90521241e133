"""The command line refuses bad input in one line that says what, where and how to mend it; and it explains itself."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import pytest

from tests.conftest import Command, assert_one_line
from threadpitch import __version__, lathe

BAD_INPUT: list[tuple[tuple[str, ...], str]] = [
    (("--set", "z_driv.screw_lead=10mm"), r"no component 'z_driv'; did you mean z_drive"),
    (("--set", "z_drive.screw_led=10mm"), r"z_drive has no variable 'screw_led'; did you mean screw_lead"),
    (("--set", "z_drive.screw_lead=-10mm"), r"z_drive\.screw_lead: -0\.01 m is below the minimum of 0\.0001 m"),
    (("--set", "z_drive.screw_lead=10kg"), r"z_drive\.screw_lead: .*'kg' cannot be converted to 'm'"),
    (("--set", "z_drive.screw_lead=10mmm"), r"z_drive\.screw_lead: .*'mmm' is not known; did you mean .*mm"),
    (("--set", "z_drive.screw_lead=long"), r"z_drive\.screw_lead: 'long' is not a number; write it like 10 or 10mm"),
    (("--set", "z_drive.screw_lead=nan"), r"z_drive\.screw_lead: 'nan' is not a number"),
    (("--set", "z_drive.screw_lead=1e999"), r"z_drive\.screw_lead: inf is not a finite number"),
    (("--set", "z_drive.detector=linear_scal"), r"z_drive\.detector: .*not a choice; did you mean linear_scale"),
    (("--set", "z_drive.detector=7"), r"z_drive\.detector: 7 is above the maximum of 2"),
    (("--set", "z_drive.detector=2mm"), r"z_drive\.detector: '2mm' has a unit"),
    (("--set", "spindle.encoder_lines=10.5"), r"spindle\.encoder_lines: 10\.5 is not a whole number"),
    (("--set", "nominal_pitch.use_threading_start=maybe"), r"'maybe' is not a Boolean; write true or false"),
    (("--set", "nominal_pitch.start_angle=1,2,3,4,5,6,7,8,9"), r"9 values for an array of 8"),
    (("--set", "controller.threading=true"), r"controller\.threading cannot be set: it is output"),
    (("--set", "z_drive"), r"'z_drive' sets nothing; write it like z_drive\.screw_lead=10mm"),
    (("--set",), r"'--set' requires an argument; see threadpitch"),
    (("nosuch",), r"nosuch: no such file; give an \.ssp, an \.ssd or a folder with SystemStructure\.ssd"),
    (("empty",), r"empty: holds no SystemStructure\.ssd; give an \.ssp, an \.ssd or a folder"),
    (("notes.txt",), r"notes\.txt: line 1: is not XML: .*; give a file with a SystemStructureDescription"),
    (("broken.ssd",), r"broken\.ssd: line 1: is not XML: .*; give a file with a SystemStructureDescription"),
    (("other.ssd",), r"other\.ssd: holds <x>, not a SystemStructureDescription of SSP"),
    (("broken",), r"broken.SystemStructure\.ssd: line 1: is not XML"),
    (("notes.ssp",), r"notes\.ssp: is not a readable ZIP archive .*; export it again"),
    (("empty.ssp",), r"empty\.ssp: holds no SystemStructure\.ssd; give an"),
    (("nosuch.ssp",), r"nosuch\.ssp: no such file"),
    (("threading_lathe", "second"), r"unexpected extra argument.*second.*; see threadpitch run --help"),
    (("--stop-time", "0"), r"the stop time of 0 s does not lie after the start at 0 s"),
    (("--stop-time", "-1"), r"the stop time of -1 s does not lie after the start at 0 s"),
    (("--stop-time", "nan"), r"'--stop-time': 'nan' is not finite; give a number"),
    (("--stop-time", "inf"), r"'--stop-time': 'inf' is not finite; give a number"),
    (("--stop-time", "long"), r"'--stop-time': 'long' is not a number; write it like 0\.5"),
    (("--step-size", "0"), r"the step size of 0 s is not positive"),
    (("--step-size", "-0.001"), r"the step size of -0\.001 s is not positive"),
    (("--step-size", "nan"), r"'--step-size': 'nan' is not finite"),
    (("--step-size", "3"), r"the step size of 3 s does not divide the time from 0 to 4 s; stop at 3 or 6 s, or "),
    (("--step-size", "0.2"), r"controller.*more than 64 control periods in one .*step: choose a smaller step size"),
    (("--step-size", "1e-12"), r"rows of \d+ variables do not fit into the memory; record fewer variables"),
    (("--flavor", "fortran"), r"flavor 'fortran' is not known; choose one of python"),
    (("--colour",), r"[Nn]o such option: --colour.*; see threadpitch run --help"),
    (("--start-angle",), r"'--start-angle' requires an argument; see threadpitch"),
    (("--start-angle", "right"), r"'--start-angle': 'right' is not a number; write it like"),
    (("--start-angle", "nan"), r"'--start-angle': 'nan' is not finite"),
    (("--start-angle", "0", "inf"), r"'--start-angle': 'inf' is not finite"),
    (("--start-angle", "361"), r"start angle 361 degrees is more than a turn; give angles from -360 to 360"),
    (("--start-angle", *"012345678"), r"9 start angles; a pitch calculator takes 1 to 8"),
    (("--parameters", "nosuch.toml"), r"nosuch\.toml: no such file; give an \.ssv, \.toml or \.json"),
    (("--parameters", "empty"), r"empty: is not a parameter file; give an \.ssv, \.toml or \.json"),
    (("--parameters", "notes.txt"), r"notes\.txt: is not a parameter file; give an \.ssv, \.toml or \.json"),
    (("--parameters", "broken.toml"), r"broken\.toml: is not TOML: .*line 1"),
    (("--parameters", "broken.json"), r"broken\.json: is not JSON: .*line 1"),
    (("--parameters", "broken.ssv"), r"broken\.ssv: line 1: is not XML"),
    (("--parameters", "wrong.toml"), r"no component 'axis'; known are spindle"),
    (("--output", "notes.txt"), r"notes\.txt is not a folder; choose another folder with --output"),
    (("--output", "notes.txt/run"), r"notes\.txt is not a folder; choose another folder with --output"),
]
FILES_OF_FAULTS = {"notes.txt": "hello\n", "notes.ssp": "hello\n", "broken.ssd": "<x", "other.ssd": "<x/>",
                   "broken/SystemStructure.ssd": "<x", "broken.ssv": "<x", "broken.toml": "x = ?\n",
                   "broken.json": "{?", "wrong.toml": "axis.gain = 1\n"}


@pytest.mark.parametrize(("arguments", "message"), BAD_INPUT, ids=[" ".join(row[0]) for row in BAD_INPUT])
def test_bad_input(threadpitch: Command, workplace: Path, arguments: tuple[str, ...], message: str) -> None:
    (workplace / "empty").mkdir()
    zipfile.ZipFile(workplace / "empty.ssp", "w").close()
    for name, text in FILES_OF_FAULTS.items():
        (workplace / name).parent.mkdir(exist_ok=True)
        (workplace / name).write_text(text, encoding="utf-8")
    before = sorted(workplace.rglob("*"))
    outcome = threadpitch("run", *arguments)
    assert (outcome.status, outcome.out) == (2, "")
    assert_one_line(outcome.err, message)
    assert len(outcome.err) < 600
    assert sorted(workplace.rglob("*")) == before


@pytest.mark.parametrize(("arguments", "message"), [
    (("nosuch.py",), r"nosuch\.py: .*No such file.*; give the path of a \.py file"),
    (("notes.py",), r"notes\.py: a model file holds one dataclass"),
    (("--fmi", "1"), r"FMI 1 is not known; choose 2 or 3"),
    (("--fmi", "two"), r"'--fmi': .*; see threadpitch build --help"),
    (("--flavor", "fortran"), r"flavor 'fortran' is not known; choose one of python"),
    (("--output", "notes.py"), r"notes\.py is not a folder; choose another folder with --output"),
])
def test_bad_input_to_build(threadpitch: Command, workplace: Path, arguments: tuple[str, ...], message: str) -> None:
    (workplace / "notes.py").write_text("hello = 1\n", encoding="utf-8")
    outcome = threadpitch("build", *arguments)
    assert (outcome.status, outcome.out) == (2, "")
    assert_one_line(outcome.err, message)
    assert list(workplace.rglob("*.fmu")) == []


def test_an_output_that_cannot_be_written_is_told_before_the_run(
        threadpitch: Command, workplace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (workplace / "file").touch()
    monkeypatch.setattr(lathe, "simulate", lambda *_, **__: pytest.fail("simulated in vain"))
    assert threadpitch("run", "--output", "file").status == 2


@pytest.mark.parametrize("command", ["run", "analyze", "build"])
@pytest.mark.parametrize("width", ["60", "80", "200"])
def test_help(threadpitch: Command, monkeypatch: pytest.MonkeyPatch, command: str, width: str) -> None:
    monkeypatch.setenv("COLUMNS", width)
    outcome = threadpitch(command, "--help")
    assert (outcome.status, outcome.err) == (0, "")
    assert max(map(len, outcome.out.splitlines())) <= int(width)
    text = " ".join(re.sub(r"[│╭╮╰╯─]", " ", outcome.out).split())
    assert f"Usage: threadpitch {command} [OPTIONS]" in text
    if width == "200":
        assert "[default: " in text
        expected = {"run": ["[default: models/threading_lathe]", "DEG ...", "in degrees", "in s.", "10mm",
                            "(of the system)"],
                    "analyze": ["rev|deg|rad|count", "[default: linear]", "mm|m|um|inch",
                                "(of the header, else what the samples tell, else rev)", "(by its name)"],
                    "build": ["[default: 2]", "[default: fmus]"]}
        for part in expected[command]:
            assert part in text


def test_the_program_itself(threadpitch: Command) -> None:
    assert threadpitch("--version") == (0, f"threadpitch {__version__}\n", "")
    assert threadpitch("--help").status == threadpitch("-h").status == threadpitch("run", "-h").status == 0
    bare = threadpitch()
    assert bare.status == 2
    assert_one_line(bare.err, r"a command is missing; see threadpitch --help")
    unknown = threadpitch("simulate")
    assert (unknown.status, unknown.out) == (2, "")
    assert_one_line(unknown.err, r"[Nn]o such command 'simulate'; see threadpitch --help")
