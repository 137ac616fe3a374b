"""Two calibrations of the same cameras compared, to say whether a camera has changed.

A campaign is what one results folder says of the cameras: parameters with their joint covariance.
Two of them count as independent, so that the covariance of their difference is the sum of both.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from acx4files.results import folder as results
from acx4files.results.provenance import read_run
from acx4files.results.read_back import read_calibration
from acx4lib.calibration import estimates
from acx4lib.calibration.estimates import Calibration, Parameter
from acx4lib.design import flying_heights
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import INTERIOR, Camera
from acx4lib.geometry.collinearity import rays
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.parameters import BORESIGHT, LEVER_ARM
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import sigmas

COMPARED = ("single_step", "rig", "rig_calibration", "two_step_gnss", "two_step")
"""Methods whose calibrations can be compared; the default is the first that a run has."""

PARTS = {"interior orientation": INTERIOR, "lever arm": LEVER_ARM, "boresight": BORESIGHT}
"""Parameters that are tested together, by the name of the part."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Campaign:
    """A calibration a posteriori by one of `COMPARED`, and the flight that it is of.

    `height_m` is the median flying height above the surveyed points, `frame_deg` the angles that
    define the frame of synthetic images, empty for a real camera, `flight` the flight's checksum.
    """

    name: str
    method: str
    calibration: Calibration
    redundancy: int
    height_m: float
    frame_deg: tuple[float, ...] = ()
    flight: str = ""


def read(folder: str | Path, *, method: str = "") -> Campaign:
    """Read a campaign from the results of a run, by the first of `COMPARED` unless one is named.

    Raises
    ------
    FlightError
        Where the folder has no such results, they were changed after the run, or the method did
        not end with a calibration.
    """
    run = read_run(folder)
    stored, flight = run.found, run.flight
    chosen = method or next((m for m in COMPARED if f"mounting/{m}" in stored.summary), "")
    key = f"mounting/{chosen}"
    entry = stored.summary.get(key)
    if entry is None:
        raise FlightError([f"{run.folder}: no results of {key}; acx4 run makes them"])
    if not entry.get("converged") or entry.get("stopped"):
        reason = next(iter(results.messages(entry, "stopped")), f"{key} did not converge")
        raise FlightError([f"{run.folder}: no calibration to compare: {reason}"])
    cameras = [flight.cameras[name] for name in results.cameras(stored, key)]
    calibration = read_calibration(stored, key, cameras)
    synthetic = None if chosen in estimates.RIGS else flight.synthetic_camera
    block = flight.block("heads" if chosen == "rig" else "calibration")
    return Campaign(
        name=run.folder.resolve().name,
        method=chosen,
        calibration=calibration,
        redundancy=int(str(entry["redundancy"])),
        height_m=float(np.median(flying_heights(block))),
        frame_deg=() if synthetic is None else tuple(np.degrees(synthetic.T_b_c.opk).tolist()),
        flight=run.provenance.digest,
    )


class JointTest(NamedTuple):
    """Test whether a vector is zero: d^T C^-1 d, its components, probability of such or more."""

    chi_square: float
    dof: int
    p: float


def joint_test(d: Array, cov: Array, *, redundancy: float = np.inf) -> JointTest:
    """Test whether a vector, shape (k,), is zero, by its positive definite covariance, (k, k).

    A finite `redundancy` is that of the adjustments which estimated the variance factor of `cov`,
    the smallest; the probability is then that of Fisher's F = chi_square / k.
    """
    sigma = sigmas(cov)  # units differ by many powers of ten
    z, k = d / sigma, len(d)
    chi_square = float(z @ np.linalg.solve(cov / sigma[:, None] / sigma, z))
    if np.isinf(redundancy):
        return JointTest(chi_square, k, statistics.chi2_sf(chi_square, k))
    return JointTest(chi_square, k, statistics.f_sf(chi_square / k, k, redundancy))


def pooled(values: Array, covs: Array) -> tuple[Array, Array]:
    """Return the mean of n vectors, (n, k), weighted by their covariances, (n, k, k), and its own.

    It is the estimate of least squares, where the vectors are independent.
    """
    scale = np.sqrt(np.mean(np.diagonal(covs, axis1=1, axis2=2), axis=0))
    W = np.linalg.inv(covs / scale[:, None] / scale)
    cov = np.linalg.inv(W.sum(axis=0))
    mean: Array = scale * (cov @ np.einsum("ijl,il->j", W, values / scale))
    return mean, cov * scale[:, None] * scale


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Two campaigns, and the k parameters that both determined.

    `values`, shape (2, k), are in the units of results, angles without jumps of 360 degrees;
    `covs`, shape (2, k, k), a posteriori; `d` is the second minus the first, `cov` its covariance.
    """

    campaigns: tuple[Campaign, Campaign]
    parameters: tuple[Parameter, ...]
    values: Array
    covs: Array
    d: Array
    cov: Array

    def test(self, which: Index | None = None) -> JointTest:
        """Test some parameters, or all of them, for no difference."""
        at = np.arange(len(self.d)) if which is None else which
        redundancy = min(campaign.redundancy for campaign in self.campaigns)
        return joint_test(self.d[at], self.cov[np.ix_(at, at)], redundancy=redundancy)

    def of_camera(self, camera: str) -> Index:
        """Return the places of a camera's parameters."""
        return np.flatnonzero([p.camera == camera for p in self.parameters])


def compare(first: Campaign, second: Campaign) -> Comparison:
    """Put two campaigns side by side.

    Raises
    ------
    FlightError
        Where they are of the same flight, their cameras are not the same, or no parameter was
        determined by both.
    """
    one, other = (_determined(campaign.calibration) for campaign in (first, second))
    names = [name for name in one if name in other]
    if problems := list(_problems(first, second, names)):
        raise FlightError(problems)
    values = np.array([[found[name][1].value for name in names] for found in (one, other)])
    turned = np.array([one[name][1].unit == "deg" for name in names])
    values -= np.where(turned, 360.0 * np.round((values - values[0]) / 360.0), 0.0)
    covs = np.empty((2, len(names), len(names)))
    for k, (campaign, found) in enumerate(((first, one), (second, other))):
        at = [found[name][0] for name in names]
        covs[k] = estimates.reported_covariance(campaign.calibration)[np.ix_(at, at)]
    listed = tuple(one[name][1] for name in names)
    d, cov = values[1] - values[0], covs.sum(axis=0)
    return Comparison(
        campaigns=(first, second), parameters=listed, values=values, covs=covs, d=d, cov=cov
    )


def _determined(calibration: Calibration) -> dict[str, tuple[int, Parameter]]:
    """Return the determined parameters with their places, by camera and name."""
    keep = estimates.is_determined(calibration)
    listed = enumerate(estimates.parameters(calibration))
    return {f"{p.camera}/{p.name}": (i, p) for i, p in listed if keep[i]}


def _problems(first: Campaign, second: Campaign, names: Sequence[str]) -> Iterator[str]:
    """Yield why two campaigns cannot be compared."""
    both = f"{first.name} and {second.name}"
    if first.flight and first.flight == second.flight:
        yield f"{both} are results of the same flight: their errors are the same, not independent"
    if not names:
        yield f"{both}: no parameter of a camera of the same name was determined by both"
    mine, other = (
        {c.name: (c.width_px, c.height_px, c.pixel_mm) for c in campaign.calibration.cameras}
        for campaign in (first, second)
    )
    for name in [name for name in mine if other.get(name, mine[name]) != mine[name]]:
        yield f"{both}: {name} is not the same camera: {mine[name]} is not {other[name]}"
    frames = first.frame_deg, second.frame_deg
    if all(frames) and np.abs(np.subtract(*frames)).max() > 0.01:
        yield f"{both}: mount_* define another frame of synthetic images; compare by the method rig"


def on_ground(
    camera: Camera, names: Sequence[str], steps: Array, *, height_m: float, nodes: int = 15
) -> tuple[Array, Array]:
    """Return points on level ground that a camera sees, and their derivatives by its parameters.

    The body is level, `height_m` above the ground, and its pose is right. Points are forward and
    left of it, m, shape (n, 2), for nodes over the format; derivatives, shape (n, 2, k), are
    central differences of the steps, shape (k,), by parameters with their names in results.
    """
    col, row = (np.linspace(0, n - 1, nodes) for n in (camera.width_px, camera.height_px))
    colrow = np.stack(np.meshgrid(col, row), axis=-1).reshape(-1, 2)
    reported, columns = estimates.reported_values(camera), []
    for name, step in zip(names, steps.tolist(), strict=True):
        ahead, behind = (
            _met(estimates.with_reported(camera, {name: reported[name] + s}), colrow, height_m)
            for s in (step, -step)
        )
        columns.append((ahead - behind) / (2 * step))
    xy, J = _met(camera, colrow, height_m), np.stack(columns, axis=-1)
    seen = np.isfinite(xy).all(axis=1) & np.isfinite(J).all(axis=(1, 2))
    return xy[seen], J[seen]


def _met(camera: Camera, colrow: Array, height_m: float) -> Array:
    """Return where rays of a camera on a level body meet the ground, m, NaN for rays upwards."""
    r, n = camera.T_b_c.r + np.array([0.0, 0.0, height_m]), len(colrow)
    ray = rays(camera, Pose(R=np.tile(camera.T_b_c.R, (n, 1, 1)), r=np.tile(r, (n, 1))), colrow)
    down = np.where(ray[:, 2] < 0, -ray[:, 2], np.nan)
    return r[:2] + ray[:, :2] * (r[2] / down)[:, None]


def ground_of(comparison: Comparison, height_m: float = np.nan) -> dict[str, Array]:
    """Return derivatives on the ground by camera, (n, 2, k), by its k parameters.

    The default height is the flying height of the first campaign, rounded to 10 m.
    """
    first, sigma, found = comparison.campaigns[0], sigmas(comparison.covs[0]), {}
    height = max(10.0, round(first.height_m, -1)) if np.isnan(height_m) else height_m
    for camera in first.calibration.cameras:
        at = comparison.of_camera(camera.name)
        names = [comparison.parameters[i].name for i in at]
        if names:
            found[camera.name] = on_ground(camera, names, sigma[at], height_m=height)[1]
    return found


def tests(comparison: Comparison, ground: Mapping[str, Array]) -> pd.DataFrame:
    """Return the joint tests: of all parameters, of those of each camera, and of its parts.

    `p_joint` is Holm's over the cameras, and over the parts. `ground_rms_m` is what the parameters
    move together, as RMS over the format, `ground_sigma_m` what they would by chance.
    """
    rows = [{"camera": "all", "part": "all", **comparison.test()._asdict()}]
    for camera, J in ground.items():
        own = comparison.of_camera(camera)
        keys = [comparison.parameters[i].key for i in own]
        for part, chosen in {"all": keys, **PARTS}.items():
            at = np.flatnonzero([key in chosen for key in keys])
            if len(at):
                d, cov = comparison.d[own[at]], comparison.cov[np.ix_(own[at], own[at])]
                moved, variance = J[:, :, at] @ d, J[:, :, at] @ cov * J[:, :, at]
                row = {"camera": camera, "part": part, **comparison.test(own[at])._asdict()}
                row["ground_rms_m"] = np.sqrt(np.sum(moved**2, axis=1).mean())
                row["ground_sigma_m"] = np.sqrt(np.sum(variance, axis=(1, 2)).mean())
                rows.append(row)
    table = pd.DataFrame(rows)
    alike = table.groupby([table["camera"] == "all", table["part"] == "all"])["p"]
    joint = alike.transform(lambda p: statistics.holm(p.to_numpy()))
    table.insert(5, "p_joint", joint)
    return table


def differences(comparison: Comparison, ground: Mapping[str, Array]) -> pd.DataFrame:
    """Return the difference of every parameter, and its value of both campaigns together.

    `ground_rms_m` is what the difference moves by itself.
    """
    d, sigma = comparison.d, sigmas(comparison.cov)
    mean, cov = pooled(comparison.values, comparison.covs)
    p = np.array([comparison.test(np.array([i])).p for i in range(len(d))])
    named = [(q.camera, q.name, q.unit) for q in comparison.parameters]
    table = pd.DataFrame(named, columns=["camera", "parameter", "unit"])
    table = table.assign(difference=d, sigma=sigma, t=d / sigma, p=p, p_joint=statistics.holm(p))
    for camera, J in ground.items():
        at = comparison.of_camera(camera)
        table.loc[at, "ground_rms_m"] = np.sqrt(np.sum((J * d[at]) ** 2, axis=1).mean(axis=0))
    return table.assign(pooled=mean, pooled_sigma=sigmas(cov))
