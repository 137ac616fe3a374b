"""Matching of tie points, and the check of overlaps."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import ndimage

from acx4lib.tie_points.matching import BLOCK, K, best_of_cells, noise_level, response
from acx4lib.tie_points.search import check_overlaps
from support.helpers import repeats
from support.pictures import taken

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


# --- whether pictures of an exposure belong together -----------------------------------------


REDUCTION = 12
HEADS, SYNTHETIC = taken.heads(REDUCTION), taken.synthetic(REDUCTION)


def exposure(seed):
    ground = taken.texture(2048, np.random.default_rng(seed))
    return taken.pictures(HEADS, SYNTHETIC, ground, np.random.default_rng(seed + 100))


@pytest.fixture(scope="module")
def images():
    return exposure(1)


@pytest.fixture(scope="module")
def others():
    return exposure(2)


def turned(image):
    return np.ascontiguousarray(image[::-1, ::-1])


def replaced(images, **by):
    """The images with some of them replaced; head_2 is the third."""
    return [by.get(f"head_{k}", image) for k, image in enumerate(images)]


def check(images):
    return check_overlaps(images, HEADS, SYNTHETIC)


def test_pictures_that_belong_together_are_no_problem(images):
    assert check(images) == []


@pytest.mark.parametrize("k", [2, repeats(0)])
def test_a_turned_head_is_named(images, k):
    assert check(replaced(images, **{f"head_{k}": turned(images[k])})) == [
        f"CAM{k + 1}: its picture fits its neighbours only when turned by 180 degrees; turn the "
        "file or set its mount"
    ]


@pytest.mark.repeats
def test_two_turned_heads_are_both_named(images):
    found = check(replaced(images, head_0=turned(images[0]), head_1=turned(images[1])))
    assert [sentence[:5] for sentence in found] == ["CAM1:", "CAM2:"]
    assert all("turned by 180 degrees" in sentence for sentence in found)


def parallel(*grounds):
    """Heads that look the same way, and a picture of each, of a ground of its own."""
    n, rng = len(grounds), np.random.default_rng(6)
    heads = replace(
        HEADS,
        heads=HEADS.heads[:n],
        xyz_mm=HEADS.xyz_mm[:n],
        opk=np.zeros((n, 3)),
        cov_joint=np.eye(16 * n),
    )
    return heads, [
        taken.pictures(heads, SYNTHETIC, ground, rng)[k] for k, ground in enumerate(grounds)
    ]


def test_of_heads_that_look_the_same_way_the_turned_one_is_named():
    heads, seen = parallel(*[taken.texture(1024, np.random.default_rng(1))] * 3)
    found = check_overlaps(replaced(seen, head_0=turned(seen[0])), heads, SYNTHETIC)
    assert [sentence.split(":")[0] for sentence in found] == ["CAM1"]


def test_bands_in_which_a_sixth_of_the_ground_looks_alike_belong_together():
    visible, infrared = (taken.texture(1024, np.random.default_rng(k)) for k in (1, 2))
    infrared[:, 440:560] = visible[:, 440:560]
    heads, seen = parallel(visible, infrared)
    assert check_overlaps(seen, heads, SYNTHETIC) == []


@pytest.mark.parametrize("k", [1, repeats(3)])
def test_a_picture_of_another_exposure_is_named(images, others, k):
    assert check(replaced(images, **{f"head_{k}": others[k]})) == [
        f"CAM{k + 1}: its picture does not show what its neighbours show (of another exposure?)"
    ]


@pytest.mark.repeats
def test_two_and_two_exposures_are_named_as_pairs(images, others):
    found = check([*images[:2], *others[2:]])
    assert [sentence.split(":")[0] for sentence in found] == ["CAM1 and CAM4", "CAM2 and CAM3"]


@pytest.mark.parametrize(("a", "b"), [(0, 1), repeats(0, 3), repeats(1, 3)])
@pytest.mark.repeats
def test_exchanged_pictures_are_named(images, a, b):
    wrong = list(images)
    wrong[a], wrong[b] = images[b], images[a]
    assert check(wrong) == [
        f"CAM{a + 1}: its picture is exchanged with that of CAM{b + 1}; exchange their files"
    ]


@pytest.mark.repeats
def test_pictures_that_changed_places_in_a_ring_are_named(images):
    assert check([images[1], images[2], images[0], images[3]]) == [
        "CAM1: its picture is that of CAM2, in whose place it fits",
        "CAM2: its picture is that of CAM3, in whose place it fits",
        "CAM3: its picture is that of CAM1, in whose place it fits",
    ]


def water(image, rng):
    return np.rint(9000 + 47 * rng.standard_normal(image.shape)).astype(np.uint16)


@pytest.mark.repeats
def test_water_accuses_nobody(images):
    rng = np.random.default_rng(3)
    wet = [water(image, rng) for image in images]
    assert check(wet) == []
    assert check([*images[:2], *wet[2:]]) == []
    assert check([images[0], *wet[1:]]) == []


def test_a_head_shifted_by_a_hundred_pixels_still_fits(images):
    moved = np.roll(images[1], 100 // REDUCTION, axis=1)
    assert check(replaced(images, head_1=moved)) == []
