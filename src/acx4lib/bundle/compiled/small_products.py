"""Products of small matrices of fixed size, eight numbers at a time, for compiled code.

The compiler does not make them by itself: it cannot know that the arrays do not overlap.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from acx4lib.expected import Array

LANES = 8

_DOUBLE, _INDEX, _LANE = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
_VECTOR = ir.VectorType(_DOUBLE, LANES)
_UNSET = ir.Constant(_VECTOR, ir.Undefined)
_FIRST_LANE = ir.Constant(ir.VectorType(_LANE, LANES), [0] * LANES)
_FAST = ("reassoc", "contract", "nsz")


def aligned(*shape: int) -> Array:
    """Return zeros from a line of the processor's cache on, so that no eight lie in two lines."""
    n = prod(shape)
    longer = np.zeros(n + LANES)
    first = -(longer.__array_interface__["data"][0] // longer.itemsize) % LANES
    return longer[first : first + n].reshape(shape)


@dataclass(frozen=True, kw_only=True)
class SmallProduct:
    """A product to compile: ``out = left @ right``.

    Attributes
    ----------
    rows, inner, width : int
        `left` is (rows, inner), `right` (inner, width), `out` (rows, width); `width` is a
        multiple of eight.
    left : tuple of int
        Strides of `left`: between rows, and between the numbers of a row; ``(1, n)`` is the
        transpose of a matrix with rows of n numbers.
    right, out : int
        Strides between their rows.
    add : int
        0 overwrites `out`, 1 adds to it, -1 subtracts from it.
    upper : bool
        Skip groups of eight numbers that lie completely below the diagonal.
    """

    rows: int
    inner: int
    width: int
    left: tuple[int, int]
    right: int
    out: int
    add: int = 0
    upper: bool = False

    def compiled(self) -> Callable[..., None]:
        """Return ``product(out, out_at, left, left_at, right, right_at)``.

        Only compiled functions can call it. The arrays are contiguous, of doubles, of any shape.
        The number after an array is the position in it at which the matrix begins.
        """
        shape = self

        @intrinsic
        def product(
            _typing: Any,
            out: Any,
            out_at: Any,  # noqa: ARG001
            left: Any,
            left_at: Any,  # noqa: ARG001
            right: Any,
            right_at: Any,  # noqa: ARG001
        ) -> Any:
            index = types.int64
            signature = types.void(out, index, left, index, right, index)

            def generate(context: Any, builder: ir.IRBuilder, typed: Any, values: Any) -> Any:
                shape._write(builder, *_starts(context, builder, typed, values))
                return context.get_dummy_value()

            return signature, generate

        return product

    def _write(self, builder: ir.IRBuilder, out: Any, left: Any, right: Any) -> None:
        """Emit the product row after row; the right matrix stays in registers."""
        groups = range(0, self.width, LANES)
        rights = {
            (k, c): _load(builder, _plus(builder, right, k * self.right + c))
            for k in range(self.inner)
            for c in groups
        }
        step, along = self.left
        for r in range(self.rows):
            factors = []
            for k in range(self.inner):
                factor = builder.load(_plus(builder, left, r * step + k * along))
                factors.append(_splat(builder, builder.fneg(factor) if self.add < 0 else factor))
            for c in groups:
                if self.upper and c + LANES <= r:
                    continue
                place = _plus(builder, out, r * self.out + c)
                total = _load(builder, place) if self.add else ir.Constant(_VECTOR, [0.0] * LANES)
                for k in range(self.inner):
                    part = builder.fmul(factors[k], rights[k, c], flags=_FAST)
                    total = builder.fadd(total, part, flags=_FAST)
                _store(builder, total, place)


def dot(width: int) -> Callable[..., float]:
    """Return a compiled ``dot(left, left_at, right, right_at)`` of as many numbers.

    Parameters
    ----------
    width : int
        A multiple of eight. Everything else is as in `SmallProduct`.
    """

    @intrinsic
    def product(
        _typing: Any,
        left: Any,
        left_at: Any,  # noqa: ARG001
        right: Any,
        right_at: Any,  # noqa: ARG001
    ) -> Any:
        index = types.int64
        signature = types.double(left, index, right, index)

        def generate(context: Any, builder: ir.IRBuilder, typed: Any, values: Any) -> Any:
            starts = _starts(context, builder, typed, values)
            total = ir.Constant(_VECTOR, [0.0] * LANES)
            for c in range(0, width, LANES):
                pair = (_load(builder, _plus(builder, start, c)) for start in starts)
                total = builder.fadd(total, builder.fmul(*pair, flags=_FAST), flags=_FAST)
            kind = ir.FunctionType(_DOUBLE, [_DOUBLE, _VECTOR])
            name = f"llvm.vector.reduce.fadd.v{LANES}f64"
            reduce = cgutils.get_or_insert_function(  # type: ignore[no-untyped-call] # untyped
                builder.module, kind, name
            )
            return builder.call(reduce, [ir.Constant(_DOUBLE, 0.0), total], fastmath=_FAST)

        return signature, generate

    return product


def _starts(context: Any, builder: ir.IRBuilder, typed: Any, values: Any) -> list[Any]:
    """Return the addresses at which matrices begin, from arrays and positions in turn."""
    return [
        builder.gep(context.make_array(kind)(context, builder, array).data, [at])
        for kind, array, at in zip(typed.args[::2], values[::2], values[1::2], strict=True)
    ]


def _plus(builder: ir.IRBuilder, start: Any, offset: int) -> Any:
    return builder.gep(start, [ir.Constant(_INDEX, offset)])


def _load(builder: ir.IRBuilder, place: Any) -> Any:
    vector = builder.load(builder.bitcast(place, _VECTOR.as_pointer()))
    vector.align = 8  # of a double, as arrays may begin anywhere
    return vector


def _store(builder: ir.IRBuilder, vector: Any, place: Any) -> None:
    stored = builder.store(vector, builder.bitcast(place, _VECTOR.as_pointer()))
    stored.align = 8


def _splat(builder: ir.IRBuilder, number: Any) -> Any:
    """Repeat a number in all lanes."""
    first = builder.insert_element(_UNSET, number, ir.Constant(_LANE, 0))
    return builder.shuffle_vector(first, _UNSET, _FIRST_LANE)
