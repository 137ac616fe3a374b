"""Statements of DBAT's report, from our adjustment: status, camera and orientation."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import pandas as pd
from scipy import stats
from scipy.spatial import ConvexHull

from acx4book.reference import dbat_files
from acx4book.reference.dbat_files import Angle, Line, Project, Statements, say
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import reduced, xy_from_colrow
from acx4lib.geometry.frames import opk_jacobian

HIGH = 0.95
"""Correlation above which the report lists a pair."""

LAST = "Information from last bundle"
EXTERIOR = ("Xc", "Yc", "Zc", "Omega", "Phi", "Kappa")

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


def is_result(path: tuple[str, ...]) -> bool:
    """Tell whether a line of a report states a result."""
    return not any(path[: len(prefix)] == prefix for prefix in _NO_RESULT)


# --- covariances -----------------------------------------------------------------------------


def _interior(project: Project) -> tuple[Array, Array]:
    """Return DBAT's nine interior values and their a posteriori covariance."""
    adjusted = project.bundle
    columns = adjusted.network.layout.interior[0]
    padded = np.pad(adjusted.solution.cov, (0, 1))  # the column of a held parameter is -1
    cov = padded[np.ix_(columns, columns)]
    return dbat_files.interior_to_dbat(adjusted.cameras[0], cov * adjusted.solution.sigma0_sq)


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


def _high(cov: Array, names: tuple[str, ...]) -> dict[str, list[tuple[str, float]]]:
    """Return for every parameter the others with high correlations to it, in percent."""
    lower = _correlations(cov)
    high: dict[str, list[tuple[str, float]]] = {}
    for i, j in np.argwhere(np.abs(lower) > HIGH):
        high.setdefault(names[i], []).append((names[j], 100 * lower[i, j]))
        high.setdefault(names[j], []).append((names[i], 100 * lower[i, j]))
    return high


def _with_correlations(
    out: Statements, path: tuple[str, ...], partners: list[tuple[str, float]]
) -> None:
    if partners:
        text = ", ".join(f"{name}:{{}}%" for name, _ in partners) + "."
        out[(*path, "Correlations over 95%")] = say(text, *(value for _, value in partners))


# --- sections --------------------------------------------------------------------------------


def _status(project: Project) -> Statements:
    solution, network = project.bundle.solution, project.bundle.network
    n_interior, n_images = len(project.free), len(network.block.images)
    sigma0 = float(np.sqrt(solution.sigma0_sq))
    n_image = int(2 * len(network.image_points))
    n_points = 3 * int(network.free_points.sum())
    problems = ("Problems and suggestions",)
    is_open = bool(solution.undetermined.any())
    high_interior = bool(_high(_interior(project)[1], dbat_files.INTERIOR_NAMES))
    high_exterior = any(_high(cov, EXTERIOR) for cov in exterior(project)[1])
    related = (*problems, "Problems related to the processing")
    out: Statements = {
        (*problems, "Project Problems", "Structural rank"): say("ok."),
        (*problems, "Project Problems", "Numerical rank"): say("deficient" if is_open else "ok."),
        related: say("({})", int(high_interior) + int(high_exterior)),
        (LAST, "Status"): say("OK"),
        (LAST, "Sigma0"): say("{}", sigma0),
        (LAST, "Sigma0 (pixels)"): say("{}", sigma0 * float(network.image_points.sigma_px.min())),
        (LAST, "Redundancy"): say("{}", solution.redundancy),
        (LAST, "Number of params"): say(
            "{} ({} IO, {} EO, {} OP)", solution.n_unknowns, n_interior, 6 * n_images, n_points
        ),
        (LAST, "Number of observations"): say(
            "{} ({} IP, {} IO, {} EO, {} OP)",
            solution.n_observations,
            n_image,
            0,
            0,
            solution.n_observations - n_image,
        ),
        (LAST, "Total error", "Last error"): say("{}", float(np.sqrt(solution.cost))),
    }
    for is_high, subject in ((high_interior, "camera"), (high_exterior, "camera station")):
        if is_high:
            parameter = "parameter has" if subject == "camera" else "parameters has"
            text = f"One or more of the {subject} {parameter} a high correlation (see below)."
            out[(*related, text)] = say("")
    return out


HEADINGS = {
    "cc": ("Camera Constant", " mm"),
    "px": ("px - principal point x", " mm"),
    "py": ("py - principal point y", " mm"),
    "K1": ("K1 - radial distortion 1", " mm^(-3)"),
    "K2": ("K2 - radial distortion 2", " mm^(-5)"),
    "K3": ("K3 - radial distortion 3", " mm^(-7)"),
    "P1": ("P1 - decentering distortion 1", " mm^(-3)"),
    "P2": ("P2 - decentering distortion 2", " mm^(-3)"),
    "as": ("as - off-unit aspect parameter", ""),
}
"""Heading and unit of every interior parameter."""

ASPECT = (HEADINGS["as"][0], "Value")
BACKWARD = re.compile(r"Backward \(Photogrammetry\) model (\d)")
ALIKE, WITHOUT_ASPECT = ("1", "2", "3", "5"), ("4",)
"""Backward models of DBAT that are ours: 1 and 2 have no aspect, 3 and 5 scale x before the lens,
and skew, which is held at zero, after it. Model 4 scales after the lens: ours without an aspect."""


def _camera(project: Project) -> Statements:
    values, cov = _interior(project)
    model = _lens_model(dbat_files.read(project.report))
    camera = (LAST, "Cameras", "Camera1 (simple)")
    names = " ".join(dbat_files.INTERIOR_NAMES)
    out: Statements = {
        (LAST, "Lens distortion models", model): say(""),
        (LAST, "Cameras", "Calibration"): say(f"yes ({names})" if project.free else "no"),
        (*camera, "Lens distortion model", model): say(""),
        (*camera, "sk - skew", "Value"): say("{}", 0.0),
    }
    high = _high(cov, dbat_files.INTERIOR_NAMES)
    for k, name in enumerate(dbat_files.INTERIOR_NAMES):
        heading, unit = HEADINGS[name]
        path = (*camera, heading)
        out[(*path, "Value")] = say("{}" + unit, values[k])
        if cov[k, k] > 0:
            out[(*path, "Deviation")] = say("{}" + unit, float(np.sqrt(cov[k, k])))
        _with_correlations(out, path, high.get(name, []))
    return {**out, **_significance(values, cov, camera), **_sensor(project, camera)}


def _lens_model(lines: Mapping[tuple[str, ...], Line]) -> str:
    """Return the name of a report's lens model, word for word."""
    named = [place[-1] for place in lines if place[:-1] == (LAST, "Lens distortion models")]
    match = BACKWARD.fullmatch(named[0]) if len(named) == 1 else None
    aspect = [float(line.numbers[0]) for place, line in lines.items() if place[-2:] == ASPECT]
    known = (*ALIKE, *(() if any(aspect) else WITHOUT_ASPECT))
    if match is None or match[1] not in known:
        msg = (
            f"lens distortion model {', '.join(named) or 'not named'}: expected a backward model, "
            f"{', '.join(ALIKE)}, or {WITHOUT_ASPECT[0]} where as is zero"
        )
        raise ValueError(msg)
    return named[0]


def _significance(values: Array, cov: Array, camera: tuple[str, ...]) -> Statements:
    """Return the chi-square probabilities that a coefficient is not zero."""
    out: Statements = {}
    for name in ("K1", "K2", "K3", "as"):
        k = dbat_files.INTERIOR_NAMES.index(name)
        if cov[k, k] > 0:
            p = float(stats.chi2.cdf(values[k] ** 2 / cov[k, k], 1))
            out[(*camera, HEADINGS[name][0], "Significance")] = say("p={}", p)
            if name != "as":
                out[(*camera, HEADINGS[name][0], "Cumulative significance")] = say("p={}", p)
    columns = [dbat_files.INTERIOR_NAMES.index(name) for name in ("P1", "P2")]
    if np.all(np.diag(cov)[columns] > 0):
        tangential = values[columns]
        statistic = tangential @ np.linalg.solve(cov[np.ix_(columns, columns)], tangential)
        p = float(stats.chi2.cdf(statistic, 2))
        out[(*camera, HEADINGS["P1"][0], "Significance")] = say("p={}", p)
    return out


def _sensor(project: Project, path: tuple[str, ...]) -> Statements:
    camera = project.bundle.cameras[0]
    size_px = np.array([camera.width_px, camera.height_px])
    rated_mm = camera.pixel_mm * size_px
    size_mm = rated_mm * np.array([1 + camera.interior.b1, 1.0])
    diagonal_mm = float(np.hypot(*rated_mm))
    view = 2 * np.degrees(np.arctan(np.append(rated_mm, diagonal_mm) / 2 / camera.interior.f))
    distortion_mm = _largest_distortion_mm(project)
    out: Statements = {}
    for k, (side, axis) in enumerate((("width", "X"), ("height", "Y"))):
        out[(*path, f"Format {side}", "Value")] = say("{} mm", size_mm[k])
        out[(*path, f"Image {side}", "Value")] = say("{} px", int(size_px[k]))
        out[(*path, f"{axis} resolution", "Value")] = say("{} px/mm", size_px[k] / size_mm[k])
        out[(*path, f"Pixel {side}", "Value")] = say("{} mm", size_mm[k] / size_px[k])
    out[(*path[:-1], "Rated angle of view (h,v,d)")] = say("({}, {}, {}) deg", *view)
    out[(*path[:-1], "Largest distortion")] = say(
        "{} mm ({} px, {}% of half-diagonal)",
        distortion_mm,
        distortion_mm / camera.pixel_mm,
        200 * distortion_mm / diagonal_mm,
    )
    return out


def _largest_distortion_mm(project: Project) -> float:
    """Return the largest distortion in the corners of the image by DBAT's formula, mm."""
    # with square pixels, with |dx| + |dy|, and with P1 and P2 exchanged in dx and in dy
    camera, (values, _) = project.bundle.cameras[0], _interior(project)
    _, px, py, _, k1, k2, k3, p1, p2 = values
    size = camera.pixel_mm * np.array([camera.width_px, camera.height_px])
    corners = 0.5 * camera.pixel_mm + size * np.array([[0, 0], [0, 1], [1, 1], [1, 0]])
    x, y = corners[:, 0] - px, corners[:, 1] - py
    r2 = x * x + y * y
    radial = r2 * (k1 + r2 * (k2 + r2 * k3))
    dx = x * radial + p1 * (r2 + 2 * x * x) + 2 * p1 * x * y
    dy = y * radial + p2 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return float(np.max(np.abs(dx) + np.abs(dy)))


def _exterior(project: Project) -> Statements:
    values, cov = exterior(project)
    photos = (LAST, "Precisions / Standard Deviations", "Photograph Standard Deviations")
    out: Statements = {}
    for photo, name in enumerate(project.bundle.network.block.images.names):
        path = (*photos, f"Photo {photo + 1}")
        out[path] = say(name)
        high = _high(cov[photo], EXTERIOR)
        for k, parameter in enumerate(EXTERIOR):
            unit = " ou" if k < 3 else " deg"
            value = values[photo, k] if k < 3 else Angle(values[photo, k])
            sigma = float(np.sqrt(cov[photo, k, k]))
            out[(*path, parameter, "Value")] = say("{}" + unit, value)
            out[(*path, parameter, "Deviation")] = say("{}" + unit, sigma)
            _with_correlations(out, (*path, parameter), high.get(parameter, []))
    return out


# --- Quality in DBAT's report, from our adjustment: coverage, residuals, points


QUALITY = "Quality"


def _misfit_statements(project: Project) -> Statements:
    """Return our statements on photographs, measurements, residuals, precision and angles."""
    return {
        **_photographs(project),
        **_ray_counts(project),
        **_residuals(project),
        **_precision(project),
        **_angles(project),
    }


def _numbers(project: Project) -> Index:
    """Return the numbers of the block's points in DBAT."""
    return np.array([int(name) for name in project.bundle.network.block.points])


def _kinds(project: Project) -> Array:
    """Return CP, CCP or OP for control, check and other points, shape (n_points,)."""
    block = project.bundle.network.block
    kind = np.full(len(block.points), "OP", dtype="<U3")
    kind[block.control.point_idx] = "CP"
    kind[block.check.point_idx] = "CCP"
    return kind


# --- photographs -----------------------------------------------------------------------------


def _photographs(project: Project) -> Statements:
    block = project.bundle.network.block
    n = len(block.images)
    camera = (QUALITY, "Cameras", "Camera1")
    outside = (QUALITY, "Photo Coverage", "Reference points outside calibrated region")
    out: Statements = {
        (QUALITY, "Photographs", "Total number"): say("{}", n),
        (QUALITY, "Photographs", "Numbers used"): say("{}", int(project.bundle.oriented.sum())),
        (QUALITY, "Cameras", "Total number"): say("{} ({} simple, {} mixed)", 1, 1, 0),
        (*camera, "Calibration"): say("yes" if project.free else "<not available>"),
        (*camera, "Number of photos using camera"): say("{}", n),
        (*outside, "Camera 1"): say("none" if project.free else "<not available>"),
    }
    every = [_coverage(project, np.array([image])) for image in range(n)]
    union = _coverage(project, np.arange(n))
    for k, name in enumerate(("Rectangular", "Convex hull", "Radial")):
        share = np.array([coverage[k] for coverage in every])
        values = (share.min(), share.max(), share.mean(), union[k])
        out[(*camera, "Photo point coverage", name)] = say(
            "{}%-{}% ({}% average, {}% union)", *(100 * value for value in values)
        )
    return out


def _coverage(project: Project, images: Index) -> Array:
    """Return the shares of the image that its points cover: rectangle, convex hull, radius."""
    block, camera = project.bundle.network.block, project.bundle.cameras[0]
    points = block.image_points
    colrow = points.colrow[np.isin(points.image_idx, images)]
    area = camera.width_px * camera.height_px
    size = np.array([camera.width_px, camera.height_px])
    corners = size * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])

    def largest_radius(pixels: Array) -> float:
        bar = reduced(camera.interior, xy_from_colrow(camera, pixels))
        return float(np.hypot(*bar.T).max())

    return np.array(
        [
            np.prod(np.ptp(colrow, axis=0)) / area,
            ConvexHull(colrow).volume / area,
            largest_radius(colrow) / largest_radius(corners),
        ]
    )


def _ray_counts(project: Project) -> Statements:
    rays, kind = project.bundle.network.block.rays, _kinds(project)
    path = (QUALITY, "Point Measurements")
    groups = {"CP": kind == "CP", "CCP": kind == "CCP", "OP": kind != "CP"}
    out: Statements = {
        (*path, "Number of control pts"): say("{}", int((kind == "CP").sum())),
        (*path, "Number of check pts"): say("{}", int((kind == "CCP").sum())),
        (*path, "Number of object pts"): say("{}", int((kind == "OP").sum())),
    }
    for name, in_group in groups.items():  # their OP count includes the check points
        place = (*path, f"{name} ray count")
        if not in_group.any():
            out[place] = say("-")
            continue
        counts = rays[in_group]
        out[place] = say("{}-{} ({} avg)", int(counts.min()), int(counts.max()), counts.mean())
        for count, points in zip(*np.unique(counts, return_counts=True), strict=True):
            out[(*place, f"points with {count} rays")] = say("{}", int(points))
    return out


# --- residuals and precision -----------------------------------------------------------------


def _residuals(project: Project) -> Statements:
    points = project.bundle.network.image_points
    squared = np.sum(project.bundle.solution.group("image_point").v ** 2, axis=1)
    number = _numbers(project)
    path = (QUALITY, "Point Marking Residuals")
    worst = int(squared.argmax())
    out: Statements = {
        (*path, "Overall point RMS"): say("{} pixels", float(np.sqrt(squared.mean()))),
        (*path, "Mark point residuals", "Maximum"): say(
            "{} pixels (OP {} on photo {})",
            float(np.sqrt(squared[worst])),
            int(number[points.point_idx[worst]]),
            int(points.image_idx[worst]) + 1,
        ),
    }
    groups = (
        ("Object point residuals (RMS over all images of a point)", points.point_idx, number),
        (
            "Photo residuals (RMS over all points in an image)",
            points.image_idx,
            np.arange(1, len(project.bundle.network.block.images) + 1),
        ),
    )
    texts = ("{} pixels (OP {} over {} images)", "{} pixels (photo {} over {} points)")
    for (heading, idx, name), text in zip(groups, texts, strict=True):
        count = np.bincount(idx)
        rms = np.sqrt(np.bincount(idx, squared) / count)
        for label, row in (("Minimum", int(rms.argmin())), ("Maximum", int(rms.argmax()))):
            out[(*path, heading, label)] = say(text, rms[row], int(name[row]), int(count[row]))
    return out


def _point_covariances(project: Project) -> Array:
    """Return the a posteriori covariances of all points, shape (n_points, 3, 3)."""
    return project.bundle.solution.cov_points * project.bundle.solution.sigma0_sq


def _precision(project: Project) -> Statements:
    number, cov = _numbers(project), _point_covariances(project)
    sigma = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    sigma[~project.bundle.network.free_points] = np.nan
    total = np.sqrt(np.sum(sigma**2, axis=1))
    path = (QUALITY, "Point Precision")
    heading = "Total standard deviation (RMS of X/Y/Z std)"
    out: Statements = {}
    for label, row in (("Minimum", np.nanargmin(total)), ("Maximum", np.nanargmax(total))):
        out[(*path, heading, label)] = say("{} (OP {})", total[row], int(number[row]))
    for k, axis in enumerate("XYZ"):
        row = np.nanargmax(sigma[:, k])
        label = f"Maximum {axis} standard deviation"
        out[(*path, label)] = say("{} (OP {})", sigma[row, k], int(number[row]))
    lower = np.array([_correlations(cov_point) for cov_point in cov])
    for percent in (95, 99):
        label = f"Points with correlation above {percent}%"
        above = int(np.sum(np.abs(lower) > percent / 100))
        out[(*path, "Points with high correlations", label)] = say("{}", above)
    return out


# --- angles ----------------------------------------------------------------------------------


def _angles(project: Project) -> Statements:
    angle, number, kind = _nearest_to_right_angle(project), _numbers(project), _kinds(project)
    surveyed = project.surveyed
    labels = {
        int(point): f", label {label}"
        for point, label in zip(surveyed.point, surveyed.labels, strict=True)
    }
    out: Statements = {}
    for name in ("CP", "CCP", "OP"):
        path = (QUALITY, "Point Angles", name)
        points = np.flatnonzero(kind == name)
        if len(points) == 0:
            out |= {(*path, label): say("-") for label in ("Minimum", "Maximum", "Average")}
            continue
        for label, position in (
            ("Minimum", angle[points].argmin()),
            ("Maximum", angle[points].argmax()),
        ):
            point = points[position]
            text = f"{{}} degrees ({name} {{}}{labels.get(int(number[point]), '')})"
            out[(*path, label)] = say(text, angle[point], int(number[point]))
        out[(*path, "Average")] = say("{} degrees", float(angle[points].mean()))
    return {**out, **_smallest_angles(project, angle, number)}


def _nearest_to_right_angle(project: Project) -> Array:
    """Return for every point the angle of two rays that is nearest to 90 degrees, deg."""
    network = project.bundle.network
    points = network.image_points
    x_m, poses = project.bundle.state.x_m, project.bundle.T_m_c
    down = x_m[points.point_idx] - poses.r[points.image_idx]
    rays = down / np.linalg.norm(down, axis=1, keepdims=True)
    out = np.zeros(network.n_points)
    for point in range(network.n_points):
        rays_of_point = rays[points.point_idx == point]
        out[point] = np.degrees(np.arccos(min(np.abs(rays_of_point @ rays_of_point.T).min(), 1.0)))
    return out


def _smallest_angles(project: Project, angle: Array, number: Index) -> Statements:
    """Return the object points with the smallest angles, chosen as in the report.

    The report takes their photos from the same row of the table of *all* points. If control
    points come first there, these are the photos of another point; we do the same.
    """
    path = (QUALITY, "Point Angles", "OP", "Smallest angles (ID, angle [deg], vis in cameras)")
    points = project.bundle.network.image_points
    object_points = np.flatnonzero(_kinds(project) == "OP")
    order = np.argsort(angle[object_points], kind="stable")
    limit = min(1.1 * angle[object_points][order[2]] + 0.1, 80.0)
    n = max(int(np.sum(angle[object_points] < limit)), 3)
    out: Statements = {}
    for row in order[:n]:
        photos = np.sort(points.image_idx[points.point_idx == row]) + 1
        text = "{} (" + " ".join(["{}"] * len(photos)) + ")"
        values = (float(angle[object_points[row]]), *map(int, photos))
        out[(*path, str(number[object_points[row]]))] = say(text, *values)
    return out


# --- Control and check points in DBAT's report, from our adjustment


EPS = np.finfo(float).eps
"""Term that keeps the relative change of sigma finite for a point without error."""


def _statements(project: Project) -> Statements:
    """Return our statements on control points and check points."""
    return {
        **_table(project, "Ctrl", np.flatnonzero(~project.is_check)),
        **_table(project, "Check", np.flatnonzero(project.is_check)),
    }


def _table(project: Project, name: str, rows: Index) -> Statements:
    path = (QUALITY, f"{name} measurements")
    if len(rows) == 0:
        return {(*path, "none"): say("")}
    surveyed = project.surveyed
    point_idx = np.searchsorted(_numbers(project), surveyed.point)
    x = project.bundle.state.x_m[point_idx] + project.origin
    sigma = np.sqrt(np.diagonal(_point_covariances(project)[point_idx], axis1=1, axis2=2))
    rays = project.bundle.network.block.rays[point_idx]
    d = x - surveyed.x
    change = 100 * ((sigma + EPS) / (surveyed.sigma + EPS) - 1)
    out: Statements = {}
    for row in rows:
        point, label, n = str(surveyed.point[row]), surveyed.labels[row], int(rays[row])
        shift = (*d[row], np.hypot(*d[row, :2]), np.linalg.norm(d[row]))
        out[(*path, "Prior", point)] = say(
            f"{{}}, {{}}, {{}}, {{}}, {{}}, {{}}, {label}", *surveyed.x[row], *surveyed.sigma[row]
        )
        out[(*path, "Posterior", point)] = say(
            f"{{}}, {{}}, {{}}, {{}}, {{}}, {{}}, {{}}, {label}", *x[row], *sigma[row], n
        )
        out[(*path, "Diff (pos=abs diff, std=rel diff)", point)] = say(
            f"{{}}, {{}}, {{}}, {{}}, {{}}, {{}}%, {{}}%, {{}}%, {{}}, {label}",
            *shift,
            *change[row],
            n,
        )
    return {**out, **_largest(project, (*path, f"{name} point delta"), rows, d)}


def _largest(project: Project, path: tuple[str, ...], rows: Index, d: Array) -> Statements:
    surveyed = project.surveyed
    length = np.linalg.norm(d, axis=1)[rows]

    def which(position: int) -> tuple[str, int]:
        row = rows[position]
        return f"{{}} ou ({surveyed.labels[row]}, pt {{}})", int(surveyed.point[row])

    text, point = which(int(length.argmax()))
    rms = float(np.sqrt(np.mean(length**2)))
    out: Statements = {
        (*path, "Max"): say(text, length.max(), point),
        (*path, "RMS"): say("{} ou (from {} items)", rms, len(rows)),
    }
    for k, axis in enumerate("XYZ"):
        component = np.abs(d[rows, k])
        text, point = which(int(component.argmax()))
        out[(*path, "Max X,Y,Z", axis)] = say(text, component.max(), point)
    return out


# --- The comparison of DBAT's reports with our adjustments, line by line


def results(project: Project) -> pd.DataFrame:
    """Return every number and statement of a report's results with ours.

    Returns
    -------
    DataFrame
        As `dbat_files.compare` returns it.

    Raises
    ------
    ValueError
        Where the library has no such lens as the report names.
    """
    lines = dbat_files.read(project.report)
    printed = {place: line for place, line in lines.items() if is_result(place)}
    ours = {
        **_status(project),
        **_camera(project),
        **_exterior(project),
        **_misfit_statements(project),
        **_statements(project),
    }
    return dbat_files.compare(printed, ours)
