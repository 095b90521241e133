"""Parameters that make an outcome least while others keep their limits: scipy's differential evolution, then a simplex.

Points within all limits go before points outside, of those the one that is less far outside goes before (Deb 2000,
Comput. Methods Appl. Mech. Eng. 186, 311). The way is the same for the same seed, and what was computed on it is kept:
a search that was stopped goes on where it was.
"""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import scipy  # its parts are loaded when they are used
from numpy.typing import NDArray

from threadpitch.cosim.system import nearest
from threadpitch.studies import worker
from threadpitch.studies.cluster import connected
from threadpitch.studies.definition import Document, Study, read_study, study_of
from threadpitch.studies.errors import StudyError
from threadpitch.studies.evaluation import FAILED, OK, Evaluator, Outcome
from threadpitch.studies.execution import DIED, sent
from threadpitch.studies.parcel import Parcel
from threadpitch.studies.place import Place
from threadpitch.studies.shown_units import Units

FloatArray = NDArray[np.float64]
Point: TypeAlias = tuple[float, ...]  # the parameters' values, in their order
Progress: TypeAlias = Callable[[int, int], None]  # (points computed, most that are computed)

DEFAULT_OUTPUT = "threadpitch-tune"
HISTORY, BEST = "points.jsonl", "best.json"
EVALUATIONS = 200
_WORDS = {"minimise", "evaluations"}
_OUTSIDE = 1e100  # cost of a point outside a limit: more than any outcome
_POPULATION = 8  # points of a generation for each parameter
_SIMPLEX_SHARE = 0.25  # of the evaluations, for the simplex at the end


@dataclass(frozen=True)
class Tuning:
    """``parameters`` (SI) of the best point, its ``outcomes``, and whether they keep the limits."""

    study: Study
    parameters: Mapping[str, float]
    outcomes: Mapping[str, Any]
    within_limits: bool
    evaluations: int
    folder: Path
    units: Units = field(default_factory=dict)  # that people read them in


def tune(definition: str | Path | Document, *, output: str | Path = DEFAULT_OUTPUT, workers: int | None = None,
         scheduler: str | None = None, queue: bool = False, progress: Progress | None = None) -> Tuning:
    """Search the parameters, each { from, to }, for the least value of the outcome that [tune] minimise names.

    [limits] are the greatest good |outcomes|. ``workers``, ``scheduler`` and ``queue`` are those of a study's
    ``Place``; the way is the same wherever the points are computed.

    Raises:
        StudyError: the file or the folder is wrong, or no point could be computed.
        cosim.CosimError: the system or a parameter is.
        KeyboardInterrupt: Ctrl-C; what was computed is kept.
    """
    study = study_of(definition) if isinstance(definition, Mapping) else read_study(definition)
    goal, most = _goal(study)
    place = Place(workers, scheduler, queue)
    place.check(study)
    bounds = [one.bounds for one in study.parameters]
    with ExitStack() as stack:
        evaluator = stack.enter_context(Evaluator(study))
        evaluator.check()
        compute = _here(evaluator)
        if not place.alone:
            parcel = Parcel.of(evaluator, with_fmus=place.elsewhere)
            client = stack.enter_context(connected(place.processes, scheduler, place.cluster(study)))
            compute = _on_dask(client, study, stack.enter_context(sent(client, parcel)))
        search = _Search(study, goal, most, _History(Path(output), study), compute, progress)
        search.run(bounds)
        units = evaluator.units
    return replace(search.result(), units=units)


class _Enough(Exception):  # noqa: N818 -- no error: the points that were granted are computed
    pass


class _History:
    """The points that were computed, in a file that grows by a line for each."""

    def __init__(self, folder: Path, study: Study) -> None:
        self.folder = folder
        self.points: dict[Point, Outcome] = {}
        self._path = folder / HISTORY
        head = json.dumps({"digest": study.digest})
        folder.mkdir(parents=True, exist_ok=True)
        if self._path.is_file():
            lines = self._path.read_text(encoding="utf-8").splitlines()
            if lines[:1] != [head]:
                raise StudyError(f"{folder}: holds another search, or this one before it was changed; choose another "
                                 "--output, or remove it")
            self._read(lines[1:])
        else:
            self._path.write_text(head + "\n", encoding="utf-8")

    def add(self, points: Iterable[tuple[Point, Outcome]]) -> None:
        with self._path.open("a", encoding="utf-8") as file:
            for point, outcome in points:
                self.points[point] = outcome
                file.write(json.dumps([point, dict(outcome.values), outcome.status, outcome.reason]) + "\n")

    def _read(self, lines: Sequence[str]) -> None:
        for number, line in enumerate(lines):
            try:
                point, values, status, reason = json.loads(line)
            except ValueError:  # the last line of a process that was killed
                continue
            self.points[tuple(point)] = Outcome(number, values, status, reason)


Compute: TypeAlias = Callable[[Sequence[Point]], list[Outcome]]


@dataclass
class _Search:
    study: Study
    goal: str
    most: int
    history: _History
    compute: Compute
    progress: Progress | None
    best: tuple[float, Point] = (math.inf, ())
    asked: dict[Point, None] = field(default_factory=dict)  # in their order; the search may come back to a point

    def run(self, bounds: Sequence[tuple[float, float]]) -> None:
        """Differential evolution over the whole room, then a simplex from the best point."""
        widths = np.array([high - low for low, high in bounds])
        generations = max(1, int(self.most * (1.0 - _SIMPLEX_SHARE)) // (_POPULATION * len(bounds)) - 1)
        try:
            scipy.optimize.differential_evolution(
                self._cost, scipy.optimize.Bounds(*zip(*bounds, strict=True)), popsize=_POPULATION, maxiter=generations,
                rng=self.study.design.seed, polish=False, init="sobol", updating="deferred", tol=1e-6,
                workers=lambda _, points: self.costs(points))
            simplex = np.array(self.best[1]) + np.vstack([np.zeros(widths.size), 0.05 * np.diag(widths)])
            low, high = (np.array(ends) for ends in zip(*bounds, strict=True))
            scipy.optimize.minimize(self._cost, self.best[1], method="Nelder-Mead", bounds=bounds,
                                    options={"initial_simplex": np.clip(simplex, low, high), "maxfev": self.most,
                                             "xatol": 1e-6 * float(widths.min()), "fatol": 0.0})
        except _Enough:
            pass

    def costs(self, points: Iterable[Any]) -> list[float]:
        """The costs of some points; those that nobody has computed are computed together.

        Raises:
            _Enough: as many as were granted have been computed.
        """
        wanted = [tuple(float(value) for value in point) for point in points]
        room = self.most - len(self.asked)
        new = [point for point in dict.fromkeys(wanted) if point not in self.asked]
        self.asked |= dict.fromkeys(new[:room])
        unknown = [point for point in new[:room] if point not in self.history.points]
        if unknown:
            self.history.add(zip(unknown, self.compute(unknown), strict=True))
        if self.progress is not None:
            self.progress(len(self.asked), self.most)
        known = [(self.cost(self.history.points[point]), point) for point in wanted if point in self.asked]
        self.best = min([self.best, *known])
        if room <= len(new):
            raise _Enough
        return [cost for cost, _ in known]

    def cost(self, outcome: Outcome) -> float:
        """The goal, or for a point outside the limits how far it is outside."""
        if outcome.status == FAILED:
            return 2.0 * _OUTSIDE
        excess = sum(max(0.0, abs(float(outcome.values[name])) / limit - 1.0) if limit > 0.0 else
                     abs(float(outcome.values[name])) for name, limit in self.study.limits.items())
        if excess > 0.0:
            return _OUTSIDE * (1.0 + excess / (1.0 + excess)) if math.isfinite(excess) else 2.0 * _OUTSIDE
        return float(outcome.values[self.goal])

    def result(self) -> Tuning:
        """The best point, which is written besides.

        Raises:
            StudyError: every point failed.
        """
        cost, point = self.best
        outcome = self.history.points.get(point)
        if outcome is None or outcome.status != OK:
            reasons = sorted({one.reason for one in self.history.points.values()})
            raise StudyError(f"no point could be computed: {reasons[0] if reasons else 'none was tried'}")
        parameters = dict(zip((one.name for one in self.study.parameters), point, strict=True))
        found = Tuning(self.study, parameters, outcome.values, cost < _OUTSIDE, len(self.asked),
                       self.history.folder)
        document = {"parameters": parameters, "outcomes": dict(outcome.values), "within_limits": found.within_limits,
                    "evaluations": found.evaluations}
        (self.history.folder / BEST).write_text(json.dumps(document, indent=1), encoding="utf-8")
        return found

    def _cost(self, point: FloatArray) -> float:
        return self.costs([point])[0]


def _goal(study: Study) -> tuple[str, int]:
    """The outcome that is made least, and how many points may be computed."""
    about = study.document.get("tune")
    if not isinstance(about, Mapping) or "minimise" not in about:
        raise StudyError("there is no [tune] with minimise = \"...\", the outcome that is to become least")
    unknown = sorted(set(about) - _WORDS)
    if unknown:
        raise StudyError(f"[tune] {unknown[0]!r} is not known{nearest(unknown[0], _WORDS)}")
    goal, most = about["minimise"], about.get("evaluations", EVALUATIONS)
    if goal not in study.outcomes:
        raise StudyError(f"[tune] minimise: no outcome is called {goal!r}{nearest(str(goal), study.outcomes)}")
    if not isinstance(most, int) or isinstance(most, bool) or most < 1:
        raise StudyError(f"[tune] evaluations: {most!r} is no number of points")
    if study.noise_seeds:
        raise StudyError("noise_seeds make every point another: leave them out of a file for tune")
    return goal, most


def _row(study: Study, point: Point) -> dict[str, float]:
    return dict(zip((one.name for one in study.parameters), point, strict=True))


def _here(evaluator: Evaluator) -> Compute:
    return lambda points: [evaluator.outcome(number, _row(evaluator.study, point))
                           for number, point in enumerate(points)]


def _on_dask(client: Any, study: Study, parcel: str) -> Compute:
    def compute(points: Sequence[Point]) -> list[Outcome]:
        evaluate = functools.partial(worker.evaluate, parcel)
        futures = client.map(evaluate, [_row(study, point) for point in points], pure=False)
        return [_outcome_of(future) for future in futures]

    return compute


def _outcome_of(future: Any) -> Outcome:
    """What a worker found, or that workers died of it.

    Raises:
        StudyError: the worker is not as the client.
    """
    from distributed.scheduler import KilledWorker

    error = future.exception()  # waits
    if isinstance(error, KilledWorker):
        return Outcome(0, {}, FAILED, DIED)
    found: Outcome = future.result()
    return found
