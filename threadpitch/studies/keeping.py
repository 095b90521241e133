"""A study's folder: rows as they are done in part files of Parquet, at the end one table.

    study.json        what was asked for and what computed it
    rows/part-....    rows that are done, each file whole; several processes may add theirs
    study.parquet     all rows in their order: row, parameters (SI), outcomes, status, reason

Nothing in them depends on when, where, or in which order rows were computed.
"""

from __future__ import annotations

import json
import time as clock
import uuid
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from threadpitch.fmu.cache import write_file
from threadpitch.studies.definition import Study, study_of
from threadpitch.studies.errors import StudyError
from threadpitch.studies.evaluation import FAILED, OK, Outcome

if TYPE_CHECKING:
    import pyarrow

METADATA = b"threadpitch"
TABLE, DOCUMENT, ROWS = "study.parquet", "study.json", "rows"
OWN = ("name", "rows", "seed", "digest", "study")  # of the document, besides what tells of the provenance
_WAIT = 2.0  # s that a row waits for others before it is written
_TEXTS = 40  # bytes of a row: status, reason, and what Parquet adds
_PART = "part-{:08d}-{}.parquet"
_VERSIONS = ("components", "connections", "threadpitch", "step_size", "steps", "flavor")  # what the bits depend on


def arrow() -> Any:
    """pyarrow with its Parquet.

    Raises:
        StudyError: it is not installed.
    """
    try:
        import pyarrow.parquet
    except ImportError:
        raise StudyError("studies need pyarrow, which is not installed; pip install 'threadpitch[study]'") from None
    return pyarrow


def is_study(path: Path) -> bool:
    """Whether it is the folder of a study."""
    return (path / DOCUMENT).is_file() and (path / ROWS).is_dir()


def kept_study(path: Path) -> tuple[Study, dict[str, Any]]:
    """The study that a folder holds, and what is known of it: ``study.json``.

    Raises:
        StudyError: there is none, or it is damaged.
    """
    try:
        document = json.loads((path / DOCUMENT).read_text(encoding="utf-8"))
        return study_of(document["study"], system_at_hand=True), document
    except FileNotFoundError:
        raise StudyError(f"{path}: holds no study; give the folder that 'threadpitch study --output' wrote") from None
    except (ValueError, KeyError, TypeError) as error:
        raise StudyError(f"{path / DOCUMENT}: is damaged ({' '.join(str(error).split())})") from None


class Folder:
    """The folder of one study. Rows that are there already belong to ``done``.

    Raises (the class itself):
        StudyError: the folder holds another study, or the path is a file.
        OSError: it cannot be written.
    """

    def __init__(self, path: str | Path, study: Study, provenance: Mapping[str, Any]) -> None:
        self.path = Path(path)
        self.study = study
        self._arrow = arrow()
        self._waiting: list[Outcome] = []
        self._written = clock.monotonic()
        self._document = {"name": study.name, "rows": len(study.rows), "seed": study.design.seed,
                          "digest": study.digest, "study": study.document, **provenance}
        if self.path.exists() and not self.path.is_dir():
            raise StudyError(f"{self.path}: is a file; a study is kept in a folder, choose another name")
        (self.path / ROWS).mkdir(parents=True, exist_ok=True)
        self._check()
        self.done: dict[int, Outcome] = dict(self._read())

    @property
    def missing(self) -> list[int]:
        """The rows that are not done, in their order."""
        return [row for row in range(len(self.study.rows)) if row not in self.done]

    def forget_failed(self) -> None:
        """Let rows that failed be computed once more; what they come to then counts."""
        self.done = {row: one for row, one in self.done.items() if one.status == OK}

    def add(self, outcomes: Iterable[Outcome]) -> None:
        """Keep rows; they are in a file at the latest when ``flush`` is called or two seconds have passed.

        Raises:
            OSError: the folder cannot be written.
        """
        for outcome in outcomes:
            self.done[outcome.row] = outcome
            self._waiting.append(outcome)
        if clock.monotonic() - self._written >= _WAIT:
            self.flush()

    def flush(self) -> None:
        """Write what waits into a part of its own, which appears whole or not at all.

        Raises:
            OSError: the folder cannot be written.
        """
        self._written = clock.monotonic()
        if self._waiting:
            name = _PART.format(self._waiting[0].row, uuid.uuid4().hex[:12])
            self._write(self.path / ROWS / name, self._table(self._waiting))
            self._waiting = []

    def finish(self) -> pyarrow.Table:
        """The table of all rows that are done, in their order; written where all are.

        Raises:
            OSError: the folder cannot be written.
        """
        self.flush()
        table = self.table()
        if not self.missing:
            self._write(self.path / TABLE, table)
        return table

    def table(self) -> pyarrow.Table:
        """The table of all rows that are done, in their order."""
        table = self._table([self.done[row] for row in sorted(self.done)], with_parameters=True)
        return table.replace_schema_metadata({METADATA: json.dumps(self._document, sort_keys=True)})

    def _check(self) -> None:
        """The folder is new, or holds rows of this study that the same FMUs computed."""
        path = self.path / DOCUMENT
        if not path.is_file():
            write_file(path, json.dumps(self._document, indent=1).encode())
            return
        try:
            before = json.loads(path.read_text(encoding="utf-8"))
        except ValueError:
            raise StudyError(f"{path}: is damaged; choose another --output, or remove it") from None
        if before.get("digest") != self._document["digest"]:
            raise StudyError(f"{self.path}: holds rows of another study, or of this one before it was changed; choose "
                             "another --output, or remove it")
        for name in _VERSIONS:
            if before.get(name) != json.loads(json.dumps(self._document.get(name))):
                raise StudyError(f"{self.path}: its rows were computed with other {name}; choose another --output, or "
                                 "remove it")
        if before != json.loads(json.dumps(self._document)):  # other limits: the rows stay what they are
            write_file(path, json.dumps(self._document, indent=1).encode())

    def _read(self) -> dict[int, Outcome]:
        """The rows of all parts; of a row that failed and was computed once more, the better."""
        found: dict[int, Outcome] = {}
        for path in sorted((self.path / ROWS).glob("part-*.parquet")):
            try:
                table = self._arrow.parquet.read_table(path)
                records = table.to_pylist()
            except (self._arrow.ArrowInvalid, OSError) as error:
                raise StudyError(f"{path}: cannot be read ({' '.join(str(error).split())}); remove it, and its rows "
                                 "are computed once more") from None
            for record in records:
                row, status, reason = record.pop("row"), record.pop("status"), record.pop("reason")
                if row not in found or found[row].status == FAILED:
                    found[row] = Outcome(row, record if status == OK else {}, status, reason)
        return found

    def _table(self, outcomes: Sequence[Outcome], *, with_parameters: bool = False) -> pyarrow.Table:
        columns: dict[str, list[Any]] = {"row": [one.row for one in outcomes]}
        if with_parameters:
            for name in self.study.columns:
                columns[name] = [self.study.rows[one.row][name] for one in outcomes]
        for name in self.study.outcomes:
            columns[name] = [one.values.get(name) for one in outcomes]
        columns |= {"status": [one.status for one in outcomes], "reason": [one.reason for one in outcomes]}
        return self._arrow.table({name: self._column(name, values) for name, values in columns.items()})

    def _column(self, name: str, values: list[Any]) -> Any:
        """Numbers, truth values or texts; an outcome that is not the same kind in all rows becomes a text."""
        kinds = {type(value) for value in values if value is not None}
        if len(kinds) > 1:
            values = [None if value is None else str(value) for value in values]
        kind = self._arrow.float64() if kinds <= {float} and name not in ("row", "status", "reason") else None
        return self._arrow.array(values, kind)

    def _write(self, path: Path, table: pyarrow.Table) -> None:
        sink = self._arrow.BufferOutputStream()
        self._arrow.parquet.write_table(table, sink, compression="zstd")
        write_file(path, sink.getvalue().to_pybytes())


def folder_size(study: Study) -> int:
    """Bytes on the disk that a study takes at most: parts and table, 8 bytes a number, uncompressed."""
    in_both = 8 + _TEXTS + 8 * len(study.outcomes)
    return len(study.rows) * (2 * in_both + 8 * len(study.columns))
