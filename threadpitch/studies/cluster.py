"""Where a study is computed: a local cluster of Dask, one that runs already, or jobs of a SLURM queue."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import signal
import threading
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from threadpitch.cosim.system import nearest
from threadpitch.studies.errors import StudyError

if TYPE_CHECKING:
    from distributed import Client

JOB_QUEUES = {"slurm": "SLURMCluster", "pbs": "PBSCluster", "lsf": "LSFCluster", "sge": "SGECluster",
              "htcondor": "HTCondorCluster", "oar": "OARCluster", "moab": "MoabCluster"}
_OF_CLUSTER = {"interface", "scheduler_options", "n_workers", "security"}  # what a cluster keeps from its jobs
_DEATHS = 3  # workers that may die under a task before the task is suspected
_CONNECT = 30.0  # s
# What Dask does beside the rows in every process, for a dashboard that nobody looks at here: some 5 % of a core with
# one worker, while client and scheduler share the cores of the workers.
_QUIET = {
    "distributed.worker.profile.enabled": False,  # looks at all stacks every 10 ms
    "distributed.admin.tick.interval": "500ms",  # instead of 20 ms; tells of event loops that hang
    "distributed.admin.system-monitor.interval": "10s",  # instead of 500 ms
    "distributed.scheduler.active-memory-manager.start": False,  # there is nothing to move between workers
}


@contextlib.contextmanager
def connected(workers: int, scheduler: str | None, cluster: Mapping[str, Any]) -> Iterator[Client]:
    """A client of the scheduler at this address, of the configured queue, or of a local cluster with these workers.

    Raises:
        StudyError: Dask is missing, or the scheduler does not answer.
    """
    _need("distributed", "Dask")
    import dask
    from distributed import Client, LocalCluster

    settings = {"distributed.scheduler.allowed-failures": _DEATHS, "distributed.comm.timeouts.connect": f"{_CONNECT}s",
                "distributed.admin.large-graph-warning-threshold": "1GB",
                "distributed.worker.memory.terminate": False, "distributed.worker.memory.pause": False}
    with contextlib.ExitStack() as stack:
        stack.enter_context(dask.config.set(settings | (_QUIET if scheduler is None else {})))
        if scheduler is not None:
            try:
                yield stack.enter_context(Client(scheduler, set_as_default=False))
            except (OSError, ValueError) as error:
                raise StudyError(f"--scheduler {scheduler}: {' '.join(str(error).split())}; give it like "
                                 "tcp://host:8786") from None
            return
        if cluster:
            made = stack.enter_context(job_queue(cluster))
            made.scale(jobs=int(cluster.get("jobs", 1)))
        else:
            try:
                with _without_interrupt():
                    made = stack.enter_context(LocalCluster(
                        n_workers=workers, threads_per_worker=1, processes=True, memory_limit=0,
                        # No dashboard; without an address its server takes port 8787, and complains where it is taken.
                        dashboard_address="127.0.0.1:0", scheduler_kwargs={"dashboard": False},
                        silence_logs="CRITICAL"))
            except RuntimeError as error:  # a process that died while it started
                raise StudyError(f"the local workers cannot be started ({' '.join(str(error).split())}); try again, "
                                 "take fewer with --workers, or compute in this process with --workers 0") from None
        yield stack.enter_context(Client(made, set_as_default=False))


@contextlib.contextmanager
def _without_interrupt() -> Iterator[None]:
    """Processes that are started here do not hear the Ctrl-C of their terminal: this one ends them, in order."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def job_queue(cluster: Mapping[str, Any]) -> Any:
    """A cluster of ``dask_jobqueue`` out of a study's [cluster]: kind, jobs, and what its class takes.

    Raises:
        StudyError: it is not installed, or the configuration is wrong.
    """
    options = dict(cluster)
    kind, _ = options.pop("kind", "slurm"), options.pop("jobs", 1)
    if kind not in JOB_QUEUES:
        raise StudyError(f"[cluster] kind: {kind!r} is not known{nearest(str(kind), JOB_QUEUES)}")
    _need("dask_jobqueue", "dask-jobqueue")
    with _without_interrupt():  # importing it sets a handler of its own, by which Ctrl-C would end with status 0
        import dask_jobqueue

    chosen = getattr(dask_jobqueue, JOB_QUEUES[kind])
    options = {"cores": 1, "memory": "2GB", **options}
    try:
        # Not Dask's 8787, which another user of a login node may have taken.
        options["scheduler_options"] = {"dashboard_address": ":0", **options.get("scheduler_options", {})}
        # A job alone first: a cluster that cannot be made complains once more when it is thrown away.
        chosen.job_cls("tcp://127.0.0.1:8786", "first", **{word: value for word, value in options.items()
                                                           if word not in _OF_CLUSTER})
        return chosen(**options)
    except (TypeError, ValueError) as error:
        raise StudyError(f"[cluster]: {' '.join(str(error).split())}") from None


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _need(module: str, name: str) -> None:
    if importlib.util.find_spec(module) is None:
        raise StudyError(f"{name} is not installed; pip install 'threadpitch[study]', or compute in this process with "
                         "--workers 0")
