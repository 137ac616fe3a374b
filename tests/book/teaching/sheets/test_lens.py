import numpy as np
import pytest
from scipy.stats import chi2

from acx4book.teaching.sheets import lens
from acx4lib.geometry.camera import Interior


def test_the_distortion_is_browns_formula():
    of = Interior(f=50.0, xp=1.0, k1=6e-6, k2=-2e-9, k3=3e-13, p1=2e-6, p2=-3e-6)
    *radial, dx, dy = lens.um(of)
    r = np.array(lens.RADII_MM)
    assert radial == pytest.approx(1e3 * (6e-6 * r**3 - 2e-9 * r**5 + 3e-13 * r**7))
    x, y, r_sq = 20.0, 15.0, 625.0
    scale = 6e-6 * r_sq - 2e-9 * r_sq**2 + 3e-13 * r_sq**3
    assert dx == pytest.approx(1e3 * (x * scale + 2e-6 * (r_sq + 2 * x * x) - 6e-6 * x * y))
    assert dy == pytest.approx(1e3 * (y * scale - 3e-6 * (r_sq + 2 * y * y) + 4e-6 * x * y))


def test_estimates_are_within_their_sigma_of_the_truth(solved):
    for name in ("f_mm", "dr_20_um", "dx_um"):
        errors = []
        for k in range(20):
            _, right = solved("lab-4", f"Student {k}")
            errors.append((right[name].value - right[name].truth) / right[name].sigma)
        low, high = chi2.ppf([0.0005, 0.9995], 20)
        assert low < np.sum(np.square(errors)) < high
