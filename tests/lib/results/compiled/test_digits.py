"""The shortest digits beside Python's own, which come from another algorithm."""

from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acx4lib.results.compiled import digits

EDGES = [5e-324, 2.2250738585072009e-308, 2.2250738585072014e-308, 1.7976931348623157e308]


def of_python(value):
    _, cells, exponent = Decimal(repr(value)).normalize().as_tuple()
    return int("".join(map(str, cells))), exponent


def ours(value):
    whole, exponent = digits.shortest(np.array(value).view(np.uint64)[()])
    whole = int(whole)
    while whole % 10 == 0:
        whole, exponent = whole // 10, exponent + 1
    return whole, exponent


@given(st.floats(min_value=5e-324, max_value=1.7976931348623157e308))
def test_digits_are_those_of_python(value):
    assert ours(value) == of_python(value)


@pytest.mark.parametrize("value", [*EDGES, 0.1, 0.3, 1.0, 4.35, 1e15, 1e22, 1e23, 2.0**53 + 2])
def test_digits_of_edges_are_those_of_python(value):
    assert ours(value) == of_python(value)


def test_powers_where_a_neighbour_is_nearer_have_the_digits_of_python():
    for exponent in range(-1074, 1024, 7):
        assert ours(2.0**exponent) == of_python(2.0**exponent)


def test_powers_of_ten_are_rounded_up_to_128_bits():
    for row in (0, 100, -digits.SMALLEST, 400, len(digits._POWERS) - 1):
        high, low = map(int, digits._POWERS[row])
        found, exponent = high << 64 | low, row + digits.SMALLEST
        power = Decimal(10) ** exponent
        assert 1 << 127 <= found < 1 << 128
        bits = (10 ** abs(exponent)).bit_length()
        shift = 128 - bits if exponent >= 0 else 127 + bits
        exact = 10**exponent * 2**shift if exponent >= 0 and shift >= 0 else None
        if exact is not None:
            assert found == exact
        assert abs(Decimal(found) / (power * Decimal(2) ** shift) - 1) < Decimal("1e-27")
