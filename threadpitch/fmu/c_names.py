"""Names that mean something to a C compiler: keywords, macros and functions of its libraries."""

from __future__ import annotations

import ast

from threadpitch.fmu.expressions import refuse
from threadpitch.fmu.source_text import SourceText

# Functions of C's math library and macros of its headers: a name of the file would be taken for them.
_TAKEN = """
    gamma lgamma tgamma j0 j1 jn y0 y1 yn signgam erf erfc fabs fmod fmin fmax fma frexp ldexp hypot cbrt ceil trunc
    round rint pow powf index time clock main remove rename abs div exit random signal sin cos tan exp log sqrt floor
    NULL EOF I NAN INFINITY HUGE_VAL TRUE FALSE BUFSIZ RAND_MAX M_PI M_E DOMAIN OVERFLOW UNDERFLOW SING
"""
C_NAMES = frozenset(_TAKEN.split())
# Macros and types in lower case; macros in upper case are more than can be listed
_MACROS = frozenset(("linux", "unix", "errno", "stdin", "stdout", "stderr", "assert", "offsetof", "int64_t"))


def check_local(text: SourceText, node: ast.AST, name: str) -> None:
    """Refuse a local or an argument whose name a header of C replaces by something else.

    Raises:
        ModelError: the name is, or may be, a macro.
    """
    if name in _MACROS or name.startswith("__") or (name.isupper() and len(name) > 1):
        refuse(text, node, f"the local {name}, a name that C's headers may take,",
               "choose another name, in lower case")
