"""The numbers of DBAT's reports, from our adjustments, by their places in the report."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from scipy import stats

from acx4book.reference import dbat_files
from acx4book.reference.dbat_files import INTERIOR_NAMES, Angle, Place, Project, Statements
from acx4lib.bundle.adjust import Bundle
from acx4lib.expected import Array, Index
from acx4lib.geometry.frames import opk_jacobian

HIGH = 0.95
"""Correlation above which the report lists a pair."""

LAST, QUALITY = "Information from last bundle", "Quality"
EXTERIOR = ("Xc", "Yc", "Zc", "Omega", "Phi", "Kappa")
MODEL = "Backward (Photogrammetry) model 3"
"""Of DBAT's lens models the one of both reports, and ours."""

_NO_RESULT: dict[Place, str] = {
    ("Project",): "names and folders on its author's machine",
    (LAST, "Last Bundle Run"): "date",
    (LAST, "DBAT version"): "version",
    (LAST, "MATLAB version"): "version",
    (LAST, "Host system"): "machine",
    (LAST, "Host name"): "machine",
    (LAST, "Processing options"): "settings of the program",
    (LAST, "Total error", "Number of stages"): "course of its computation",
    (LAST, "Total error", "Number of iterations"): "course of its computation",
    (LAST, "Total error", "First error"): "depends on its own start values",
    (LAST, "Execution times (s)"): "course of its computation",
    ("Problems and suggestions",): "sentences on numbers that stand elsewhere",
    (LAST, "Cameras", "Rated angle of view (h,v,d)"): "of the sensor alone",
    (LAST, "Cameras", "Largest distortion"): "by a formula of its own",
    **{
        (LAST, "Cameras", "Camera1 (simple)", f"{what} {side}"): "of the sensor alone"
        for what in ("Format", "Image", "Pixel")
        for side in ("width", "height")
    },
    (LAST, "Cameras", "Camera1 (simple)", "X resolution"): "of the sensor alone",
    (LAST, "Cameras", "Camera1 (simple)", "Y resolution"): "of the sensor alone",
    **{
        (QUALITY, what): "counts of the measurements"
        for what in ("Photographs", "Cameras", "Photo Coverage", "Point Measurements")
    },
    (QUALITY, "Point Angles"): "angles of rays that are not adjusted",
}
"""Lines of a report that are no results of the adjustment, with the reasons."""


def is_result(place: Place) -> bool:
    """Tell whether a line of a report states a result."""
    return not any(place[: len(prefix)] == prefix for prefix in _NO_RESULT)


def results(project: Project) -> pd.DataFrame:
    """Return every number of a report's results with ours, as `dbat_files.compare` does."""
    lines = dbat_files.read(project.report)
    printed = {place: line for place, line in lines.items() if is_result(place)}
    ours = _Ours(project)
    sections = (
        ours.status(),
        ours.camera(),
        ours.photographs(),
        ours.residuals(),
        ours.precision(),
        ours.surveyed("Ctrl", np.flatnonzero(~project.is_check)),
        ours.surveyed("Check", np.flatnonzero(project.is_check)),
    )
    return dbat_files.compare(printed, {k: v for section in sections for k, v in section.items()})


def exterior(project: Project) -> tuple[Array, Array]:
    """Return Xc, Yc, Zc, omega, phi, kappa (degrees) of all photos and their covariances.

    Returns
    -------
    values : ndarray, shape (n_images, 6)
    cov : ndarray, shape (n_images, 6, 6)
        A posteriori.
    """
    adjusted = project.bundle
    poses = adjusted.T_m_c
    by_step = np.zeros((len(poses), 6, 6))
    by_step[:, :3, :3] = np.eye(3)
    by_step[:, 3:, 3:] = np.degrees(opk_jacobian(poses.opk))
    columns = adjusted.network.layout.pose
    cov = adjusted.solution.cov[columns[:, :, None], columns[:, None, :]]
    cov = by_step @ cov @ np.swapaxes(by_step, 1, 2) * adjusted.solution.sigma0_sq
    return np.column_stack([poses.r + project.origin, np.degrees(poses.opk)]), cov


def _correlations(cov: Array) -> Array:
    """Return the correlations below the diagonal of a covariance; zero for a variance of zero."""
    sigma = np.sqrt(np.diag(cov))
    sigma = np.where(sigma > 0, sigma, np.inf)
    return np.asarray(np.tril(cov / sigma / sigma[:, None], -1))


def _estimated(place: Place, names: tuple[str, ...], values: Array, cov: Array) -> Statements:
    """Return values, standard deviations and high correlations, in percent, of some parameters."""
    lower = _correlations(cov)
    both = lower + lower.T
    out: Statements = {}
    for k, name in enumerate(names):
        heading = (*place, HEADINGS.get(name, name))
        value = float(values[k])
        out[(*heading, "Value")] = (Angle(value) if name in EXTERIOR[3:] else value,)
        if cov[k, k] > 0:
            out[(*heading, "Deviation")] = (float(np.sqrt(cov[k, k])),)
        if high := [100 * float(r) for r in both[k] if abs(r) > HIGH]:
            out[(*heading, "Correlations over 95%")] = tuple(high)
    return out


HEADINGS = {
    "cc": "Camera Constant",
    "px": "px - principal point x",
    "py": "py - principal point y",
    "K1": "K1 - radial distortion 1",
    "K2": "K2 - radial distortion 2",
    "K3": "K3 - radial distortion 3",
    "P1": "P1 - decentering distortion 1",
    "P2": "P2 - decentering distortion 2",
    "as": "as - off-unit aspect parameter",
}
"""Headings of the interior parameters."""

EPS = np.finfo(float).eps
"""Term that keeps the relative change of sigma finite for a point without error."""


@dataclass(frozen=True, eq=False)
class _Ours:
    """Our numbers of one project, section by section."""

    project: Project

    @property
    def bundle(self) -> Bundle:
        return self.project.bundle

    @cached_property
    def interior(self) -> tuple[Array, Array]:
        """DBAT's nine interior values and their a posteriori covariance."""
        solution, columns = self.bundle.solution, self.bundle.network.layout.interior[0]
        padded = np.pad(solution.cov, (0, 1))  # the column of a held parameter is -1
        cov = padded[np.ix_(columns, columns)] * solution.sigma0_sq
        return dbat_files.interior_to_dbat(self.bundle.cameras[0], cov)

    @cached_property
    def numbers(self) -> Index:
        """DBAT's numbers of the block's points."""
        return np.array([int(name) for name in self.bundle.network.block.points])

    @cached_property
    def point_covariances(self) -> Array:
        """A posteriori, shape (n_points, 3, 3)."""
        return self.bundle.solution.cov_points * self.bundle.solution.sigma0_sq

    def status(self) -> Statements:
        solution, network = self.bundle.solution, self.bundle.network
        n_interior, n_images = len(self.project.free), len(network.block.images)
        sigma0, sigma_px = (
            float(np.sqrt(solution.sigma0_sq)),
            float(network.image_points.sigma_px.min()),
        )
        n_image = int(2 * len(network.image_points))
        n_points = 3 * int(network.free_points.sum())
        n_other = solution.n_observations - n_image
        return {
            (LAST, "Status"): "OK",
            (LAST, "Sigma0"): (sigma0,),
            (LAST, "Sigma0 (pixels)"): (sigma0 * sigma_px,),
            (LAST, "Redundancy"): (solution.redundancy,),
            (LAST, "Number of params"): (solution.n_unknowns, n_interior, 6 * n_images, n_points),
            (LAST, "Number of observations"): (solution.n_observations, n_image, 0, 0, n_other),
            (LAST, "Total error", "Last error"): (float(np.sqrt(solution.cost)),),
            (LAST, "Lens distortion models", MODEL): "",
            (LAST, "Cameras", "Calibration"): (
                f"yes ({' '.join(INTERIOR_NAMES)})" if self.project.free else "no"
            ),
        }

    def camera(self) -> Statements:
        """Interior orientation, with the chi-square probabilities that it is not zero."""
        values, cov = self.interior
        camera = (LAST, "Cameras", "Camera1 (simple)")
        out = _estimated(camera, INTERIOR_NAMES, values, cov)
        out |= {
            (*camera, "Lens distortion model", MODEL): "",
            (*camera, "sk - skew", "Value"): (0.0,),
        }
        if not self.project.free:
            return out
        for names in (("K1",), ("K2",), ("K3",), ("as",), ("P1", "P2")):
            k = [INTERIOR_NAMES.index(name) for name in names]
            square = values[k] @ np.linalg.solve(cov[np.ix_(k, k)], values[k])
            p = (float(stats.chi2.cdf(square, len(k))),)
            out[(*camera, HEADINGS[names[0]], "Significance")] = p
            if names[0].startswith("K"):
                out[(*camera, HEADINGS[names[0]], "Cumulative significance")] = p
        return out

    def photographs(self) -> Statements:
        values, cov = exterior(self.project)
        photos = (LAST, "Precisions / Standard Deviations", "Photograph Standard Deviations")
        out: Statements = {}
        for k, name in enumerate(self.bundle.network.block.images.names):
            place = (*photos, f"Photo {k + 1}")
            out |= {place: name, **_estimated(place, EXTERIOR, values[k], cov[k])}
        return out

    def residuals(self) -> Statements:
        points, number = self.bundle.network.image_points, self.numbers
        squared = np.sum(self.bundle.solution.group("image_point").v ** 2, axis=1)
        place = (QUALITY, "Point Marking Residuals")
        worst = int(squared.argmax())
        found = (int(number[points.point_idx[worst]]), int(points.image_idx[worst]) + 1)
        out: Statements = {
            (*place, "Overall point RMS"): (float(np.sqrt(squared.mean())),),
            (*place, "Mark point residuals", "Maximum"): (float(np.sqrt(squared[worst])), *found),
        }
        photos = np.arange(1, len(self.bundle.network.block.images) + 1)
        groups = {
            "Object point residuals (RMS over all images of a point)": (points.point_idx, number),
            "Photo residuals (RMS over all points in an image)": (points.image_idx, photos),
        }
        for heading, (idx, name) in groups.items():
            count = np.bincount(idx)
            rms = np.sqrt(np.bincount(idx, squared) / count)
            for label, k in (("Minimum", int(rms.argmin())), ("Maximum", int(rms.argmax()))):
                out[(*place, heading, label)] = (float(rms[k]), int(name[k]), int(count[k]))
        return out

    def precision(self) -> Statements:
        cov, place = self.point_covariances, (QUALITY, "Point Precision")
        sigma = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
        sigma[~self.bundle.network.free_points] = np.nan
        total = np.sqrt(np.sum(sigma**2, axis=1))
        whole = (*place, "Total standard deviation (RMS of X/Y/Z std)")
        low = int(np.nanargmin(total))
        out: Statements = {(*whole, "Minimum"): (float(total[low]), int(self.numbers[low]))}
        largest: dict[Place, Array] = {(*whole, "Maximum"): total}
        for axis, of_axis in zip("XYZ", sigma.T, strict=True):
            largest[(*place, f"Maximum {axis} standard deviation")] = of_axis
        for where, values in largest.items():
            k = int(np.nanargmax(values))
            out[where] = (float(values[k]), int(self.numbers[k]))
        lower = np.abs([_correlations(one) for one in cov])
        for percent in (95, 99):
            label = f"Points with correlation above {percent}%"
            above = int(np.sum(lower > percent / 100))
            out[(*place, "Points with high correlations", label)] = (above,)
        return out

    def surveyed(self, name: str, rows: Index) -> Statements:
        """Return control points or check points before and after the adjustment."""
        project, place = self.project, (QUALITY, f"{name} measurements")
        if len(rows) == 0:
            return {(*place, "none"): ""}
        points = np.searchsorted(self.numbers, project.point[rows])
        given, before = project.x[rows], project.sigma[rows]
        x = self.bundle.state.x_m[points] + project.origin
        sigma = np.sqrt(np.diagonal(self.point_covariances[points], axis1=1, axis2=2))
        d = x - given
        length = np.linalg.norm(d, axis=1)
        moved = np.column_stack([d, np.hypot(*d[:, :2].T), length])
        change = 100 * ((sigma + EPS) / (before + EPS) - 1)
        out: Statements = {}
        for k, number in enumerate(project.point[rows]):
            n = int(self.bundle.network.block.rays[points[k]])
            for table, values in {
                "Prior": (*given[k], *before[k]),
                "Posterior": (*x[k], *sigma[k], n),
                "Diff (pos=abs diff, std=rel diff)": (*moved[k], *change[k], n),
            }.items():
                out[(*place, table, str(number))] = values
        delta = (*place, f"{name} point delta")
        sizes = {"Max": length, **dict(zip("XYZ", np.abs(d).T, strict=True))}
        for label, size in sizes.items():
            where = (*delta, "Max") if label == "Max" else (*delta, "Max X,Y,Z", label)
            out[where] = (float(size.max()), int(project.point[rows][size.argmax()]))
        out[(*delta, "RMS")] = (float(np.sqrt(np.mean(length**2))), len(rows))
        return out
