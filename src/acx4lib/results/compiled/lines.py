"""The lines of a table, written cell by cell into one array of bytes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acx4lib.compiling import compiled, inlined
from acx4lib.expected import Index
from acx4lib.results.compiled.digits import Whole, shortest

Words = NDArray[np.unsignedinteger[Any]]
"""Bytes of text, or the bits of numbers."""

LONGEST = 24
"""Largest number of bytes of a number."""

_COMMA, _END, _MINUS, _PLUS, _POINT, _ZERO, _E = map(ord, ",\n-+.0e")
_0, _10, _SIGN = np.uint64(0), np.uint64(10), np.uint64(63)  # beside a plain 1 they are floats
_SIZE, _NOT_FINITE = np.uint64((1 << 63) - 1), np.uint64(0x7FF << 52)


@inlined
def _put_zeros(out: Words, at: Whole, n: Whole) -> Whole:
    for i in range(n):
        out[at + i] = _ZERO
    return at + n


@inlined
def _put_digits(out: Words, at: Whole, digits: np.uint64, n: Whole, point: Whole) -> Whole:
    """Write n digits, with a point before that of a number; none where there is no such digit."""
    for i in range(n - 1, -1, -1):
        rest = digits // _10
        out[at + (i if i < point else i + 1)] = _ZERO + np.int64(digits - rest * _10)
        digits = rest
    if point >= n:
        return at + n
    out[at + point] = _POINT
    return at + n + 1


@inlined
def _put_scientific(out: Words, at: Whole, digits: np.uint64, n: Whole, exponent: Whole) -> Whole:
    at = _put_digits(out, at, digits, n, 1)
    out[at] = _E
    out[at + 1] = _MINUS if exponent < 0 else _PLUS
    wide = 3 if abs(exponent) >= 100 else 2
    return _put_digits(out, at + 2, np.uint64(abs(exponent)), wide, wide)


@inlined
def _put_positional(out: Words, at: Whole, digits: np.uint64, n: Whole, point: Whole) -> Whole:
    if point <= 0:
        at = _put_zeros(out, at, 2 - point)
        out[at + point - 1] = _POINT
        return _put_digits(out, at, digits, n, n)
    at = _put_digits(out, at, digits, n, point)
    if point < n:
        return at
    at = _put_zeros(out, at, point - n + 2)
    out[at - 2] = _POINT
    return at


@inlined
def _put_number(out: Words, at: Whole, bits: np.uint64) -> Whole:
    """Write a number as Python's ``repr`` does; nothing where it is not finite."""
    if bits & _NOT_FINITE == _NOT_FINITE:
        return at
    if bits >> _SIGN:
        out[at] = _MINUS
        at += 1
    digits, exponent = _0, 0
    if bits & _SIZE:
        digits, exponent = shortest(bits & _SIZE)
        while digits % _10 == _0:
            digits //= _10
            exponent += 1
    n, rest = 1, digits // _10
    while rest:
        rest //= _10
        n += 1
    point = n + exponent
    if -4 < point <= 16:
        return _put_positional(out, at, digits, n, point)
    return _put_scientific(out, at, digits, n, point - 1)


@compiled
def put_lines(
    out: Words, order: Index, codes: Index, texts: Words, starts: Index, numbers: Words
) -> Whole:
    """Write the lines of a table; return the number of bytes.

    Parameters
    ----------
    out : ndarray of uint8
        Long enough: `LONGEST` for a number, and the text's length, each with a byte behind it.
    order : ndarray of int, shape (n_columns,)
        For every column the row of `codes`, or -1 - the row of `numbers`.
    codes : ndarray of int, shape (n_texts, n_rows)
        Which text a cell has.
    texts : ndarray of uint8
        All texts one behind the other, as they are in a file.
    starts : ndarray of int, shape (n + 1,)
        Where each begins.
    numbers : ndarray of uint64, shape (n_numbers, n_rows)
        The bits of doubles.
    """
    at = 0
    for row in range(codes.shape[1]):
        for column in range(len(order)):
            k = order[column]
            if k < 0:
                at = _put_number(out, at, numbers[-1 - k, row])
            else:
                code = codes[k, row]
                for i in range(starts[code], starts[code + 1]):
                    out[at] = texts[i]
                    at += 1
            out[at] = _COMMA
            at += 1
        out[at - 1] = _END
    return at
