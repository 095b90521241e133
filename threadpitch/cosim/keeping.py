"""What is kept of a run: results in memory or in a file, checkpoints, and the ``Result`` at its end."""

from __future__ import annotations

import logging
import time as clock
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from threadpitch.cosim.block import Channels
from threadpitch.cosim.check import Plan
from threadpitch.cosim.checkpoint import Checkpoint, CheckpointError, write_checkpoint
from threadpitch.cosim.csv_file import CsvFile
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.metadata import same_versions
from threadpitch.cosim.network import Network
from threadpitch.cosim.parquet import ParquetFolder
from threadpitch.cosim.places import check_places
from threadpitch.cosim.recording import Recorder, Sink
from threadpitch.cosim.result import Result
from threadpitch.cosim.system import SystemStructureError

SAVING_TIME = 60.0  # s of the clock between two checkpoints
KINDS = (".parquet", ".csv", ".mat")
_FLUSH_TIME = 2.0  # s: rows wait no longer for the disk in the beginning,
_FLUSH_PART = 0.02  # and no longer than this part of the time that the run has taken, lest parts become many
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Keeping:
    """Where a run's rows go (a ``KINDS`` file, or None for memory only), and its state every ``every`` seconds."""

    results: Path | None = None
    checkpoint: Path | None = None
    every: float = SAVING_TIME

    def check(self, plan: Plan) -> None:
        """Look before the run at what would fail in it.

        Raises:
            SystemStructureError: components cannot serialise their state.
            CosimError: the results' kind is not known, files stand in the way, or the time between saves is
                negative.
            OSError: a folder cannot be written.
        """
        if self.results is not None and self.results.suffix.lower() not in KINDS:
            raise CosimError(f"{self.results}: results are written as {', '.join(KINDS)}; choose a name that ends so")
        if not self.every >= 0.0:
            raise CosimError(f"a checkpoint every {self.every:g} s is not possible; give 0 s or more")
        system = plan.system.path
        check_places(self.results, self.checkpoint,
                     [*([] if system is None else [system]), *(one.path for one in plan.descriptions.values())])
        if self.checkpoint is not None:
            lacking = [f"checkpoint: {name} ({plan.descriptions[name].path.name}) cannot serialise its state (no "
                       "canSerializeFMUstate)" for name in plan.order if not plan.descriptions[name].serializes_state]
            if lacking:
                raise SystemStructureError(*lacking)

    def file(self, channels: Channels, metadata: Mapping[str, Any], saved: Checkpoint | None) -> Sink | None:
        """What grows while the run computes, or None; one that is gone on with where there is a checkpoint.

        Raises:
            CosimError, OSError: it cannot be written, or does not hold what it held.
        """
        before = {} if saved is None else saved.document["results"]
        kind, went_to = _file_kind(self.results), _file_kind(before.get("path"))
        if saved is not None and kind != went_to:
            place = before.get("path") or "memory"
            raise CheckpointError(f"{saved.path}: its results went to {place}, and cannot go on in "
                                  f"{self.results or 'memory'}")
        if self.results is None or not kind:
            return None
        if kind == ".csv":
            return CsvFile(self.results, channels, metadata, before.get("size"))
        return ParquetFolder(self.results, channels, metadata, before.get("parts", 0))


class Keeper:
    """Looks after a run between its chunks of steps, and makes its result."""

    def __init__(self, keeping: Keeping, recorder: Recorder, file: Sink | None, metadata: Mapping[str, Any],
                 warnings: Callable[[], list[str]]) -> None:
        self._keeping = keeping
        self._recorder = recorder
        self._file = file
        self._metadata = metadata
        self._warnings = warnings
        self._network: Network | None = None
        self._unsaved: list[str] = []
        self._began = self._flushed = self._saved = clock.perf_counter()

    def watch(self, network: Network) -> None:
        """Look after this network from now on."""
        self._network = network

    def __call__(self) -> None:
        """Between two chunks: bring rows to the disk and write a checkpoint, where it is time."""
        now = clock.perf_counter()
        if self._keeping.checkpoint is not None and now - self._saved >= self._keeping.every:
            self.save()
        elif self._file is not None and now - self._flushed >= max(_FLUSH_TIME, _FLUSH_PART * (now - self._began)):
            self._recorder.drain()
            self._flushed = now

    def save(self) -> None:
        """Write a checkpoint, where one is wanted; a disk that does not take it is a warning, and the run goes on."""
        if self._keeping.checkpoint is None or self._network is None:
            return
        self._recorder.drain()
        path = None if self._keeping.results is None else str(self._keeping.results.absolute())
        position = {} if self._file is None else self._file.position()
        try:
            write_checkpoint(self._keeping.checkpoint, self._network, self._metadata, {"path": path, **position})
        except OSError as error:
            self._unsaved.append(f"no checkpoint at step {self._recorder.steps}: {error.filename}: {error.strerror}")
        self._saved = self._flushed = clock.perf_counter()

    def save_at_the_end(self) -> None:
        """Write a checkpoint of a run that ends before its time: what fails now must not hide why it ends."""
        try:
            self.save()
        except (CosimError, OSError) as error:
            _log.warning("no checkpoint: %s", error)

    def result(self) -> Result | None:
        """All that was recorded; None where nothing was. Files are complete after that."""
        if not self._recorder.drained + self._recorder.filled:
            return None
        wall_time = clock.perf_counter() - self._began
        warnings = [*self._warnings(), *self._unsaved[-1:]]
        result, *watched = (Result(self._recorder, wall_time=wall_time, order=self._metadata["order"],
                                   warnings=warnings, metadata=self._metadata, taking=number)
                            for number in range(len(self._recorder.takings)))
        result.watched = watched[0] if watched else None
        result.path = self._keeping.results
        if result.path is not None and self._file is None:
            result.save_mat(result.path)
        return result


def _file_kind(path: Path | str | None) -> str:
    """The kind of file that grows while a run computes; empty for memory, from which a .mat is written at the end."""
    kind = "" if path is None else Path(path).suffix.lower()
    return "" if kind == ".mat" else kind


def warn_of_versions(saved: Checkpoint) -> list[str]:
    """What has changed since the checkpoint that may change the bits."""
    texts = [f"{saved.path}: {text}; the bits may differ" for text in same_versions(saved.metadata)]
    for text in texts:
        _log.warning("%s", text)
    return texts
