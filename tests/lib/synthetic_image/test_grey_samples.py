"""Means of patches, against scipy's interpolation."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import ndimage

from acx4lib.synthetic_image.compiled.patch_means import patch_means


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_patches_have_the_mean_of_bilinear_samples_and_the_largest_of_their_pixels(dtype):
    rng = np.random.default_rng(5)
    image = rng.integers(0, np.iinfo(dtype).max, size=(60, 80, 3), dtype=dtype, endpoint=True)
    at = rng.uniform(2, 57, (40, 9, 2))
    mean, peak = np.zeros((40, 3)), np.zeros((40, 3), dtype)
    often = np.zeros((3, np.iinfo(dtype).max + 1), np.int64)
    patch_means(image, at, mean, peak, often)
    for band in range(3):
        places = np.moveaxis(at[..., ::-1], -1, 0)
        told = ndimage.map_coordinates(image[..., band].astype(float), places, order=1)
        # weights have single precision
        assert_allclose(mean[:, band], told.mean(axis=1), rtol=1e-5)
    col, row = np.moveaxis(np.floor(at).astype(int), -1, 0)
    corners = [image[row + i, col + j] for i in (0, 1) for j in (0, 1)]
    assert_array_equal(peak, np.max(corners, axis=(0, 2)))
    for band in range(3):
        one_of_four = image[row + 1, col + 1, band].ravel()
        assert_array_equal(often[band], np.bincount(one_of_four, minlength=often.shape[1]))
