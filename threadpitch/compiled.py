"""Numba with its cache where there is a place for it: an account without a home of its own compiles anew each time.

Numba looks at the file of the compiled function only. What is compiled into it from the files beside it (records,
inlined functions) is looked at here: the name under which a function is kept holds a digest of all of them.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

_Function = TypeVar("_Function", bound=Callable[..., Any])


def compiled(**options: Any) -> Callable[[_Function], _Function]:
    """``@compiled(nogil=True)``: the function compiled by Numba when first called, with its type kept."""

    def decorate(function: _Function) -> _Function:
        try:
            return cast(_Function, numba.njit(cache=True, **options)(_named(function)))
        except RuntimeError:  # Numba finds no folder that it may write
            return cast(_Function, numba.njit(**options)(function))

    return decorate


def compiled_callback(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """The function as a C callback of this signature."""

    def decorate(function: Callable[..., Any]) -> Any:
        try:
            return numba.cfunc(signature, cache=True)(_named(function))
        except RuntimeError:
            return numba.cfunc(signature)(function)

    return decorate


def _named(function: _Function) -> _Function:
    """The function itself, with the digest of the sources beside it in the name that its cache file gets."""
    digest = _digest(Path(function.__code__.co_filename).parent)
    if digest not in function.__qualname__:
        function.__qualname__ = f"{function.__qualname__}.{digest}"
    return function


@functools.cache
def _digest(folder: Path) -> str:
    """What all Python files of a folder are, in eight characters; of a package in an archive nothing is found."""
    found = hashlib.sha256()
    for path in sorted(folder.glob("*.py")):
        found.update(path.name.encode() + b"\0" + path.read_bytes())
    return found.hexdigest()[:8]
