"""Figures by matplotlib, the plotting library of the field; it comes with the extra ``plot``."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_UNDATED: dict[str, dict[str, None]] = {".svg": {"Date": None}, ".png": {}, ".pdf": {"CreationDate": None}}
FORMATS = tuple(_UNDATED)
_STYLE: dict[str, object] = {
    "font.size": 9.0, "axes.grid": True, "grid.alpha": 0.3, "axes.spines.top": False, "axes.spines.right": False,
    "svg.hashsalt": "threadpitch",  # equal figures give equal files
    "axes.titlesize": 10.0, "legend.frameon": False,
}


class PlotError(ValueError):
    """A figure cannot be drawn: what is missing, and how to mend it."""


def check_figure(path: Path) -> None:
    """Refuse a file that cannot become a figure, before anything is computed for it.

    Raises:
        PlotError, OSError: as ``figure``.
    """
    if path.suffix.lower() not in FORMATS:
        raise PlotError(f"{path}: a figure can be {', '.join(FORMATS)}; give the file such a name")
    if importlib.util.find_spec("matplotlib") is None:
        raise PlotError("matplotlib is not installed; install it with: pip install 'threadpitch[plot]'")
    if not path.parent.is_dir():
        raise FileNotFoundError(2, "there is no such folder", str(path.parent))


@contextmanager
def figure(path: Path, size: tuple[float, float]) -> Iterator[Figure]:
    """An empty figure of this size (inch), written to ``path`` when the context ends; its suffix is the format.

    Raises:
        PlotError: the format is not known, or matplotlib is not installed.
        OSError: the file cannot be written.
    """
    check_figure(path)
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(_STYLE):  # type: ignore[arg-type] # its keys are literals
        made = Figure(figsize=size, layout="constrained")
        yield made
        made.savefig(path, dpi=150, metadata=_UNDATED[path.suffix.lower()])
