"""How many multiplications normal equations cost, with and without eliminating the points.

Divisions count as multiplications; square roots and additions are not counted.
"""

from __future__ import annotations

PER_POSE, PER_POINT = 6, 3


def cholesky(n: int) -> int:
    """Return the multiplications that factor a full symmetric matrix of n rows."""
    return n * (n - 1) * (n + 4) // 6


def banded_cholesky(n: int, width: int) -> int:
    """Return the same for a matrix whose entries lie at most `width` places off the diagonal."""
    width = min(width, n - 1)
    # the last rows of the band are those of a full matrix
    return (n - width) * width * (width + 3) // 2 + cholesky(width)


def whole(n_images: int, n_points: int, *, n_shared: int) -> int:
    """Return the multiplications that factor the whole normal matrix, its zeros not spared.

    Parameters
    ----------
    n_images, n_points : int
    n_shared : int
        Unknowns of the camera and its mounting, which all images share.
    """
    return cholesky(n_shared + PER_POSE * n_images + PER_POINT * n_points)


def elimination(n_points: int, rays: float, *, n_shared: int) -> int:
    """Return the multiplications that eliminate points: V = L L^T, Z = L^-1 W^T, and Z^T Z.

    Parameters
    ----------
    n_points : int
    rays : float
        Mean number of images of a point.
    n_shared : int
        As in `whole`.
    """
    columns = n_shared + PER_POSE * rays
    of_point = cholesky(PER_POINT) + 6 * columns + 3 * columns * (columns + 1) / 2
    return round(n_points * of_point)


def reduced(n_images: int, n_points: int, rays: float, *, n_shared: int) -> int:
    """Return the multiplications that eliminate the points and factor what remains.

    Parameters
    ----------
    n_images, n_points, rays, n_shared
        As in `whole` and `elimination`.
    """
    by_points = elimination(n_points, rays, n_shared=n_shared)
    return by_points + cholesky(n_shared + PER_POSE * n_images)
