"""The whole state of a run in one file: another process goes on from there, to the same bits.

A ZIP archive of plain bytes: ``checkpoint.json`` (metadata, counters), the network's values, samples and times, every
FMU's serialised state, and the rows that were not yet in a file. The member ``sha256`` covers all others. A checkpoint
holds no code; but its states go into the FMUs, so take it from where you would take the FMUs.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.block import Block, Blocks, Channels, Rows, Times
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.events import EventRecord
from threadpitch.cosim.memory import Memory
from threadpitch.cosim.metadata import differences
from threadpitch.cosim.network import Network
from threadpitch.cosim.places import CHECKPOINT, written
from threadpitch.cosim.recording import MemoryRows, Recorder
from threadpitch.cosim.schedule import Schedule

_Bytes: TypeAlias = bytes | memoryview

FORMAT = 1
_DOCUMENT, _DIGEST = CHECKPOINT, "sha256"
_DATE = (1980, 1, 1, 0, 0, 0)  # the first that ZIP knows: equal states make equal files


class CheckpointError(CosimError):
    """A file is no checkpoint, or not one of this run."""


@dataclass(frozen=True)
class Checkpoint:
    """What was read: the run's ``metadata``, where its results went and how far, and the members' bytes."""

    path: Path
    document: Mapping[str, Any]
    members: Mapping[str, bytes]

    @property
    def metadata(self) -> Mapping[str, Any]:
        """How the run was made."""
        found: Mapping[str, Any] = self.document["metadata"]
        return found

    def check(self, metadata: Mapping[str, Any]) -> None:
        """Compare with the run that is to go on.

        Raises:
            CheckpointError: FMUs, connections, parameters, method, step size or what is recorded differ.
        """
        found = list(differences(self.metadata, metadata))
        if found:
            more = f" (and {len(found) - 1} more)" if found[1:] else ""
            raise CheckpointError(f"{self.path}: is of another run: {found[0]}{more}; go on with what it was made with")

    def check_steps(self, schedule: Schedule) -> None:
        """Compare with the communication points that are to be reached.

        Raises:
            CheckpointError: the run is past the last of them.
        """
        done = int(self.document["steps"])
        if done > schedule.steps:
            raise CheckpointError(f"{self.path}: the run is at t = {schedule.time(done):.9g} s already; give a later "
                                  "stop time")

    def restore(self, network: Network) -> None:
        """Put everything back into a network that has been initialised.

        Raises:
            CheckpointError: what is there does not fit.
            StepError: an FMU refuses its state.
        """
        for name, array in _arrays("network", network.state):
            self._fill(name, array)
        for node in network.nodes:
            node.instance.load_state(self._member(f"state/{node.number}"))
        self._restore_rows(network.recorder)

    def _restore_rows(self, recorder: Recorder) -> None:
        recorder.go_on(int(self.document["steps"]), int(self.document["drained"]))
        recorder.events[:] = [EventRecord(**event) for event in self.document["events"]]
        for number, taking in enumerate(recorder.takings):
            taking.taken = int(self.document["takings"][number])
            last = self._block(f"rows/{number}/last", taking.channels)
            taking.last = last if len(last) else None
            if isinstance(taking.sink, MemoryRows):
                taking.sink.take(self._block(f"rows/{number}/kept", taking.channels))

    def _block(self, name: str, channels: Channels) -> Block:
        count = len(self._member(f"{name}/time")) // 8
        times, rows = np.empty(count), channels.empty(count)
        for member, array in _row_arrays(name, times, rows):
            self._fill(member, array)
        return Block.of_rows(channels, times, rows)

    def _fill(self, name: str, array: NDArray[Any]) -> None:
        found = np.frombuffer(self._member(name), np.uint8)
        flat = array.reshape(-1).view(np.uint8)
        if found.size != flat.size:
            raise self._broken()
        flat[:] = found

    def _member(self, name: str) -> bytes:
        if name not in self.members:
            raise self._broken()
        return self.members[name]

    def _broken(self) -> CheckpointError:
        return CheckpointError(f"{self.path}: does not fit the run that it claims to be of; it cannot be gone on from")


def write_checkpoint(path: Path, network: Network, metadata: Mapping[str, Any], results: Mapping[str, Any]) -> None:
    """Write the state between two steps; the file appears whole or not at all.

    ``results`` says where the rows go and how much is there.

    Raises:
        StepError: an FMU does not give its state.
        OSError: the file cannot be written.
    """
    recorder = network.recorder
    recorder.drain()
    document = {
        "format": FORMAT, "metadata": metadata, "results": results, "steps": recorder.steps,
        "drained": recorder.drained, "takings": [taking.taken for taking in recorder.takings],
        "events": [event._asdict() for event in recorder.events],
    }
    members: dict[str, _Bytes] = {_DOCUMENT: json.dumps(document, indent=1).encode()}
    members |= {name: _raw(array) for name, array in _arrays("network", network.state)}
    members |= {f"state/{node.number}": node.instance.save_state() for node in network.nodes}
    for number, taking in enumerate(recorder.takings):
        nothing = Blocks(taking.channels, ())
        kept = taking.sink.close() if isinstance(taking.sink, MemoryRows) else nothing
        for word, block in (("kept", kept), ("last", taking.last or nothing)):
            arrays = _row_arrays(f"rows/{number}/{word}", block.times, block.rows)
            members |= {name: _raw(array) for name, array in arrays}
    with written(path):
        _write(path, members | {_DIGEST: _digest(members).encode()})


def read_checkpoint(path: str | Path) -> Checkpoint:
    """Read and verify a checkpoint.

    Raises:
        CheckpointError: it is missing, damaged, or of another version.
    """
    path = Path(path)
    try:
        with zipfile.ZipFile(path) as packed:
            # Stored, not compressed: what comes out is never more than what lies there.
            if any(member.compress_type != zipfile.ZIP_STORED for member in packed.infolist()):
                raise CheckpointError(f"{path}: is not a checkpoint of threadpitch")
            members = {member.filename: packed.read(member) for member in packed.infolist()}
    except FileNotFoundError:
        raise CheckpointError(f"{path}: no such file") from None
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise CheckpointError(f"{path}: is not a readable checkpoint ({error})") from None
    digest = members.pop(_DIGEST, b"")
    if _DOCUMENT not in members:
        raise CheckpointError(f"{path}: is not a checkpoint of threadpitch")
    if digest != _digest(members).encode():
        raise CheckpointError(f"{path}: is damaged: its content does not have the digest that it was written with")
    document = json.loads(members[_DOCUMENT])
    if document.get("format") != FORMAT:
        raise CheckpointError(f"{path}: is a checkpoint of format {document.get('format')}; only {FORMAT} can be read")
    return Checkpoint(path, document, members)


def _write(path: Path, members: Mapping[str, _Bytes]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, temporary = tempfile.mkstemp(prefix=".checkpoint-", dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as packed:
                for name, content in members.items():
                    with packed.open(zipfile.ZipInfo(name, _DATE), "w", force_zip64=True) as member:
                        member.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).chmod(0o644)  # mkstemp makes files that only their owner can read
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _digest(members: Mapping[str, _Bytes]) -> str:
    found = hashlib.sha256()
    for name in sorted(members):
        found.update(f"{name} {len(members[name])}\n".encode())
        found.update(members[name])
    return found.hexdigest()


def _raw(array: NDArray[Any]) -> memoryview:
    """An array's bytes, without a copy."""
    return np.ascontiguousarray(array).reshape(-1).view(np.uint8).data


def _arrays(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    """All arrays in a tree of named tuples, by their path."""
    if isinstance(value, Memory):
        yield name, value.view(np.uint8)
    elif isinstance(value, np.ndarray):
        yield name, value
    else:
        for field, one in value._asdict().items():
            yield from _arrays(f"{name}/{field}", one)


def _row_arrays(name: str, times: Times, rows: Rows) -> Iterator[tuple[str, NDArray[Any]]]:
    yield f"{name}/time", times
    for width, columns in rows.items():
        yield f"{name}/{width}", columns
