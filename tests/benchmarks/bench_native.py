"""What a step of the models costs: native FMU, PythonFMU FMU, and the bare equations in a C loop.

    python -m tests.benchmarks.bench_native

All are called by one loop in C, in this process, one after the other, round by round; the shortest time of each is
taken, because other work on the machine only makes a run slower. Steps are 1 ms; with models that integrate, in
internal steps of 25 us. One input of each moves in every step. The last values of the two FMUs must be equal bit for
bit, those of FeedDrive's bare equations too.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from tests.fmu.driving import Fmu, opened, read
from threadpitch.fmu import available_compiler, build_fmu
from threadpitch.fmu.compiler import FLAGS
from threadpitch.lathe import model_files

STEP_SIZE = 1e-3  # s
INTERNAL_STEP = 25e-6  # s
ROUNDS = 40
STEPS = {"native": 1000, "python": 100}  # in a round
# The input that moves, and by how much in a step
INPUTS = {
    "FeedDrive": ("position_command", 25e-6),  # m: 25 mm/s
    "PitchCalculator": ("spindle_angle", 0.05),  # rad: 500 rpm
    "SpindleDrive": ("speed_command", 0.005),  # rad/s
    "ThreadCutting": ("spindle_angle", 0.05),
    "ThreadingController": ("spindle_angle", 0.05),
}


@dataclass(frozen=True)
class Cost:
    """Seconds of one step of a model, by what steps it."""

    model: str
    native: float
    python: float
    bare: float | None = None

    @property
    def ratio(self) -> float:
        """PythonFMU over native."""
        return self.python / self.native


class Loop:
    """The compiled loop, and FeedDrive's equations beside it."""

    def __init__(self, folder: Path) -> None:
        """``folder``: an unpacked native FMU of FeedDrive, whose sources are compiled with its own flags."""
        library = folder / "loop.so"
        sources = folder / "sources"
        command = [str(available_compiler()), *FLAGS, "-fvisibility=default", f"-I{sources}",
                   str(Path(__file__).parent / "c" / "loop.c"), str(sources / "equations.c"), "-lm", "-o", str(library)]
        subprocess.run(command, check=True)
        # not CDLL: the GIL stays held, as Python in an FMU wants it
        self.functions = ctypes.PyDLL(str(library))
        for name in ("fmu_loop", "bare_loop", "bare_position"):
            getattr(self.functions, name).restype = ctypes.c_double

    def step(self, fmu: Fmu, first: int, steps: int) -> float:
        """Seconds of so many steps of an FMU."""
        name, rise = INPUTS[fmu.model.class_name]
        dll = fmu.slave.dll
        seconds = self.functions.fmu_loop(
            dll.fmi2SetReal, dll.fmi2DoStep, ctypes.c_void_p(fmu.slave.component), fmu.by_name[name].reference,
            ctypes.c_double(rise), first, steps, ctypes.c_double(STEP_SIZE))
        assert seconds > 0.0, fmu.log
        return float(seconds)

    def step_bare(self, first: int, steps: int) -> float:
        """Seconds of so many steps of FeedDrive's equations."""
        rise = INPUTS["FeedDrive"][1]
        seconds = self.functions.bare_loop(ctypes.c_double(rise), first, steps, ctypes.c_double(STEP_SIZE))
        assert seconds > 0.0
        return float(seconds)


def measure(paths: Sequence[Path] = tuple(model_files())) -> list[Cost]:
    """The costs of these models."""
    with tempfile.TemporaryDirectory() as temporary, ExitStack() as stack:
        folder = Path(temporary)
        fmus = {(path, flavor): stack.enter_context(opened(build_fmu(path, folder / flavor, flavor), read(path)))
                for path in paths for flavor in STEPS}
        for fmu in fmus.values():
            fine = {"internal_step": INTERNAL_STEP} if "internal_step" in fmu.by_name else {}
            fmu.initialize(dict(fine))
        loop = Loop(folder / "native" / "FeedDrive")
        loop.functions.bare_begin(ctypes.c_double(INTERNAL_STEP))
        stack.callback(loop.functions.bare_end)
        return [_cost(path, fmus[path, "native"], fmus[path, "python"], loop) for path in paths]


def _cost(path: Path, native: Fmu, python: Fmu, loop: Loop) -> Cost:
    slow, quick = STEPS["python"], STEPS["native"]
    drive = path.stem == "feed_drive"
    loop.step(native, 0, slow)
    loop.step(python, 0, slow)
    assert native.everything() == python.everything(), f"{path.stem}: native and PythonFMU differ"
    seconds: dict[str, list[float]] = {"native": [], "python": [], "bare": []}
    for n in range(ROUNDS):
        first = slow + n * quick
        seconds["native"].append(loop.step(native, first, quick) / quick)
        if drive:
            if n == 0:
                loop.step_bare(0, slow)
            seconds["bare"].append(loop.step_bare(first, quick) / quick)
        if n % 4 == 0:
            seconds["python"].append(loop.step(python, slow * (1 + n // 4), slow) / slow)
    if drive:
        assert loop.functions.bare_position() == native.get("position")
    return Cost(path.stem, min(seconds["native"]), min(seconds["python"]), min(seconds["bare"]) if drive else None)


def main() -> None:
    """Prints the table."""
    table = Table(title="a step of 1 ms")
    for column in ("model", "native us", "PythonFMU us", "PythonFMU / native", "bare C us", "native / bare C"):
        table.add_column(column, justify="left" if column == "model" else "right")
    for cost in measure():
        bare = ["", ""] if cost.bare is None else [f"{cost.bare * 1e6:.2f}", f"{cost.native / cost.bare:.3f}"]
        table.add_row(cost.model, f"{cost.native * 1e6:.2f}", f"{cost.python * 1e6:.1f}", f"{cost.ratio:.0f}", *bare)
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
