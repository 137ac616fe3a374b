"""Grey values of views that overlap."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from acx4book.reference.surround.greys import grey_correlation, grey_samples, overlapping
from acx4lib.synthetic_image import response
from support.pictures.surround_rigs import HEIGHT, WIDTH


def test_views_of_one_ground_are_alike(views):
    pairs = overlapping(views)
    assert pairs == [(0, 1), (0, 3), (1, 2), (2, 3)]
    for a, b in pairs:
        # what is left is that one of them sees the corner from farther away
        assert grey_correlation(views[a], views[b]) > 0.9
    assert np.isnan(grey_correlation(views[0], views[2]))


def test_gains_are_found_and_saturation_is_left_out(views, rng):
    factors = (1.0, 1.1, 0.9, 1.05)
    lit = [
        replace(
            v,
            image=np.rint(v.image * f + rng.normal(0, 1, (HEIGHT, WIDTH, 3)))
            .clip(0, 254)
            .astype(np.uint8),
        )
        for v, f in zip(views, factors, strict=True)
    ]
    lit[1].image[:320, :420] = 255
    samples = grey_samples(lit)
    assert samples[0].saturated.any()
    assert np.all(np.isnan(samples[0].log_ratio) == samples[0].saturated | samples[0].dark)
    fit = response.fit_response(samples, n_heads=4, n_bands=3)
    expected = np.log(factors) - np.mean(np.log(factors))
    # means of 64 pixels of 50 to 180, with a noise of one: a quarter of a percent at most
    assert_allclose(fit.response.coefficients[:, :, 0], np.tile(expected, (3, 1)).T, atol=0.003)
    assert_allclose(fit.response.coefficients[:, :, 1:], 0, atol=1e-9)
