"""The renderer against closed forms, OpenCV, and the same thing computed plainly."""

from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from acx4lib.least_squares import processors
from acx4lib.synthetic_image.compiled import SHOULDER
from acx4lib.synthetic_image.frame import reduced_camera, reduced_heads
from acx4lib.synthetic_image.head_map import HeadMap
from acx4lib.synthetic_image.rendering import (
    RenderPlan,
    render,
    render_into,
    render_plan,
    resample,
    stack,
)
from acx4lib.synthetic_image.response import Response
from support.pictures import taken
from support.pictures.exact_rendering import blended, exact_positions, sampled


def affine_map(size, image_size, A, t, *, step=16):
    """Return a map that sees pixel p of an image of `size` (cols, rows) at A p + t."""
    cols, rows = (step * np.arange(-(-n // step) + 1) for n in size)
    grid = np.stack(np.meshgrid(cols, rows), axis=-1)
    return HeadMap(
        nodes=grid @ np.transpose(A) + t,
        step_px=step,
        width_px=image_size[0],
        height_px=image_size[1],
    )


def plan_of(*maps, size, **how):
    return RenderPlan(maps=maps, width_px=size[0], height_px=size[1], **how)


def identity(width, height, **how):
    return plan_of(affine_map((width, height), (width, height), np.eye(2), 0), size=(width, height))


def turned(degrees, scale):
    c, s = scale * np.cos(np.radians(degrees)), scale * np.sin(np.radians(degrees))
    return np.array([[c, -s], [s, c]])


def noise(rng, width, height, bands, dtype=np.uint16):
    return rng.integers(0, np.iinfo(dtype).max, (height, width, bands), dtype, endpoint=True)


def landscape(rng, width, height, bands=3):
    """Return an image with details of every size, the finest of a few hundred grey values."""
    image = np.full((height, width, bands), 12000.0)
    for size in (1, 2, 4, 8, 32, 128):
        coarse = rng.normal(size=(height // size + 2, width // size + 2, bands))
        image += 120 * np.sqrt(size) * cv2.resize(coarse, (width, height)).reshape(image.shape)
    return np.rint(np.clip(image, 0, 65535)).astype(np.uint16)


# --- sampling ------------------------------------------------------------------------------------


@given(
    width=st.integers(2, 70),
    height=st.integers(2, 40),
    bands=st.integers(1, 4),
    dtype=st.sampled_from([np.uint8, np.uint16]),
    seed=st.integers(0, 99),
)
def test_the_identity_copies_every_pixel(width, height, bands, dtype, seed):
    image = noise(np.random.default_rng(seed), width, height, bands, dtype)
    assert_array_equal(render(identity(width, height), [image]), image)


@pytest.mark.parametrize(
    ("bands", "dtype", "degrees"),
    [(1, np.uint16, 3.0), (2, np.uint8, 93.0), (3, np.uint16, 93.0), (4, np.uint8, 3.0)],
)
def test_bilinear_samples_are_opencvs(rng, bands, dtype, degrees):
    image = noise(rng, 180, 170, bands, dtype)
    A, t = turned(degrees, 0.9), np.array([88.2, 81.4])
    plan = plan_of(affine_map((60, 50), (180, 170), A, t), size=(60, 50))
    at = (np.stack(np.meshgrid(np.arange(60), np.arange(50)), axis=-1) @ A.T + t).astype(np.float32)
    out = render(plan, [image])
    for band in range(bands):  # one at a time: OpenCV rounds positions where there are two
        one = image[..., band].astype(np.float32)
        reference = cv2.remap(one, at[..., 0], at[..., 1], cv2.INTER_LINEAR)
        # rounding, and single precision of OpenCV's positions, 1e-5 px, times noise's contrast
        assert_allclose(out[..., band], reference, atol=0.5 + 1.0)


def test_samples_at_the_border_take_the_outermost_pixels_on(rng):
    image = noise(rng, 40, 30, 3)
    shift = np.array([-0.31, -0.22])
    plan = plan_of(affine_map((42, 32), (40, 30), np.eye(2), shift), size=(42, 32))
    at = np.stack(np.meshgrid(np.arange(42), np.arange(32)), axis=-1) + shift
    seen = np.all((at > -0.5) & (at < [39.5, 29.5]), axis=-1)
    out = render(plan, [image])
    assert_allclose(out[seen], sampled(image, at[seen]), atol=0.55)
    assert not out[~seen].any()
    assert seen[:, 0].any()
    assert not seen[0, -1]


def test_positions_keep_their_fraction_at_the_far_end_of_a_wide_image():
    """In single precision column 30000 would be known to 0.002 px: 120 of these grey values."""
    ramp = np.array([0, 65535] * 15010, np.uint16)
    image = np.ascontiguousarray(np.broadcast_to(ramp[None, :, None], (20, 30020, 1)))
    shift = np.array([30000.0 - 8 + 0.1237, 0.0])
    plan = plan_of(affine_map((16, 20), (30020, 20), np.eye(2), shift), size=(16, 20))
    row = render(plan, [image])[10, :, 0]
    assert_allclose(row[0::2], 0.1237 * 65535, atol=0.6)
    assert_allclose(row[1::2], (1 - 0.1237) * 65535, atol=0.6)


@pytest.mark.parametrize("where", [np.s_[:, 4:], np.s_[:2], np.s_[3, 5], np.s_[:, :, 1]])
def test_cells_outside_the_lens_model_are_not_used(rng, where):
    image = noise(rng, 128, 128, 3)
    head = affine_map((128, 128), (128, 128), np.eye(2), 0)
    head.nodes[where] = np.nan
    known = np.isfinite(head.nodes).all(axis=-1)
    cells = known[1:, 1:] & known[:-1, 1:] & known[1:, :-1] & known[:-1, :-1]
    seen = np.kron(cells, np.ones((16, 16), bool))[..., None]
    assert_array_equal(render(plan_of(head, size=(128, 128)), [image]), np.where(seen, image, 0))


# --- blending ------------------------------------------------------------------------------------

SMALL = 16
HEADS, SYN = taken.printed_heads(), taken.printed_synthetic()
heads, synthetic = reduced_heads(HEADS, SMALL), reduced_camera(SYN, SMALL)


@pytest.fixture(scope="module")
def images():
    rng = np.random.default_rng(7)
    return [landscape(rng, heads.heads[0].width_px, heads.heads[0].height_px) for _ in range(4)]


@pytest.fixture(scope="module")
def positions():
    return exact_positions(heads, synthetic, (0, synthetic.height_px, 0, synthetic.width_px))


COEFFICIENTS = np.array(
    [
        [[g, -0.15 - b, 0.02 * k] for b in (0, 0.03, 0.05)]
        for k, g in enumerate((-0.1, 0, 0.05, 0.08))
    ]
)

RESPONSE = Response(coefficients=COEFFICIENTS)


@pytest.mark.parametrize("coefficients", [None, COEFFICIENTS])
def test_grey_values_are_those_of_an_exact_rendering(images, positions, coefficients):
    response = None if coefficients is None else Response(coefficients=coefficients)
    plan = render_plan(heads, synthetic, feather_px=15, response=response)
    exact = blended(images, positions, feather_px=15, coefficients=coefficients)
    difference = np.abs(render(plan, images) - exact)
    assert np.sqrt(np.mean(difference**2)) < 0.45  # 0.29 of it is rounding
    assert np.quantile(difference, 0.999) < 3.5
    assert difference.max() < 10.5


def test_a_hard_seam_takes_the_head_that_is_farthest_from_its_border(positions):
    flat = [
        np.full((h.height_px, h.width_px, 1), 100 * (k + 1), np.uint8)
        for k, h in enumerate(heads.heads[:2])
    ]
    flat += [np.full_like(flat[0], 50), np.full_like(flat[0], 150)]
    out = render(render_plan(heads, synthetic, feather_px=0), flat)
    assert set(np.unique(out)) == {50, 100, 150, 200}  # never a mixture
    exact = np.rint(blended(flat, positions, feather_px=0))
    assert np.mean(out != exact) < 1e-3  # the line itself, 0.0025 px wide


@given(value=st.integers(0, 65535), feather=st.floats(0, 60), bands=st.integers(1, 4))
@example(value=1, feather=1e-7, bands=1)  # narrower than single precision tells
def test_a_flat_scene_stays_flat_under_any_blending(value, feather, bands):
    flat = [np.full((h.height_px, h.width_px, bands), value, np.uint16) for h in tiny.heads]
    plan = replace(TINY_PLAN, feather_px=feather)
    assert np.all(render(plan, flat) == value)  # also: no pixel without a head


tiny, tiny_synthetic = reduced_heads(HEADS, 60), reduced_camera(SYN, 60)
TINY_PLAN = render_plan(tiny, tiny_synthetic)


def test_the_ramp_between_two_heads_is_even():
    """Side by side, 20 px common: the left head's weight falls linearly over the feather."""
    left = affine_map((100, 200), (60, 200), np.eye(2), 0)
    right = affine_map((100, 200), (60, 200), np.eye(2), [-40, 0])
    plan = plan_of(left, right, size=(100, 200), feather_px=8)
    bright = np.full((200, 60, 1), 10000, np.uint16)
    row = render(plan, [bright, np.zeros_like(bright)])[100, :, 0]
    cols = np.arange(100)
    d_left, d_right = 59.5 - cols, cols - 39.5
    w_left, w_right = 8 + np.minimum(d_left - d_right, 0), 8 + np.minimum(d_right - d_left, 0)
    w_left = np.where(d_right < 0, 1, np.clip(np.minimum(w_left, d_left), 0, None))
    w_right = np.where(d_left < 0, 1, np.clip(np.minimum(w_right, d_right), 0, None))
    w_right[d_right < 0], w_left[d_left < 0] = 0, 0
    assert_allclose(row, 10000 * w_left / (w_left + w_right), atol=0.6)
    assert np.all(np.diff(row.astype(int)) <= 0)


def test_the_response_is_taken_off(images):
    """Heads of one flat scene, each through its response, become flat again."""
    size = np.array([heads.heads[0].width_px, heads.heads[0].height_px])
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in size)), axis=-1)
    q = np.sum((grid - (size - 1) / 2) ** 2, axis=-1) / np.sum((size / 2) ** 2)
    seen = [
        np.rint(20000 * np.exp(g + np.multiply.outer(q, a) + np.multiply.outer(q**2, b)))
        for g, a, b in np.moveaxis(COEFFICIENTS, -1, 1)
    ]
    plan = replace(render_plan(heads, synthetic, feather_px=15), response=RESPONSE)
    out = render(plan, [one.astype(np.uint16) for one in seen])
    assert np.abs(out.astype(int) - 20000).max() <= 1  # rounded before and after


RESPONSE_OF_A_BRIGHT_HEAD = Response(coefficients=np.array([[[np.log(1.2), 0, 0]]]))


def test_what_is_saturated_stays_saturated():
    """The second head was 1.2 times brighter; its numbers go down, its saturated ones do not."""
    plan = replace(identity(40, 40), response=RESPONSE_OF_A_BRIGHT_HEAD)
    image = np.full((40, 40, 1), 60000, np.uint16)
    image[10:20] = 65535
    out = render(plan, [image])
    assert np.all(out[10:20] == 65535)
    assert np.all(out[:10] == 50000)
    dark = Response(coefficients=-RESPONSE_OF_A_BRIGHT_HEAD.coefficients)
    darker = replace(plan, response=dark)
    assert np.all(render(darker, [image]) == 65535)  # 72000 does not fit: held, not wrapped


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_sky_at_the_limit_gets_no_speckles(dtype):
    """Noise of a hundredth about saturation, of a head that is made 1.2 times darker."""
    top, rng = np.iinfo(dtype).max, np.random.default_rng(3)
    sky = top * (1 + 0.01 * rng.standard_normal((60, 60, 1)))
    sky = np.clip(np.rint(sky), 0, top)
    plan = replace(identity(60, 60), response=RESPONSE_OF_A_BRIGHT_HEAD)
    out = render(plan, [sky.astype(dtype)]).astype(float)
    assert np.all(out[sky == top] == top)
    below = sky < top
    # four times the noise, not the sixth of the range by which the head is too bright
    assert np.all(top - out[below] <= SHOULDER * (top - sky[below]) + 0.5)
    assert np.all(np.diff(out[below][np.argsort(sky[below])]) >= 0)


# --- stripes, threads, memory --------------------------------------------------------------------


@pytest.fixture(scope="module")
def whole():
    """A plan, the images of its heads, and the image that it renders."""
    rng = np.random.default_rng(1)
    views = [noise(rng, h.width_px, h.height_px, 3) for h in tiny.heads]
    plan = replace(TINY_PLAN, feather_px=5.0)
    return plan, views, render(plan, views)


def rows(plan, views, start, stop):
    out = np.full((stop - start, plan.width_px, 3), 7, np.uint16)
    render_into(out, plan, views, start)
    return out


@given(cuts=st.lists(st.integers(0, 270), max_size=5))
def test_stripes_are_the_rows_of_the_whole(whole, cuts):
    plan, views, image = whole
    edges = [0, *sorted(cuts), tiny_synthetic.height_px]
    stripes = [rows(plan, views, a, b) for a, b in pairwise(edges)]
    assert_array_equal(np.concatenate(stripes), image)


def test_neither_threads_nor_mapped_files_matter(tmp_path, whole, monkeypatch):
    plan, views, image = whole
    for cores in (1, 7):
        monkeypatch.setattr(processors, "cores", lambda cores=cores: cores)
        assert_array_equal(render(plan, views), image)
    mapped = []
    for k, view in enumerate(views):
        view.tofile(tmp_path / str(k))
        mapped.append(np.memmap(tmp_path / str(k), np.uint16, "r", shape=view.shape))
    assert_array_equal(rows(plan, mapped, 80, 130), image[80:130])


# --- one head, and heads as bands ----------------------------------------------------------------


def test_one_head_resampled_is_its_samples(images, positions):
    r0, r1, c0, c1 = window = (500, 900, 30, 700)
    out = resample(images[0], heads, 0, synthetic, window)
    seen, at = out.all(axis=-1), positions[0][r0:r1, c0:c1]
    inner = np.all((at > -0.5) & (at < np.array(images[0].shape[1::-1]) - 0.5), axis=-1)
    assert np.mean(seen != inner) < 1e-3  # the border line itself
    both = seen & inner
    assert both.any()
    assert not both.all()
    assert np.abs(out[both] - sampled(images[0], at[both])).max() < 10  # 0.0025 px


def test_every_head_is_a_band_of_its_own_pixels(rng):
    maps = [affine_map((96, 300), (96, 300), np.eye(2), 0)] * 3
    bands = [noise(rng, 96, 300, 1) for _ in maps]
    stacked = stack(plan_of(*maps, size=(96, 300)), bands, 100, 250)
    assert_array_equal(stacked, np.concatenate(bands, axis=2)[100:250])


# --- what is refused


PLAN = identity(6, 4)
BAND = np.zeros((4, 6, 1), np.uint8)
OF_THREE = Response(coefficients=np.zeros((1, 3, 3)))


@pytest.mark.parametrize(
    ("plan", "images", "words"),
    [
        (
            PLAN,
            [BAND[:3]],
            r"expected images of shape \(4, 6, 1\), .*, got \(3, 6",
        ),
        (PLAN, [BAND.astype(float)], "float64"),
        (replace(PLAN, maps=PLAN.maps * 2), [BAND, BAND.astype(np.uint16)], "got .* uint16"),
        (replace(PLAN, response=OF_THREE), [BAND], "images of 1 bands do not fit"),
    ],
)
def test_what_does_not_fit_is_refused(plan, images, words):
    with pytest.raises(ValueError, match=words):
        render(plan, images)
