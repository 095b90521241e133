"""The pages made from a declaration: ``documentation/index.html`` of the FMU, and a Markdown table of the variables."""

from __future__ import annotations

import html
import math
from pathlib import Path

from threadpitch.fmu.model import Model
from threadpitch.fmu.quantities import described
from threadpitch.fmu.variable import Variable
from threadpitch.units import from_si

_HEADINGS = {"parameter": "Parameters", "input": "Inputs", "output": "Outputs", "local": "States"}
_ORDER = ("input", "output", "parameter", "local")
_COLUMNS = ("Name", "Type", "Unit", "Start", "Range", "Description")
_GENERIC_ICON = Path(__file__).with_name("icon.png")
_STYLE = """body{font-family:sans-serif;max-width:70em;margin:2em auto;padding:0 1em;color:#222}
table{border-collapse:collapse;width:100%}th,td{text-align:left;vertical-align:top;padding:.25em .6em;
border-bottom:1px solid #ccc}pre{background:#f4f4f4;padding:.8em;white-space:pre-wrap}"""


def icon(model: Model) -> bytes:
    """The PNG ``icons/<Class>.png`` beside the model's file, or the generic one."""
    own = model.path.parent / "icons" / f"{model.class_name}.png"
    return (own if own.is_file() else _GENERIC_ICON).read_bytes()


def html_page(model: Model) -> str:
    """``documentation/index.html``: description with its equations, variables, declared errors."""
    summary, _, rest = model.description.partition("\n\n")
    parts = [
        "<!DOCTYPE html>", '<html lang="en">', "<head>", '<meta charset="utf-8">',
        f"<title>{model.class_name}</title>", f"<style>{_STYLE}</style>", "</head>", "<body>",
        f"<h1>{model.class_name}</h1>", f"<p>{html.escape(' '.join(summary.split()))}</p>",
    ]
    if rest:
        parts.append(f"<pre>{html.escape(rest)}</pre>")
    for causality in _ORDER:
        rows = [_row(variable) for variable in model.variables if variable.causality == causality]
        if rows:
            parts += [f"<h2>{_HEADINGS[causality]}</h2>", *_html_table(rows)]
    if model.errors:
        parts += ["<h2>Errors</h2>", "<ul>"]
        parts += [f"<li>{number}: {html.escape(text)}</li>" for number, text in sorted(model.errors.items())]
        parts.append("</ul>")
    parts.append('<p><a href="upgrade.html">Replacing this FMU by a newer one</a></p>')
    return "\n".join([*parts, "</body>", "</html>", ""])


def upgrade_page(model: Model) -> str:
    """``documentation/upgrade.html``: what stays when this FMU is replaced by a newer one, and how to find out."""
    name = model.class_name
    return "\n".join([
        "<!DOCTYPE html>", '<html lang="en">', "<head>", '<meta charset="utf-8">',
        f"<title>{name}: upgrade</title>", f"<style>{_STYLE}</style>", "</head>", "<body>",
        f"<h1>{name}: replacing this FMU by a newer one</h1>",
        "<p>The names of the variables, their types and their units are stable: a newer version keeps them, and may "
        "add variables. Refer to variables by name. Value references, the GUID (FMI 3: instantiation token) and saved "
        "FMU states belong to one build and change with it.</p>",
        "<ol>",
        "<li>Replace the file and load the FMU again, so that the tool reads the new model description.</li>",
        f"<li>Compare <code>reference/{name}_ref.csv</code> of both versions: the outputs of the same short run "
        f"with the inputs of <code>reference/{name}_in.csv</code>. Where they are equal, the model's behavior in that "
        "run is.</li>",
        "<li><code>threadpitch build --check</code> runs the FMU on your machine against its reference results.</li>",
        "</ol>",
        "<p>Every row of the inputs is constant from its time to the next. The outputs are those after initialization "
        "and after every step.</p>",
        "</body>", "</html>", ""])


def markdown_table(model: Model) -> str:
    """The variables as Markdown tables, one for each causality."""
    parts = []
    for causality in _ORDER:
        rows = [_row(variable) for variable in model.variables if variable.causality == causality]
        if rows:
            parts += [f"**{_HEADINGS[causality]}**", "", f"| {' | '.join(_COLUMNS)} |", "|---" * len(_COLUMNS) + "|"]
            parts += ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows] + [""]
    return "\n".join(parts)


def _html_table(rows: list[tuple[str, ...]]) -> list[str]:
    lines = ["<table>", "<tr>" + "".join(f"<th>{column}</th>" for column in _COLUMNS) + "</tr>"]
    lines += ["<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows]
    return [*lines, "</table>"]


def _row(variable: Variable) -> tuple[str, ...]:
    kind = {"float": "Real", "int": "Integer", "bool": "Boolean"}[variable.kind]
    name = variable.name if variable.size is None else f"{variable.name}[1..{variable.size}]"
    unit = "" if variable.unit == "1" and variable.display is None else variable.display or variable.unit
    start = _shown(variable.start, variable) if variable.causality in ("parameter", "input") else ""
    return name, kind, unit, start, _range(variable), described(variable)


def _range(variable: Variable) -> str:
    if variable.choices or (variable.min is None and variable.max is None):
        return ""
    if variable.max is None:
        return f"≥ {_shown(variable.min, variable)}"
    if variable.min is None:
        return f"≤ {_shown(variable.max, variable)}"
    return f"{_shown(variable.min, variable)} to {_shown(variable.max, variable)}"


def _shown(value: float | int | bool | None, variable: Variable) -> str:
    """The value in the unit that people read, without the digits that conversion makes."""
    if value is None:
        return ""
    if variable.kind != "float":
        return str(value).lower() if variable.kind == "bool" else str(value)
    converted = from_si(float(value), variable.display or variable.unit)
    return f"{0.0 if math.isclose(converted, 0.0, abs_tol=1e-300) else converted:.9g}"
