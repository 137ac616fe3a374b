"""Correlation and least-squares matching, against what others compute and against the truth."""

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import ndimage, optimize

from acx4lib.tie_points.compiled import match_points
from acx4lib.tie_points.least_squares_matching import (
    correlate,
    match,
    position_derivatives,
    spline_coefficients,
)
from support.pictures import taken

N = 256
HALF = 10


def shifted(image, dx, dy):
    """The image moved by fractions of a pixel; exact for one that continues over its borders."""
    fx, fy = np.fft.rfftfreq(N)[None], np.fft.fftfreq(N)[:, None]
    phase = np.exp(-2j * np.pi * (fx * dx + fy * dy))
    return np.fft.irfft2(np.fft.rfft2(image) * phase, s=image.shape)


def grid(step=16, margin=32):
    at = np.arange(margin, N - margin, step)
    return np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2)


@pytest.fixture(scope="module")
def texture():
    return taken.texture(N, np.random.default_rng(2), finest=0.2)


# --- correlation -----------------------------------------------------------------------------


def test_the_coefficient_and_its_place_are_those_of_opencv(texture):
    rng = np.random.default_rng(0)
    a = (texture - 12000).astype(np.float32)
    b = shifted(texture - 12000, 3.0, -2.0) + rng.normal(scale=300, size=a.shape)
    b = b.astype(np.float32)
    at = grid()
    found, coefficient = correlate(a, b, at, at, half=7, search=8)
    for (col, row), place, value in zip(at, found, coefficient, strict=True):
        window = a[row - 7 : row + 8, col - 7 : col + 8]
        search = b[row - 15 : row + 16, col - 15 : col + 16]
        scores = cv2.matchTemplate(search, window, cv2.TM_CCOEFF_NORMED)
        y, x = np.unravel_index(scores.argmax(), scores.shape)
        assert_allclose(value, scores.max(), atol=1e-4)  # single precision on both sides
        # a parabola moves the maximum by less than a pixel to either side
        assert_allclose(place, [col + x - 8, row + y - 8], atol=0.5)


def test_correlation_alone_finds_a_shift_to_a_tenth_of_a_pixel(texture):
    a, b = texture.astype(np.float32), shifted(texture, 2.3, -4.4).astype(np.float32)
    at = grid()
    found, _ = correlate(a, b, at, at + np.array([3, -3]), half=7, search=4)
    error = found - at - [2.3, -4.4]
    assert np.sqrt(np.mean(error**2)) < 0.1  # what a parabola through three values can do


def test_a_maximum_on_the_border_of_the_search_is_no_place(texture):
    a, b = texture.astype(np.float32), shifted(texture, 6.0, 0.0).astype(np.float32)
    at = grid()
    found, coefficient = correlate(a, b, at, at, half=7, search=6)
    assert np.isnan(found).all(axis=1).mean() > 0.9
    assert np.isfinite(coefficient).all()


def test_windows_that_meet_nothing_or_have_no_contrast_have_no_place(texture):
    a = texture.astype(np.float32)
    b = a.copy()
    b[100, 100] = np.nan
    flat = np.full_like(a, 12000)
    at = np.array([[100, 100], [3, 100], [100, N - 4], [60, 60]])
    found, coefficient = correlate(a, b, at, at, half=7, search=4)
    assert np.isnan(found[:3]).all()
    assert np.isnan(coefficient[:3]).all()
    assert_allclose(found[3], [60, 60], atol=0.1)
    assert np.isnan(correlate(flat, b, at, at, half=7, search=4)[1]).all()


# --- splines ---------------------------------------------------------------------------------


def test_spline_coefficients_are_those_of_scipy(texture):
    image = texture[:90, :120]
    expected = ndimage.spline_filter(image, order=3, mode="mirror")
    assert_allclose(spline_coefficients(image), expected, rtol=1e-6)  # single precision


# --- least-squares matching ------------------------------------------------------------------


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.37, -0.21), (0.5, 0.5), (-0.75, 0.1)])
def test_a_shift_with_another_gain_and_offset_is_found_to_a_thousandth(texture, shift):
    at = grid()
    matches = match(
        texture.astype(np.float32),
        (1.3 * shifted(texture, *shift) - 2000).astype(np.float32),
        at,
        at.astype(float),
        half=HALF,
    )
    # what a cubic spline is off by for structures of five pixels' length
    assert_allclose(matches.colrow, at + np.array(shift), atol=2e-3)
    assert_allclose(matches.gain, 1.3, rtol=0.01)


def test_grey_values_that_fall_off_across_the_window_do_not_move_the_match(texture):
    """As vignetting does; a gain and an offset alone would be off by a twentieth of a pixel."""
    slope = 12.0 * (np.arange(N)[None] - N / 2) - 7.0 * (np.arange(N)[:, None] - N / 2)
    at, shift = grid(), np.array([0.2, -0.3])
    b = (shifted(texture, *shift) + slope).astype(np.float32)
    matches = match(texture.astype(np.float32), b, at, at.astype(float), half=HALF)
    assert_allclose(matches.colrow, at + shift, atol=2e-3)


def test_an_affine_distortion_is_found(texture):
    """b shows at A x + t what a shows at x; made by scipy's quintic splines."""
    A, t = np.array([[1.03, -0.04], [0.02, 0.98]]), np.array([3.2, -1.7])
    rows, cols = np.mgrid[0:N, 0:N]
    middle = np.array([N / 2, N / 2])
    x = np.stack([cols, rows], -1).reshape(-1, 2) - middle - t
    col, row = (x @ np.linalg.inv(A).T + middle).T
    b = ndimage.map_coordinates(texture, [row, col], order=5, mode="grid-wrap").reshape(N, N)
    at = grid()
    truth = (at - middle) @ A.T + middle + t
    matches = match(
        texture.astype(np.float32),
        b.astype(np.float32),
        at,
        truth + np.array([0.6, -0.5]),
        half=HALF,
    )
    assert_allclose(matches.colrow, truth, atol=3e-3)


def test_it_is_the_least_squares_solution_of_ten_unknowns(texture):
    """Against scipy's optimiser over its own splines.

    That one takes derivatives of the interpolated image, which has less noise the farther from
    whole pixels it is; the solutions differ by products of noise and noise.
    """
    rng = np.random.default_rng(5)
    a = (texture + rng.normal(scale=15, size=(N, N))).astype(np.float32)
    b = (1.1 * shifted(texture, 0.3, -0.4) + rng.normal(scale=15, size=(N, N))).astype(np.float32)
    at = grid(margin=60)
    matches = match(a, b, at, at.astype(float), half=HALF)
    ratios = []
    filtered = ndimage.spline_filter(b.astype(float), mode="mirror")
    y, x = (g.ravel() for g in np.mgrid[-HALF : HALF + 1, -HALF : HALF + 1])
    places = zip(at[::9], matches.colrow[::9], matches.sigma_px[::9], strict=True)
    for (col, row), found, sigma in places:
        window = a[row + y, col + x].astype(float)

        def residuals(p, col=col, row=row, window=window):
            cols = col + p[0] + (1 + p[2]) * x + p[3] * y
            rows = row + p[1] + p[4] * x + (1 + p[5]) * y
            seen = ndimage.map_coordinates(filtered, [rows, cols], prefilter=False)
            return seen - p[6] * window - 1000 * p[7] - 10 * (p[8] * x + p[9] * y)

        start = [0, 0, 0, 0, 0, 0, 1, 0, 0, 0]
        fit = optimize.least_squares(
            residuals, start, x_scale=[1, 1, 0.1, 0.1, 0.1, 0.1, 1, 1, 1, 1]
        )
        assert_allclose(found - [col, row], fit.x[:2], atol=0.6 * sigma.max())
        cov = np.linalg.inv(fit.jac.T @ fit.jac) * 2 * fit.cost / (len(x) - 10)
        ratios.append(sigma / np.sqrt(np.diag(cov)[:2]))
    # the noise is white here; what each window has of it at its edges differs by a tenth, and
    # derivatives of the interpolated image have noise that is no texture
    assert_allclose(ratios, 1.0, atol=0.4)
    assert_allclose(np.mean(ratios), 1.0, atol=0.2)


def normalised_squares(matches, truth):
    error = (matches.colrow - truth) / matches.sigma_px
    assert np.isfinite(error).all()
    return np.mean(error**2)


@pytest.mark.parametrize("noise", [20.0, 80.0])
def test_the_predicted_sigma_is_honest(texture, noise):
    rng = np.random.default_rng(7)
    at, squares = grid(), []
    for _ in range(8):
        shift = rng.uniform(-0.6, 0.6, 2)
        a = texture + rng.normal(scale=noise, size=(N, N))
        b = 1.2 * shifted(texture, *shift) + rng.normal(scale=noise, size=(N, N))
        matches = match(a.astype(np.float32), b.astype(np.float32), at, at * 1.0, half=HALF)
        squares.append(normalised_squares(matches, at + shift))
    # 2 700 squares of normal numbers: 3 sigma are 0.08; derivatives of noisy windows, and the
    # interpolation, which smooths the noise at some places, add a tenth
    assert 0.85 < np.mean(squares) < 1.25


@pytest.mark.parametrize("quality", [75, 90])
@pytest.mark.parametrize("finest", [0.1, 0.2])
def test_the_predicted_sigma_is_honest_for_compressed_images(quality, finest):
    """Blocks share their noise, and it is largest at edges: as white it is 1.2 to 2 times less."""
    rng = np.random.default_rng(9)
    seen = taken.texture(N, rng, finest=finest, contrast=30.0, level=120.0)
    at, squares = grid(), []
    for _ in range(8):
        shift = rng.uniform(-4, 4, 2)
        pair = seen, shifted(seen, *shift)
        noisy = [np.rint(one + rng.normal(size=(N, N))).astype(np.uint8) for one in pair]
        a, b = (taken.compressed(one, quality).astype(np.float32) for one in noisy)
        matches = match(a, b, at, at + shift.round(), half=HALF)
        good = np.all(matches.sigma_px < 0.5, axis=1)
        assert good.mean() > 0.6
        squares.append(np.square((matches.colrow - at - shift) / matches.sigma_px)[good])
    assert 0.75 < np.mean(np.concatenate(squares)) < 1.3


def test_the_predicted_sigma_is_honest_for_images_that_were_interpolated(texture):
    """Neighbouring pixels then have the same noise in part."""
    rng = np.random.default_rng(8)
    at, squares = grid(), []
    places = np.arange(N) * 0.87  # of the interpolated image in the original one
    rows, cols = np.meshgrid(places, places, indexing="ij")

    def interpolated(original, dx, dy):
        seen = [rows - dy, cols - dx]
        return ndimage.map_coordinates(original, seen, order=3, mode="grid-wrap")

    for _ in range(8):
        shift = rng.uniform(-0.6, 0.6, 2)
        a = interpolated(texture + rng.normal(scale=60, size=(N, N)), 0.3, 0.2)
        b = shifted(texture, *(0.87 * shift)) + rng.normal(scale=60, size=(N, N))
        b = interpolated(b, 0.3, 0.2)
        matches = match(a.astype(np.float32), b.astype(np.float32), at, at * 1.0, half=HALF)
        squares.append(normalised_squares(matches, at + shift))
    assert 0.85 < np.mean(squares) < 1.25


def test_what_two_bands_show_differently_is_no_texture(texture):
    """Each has texture of its own, half as strong: derivatives of one image would be too large."""
    rng = np.random.default_rng(10)
    at, squares = grid(), []
    for _ in range(8):
        shift = rng.uniform(-0.6, 0.6, 2)
        own = [taken.texture(N, rng, finest=0.2, contrast=750.0, level=0.0) for _ in range(2)]
        a, b = texture + own[0], shifted(texture, *shift) + own[1]
        matches = match(a.astype(np.float32), b.astype(np.float32), at, at * 1.0, half=HALF)
        good = np.all(matches.sigma_px < 0.5, axis=1)
        squares.append(np.square((matches.colrow - at - shift) / matches.sigma_px)[good])
    assert 0.7 < np.mean(np.concatenate(squares)) < 1.4


@pytest.mark.parametrize(("half", "noise", "share"), [(10, 20.0, 0.03), (5, 60.0, 0.16)])
def test_a_place_moves_with_the_grey_values_as_its_derivatives_say(texture, half, noise, share):
    """What is left grows with noise, whose derivatives a window's rim does not have."""
    rng = np.random.default_rng(3)
    a = (texture + rng.normal(scale=noise, size=texture.shape)).astype(np.float32)
    b = (texture + rng.normal(scale=noise, size=texture.shape)).astype(np.float32)
    more = ndimage.gaussian_filter(rng.normal(size=b.shape), 2)
    more *= 50 / more.std()
    at = grid()
    ways = [spline_coefficients((b + s * more).astype(np.float32)) for s in (0, 1, -1)]
    (_, gain, residuals), (ahead, *_), (behind, *_) = (
        match_points(a, way, at, at.astype(float), half) for way in ways
    )
    known = np.isfinite(gain)
    moves = np.full((len(at), 2, residuals.shape[1]), np.nan)
    moves[known] = position_derivatives(a, at[known], half, residuals[known], gain[known])
    side = np.arange(-half, half + 1)
    windows = more[at[:, 1, None, None] + side[:, None], at[:, 0, None, None] + side]
    told = np.einsum("nip,np->ni", moves, windows.reshape(len(at), -1))
    matched = np.isfinite(ahead + behind).all(axis=1)
    misfit = (ahead - behind)[matched] / 2 - told[matched]
    assert matched.mean() > 0.9
    assert np.sqrt(np.mean(misfit**2)) < share * np.sqrt(np.mean(told[matched] ** 2))


def test_windows_without_texture_or_over_nothing_have_no_match(texture):
    a = texture.astype(np.float32)
    b = a.copy()
    b[95:105, 95:105] = np.nan
    at = np.array([[100, 100], [5, 100], [100, N - 6], [60, 60]])
    found = match(a, b, at, at * 1.0, half=HALF).colrow
    assert np.isnan(found[:3]).all()
    assert_allclose(found[3], [60, 60], atol=1e-3)
    flat = np.full_like(a, 12000)
    assert np.isnan(match(flat, a, at, at * 1.0, half=HALF).colrow).all()
    assert np.isnan(match(a, np.full_like(a, np.nan), at, at * 1.0, half=HALF).colrow).all()


def test_windows_that_do_not_show_the_same_do_not_match(texture):
    other = taken.texture(N, np.random.default_rng(99), finest=0.2).astype(np.float32)
    at = grid()
    matches = match(texture.astype(np.float32), other, at, at * 1.0, half=HALF)
    assert np.isfinite(matches.colrow[:, 0]).mean() < 0.1


def test_no_points_have_no_matches(texture):
    a = texture.astype(np.float32)
    matches = match(a, a, np.zeros((0, 2), int), np.zeros((0, 2)), half=HALF)
    assert matches.colrow.shape == (0, 2)
