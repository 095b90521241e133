"""The story on one page: system and parameters -> co-simulation of its FMUs -> passes with their pitch tables.

Knows what is shipped with the package (``models/``, ``fmu_src/``), builds the FMUs that a system asks for, and finds
the pitches in what was recorded.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace as replaced
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from threadpitch import cosim
from threadpitch.cosim.master import Progress
from threadpitch.cosim.system import nearest
from threadpitch.cosim.values import Given
from threadpitch.cycles.moves import Hand
from threadpitch.fmu import available_compiler, cached_fmu
from threadpitch.live_turns import LiveTurn, LiveTurns
from threadpitch.passes import (
    CONTROLLER,
    FloatArray,
    Pass,
    ToolPath,
    alarm_text,
    find_passes,
    hold_text,
)
from threadpitch.pitch import PitchTable
from threadpitch.replacement import replacements
from threadpitch.roles import X_DRIVE, Z_DRIVE, Roles
from threadpitch.units import from_si

DEFAULT_SYSTEM = "models/threading_lathe"
NOMINAL = "nominal_pitch"  # names in the lathe's SSD
ACTUAL = "actual_pitch"
ANGLES = 8  # start angles of a PitchCalculator


class LatheError(ValueError):
    """The simulation cannot answer the question that was asked; the message tells why and how to mend it."""


class Simulation(Mapping[str, cosim.block.Column]):
    """What a simulated lathe leaves: recorded variables by name, and the passes that were cut.

    ``result["nominal_pitch.pitch[1]"]`` and ``result.time`` are (steps + 1,), the first row after initialisation.
    """

    def __init__(self, result: cosim.Result, flavor: str) -> None:
        self.result = result
        self.flavor = flavor
        self.steps = result.steps
        self.wall_time = result.wall_time
        self._turning = result if result.watched is None else result.watched  # rows in which turns end, or all
        self._numbers: tuple[int, ...] = ()
        self._final: frozenset[int] = frozenset()
        self._hands: tuple[Hand | None, ...] = ()
        self._largest_lead: float | None = None

    def numbered(self, numbers: Sequence[int], final: Iterable[int], hands: Sequence[Hand | None] = (),
                 largest_lead: float | None = None) -> Simulation:
        """The same, its passes with a program's numbers and hands; those numbered ``final`` make the final flanks.

        ``largest_lead`` (m per turn along Z) is that of all blocks, where it is not the controller's first.
        """
        other = Simulation(self.result, self.flavor)
        other._numbers, other._final = tuple(numbers), frozenset(final)
        other._hands = tuple(hands) or (None,) * len(numbers)
        other._largest_lead = largest_lead
        return other

    def parameter(self, name: str) -> float | None:
        """A parameter of the control or the Z drive; None where the system does not have it."""
        return float(self._turning[name][0]) if name in self._turning else None

    @property
    def begun_passes(self) -> int:
        """How many passes began, a last one without a whole turn too."""
        return int(np.count_nonzero(np.diff(self._threading().astype(np.int8), prepend=np.int8(0)) > 0))

    @property
    def alarm(self) -> str:
        """The alarm that stopped the controller, when, and how to mend it; empty where there was none."""
        return alarm_text(self._turning, self._turning.time)

    @property
    def time(self) -> FloatArray:
        """Communication points, (rows,) s."""
        return self.result.time

    @property
    def simulated(self) -> float:
        """The time that was computed, s."""
        schedule = self.result.schedule
        return round(schedule.time(self.steps) - schedule.start_time, 12)

    def __getitem__(self, name: str) -> cosim.block.Column:
        return self.result[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.result)

    def __len__(self) -> int:
        return len(self.result)

    def __repr__(self) -> str:
        return f"<Simulation: {len(self.passes)} passes, {self.result!r}>"

    @property
    def calculators(self) -> tuple[str, ...]:
        """The components that calculate pitches, by their variables; the nominal one first where there is one."""
        mark = ".completed_pitch[1]"
        names = [name.removesuffix(mark) for name in self._turning if name.endswith(mark)]
        return tuple(sorted(names, key=lambda name: name != NOMINAL))

    @functools.cached_property
    def passes(self) -> tuple[Pass, ...]:
        """The passes as the first calculator saw them: of the lathe, the nominal pitches."""
        return self.passes_of(self.calculators[0]) if self.calculators else ()

    def passes_of(self, calculator: str) -> tuple[Pass, ...]:
        """The passes as this calculator saw them.

        Raises:
            LatheError: there is no such calculator.
        """
        if calculator not in self.calculators:
            raise LatheError(f"component {calculator!r} calculates no pitches{nearest(calculator, self.calculators)}")
        found = find_passes(self._turning, calculator, self._threading(), self._turning.time)
        if not self._numbers:
            return found
        told = [(one, one.number - 1) for one in found]
        return tuple(replaced(one, number=self._numbers[k], hand=self._hands[k],
                              final_flank=self._numbers[k] in self._final) for one, k in told)

    def beside(self, one: Pass) -> dict[str, Pass]:
        """One of ``passes`` as the other calculators saw it, by their names: of the lathe, the actual pitches."""
        return {name: found[one.number] for name, found in self._others.items() if one.number in found}

    @functools.cached_property
    def _others(self) -> dict[str, dict[int, Pass]]:
        return {name: {found.number: found for found in self.passes_of(name)} for name in self.calculators[1:]}

    def axis_too_slow(self) -> str:
        """What to say where lead x speed is more than the Z axis does; nothing where it is not, or not told."""
        names = [f"{CONTROLLER}.lead", f"{CONTROLLER}.commanded_speed", f"{Z_DRIVE}.speed_limit"]
        if not all(name in self._turning for name in names):
            return ""
        lead, speed, limit = (float(self._turning[name][0]) for name in names)
        lead = lead if self._largest_lead is None else self._largest_lead
        if lead * speed / (2.0 * math.pi) <= limit:
            return ""
        return (f"{from_si(lead, 'mm'):.6g} mm a turn at {from_si(speed, 'rpm'):.6g} rpm is more than the Z axis does; "
                f"turn at most {from_si(2.0 * math.pi * limit / lead, 'rpm'):.0f} rpm")

    @property
    def tool_path(self) -> ToolPath:
        """Where the tool truly was, after the errors of both drives.

        Raises:
            LatheError: the system has no drive for one of the axes.
        """
        names = [f"{Z_DRIVE}.position", f"{X_DRIVE}.position", f"{CONTROLLER}.threading"]
        missing = [name for name in names if name not in self.result]
        if missing:
            raise LatheError(f"the system has no {missing[0]}, so that there is no tool path; take one with the "
                             f"components {Z_DRIVE}, {X_DRIVE} and {CONTROLLER}")
        z, x, threading = (np.asarray(self.result[name]) for name in names)
        return ToolPath(self.time, z.astype(np.float64), x.astype(np.float64), threading.astype(np.bool_))

    @property
    def pitch_table(self) -> PitchTable:
        """P(n) of the first pass.

        Raises:
            LatheError: no turn was completed.
        """
        if not self.passes:
            raise LatheError(self.why_no_turn())
        return self.passes[0].table

    def why_no_turn(self) -> str:
        """Why no pitch was found, in one line."""
        if not self.calculators:
            return "no component of this system calculates pitches; add a PitchCalculator to it"
        threading = self._threading()
        stop = self.result.schedule.time(self.steps)
        if not threading.any():
            mend = self.alarm or hold_text(self.result) or self._why_not_at_speed() or "choose a longer stop time"
            return f"no threading until the stop at {stop:g} s; {mend}"
        began = float(self._turning.time[int(np.argmax(threading))])
        return (f"no whole turn until the stop at {stop:g} s: threading began at {began:g} s; "
                f"{self.alarm or 'choose a longer stop time'}")

    def _why_not_at_speed(self) -> str:
        """What to say where the spindle has not come near its commanded speed; nothing where it has."""
        names = [f"{CONTROLLER}.spindle_speed", f"{CONTROLLER}.spindle_speed_command"]
        if not all(name in self.result for name in names):
            return ""
        reached, commanded = (float(np.max(self.result[name])) for name in names)
        if reached >= 0.95 * commanded:
            return ""
        return (f"the spindle reached {from_si(reached, 'rpm'):.0f} of {from_si(commanded, 'rpm'):.0f} rpm; choose a "
                "longer stop time or a lower controller.commanded_speed (without a unit it is rad/s)")

    def _threading(self) -> NDArray[np.bool_]:
        """(rows,) whether the first calculator's input said threading."""
        return np.asarray(self._turning[f"{self.calculators[0]}.threading"], dtype=np.bool_)


def simulate(system: str | Path = DEFAULT_SYSTEM, *, parameters: Mapping[str, Given] | None = None,
             start_angles: Sequence[float] | None = None, stop_time: float | None = None,
             step_size: float | None = None, flavor: str | None = None,
             replace: Mapping[str, str | Path] | None = None, record: Iterable[str] | None = None,
             record_every: int = 1, record_on: Iterable[str] = (), results: str | Path | None = None,
             checkpoint: str | Path | None = None, checkpoint_every: float = 60.0, method: cosim.Method | None = None,
             isolate: bool | Iterable[str] = False, progress: Progress | None = None,
             turned: Callable[[list[LiveTurn]], None] | None = None) -> Simulation:
    """Simulate a lathe: a folder with SystemStructure.ssd, an .ssd or an .ssp, or a shipped one such as the default.

    ``parameters`` maps ``component.variable`` to a number (SI), a truth value or a text with a unit ("10mm").
    ``start_angles`` (start_angles,) rad, up to 8, go to every pitch calculator. Times are seconds; what is None comes
    from the system. FMUs that the system names and that do not lie beside it are built from ``fmu_src``,
    in the flavor "native" or "python"; None takes native FMUs where a C compiler is found. ``replace`` names by
    component another .fmu, or a model file (.py), which is built. What is recorded (default:
    all outputs and what the passes are found by), where it goes, checkpoints, method and isolation are those of
    ``cosim.simulate``; the passes are found whatever is recorded. ``turned`` hears of revolutions while the simulation
    runs, several times a second.

    Raises:
        LatheError: too many start angles.
        cosim.CosimError: the system, a value or a time is wrong, or a component fails.
        fmu.BuildError: an FMU cannot be built in this flavor.
    """
    check_start_angles(start_angles)
    flavor = choose_flavor(flavor)
    chosen_fmus = replacements(replace or {}, flavor)
    with cosim.read_system(find_system(system), locate=functools.partial(locate_fmu, flavor),
                           replace=chosen_fmus) as structure, cosim.prepare(structure) as plan:
        roles = Roles.of(plan)
        watch = roles.watch if turned is None else \
            replaced(roles.watch, look=LiveTurns(roles.calculators, turned))
        chosen = roles.parameters(parameters or {}, start_angles)
        wanted = ("outputs", *watch.record, *watch.on) if record is None else record
        result = cosim.simulate(plan, parameters=chosen, stop_time=stop_time, step_size=step_size, record=wanted,
                                record_every=record_every, record_on=record_on, watch=watch, results=results,
                                checkpoint=checkpoint, checkpoint_every=checkpoint_every, method=method,
                                isolate=isolate,
                                progress=progress, about={
                                    "flavor": flavor, "replace": {name: str(path.absolute()) for name, path
                                                                  in chosen_fmus.items()}})
    return Simulation(result, flavor)


def resume(checkpoint: str | Path, *, stop_time: float | None = None, progress: Progress | None = None,
           turned: Callable[[list[LiveTurn]], None] | None = None) -> Simulation:
    """Go on with a simulation from the checkpoint that it wrote, to the same bits as if it had never ended.

    ``stop_time`` may be later than that of the simulation. ``turned`` hears of revolutions as with ``simulate``, of
    those before the checkpoint too.

    Raises:
        cosim.CosimError: the file is no checkpoint, the system or its FMUs have changed, or a component fails.
    """
    metadata = cosim.read_checkpoint(checkpoint).metadata
    flavor = choose_flavor(metadata["about"].get("flavor"))
    with cosim.read_system(metadata["system"] or "", locate=functools.partial(locate_fmu, flavor),
                           replace=metadata["about"].get("replace")) as structure, cosim.prepare(structure) as plan:
        look = None if turned is None else LiveTurns(Roles.of(plan).calculators, turned)
        result = cosim.resume(checkpoint, system=plan, stop_time=stop_time, progress=progress, look=look)
    return Simulation(result, flavor)


def choose_flavor(flavor: str | None = None) -> str:
    """The flavor itself; None is "native" where a C compiler (or ziglang) is found, else "python"."""
    return flavor or ("python" if available_compiler() is None else "native")


def check_start_angles(start_angles: Sequence[float] | None) -> None:
    """Refuse more start angles than a calculator takes.

    Raises:
        LatheError: there are none, or too many.
    """
    if start_angles is not None and not 1 <= len(start_angles) <= ANGLES:
        raise LatheError(f"{len(start_angles)} start angles; a pitch calculator takes 1 to {ANGLES}")


def shipped(name: str) -> Path:
    """The folder ``fmu_src`` or ``models``: inside the installed package, or beside it in a checkout."""
    package = Path(__file__).parent
    return package / name if (package / name).is_dir() else package.parent / name


def find_system(system: str | Path) -> Path:
    """The path itself where it exists; else a shipped one of this name, such as ``models/threading_lathe``."""
    path = Path(system)
    if path.exists() or path.is_absolute():
        return path
    parts = path.parts[1:] if path.parts[:1] == ("models",) else path.parts
    candidate = shipped("models").joinpath(*parts) if parts else path
    return candidate if candidate.exists() and ".." not in parts else path


def model_file(class_name: str) -> Path:
    """``fmu_src/feed_drive.py`` for ``FeedDrive``."""
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", class_name).lower()
    return shipped("fmu_src") / f"{words}.py"


def model_files() -> list[Path]:
    """The shipped models, in the order of their names."""
    return sorted(path for path in shipped("fmu_src").glob("*.py") if not path.name.startswith("_"))


def locate_fmu(flavor: str, source: str, base: Path, platforms: Sequence[str] | None = None) -> Path:
    """The FMU beside the system where there is one, else the one of this name built from ``fmu_src``.

    Raises:
        cosim.SystemStructureError: there is neither.
    """
    path = base / source
    if path.is_file():
        return path
    model = model_file(path.stem)
    if path.suffix == ".fmu" and model.is_file():
        return cached_fmu(model, flavor, platforms=platforms)
    known = ["".join(word.capitalize() for word in one.stem.split("_")) for one in model_files()]
    raise cosim.SystemStructureError(f"FMU {source!r} does not lie beside the SSD, and no shipped model is called "
                                     f"{path.stem!r}{nearest(path.stem, known)}")
