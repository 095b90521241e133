"""A report as one HTML file that needs nothing else: opened from disk, offline, it draws itself.

Everything that came from a file goes through Jinja's escaping, or as data into JSON; the page's own policy lets no
script run but the three it was made with (by their SHA-256), and nothing be fetched.
"""

from __future__ import annotations

import base64
import hashlib
import importlib.util
import json
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from threadpitch import __version__
from threadpitch.report.content import Report, ReportError
from threadpitch.report.statements import statements
from threadpitch.tables import printable

if TYPE_CHECKING:
    from jinja2 import Environment

TEMPLATES = Path(__file__).parent / "templates"
_ROWS_AT_ONCE = 500  # of a table; a longer one is built when it is opened
_NEEDED = ("bokeh", "jinja2")
_NONE = "'none'"


@dataclass(frozen=True)
class Scripts:
    """The scripts of a page: texts that stand in it, or addresses on the server that gives it out."""

    texts: tuple[str, ...] = ()
    addresses: tuple[str, ...] = ()

    @property
    def policy(self) -> str:
        """Content-Security-Policy: what the page may do."""
        allowed = [f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
                   for text in self.texts]
        if self.addresses:
            allowed.append("'self'")
        connect = "'self'" if self.addresses else "'none'"
        return (f"default-src 'none'; script-src {' '.join(allowed) or _NONE}; style-src 'unsafe-inline'; "
                f"img-src data: blob:; connect-src {connect}; base-uri 'none'; form-action 'self'")


def write_page(report: Report, path: Path) -> None:
    """Write the report as one HTML file, which appears whole or not at all.

    Raises:
        ReportError: Bokeh or Jinja is not installed.
        OSError: the file cannot be written.
    """
    text = page(report, Scripts(texts=(bokeh_script(), page_script())))
    write_whole(path, text.encode("utf-8"))


def page(report: Report, scripts: Scripts, navigation: str = "") -> str:
    """The report as HTML.

    Raises:
        ReportError: Bokeh or Jinja is not installed.
    """
    require()
    from threadpitch.report.charts import charts
    from threadpitch.report.drawing import documents

    found = charts(report)
    return templates().get_template("report.html").render(
        title=printable(report.title), provenance=report.provenance, charts=found,
        threads=[statements(thread) for thread in report.threads],
        document=json_for_script(documents(found)), scripts=scripts, policy=scripts.policy, style=style(),
        version=__version__, navigation=navigation, rows_at_once=_ROWS_AT_ONCE)


def require() -> None:
    """Refuse where the libraries of the extra are missing.

    Raises:
        ReportError: they are, with the command that installs them.
    """
    missing = [name for name in _NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise ReportError(f"{' and '.join(missing)}: not installed; install with: pip install 'threadpitch[report]'")


def templates() -> Environment:
    """The templates, which escape whatever is put into them."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined,
                       trim_blocks=True, lstrip_blocks=True)


def bokeh_script() -> str:
    """BokehJS as the installed Bokeh ships it."""
    import bokeh

    return (Path(bokeh.__file__).parent / "server" / "static" / "js" / "bokeh.min.js").read_text(encoding="utf-8")


def page_script() -> str:
    """What the page itself does: draw the charts, listen to keys."""
    return _read("page.js")


def style() -> str:
    """How the pages look."""
    return _read("page.css")


def json_for_script(document: object) -> str:
    """JSON that may stand in a script element: no text in it can end the element."""
    text = json.dumps(document, allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def write_whole(path: Path, content: bytes) -> None:
    """Write a file that appears whole or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    if not path.parent.is_dir():
        raise FileNotFoundError(2, "there is no such folder", str(path.parent))
    if path.is_dir():
        raise IsADirectoryError(21, "is a folder; give a file name", str(path))
    descriptor, temporary = tempfile.mkstemp(prefix=".threadpitch-", dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
        Path(temporary).chmod(0o644)  # mkstemp makes files that only their owner can read
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _read(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")
