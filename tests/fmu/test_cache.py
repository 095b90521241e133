"""FMUs are built once for one content, in one move, and bad requests are refused."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.fmu.driving import ROOT, TEST_MODEL
from threadpitch.fmu import BuildError, build_fmu, cache_folder, cached_fmu
from threadpitch.fmu.archive import write_archive
from threadpitch.fmu.cache import write_folder


def test_cached_once_by_content(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("THREADPITCH_CACHE", str(tmp_path / "cache"))
    first = cached_fmu(TEST_MODEL)
    stamp = first.stat().st_mtime_ns
    assert cached_fmu(TEST_MODEL) == first
    assert first.stat().st_mtime_ns == stamp
    assert first.read_bytes() == build_fmu(TEST_MODEL, tmp_path).read_bytes()
    changed = tmp_path / TEST_MODEL.name
    changed.write_text(TEST_MODEL.read_text().replace("start=400.0", "start=500.0"))
    assert cached_fmu(changed) != first
    assert [path.name for path in first.parent.iterdir()] == ["DampedMass.fmu"]


def test_two_processes_may_build_at_once(tmp_path: Path) -> None:
    code = f"from threadpitch.fmu import cached_fmu; print(cached_fmu({str(TEST_MODEL)!r}))"
    environment = os.environ | {"THREADPITCH_CACHE": str(tmp_path), "PYTHONPATH": str(ROOT)}
    running = [subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True)
               for _ in range(2)]
    paths = {process.communicate()[0].strip() for process in running}
    assert [process.returncode for process in running] == [0, 0]
    (path,) = paths
    assert Path(path).read_bytes() == build_fmu(TEST_MODEL, tmp_path / "again").read_bytes()


@pytest.mark.parametrize("damage", [lambda content: content[:len(content) // 2], lambda content: b"",
                                    lambda content: content.replace(content[200:240], bytes(40), 1)])
def test_a_damaged_fmu_in_the_cache_is_built_again(damage: Callable[[bytes], bytes], tmp_path: Path,
                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("THREADPITCH_CACHE", str(tmp_path))
    path = cached_fmu(TEST_MODEL)
    whole = path.read_bytes()
    path.write_bytes(damage(whole))
    assert cached_fmu(TEST_MODEL) == path
    assert path.read_bytes() == whole


def test_sources_that_were_changed_are_written_again(tmp_path: Path) -> None:
    write_folder(tmp_path / "made", {"a.c": b"good", "b.c": b"also"})
    (tmp_path / "made" / "a.c").write_bytes(b"go")
    write_folder(tmp_path / "made", {"a.c": b"good", "b.c": b"also"})
    assert (tmp_path / "made" / "a.c").read_bytes() == b"good"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no umask")
def test_the_umask_says_who_may_read_an_fmu(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        path = build_fmu(TEST_MODEL, tmp_path)
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o640


def test_cache_folder_follows_the_platform(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("THREADPITCH_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(sys, "platform", "linux")
    assert cache_folder() == tmp_path / "threadpitch"
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "local"))
    assert cache_folder() == tmp_path / "local" / "threadpitch" / "cache"


def test_unknown_flavor_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BuildError, match="flavor 'wasm' is not known; choose one of python"):
        build_fmu(TEST_MODEL, tmp_path, flavor="wasm")


def test_a_failed_write_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(TypeError):
        write_archive(tmp_path / "x.fmu", {"good": b"1", "wrong": None})  # type: ignore[dict-item]  # makes it fail
    assert list(tmp_path.iterdir()) == []
