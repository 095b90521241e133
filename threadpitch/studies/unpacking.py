"""A plugin of Dask's workers: FMUs are unpacked into a worker's own folder, which goes when the worker was killed."""

from __future__ import annotations

import tempfile

from distributed import Worker, WorkerPlugin


class Unpacking(WorkerPlugin):  # type: ignore[misc] # Dask's types are not read
    """Temporary folders of a worker lie in its own."""

    name = "threadpitch-unpacking"

    def setup(self, worker: Worker) -> None:
        """When the worker begins."""
        tempfile.tempdir = worker.local_directory
