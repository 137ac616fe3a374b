"""Compiled products of small matrices against numpy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

numba = pytest.importorskip("numba")
small_products = pytest.importorskip("acx4lib.bundle.compiled.small_products")


def compiled(**shape):
    product = small_products.SmallProduct(**shape).compiled()

    @numba.njit
    def call(out, out_at, left, left_at, right, right_at):
        product(out, out_at, left, left_at, right, right_at)

    return call


@pytest.mark.parametrize(("add", "before", "sign"), [(0, 0, 1), (1, 1, 1), (-1, 1, -1)])
def test_a_product_is_written_added_or_taken_off_where_it_is_told(rng, add, before, sign):
    call = compiled(rows=3, inner=2, width=8, left=(2, 1), right=16, out=8, add=add)
    left, right, out = (
        rng.normal(size=(4, 3, 2)),
        rng.normal(size=(2, 16)),
        rng.normal(size=(2, 3, 8)),
    )
    expected = out.copy()
    expected[1] = before * expected[1] + sign * left[2] @ right[:, 8:]
    call(out, 24, left, 12, right, 8)
    assert_allclose(out, expected, rtol=1e-14, atol=1e-14)


def test_strides_take_the_transpose_of_the_left_matrix(rng):
    call = compiled(rows=6, inner=3, width=16, left=(1, 16), right=16, out=16)
    left, right, out = rng.normal(size=(3, 16)), rng.normal(size=(3, 16)), np.zeros((6, 16))
    call(out, 0, left, 0, right, 0)
    assert_allclose(out, left[:, :6].T @ right, rtol=1e-14, atol=1e-14)


def test_a_dot_product_begins_where_it_is_told(rng):
    product, a, b = small_products.dot(16), rng.normal(size=40), rng.normal(size=(2, 16))

    @numba.njit
    def call(a, b):
        return product(a, 3, b, 16)

    assert_allclose(call(a, b), a[3:19] @ b[1], rtol=1e-14)


def test_what_is_aligned_begins_where_a_line_of_the_cache_does():
    for shape in ((3,), (5, 2, 24), (1, 3, 3)):
        made = small_products.aligned(*shape)
        assert made.shape == shape
        assert not made.any()
        assert made.ctypes.data % 64 == 0
        assert made.flags.c_contiguous


def test_the_lower_triangle_of_a_symmetric_product_may_be_left_out(rng):
    call = compiled(rows=16, inner=2, width=16, left=(1, 16), right=16, out=16, add=1, upper=True)
    J, out = rng.normal(size=(2, 16)), np.zeros((16, 16))
    call(out, 0, J, 0, J, 0)
    assert_allclose(np.triu(out), np.triu(J.T @ J), rtol=1e-14, atol=1e-14)
    assert not out[8:, :8].any()
