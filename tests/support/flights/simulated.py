"""Simulated flights as a user's would be read, and what every method makes of them.

Nothing is computed before a test asks for it, and nothing twice in one process.
"""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

import acx4sim
from acx4files import flight
from acx4files.flight.reader import PLACE
from acx4lib.calibration import estimates, mounting
from acx4lib.calibration import heads as calibration_heads
from acx4lib.georeferencing import validation
from acx4lib.model import Model
from acx4lib.tie_points import ties as tie_points
from acx4sim.files import truth_path

SEEDS = range(1, 21)
CAMERA = {"acx4": "SYN", "acx4-ideal": "SYN", "single-head": "CAM"}
HEADS = ("CAM1", "CAM2", "CAM3", "CAM4")
MOUNTED = ("calibration", "validation")
MOUNTING_NAMES = (
    "f_mm",
    "xp_mm",
    "yp_mm",
    "k1",
    "k2",
    "k3",
    "p1",
    "p2",
    "lever_x_m",
    "lever_y_m",
    "lever_z_m",
    "boresight_omega_deg",
    "boresight_phi_deg",
    "boresight_kappa_deg",
)
EXACT = {"image_noise": 0.0, "control_noise": 0.0, "gnss_noise": 0.0, "attitude_noise": 0.0}


# --- flights ---------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class Flown:
    """A flight as it was read, and its truth."""

    flight: flight.Flight
    truth: dict[str, Any]


@lru_cache(maxsize=64)
def fly(design, *, seed, blocks=MOUNTED, exact=False):
    """Simulate a flight; exact data still state the design's sigmas."""
    options = acx4sim.Options(blocks=blocks, **(EXACT if exact else {}))
    return read_back(acx4sim.DESIGNS[design](seed=seed, options=options))


def read_back(simulated):
    """Write a flight to disk and read it as any other; afterwards it has no files."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight"
        acx4sim.write(simulated, path)
        read, truth = flight.read(path), json.loads(truth_path(path).read_text())
    return Flown(flight=replace(read, path=PLACE, pictures=PLACE), truth=truth)


def shift_image_points(table, sizes_px, *, size):
    """Shift some measurements in place, all far apart, toward the middle of their image.

    Points with few rays are left alone: along a strip an error of one ray of three may as well
    be that of the two others.

    Returns
    -------
    set of (str, str, str)
        Names as `named` has them.
    """
    head = table["image"].str.partition("_")[2]  # empty where there are no heads
    rays = table.groupby([table["point"], head])["image"].transform("size")
    rows = np.flatnonzero(rays >= 6)[:: int((rays >= 6).sum() / (len(sizes_px) + 0.5))][1:]
    for row, size_px in zip(rows, sizes_px, strict=True):
        for name, n_px in zip(("col_px", "row_px"), size, strict=True):
            inward = 1 if table.loc[row, name] < n_px / 2 else -1
            table.loc[row, name] += inward * size_px / np.sqrt(2)
    return {("image_point", table["image"][row], table["point"][row]) for row in rows}


# --- estimates -------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimates:
    """What a method says.

    Attributes
    ----------
    names : tuple of str
    values, sigma : ndarray
        As reported, sigma a posteriori.
    cov : ndarray
        For the test of errors: a priori where the method gives it so.
    """

    names: tuple[str, ...]
    values: np.ndarray
    sigma: np.ndarray
    cov: np.ndarray


def of_calibration(found):
    """Return the estimates of a calibration."""
    listed = estimates.parameters(found)
    J = estimates.to_reported(found)
    return Estimates(
        names=tuple(f"{p.camera} {p.name}" for p in listed),
        values=np.array([p.value for p in listed]),
        sigma=np.array([p.sigma for p in listed]),
        cov=J @ found.cov @ J.T,
    )


def of_orientation(found):
    """Return the estimates of a relative orientation, mm and radians, its covariance as it is.

    It has each head's a posteriori variance factor, which some 6000 degrees of freedom hold
    within 2 % of one.
    """
    keys = ("Xc", "Yc", "Zc", "omega", "phi", "kappa")
    return Estimates(
        names=tuple(f"{head.name} {key}" for head in found.heads for key in keys),
        values=np.hstack([found.xyz_mm, found.opk]).ravel(),
        sigma=found.sigma.ravel(),
        cov=found.cov,
    )


@cache
def calibrations(design, *, seed):
    """Calibrate the mounting by all methods."""
    flown = fly(design, seed=seed).flight
    found = mounting.calibrate(flown.calibration, Model(free=flown.estimate_mounting))
    assert not found.failures
    return {name: method.calibration for name, method in found.methods.items()}


@cache
def exact_calibration(design, method, *, seed):
    """Calibrate on exact data, by one method."""
    flown = fly(design, seed=seed, exact=True).flight
    calibrate = getattr(mounting, method)
    return calibrate(flown.calibration, Model(free=flown.estimate_mounting)).calibration


def mounting_estimates(design, method, *, seed):
    """Return the estimates of a method of the mounting stage."""
    return of_calibration(calibrations(design, seed=seed)[method])


def two_step_estimates(design, *, seed):
    """Return the two-step estimates; there are no gross errors, and none are looked for."""
    flown = fly(design, seed=seed, blocks=("calibration",)).flight
    return of_calibration(
        mounting.two_step(flown.calibration, Model(free=flown.estimate_mounting)).calibration
    )


@cache
def true_mounting(design):
    """Return the true parameters of the calibrated camera, in the order of the estimates."""
    true = fly(design, seed=1).truth["cameras"][CAMERA[design]]
    return np.array([true[name] for name in MOUNTING_NAMES])


def mounting_errors(design, method, *, seed):
    """Return the errors of a method, against the truth or, where it cannot meet it, exact data."""
    found = mounting_estimates(design, method, seed=seed)
    if method == "two_step_gnss":  # holds a wrong lever arm
        return found.values - of_calibration(exact_calibration(design, method, seed=seed)).values
    return found.values - true_mounting(design)


@cache
def head_estimates(*, seed, exact=False):
    """Return the estimates of the heads one by one, of their orientation, and of its refinement."""
    flown = fly("acx4", seed=seed, blocks=("heads",), exact=exact).flight
    heads = calibration_heads.calibrate_heads(flown.heads, HEADS, Model(free=flown.estimate_heads))
    assert not heads.failures
    oriented = calibration_heads.relative_orientation(heads, flown.cameras[flown.synthetic.camera])
    ties = tie_points.shared_points(flown.heads, oriented)
    refined = tie_points.refine_by_mean_differences(oriented, ties)
    return {
        **{k: of_calibration(estimates.from_bundle(b)) for k, b in heads.bundles.items()},
        "relative_orientation": of_orientation(oriented),
        "refined": of_orientation(refined),
    }


def head_errors(method, *, seed):
    """Return the errors against what the same method gives on exact data: f is held wrong."""
    exact = head_estimates(seed=seed, exact=True)[method]
    return head_estimates(seed=seed)[method].values - exact.values


@cache
def validations(design, *, seed):
    """Validate every method on the independent block."""
    block = fly(design, seed=seed).flight.validation
    return {
        name: validation.validate(block, found, method=name)
        for name, found in calibrations(design, seed=seed).items()
    }


# --- statistics ------------------------------------------------------------------------------


def chi_square(errors, cov):
    """Return the errors' chi-square with their joint covariance, and its degrees of freedom.

    What a method holds has sigma zero, what it constrains makes the covariance singular: both
    are no errors.
    """
    sigma = np.sqrt(np.diag(cov))
    free = sigma > 0
    scale = sigma[free]
    values, vectors = np.linalg.eigh(cov[np.ix_(free, free)] / scale[:, None] / scale)
    kept = values > 1e-8  # the constraints leave 1e-15, the closest correlations 1e-3
    parts = vectors[:, kept].T @ (errors[free] / scale)
    return float(np.sum(parts**2 / values[kept])), int(kept.sum())


def assert_errors_fit(chi_squares):
    """Assert that chi-squares of independent flights are as large as they should be.

    Parameters
    ----------
    chi_squares : sequence of (float, int)
        Value and degrees of freedom of every flight.
    """
    total, dof = np.sum(chi_squares, axis=0)
    low, high = stats.chi2.interval(0.99, dof)
    assert low < total < high, f"{total:.1f}, expected {low:.1f} to {high:.1f}"
    for value, n in chi_squares:  # one of twenty flights in 500 would fail
        assert 1e-4 < stats.chi2.sf(value, n) < 1 - 1e-4


def assert_within_4_sigma(errors, found):
    """Assert it for every parameter; a sigma of zero says that it is held."""
    free = found.sigma > 0
    assert np.all(errors[~free] == 0)
    normalised = errors[free] / found.sigma[free]
    assert np.all(np.abs(normalised) < 4), dict(
        zip(np.array(found.names)[free], normalised, strict=True)
    )


def named(block, rejected):
    """Return what was rejected by its names: kind, image or exposure, point."""
    points, images = block.image_points, block.images.names
    names = {
        "image_point": lambda row: (images[points.image_idx[row]], points.point_idx[row]),
        "control_point": lambda row: ("", block.control.point_idx[row]),
        "gnss": lambda row: (block.trajectory.exposures[row], -1),
        "attitude": lambda row: (block.trajectory.exposures[row], -1),
    }
    out = set()
    for r in rejected:
        where, point = names[r.kind](r.row)
        out.add((r.kind, where, block.points[point] if point >= 0 else ""))
    return out


# --- the same for both designs -----------------------------------------------------------------


def assert_two_step_claims_its_scatter(design, flights):
    """Assert that errors over sigma scatter by one for every parameter.

    A standard deviation from n flights is itself uncertain by 1 / sqrt(2 n): 10 % from 50, 5 %
    from 200. Three of these are allowed to fourteen parameters.
    """
    normalised = []
    for seed in range(1, flights + 1):
        found = two_step_estimates(design, seed=seed)
        errors = found.values - true_mounting(design)
        normalised.append(errors / np.sqrt(np.diag(found.cov)))
    found = np.std(normalised, axis=0, ddof=1)
    np.testing.assert_allclose(found, 1.0, atol=3 / np.sqrt(2 * flights))


def assert_check_points_fit(design, method):
    """Assert that differences at check points are without bias and as large as their sigma.

    Points of one flight share parameters and exposures; flights are independent. So the flights'
    means are tested, with Student's distribution at 99.9 % (many are tested).
    """
    found = [validations(design, seed=seed)[method] for seed in SEEDS]
    limit = stats.t.ppf(0.9995, len(SEEDS) - 1)
    for part in ("points", "pairs"):
        differences = [getattr(v, part) for v in found]
        normalised = [d.d / d.sigma for d in differences]
        for of_flights, expected in (
            (np.array([np.mean(z**2, axis=0) for z in normalised]), 1.0),
            (np.array([np.mean(z, axis=0) for z in normalised]), 0.0),
        ):
            error = of_flights.std(axis=0, ddof=1) / np.sqrt(len(SEEDS))
            assert np.all(error < 0.12)  # or the test would see nothing
            assert np.all(np.abs(of_flights.mean(axis=0) - expected) < limit * error)
