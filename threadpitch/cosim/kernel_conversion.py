"""What a link does in the compiled loop: a value is copied, converted, or followed by a polynomial."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray  # type: ignore[attr-defined] # Numba's own types leave it out

from threadpitch.compiled import compiled as compiled_by_numba
from threadpitch.cosim import extrapolation
from threadpitch.cosim.calls import pointer
from threadpitch.cosim.tables import Tables

BOOLEAN = 10  # code of the one-byte truth value in tables.TYPES

# Inlined, the arrays that the kernel makes are addresses in registers.
inlined = compiled_by_numba(forceinline=True)
add_sample = inlined(extrapolation.add_sample)
polynomial = inlined(extrapolation.polynomial)


@inlined
def copy_bits(tables: Tables, c: int) -> None:
    """A value of the same type, without conversion."""
    copy, memory = tables.copies[c], tables.memory
    if copy.width == 8:
        memory.i8[copy.target] = memory.i8[copy.source]
    elif copy.width == 4:
        memory.i4[copy.target] = memory.i4[copy.source]
    elif copy.width == 2:
        memory.i2[copy.target] = memory.i2[copy.source]
    else:
        memory.i1[copy.target] = memory.i1[copy.source]


@inlined
def follow(tables: Tables, f: int, start: float) -> None:
    """Note the source's newest value, and put the polynomial's value and derivatives at ``start`` into their places."""
    one, reals = tables.follows[f], tables.memory.f8
    value = reals[one.source]
    if one.plain == 0:
        value = value * one.factor + one.shift
    add_sample(tables.samples, one.number, tables.times[one.giver], value)
    value, first, second = polynomial(tables.samples, one.number, one.order, start)
    reals[one.target] = value
    reals[one.first] = first
    if one.order > 1:
        reals[one.second] = second


@inlined
def convert(tables: Tables, c: int) -> None:
    """A value of another type, a linear transformation or a table; check.py has made sure that it fits."""
    one = tables.conversions[c]
    if one.count > 0:
        store_whole(tables, one.target_type, one.target, looked_up(tables, c))
    elif one.source_type <= 1:
        convert_real(tables, c)
    elif one.target_type == BOOLEAN or one.source_type == BOOLEAN:
        convert_truth(tables, c)
    else:
        store_whole(tables, one.target_type, one.target, load_whole(tables, one.source_type, one.source))


@inlined
def convert_real(tables: Tables, c: int) -> None:
    """target = factor source + shift, in double precision."""
    one, memory = tables.conversions[c], tables.memory
    value = memory.f8[one.source] if one.source_type == 0 else np.float64(memory.f4[one.source])
    if one.factor != 1.0 or one.shift != 0.0:
        value = value * one.factor + one.shift
    if one.target_type == 0:
        memory.f8[one.target] = value
    else:
        memory.f4[one.target] = np.float32(value)


@inlined
def convert_truth(tables: Tables, c: int) -> None:
    """Booleans of FMI 2.0 have four bytes, those of FMI 3.0 one."""
    one = tables.conversions[c]
    if one.source_type == BOOLEAN:
        tables.memory.i4[one.target] = 1 if tables.memory.u1[one.source] != 0 else 0
    else:
        tables.memory.u1[one.target] = 1 if tables.memory.i4[one.source] != 0 else 0


@inlined
def looked_up(tables: Tables, c: int) -> Any:
    """What the table of a conversion gives for the source's value; that value itself where it is not in it."""
    one = tables.conversions[c]
    value = load_whole(tables, one.source_type, one.source)
    pairs = carray(pointer(one.pairs), (2 * one.count,), np.int64)
    low, high = 0, one.count
    while low < high:
        middle = (low + high) // 2
        if pairs[middle] < value:
            low = middle + 1
        else:
            high = middle
    if low < one.count and pairs[low] == value:
        return pairs[one.count + low]
    return value


@inlined
def load_whole(tables: Tables, type_: int, index: int) -> Any:
    """A whole number of any type; one of 64 bits without sign goes nowhere else than into its like, by its bits."""
    memory = tables.memory
    if type_ in (2, 3):
        return memory.i8[index]
    if type_ == 4:
        return np.int64(memory.i4[index])
    if type_ == 5:
        return np.int64(memory.u4[index])
    if type_ == 6:
        return np.int64(memory.i2[index])
    if type_ == 7:
        return np.int64(memory.u2[index])
    if type_ == 8:
        return np.int64(memory.i1[index])
    return np.int64(memory.u1[index])


@inlined
def store_whole(tables: Tables, type_: int, index: int, value: int) -> None:
    """A whole number into a place of its type: the bits of both signs are the same."""
    memory = tables.memory
    if type_ in (2, 3):
        memory.i8[index] = value
    elif type_ in (4, 5):
        memory.i4[index] = np.int32(value)
    elif type_ in (6, 7):
        memory.i2[index] = np.int16(value)
    else:
        memory.i1[index] = np.int8(value)
