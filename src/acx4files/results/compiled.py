"""The lines of a table, written cell by cell into one array of bytes, compiled.

Each number has its shortest digits. Only `results.table_files` calls it; Python's ``repr`` and
its module csv write the same.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acx4lib.compiling import compiled, inlined
from acx4lib.expected import Index

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


# --- The shortest digits that read back as the same number, as in Python's ``repr``
#
# Of all decimal numbers that round to a double the shortest is taken, and of these the nearest:
# R. Giulietti, "The Schubfach way to render doubles", 2020, with the names of its section 9.


Whole = Any  # a Python or a numpy integer; of sums of both mypy knows nothing

SMALLEST, LARGEST = -292, 324
"""Range of the exponents of ten that doubles need."""


def _powers() -> NDArray[np.uint64]:
    """Return the first 128 bits of the powers of ten, rounded up, as two words, shape (n, 2)."""
    found = np.empty((LARGEST - SMALLEST + 1, 2), dtype=np.uint64)
    for row, exponent in enumerate(range(SMALLEST, LARGEST + 1)):
        power = 10 ** abs(exponent)
        bits = power.bit_length()
        if exponent < 0:
            above, below = 1 << (127 + bits), power
        else:
            above, below = power << max(128 - bits, 0), 1 << max(bits - 128, 0)
        found[row] = divmod(-(-above // below), 1 << 64)
    return found


_POWERS = _powers()
_1, _2, _4, _40 = map(np.uint64, (1, 2, 4, 40))
_32, _52, _63, _LOW = np.uint64(32), np.uint64(52), np.uint64(63), np.uint64(0xFFFFFFFF)
_FRACTION, _HIDDEN = np.uint64((1 << 52) - 1), np.uint64(1 << 52)


@inlined
def _product(a: np.uint64, b: np.uint64) -> tuple[np.uint64, np.uint64]:
    """Return high and low word of a product of two words."""
    a0, a1, b0, b1 = a & _LOW, a >> _32, b & _LOW, b >> _32
    low, middle = a0 * b0, a1 * b0
    middle += low >> _32
    other = a0 * b1 + (middle & _LOW)
    return a1 * b1 + (middle >> _32) + (other >> _32), (other << _32) | (low & _LOW)


@inlined
def _scaled(row: Whole, factor: np.uint64) -> np.uint64:
    """Return the whole part of a power of ten times a factor, odd where it is not exact."""
    carried, _ = _product(_POWERS[row, 1], factor)
    whole, part = _product(_POWERS[row, 0], factor)
    part += carried
    if part < carried:
        whole += _1
    return whole | (_1 if part > _1 else _0)


@inlined
def shortest(bits: np.uint64) -> tuple[np.uint64, Whole]:
    """Return whole number and exponent of ten of a double without its sign.

    Parameters
    ----------
    bits : np.uint64
        Of a finite number that is not zero; the sign is not looked at.

    Returns
    -------
    digits : np.uint64
        It may end with zeros.
    exponent : int
    """
    fraction, exponent = bits & _FRACTION, np.int64((bits << _1) >> (_52 + _1))
    c = fraction | _HIDDEN if exponent else fraction
    q = max(exponent, np.int64(1)) - 1075
    uneven = fraction == _0 and exponent > 1  # the smaller neighbour is nearer
    k = (q * 1262611 - (524031 if uneven else 0)) >> 22
    h = np.uint64(q + ((-k * 1741647) >> 19) + 1)
    row = -k - SMALLEST
    centre = _4 * c
    outside = c & _1  # of an odd number the bounds round to its neighbours
    lower = _scaled(row, (centre - (_1 if uneven else _2)) << h) + outside
    middle = _scaled(row, centre << h)
    upper = _scaled(row, (centre + _2) << h) - outside
    s = middle // _4
    shorter = s // _10
    below, above = lower <= _40 * shorter, _40 * shorter + _40 <= upper
    if s >= _10 and below != above:
        return (shorter + _1 if above else shorter), k + 1
    below, above = lower <= _4 * s, _4 * s + _4 <= upper
    if below != above:
        return (s + _1 if above else s), k
    half = _4 * s + _2
    up = middle > half or (middle == half and (s & _1) != _0)
    return (s + _1 if up else s), k
