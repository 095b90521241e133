"""Numba with its cache where there is a place for it: an account without a home of its own compiles anew each time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

_Function = TypeVar("_Function", bound=Callable[..., Any])


def compiled(**options: Any) -> Callable[[_Function], _Function]:
    """``@compiled(nogil=True)``: the function compiled by Numba when first called, with its type kept."""

    def decorate(function: _Function) -> _Function:
        try:
            return cast(_Function, numba.njit(cache=True, **options)(function))
        except RuntimeError:  # Numba finds no folder that it may write
            return cast(_Function, numba.njit(**options)(function))

    return decorate


def compiled_callback(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """The function as a C callback of this signature."""

    def decorate(function: Callable[..., Any]) -> Any:
        try:
            return numba.cfunc(signature, cache=True)(function)
        except RuntimeError:
            return numba.cfunc(signature)(function)

    return decorate
