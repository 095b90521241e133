"""C to shared libraries: by the system's compiler for this machine, or by ``ziglang`` for every platform.

The flags keep IEEE arithmetic, so that a native FMU calculates the bits that Python does: no contraction of
``a * b + c``, no fast-math. Equal sources give equal bytes: fixed names, no paths, no times.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from threadpitch.fmu.cache import cache_folder, write_folder
from threadpitch.fmu.failure import BuildError

NO_CONTRACTION = "-ffp-contract=off"
FLAGS = ("-std=gnu99", "-O3", "-fPIC", "-shared", "-fvisibility=hidden", NO_CONTRACTION, "-fno-fast-math",
         "-fno-math-errno", "-w")
_SYSTEM_COMPILERS = ("gcc", "clang", "cc")
_ZIG = "ziglang"
NO_COMPILER = ("no C compiler was found; install one (gcc or clang, or name it in the environment variable CC), "
               "or install ziglang: pip install 'threadpitch[native]'")


@dataclass(frozen=True)
class Platform:
    """A platform as FMI 3.0 names it, with FMI 2.0's folder (None: it has none) and zig's name of the target."""

    name: str
    folder2: str | None
    target: str
    suffix: str


# glibc 2.17 runs on every Linux since 2013, but was first for aarch64 too
PLATFORMS = {one.name: one for one in (
    Platform("x86_64-linux", "linux64", "x86_64-linux-gnu.2.17", ".so"),
    Platform("aarch64-linux", None, "aarch64-linux-gnu.2.17", ".so"),
    Platform("x86_64-windows", "win64", "x86_64-windows-gnu", ".dll"),
    Platform("x86_64-darwin", "darwin64", "x86_64-macos", ".dylib"),
    Platform("aarch64-darwin", None, "aarch64-macos", ".dylib"),
)}
_SHORT_NAMES = {one.folder2: one.name for one in PLATFORMS.values() if one.folder2 is not None} | {
    "linux-arm64": "aarch64-linux", "darwin-arm64": "aarch64-darwin"}


@dataclass(frozen=True)
class Compiler:
    """How one platform's library is made: the command before the flags, and its version."""

    command: tuple[str, ...]
    version: str
    flags: tuple[str, ...] = ()

    @property
    def is_zig(self) -> bool:
        """Whether it is ``ziglang``, which links its own C runtime."""
        return self.command[1:3] == ("-m", _ZIG)


def platform_named(name: str) -> Platform:
    """The platform of this name: FMI 3.0's (``x86_64-linux``) or a short one (``linux64``, ``linux-arm64``).

    Raises:
        BuildError: the name is not known.
    """
    known = PLATFORMS.get(_SHORT_NAMES.get(name, name))
    if known is None:
        raise BuildError(f"platform {name!r} is not known; choose from {', '.join((*_SHORT_NAMES, *PLATFORMS))}")
    return known


def this_platform() -> Platform:
    """The platform of this machine.

    Raises:
        BuildError: there are no native FMUs for it.
    """
    machine = {"amd64": "x86_64", "x86_64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}
    system = {"linux": "linux", "darwin": "darwin", "win32": "windows"}
    name = f"{machine.get(platform.machine().lower(), platform.machine())}-{system.get(sys.platform, sys.platform)}"
    if name not in PLATFORMS:
        raise BuildError(f"this machine is {name}; native FMUs are built for {', '.join(PLATFORMS)}, "
                         "use --flavor python")
    return PLATFORMS[name]


def available_compiler() -> str | None:
    """The C compiler that builds for this machine: the system's (``CC``, gcc, clang, cc), or ``ziglang``, or None.

    Raises:
        BuildError: ``CC`` names one that is not there.
    """
    system = _system_command()
    if system is not None:
        return shlex.join(system)
    return _ZIG if importlib.util.find_spec(_ZIG) is not None else None


def compilers(platforms: Sequence[Platform] | None) -> dict[Platform, Compiler]:
    """The compiler of every platform; None stands for this machine alone.

    For this machine alone the system's compiler comes first, as it is there and quick. For platforms by name it is
    zig where it is installed: its libraries run on older systems than this one.

    Raises:
        BuildError: there is no compiler for one of them.
    """
    if platforms is None:
        here = this_platform()
        compiler = _system() or _zig(here)
        if compiler is None:
            raise BuildError(NO_COMPILER)
        return {here: compiler}
    found = {}
    for one in platforms:
        compiler = _zig(one)
        if compiler is None and one.name == this_platform().name:
            compiler = _system()
        if compiler is None:
            raise BuildError(f"no compiler for {one.name} was found; install ziglang: pip install "
                             "'threadpitch[native]'" + ("" if _system_command() else
                                                        ", or for this machine gcc or clang"))
        found[one] = compiler
    return found


def compile_library(name: str, sources: Mapping[str, bytes], target: Platform, compiler: Compiler) -> bytes:
    """The shared library ``name`` of these sources (all ``.c`` among them are compiled), as bytes.

    Raises:
        BuildError: the compiler refuses the sources, or cannot be run.
        OSError: the cache cannot be written.
    """
    digest = hashlib.sha256(b"\0".join(part for file in sorted(sources) for part in (file.encode(), sources[file])))
    # zig finds what it has compiled before only when it runs in the same folder, and names go into what it writes
    folder = zig_cache() / "sources"
    inside = f"{name}_{digest.hexdigest()[:16]}"
    write_folder(folder / inside, sources)
    files = [f"{inside}/{file}" for file in sorted(sources) if file.endswith(".c")]
    with tempfile.TemporaryDirectory(prefix="threadpitch-") as temporary:
        library = Path(temporary) / f"{name}{target.suffix}"
        command = [*compiler.command, *FLAGS, *compiler.flags, *_platform_flags(target, name),
                   f"-ffile-prefix-map={inside}=sources", f"-I{inside}", *files, "-lm", "-o", str(library)]
        try:
            done = subprocess.run(command, cwd=folder, env=_environment(), capture_output=True, text=True,
                                  errors="replace", check=False)
        except OSError as error:
            raise BuildError(f"the C compiler {compiler.command[0]} cannot be run ({error.strerror}); "
                             "name another in the environment variable CC") from error
        if done.returncode != 0 or not library.is_file():
            raise BuildError(f"{' '.join(compiler.command)} does not compile {name} for {target.name}: "
                             f"{_first_error(done.stderr)}; try another compiler (environment variable CC, or pip "
                             "install 'threadpitch[native]')")
        return library.read_bytes()


def zig_cache() -> Path:
    """Where zig keeps the C runtimes that it has compiled: ``ZIG_GLOBAL_CACHE_DIR``, or in the cache folder."""
    chosen = os.environ.get("ZIG_GLOBAL_CACHE_DIR")
    return Path(chosen) if chosen else cache_folder() / "zig"


def _platform_flags(target: Platform, name: str) -> tuple[str, ...]:
    if target.suffix == ".so":
        return "-Wl,--build-id=none", "-s", "-Wl,-z,defs"
    if target.suffix == ".dylib":
        return (f"-Wl,-install_name,@rpath/{name}.dylib",)
    return ("-s",)


def _environment() -> dict[str, str]:
    own = str(zig_cache())
    # compilers that write a time write this one
    return dict(os.environ) | {"ZIG_GLOBAL_CACHE_DIR": own, "ZIG_LOCAL_CACHE_DIR": own, "LC_ALL": "C",
                               "SOURCE_DATE_EPOCH": "0"}


def _system_command() -> list[str] | None:
    named = os.environ.get("CC", "")
    try:
        chosen = shlex.split(named)
    except ValueError as error:
        raise BuildError(f"the environment variable CC is {named!r}, which is no command ({error}); mend or unset it"
                         ) from error
    for command in [chosen] if chosen else [[name] for name in _SYSTEM_COMPILERS]:
        path = shutil.which(command[0])
        if path is not None:
            return [path, *command[1:]]
    if chosen:
        raise BuildError(f"the environment variable CC names the C compiler {chosen[0]}, which is not found; "
                         "mend or unset it")
    return None


def _system() -> Compiler | None:
    command = _system_command()
    if command is None:
        return None
    try:
        return Compiler(tuple(command), _version(tuple(command), Path(command[0]).stat().st_mtime_ns))
    except OSError as error:
        raise BuildError(f"the C compiler {command[0]} cannot be run ({error.strerror}); "
                         "name another in the environment variable CC") from error


@functools.lru_cache(maxsize=16)
def _version(command: tuple[str, ...], _changed: int) -> str:
    """What the compiler calls itself; it is asked once, and again when its file has changed."""
    done = subprocess.run([*command, "--version"], capture_output=True, text=True, errors="replace", check=False)
    return (done.stdout.splitlines() or ["unknown version"])[0]


def _zig(target: Platform) -> Compiler | None:
    if importlib.util.find_spec(_ZIG) is None:
        return None
    return Compiler((sys.executable, "-m", _ZIG, "cc"), f"ziglang {importlib.metadata.version(_ZIG)}",
                    ("-target", target.target, "-fno-sanitize=all", "-g0"))


def _first_error(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return next((line for line in lines if "error" in line.lower()), lines[-1] if lines else "no message")
