"""A study: what is varied, how, and what is wanted of every run; read from a TOML file."""

from __future__ import annotations

import functools
import hashlib
import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from threadpitch.cosim.system import nearest
from threadpitch.cosim.values import Given
from threadpitch.lathe import DEFAULT_SYSTEM, find_system
from threadpitch.studies.correlation import correlation_of
from threadpitch.studies.design import DESIGNS, Design, Row, check_design, row_seed
from threadpitch.studies.errors import StudyError
from threadpitch.studies.expression import FUNCTIONS, Expression
from threadpitch.studies.parameter import Parameter, read_parameter
from threadpitch.studies.quantity import number, written_unit
from threadpitch.studies.statistics import STATISTICS, Judging

Document = Mapping[str, Any]

NO_SYSTEM = "none"
_TABLES = {"study", "parameters", "fixed", "outcomes", "limits", "correlations", "cluster", "tune"}
_STUDY = {"name", "system", "design", "samples", "seed", "stop_time", "step_size", "flavor", "start_angles_deg",
          "pitch_limit", "uncertainty", "noise_seeds", "share_beginnings"}
_RESERVED = {"row", "status", "reason"}


@dataclass(frozen=True)
class Run:
    """What all runs of a study have in common. ``system`` is None where the outcomes are formulae of the parameters."""

    system: str | None
    fixed: Mapping[str, Given]
    stop_time: float | None = None
    step_size: float | None = None
    flavor: str | None = None
    start_angles: tuple[float, ...] | None = None  # rad
    share_beginnings: bool = True


@dataclass(frozen=True)
class Study:
    """``limits`` are the greatest good values of outcomes, SI, ``limit_units`` what they are written in;
    ``noise_seeds`` names parameters that differ by row.

    ``document`` is the study as it was written, which workers read once more.
    """

    name: str
    run: Run
    parameters: tuple[Parameter, ...]
    outcomes: Mapping[str, Expression]
    limits: Mapping[str, float]
    limit_units: Mapping[str, str]
    design: Design
    judging: Judging
    noise_seeds: tuple[str, ...]
    document: Document

    @functools.cached_property
    def rows(self) -> list[Row]:
        """The parameters of every row, of ``noise_seeds`` too."""
        rows = self.design.rows(self.parameters)
        if not self.noise_seeds:
            return rows
        return [{**row, **dict.fromkeys(self.noise_seeds, float(row_seed(self.design.seed, place)))}
                for place, row in enumerate(rows)]

    @property
    def columns(self) -> tuple[str, ...]:
        """The parameters of a row."""
        return (*(one.name for one in self.parameters), *self.noise_seeds)

    @property
    def recorded(self) -> tuple[str, ...]:
        """The variables that outcomes need at every step."""
        names = {name for outcome in self.outcomes.values() for name in outcome.names}
        return tuple(sorted(names - set(STATISTICS) - set(self.columns)))

    @functools.cached_property
    def digest(self) -> str:
        """What the rows depend on: all but limits and cluster, and the values that were drawn.

        Of the system its name: on another machine it lies elsewhere, and its FMUs are told by their hashes.
        """
        written = {key: value for key, value in self.document.items() if key not in ("limits", "cluster", "tune")}
        if self.run.system is not None:
            written["study"] = {**written["study"], "system": Path(self.run.system).name}
        text = json.dumps([written, [list(row.values()) for row in self.rows]], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


def read_study(path: str | Path) -> Study:
    """The study that a TOML file describes; a path in it counts from the file's folder.

    Raises:
        StudyError: the file is missing, or what is in it makes no study.
    """
    path = Path(path)
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise StudyError(f"{path}: no such file; give a study, such as models/studies/gain.toml") from None
    except (ValueError, RecursionError, IsADirectoryError) as error:
        raise StudyError(f"{path}: is not TOML: {error}") from None
    try:
        return study_of(document, path.parent)
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None


def study_of(document: Document, base: str | Path = ".", *, system_at_hand: bool = False) -> Study:
    """A study out of the tables of its file; ``base`` is the folder that paths count from.

    ``system_at_hand``: the system has been read and is not looked for, as in a worker elsewhere.

    Raises:
        StudyError: something is missing or wrong.
    """
    _check_words(document, _TABLES, "table")
    about = _table(document, "study")
    _check_words(about, _STUDY, "[study]:")
    parameters = tuple(read_parameter(name, given) for name, given in _flat(_table(document, "parameters")))
    if not parameters:
        raise StudyError("[parameters] is empty; write \"z_drive.position_gain\" = { from = 30, to = 80 }")
    given = about.get("system", DEFAULT_SYSTEM)
    system = given if system_at_hand and given != NO_SYSTEM else _system(given, Path(base))
    fixed = dict(_flat(_table(document, "fixed")))
    noise_seeds = _names(about, "noise_seeds")
    _check_names(parameters, fixed, noise_seeds, _table(document, "outcomes"))
    outcomes = _outcomes(_table(document, "outcomes"))
    limits = _limits(_table(document, "limits"), outcomes)
    design = _design(about, parameters, document.get("correlations", ()))
    study = Study(
        name=str(about.get("name", "study")), parameters=parameters, outcomes=outcomes, limits=limits, design=design,
        limit_units={name: found for name, value in _table(document, "limits").items()
                     if (found := written_unit(value))},
        judging=_judging(about), noise_seeds=noise_seeds, document=_settled(document, system),
        run=Run(system, fixed, _seconds(about, "stop_time"), _seconds(about, "step_size"), about.get("flavor"),
                _angles(about), _truth(about, "share_beginnings", True)))
    unknown = sorted(set(study.recorded) - set(fixed)) if system is None else []
    if unknown:
        raise StudyError(f"outcome: a study without a system knows parameters only, not {unknown[0]!r}"
                         f"{nearest(unknown[0], [*study.columns, *fixed])}")
    return study


def _system(given: object, base: Path) -> str | None:
    """The system's absolute path; None for a study of formulae."""
    if given == NO_SYSTEM:
        return None
    if not isinstance(given, str):
        raise StudyError(f"[study] system: {given!r} is no path; write a folder, an .ssd, an .ssp, or \"none\"")
    here = base / given
    path = here if here.exists() else find_system(given)
    if not path.exists():
        raise StudyError(f"[study] system: {given}: no such file or folder, neither in {base}")
    return str(path.absolute())


def _settled(document: Document, system: str | None) -> Document:
    """The document with the system's absolute path, as JSON holds it: what every worker understands."""
    about = {**document.get("study", {}), "system": NO_SYSTEM if system is None else system}
    return dict(json.loads(json.dumps({**document, "study": about}, default=str)))


def _design(about: Document, parameters: Sequence[Parameter], correlations: object) -> Design:
    kind = about.get("design", "grid")
    if kind not in DESIGNS:
        raise StudyError(f"[study] design: {kind!r} is not known{nearest(str(kind), DESIGNS)}")
    samples, seed = (_whole(about, name) for name in ("samples", "seed"))
    design = Design(kind, samples, seed, correlation_of(parameters, correlations))
    check_design(design, parameters)
    return design


def _outcomes(given: Document) -> dict[str, Expression]:
    if not given:
        raise StudyError("[outcomes] is empty; write worst = \"actual.max_deviation\"")
    for name, text in given.items():
        if not isinstance(text, str):
            raise StudyError(f"outcome {name}: {text!r} is no expression; write it like \"actual.max_deviation\"")
        if name in _RESERVED or not name.isidentifier():
            raise StudyError(f"outcome {name!r}: is no name for a column; take letters, digits and _, and none of "
                             f"{', '.join(sorted(_RESERVED))}")
    return {name: Expression(text, f"outcome {name}") for name, text in given.items()}


def _limits(given: Document, outcomes: Document) -> dict[str, float]:
    for name in given:
        if name not in outcomes:
            raise StudyError(f"[limits]: no outcome is called {name!r}{nearest(name, outcomes)}")
    limits = {name: number(value, f"[limits] {name}") for name, value in given.items()}
    for name, limit in limits.items():
        if limit < 0.0:
            raise StudyError(f"[limits] {name}: {limit:g} is the greatest absolute value, which is never negative")
    return limits


def _judging(about: Document) -> Judging:
    limit = about.get("pitch_limit")
    uncertainty = number(about.get("uncertainty", Judging.uncertainty), "[study] uncertainty", measures="m")
    found = Judging(None if limit is None else number(limit, "[study] pitch_limit", measures="m"), uncertainty)
    if uncertainty <= 0.0 or (found.pitch_limit is not None and found.pitch_limit <= 0.0):
        raise StudyError("[study]: pitch_limit and uncertainty must be positive")
    return found


def _check_names(parameters: Sequence[Parameter], fixed: Document, noise_seeds: Sequence[str],
                 outcomes: Document) -> None:
    names = [*(one.name for one in parameters), *fixed, *noise_seeds]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise StudyError(f"{twice[0]} stands twice, in [parameters], [fixed] or noise_seeds")
    taken = sorted(set(names) & {*STATISTICS, *FUNCTIONS, *_RESERVED})
    if taken:
        raise StudyError(f"parameter {taken[0]!r}: the name has a meaning of its own; take another")


    both = sorted({one.name for one in parameters} & set(outcomes))
    if both:
        raise StudyError(f"{both[0]!r} is the name of a parameter and of an outcome; call the outcome something else")


def _check_words(table: Document, known: set[str], where: str) -> None:
    for word in table:
        if word not in known:
            raise StudyError(f"{where} {word!r} is not known{nearest(word, sorted(known))}")


def _table(document: Document, name: str) -> Document:
    found = document.get(name, {})
    if not isinstance(found, Mapping):
        raise StudyError(f"[{name}] is no table; write a line [{name}] with its entries below")
    return found


def _flat(table: Document, owner: str = "") -> list[tuple[str, Any]]:
    """``[parameters.z_drive] position_gain = ...`` and ``"z_drive.position_gain" = ...`` as pairs."""
    found: list[tuple[str, Any]] = []
    for name, value in table.items():
        if isinstance(value, Mapping) and not set(value) & {"from", "to", "values", "distribution"}:
            found += _flat(value, f"{owner}{name}.")
        else:
            found.append((owner + name, value))
    return found


def _names(about: Document, name: str) -> tuple[str, ...]:
    given = about.get(name, [])
    if not isinstance(given, list | tuple) or not all(isinstance(one, str) for one in given):
        raise StudyError(f"[study] {name}: write a list of names, such as [\"spindle.noise_seed\"]")
    return tuple(given)


def _whole(about: Document, name: str) -> int:
    value = about.get(name, 0)
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise StudyError(f"[study] {name}: {value!r} is no whole number from 0 on")
    return value


def _truth(about: Document, name: str, otherwise: bool) -> bool:
    value = about.get(name, otherwise)
    if not isinstance(value, bool):
        raise StudyError(f"[study] {name}: {value!r} is neither true nor false")
    return value


def _seconds(about: Document, name: str) -> float | None:
    return None if name not in about else number(about[name], f"[study] {name}", measures="s")


def _angles(about: Document) -> tuple[float, ...] | None:
    given = about.get("start_angles_deg")
    if given is None:
        return None
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise StudyError("[study] start_angles_deg: write a list of degrees, such as [0, 90]")
    return tuple(float(np.radians(number(value, "[study] start_angles_deg"))) for value in given)
