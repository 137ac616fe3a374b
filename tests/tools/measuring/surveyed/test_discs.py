import cv2
import numpy as np
import pytest

from acx4tools.measuring.surveyed.discs import discs


def picture(col, row, radius, *, bright=40000.0, dark=3000.0, rng=None, noise=0.0):
    """A disc drawn sixteen times too large, blurred as by a lens, and averaged."""
    size = 41
    k = 16
    y, x = (np.mgrid[: size * k, : size * k] + 0.5) / k - 0.5
    fine = np.where(np.hypot(x - col, y - row) < radius, bright, dark).astype(np.float32)
    fine = cv2.GaussianBlur(fine, (0, 0), 0.4 * k)
    out = cv2.resize(fine, (size, size), interpolation=cv2.INTER_AREA)
    return out if rng is None else out + rng.normal(0, noise, out.shape).astype(np.float32)


@pytest.mark.parametrize("radius", [0.8, 1.2, 2.0, 3.3, 6.0])
@pytest.mark.parametrize("place", [(20.0, 20.0), (20.5, 20.5), (19.7, 20.2)])
def test_a_disc_is_centred_to_hundredths_of_a_pixel(radius, place, rng):
    disc = discs(picture(*place, radius, rng=rng, noise=300.0))[0]
    assert np.hypot(disc.col - place[0], disc.row - place[1]) < 0.04
    assert disc.radius_px == pytest.approx(radius, abs=0.4)  # blur and radius of small ones mix
    assert 0.01 < disc.sigma_px < 0.06


def test_a_dark_disc_has_a_negative_contrast():
    disc = discs(picture(20.2, 19.6, 2.0, bright=3000.0, dark=40000.0))[0]
    assert disc.contrast < 0
    assert (disc.col, disc.row) == pytest.approx((20.2, 19.6), abs=0.03)


def test_errors_have_the_size_of_their_sigma(rng):
    z = []
    for _ in range(40):
        place = rng.uniform(19.5, 20.5, 2)
        disc = discs(picture(*place, 1.5, rng=rng, noise=1500.0))[0]
        z.append((np.array([disc.col, disc.row]) - place) / disc.sigma_px)
    assert 0.3 < np.mean(np.square(z)) < 1.6  # chi-square of 80 over 80, and the model's 0.02 px


def test_an_edge_and_noise_are_no_discs(rng):
    edge = np.where(np.arange(41) < 20, 3000.0, 40000.0).astype(np.float32)
    assert discs(np.tile(edge, (41, 1))) == []
    assert len(discs(rng.normal(9000, 300, (41, 41)).astype(np.float32))) <= 1
    assert discs(np.full((41, 41), 7.0, np.float32)) == []
