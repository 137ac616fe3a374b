"""Against counting, in code that multiplies one number at a time."""

import numpy as np
import pytest

from acx4book.foundations.adjusting import operations


def counted_cholesky(N, width):
    """Factor a banded matrix in place; return the factor and the multiplications."""
    L, n, count = np.tril(N), len(N), 0
    for j in range(n):
        for i in range(j, min(j + width + 1, n)):
            for k in range(max(0, i - width), j):
                L[i, j] -= L[i, k] * L[j, k]
                count += 1
            if i == j:
                L[j, j] = np.sqrt(L[j, j])
            else:
                L[i, j] /= L[j, j]
                count += 1
    return L, count


@pytest.mark.parametrize(("n", "width"), [(1, 0), (3, 2), (9, 8), (12, 0), (12, 4), (5, 3)])
def test_multiplications_of_cholesky(n, width):
    rng = np.random.default_rng(n)
    N = np.eye(n) * 50 + sum(np.diag(rng.normal(size=n - k), k) for k in range(width + 1))
    N = (N + N.T) / 2
    L, count = counted_cholesky(N.copy(), width)
    np.testing.assert_allclose(L, np.linalg.cholesky(N), atol=1e-12)
    assert operations.banded_cholesky(n, width) == count
    if width == n - 1:
        assert operations.cholesky(n) == count


def test_elimination_of_one_point_seen_by_four_images():
    columns = 3 + 4 * 6
    solved = sum(1 for _ in range(columns) for i in range(3) for _ in range(i + 1))
    products = sum(1 for i in range(columns) for _ in range(i + 1) for _ in range(3))
    expected = operations.cholesky(3) + solved + products
    assert operations.elimination(1, 4, n_shared=3) == expected
    assert operations.reduced(4, 2, 4, n_shared=3) == 2 * expected + operations.cholesky(27)


def test_the_whole_example_has_33_unknowns():
    assert operations.whole(4, 2, n_shared=3) == operations.cholesky(33)
