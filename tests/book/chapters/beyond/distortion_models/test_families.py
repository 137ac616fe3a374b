"""The families keep what their authors made them for."""

from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.beyond.distortion_models import families
from acx4lib.geometry.camera import Camera, Interior

CAMERA = Camera(name="CAM", width_px=400, height_px=300, pixel_mm=0.1, interior=Interior(f=50.0))
NINE = np.array(list(product((-1.0, 0.0, 1.0), repeat=2)))


def gram(terms):
    A = terms.reshape(-1, terms.shape[-1])
    return A.T @ A


def off_diagonal(N):
    return N - np.diag(np.diagonal(N))


def test_ebners_terms_are_orthogonal_on_the_nine_points():
    N = gram(families.ebner(NINE))
    assert_allclose(off_diagonal(N), 0, atol=1e-12)
    assert np.all(np.diagonal(N) > 0.4)


def orientation():
    """Shifts, turn, scale, and tilts: what the orientation of a vertical image changes."""
    x, y = NINE.T
    one, zero = np.ones(9), np.zeros(9)
    parts = [(one, zero), (zero, one), (-y, x), (x, y), (x * x, x * y), (x * y, y * y)]
    return np.stack([np.stack(part, axis=-1) for part in parts], axis=-1)


def test_ebners_terms_are_orthogonal_to_the_orientation_of_a_vertical_image():
    both = gram(np.concatenate([families.ebner(NINE), orientation()], axis=2))
    assert_allclose(both[:12, 12:], 0, atol=1e-12)


def test_ebners_terms_and_the_orientation_explain_any_shifts_of_the_nine_points():
    A = np.concatenate([families.ebner(NINE), orientation()], axis=2).reshape(18, -1)
    assert np.linalg.matrix_rank(A) == 18


def test_another_base_changes_the_numbers_and_not_what_can_be_fitted():
    at = np.random.default_rng(1).uniform(-1, 1, (60, 2))
    x, y = at.T
    one, zero = np.ones(60), np.zeros(60)
    parts = [(one, zero), (zero, one), (-y, x), (x, y), (x * x, x * y), (x * y, y * y)]
    own = np.stack([np.stack(part, axis=-1) for part in parts], axis=-1)
    spans = [
        np.linalg.qr(np.concatenate([families.ebner(at / b), own], axis=2).reshape(120, -1))[0]
        for b in (1.0, 0.6)
    ]
    assert_allclose(spans[0] @ spans[0].T, spans[1] @ spans[1].T, atol=1e-9)


def test_waves_are_orthogonal_and_without_mean_over_the_image():
    at = (np.arange(24) + 0.5) / 12 - 1
    uv = np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2)
    terms = families.fourier(uv)
    assert terms.shape == (576, 2, 16)
    assert_allclose(gram(terms), 576 / 2 * np.eye(16), atol=1e-9)
    assert_allclose(terms.mean(axis=0), 0, atol=1e-12)


def test_a_coefficient_of_one_mm_shifts_by_its_term_in_pixels_with_rows_downward():
    corner = np.array([[399.5, -0.5]])  # upper right: x, y = +20, +15 mm
    ebner = families.by_coefficient(families.MODELS[2], CAMERA, corner)[0]
    assert_allclose(ebner[:, 0], [10.0, 0.75 * 10.0])  # x, -y; the row grows downward
    waves = families.by_coefficient(families.MODELS[3], CAMERA, corner)[0]
    assert_allclose(waves[:, 0], [-10.0, 0.0], atol=1e-12)  # cos(pi)
    assert_allclose(waves[:, 8], [0.0, 10.0], atol=1e-12)


@pytest.mark.parametrize(
    ("name", "n"),
    [("Brown", 5), ("Ebner", 12), ("Fourier", 16), ("radial + Ebner", 15)],
)
def test_a_model_counts_its_parameters_of_distortion(name, n):
    assert {m.name: m.n_distortion for m in families.MODELS}[name] == n
