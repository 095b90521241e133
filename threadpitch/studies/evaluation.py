"""One row of a study -> its outcomes. FMUs are loaded once; a row's bits do not depend on the rows before it."""

from __future__ import annotations

import functools
import math
import signal
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from types import TracebackType
from typing import Any

from threadpitch import cosim
from threadpitch.cosim.interrupt import HeldInterrupt, Terminated
from threadpitch.cosim.mounted import Experiment, Mounted, mount
from threadpitch.cosim.system import nearest
from threadpitch.diagnosis import DECIDING
from threadpitch.fmu import BuildError, ModelError
from threadpitch.lathe import NOMINAL, LatheError, Simulation, check_start_angles, choose_flavor, locate_fmu
from threadpitch.roles import Roles
from threadpitch.studies.definition import Study
from threadpitch.studies.design import Row
from threadpitch.studies.errors import StudyError
from threadpitch.studies.quantity import Level
from threadpitch.studies.shown_units import Units, shown_units
from threadpitch.studies.statistics import CALCULATORS, CAUSE, NEED_LIMIT, STATISTICS, ThreadStatistics

OK, FAILED = "ok", "failed"
_LOOKED_AT = 64  # rows, of which one must have values that the system takes
# What a row can fail of; all else is an error of this program and ends the study.
_ROW_ERRORS = (cosim.CosimError, LatheError, StudyError, BuildError, ModelError)


@dataclass(frozen=True)
class Outcome:
    """What one row came to: outcomes by name, or why there are none."""

    row: int
    values: Mapping[str, Level]
    status: str = OK
    reason: str = ""


class Evaluator:
    """Computes rows of one study; a context, in which the system's FMUs stay loaded.

    ``system`` is that of the study where it has been read already.
    """

    def __init__(self, study: Study, system: cosim.System | None = None) -> None:
        self.study = study
        self._stack = ExitStack()
        self._given = system
        self._system: cosim.System | None = None
        self._roles: Roles | None = None
        self._recorded: tuple[str, ...] = ()
        self._units: Units = {}
        self._mounted: Mounted | None = None
        self._mounts = ExitStack()
        self._flavor = choose_flavor(study.run.flavor) if study.run.system is not None else ""

    def __enter__(self) -> Evaluator:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Unload the FMUs and remove what was unpacked."""
        self._mounts.close()
        self._stack.close()
        self._mounted = None

    @property
    def system(self) -> cosim.System | None:
        """The system of the study, with the paths of its FMUs; None where outcomes are formulae.

        Raises:
            cosim.CosimError, BuildError: it cannot be read, or an FMU cannot be built.
        """
        return None if self.study.run.system is None else self._read()

    def outcomes(self, rows: Iterable[int]) -> Iterator[Outcome]:
        """The outcomes of these rows, one after the other; a row that fails says why, and the next one goes on."""
        for row in rows:
            yield self.outcome(row, self.study.rows[row])

    def outcome(self, number: int, row: Row) -> Outcome:
        """The outcomes for these parameters under this number, or why there are none.

        Raises:
            KeyboardInterrupt: Ctrl-C or SIGTERM. A row that runs ends between two of its steps, and is not done.
        """
        with HeldInterrupt() as held:
            found = self._outcome(number, row)
        if held.requested:
            raise KeyboardInterrupt if held.signal == signal.SIGINT else Terminated(held.signal)
        return found

    def _outcome(self, number: int, row: Row) -> Outcome:
        try:
            return Outcome(number, self.values(row))
        except cosim.SimulationInterrupted as error:
            raise KeyboardInterrupt if error.signal == signal.SIGINT else Terminated(error.signal) from None
        except _ROW_ERRORS as error:
            return Outcome(number, {}, FAILED, " ".join(str(error).split()))

    def values(self, row: Mapping[str, Any]) -> dict[str, Level]:
        """The outcomes for these parameters, by name.

        Raises:
            StudyError: an outcome cannot be computed, or is not a finite number.
            cosim.CosimError, LatheError: the simulation fails.
        """
        found = {}
        if self.study.run.system is None:
            known: Mapping[str, Any] = {**self.study.run.fixed, **row}
            for name, expression in self.study.outcomes.items():
                found[name] = expression(known.__getitem__)
        else:
            simulation = self._simulate(row)
            statistics = ThreadStatistics(simulation, self.study.judging)

            def quantity(name: str) -> Any:
                if name in row:
                    return row[name]
                return statistics(name) if name in STATISTICS else simulation[name]

            for name, expression in self.study.outcomes.items():
                found[name] = expression(quantity)
        for name, value in found.items():
            if isinstance(value, float) and math.isnan(value):
                raise StudyError(f"outcome {name} is not a number (NaN)")
            if isinstance(value, str) and name in self.study.limits:
                raise StudyError(f"outcome {name} is the text {value!r}, but a limit is one of numbers")
        return found

    def describe(self) -> dict[str, Any]:
        """Versions, FMUs by their content, steps, the values that are common to all rows, and the units for people."""
        if self.study.run.system is None:
            return {**cosim.metadata.versions(), "units": dict(self.units)}
        return {**self._mount().describe(), "flavor": self._flavor, "units": dict(self.units)}

    @property
    def units(self) -> Units:
        """The units that people read parameters and outcomes in."""
        if self.study.run.system is None:
            return shown_units(self.study, None)
        self._read()
        return self._units

    def ordered(self, rows: Iterable[int]) -> list[int]:
        """The rows in an order in which neighbours share long beginnings: what comes last in the data changes first."""
        if self.study.run.system is None:
            return list(rows)
        order = list(self._mount().order)
        names = sorted(self.study.columns, key=lambda name: next(
            (place for place, component in enumerate(order) if name.startswith(f"{component}.")), len(order)))
        return sorted(rows, key=lambda row: [self.study.rows[row][name] for name in names])

    def check(self) -> None:
        """Look at the system, the names in the outcomes, and the parameters of the first row.

        Raises:
            StudyError, cosim.CosimError, LatheError: something is wrong with them.
        """
        check_start_angles(self.study.run.start_angles)
        self._check_statistics()
        if self.study.run.system is None:
            return
        mounted, first = self._mount(), None
        for row in self.study.rows[:_LOOKED_AT]:  # a value outside of its range is the row's fault, not the study's
            try:
                mounted.check(self._parameters(row))
                return
            except cosim.CosimError as error:
                first = first or error
        if first is not None:
            raise first

    def _check_statistics(self) -> None:
        """What looks like a statistic is one, and has the limit that it needs."""
        for outcome, expression in self.study.outcomes.items():
            for name in sorted(expression.names):
                if name.partition(".")[0] in CALCULATORS and name not in STATISTICS:
                    raise StudyError(f"outcome {outcome}: no statistic {name!r}{nearest(name, STATISTICS)}")
                if name.endswith(NEED_LIMIT) and self.study.judging.pitch_limit is None:
                    raise StudyError(f"outcome {outcome}: {name} needs the limit of a pitch; write "
                                     "pitch_limit = \"5um\" into [study]")

    def _simulate(self, row: Row) -> Simulation:
        return Simulation(self._mount().run(self._parameters(row)), self._flavor)

    def _parameters(self, row: Row) -> dict[str, Any]:
        assert self._roles is not None
        return self._roles.parameters({**self.study.run.fixed, **row}, self.study.run.start_angles)

    def _mount(self) -> Mounted:
        """The loaded system; anew after a run that failed."""
        if self._mounted is not None and not self._mounted.broken:
            return self._mounted
        self._mounts.close()
        system, run = self._read(), self.study.run
        assert self._roles is not None
        part_at = f"{NOMINAL}.threading" if NOMINAL in self._roles.calculators and run.share_beginnings else None
        experiment = Experiment(run.stop_time, run.step_size, self._recorded, self._roles.watch, part_at)
        self._mounted = self._mounts.enter_context(mount(system, experiment=experiment))
        return self._mounted

    def _deciding(self, plan: cosim.Plan) -> list[str]:
        """What a verdict needs besides, of what the system has."""
        if not any(CAUSE in expression.names for expression in self.study.outcomes.values()):
            return []
        known = {f"{name}.{variable}" for name, description in plan.descriptions.items()
                 for variable in description.variables}
        return [name for name in DECIDING if name in known and name not in self.study.recorded]

    def _read(self) -> cosim.System:
        if self._system is None:
            self._system = self._stack.enter_context(self._given or cosim.read_system(
                self.study.run.system or "", locate=functools.partial(locate_fmu, self._flavor)))
            with cosim.prepare(self._system) as plan:
                self._roles = Roles.of(plan)
                self._recorded = (*self.study.recorded, *self._deciding(plan))
                self._units = shown_units(self.study, plan)
        return self._system
