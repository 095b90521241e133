"""Where the rows of a study, or the points of a search, are computed."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from threadpitch.studies.cluster import available_cores
from threadpitch.studies.definition import Study
from threadpitch.studies.errors import StudyError


@dataclass(frozen=True)
class Place:
    """Where rows are computed: by so many local workers (0: in this process; None: one for each core), by the workers
    of a Dask scheduler, or of the queue that the study configures; and which part of them, (i, n) the i-th of n.
    """

    workers: int | None = None
    scheduler: str | None = None
    queue: bool = False
    shard: tuple[int, int] = (1, 1)

    @property
    def elsewhere(self) -> bool:
        """Whether workers may be on other machines."""
        return self.scheduler is not None or self.queue

    @property
    def alone(self) -> bool:
        """Whether all is computed in this process, without Dask."""
        return not self.elsewhere and (self.workers == 0 or self.shard != (1, 1))

    @property
    def processes(self) -> int:
        """The local processes that compute."""
        return 1 if self.alone else max(1, available_cores() if self.workers is None else self.workers)

    def cluster(self, study: Study) -> Mapping[str, Any]:
        """What the study says of the queue, where one is asked for."""
        found: Mapping[str, Any] = study.document.get("cluster", {}) if self.queue else {}
        return found

    def check(self, study: Study) -> None:
        """Look whether the study has what the place needs.

        Raises:
            StudyError: a queue is asked for, and it configures none.
        """
        if self.queue and "cluster" not in study.document:
            raise StudyError("the study has no [cluster]; write one with kind = \"slurm\", jobs, cores, memory, "
                             "walltime")


def read_shard(text: str) -> tuple[int, int]:
    """``2/8`` -> (2, 8).

    Raises:
        StudyError: it is no part of a whole.
    """
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise StudyError(f"--shard {text!r} is no part; write it like 2/8, from 1/8 to 8/8")
    return int(match[1]), int(match[2])
