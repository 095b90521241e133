"""Calling C functions at their addresses from compiled code: the FMI functions that a step needs.

All arguments but times are pointers or sizes, so that functions of the same number of arguments have one signature.
Numba holds the GIL meanwhile: FMUs that run Python in this process may take it again.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

_ADDRESS = ir.IntType(64)
_STATUS = ir.IntType(32)


def _call(builder: Any, address: Any, argument_types: list[Any], arguments: Any) -> Any:
    signature = ir.FunctionType(_STATUS, argument_types)
    return builder.call(builder.inttoptr(address, signature.as_pointer()), arguments)


@intrinsic
def _call_two(typing_context: Any, function: Any, instance: Any, state: Any) -> Any:
    """fmi2GetFMUstate and its like: (component, state or its place) -> status."""
    signature = types.int32(types.uintp, types.uintp, types.uintp)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return _call(builder, arguments[0], [_ADDRESS] * 2, arguments[1:])

    return signature, generate


@intrinsic
def _call_four(typing_context: Any, function: Any, instance: Any, references: Any, count: Any, values: Any) -> Any:
    """fmi2GetReal and its like: (component, references, count, values) -> status."""
    signature = types.int32(types.uintp, types.uintp, types.uintp, types.uintp, types.uintp)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return _call(builder, arguments[0], [_ADDRESS] * 4, arguments[1:])

    return signature, generate


@intrinsic
def _call_five(typing_context: Any, function: Any, instance: Any, references: Any, count: Any, fourth: Any,
               fifth: Any) -> Any:
    """fmi3GetFloat64 and its like, fmi2SetRealInputDerivatives: (instance, references, count, x, y) -> status."""
    signature = types.int32(types.uintp, types.uintp, types.uintp, types.uintp, types.uintp, types.uintp)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return _call(builder, arguments[0], [_ADDRESS] * 5, arguments[1:])

    return signature, generate


@intrinsic
def _call_step2(typing_context: Any, function: Any, component: Any, time: Any, step_size: Any, final: Any) -> Any:
    """fmi2DoStep(component, time, step size, final): whether the master never steps back."""
    signature = types.int32(types.uintp, types.uintp, types.float64, types.float64, types.int32)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        argument_types = [_ADDRESS, ir.DoubleType(), ir.DoubleType(), ir.IntType(32)]
        return _call(builder, arguments[0], argument_types, arguments[1:])

    return signature, generate


@intrinsic
def _call_step3(typing_context: Any, function: Any, instance: Any, time: Any, step_size: Any, final: Any,
                answers: Any) -> Any:
    """fmi3DoStep(instance, time, step size, final, answers...): see ``tables.ANSWER`` for what answers holds."""
    signature = types.int32(types.uintp, types.uintp, types.float64, types.float64, types.int32, types.uintp)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        double = ir.DoubleType()
        # A C bool travels as a whole register: 32 bits leave no rubbish in its upper part.
        argument_types = [_ADDRESS, double, double, ir.IntType(32), _ADDRESS, _ADDRESS, _ADDRESS, _ADDRESS]
        reached = arguments[5]
        flags = [builder.add(reached, ir.Constant(_ADDRESS, 8 + place)) for place in range(3)]
        values = [*arguments[1:5], *flags, reached]
        return _call(builder, arguments[0], argument_types, values)

    return signature, generate


@intrinsic
def _copy_bytes(typing_context: Any, target: Any, source: Any, count: Any) -> Any:
    """memcpy(target, source, count)."""
    signature = types.void(types.uintp, types.uintp, types.uintp)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        byte = ir.IntType(8).as_pointer()
        target, source = (builder.inttoptr(address, byte) for address in arguments[:2])
        cgutils.raw_memcpy(builder, target, source, arguments[2], 1)  # type: ignore[no-untyped-call] # Numba
        return context.get_dummy_value()

    return signature, generate


@intrinsic
def _compare_bytes(typing_context: Any, first: Any, second: Any, count: Any) -> Any:
    """memcmp(first, second, count): 0 where they are alike."""
    signature = types.int32(types.uintp, types.uintp, types.uintp)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        byte = ir.IntType(8).as_pointer()
        function = cgutils.get_or_insert_function(  # type: ignore[no-untyped-call] # Numba
            builder.module, ir.FunctionType(_STATUS, [byte, byte, _ADDRESS]), "memcmp")
        first, second = (builder.inttoptr(address, byte) for address in arguments[:2])
        return builder.call(function, [first, second, arguments[2]])

    return signature, generate


@intrinsic
def _pointer(typing_context: Any, address: Any) -> Any:
    """An address as a pointer, which ``numba.carray`` takes."""
    signature = types.voidptr(types.uintp)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], ir.IntType(8).as_pointer())

    return signature, generate


# Typed as what compiled code sees: Numba's own types show the typing context as an argument.
call_two: Any = _call_two
call_four: Any = _call_four
call_five: Any = _call_five
call_step2: Any = _call_step2
call_step3: Any = _call_step3
copy_bytes: Any = _copy_bytes
compare_bytes: Any = _compare_bytes
pointer: Any = _pointer
