"""Rows -> outcomes, in this process or by the workers of a Dask cluster; what a dead worker had is given to another."""

from __future__ import annotations

import contextlib
import time as clock
import uuid
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from threadpitch.studies import worker
from threadpitch.studies.errors import StudyError
from threadpitch.studies.evaluation import FAILED, Evaluator, Outcome
from threadpitch.studies.parcel import Parcel

if TYPE_CHECKING:
    from distributed import Client, Future

DIED = ("the process that computed it died, again and again; an FMU crashes with these parameters, or there is not "
        "enough memory")
_TASK_TIME = 2.0  # s that a task should take: long against Dask's own time for it, short against the study
_AHEAD = 2  # tasks per thread that are under way: one computes, one waits
_MOST = 5000  # rows of a task


def in_this_process(evaluator: Evaluator, rows: Sequence[int]) -> Iterator[list[Outcome]]:
    """The outcomes of the rows, one by one."""
    for outcome in evaluator.outcomes(rows):
        yield [outcome]


@contextlib.contextmanager
def sent(client: Client, parcel: Parcel) -> Iterator[str]:
    """All workers have the parcel, under this name, until the end.

    Raises:
        StudyError: a worker cannot take it.
    """
    from threadpitch.studies.delivery import Delivery  # needs Dask

    name = f"threadpitch-{uuid.uuid4().hex}"
    try:
        client.register_plugin(Delivery(name, parcel), name=name)
    except Exception as error:  # whatever a worker with other software, or a full disk, comes to
        raise StudyError(f"a worker cannot take the study ({type(error).__name__}: {' '.join(str(error).split())}); "
                         "give workers the same threadpitch, and room on their disk") from None
    try:
        yield name
    finally:
        with contextlib.suppress(Exception):  # workers and scheduler may be gone, and the parcel with them
            client.unregister_worker_plugin(name)


@dataclass
class OnDask:
    """The rows of one study on a cluster, whose workers have it under the name of its ``parcel``."""

    client: Client
    parcel: str

    def outcomes(self, rows: Sequence[int]) -> Generator[list[Outcome], None, None]:
        """The outcomes of the rows, task by task as they are done; leaving cancels what is under way.

        Raises:
            StudyError: a worker is not as the client.
        """
        from distributed import as_completed

        waiting: deque[list[int]] = deque()
        rest = deque(rows)
        size, began = 1, clock.monotonic()
        under_way: dict[Future, tuple[list[int], float]] = {}
        done = as_completed([], loop=self.client.loop)
        try:
            while rest or waiting or under_way:
                places = _AHEAD * self._threads()
                while (rest or waiting) and len(under_way) < places:
                    # No more than an equal share of what is left, so that all workers end together: guided
                    # self-scheduling (Polychronopoulos and Kuck 1987).
                    share = -(-len(rest) // places)
                    task = waiting.popleft() if waiting else [rest.popleft() for _ in range(min(size, share))]
                    future = self._submit(task)
                    under_way[future] = task, clock.monotonic()
                    done.add(future)
                future = next(done)
                task, began = under_way.pop(future)
                if future.status == "error":
                    yield from self._failed(future, task, waiting)
                    continue
                yield future.result()
                size = _next_size(size, len(task), clock.monotonic() - began)
        finally:
            if under_way:
                self.client.cancel(list(under_way), force=True)

    def _submit(self, rows: list[int]) -> Future:
        return self.client.submit(worker.compute, self.parcel, rows, pure=False)

    def _threads(self) -> int:
        threads: int = sum(self.client.nthreads().values())
        return max(1, threads)

    def _failed(self, future: Future, task: list[int], waiting: deque[list[int]]) -> Iterator[list[Outcome]]:
        """Of a task under which workers died, every row alone; a row under which they die alone has failed."""
        from distributed.scheduler import KilledWorker

        error = future.exception()
        if not isinstance(error, KilledWorker):
            raise error
        if len(task) == 1:
            yield [Outcome(task[0], {}, FAILED, DIED)]
        else:
            waiting.extend([row] for row in task)


def _next_size(size: int, rows: int, elapsed: float) -> int:
    """Rows of the next tasks, from how long these rows waited and took: at most twice as many as before."""
    wanted = rows * _TASK_TIME * _AHEAD / max(elapsed, 1e-3)
    return int(max(1, min(_MOST, 2 * size, wanted)))
