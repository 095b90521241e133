"""``model.c`` of a native FMU: the constant ``model`` of ``c/model.h``, made from the declaration."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from threadpitch.fmu.model import Model
from threadpitch.fmu.variable import Variable

_KINDS = {"float": "REAL", "int": "INTEGER", "bool": "BOOLEAN"}
_CAUSALITIES = {"parameter": "PARAMETER", "input": "INPUT", "output": "OUTPUT", "local": "LOCAL"}
_UNDECLARED = "the model reports an error that it does not declare"
_OUTSIDE = "an index is outside its array: a fault of the model"
OUTSIDE = -1  # the error number that stands for it


@dataclass(frozen=True)
class Tokens:
    """What an importer must show to instantiate the FMU."""

    guid: str  # FMI 2
    token: str  # FMI 3


def table(model: Model, class_name: str, tokens: Tokens) -> str:
    """The text of ``model.c``; ``class_name`` is the struct's name in ``equations.h``."""
    parts = [
        f"/* {model.class_name}: made by threadpitch from the declaration in {model.path.name}. */",
        '#include "model.h"\n#include "equations.h"\n\n#include <math.h>\n#include <stddef.h>',
        _instance(model, class_name),
        _functions(class_name),
        _errors(model),
        *_choices(model.variables),
        _variables(model, class_name),
    ]
    if model.clocks:
        parts.append(_clocks(model))
    return "\n\n".join([*parts, _model(model, tokens)]) + "\n"


def c_text(text: str) -> str:
    """A C string literal; what is not plain ASCII becomes octal escapes of its UTF-8 bytes."""
    plain = "".join(chr(byte) if 32 <= byte < 127 and byte not in b'"\\?' else f"\\{byte:03o}"
                    for byte in text.encode())
    return f'"{plain}"'


def _instance(model: Model, class_name: str) -> str:
    """The equations' struct, and whether an index was outside its array."""
    arrays = [variable.name for variable in model.variables if variable.size is not None]
    lines = ["typedef struct {", f"    struct {class_name} equations;", "    int64_t outside;", "} Instance;", "",
             "static void attach(Instance *self) {", "    self->outside = 0;"]
    lines += [f"    self->equations.{name}.outside = &self->outside;" for name in arrays]
    return "\n".join([*lines, "}"])


def _functions(class_name: str) -> str:
    return f"""static void create(void *self) {{
    {class_name}__init__(&((Instance *)self)->equations);
}}

static void destroy(void *self) {{
    {class_name}__del__(&((Instance *)self)->equations);
}}

static int64_t check(void *self) {{
    Instance *instance = self;
    int64_t number;
    attach(instance);
    number = {class_name}__check(&instance->equations);
    return instance->outside ? {OUTSIDE} : number;
}}

static int64_t initialize(void *self) {{
    Instance *instance = self;
    attach(instance);
    {class_name}__initialize(&instance->equations);
    return instance->outside ? {OUTSIDE} : 0;
}}

static int64_t step(void *self, double time, double step_size) {{
    Instance *instance = self;
    int64_t number;
    attach(instance);
    number = {class_name}__step(&instance->equations, time, step_size);
    return instance->outside ? {OUTSIDE} : number;
}}"""


def _errors(model: Model) -> str:
    lines = ["static const char *error(int64_t number) {", "    switch (number) {"]
    for number, text in sorted({OUTSIDE: _OUTSIDE, **model.errors}.items()):
        lines += [f"    case {number}:", f"        return {c_text(text)};"]
    return "\n".join([*lines, "    default:", f"        return {c_text(_UNDECLARED)};", "    }", "}"])


def _choices(variables: Iterable[Variable]) -> list[str]:
    parts = []
    for variable in variables:
        if variable.choices:
            numbers = ", ".join(str(number) for number in variable.choices.values())
            names = ", ".join(c_text(name) for name in variable.choices)
            parts.append(f"static const int64_t {variable.name}_choices[] = {{{numbers}}};\n"
                         f"static const char *const {variable.name}_choice_names[] = {{{names}}};")
    return parts


def _variables(model: Model, class_name: str) -> str:
    index = {variable.name: number for number, variable in enumerate(model.variables)}
    lines = [f"#define PLACE(member) (offsetof(Instance, equations) + offsetof(struct {class_name}, member))", "",
             "static const Variable variables[] = {"]
    lines += ["    {" + ", ".join(f".{name} = {value}" for name, value in _row(variable, index)) + "},"
              for variable in model.variables]
    return "\n".join([*lines, "};"])


def _row(variable: Variable, index: Mapping[str, int]) -> Iterator[tuple[str, str]]:
    """The members of the C struct ``Variable`` that are not 0."""
    yield "name", c_text(variable.name)
    yield "kind", _KINDS[variable.kind]
    yield "causality", _CAUSALITIES[variable.causality]
    yield "offset", f"PLACE({variable.name})"
    if variable.size is not None:
        yield "size", str(variable.size)
    yield "minimum", _limit(variable.min, "-INFINITY")
    yield "maximum", _limit(variable.max, "INFINITY")
    if variable.choices:
        yield "choices", f"{variable.name}_choices"
        yield "choice_count", str(len(variable.choices))
        yield "choice_names", f"{variable.name}_choice_names"
    yield "unit", c_text(variable.unit)
    if variable.derivatives:
        yield "derivatives", str(len(variable.derivatives))
        yield "derivative", f"{{{', '.join(f'PLACE({name})' for name in variable.derivatives)}}}"
    yield "output_derivative", str(-1 if variable.derivative is None else index[variable.derivative])


def _clocks(model: Model) -> str:
    index = {variable.name: number for number, variable in enumerate(model.variables)}
    rows = [f"    {{.name = {c_text(clock.name)}, .variable = {index[clock.ticks]}, .element = {clock.element}}},"
            for clock in model.clocks]
    return "\n".join(["static const Clock clocks[] = {", *rows, "};"])


def _model(model: Model, tokens: Tokens) -> str:
    members = {"name": c_text(model.class_name), "token2": c_text(tokens.guid), "token3": c_text(tokens.token),
               "size": "sizeof(Instance)", "variables": "variables", "variable_count": str(len(model.variables))}
    if model.clocks:
        members |= {"clocks": "clocks", "clock_count": str(len(model.clocks))}
    members |= {name: name for name in ("create", "destroy", "check", "initialize", "step", "error")}
    return "\n".join(["const Model model = {", *(f"    .{name} = {value}," for name, value in members.items()), "};"])


def _limit(value: float | int | None, absent: str) -> str:
    return absent if value is None else repr(float(value))
