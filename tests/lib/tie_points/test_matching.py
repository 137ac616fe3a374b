"""Corners of tie points, and the noise that their texture must exceed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import ndimage

from acx4lib.tie_points.matching import BLOCK, K, best_of_cells, noise_level, response

# --- corners of cells, and the noise that their texture must exceed --------------------------


def squares(size=80):
    """A bright square on dark ground, corners at rows and columns 24.5 and 54.5."""
    grey = np.full((size, size), 1000.0)
    grey[25:55, 25:55] = 3000.0
    return grey


def test_the_response_is_harris_formula_over_a_block():
    """Against scipy's Sobel and uniform filters, up to OpenCV's one scale."""
    rng = np.random.default_rng(0)
    grey = ndimage.gaussian_filter(rng.normal(size=(60, 70)), 1.5)
    gx, gy = ndimage.sobel(grey, axis=1), ndimage.sobel(grey, axis=0)
    xx, xy, yy = (ndimage.uniform_filter(g, BLOCK) for g in (gx * gx, gx * gy, gy * gy))
    expected = (xx * yy - xy**2 - K * (xx + yy) ** 2)[8:-8, 8:-8]
    found = response(grey)[8:-8, 8:-8]
    scale = np.abs(found).max() / np.abs(expected).max()
    # single precision, and the two large terms of the response cancel
    assert_allclose(found, scale * expected, atol=1e-4 * np.abs(found).max())


def test_corners_of_a_square_are_found_and_its_sides_are_not():
    grey = squares()
    at, _ = best_of_cells(response(grey), np.ones(grey.shape, bool), 40)
    assert len(at) == 4
    # within half the block that the squares are summed over
    assert np.abs(np.sort(at.ravel()) - np.repeat([24.5, 54.5], 4)).max() <= BLOCK / 2


@pytest.mark.parametrize("grey", [np.full((50, 50), 700.0), np.arange(2500.0).reshape(50, 50)])
def test_planes_have_no_corner(grey):
    values = response(grey)
    values[np.abs(values) < 1e-6 * np.abs(values).max()] = 0
    inner = np.zeros(grey.shape, bool)
    inner[5:-5, 5:-5] = True
    at, n_cells = best_of_cells(values, inner, 10)
    assert len(at) == 0
    assert n_cells == 25


@given(
    rows=st.integers(1, 40), cols=st.integers(1, 40), cell=st.integers(1, 15), seed=st.integers(0)
)
def test_each_cell_gives_its_best_allowed_place(rows, cols, cell, seed):
    rng = np.random.default_rng(seed)
    values, allowed = rng.normal(size=(rows, cols)), rng.random((rows, cols)) < 0.5
    at, n_cells = best_of_cells(values.astype(np.float32), allowed, cell)
    expected, cells = [], 0
    for row in range(0, rows, cell):
        for col in range(0, cols, cell):
            part = np.s_[row : row + cell, col : col + cell]
            cells += allowed[part].any()
            inner = np.where(allowed[part], values[part], 0)
            if inner.max() > 0:
                r, c = np.unravel_index(inner.argmax(), inner.shape)
                expected.append((col + c, row + r))
    assert n_cells == cells
    assert sorted(map(tuple, at.tolist())) == sorted(expected)


# --- noise -----------------------------------------------------------------------------------


def noisy(rng, *, per_value, shape=(300, 400, 3)):
    """Levels of 4 000 to 20 000 with a noise whose variance grows with them; mean of bands."""
    levels = np.linspace(4000, 20000, shape[1])[None, :, None]
    spread = np.sqrt(per_value * shape[2] * levels)
    return np.rint(levels + spread * rng.standard_normal(shape)).astype(np.uint16)


@pytest.mark.parametrize("per_value", [0.02, 0.25])
def test_the_noise_is_found_at_all_levels(per_value):
    rng = np.random.default_rng(1)
    found = noise_level(noisy(rng, per_value=per_value), rng=rng)
    # the quietest twentieth of patches lies 1.6 of their scatter of some ten percent lower
    assert 0.7 * per_value < found < 1.05 * per_value


def test_texture_in_most_of_an_image_does_not_count_as_noise():
    rng = np.random.default_rng(1)
    image = noisy(rng, per_value=0.05).astype(float)
    image[:, :300] += rng.normal(scale=2000, size=(300, 300, 1))
    found = noise_level(image.astype(np.uint16), rng=rng)
    assert 0.03 < found < 0.06


def test_an_image_without_any_noise_still_has_that_of_whole_numbers():
    flat = np.full((100, 100, 1), 500, np.uint16)
    found = noise_level(flat, rng=np.random.default_rng(0))
    assert_allclose(found, 1 / 12 / 500)
