"""Tie points from pixels: true to hundredths of a pixel, honest, and silent over water."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from acx4lib.geometry.camera import inside, xy_from_colrow
from acx4lib.least_squares import processors
from acx4lib.synthetic_image.frame import head_from_synthetic, reduced_heads, synthetic_from_head
from acx4lib.tie_points.matching import (
    OverlapMatches,
    SharedWindow,
    TieOptions,
    grey,
    grey_window,
    reduced_exposure,
    shared_windows,
)
from acx4lib.tie_points.search import (
    NARROW_PX,
    WITNESSES,
    OverlapTies,
    coarse_factor,
    consensus,
    find_ties,
    strongest_chain,
)
from support.helpers import repeats
from support.pictures import taken

K = 8
NOMINAL, SYNTHETIC = taken.heads(K), taken.synthetic(K)
FULL_PX = K  # one pixel of these images in full-size ones


def errors_px(ties, true):
    """What the ties are off by in the second head: its place less where it sees the first's."""
    out = np.zeros((len(ties), 2))
    for a in range(len(true.heads)):
        for b in range(a + 1, len(true.heads)):
            own = (ties.head_a == a) & (ties.head_b == b)
            xy = synthetic_from_head(true, a, ties.colrow_a[own])
            out[own] = ties.colrow_b[own] - head_from_synthetic(true, b, xy)
    return out


def first_two(orientation):
    """Heads 1 and 2 alone, where one overlap says enough."""
    return replace(
        orientation,
        heads=orientation.heads[:2],
        xyz_mm=orientation.xyz_mm[:2],
        opk=orientation.opk[:2],
        cov_joint=orientation.cov_joint[:32, :32],
    )


def by_names(found):
    return {one.names: one for one in found.overlaps}


@pytest.fixture(scope="module")
def true():
    return taken.turned_heads(NOMINAL, 0.01, np.random.default_rng(1))


@pytest.fixture(scope="module")
def ground():
    return taken.texture(2048, np.random.default_rng(3))


@pytest.fixture(scope="module")
def images(true, ground):
    return taken.pictures(true, SYNTHETIC, ground, np.random.default_rng(5))


@pytest.fixture(scope="module")
def found(images):
    return find_ties(images, NOMINAL, SYNTHETIC, exposure=7)


# --- what comes out --------------------------------------------------------------------------


def test_ties_are_true_to_hundredths_of_a_pixel(found, true):
    error = np.hypot(*errors_px(found.ties, true).T)
    assert np.sqrt(np.mean(error**2)) < 0.04  # what is asked of full-size images
    assert np.mean(error < 0.1) > 0.98


def test_their_predicted_sigma_is_honest(found, true):
    error = errors_px(found.ties, true)
    # windows overlap: of 2 500 squares an overlap some 800 are independent, 3 sigma are 0.15
    for head_a, head_b in ((0, 1), (0, 3), (1, 2), (2, 3)):
        own = (found.ties.head_a == head_a) & (found.ties.head_b == head_b)
        normalised = error[own] / (np.sqrt(2) * found.ties.sigma_px[own, None])
        assert 0.8 < np.mean(normalised**2) < 1.2


def test_every_overlap_gives_a_point_in_nearly_every_cell(found):
    assert len(found.overlaps) == 6
    for one in found.overlaps:
        assert one.n_cells >= one.n_textured >= one.n_correlated >= one.n_matched >= one.n_ties
        assert one.n_ties > 0.8 * one.n_cells
        assert one.sentence == ""
    assert found.sentences == []


def test_ties_are_numbered_and_lie_in_their_heads(found):
    ties = found.ties
    assert len(ties) == sum(one.n_ties for one in found.overlaps) == len(found.sigma)
    assert_array_equal(ties.point_idx, np.arange(len(ties)))
    assert np.all(ties.exposure_idx == 7)
    assert np.all(ties.head_a < ties.head_b)
    for k, head in enumerate(NOMINAL.heads):
        assert inside(head, ties.colrow_a[ties.head_a == k]).all()
        assert inside(head, ties.colrow_b[ties.head_b == k]).all()


@pytest.mark.parametrize("cores", [1, 5])
def test_the_same_images_give_the_same_ties_on_any_number_of_cores(
    images, found, monkeypatch, cores
):
    monkeypatch.setattr(processors, "cores", lambda: cores)
    again = find_ties(images, NOMINAL, SYNTHETIC, exposure=7)
    for name in ("head_a", "head_b", "colrow_a", "colrow_b", "sigma_px"):
        assert_array_equal(getattr(again.ties, name), getattr(found.ties, name))


# --- other images ----------------------------------------------------------------------------


def test_a_shift_beyond_the_search_is_found_first(ground):
    """A head turned by 0.3 degrees sees things 69 full-size pixels away; the search has 2."""
    opk = NOMINAL.opk.copy()
    opk[2] += np.radians([0.3, 0.0, 0.0])
    true = replace(NOMINAL, opk=opk)
    images = taken.pictures(true, SYNTHETIC, ground, np.random.default_rng(6))
    found = find_ties(images, NOMINAL, SYNTHETIC, options=TieOptions(search_px=2))
    one = by_names(found)["CAM2", "CAM3"]
    assert np.hypot(*one.shift_px) * FULL_PX > 50
    assert one.n_ties > 0.7 * one.n_cells
    assert np.sqrt(np.mean(errors_px(found.ties, true) ** 2)) < 0.04


def test_ties_do_not_need_the_lenses(images, true, found):
    """Sixteen full-size pixels at the border, by the place alone where heads look."""
    plain = replace(
        NOMINAL,
        heads=tuple(h.with_interior(replace(h.interior, k1=0.0)) for h in NOMINAL.heads),
    )
    without = find_ties(images, plain, SYNTHETIC)
    assert len(without.ties) > 0.95 * len(found.ties)
    assert np.sqrt(np.mean(errors_px(without.ties, true) ** 2)) < 0.04


def water(shape, rng):
    """Of one level, with the noise of the taken."""
    return np.rint(9000 + 47 * rng.standard_normal(shape)).astype(np.uint16)


def test_an_overlap_of_water_gives_nothing_and_says_so(images, found):
    """Heads 3 and 4 see water where they overlap, each with noise of its own."""
    rng = np.random.default_rng(9)
    wet = [image.copy() for image in images]
    part = next(s for s in shared_windows(NOMINAL, SYNTHETIC) if (s.head_a, s.head_b) == (2, 3))
    for k in (2, 3):
        head = NOMINAL.heads[k]
        colrow = np.stack(np.meshgrid(np.arange(head.width_px), np.arange(head.height_px)), -1)
        xy = synthetic_from_head(NOMINAL, k, colrow.reshape(-1, 2).astype(float))
        row = (SYNTHETIC.height_px - 1) / 2 - xy[:, 1] / SYNTHETIC.pixel_mm
        inner = (row > part.window[0] - 20) & (row < part.window[1] + 20)
        inner = inner.reshape(colrow.shape[:2])
        wet[k][inner] = water((int(inner.sum()), 3), rng)
    with_water = find_ties(wet, NOMINAL, SYNTHETIC)
    one = by_names(with_water)["CAM3", "CAM4"]
    assert one.n_textured < 0.02 * one.n_cells
    assert one.n_ties == 0
    assert one.sentence.startswith("CAM3 and CAM4: ")
    assert one.sentence.endswith("cells have texture")
    dry = by_names(with_water)["CAM1", "CAM2"]
    assert dry.n_ties > 0.95 * by_names(found)["CAM1", "CAM2"].n_ties


def test_a_sea_without_any_texture_gives_no_ties_and_no_error():
    rng = np.random.default_rng(10)
    images = [water((h.height_px, h.width_px, 3), rng) for h in NOMINAL.heads]
    found = find_ties(images, NOMINAL, SYNTHETIC)
    assert len(found.ties) == 0
    assert len(found.sentences) == 6


def test_what_moved_between_the_heads_is_left_out(true, ground, images):
    """A part of overlap 1-2 is two pixels away when the second head looks."""
    moved = ground.copy()
    middle = np.s_[900:1100, 300:500]
    moved[middle] = np.roll(ground, 2, axis=1)[middle]
    true = first_two(true)
    later = taken.pictures(true, SYNTHETIC, moved, np.random.default_rng(5))
    found = find_ties([images[0], later[1]], first_two(NOMINAL), SYNTHETIC)
    error = np.hypot(*errors_px(found.ties, true).T)
    # the limit is half a pixel of the synthetic image
    assert error.max() < 0.55
    assert by_names(found)["CAM1", "CAM2"].n_ties > 500


def test_eight_bit_images_of_one_band_are_enough(true):
    ground = taken.texture(2048, np.random.default_rng(3), contrast=30.0, level=120.0)
    true, rng = first_two(true), np.random.default_rng(5)
    images = taken.pictures(true, SYNTHETIC, ground, rng, noise=0.1, bands=1, dtype=np.uint8)
    found = find_ties(images, first_two(NOMINAL), SYNTHETIC)
    error = np.hypot(*errors_px(found.ties, true).T)
    assert len(found.ties) > 900
    assert np.sqrt(np.mean(error**2)) < 0.06  # one grey value in thirty of contrast is noise


@pytest.mark.parametrize("quality", [75, repeats(88)])
def test_sigma_is_honest_for_eight_bits_compressed(true, quality):
    """As the frames of many cameras are; with white noise it would be half as large."""
    ground = taken.texture(2048, np.random.default_rng(3), finest=0.1, contrast=30.0, level=120.0)
    true = first_two(true)
    images = taken.pictures(
        true, SYNTHETIC, ground, np.random.default_rng(5), noise=0.1, dtype=np.uint8
    )
    found = find_ties([taken.compressed(i, quality) for i in images], first_two(NOMINAL), SYNTHETIC)
    error = errors_px(found.ties, true)
    assert len(found.ties) > 600
    assert found.sentences == []
    assert 0.8 < np.mean((error / (np.sqrt(2) * found.ties.sigma_px[:, None])) ** 2) < 1.25


def apart(full_px):
    """Heads 1 and 2, moved apart by so many full-size pixels."""
    two = first_two(NOMINAL)
    xyz = two.xyz_mm + np.outer([-1, 1], [0.0, full_px * 0.0056 / 2, 0.0])
    return replace(two, xyz_mm=xyz)


@pytest.mark.parametrize(("full_px", "width"), [(2600, 16), (2550, 23)])
def test_an_overlap_narrower_than_the_windows_is_named_with_its_width(ground, full_px, width):
    heads = apart(full_px)
    images = taken.pictures(heads, SYNTHETIC, ground, np.random.default_rng(6))
    found = find_ties(images, heads, SYNTHETIC)
    assert len(found.ties) == 0
    assert found.sentences == [
        f"CAM1 and CAM2: their pictures overlap by {width} px, and the windows of matching need "
        "28 px, so no tie points are found there"
    ]


def test_a_few_right_points_are_kept_and_said_to_be_few(images, true):
    """All but a corner of the overlap is water, which noise alone makes rough."""
    rng = np.random.default_rng(9)
    pair = [image.copy() for image in images[:2]]
    part = next(s for s in shared_windows(NOMINAL, SYNTHETIC) if (s.head_a, s.head_b) == (0, 1))
    for k, image in enumerate(pair):
        head = NOMINAL.heads[k]
        colrow = np.stack(np.meshgrid(np.arange(head.width_px), np.arange(head.height_px)), -1)
        xy = synthetic_from_head(true, k, colrow.reshape(-1, 2).astype(float))
        col = (SYNTHETIC.width_px - 1) / 2 + xy[:, 0] / SYNTHETIC.pixel_mm
        row = (SYNTHETIC.height_px - 1) / 2 - xy[:, 1] / SYNTHETIC.pixel_mm
        middle = part.window[0] + part.window[1]
        dry = (abs(col - 300) < 35) & (abs(row - middle / 2) < 35)
        wet = ~dry.reshape(image.shape[:2])
        image[wet] = water((int(wet.sum()), 3), rng)
    found = find_ties(pair, first_two(NOMINAL), SYNTHETIC)
    assert 6 <= len(found.ties) < 40
    error = np.hypot(*errors_px(found.ties, first_two(true)).T)
    assert np.median(error) < 0.12  # the shore has steps of a pixel
    assert not any("turned" in sentence for sentence in found.sentences)


# --- misuse ----------------------------------------------------------------------------------


def test_images_that_are_not_those_of_the_heads_are_refused(images):
    with pytest.raises(ValueError, match=r"images: expected \[\(841, 1123\), .*, got"):
        find_ties(images[:3], NOMINAL, SYNTHETIC)


def test_heads_that_do_not_overlap_have_no_ties(images):
    apart = replace(NOMINAL, xyz_mm=NOMINAL.xyz_mm + np.outer(np.arange(4), [500.0, 0.0, 0.0]))
    found = find_ties(images, apart, SYNTHETIC)
    assert len(found.ties) == len(found.overlaps) == 0


# --- the synthetic geometry ------------------------------------------------------------------


def test_a_head_in_the_synthetic_geometry_shows_the_ground_itself():
    """Twice interpolated by splines; a hundredth of a pixel would show as four grey values."""
    ground = taken.texture(2048, np.random.default_rng(3), finest=0.15)
    images = taken.pictures(NOMINAL, SYNTHETIC, ground, np.random.default_rng(0), noise=0.0)
    window = (900, 1100, 100, 400)
    seen = grey_window(images[0], NOMINAL, 0, SYNTHETIC, window).astype(float)
    truth = ground[window[0] : window[1], window[2] : window[3]]
    assert np.isfinite(seen).all()
    # head 1 has no gain; its vignetting is a square of the distance from its middle
    cols, rows = np.meshgrid(np.arange(window[2], window[3]), np.arange(window[0], window[1]))
    xy = xy_from_colrow(SYNTHETIC, np.stack([cols, rows], axis=-1).reshape(-1, 2).astype(float))
    head = NOMINAL.heads[0]
    mm = xy_from_colrow(head, head_from_synthetic(NOMINAL, 0, xy))
    corner = xy_from_colrow(head, np.zeros(2))
    dark = 1 - 0.2 * np.sum(mm**2, axis=1) / np.sum(corner**2)
    error = seen - dark.reshape(seen.shape) * truth
    assert np.sqrt(np.mean(error**2)) < 0.5  # most of it from rounding to whole numbers


def test_nothing_is_seen_outside_a_head(images):
    outside = grey_window(images[0], NOMINAL, 0, SYNTHETIC, (-40, 10, 1400, 1450))
    assert np.isnan(outside).all()


def test_reduced_images_hold_the_means_of_what_they_replace(images):
    small = reduced_exposure(images, NOMINAL, SYNTHETIC, 2)
    expected = reduced_heads(NOMINAL, 2).heads[0]
    assert small.images[0].shape == (expected.height_px, expected.width_px)
    # 1123 x 841 px: the last column and the last row have no partner
    blocks = grey(images[0])[:840, :1122].reshape(420, 2, 561, 2).mean(axis=(1, 3))
    assert_allclose(small.images[0], blocks, atol=0.501)  # rounded in the bands


def test_overlaps_are_where_both_heads_look():
    shared = {(s.head_a, s.head_b): s for s in shared_windows(NOMINAL, SYNTHETIC)}
    assert set(shared) == {(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)}
    row_0, row_1, col_0, col_1 = shared[0, 1].window
    # Table 1's heads: a strip on the left, in the middle of the height
    assert col_0 == 0
    assert row_0 < SYNTHETIC.height_px / 2 < row_1
    corners = [[col_0, row_0], [col_1 - 1, row_0], [col_0, row_1 - 1], [col_1 - 1, row_1 - 1]]
    assert max(np.ravel(corners)) < SYNTHETIC.height_px
    assert shared[0, 1].area_px <= (row_1 - row_0) * (col_1 - col_0)


def test_the_strongest_chain_binds_all_heads_by_pairs_that_tie_best():
    share = {(0, 1): 0.9, (0, 2): 0.2, (1, 2): 0.7, (0, 3): 0.0, (1, 3): 0.1, (2, 3): 0.8}
    pairs = [
        OverlapTies(
            head_a=a,
            head_b=b,
            names=("", ""),
            n_cells=200,
            n_textured=100,
            n_correlated=100,
            n_matched=100,
            n_ties=round(100 * one),
            shift_px=np.zeros(2),
            width_px=100.0,
            least_width_px=28.0,
        )
        for (a, b), one in share.items()
    ]
    chain = strongest_chain(pairs)
    assert [(one.head_a, one.head_b) for one in chain] == [(0, 1), (1, 2), (2, 3)]
    assert strongest_chain([]) == []


# --- Which matches agree with each other, on numbers alone; shifts by images: test_image_ties


H = np.array([[1.001, -0.002, 3.0], [0.0015, 0.999, -5.0], [1e-7, -2e-7, 1.0]])


def through_homography(colrow):
    x = np.column_stack([colrow, np.ones(len(colrow))]) @ H.T
    return x[:, :2] / x[:, 2:]


def matches(a, b):
    return OverlapMatches(
        colrow_a=a, colrow_b=b, sigma_px=np.full(a.shape, 0.05), counts=np.zeros(4, dtype=int)
    )


def places(n, rng):
    return rng.uniform([0, 1000], [2600, 8000], size=(n, 2))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 0.5))
def test_false_matches_are_told_from_those_on_a_homography(seed, share):
    rng = np.random.default_rng(seed)
    a = places(400, rng)
    b = through_homography(a) + rng.normal(scale=0.03, size=a.shape)
    false = rng.random(len(a)) < share
    b[false] += rng.choice([-1, 1], size=(false.sum(), 2)) * rng.uniform(1, 8, (false.sum(), 2))
    agree = consensus(matches(a, b), 0.5)
    assert agree[~false].all()  # 0.5 px are 17 sigma
    assert not agree[false].any()


def test_what_a_badly_known_lens_bends_is_kept_as_a_whole():
    """Radial distortion of 12 px over the overlap, of which no homography makes half a pixel."""
    rng = np.random.default_rng(0)
    a = places(2000, rng)
    off = (a - [3000, 4500]) / 4000
    b = through_homography(a) + 12 * off * np.sum(off**2, axis=1, keepdims=True)
    b[:50] += 2.0
    agree = consensus(matches(a, b), 0.5)
    assert not agree[:50].any()
    assert agree[50:].all()


@pytest.mark.parametrize("n", [0, 1, 2 + WITNESSES])
def test_few_matches_are_no_witnesses(n):
    a = places(n, np.random.default_rng(0))
    assert not consensus(matches(a, a + 1.0), 0.5).any()


def test_matches_by_chance_do_not_agree():
    rng = np.random.default_rng(4)
    a = places(600, rng)
    assert not consensus(matches(a, a + rng.uniform(-8, 8, size=a.shape)), 0.5).any()


@pytest.mark.parametrize(("reduce", "factor"), [(1, 12), (4, 3), (12, 1), (40, 1)])
def test_images_are_reduced_until_overlaps_are_narrow(reduce, factor):
    """The overlaps of Table 1's heads are 2700 px wide, section 2.1 by its numbers."""
    side = 2700 // reduce
    window = SharedWindow(
        head_a=0, head_b=1, window=(0, 3 * side, 0, side), area_px=3.0 * side**2, width_px=side
    )
    assert coarse_factor([window]) == factor
    assert side / factor < 1.5 * NARROW_PX
    assert coarse_factor([]) == 1


# --- few matches -----------------------------------------------------------------------------


@pytest.mark.parametrize(("width", "length"), [(20, 2000), (2600, 7000)])
def test_nine_right_matches_are_kept_and_false_ones_among_them_left_out(width, length):
    """Over a whole overlap, or along one that is hardly wider than the windows."""
    rng = np.random.default_rng(5)
    a = rng.uniform([0, 1000], [width, 1000 + length], size=(11, 2))
    b = through_homography(a) + rng.normal(scale=0.05, size=a.shape)
    b[9:] += [[3.0, -4.0], [-6.0, 1.0]]
    agree = consensus(matches(a, b), 0.5)
    assert agree[:9].all()
    assert not agree[9:].any()


def test_few_matches_by_chance_do_not_agree():
    rng = np.random.default_rng(6)
    for n in (6, 8, 11):
        for _ in range(100):
            a = places(n, rng)
            b = a + rng.uniform(-8, 8, size=a.shape)
            assert not consensus(matches(a, b), 0.5).any()
