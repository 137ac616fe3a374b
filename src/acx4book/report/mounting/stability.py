"""The boresight over time: values of all images, a drift, and differences between strips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from acx4book.report.material import Material, block_of, exposure_times
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block
from acx4lib.geometry.frames import log, mean_rotation, opk_jacobian
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.least_squares.statistical import distributions
from acx4lib.results import folder

AXES = ("x", "y", "z")
SOURCES = ("mounting/two_step", "mounting/two_step_gnss")
"""Methods that orient the images without the attitudes of the trajectory."""


@dataclass(frozen=True, kw_only=True)
class Drift:
    """A straight line through the boresights over the exposures, about one axis of the body.

    Attributes
    ----------
    axis : str
    change_deg, sigma_deg : float
        Change from the first exposure to the last, and its standard deviation from the scatter.
    p : float
        Probability of such a change or a larger one if there is none.
    p_strips : float
        Probability of such differences of strip means if there are none; NaN for one strip.
    """

    axis: str
    change_deg: float
    sigma_deg: float
    p: float
    p_strips: float


@dataclass(frozen=True, kw_only=True)
class Line:
    """A straight line through values of equal weight.

    Attributes
    ----------
    at_zero, slope : float
    sigma_slope : float
        Standard deviation of the slope, from the scatter about the line.
    p : float
        Two-sided probability of such a slope, or a larger one, if there is none; Student's test.
    """

    at_zero: float
    slope: float
    sigma_slope: float
    p: float


def boresights(material: Material) -> pd.DataFrame:
    """Return the boresight of every image, eq. (13), minus the mean of its camera.

    Parameters
    ----------
    material : Material

    Returns
    -------
    DataFrame
        camera, image, strip, number (in order of time), time_s (after the first image; NaN where
        not known), x_deg, y_deg, z_deg about the axes of the body, and their sigma_*_deg from the
        image's orientation and the trajectory's attitude, without the error that all images
        share. Empty where no bundle had free orientations.
    """
    source = next((s for s in SOURCES if folder.has(material.found, s)), "")
    rows = folder.rows(material.found, "exterior_orientation", source) if source else pd.DataFrame()
    if rows.empty:
        return pd.DataFrame()
    block = block_of(material, source)
    image_idx = pd.Index(block.images.names).get_indexer(pd.Index(rows["image"]))
    turns, sigma = _turns(block, image_idx, rows)
    times = exposure_times(material, block).to_numpy()[block.images.exposure_idx[image_idx]]
    frame = pd.DataFrame(
        {
            "camera": [block.cameras[k].name for k in block.images.camera_idx[image_idx]],
            "image": rows["image"],
            "strip": [block.images.strips[i] for i in image_idx],
            "time_s": times - np.nanmin(times) if np.isfinite(times).any() else times,
            **{f"{axis}_deg": turns[:, i] for i, axis in enumerate(AXES)},
            **{f"sigma_{axis}_deg": sigma[:, i] for i, axis in enumerate(AXES)},
        }
    )
    known = np.isfinite(times).all()
    frame = frame.sort_values("time_s", kind="stable") if known else frame
    return frame.assign(number=np.arange(1, len(frame) + 1)).reset_index(drop=True)


def _turns(block: Block, image_idx: Index, rows: pd.DataFrame) -> tuple[Array, Array]:
    """Return boresights minus their mean, and their sigma, body axes, degrees, shape (n, 3)."""
    enh = rows[["east_m", "north_m", "height_m"]].to_numpy()
    opk = np.radians(rows[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy())
    T_m_c = block.frame.pose_from_grid(enh, opk)
    R_b_c = np.swapaxes(block.T_m_b_images.R[image_idx], 1, 2) @ T_m_c.R
    turns, camera_idx = np.zeros((len(rows), 3)), block.images.camera_idx[image_idx]
    for k in np.unique(camera_idx):
        own = camera_idx == k
        turns[own] = log(R_b_c[own] @ mean_rotation(R_b_c[own]).T)
    said = rows[["sigma_omega_deg", "sigma_phi_deg", "sigma_kappa_deg"]].to_numpy()
    J = R_b_c @ np.linalg.inv(opk_jacobian(opk))
    by_image = propagate(J, np.apply_along_axis(np.diag, 1, said**2))
    attitude = np.degrees(block.trajectory.sigma_attitude[block.images.exposure_idx[image_idx]])
    return np.degrees(turns), np.sqrt(sigmas(by_image) ** 2 + attitude**2)


def drifts(listed: pd.DataFrame) -> list[Drift]:
    """Test the boresights for a drift and for differences between strips, axis by axis.

    Parameters
    ----------
    listed : DataFrame
        As `boresights` returns it.

    Returns
    -------
    list of Drift
        Empty for fewer than four images.

    Notes
    -----
    A regression line over time (over the order of the images where times are not known) with
    Student's test, and a one-way analysis of variance over the strips. Both use the observed
    scatter, not the predicted sigma.
    """
    if len(listed) < 4:
        return []
    time = listed["time_s" if listed["time_s"].notna().all() else "number"].to_numpy(dtype=float)
    out = []
    for axis in AXES:
        values = listed[f"{axis}_deg"].to_numpy()
        span = float(np.ptp(time))
        line = straight_line(time, values) if span > 0 else None
        out.append(
            Drift(
                axis=axis,
                change_deg=line.slope * span if line else np.nan,
                sigma_deg=line.sigma_slope * span if line else np.nan,
                p=line.p if line else np.nan,
                p_strips=_between_strips(values, listed["strip"]),
            )
        )
    return out


def _between_strips(values: Array, strips: pd.Series) -> float:
    groups = [values[(strips == name).to_numpy()] for name in strips.unique() if name]
    groups = [group for group in groups if len(group) > 1]
    return equal_means_p(groups) if len(groups) > 1 else np.nan


def straight_line(x: Array, y: Array) -> Line:
    """Fit a straight line to values of equal weight.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        The x must differ; two points have no scatter, their sigma and p are NaN.
    """
    n, dx, dy = len(x), x - x.mean(), y - y.mean()
    slope = float(dx @ dy / (dx @ dx))
    v = dy - slope * dx
    with np.errstate(divide="ignore", invalid="ignore"):
        sigma = float(np.sqrt(np.divide(v @ v, n - 2) / (dx @ dx)))
        t = np.abs(np.divide(slope, sigma))
    return Line(
        at_zero=float(y.mean() - slope * x.mean()),
        slope=slope,
        sigma_slope=sigma,
        p=2 * distributions.t_sf(float(t), n - 2),
    )


def equal_means_p(groups: Sequence[Array]) -> float:
    """Return the probability of means that differ so much, or more, if the true ones are equal.

    Parameters
    ----------
    groups : sequence of ndarray, shape (n,)
        At least two, with values of equal weight; Fisher's one-way analysis of variance.
    """
    together = np.concatenate(groups)
    between = sum(len(own) * (own.mean() - together.mean()) ** 2 for own in groups)
    within = sum(np.sum((own - own.mean()) ** 2) for own in groups)
    dfn, dfd = len(groups) - 1, len(together) - len(groups)
    with np.errstate(divide="ignore", invalid="ignore"):
        return distributions.f_sf(np.divide(between / dfn, within / dfd), dfn, dfd)
