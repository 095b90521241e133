"""``threadpitch fit``: what a drive does, out of a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from threadpitch.cli.options import AsJson, number
from threadpitch.cli.printing import fail, print_json, printing
from threadpitch.drive_fit import CONFIDENCE_FACTOR, PARAMETERS, DriveFit, read_fit
from threadpitch.fmu.cache import write_file
from threadpitch.parameters import read_assignments

_SHOWN = {"gain": ("position gain Kv", "1/s", 1.0), "lag": ("lag of the velocity loop T", "ms", 1e3),
          "feedforward": ("velocity feedforward f", "", 1.0)}
_COMPONENT = "drive"  # before the names of --known, which are read like assignments


def fit(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="Log of any format that analyze reads.",
                                        show_default=False)],
    command: Annotated[str, typer.Option(metavar="COLUMN", help="Commanded position.", show_default=False)],
    position: Annotated[str, typer.Option(metavar="COLUMN", help="Actual position.", show_default=False)],
    time: Annotated[str | None, typer.Option(metavar="COLUMN", help="Time.", show_default="time")] = None,
    position_unit: Annotated[str | None, typer.Option(
        metavar="mm|m|um|inch", help="Unit of both positions.", show_default="that of the header, else mm")] = None,
    free: Annotated[list[str] | None, typer.Option(
        metavar="NAME ...", help=f"What is looked for: {', '.join(PARAMETERS)}.", show_default="gain lag")] = None,
    known: Annotated[list[str] | None, typer.Option(
        metavar="NAME=VALUE ...", help="What is known, SI: feedforward=1, lag=0.004.", show_default="0")] = None,
    parameters: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Write what a FeedDrive takes as TOML for run --parameters.")] = None,
    as_json: AsJson = False,
) -> None:
    """Position gain, lag and feedforward of a drive from its commanded and actual position, with uncertainty."""
    given = read_assignments([f"{_COMPONENT}.{text}" for text in known or []])
    values = {name.removeprefix(f"{_COMPONENT}."): number(str(value)) for name, value in given.items()}
    found = read_fit(log, {"time": time or "time", "command": command, "position": position}, unit=position_unit,
                     free=tuple(free or ("gain", "lag")), known=values)
    if parameters is not None:
        if parameters.suffix != ".toml":
            fail(f"{parameters}: parameters are written as TOML; give the file such a name")
        lines = [f"{name} = {value!r}" for name, value in found.parameters.items()]
        write_file(parameters, "\n".join(["[z_drive]", *lines, ""]).encode())
    with printing():
        if as_json:
            print_json(_document(found))
        else:
            print(_text(found))


def _text(found: DriveFit) -> str:
    lines = [f"{found.rows} rows every {found.period * 1e3:.4g} ms"]
    for name, (title, unit, factor) in _SHOWN.items():
        value = factor * getattr(found, name)
        if name in found.uncertainty:
            half = CONFIDENCE_FACTOR * factor * found.uncertainty[name]
            lines.append(f"{title} = {value:.6g} +- {half:.2g} {unit}".rstrip() + " (95 %)")
        else:
            lines.append(f"{title} = {value:.6g} {unit}".rstrip() + " (known)")
    lines.append(f"measured less calculated position: {found.residual * 1e6:.3g} um root mean square")
    return "\n".join(lines)


def _document(found: DriveFit) -> dict[str, Any]:
    told = found.uncertainty
    return {
        "gain_per_s": found.gain, "gain_uncertainty_per_s": told.get("gain"),
        "lag_ms": 1e3 * found.lag, "lag_uncertainty_ms": None if "lag" not in told else 1e3 * told["lag"],
        "feedforward": found.feedforward, "feedforward_uncertainty": told.get("feedforward"),
        "residual_um": 1e6 * found.residual, "period_ms": 1e3 * found.period, "rows": found.rows,
    }
