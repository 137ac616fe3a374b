"""The shortest digits that read back as the same number, as in Python's ``repr``.

Of all decimal numbers that round to a double the shortest is taken, and of these the nearest:
R. Giulietti, "The Schubfach way to render doubles", 2020, with the names of its section 9.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acx4lib.compiling import inlined

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
_0, _1, _2, _4, _10, _40 = map(np.uint64, (0, 1, 2, 4, 10, 40))  # beside a plain 1 they are floats
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
