"""Differences along the axes of the CRS, their sigma, and the errors that they share."""

import numpy as np
from numpy.testing import assert_allclose

from acx4lib.geometry.collinearity import project
from acx4lib.georeferencing.differences import compare, rays_of_pairs
from acx4lib.georeferencing.validation import validate


def test_a_point_that_was_not_met_has_no_difference(block):
    x_m = block.check.x_m.copy()
    x_m[1] = np.nan
    d, sigma = compare(block, x_m, np.tile(0.01 * np.eye(3), (4, 1, 1)), np.arange(4))
    assert np.isnan(d[1]).all()
    assert_allclose(np.delete(d, 1, axis=0), 0.0, atol=1e-7)
    assert np.isfinite(sigma).all()


def test_sigmas_have_the_surveys_part_and_lie_along_the_axes_of_the_crs(block):
    R = block.check.R_g_m
    cov_grid = np.diag([0.03, 0.05, 0.20]) ** 2
    cov = np.swapaxes(R, 1, 2) @ cov_grid @ R
    _, sigma = compare(block, block.check.x_m, cov, np.arange(4))
    expected = np.hypot([0.03, 0.05, 0.20], [0.01, 0.01, 0.02])
    assert_allclose(sigma, np.tile(expected, (4, 1)), rtol=1e-9)


def test_the_sources_of_a_difference_add_up_to_its_sigma(block, cameras):
    found = validate(block, cameras, method="given")
    for differences in (found.pairs, found.points):
        variance = np.diagonal(differences.sources.cov, axis1=1, axis2=2)
        assert_allclose(np.sqrt(variance), differences.sigma, rtol=1e-9)


def test_the_rays_of_a_pair_are_where_its_two_images_show_the_point(block, cameras):
    found = validate(block, cameras, method="given")
    k = len(found.pairs) - 1
    rays = rays_of_pairs(block, found.pairs, [k])
    assert rays.image_idx.tolist() == found.pairs.image_idx[k].tolist()
    point = block.check.x_m[found.pairs.point_idx[k]]
    (camera,) = found.georeferenced.cameras
    for i, colrow in zip(rays.image_idx, rays.colrow, strict=True):
        shown = project(camera, found.georeferenced.T_m_c[[i]], point[None])
        assert_allclose(colrow, shown[0], atol=1e-6)  # measured without noise


def test_without_a_choice_the_rays_are_those_of_all_pairs(block, cameras):
    pairs = validate(block, cameras, method="given").pairs
    rays = rays_of_pairs(block, pairs)
    assert rays.image_idx.tolist() == pairs.image_idx.ravel().tolist()
    assert rays.n_groups == len(pairs)
