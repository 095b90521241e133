"""Building native FMUs: equal bytes, one build for two processes, platforms, exports, sources, and refusals."""

from __future__ import annotations

import importlib.util
import os
import platform
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from fmpy.build import build_platform_binary
from fmpy.validation import validate_fmu

from tests.fmu.driving import ROOT, TABLE_MODEL, TEST_MODEL
from tests.fmu.native.building import both_versions, built, every_model, needs_compiler, zig_folder
from threadpitch.cli import invoke
from threadpitch.fmu import BuildError, available_compiler, build_fmu, cached_fmu
from threadpitch.fmu.check import check_built
from threadpitch.fmu.compiler import platform_named

needs_zig = pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="ziglang is not installed")
PLATFORMS = ["linux64", "win64", "darwin64", "aarch64-linux", "aarch64-darwin"]
LARGEST_GLIBC = (2, 17)


def _tool(name: str) -> str:
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"{name} is not installed")
    return path


def _entries(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@needs_compiler
@every_model
@both_versions
def test_validation_reports_nothing(path: Path, fmi: int) -> None:
    assert validate_fmu(str(built(path, fmi))) == []


@needs_compiler
@both_versions
def test_building_twice_gives_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fmi: int) -> None:
    monkeypatch.setenv("THREADPITCH_CACHE", str(tmp_path / "another cache"))
    again = build_fmu(TABLE_MODEL, tmp_path, "native", fmi=fmi)
    assert again.read_bytes() == built(TABLE_MODEL, fmi).read_bytes()


@needs_compiler
def test_two_processes_may_build_at_once(tmp_path: Path) -> None:
    code = f"from threadpitch.fmu import cached_fmu; print(cached_fmu({str(TEST_MODEL)!r}, 'native', fmi=3))"
    environment = os.environ | {"THREADPITCH_CACHE": str(tmp_path), "PYTHONPATH": str(ROOT)}
    running = [subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True)
               for _ in range(2)]
    paths = {process.communicate()[0].strip() for process in running}
    assert [process.returncode for process in running] == [0, 0]
    (path,) = paths
    assert Path(path).read_bytes() == built(TEST_MODEL, 3).read_bytes()


@needs_compiler
def test_the_cache_tells_versions_and_flavors_apart() -> None:
    paths = [cached_fmu(TEST_MODEL), cached_fmu(TEST_MODEL, "native"), cached_fmu(TEST_MODEL, "native", fmi=3)]
    assert len({path.parent for path in paths}) == 3
    assert [path.parent.name == "fmi3" for path in paths] == [False, False, True]
    stamp = paths[1].stat().st_mtime_ns
    assert cached_fmu(TEST_MODEL, "native") == paths[1]
    assert paths[1].stat().st_mtime_ns == stamp


@needs_compiler
@both_versions
def test_the_library_exports_the_functions_of_fmi_and_nothing_else(tmp_path: Path, fmi: int) -> None:
    nm = _tool("nm")
    if sys.platform != "linux":
        pytest.skip("nm -D reads ELF")
    (library,) = (content for name, content in _entries(built(TABLE_MODEL, fmi)).items() if name.endswith(".so"))
    (tmp_path / "library.so").write_bytes(library)
    listed = subprocess.run([nm, "-D", "--defined-only", str(tmp_path / "library.so")], capture_output=True,
                            text=True, check=True).stdout
    exported = {line.split()[-1] for line in listed.splitlines()}
    assert exported == _declared(fmi)


def _declared(fmi: int) -> set[str]:
    """The functions that the standard's header declares, without those of model exchange in FMI 2.

    FMI 2 lets a co-simulation FMU leave these out; FMI 3 does not.
    """
    header = _entries(built(TABLE_MODEL, fmi))[f"sources/fmi{fmi}Functions.h"].decode()
    names = set(re.findall(rf"FMI{fmi}_Export\s+fmi{fmi}\w+TYPE\s+(fmi{fmi}\w+);", header))
    exchange = {f"fmi2{name}" for name in (
        "EnterEventMode", "NewDiscreteStates", "EnterContinuousTimeMode", "CompletedIntegratorStep", "SetTime",
        "SetContinuousStates", "GetDerivatives", "GetEventIndicators", "GetContinuousStates",
        "GetNominalsOfContinuousStates")}
    assert len(names) > 30
    return names - exchange


@needs_compiler
def test_nothing_of_this_machine_is_in_the_library() -> None:
    for fmi in (2, 3):
        for name, content in _entries(built(TEST_MODEL, fmi)).items():
            assert str(ROOT).encode() not in content, name
            assert str(Path.home()).encode() + b"/" not in content, name


@needs_compiler
@both_versions
def test_archive_holds_what_an_fmu_needs(fmi: int) -> None:
    entries = _entries(built(TABLE_MODEL, fmi))
    for name in ("fmpy", "pyccel", "threadpitch"):
        assert len(entries[f"documentation/licenses/{name}-LICENSE.txt"]) > 500
    wanted = {"modelDescription.xml", "documentation/index.html", "documentation/upgrade.html", "sources/equations.c",
              "sources/model.c", "documentation/reference/RotaryTable_in.csv",
              "documentation/reference/RotaryTable_ref.csv"}
    wanted |= {"model.png"} if fmi == 2 else {"terminalsAndIcons/icon.png", "sources/buildDescription.xml",
                                              "terminalsAndIcons/terminalsAndIcons.xml"}
    assert wanted <= entries.keys()
    assert not any(name.startswith(f"sources/fmi{5 - fmi}") for name in entries)


@needs_compiler
@both_versions
def test_fmpy_compiles_the_sources_and_the_results_are_equal(tmp_path: Path, fmi: int) -> None:
    missing = [name for name in ("cmake", "make", "cc", "c++") if shutil.which(name) is None]
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")
    folder = tmp_path / "unpacked"
    with zipfile.ZipFile(built(TEST_MODEL, fmi)) as archive:
        archive.extractall(folder)
    shutil.rmtree(folder / "binaries")
    (tmp_path / "build").mkdir()
    build_platform_binary(folder, tmp_path / "build")
    packed = shutil.make_archive(str(tmp_path / "compiled"), "zip", folder)
    assert check_built(packed) == []


@needs_compiler
def test_an_importer_that_compiles_is_told_not_to_contract_and_does_not(tmp_path: Path) -> None:
    entries = _entries(built(TEST_MODEL, 3))
    assert b'compilerOptions="-ffp-contract=off"' in entries["sources/buildDescription.xml"]
    if platform.machine() != "x86_64" or shutil.which("gcc") is None:
        pytest.skip("no gcc for x86_64")
    for name, content in entries.items():
        if name.startswith("sources/"):
            (tmp_path / Path(name).name).write_bytes(content)
    subprocess.run(["gcc", "-std=gnu99", "-O3", "-mfma", "-ffp-contract=fast", "-S", "equations.c"], cwd=tmp_path,
                   check=True)
    made = (tmp_path / "equations.s").read_text()
    assert "mulsd" in made
    assert "vfm" not in made


@needs_zig
def test_one_fmu_for_every_platform(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ZIG_GLOBAL_CACHE_DIR", str(zig_folder()))
    path = build_fmu(TABLE_MODEL, tmp_path, "native", fmi=3, platforms=PLATFORMS)
    assert build_fmu(TABLE_MODEL, tmp_path / "again", "native", fmi=3, platforms=PLATFORMS).read_bytes() \
        == path.read_bytes()
    binaries = {name: content for name, content in _entries(path).items() if name.startswith("binaries/")}
    assert {name: content[:4] for name, content in binaries.items()} == {
        "binaries/x86_64-linux/RotaryTable.so": b"\x7fELF", "binaries/aarch64-linux/RotaryTable.so": b"\x7fELF",
        "binaries/x86_64-windows/RotaryTable.dll": b"MZ\x78\x00",
        "binaries/x86_64-darwin/RotaryTable.dylib": b"\xcf\xfa\xed\xfe",
        "binaries/aarch64-darwin/RotaryTable.dylib": b"\xcf\xfa\xed\xfe"}
    for name, content in binaries.items():
        for function in _declared(3):
            assert function.encode() in content, (name, function)
    assert check_built(path) == []
    for name in ("ziglang-LICENSE.txt", "mingw-w64-COPYING.txt", "glibc-LICENSES.txt"):
        assert len(_entries(path)[f"documentation/licenses/{name}"]) > 1000
    for name in ("binaries/x86_64-linux/RotaryTable.so", "binaries/aarch64-linux/RotaryTable.so"):
        needed = [tuple(int(part) for part in found.split(b"."))
                  for found in re.findall(rb"GLIBC_([0-9.]+)", binaries[name])]
        assert needed
        assert max(needed) <= LARGEST_GLIBC
    (tmp_path / "RotaryTable.dll").write_bytes(binaries["binaries/x86_64-windows/RotaryTable.dll"])
    listed = subprocess.run([_tool("objdump"), "-p", str(tmp_path / "RotaryTable.dll")], capture_output=True,
                            text=True, check=True).stdout
    assert set(re.findall(r"\] (?:\+base\[\s*\d+\]\s+\w+ )?(fmi3\w+)", listed)) == _declared(3)


@needs_compiler
def test_platforms_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(BuildError, match=r"FMI 2\.0 has no folder for aarch64-linux; build it with --fmi 3"):
        build_fmu(TEST_MODEL, tmp_path, "native", platforms=["aarch64-linux"])
    with pytest.raises(BuildError, match="platform 'beos' is not known; choose from linux64, win64"):
        build_fmu(TEST_MODEL, tmp_path, "native", platforms=["beos"])
    with pytest.raises(BuildError, match="FMI 1 is not known; choose 2 or 3"):
        build_fmu(TEST_MODEL, tmp_path, "native", fmi=1)
    with pytest.raises(BuildError, match=r"PythonFMU makes FMUs of FMI 2\.0, not 3\.0"):
        build_fmu(TEST_MODEL, tmp_path, fmi=3)
    with pytest.raises(BuildError, match="leave --platform out"):
        build_fmu(TEST_MODEL, tmp_path, platforms=["linux64"])
    assert not list(tmp_path.iterdir())
    assert platform_named("win64") == platform_named("x86_64-windows")


def test_platforms_of_the_readme_are_known() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    names = {name for named in re.findall(r"`--platform ([^`]*)`", text) for name in named.split()}
    assert names >= {"linux64", "win64", "darwin64", "linux-arm64", "darwin-arm64"}
    assert len({platform_named(name).name for name in names}) == 5


def test_a_compiler_that_is_named_and_not_there_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for named, message in (("/nowhere/gcc -m64", "CC names the C compiler /nowhere/gcc, which is not found; mend or"),
                           ("gcc '", r"CC is \"gcc '\", which is no command \(No closing quotation\); mend or unset")):
        monkeypatch.setenv("CC", named)
        with pytest.raises(BuildError, match=message):
            available_compiler()
        with pytest.raises(BuildError, match=message):
            build_fmu(TEST_MODEL, tmp_path, "native")
    assert build_fmu(TEST_MODEL, tmp_path, "python").is_file()


class TestWithoutCompiler:
    @pytest.fixture(autouse=True)
    def nothing(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        """No compiler on the path, and no ziglang."""
        monkeypatch.setenv("PATH", str(tmp_path))
        monkeypatch.delenv("CC", raising=False)
        find_spec = importlib.util.find_spec
        monkeypatch.setattr(importlib.util, "find_spec",
                            lambda name, *more: None if name == "ziglang" else find_spec(name, *more))

    def test_the_message_names_both_ways_out(self, tmp_path: Path) -> None:
        assert available_compiler() is None
        with pytest.raises(BuildError, match=r"install one \(gcc or clang.*or install ziglang: pip install"):
            build_fmu(TEST_MODEL, tmp_path, "native")
        with pytest.raises(BuildError, match="no compiler for x86_64-windows was found; install ziglang"):
            build_fmu(TEST_MODEL, tmp_path, "native", platforms=["win64"])

    def test_the_command_says_why_it_builds_with_pythonfmu(self, tmp_path: Path,
                                                           capsys: pytest.CaptureFixture[str]) -> None:
        assert invoke(["build", str(TEST_MODEL), "--output", str(tmp_path)]) == 0
        told = capsys.readouterr().err
        assert told.startswith("threadpitch: note: the FMUs are built by PythonFMU and need Python where they run: no")
        assert invoke(["build", str(TEST_MODEL), "--output", str(tmp_path), "--flavor", "python"]) == 0
        assert capsys.readouterr().err == ""

    def test_a_broken_model_is_named_before_any_compiler_runs(self, tmp_path: Path,
                                                             monkeypatch: pytest.MonkeyPatch) -> None:
        compiler = tmp_path / "gcc"
        compiler.write_text('#!/bin/sh\n[ "$1" = --version ] && exit 0\nexec /bin/touch "$0.ran"\n')
        compiler.chmod(0o755)
        broken = tmp_path / "broken.py"
        broken.write_text(TEST_MODEL.read_text().replace("h = step_size / self.substeps",
                                                         "h = step_size ** 2 / self.substeps"))
        with pytest.raises(ValueError, match=r"broken\.py:\d+: \*\*, which rounds differently in C, cannot be in"):
            build_fmu(broken, tmp_path, "native")
        assert not (tmp_path / "gcc.ran").exists()

    def test_a_compiler_that_fails_is_quoted(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        compiler = tmp_path / "gcc"
        compiler.write_text('#!/bin/sh\n[ "$1" = --version ] && exit 0\necho "x.c:1: error: bad day" >&2\nexit 1\n')
        compiler.chmod(0o755)
        with pytest.raises(BuildError, match=r"does not compile DampedMass for .*: x\.c:1: error: bad day; try ano"):
            build_fmu(TEST_MODEL, tmp_path, "native")


@needs_zig
def test_zig_builds_where_there_is_no_other_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ZIG_GLOBAL_CACHE_DIR", str(zig_folder()))
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    assert available_compiler() == "ziglang"
    assert check_built(build_fmu(TEST_MODEL, tmp_path, "native")) == []
