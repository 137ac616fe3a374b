"""Against differences, against the library's intersection, and against what was surveyed."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import chi2

from acx4book.foundations import example
from acx4book.foundations.adjusting import forward_intersection as rays
from acx4lib.geometry import collinearity, intersection
from support.helpers import numeric_jacobian


@pytest.mark.parametrize("k", [0, 1])
def test_rows_are_the_derivatives_of_the_library_s_projection(k):
    T, x_m = rays.cameras(), example.points()[k]

    def projected(x):
        colrow = collinearity.project(example.camera(), T, np.tile(x, (4, 1)))
        return (colrow * [0.01, -0.01] + [-19.995, 14.995]).ravel()

    A, misfit = rays.linearised(T, example.measured()[:, k], x_m)
    assert_allclose(A, numeric_jacobian(projected, x_m, step=1e-3), atol=1e-8)
    assert_allclose(misfit, example.measured()[:, k].ravel() - projected(x_m), atol=1e-12)


def test_points_lie_where_the_rays_pass_and_where_they_were_surveyed():
    T = rays.cameras()
    for k, surveyed in enumerate(example.points()):
        x_m, step = rays.intersected(T, example.measured()[:, k])
        xy = np.column_stack([example.measured()[:, k], np.full(4, -example.F_MM)])
        ray = np.einsum("nij,nj->ni", T.R, xy / np.linalg.norm(xy, axis=1, keepdims=True))
        nearest = intersection.intersect(T.r, ray, np.zeros(4, dtype=int), 1)[0]
        assert_allclose(x_m, nearest, atol=0.02)  # another measure of nearness
        assert_allclose(step.dx, 0.0, atol=1e-9)
        cov = step.cov + np.diag(np.square([0.03, 0.03, 0.05]))  # and that of the positions
        d = x_m - surveyed
        assert chi2.cdf(d @ np.linalg.solve(cov, d), 3) < 0.99
