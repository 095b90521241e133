"""One scalar of an FMU: a variable of FMI 2.0, or an element of a variable of FMI 3.0."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from threadpitch.cosim.c_types import C_TYPES, c_type_name, family_of


@dataclass(frozen=True)
class FmuVariable:
    """One scalar variable. ``type`` is the word of modelDescription.xml, of FMI version ``fmi``.

    Arrays of FMI 3.0 are listed element by element, ``name[1]``, ``name[2,1]``, as FMI 2.0 names them: ``element``
    counts within ``reference`` (row by row, from 0), which holds ``size`` values. ``start`` is the element's start
    value as a number. ``choices`` names an Enumeration's values, or those of an Integer that our own annotation names.
    ``settable`` tells whether it takes a value before initialisation, ``interpolated`` whether it is an input that
    can follow a polynomial inside of a step, ``discrete`` whether it changes at events or samples only.
    """

    name: str
    reference: int
    type: str
    causality: str
    unit: str | None = None
    minimum: float | None = None
    maximum: float | None = None
    choices: Mapping[str, int] | None = None
    settable: bool = False
    fmi: int = 2
    element: int = 0
    size: int = 1
    start: float | None = None
    display: str | None = None  # unit that people read it in
    interpolated: bool = False
    discrete: bool = False

    @property
    def c_type(self) -> str:
        """The C type of its values, which names the functions that get and set it."""
        return c_type_name(self.fmi, self.type)

    @property
    def family(self) -> str:
        """Its type without the width: what people write for it, and what it may be joined to."""
        return family_of(self.type)

    @property
    def kind(self) -> str:
        """Its family, but that Enumerations are Integers to all functions."""
        return "Integer" if self.family == "Enumeration" else self.family

    @property
    def fixed(self) -> bool:
        """Whether it stays what it is when initialisation ends: a master sets no parameters in a run."""
        return self.causality in ("parameter", "calculatedParameter", "structuralParameter")

    @property
    def exchanged(self) -> bool:
        """Whether it can be connected and recorded: not texts, bytes and clocks."""
        return self.c_type in C_TYPES
