"""How Dask brings a parcel to each of its workers; the only module that cannot be read without Dask."""

from __future__ import annotations

from pathlib import Path

from distributed import Worker, WorkerPlugin

from threadpitch.studies import worker as here
from threadpitch.studies.parcel import Parcel


class Delivery(WorkerPlugin):  # type: ignore[misc] # Dask ships no types
    """Puts the parcel into a worker under this name, its FMUs into the worker's folder, which Dask removes."""

    def __init__(self, name: str, parcel: Parcel) -> None:
        self._name = name
        self._parcel = parcel

    def setup(self, worker: Worker) -> None:
        """Unpack the parcel; Dask calls it when the worker begins, or when the parcel is sent.

        Raises:
            OSError: the folder cannot be written.
        """
        here.put(self._name, self._parcel, Path(worker.local_directory))

    def teardown(self, worker: Worker) -> None:
        """Forget the parcel."""
        here.forget(self._name)
