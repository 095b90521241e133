"""Which rows a study has: the parameters of every run, the same for the same seed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are loaded when they are used
from numpy.typing import NDArray

from threadpitch.studies.errors import StudyError
from threadpitch.studies.parameter import Parameter
from threadpitch.studies.quantity import Level

FloatArray = NDArray[np.float64]
Row = Mapping[str, Level]  # by parameter

GRID, ONE_AT_A_TIME = "grid", "one_at_a_time"
LATIN_HYPERCUBE, SOBOL, RANDOM, SENSITIVITY = "latin_hypercube", "sobol", "random", "sensitivity"
DRAWN = (LATIN_HYPERCUBE, SOBOL, RANDOM, SENSITIVITY)
DESIGNS = (GRID, ONE_AT_A_TIME, *DRAWN)
MOST_ROWS = 10_000_000
_INSIDE = 2.0**-53  # distance from 0 and 1, where distributions are infinite


@dataclass(frozen=True)
class Design:
    """How rows are chosen: ``samples`` of a drawn design, ``seed``, rank correlations (parameters, parameters).

    "sensitivity" is Saltelli's: with d parameters samples (d + 2) rows, samples of A, of B, then A with column i of B
    (Saltelli et al. 2010, Comput. Phys. Commun. 181, 259).
    """

    kind: str
    samples: int = 0
    seed: int = 0
    correlation: FloatArray | None = None

    def count(self, parameters: Sequence[Parameter]) -> int:
        """The number of rows."""
        if self.kind == GRID:
            return math.prod(len(one.levels) for one in parameters)
        if self.kind == ONE_AT_A_TIME:
            return 1 + sum(len(one.levels) - (one.middle in one.levels) for one in parameters)
        return self.samples * (len(parameters) + 2) if self.kind == SENSITIVITY else self.samples

    def rows(self, parameters: Sequence[Parameter]) -> list[Row]:
        """The parameters of every row.

        Raises:
            StudyError: they are too many.
        """
        if self.count(parameters) > MOST_ROWS:
            raise StudyError(f"{self.count(parameters):,} rows are too many; take fewer values, or a drawn design")
        names = [one.name for one in parameters]
        if self.kind == GRID:
            return [dict(zip(names, levels, strict=True))
                    for levels in itertools.product(*(one.levels for one in parameters))]
        if self.kind == ONE_AT_A_TIME:
            middle = {one.name: one.middle for one in parameters}
            return [middle, *({**middle, one.name: value} for one in parameters for value in one.levels
                              if value != one.middle)]
        columns = [one.at(share) for one, share in zip(parameters, self.shares(len(parameters)).T, strict=True)]
        return [dict(zip(names, values, strict=True)) for values in zip(*columns, strict=True)]

    def shares(self, width: int) -> FloatArray:
        """Places between 0 and 1 at which the distributions are taken, (rows, width)."""
        if self.kind == SENSITIVITY:
            both = scipy.stats.qmc.Sobol(2 * width, rng=self._generator()).random(self.samples)
            first, second = both[:, :width], both[:, width:]
            mixed = np.repeat(first[None], width, axis=0)  # (width, samples, width)
            for i in range(width):
                mixed[i, :, i] = second[:, i]
            found = np.concatenate([first, second, mixed.reshape(-1, width)])
        elif self.kind == SOBOL:
            found = scipy.stats.qmc.Sobol(width, rng=self._generator()).random(self.samples)
        elif self.kind == LATIN_HYPERCUBE:
            found = scipy.stats.qmc.LatinHypercube(width, rng=self._generator()).random(self.samples)
        else:
            found = self._generator().random((self.samples, width))
        return np.clip(self._correlated(found), _INSIDE, 1.0 - _INSIDE)

    def _correlated(self, shares: FloatArray) -> FloatArray:
        """Gaussian copula: u = Phi(L Phi^-1(v)), L L' the correlation of the normal scores; margins stay."""
        if self.correlation is None:
            return shares
        scores = scipy.special.ndtri(np.clip(shares, _INSIDE, 1.0 - _INSIDE)) @ np.linalg.cholesky(self.correlation).T
        return np.asarray(scipy.special.ndtr(scores))

    def _generator(self) -> np.random.Generator:
        return np.random.default_rng(self.seed)


def row_seed(seed: int, row: int) -> int:
    """A number of 31 bits for the noise of one row, the same wherever and whenever the row is computed."""
    return int(np.random.SeedSequence([seed, row]).generate_state(1)[0] >> 1)


def check_design(design: Design, parameters: Sequence[Parameter]) -> None:
    """Look for what makes no design.

    Raises:
        StudyError: number of samples, correlation.
    """
    if design.kind not in DRAWN:
        if design.samples or design.correlation is not None:
            raise StudyError(f"design {design.kind!r} takes all levels: 'samples' and 'correlations' are for "
                             f"{', '.join(DRAWN)}")
        return
    if design.samples < 1:
        raise StudyError(f"design {design.kind!r} needs 'samples', the number that is drawn")
    if design.kind in (SOBOL, SENSITIVITY) and design.samples & (design.samples - 1):
        near = 2 ** round(math.log2(design.samples))
        raise StudyError(f"{design.samples} samples of a Sobol sequence are not balanced; take a power of 2, such as "
                         f"{near}")
    if design.correlation is None:
        return
    if design.kind == SENSITIVITY:
        raise StudyError("Sobol indices are of independent parameters; leave the correlations out, or take another "
                         "design")
    if float(np.linalg.eigvalsh(design.correlation).min()) <= 0.0:
        names = ", ".join(one.name for one in parameters)
        raise StudyError(f"the correlations of {names} contradict each other: no such distribution exists")
