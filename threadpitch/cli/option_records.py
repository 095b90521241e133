"""Options that several commands share, as the fields of one parameter.

``@with_option_records`` puts the fields of a dataclass, each ``name: Annotated[type, typer.Option(...)] = default``, in
the place of every parameter of such a type, for the command line, and gives the command the dataclass.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import wraps
from typing import Any, get_type_hints


def with_option_records(command: Callable[..., None]) -> Callable[..., None]:
    """A command with records of options among its parameters -> one with the options in their places."""
    own = inspect.signature(command, eval_str=True).parameters.values()
    records: dict[str, Any] = {one.name: one.annotation for one in own if is_dataclass(one.annotation)}
    parameters = [option for one in own for option in (
        _options(records[one.name]) if one.name in records else [one.replace(kind=inspect.Parameter.KEYWORD_ONLY)])]

    @wraps(command)
    def taking(**given: Any) -> None:
        made = {name: record(**{one.name: given.pop(one.name) for one in fields(record)})
                for name, record in records.items()}
        command(**made, **given)

    taking.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined] # what inspect looks at first
    taking.__annotations__ = {one.name: one.annotation for one in parameters}
    return taking


def _options(record: Any) -> list[inspect.Parameter]:
    hints = get_type_hints(record, include_extras=True)
    return [inspect.Parameter(one.name, inspect.Parameter.KEYWORD_ONLY, default=one.default,
                              annotation=hints[one.name]) for one in fields(record)]
