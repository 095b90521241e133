"""The script of a PythonFMU FMU: the adapter, and below it the tables of one model."""

from __future__ import annotations

from pathlib import Path

from threadpitch.fmu.model import Model, Scalar, scalars
from threadpitch.fmu.plain import PlainModule, content_hash


def adapter_script(model: Model, plain: PlainModule) -> PlainModule:
    """The module that PythonFMU loads; like the plain module it is named by its content."""
    adapter = Path(__file__).with_name("adapter.py").read_text(encoding="utf-8")
    ranges = {variable.name: (variable.min, variable.max, dict(variable.choices) if variable.choices else None,
                              variable.unit)
              for variable in model.variables
              if variable.causality == "parameter" and (variable.min, variable.max) != (None, None)}
    lines = [
        adapter,
        "",
        f"from {plain.name} import {model.class_name}  # noqa: E402",
        "",
        "",
        f"class {model.class_name}Slave(ModelSlave):",
        f'    """{model.class_name} as an FMU."""',
        "",
        f"    model_class = {model.class_name}",
        f"    content = {plain.name!r}",
        "    variables = (",
        *(f"        {_row(scalar)!r}," for scalar in scalars(model)),
        "    )",
        "    ranges = {",
        *(f"        {name!r}: {limits!r}," for name, limits in ranges.items()),
        "    }",
        f"    errors = {dict(model.errors)!r}",
        "",
    ]
    text = "\n".join(lines)
    return PlainModule(f"{model.class_name.lower()}_fmu_{content_hash(text)}", text)


def _row(scalar: Scalar) -> tuple[str, str, int | None, str, str]:
    variable = scalar.variable
    return scalar.name, variable.name, scalar.index, variable.kind, variable.causality
