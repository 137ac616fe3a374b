"""Requests for memory before it is needed, for compiled code that reads it in jumps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

_INT = ir.IntType(32)
_EMIT: Any = cgutils  # it has no types, nor has `intrinsic`
_emitted: Callable[[Callable[..., Any]], Callable[..., Any]] = intrinsic


@_emitted
def ask_to_read(_typing: Any, address: Any) -> Any:
    """Ask the processor to load memory that will be read: ``ask_to_read(address)``."""
    return types.void(address), lambda *given: _ask(given[0], given[1], given[3][0], 0)


@_emitted
def ask_to_write(_typing: Any, address: Any) -> Any:
    """Ask the processor to load memory that will be written: ``ask_to_write(address)``."""
    return types.void(address), lambda *given: _ask(given[0], given[1], given[3][0], 1)


def _ask(context: Any, builder: ir.IRBuilder, address: Any, write: int) -> Any:
    pointer = ir.IntType(8).as_pointer()
    kind = ir.FunctionType(ir.VoidType(), [pointer, _INT, _INT, _INT])
    ask = _EMIT.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
    how = [ir.Constant(_INT, number) for number in (write, 3, 1)]  # 3: nearest cache, 1: data
    builder.call(ask, [builder.inttoptr(address, pointer), *how])
    return context.get_dummy_value()
