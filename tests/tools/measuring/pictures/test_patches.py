import numpy as np

from acx4tools.measuring.pictures.patches import laid_patches, own_patches, side_of
from acx4tools.measuring.pictures.views import pixels_of_view, transferred

AT = np.array([[700, 500], [600, 420]])


def test_sides_are_odd_and_reach_far_enough():
    assert [side_of(n) for n in (1, 8, 9, 29)] == [17, 17, 33, 65]


def test_own_patches_are_the_pixels_themselves(views):
    patches = own_patches(views[0], np.array([[700, 500], [3, 2]]), 17)
    image = pixels_of_view(views[0]).mean(axis=2)
    np.testing.assert_allclose(patches.grey[:17], image[492:509, 692:709], rtol=1e-6)
    assert np.isnan(patches.grey[17:][:6]).all()  # beyond the border
    np.testing.assert_allclose(patches.grey[17:][6:, 5:], image[:11, :12], rtol=1e-6)


def test_a_picture_laid_on_a_crossing_one_shows_the_same(views, surface):
    """The strips cross at other heights: without being turned nothing would correlate."""
    a, b = views[0], views[2]
    own, laid = own_patches(a, AT, 33), laid_patches(a, b, surface, AT, 33)
    seen = np.isfinite(laid.grey)
    assert seen.mean() > 0.9
    assert np.corrcoef(own.grey[seen], laid.grey[seen])[0, 1] > 0.7
    np.testing.assert_allclose(laid.scale, 0.6, atol=0.05)  # 600 m to 1000 m above ground


def test_the_middle_of_a_patch_has_the_grey_value_of_its_place(views, surface):
    a, b = views[1], views[0]
    laid = laid_patches(a, b, surface, AT, 17)
    grey = pixels_of_view(b).mean(axis=2)
    for (col, row), (x, y) in zip(
        laid.middles, transferred(a, b, surface, AT.astype(float)), strict=True
    ):
        near = grey[int(y) - 1 : int(y) + 3, int(x) - 1 : int(x) + 3]
        assert near.min() - 500 <= laid.grey[row, col] <= near.max() + 500
