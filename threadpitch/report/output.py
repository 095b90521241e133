"""Where a report goes: the suffix of the file says how it is made."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from threadpitch.report.content import Report, ReportError
from threadpitch.report.page import require as require_page
from threadpitch.report.page import write_page
from threadpitch.report.paper import require as require_paper
from threadpitch.report.paper import write_paper

_FORMATS: dict[str, tuple[Callable[[], None], Callable[[Report, Path], None]]] = {
    ".html": (require_page, write_page), ".pdf": (require_paper, write_paper),
}


def check_output(path: Path) -> None:
    """Refuse a file that cannot become a report, before anything is computed for it.

    Raises:
        ReportError: the format is not known, or what makes it is not installed.
        OSError: there is no such folder, or the file is one.
    """
    if path.suffix.lower() not in _FORMATS:
        raise ReportError(f"{path}: a report can be {' or '.join(_FORMATS)}; give the file such a name")
    _FORMATS[path.suffix.lower()][0]()
    if not path.parent.is_dir():
        raise FileNotFoundError(2, "there is no such folder", str(path.parent))
    if path.is_dir():
        raise IsADirectoryError(21, "is a folder; give a file name", str(path))


def write_report(report: Report, path: Path) -> None:
    """Write it as .html or .pdf; the file appears whole or not at all.

    Raises:
        ReportError, OSError: as ``check_output``; the file cannot be written.
    """
    check_output(path)
    _FORMATS[path.suffix.lower()][1](report, path)
