"""Do heads from half of the exposures predict those from the other half? By 100 drawn halvings.

``python tests/benchmarks/halvings.py rig``, or ``ties FLIGHT``: of a measured one, by default the
stored flight of four real heads. Odd against even exposures come first.
"""

import sys

import numpy as np

import acx4 as acx
from acx4book.reference import four_heads
from acx4lib.block import select_images
from acx4lib.bundle.rejections import without
from acx4lib.calibration.estimates import difference
from acx4lib.calibration.heads import declared_orientation
from acx4lib.calibration.mounting import single_step
from acx4lib.least_squares.covariance import correlation, sigmas
from acx4lib.least_squares.statistics import chi2_sf
from acx4lib.tie_points import refinement
from acx4lib.tie_points.ties import shared_points


def by_tie_points(flight, block):
    """Of the rotations of the heads to the first one.

    Exposures are adjusted one by one; a half has their weighted mean, as one adjustment would.
    """
    heads = declared_orientation(block.cameras, flight.synthetic_camera)
    ties, each = shared_points(block, heads), []
    axis = np.tile([3, 4, 5], len(heads.heads) - 1)
    of = axis + 6 * np.repeat(np.arange(1, len(heads.heads)), 3)
    for exposure in np.unique(ties.exposure_idx):
        own = ties[ties.exposure_idx == exposure]
        found = refinement.refine_by_rotations(heads, own).orientation
        N = np.linalg.inv(found.cov[np.ix_(of, of)])
        each.append(refinement.OneExposure(N=N, h=-N @ (found.opk - heads.opk)[1:].ravel()))

    def of_half(half):
        own = [one for one, taken in zip(each, half, strict=True) if taken]
        N, h = np.sum([one.N for one in own], axis=0), np.sum([one.h for one in own], axis=0)
        variance = refinement.components(own, axis, 1.0)
        return -np.linalg.solve(N, h), np.linalg.inv(N) + refinement.covariance(own, axis, variance)

    def test(half):
        (a, cov_a), (b, cov_b) = of_half(half), of_half(~half)
        return a - b, cov_a + cov_b

    return test


def by_rig(flight, block):
    """Of all parameters of the self-calibrated rig."""
    clean = without(block, four_heads.rig(flight).bundle.rejected)
    how = {"free": ("f", *flight.estimate_heads), "fix": ("lever_arm",), "snooping": False}

    def test(half):
        taken = half[clean.images.exposure_idx]
        a, b = (single_step(select_images(clean, t), **how).calibration for t in (taken, ~taken))
        columns = np.hstack([a.layout.interior, a.layout.mount])
        d = np.array([difference(*pair) for pair in zip(a.cameras, b.cameras, strict=True)])
        return d[columns >= 0], a.sigma0_sq * a.cov + b.sigma0_sq * b.cov

    return test


def main(by="rig", path=four_heads.FLIGHT):
    """Print the probability of every joint chi-square, and how many are above 0.01."""
    flight = acx.read(path)
    test = {"ties": by_tie_points, "rig": by_rig}[by](flight, four_heads.heads_of(flight))
    n, rng, found = len(flight.block("heads").trajectory), np.random.default_rng(1), []
    for i in range(101):
        d, cov = test((rng.permutation(n) if i else np.arange(n)) % 2 == 1)
        z = d / sigmas(cov)
        found.append(chi2_sf(float(z @ np.linalg.solve(correlation(cov), z)), len(z)))
    above = int(np.sum(np.array(found[1:]) > 0.01))
    sys.stdout.write(f"odd against even: p = {found[0]:.3f}; {above} of 100 drawn above 0.01\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
