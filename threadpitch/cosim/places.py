"""Where a run writes: places are looked at before it begins, and errors of writing tell which file and what to do."""

from __future__ import annotations

import os
import tempfile
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from threadpitch.cosim.errors import CosimError

CHECKPOINT = "checkpoint.json"  # the member by which a checkpoint is known
_MEND = "free some space, or choose another place"


def metadata_path(path: Path) -> Path:
    """``trace.csv.json`` for ``trace.csv``: what a CSV of results says of itself."""
    return path.with_name(path.name + ".json")


@contextmanager
def written(path: Path) -> Iterator[None]:
    """While a file is written, perhaps under another name first: what fails is told of the file itself.

    Raises:
        OSError: as it came, with the name of the file and how to mend it.
    """
    try:
        yield
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise OSError(error.errno, f"cannot be written ({reason}); {_MEND}", str(path)) from None


def check_places(results: Path | None, checkpoint: Path | None, inputs: Iterable[Path]) -> None:
    """Look at the files that a run is to write, before it has computed anything.

    Raises:
        CosimError: two are the same file, one is a folder or a file that the run reads, or what lies at the
            checkpoint's place is no checkpoint.
        OSError: a folder cannot be written.
    """
    files = [one for one in (results, checkpoint) if one is not None]
    if results is not None and results.suffix.lower() == ".csv":
        files.append(metadata_path(results))
    places = [one.resolve() for one in files]
    read = {one.resolve() for one in inputs}
    for number, (file, place) in enumerate(zip(files, places, strict=True)):
        if place in read:
            raise CosimError(f"{file}: is a file that the run reads; choose another name")
        if place in places[:number]:
            raise CosimError(f"{file}: is to hold two things; choose another name for the results or the checkpoint")
        folder_of_parts = file is results and file.suffix.lower() == ".parquet"
        if place.is_dir() and not folder_of_parts:
            raise CosimError(f"{file}: is a folder; choose the name of a file")
        _check_writable(file)
    if checkpoint is not None and checkpoint.exists() and not _is_checkpoint(checkpoint):
        raise CosimError(f"{checkpoint}: is there, and is no checkpoint; choose another name, or remove it")


def _is_checkpoint(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as packed:
            return CHECKPOINT in packed.namelist()
    except (zipfile.BadZipFile, OSError):
        return False


def _check_writable(file: Path) -> None:
    """Try the folder, or the nearest one above that is there; nothing is left behind."""
    nearest = next(one for one in file.absolute().parents if os.path.lexists(one))
    with written(file):
        os.rmdir(tempfile.mkdtemp(prefix=".threadpitch-", dir=nearest))
