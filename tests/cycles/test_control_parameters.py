"""The parameter set and its file: values, refusals, rewriting by several processes at once."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from threadpitch.cycles import ControlParameters, CycleError, ParameterFile, Setup, expand_cycle

BLOCKS = ["G76 P031055 Q0.07 R0.08", "G76 X18. Z-30. P1. Q.3 F2."]


def test_a_file_that_is_not_there_holds_the_start_values(tmp_path: Path) -> None:
    assert ParameterFile(tmp_path / "control.toml").read() == ControlParameters()
    assert not list(tmp_path.iterdir())


def test_execution_is_saved_across_runs(tmp_path: Path) -> None:
    file = ParameterFile(tmp_path / "deep" / "control.toml")
    result = expand_cycle(BLOCKS, Setup(parameters=file.read()))
    assert file.rewrite(result.rewritten) == result.parameters
    kept = ParameterFile(file.path).read()
    assert kept.by_number() == {"019": 10, "057": 3, "058": 55, "059": 70, "060": 80, "106": 0, "253": 0}
    later = expand_cycle(BLOCKS[1:], Setup(parameters=kept))
    assert later.passes == result.passes


def test_a_rewrite_keeps_what_another_run_wrote_meanwhile(tmp_path: Path) -> None:
    file = ParameterFile(tmp_path / "control.toml")
    file.rewrite({"106": 12.5})
    ParameterFile(file.path).rewrite({"057": 4})
    values = file.read().by_number()
    assert (values["106"], values["057"]) == (12.5, 4)


def test_nothing_to_rewrite_writes_nothing(tmp_path: Path) -> None:
    ParameterFile(tmp_path / "control.toml").rewrite({})
    assert not list(tmp_path.iterdir())


def test_two_processes_lose_no_rewrite(tmp_path: Path) -> None:
    """Each process counts its own parameter up by reading and rewriting; a lost update would leave one behind."""
    path = tmp_path / "control.toml"
    code = ("import sys; from pathlib import Path; from threadpitch.cycles.parameters import ParameterFile\n"
            "file = ParameterFile(Path(sys.argv[1]))\n"
            "for _ in range(40): file.rewrite({sys.argv[2]: file.read().by_number()[sys.argv[2]] + 1})\n")
    running = [subprocess.Popen([sys.executable, "-c", code, str(path), number], cwd=Path(__file__).parents[2])
               for number in ("019", "057")]
    assert [process.wait(timeout=60) for process in running] == [0, 0]
    values = ParameterFile(path).read().by_number()
    assert (values["019"], values["057"]) == (45, 41)
    assert not list(tmp_path.glob("*.new"))


@pytest.mark.parametrize(("text", "words"), [
    ('"057" = ', "no parameter file"), ('"999" = 1', "'999' is not known"), ('"057" = 100', "give 0 to 99"),
    ('"057" = 1.5', "whole number"), ('"057" = true', "give a number"), ('"057" = "two"', "give a number"),
    ('"060" = nan', "give a number"), ('"253" = 3', "give 0 to 2"), ("[control]\nx = 1", "'control' is not known"),
    ("a = " + "[" * 5000, "no parameter file")])
def test_a_bad_file_is_refused_by_name(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "control.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(CycleError) as caught:
        ParameterFile(path).read()
    assert str(caught.value).startswith(str(path))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_refused_rewrite_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    file = ParameterFile(tmp_path / "control.toml")
    file.rewrite({"057": 2})
    before = file.path.read_bytes()
    with pytest.raises(CycleError, match="give 0 to 99"):
        file.rewrite({"057": 100})
    assert file.path.read_bytes() == before


def test_a_rewrite_keeps_mode_and_link_of_the_file(tmp_path: Path) -> None:
    file = ParameterFile(tmp_path / "control.toml")
    file.rewrite({"057": 2})
    file.path.chmod(0o664)
    link = tmp_path / "link.toml"
    link.symlink_to(file.path)
    ParameterFile(link).rewrite({"057": 5})
    assert stat.S_IMODE(file.path.stat().st_mode) == 0o664
    assert link.is_symlink()
    assert file.read().finishing_passes == 5


def test_what_a_killed_run_left_is_taken_over(tmp_path: Path) -> None:
    file = ParameterFile(tmp_path / "control.toml")
    file.rewrite({"057": 2})
    (tmp_path / "control.toml.new").write_text('"057" = ', encoding="utf-8")
    file.rewrite({"058": 55})
    assert (file.read().finishing_passes, file.read().tool_angle_deg) == (2, 55)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["control.toml", "control.toml.lock"]


def test_a_read_only_file_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = ParameterFile(tmp_path / "control.toml")
    file.rewrite({"057": 2})
    before = file.path.read_bytes()
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)  # root may write what is read-only
    with pytest.raises(CycleError, match="is read-only"):
        file.rewrite({"057": 3})
    assert file.path.read_bytes() == before


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(CycleError, match="choose another place"):
        ParameterFile(tmp_path / "file" / "control.toml").rewrite({"057": 2})
