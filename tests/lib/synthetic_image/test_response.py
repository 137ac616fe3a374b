"""Responses of heads that are known, found again from overlaps of pictures without an outside."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.synthetic_image.frame import reduced_camera, reduced_heads, synthetic_from_head
from acx4lib.synthetic_image.response import (
    Response,
    Samples,
    corner_share,
    estimate_response,
    fit_response,
    overlap_samples,
)
from support.pictures import taken

K = 12
ORIENTATION = taken.printed_heads()
HEADS, REDUCED = reduced_heads(ORIENTATION, K), reduced_camera(taken.printed_synthetic(), K)
N_POINTS = 4000


def known(n_bands=3, *, seed=1, radial=True):
    """Gains within 5 %, a fifth to a quarter lost at the corner."""
    rng = np.random.default_rng(seed)
    out = np.zeros((4, n_bands, 3))
    out[..., 0] = rng.uniform(-0.05, 0.05, (4, n_bands))
    out[..., 0] -= out[..., 0].mean(axis=0)
    if radial:
        out[..., 1] = rng.uniform(-0.2, -0.15, (4, n_bands))
        out[..., 2] = rng.uniform(-0.08, -0.03, (4, n_bands))
    return Response(coefficients=out)


def log_response(response, k, colrow, camera):
    """Gain and two radial terms, by the definition of a response."""
    q = corner_share(camera, colrow)[:, None]
    g, a, b = response.coefficients[k].T
    return g + a * q + b * q**2


def ground(xy, n_bands):
    """Grey values of the ground, any band, smooth over some pixels and otherwise lively."""
    x, y = xy.T
    pattern = 0.4 * np.sin(1.1 * x) * np.cos(0.8 * y) + 0.2 * np.sin(4.0 * x + 3.0 * y)
    return 12000 * np.exp(pattern[:, None] * (1 + 0.1 * np.arange(n_bands)))


def pictures(response, *, rng, dtype=np.uint16, noise=0.5, scale=1.0, orientation=HEADS):
    """The heads' images of that ground with noise like that of counted electrons."""
    n_bands, images = response.coefficients.shape[1], []
    for k, camera in enumerate(orientation.heads):
        col, row = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
        colrow = np.stack([col, row], axis=-1).reshape(-1, 2).astype(float)
        dn = ground(synthetic_from_head(orientation, k, colrow), n_bands)
        dn *= scale * np.exp(log_response(response, k, colrow, camera))
        dn += noise * rng.normal(size=dn.shape) * np.sqrt(dn)
        dn = np.clip(np.rint(dn), 0, np.iinfo(dtype).max).astype(dtype)
        images.append(dn.reshape(camera.height_px, camera.width_px, n_bands))
    return images


def estimate(images, **how):
    return estimate_response(
        images, HEADS, REDUCED, rng=np.random.default_rng(11), n_points=N_POINTS, **how
    )


@pytest.fixture(scope="module")
def images():
    return pictures(known(), rng=np.random.default_rng(2))


@pytest.fixture(scope="module")
def fit(images):
    return estimate(images)


def curve_error(found, true):
    """Largest error of a head's response from the middle to the corner, the mean level free."""
    powers = np.linspace(0, 1, 21)[:, None] ** np.arange(3)
    return np.abs(powers @ np.moveaxis(found.coefficients - true.coefficients, 2, 1)).max()


# --- the model -------------------------------------------------------------------------------


def test_the_corner_is_the_outer_edge_of_the_outer_pixel():
    camera = ORIENTATION.heads[0]
    corners = np.array([[-0.5, -0.5], [8983.5, 6731.5], [4491.5, 3365.5], [4491.5, -0.5]])
    expected = [1.0, 1.0, 0.0, 6732**2 / (6732**2 + 8984**2)]
    assert_allclose(corner_share(camera, corners), expected, atol=1e-12)


# --- recovery --------------------------------------------------------------------------------


def test_known_responses_are_recovered_within_their_sigma(fit):
    error = fit.response.coefficients - known().coefficients
    assert np.sqrt(np.mean((error / fit.sigma) ** 2)) < 1.6  # of 36, correlated
    assert curve_error(fit.response, known()) < 0.002
    assert_allclose(fit.response.coefficients[..., 0].mean(axis=0), 0.0, atol=1e-12)
    assert fit.sigma.max() < 0.01


def test_overlaps_disagree_by_ten_per_cent_before_and_by_their_noise_after(fit):
    assert {(o.head_a, o.head_b) for o in fit.overlaps} >= {(0, 1), (0, 3), (1, 2), (2, 3)}
    for o in fit.overlaps:
        assert np.all(o.before > 0.03)
        assert np.all(o.after < 0.006)  # goal of the task
        # noise of two heads' means over nine pixels that are interpolated: below 0.5 DN^-1/2
        assert np.all(o.after < 1.15 * 0.5 * np.sqrt(2 / 9 / 6000.0))
        assert np.all(o.n_used > 300)
        assert not np.any(o.n_saturated + o.n_dark)


def test_gains_alone_are_recovered(images):
    true = known(radial=False)
    found = estimate(pictures(true, rng=np.random.default_rng(3)))
    assert_allclose(found.response.coefficients, true.coefficients, atol=0.003)


def test_another_shape_of_falloff_is_followed(images):
    """The fourth power of the cosine of 37 degrees, with three terms: to a thousandth."""
    q = np.linspace(0, 1, 50)
    tangent_sq = q * (0.006 * 5613) ** 2 / 74**2  # half the diagonal in px
    falloff = -2 * np.log(1 + tangent_sq)
    powers = q[:, None] ** np.arange(1, 3)
    terms = np.linalg.lstsq(powers, falloff, rcond=None)[0]
    assert np.abs(powers @ terms - falloff).max() < 0.001


def test_bad_matches_of_some_ground_do_no_harm(images):
    """Something that moved: a tenth of the frame is twice as bright in one head."""
    spoilt = [image.copy() for image in images]
    height = spoilt[1].shape[0]
    spoilt[1][: height // 10] *= 2
    assert curve_error(estimate(spoilt).response, known()) < 0.004


@pytest.mark.parametrize("n_bands", [1, 2, 4])
def test_any_number_of_bands_and_eight_bits(n_bands):
    true = known(n_bands)
    images = pictures(
        true, rng=np.random.default_rng(4), dtype=np.uint8, noise=0.1, scale=100 / 12000
    )
    found = estimate(images)
    assert found.response.coefficients.shape == (4, n_bands, 3)
    assert curve_error(found.response, true) < 0.006  # rounding to a grey value is 0.3 %


def test_the_same_points_give_the_same_response(images, fit):
    again = estimate(images)
    assert_allclose(again.response.coefficients, fit.response.coefficients, atol=0)


# --- what is left out ------------------------------------------------------------------------


@pytest.mark.parametrize("level", [65535, 52000])
def test_saturated_samples_are_left_out_and_counted(level):
    """At the type's end, or where a head clips below it: a quarter of the ground."""
    images = pictures(known(), rng=np.random.default_rng(5), scale=4.5)
    clipped = [np.minimum(image, level).astype(np.uint16) for image in images]
    found = estimate(clipped)
    large = [o for o in found.overlaps if (o.head_a + o.head_b) % 2]  # neighbours
    assert all(np.all(o.n_saturated > 100) for o in large)
    assert curve_error(found.response, known()) < 0.003


@pytest.mark.parametrize("quality", [75, 90])
def test_a_compressed_sky_that_is_partly_saturated_does_no_harm(quality):
    """Compression makes 250 to 255 of what was saturated, in both heads whatever they lose."""
    images = pictures(
        known(), rng=np.random.default_rng(5), dtype=np.uint8, noise=0.1, scale=200 / 12000
    )
    found = estimate([taken.compressed(image, quality) for image in images])
    large = [o for o in found.overlaps if (o.head_a + o.head_b) % 2]  # neighbours
    assert all(np.all(o.n_saturated > 500) for o in large)
    assert curve_error(found.response, known()) < 0.01


def test_dark_samples_are_left_out_and_counted(images):
    dark = [image.copy() for image in images]
    dark[0][:, : dark[0].shape[1] // 2] = 3
    found = estimate(dark)
    by_pair = {(o.head_a, o.head_b): o for o in found.overlaps}
    assert np.all(by_pair[0, 1].n_dark + by_pair[0, 3].n_dark > 300)
    assert np.all(by_pair[1, 2].n_dark == 0)
    assert curve_error(found.response, known()) < 0.005


def test_even_ground_is_not_held_for_saturated():
    even = [np.full((h.height_px, h.width_px, 1), 900, dtype=np.uint16) for h in HEADS.heads]
    found = estimate(even)
    assert all(np.all(o.n_saturated == 0) for o in found.overlaps)
    assert_allclose(found.response.coefficients, 0.0, atol=1e-6)


# --- priors ----------------------------------------------------------------------------------


def test_without_overlaps_the_response_is_one():
    found = fit_response([], n_heads=3, n_bands=2)
    assert_allclose(found.response.coefficients, 0.0, atol=0)
    assert found.overlaps == ()


def test_a_head_of_water_is_held_near_one_and_the_others_are_found(images):
    """All of one head is dark: what is known before is left."""
    wet = [image.copy() for image in images]
    wet[3][:] = 2
    found = estimate(wet)
    assert_allclose(found.response.coefficients[3, :, 1:], 0.0, atol=1e-9)
    assert np.all(found.sigma[3] > 0.1)
    true = known().coefficients[:3]
    error = found.response.coefficients[:3] - true
    error[..., 0] -= error[..., 0].mean(axis=0)  # the level is that of other heads
    assert np.abs(error.sum(axis=2)).max() < 0.004
    assert np.all(np.isnan(next(o for o in found.overlaps if o.head_b == 3).after))
    assert all(np.all(o.n_used == 0) for o in found.overlaps if o.head_b == 3)


def test_samples_of_several_exposures_are_joined(images):
    rng = np.random.default_rng(12)
    both = [
        *overlap_samples(images, HEADS, REDUCED, rng=rng, n_points=1000),
        *overlap_samples(
            pictures(known(), rng=np.random.default_rng(6)), HEADS, REDUCED, rng=rng, n_points=1000
        ),
    ]
    one, two = (fit_response(s, n_heads=4, n_bands=3) for s in (both[: len(both) // 2], both))
    for a, b in zip(one.overlaps, two.overlaps, strict=True):
        assert_allclose(b.n_used, 2 * a.n_used, rtol=0.05)  # as many as there is room for
    assert_allclose(two.sigma / one.sigma, np.sqrt(0.5), rtol=0.1)


def test_samples_may_come_from_any_geometry():
    """Two heads that see the same ground the other way round; only q and ratios count."""
    rng = np.random.default_rng(13)
    q = rng.uniform(0, 1, (2, 4000))
    true = known(1).coefficients[:2, 0] - [known(1).coefficients[:2, 0, 0].mean(), 0, 0]
    powers = q[..., None] ** np.arange(3)
    ratio = powers[0] @ true[0] - powers[1] @ true[1] + rng.normal(0, 0.003, 4000)
    nothing = np.zeros((4000, 1), dtype=bool)
    samples = Samples(
        head_a=0,
        head_b=1,
        q_a=q[0],
        q_b=q[1],
        log_ratio=ratio[:, None],
        saturated=nothing,
        dark=nothing,
    )
    found = fit_response([samples], n_heads=2, n_bands=1)
    assert_allclose(found.response.coefficients[:, 0], true, atol=0.003)
    assert found.overlaps[0].after == pytest.approx(0.003, rel=0.05)


def test_heads_that_do_not_overlap_have_no_samples(images):
    apart = replace(HEADS, xyz_mm=HEADS.xyz_mm + np.outer(np.arange(4), [500.0, 0.0, 0.0]))
    assert overlap_samples(images, apart, REDUCED, rng=np.random.default_rng(1)) == []
