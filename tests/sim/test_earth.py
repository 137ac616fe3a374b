"""The earth: geocentric coordinates and grid attitudes are the published ones."""

import numpy as np
from numpy.testing import assert_allclose
from pyproj import Transformer

from acx4sim import earth


def test_published_vector_of_a_grid_attitude():
    """A worked example on GRS80 near Curitiba, computed in two other ways.

    Its body is forward-right-down and its angles are the camera's, its lever arm of
    (0.223, -0.399, -0.201) therefore (0.223, 0.399, 0.201) in the contract's axes.
    """
    grid = earth.Grid(crs="EPSG:31982")
    llh = np.array([[np.radians(-25.45), np.radians(-49.25), 2250.0]])
    gamma = grid.convergence(llh)
    assert_allclose(np.degrees(gamma), -0.7522096122, atol=1e-9)
    R_enu_b = earth.attitude_from_rph(np.radians([[1.25, -2.5, 37.0]]))
    R_b_c = earth.rotation_from_opk_deg((0.49665, -1.59457, 0.07984))
    opk = np.degrees(earth.opk_from_attitude(R_enu_b * R_b_c, gamma))
    assert_allclose(opk, [[0.354061763548, 1.934249251200, 52.259248857567]], atol=2e-9)
    x_g = grid.grid_from_geodetic(llh)
    assert_allclose(x_g, [[675960.7544160, 7184067.8846027, 2250.0]], atol=1e-6)
    lever = R_enu_b.apply([0.223, 0.399, 0.201])
    assert_allclose(lever[0, 2], 0.1997297, atol=1e-6)


def test_ecef_is_projs():
    grid = earth.Grid(crs="EPSG:31982")
    llh = np.array([[-0.44, -0.86, 1234.5], [0.1, 0.2, 0.0]])
    geocentric = Transformer.from_crs("EPSG:4989", "EPSG:4988", always_xy=True)
    expected = geocentric.transform(np.degrees(llh[:, 1]), np.degrees(llh[:, 0]), llh[:, 2])
    assert_allclose(grid.ecef_from_geodetic(llh), np.column_stack(expected), atol=1e-8)
