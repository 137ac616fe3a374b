"""The numbers of DBAT's reports, from our adjustments, by their places in the report."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from scipy import stats
from scipy.spatial import ConvexHull

from acx4book.reference import dbat_files
from acx4book.reference.dbat_files import INTERIOR_NAMES, Angle, Place, Project, Statements
from acx4lib.bundle.adjust import Bundle
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import reduced, xy_from_colrow
from acx4lib.geometry.frames import opk_jacobian

HIGH = 0.95
"""Correlation above which the report lists a pair."""

LAST, QUALITY = "Information from last bundle", "Quality"
EXTERIOR = ("Xc", "Yc", "Zc", "Omega", "Phi", "Kappa")
MODEL = "Backward (Photogrammetry) model 3"
"""Of DBAT's lens models the one of both reports, and ours."""

_NO_RESULT = {
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
        ours.sensor(),
        ours.photographs(),
        ours.coverage(),
        ours.rays(),
        ours.residuals(),
        ours.precision(),
        ours.angles(),
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
    def kinds(self) -> Array:
        """CP, CCP or OP for control, check and other points, shape (n_points,)."""
        block = self.bundle.network.block
        kind = np.full(len(block.points), "OP", dtype="<U3")
        kind[block.control.point_idx] = "CP"
        kind[block.check.point_idx] = "CCP"
        return kind

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
        problems = ("Problems and suggestions",)
        related = (*problems, "Problems related to the processing")
        of_camera = bool(np.any(np.abs(_correlations(self.interior[1])) > HIGH))
        of_stations = any(
            np.any(np.abs(_correlations(cov)) > HIGH) for cov in exterior(self.project)[1]
        )
        words = "a high correlation (see below)."
        said = {
            f"One or more of the camera parameter has {words}": of_camera,
            f"One or more of the camera station parameters has {words}": of_stations,
        }
        n_other = solution.n_observations - n_image
        return {
            (*problems, "Project Problems", "Structural rank"): "ok.",
            (*problems, "Project Problems", "Numerical rank"): (
                "deficient" if solution.undetermined.any() else "ok."
            ),
            related: (int(of_camera) + int(of_stations),),
            **{(*related, text): "" for text, is_said in said.items() if is_said},
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

    def sensor(self) -> Statements:
        camera, place = self.bundle.cameras[0], (LAST, "Cameras", "Camera1 (simple)")
        size_px = np.array([camera.width_px, camera.height_px])
        rated_mm = camera.pixel_mm * size_px
        size_mm = rated_mm * np.array([1 + camera.interior.b1, 1.0])
        diagonal_mm = float(np.hypot(*rated_mm))
        view = 2 * np.degrees(np.arctan(np.append(rated_mm, diagonal_mm) / 2 / camera.interior.f))
        largest = self._largest_distortion_mm()
        share = 200 * largest / diagonal_mm
        out: Statements = {
            (*place[:-1], "Rated angle of view (h,v,d)"): tuple(map(float, view)),
            (*place[:-1], "Largest distortion"): (largest, largest / camera.pixel_mm, share),
        }
        for k, (side, axis) in enumerate((("width", "X"), ("height", "Y"))):
            out[(*place, f"Format {side}", "Value")] = (float(size_mm[k]),)
            out[(*place, f"Image {side}", "Value")] = (int(size_px[k]),)
            out[(*place, f"{axis} resolution", "Value")] = (float(size_px[k] / size_mm[k]),)
            out[(*place, f"Pixel {side}", "Value")] = (float(size_mm[k] / size_px[k]),)
        return out

    def _largest_distortion_mm(self) -> float:
        """Return the largest distortion in the corners of the image by DBAT's formula, mm."""
        # with square pixels, with |dx| + |dy|, and with P1 and P2 exchanged in dx and in dy
        camera = self.bundle.cameras[0]
        _, px, py, _, k1, k2, k3, p1, p2 = self.interior[0]
        size = camera.pixel_mm * np.array([camera.width_px, camera.height_px])
        corners = 0.5 * camera.pixel_mm + size * np.array([[0, 0], [0, 1], [1, 1], [1, 0]])
        x, y = corners[:, 0] - px, corners[:, 1] - py
        r2 = x * x + y * y
        radial = r2 * (k1 + r2 * (k2 + r2 * k3))
        dx = x * radial + p1 * (r2 + 2 * x * x) + 2 * p1 * x * y
        dy = y * radial + p2 * (r2 + 2 * y * y) + 2 * p2 * x * y
        return float(np.max(np.abs(dx) + np.abs(dy)))

    def photographs(self) -> Statements:
        values, cov = exterior(self.project)
        photos = (LAST, "Precisions / Standard Deviations", "Photograph Standard Deviations")
        out: Statements = {}
        for k, name in enumerate(self.bundle.network.block.images.names):
            place = (*photos, f"Photo {k + 1}")
            out |= {place: name, **_estimated(place, EXTERIOR, values[k], cov[k])}
        return out

    def coverage(self) -> Statements:
        """Return counts, and the shares of the image that points cover, in percent."""
        n = len(self.bundle.network.block.images)
        camera, known = (QUALITY, "Cameras", "Camera1"), bool(self.project.free)
        outside = (QUALITY, "Photo Coverage", "Reference points outside calibrated region")
        every = 100 * np.array([self._covered(np.array([image])) for image in range(n)])
        union = 100 * self._covered(np.arange(n))
        shares: Statements = {
            (*camera, "Photo point coverage", name): tuple(
                map(float, (share.min(), share.max(), share.mean(), union[k]))
            )
            for k, (name, share) in enumerate(
                zip(("Rectangular", "Convex hull", "Radial"), every.T, strict=True)
            )
        }
        return {
            (QUALITY, "Photographs", "Total number"): (n,),
            (QUALITY, "Photographs", "Numbers used"): (int(self.bundle.oriented.sum()),),
            (QUALITY, "Cameras", "Total number"): (1, 1, 0),
            (*camera, "Calibration"): "yes" if known else "<not available>",
            (*camera, "Number of photos using camera"): (n,),
            (*outside, "Camera 1"): "none" if known else "<not available>",
            **shares,
        }

    def _covered(self, images: Index) -> Array:
        """Return the shares that the points of images cover: rectangle, convex hull, radius."""
        points, camera = self.bundle.network.block.image_points, self.bundle.cameras[0]
        colrow = points.colrow[np.isin(points.image_idx, images)]
        size = np.array([camera.width_px, camera.height_px])
        corners = size * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        inside, whole = (
            float(np.hypot(*reduced(camera.interior, xy_from_colrow(camera, pixels)).T).max())
            for pixels in (colrow, corners)
        )
        areas = np.array([np.prod(np.ptp(colrow, axis=0)), ConvexHull(colrow).volume])
        return np.append(areas / np.prod(size), inside / whole)

    def rays(self) -> Statements:
        rays, kind = self.bundle.network.block.rays, self.kinds
        place = (QUALITY, "Point Measurements")
        # their ray count of OP includes the check points
        groups = {"CP": kind == "CP", "CCP": kind == "CCP", "OP": kind != "CP"}
        out: Statements = {
            (*place, f"Number of {name} pts"): (int((kind == key).sum()),)
            for name, key in (("control", "CP"), ("check", "CCP"), ("object", "OP"))
        }
        for name, in_group in groups.items():
            counts, heading = rays[in_group], (*place, f"{name} ray count")
            if len(counts) == 0:
                out[heading] = "-"
                continue
            out[heading] = (int(counts.min()), int(counts.max()), float(counts.mean()))
            for count, points in zip(*np.unique(counts, return_counts=True), strict=True):
                out[(*heading, f"points with {count} rays")] = (int(points),)
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

    def angles(self) -> Statements:
        """Return the angles of rays that are nearest to 90 degrees, by kind of point.

        The report takes the photos of the object points with the smallest angles from the same row
        of the table of *all* points. If control points come first there, these are the photos of
        another point; we do the same.
        """
        network, place = self.bundle.network, (QUALITY, "Point Angles")
        points = network.image_points
        down = self.bundle.state.x_m[points.point_idx] - self.bundle.T_m_c.r[points.image_idx]
        rays = down / np.linalg.norm(down, axis=1, keepdims=True)
        angle = np.zeros(network.n_points)
        for point in range(network.n_points):
            of_point = rays[points.point_idx == point]
            angle[point] = np.degrees(np.arccos(min(np.abs(of_point @ of_point.T).min(), 1.0)))
        out: Statements = {}
        for name in ("CP", "CCP", "OP"):
            rows = np.flatnonzero(self.kinds == name)
            if len(rows) == 0:
                out |= {(*place, name, label): "-" for label in ("Minimum", "Maximum", "Average")}
                continue
            low, high = rows[angle[rows].argmin()], rows[angle[rows].argmax()]
            out[(*place, name, "Minimum")] = (float(angle[low]), int(self.numbers[low]))
            out[(*place, name, "Maximum")] = (float(angle[high]), int(self.numbers[high]))
            out[(*place, name, "Average")] = (float(angle[rows].mean()),)
        order = np.argsort(angle[rows], kind="stable")
        limit = min(1.1 * angle[rows][order[2]] + 0.1, 80.0)
        table = (*place, "OP", "Smallest angles (ID, angle [deg], vis in cameras)")
        for row in order[: max(int(np.sum(angle[rows] < limit)), 3)]:
            photos = np.sort(points.image_idx[points.point_idx == row]) + 1
            where = (*table, str(self.numbers[rows[row]]))
            out[where] = (float(angle[rows[row]]), *map(int, photos))
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
