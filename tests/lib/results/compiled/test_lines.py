"""Compiled lines and digits are those of Python."""

from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acx4lib.results import compiled
from acx4lib.results.compiled import LONGEST, put_lines

# --- lines beside what Python's ``repr`` writes, for very many numbers -----------------------


def written(values):
    """The lines of a table of one column of numbers."""
    bits = np.ascontiguousarray(values, dtype=float).view(np.uint64)[None]
    out = np.empty((LONGEST + 1) * bits.shape[1], dtype=np.uint8)
    codes, texts, starts = np.zeros((1, bits.shape[1]), dtype=int), out[:0], np.zeros(1, dtype=int)
    n = put_lines(out, np.array([-1]), codes, texts, starts, bits)
    return out[:n].tobytes().decode().splitlines()


@pytest.mark.parametrize(
    "draw",
    [
        lambda rng: rng.integers(0, 1 << 64, 100_000, dtype=np.uint64).view(float),
        lambda rng: rng.normal(size=100_000),
        lambda rng: rng.normal(size=100_000) * 10.0 ** rng.integers(-9, 20, 100_000),
        lambda rng: np.round(rng.normal(size=100_000) * 1e4, 6),
        lambda rng: rng.integers(-(1 << 60), 1 << 60, 100_000).astype(float),
        lambda rng: 10.0 ** rng.integers(-323, 309, 1_000),
    ],
)
def test_numbers_are_written_as_python_does(draw, rng):
    values = draw(rng)
    values = values[np.isfinite(values)]
    assert written(values) == [repr(value) for value in values.tolist()]


def test_the_longest_numbers_fit_and_what_is_not_finite_is_empty():
    values = [-2.2250738585072014e-308, -0.00012345678901234567, -1.7976931348623157e308, -0.0]
    assert written(values) == list(map(repr, values))
    assert max(map(len, map(repr, values))) == LONGEST
    assert written([np.nan, np.inf, -np.inf, 0.0]) == ["", "", "", "0.0"]


def test_columns_of_text_and_numbers_stand_in_the_order_that_is_asked_for():
    cells = [b"a", b"\xc3\xa4,", b""]
    starts = np.cumsum([0, *map(len, cells)])
    bits = np.array([[0.5, 1e16, -3.0], [1.0, 2.0, np.nan]]).view(np.uint64)
    out = np.empty(200, dtype=np.uint8)
    texts = np.frombuffer(b"".join(cells), dtype=np.uint8)
    n = put_lines(out, np.array([-2, 0, -1]), np.array([[0, 1, 2]]), texts, starts, bits)
    assert out[:n].tobytes().decode() == "1.0,a,0.5\n2.0,ä,,1e+16\n,,-3.0\n"


# --- the shortest digits beside Python's own, which come from another algorithm --------------


EDGES = [5e-324, 2.2250738585072009e-308, 2.2250738585072014e-308, 1.7976931348623157e308]


def of_python(value):
    _, cells, exponent = Decimal(repr(value)).normalize().as_tuple()
    return int("".join(map(str, cells))), exponent


def ours(value):
    whole, exponent = compiled.shortest(np.array(value).view(np.uint64)[()])
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
    for row in (0, 100, -compiled.SMALLEST, 400, len(compiled._POWERS) - 1):
        high, low = map(int, compiled._POWERS[row])
        found, exponent = high << 64 | low, row + compiled.SMALLEST
        power = Decimal(10) ** exponent
        assert 1 << 127 <= found < 1 << 128
        bits = (10 ** abs(exponent)).bit_length()
        shift = 128 - bits if exponent >= 0 else 127 + bits
        exact = 10**exponent * 2**shift if exponent >= 0 and shift >= 0 else None
        if exact is not None:
            assert found == exact
        assert abs(Decimal(found) / (power * Decimal(2) ** shift) - 1) < Decimal("1e-27")
