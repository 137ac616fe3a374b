"""The error budget: how much of the variance of a ground point comes from each source.

The errors of a point are a sum: of those of its image points and of the survey it is compared with,
of the trajectory at each of its exposures, and of the calibration. Sources that are independent add
their variances. The estimates of a calibration are correlated, so that the variance has terms with
two of its groups, too. Such a term is a source by itself here; it may be negative.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np

from acx4lib import expected
from acx4lib.bundle.unknowns import Layout
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block
from acx4lib.geometry.camera import Camera, correct, inside, xy_from_colrow
from acx4lib.geometry.collinearity import as_seen, pinhole, project, to_camera
from acx4lib.geometry.intersection import largest_angles
from acx4lib.georeferencing import direct
from acx4lib.georeferencing.direct import Georeferenced
from acx4lib.georeferencing.error_sources import ErrorSources, turned

TRAJECTORY = {"GNSS": (0, 1, 2), "roll": (3,), "pitch": (4,), "heading": (5,)}
"""Columns of a body pose, by source: position, and small turns about the body's axes."""

CALIBRATED = ("boresight", "lever arm", "interior orientation")
"""Groups of calibrated parameters."""

PAIRS = tuple(combinations_with_replacement(range(len(CALIBRATED)), 2))
"""Each group with itself, and with each later one."""

CALIBRATION = tuple(" with ".join(dict.fromkeys((CALIBRATED[a], CALIBRATED[b]))) for a, b in PAIRS)
"""Sources of the calibration: its groups, and their correlations."""

SOURCES = ("image points", "survey", *TRAJECTORY, *CALIBRATION)
"""All sources, in the order of `Budget.variance`."""

GROUPS = {
    "image and survey": SOURCES[:2],
    "trajectory": tuple(TRAJECTORY),
    "calibration": CALIBRATION,
}
"""The sources in three groups, which are independent of one another."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Budget:
    """Predicted variances of n points, by their sources.

    Attributes
    ----------
    variance : ndarray, shape (n, 3, n_sources)
        m^2, along the axes of the points' errors, in the order of `SOURCES`; the sum over the last
        axis is the variance of the point.
    """

    variance: Array

    def __post_init__(self) -> None:
        expected.shape("variance", self.variance, ("n", 3, len(SOURCES)))

    def __len__(self) -> int:
        """Count the points."""
        return len(self.variance)

    @property
    def sigma(self) -> Array:
        """Standard deviation of every point, shape (n, 3), m."""
        return np.sqrt(self.variance.sum(axis=-1))

    @property
    def mean(self) -> Array:
        """Mean variance of the points, shape (3, n_sources), m^2.

        NaN are left out: points that are not determined.
        """
        known = self.variance[np.isfinite(self.variance).all(axis=(1, 2))]
        return known.mean(axis=0) if len(known) else np.full((3, len(SOURCES)), np.nan)

    @property
    def rms(self) -> Array:
        """Predicted RMS of the points' errors, shape (3,), m."""
        return np.sqrt(self.mean.sum(axis=-1))


def of(sources: ErrorSources, layout: Layout) -> Budget:
    """Split the variances of points by their sources.

    Valid where positions are independent of attitudes, and the three angles of one another, as
    `Trajectory.cov` has them. Errors that exposures share belong to the source that they are of.

    Parameters
    ----------
    sources : ErrorSources
        Of points, differences or pairs, along any axes.
    layout : Layout
        Columns of the calibration, `Georeferenced.layout`.

    Returns
    -------
    Budget
        Its sum is the diagonal of `sources.cov`, to rounding.

    Notes
    -----
    With x = A a + B b and the covariance C of a and b, var(x) = A C_aa A^T + B C_bb B^T +
    2 A C_ab B^T; the last is the part of their correlations.
    """
    variance = np.zeros((len(sources), 3, len(SOURCES)))
    variance[:, :, 0] = np.diagonal(sources.image, axis1=1, axis2=2)
    variance[:, :, 1] = np.diagonal(sources.survey, axis1=1, axis2=2)
    cov = sources.cov_body[sources.exposure]
    point, i, j = sources.neighbours
    first, second, between = sources.by_body[i], sources.by_body[j], sources.between(i, j)
    for s, columns in enumerate(TRAJECTORY.values(), start=2):
        own = np.array(columns)
        at = _product(sources.by_body, cov, own, own)
        np.add.at(variance[:, :, s], sources.point, at)
        shared = (first[:, :, own] @ between[:, own[:, None], own]) * second[:, :, own]
        np.add.at(variance[:, :, s], point, 2 * shared.sum(axis=-1))
    groups = (layout.mount[:, 3:], layout.mount[:, :3], layout.interior)
    columns_of = [np.unique(group[group >= 0]) for group in groups]
    J, C = sources.by_parameters, sources.cov_parameters
    for s, (a, b) in enumerate(PAIRS, start=2 + len(TRAJECTORY)):
        part = _product(J, C, columns_of[a], columns_of[b])
        variance[:, :, s] = part if a == b else 2 * part
    return Budget(variance=variance)


def _product(J: Array, cov: Array, a: Index, b: Index) -> Array:
    """Return the diagonal of J_a cov_ab J_b^T over leading axes, shape (n, 3)."""
    right = J[:, :, b] @ np.swapaxes(cov[..., a[:, None], b], -1, -2)
    return np.sum(J[:, :, a] * right, axis=-1)


def shares(variance: Array) -> dict[str, Array]:
    """Return what share of a variance each group of sources has.

    Parameters
    ----------
    variance : ndarray, shape (..., n_sources)

    Returns
    -------
    dict of str to ndarray, shape (...)
        By the names of `GROUPS`; they add up to one.
    """
    expected.shape("variance", variance, (..., len(SOURCES)))
    total = variance.sum(axis=-1)
    return {
        name: variance[..., [SOURCES.index(source) for source in sources]].sum(axis=-1) / total
        for name, sources in GROUPS.items()
    }


def predict(
    block: Block,
    georeferenced: Georeferenced,
    x_m: Array,
    *,
    sigma_px: float,
    sigma_survey_m: Array | None = None,
    refraction: str = "none",
) -> Budget:
    """Predict the errors of points that are intersected from every image that shows them.

    Nothing is measured for it; the image points are where the cameras show the points.

    Parameters
    ----------
    block : Block
        Its images; its own points are not used.
    georeferenced : Georeferenced
        The block's poses, as `direct.georeference` returns them.
    x_m : ndarray, shape (n, 3)
        Mapping frame, m.
    sigma_px : float
        Standard deviation of every image point.
    sigma_survey_m : ndarray, shape (3,), optional
        Of the coordinates with which a point is compared, east, north, height; zero by default.
    refraction : str
        ``"none"`` or ``"standard"``.

    Returns
    -------
    Budget
        Along east, north and height; NaN for points whose rays from fewer than two images meet at
        the block's smallest angle.
    """
    points, met = sources_at(
        block,
        georeferenced,
        x_m,
        sigma_px=sigma_px,
        sigma_survey_m=sigma_survey_m,
        refraction=refraction,
    )
    variance = np.full((len(x_m), 3, len(SOURCES)), np.nan)
    variance[points] = of(met, georeferenced.layout).variance
    return Budget(variance=variance)


def sources_at(
    block: Block,
    georeferenced: Georeferenced,
    x_m: Array,
    *,
    sigma_px: float,
    sigma_survey_m: Array | None = None,
    refraction: str = "none",
) -> tuple[Index, ErrorSources]:
    """Return the sources of the errors that `predict` predicts.

    Parameters
    ----------
    block, georeferenced, x_m, sigma_px, sigma_survey_m, refraction
        As in `predict`.

    Returns
    -------
    points : ndarray, shape (k,)
        Places of the points that have an error: those of `predict` without NaN.
    sources : ErrorSources
        Of these, along east, north and height.
    """
    x_m = expected.numbers("x_m", x_m, ("n", 3))
    expected.positive_number("sigma_px", sigma_px)
    survey = np.zeros(3) if sigma_survey_m is None else sigma_survey_m
    expected.shape("sigma_survey_m", survey, (3,))
    image_idx, point_idx, colrow = shown(block, georeferenced, x_m, refraction=refraction)
    towards = x_m[point_idx] - georeferenced.T_m_c.r[image_idx]
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    known = largest_angles(towards, point_idx, len(x_m)) >= block.smallest_angle
    rows = np.flatnonzero(known[point_idx])
    points, group = np.unique(point_idx[rows], return_inverse=True)
    measured = direct.Rays(
        image_idx=image_idx[rows],
        group=group,
        colrow=colrow[rows],
        sigma_px=np.full(len(rows), sigma_px),
    )
    met = direct.intersect_rays(block, georeferenced, measured, refraction=refraction)
    sources = turned(met.sources, block.frame.grid_axes(x_m[points]))
    surveyed = np.tile(np.diag(np.asarray(survey) ** 2), (len(points), 1, 1))
    return points, replace(sources, survey=surveyed)


def shown(
    block: Block, georeferenced: Georeferenced, x_m: Array, *, refraction: str = "none"
) -> tuple[Index, Index, Array]:
    """Return which images show which points, and where: image and point of each, and its pixel.

    Parameters
    ----------
    block : Block
    georeferenced : Georeferenced
    x_m : ndarray, shape (n, 3)
        Mapping frame, m.
    refraction : str
        ``"none"`` or ``"standard"``.

    Returns
    -------
    image_idx, point_idx : ndarray, shape (k,)
        Sorted by point.
    colrow : ndarray, shape (k, 2)
    """
    image_idx, point_idx, colrow = [], [], []
    limits = [_limits(camera) for camera in georeferenced.cameras]
    for i, k in enumerate(block.images.camera_idx):
        camera, T_m_c = georeferenced.cameras[k], georeferenced.T_m_c[i : i + 1]
        seen_at = as_seen(T_m_c.r, x_m, refraction=refraction)
        ideal = pinhole(camera.interior.f, to_camera(T_m_c, seen_at))
        near = np.flatnonzero(np.all(np.abs(ideal) <= limits[k], axis=1))
        at = project(camera, T_m_c, seen_at[near])
        within = inside(camera, at)
        image_idx.append(np.full(int(within.sum()), i))
        point_idx.append(near[within])
        colrow.append(at[within])
    point = np.concatenate([*point_idx, np.zeros(0, dtype=np.intp)])
    order = np.argsort(point, kind="stable")
    image = np.concatenate([*image_idx, np.zeros(0, dtype=np.intp)])
    return image[order], point[order], np.concatenate([*colrow, np.zeros((0, 2))])[order]


def _limits(camera: Camera) -> Array:
    """Return how far from the principal point ideal image points of the format lie, mm, and more.

    Points beyond need no search for their distorted place.
    """
    col, row = (np.array([0.0, 0.5, 1.0]) * n - 0.5 for n in (camera.width_px, camera.height_px))
    border = np.stack(np.meshgrid(col, row), axis=-1).reshape(-1, 2)
    ideal = correct(camera.interior, xy_from_colrow(camera, border))
    return 1.05 * np.abs(ideal).max(axis=0)
