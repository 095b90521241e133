"""The control's system parameters that threading uses and rewrites, and the file that keeps them.

Numbers as in the TOMATECH and GSK lists: 019, 057 to 060, 106, 253. The start values are this package's own: the
sheets print none.
"""

from __future__ import annotations

import math
import os
import shutil
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from filelock import FileLock, Timeout

from threadpitch.cycles.errors import CycleError

Number = int | float
LOCK_PATIENCE = 10.0  # s; a rewrite takes a millisecond


@dataclass(frozen=True)
class Entry:
    """One parameter of the list: number, meaning with unit, largest value (the least is 0), whether it is whole."""

    number: str
    meaning: str
    high: float
    is_whole: bool = True


ENTRIES: dict[str, Entry] = {
    "run_out_width": Entry("019", "run-out width r of G76 and G92, 0.1 x lead", 99),
    "finishing_passes": Entry("057", "finishing passes m", 99),
    "tool_angle_deg": Entry("058", "angle of the tooth a, degrees", 99),
    "least_cut_um": Entry("059", "least roughing cut dmin, radius, 0.001 mm", 2.54e6, is_whole=False),
    "allowance_um": Entry("060", "finishing allowance d, radius, 0.001 mm", 2.54e6, is_whole=False),
    "speed_fluctuation_percent": Entry(
        "106", "spindle speed fluctuation that stops threading, percent, 0 = off", 100, is_whole=False),
    "acceleration_type": Entry("253", "acceleration of threading: 0 linear, 1 S, 2 exponential", 2),
}


@dataclass(frozen=True)
class ControlParameters:
    """The parameters in the control's own units, as a screen of the control shows them; ``ENTRIES`` describes them.

    Raises:
        CycleError: a value out of its range, or a fraction where a whole number is needed.
    """

    run_out_width: Number = 5
    finishing_passes: Number = 1
    tool_angle_deg: Number = 60
    least_cut_um: Number = 50
    allowance_um: Number = 50
    speed_fluctuation_percent: Number = 0
    acceleration_type: Number = 0

    def __post_init__(self) -> None:
        for name, entry in ENTRIES.items():
            _check(entry, getattr(self, name))

    def by_number(self) -> dict[str, Number]:
        """Values by parameter number; whole values as int."""
        return {entry.number: _tidy(getattr(self, name)) for name, entry in ENTRIES.items()}

    def changed(self, values: Mapping[str, Number]) -> ControlParameters:
        """The parameters with some values, given by number, replaced.

        Raises:
            CycleError: a number that is not in the list, or a value out of its range.
        """
        names = {entry.number: name for name, entry in ENTRIES.items()}
        unknown = [number for number in values if number not in names]
        if unknown:
            raise CycleError(f"parameter {unknown[0]!r} is not known; known are {', '.join(names)}")
        mine = {name: getattr(self, name) for name in ENTRIES}
        return ControlParameters(**(mine | {names[number]: value for number, value in values.items()}))


class ParameterFile:
    """A file of parameters that several runs, processes and users share; a file that is read-only is left alone.

    TOML, one ``"number" = value`` per line. A rewrite takes the lock beside the file, reads what others wrote, changes
    the given numbers only, and puts the new file in place of the old in one step: a reader never sees half a file,
    and a run that is killed leaves the old one.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def read(self) -> ControlParameters:
        """The parameters of the file; the start values where there is no file yet.

        Raises:
            CycleError: the file cannot be read, is no TOML, or holds an unknown number or a bad value.
        """
        try:
            text = self.path.read_text(encoding="utf-8")
            values = tomllib.loads(text)
        except FileNotFoundError:
            return ControlParameters()
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
            what = " ".join(str(error).split())
            raise CycleError(f"{self.path}: no parameter file ({what}); mend it, or delete it for the start "
                             "values") from None
        try:
            return ControlParameters().changed(values)
        except CycleError as error:
            raise CycleError(f"{self.path}: {error}") from None

    def rewrite(self, values: Mapping[str, Number]) -> ControlParameters:
        """Replace these values in the file, keep all others as they are there now, and return the whole.

        Raises:
            CycleError: the file cannot be read or written, another process holds it, or a value is bad.
        """
        if not values:
            return self.read()
        if self.path.exists() and not os.access(self.path, os.W_OK):
            raise CycleError(f"{self.path}: is read-only; allow writing to it, or name another file")
        with self._locked():
            parameters = self.read().changed(values)
            self._replace(_text(parameters))
        return parameters

    @contextmanager
    def _locked(self) -> Iterator[None]:
        lock = FileLock(self.path.with_name(self.path.name + ".lock"), timeout=LOCK_PATIENCE)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            lock.acquire()
        except Timeout:
            if not Path(lock.lock_file).exists():
                raise self._unwritable("no lock can be made beside it") from None
            raise CycleError(f"{self.path}: another process holds it for {LOCK_PATIENCE:g} s; try again") from None
        except OSError as error:
            raise self._unwritable(error.strerror) from None
        try:
            yield
        finally:
            lock.release()

    def _replace(self, text: str) -> None:
        place = self.path.resolve()  # of a link the file, not the link
        temporary = place.with_name(place.name + ".new")  # one name: the lock is ours, and a killed run's is taken over
        try:
            with temporary.open("w", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            if place.exists():
                shutil.copymode(place, temporary)
            os.replace(temporary, place)
        except OSError as error:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
            raise self._unwritable(error.strerror) from None

    def _unwritable(self, why: str | None) -> CycleError:
        return CycleError(f"{self.path}: cannot be written ({why}); choose another place")


def _text(parameters: ControlParameters) -> str:
    entries = list(ENTRIES.values())
    lines = [f'"{entry.number}" = {value!r}  # {entry.meaning}'
             for entry, value in zip(entries, parameters.by_number().values(), strict=True)]
    return "# System parameters of the control; executing G76 rewrites 019 and 057 to 060.\n" + "\n".join(lines) + "\n"


def _check(entry: Entry, value: object) -> None:
    what = f"parameter {entry.number} ({entry.meaning})"
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise CycleError(f"{what} is {value!r}; give a number")
    if not 0 <= value <= entry.high:
        raise CycleError(f"{what} is {value:g}; give 0 to {entry.high:g}")
    if entry.is_whole and value != int(value):
        raise CycleError(f"{what} is {value:g}; give a whole number")


def _tidy(value: Number) -> Number:
    return int(value) if value == int(value) else value
