"""Quality in DBAT's report, from our adjustment: coverage, residuals, points."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from acx4book.reference.dbat.blocks import Project
from acx4book.reference.dbat.comparison import Statements, say
from acx4book.reference.dbat.statements import correlations
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import reduced, xy_from_colrow

QUALITY = "Quality"


def statements(project: Project) -> Statements:
    """Return our statements on photographs, measurements, residuals, precision and angles."""
    return {
        **_photographs(project),
        **_ray_counts(project),
        **_residuals(project),
        **_precision(project),
        **_angles(project),
    }


def numbers(project: Project) -> Index:
    """Return the numbers of the block's points in DBAT."""
    return np.array([int(name) for name in project.bundle.network.block.points])


def kinds(project: Project) -> Array:
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
    rays, kind = project.bundle.network.block.rays, kinds(project)
    path = (QUALITY, "Point Measurements")
    groups = {"CP": kind == "CP", "CCP": kind == "CCP", "OP": kind != "CP"}
    out: Statements = {
        (*path, "Number of control pts"): say("{}", int((kind == "CP").sum())),
        (*path, "Number of check pts"): say("{}", int((kind == "CCP").sum())),
        (*path, "Number of object pts"): say("{}", int((kind == "OP").sum())),
    }
    for name, own in groups.items():  # their OP count includes the check points
        place = (*path, f"{name} ray count")
        if not own.any():
            out[place] = say("-")
            continue
        counts = rays[own]
        out[place] = say("{}-{} ({} avg)", int(counts.min()), int(counts.max()), counts.mean())
        for count, points in zip(*np.unique(counts, return_counts=True), strict=True):
            out[(*place, f"points with {count} rays")] = say("{}", int(points))
    return out


# --- residuals and precision -----------------------------------------------------------------


def _residuals(project: Project) -> Statements:
    points = project.bundle.network.image_points
    squared = np.sum(project.bundle.solution.group("image_point").v ** 2, axis=1)
    number = numbers(project)
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
        for label, at in (("Minimum", int(rms.argmin())), ("Maximum", int(rms.argmax()))):
            out[(*path, heading, label)] = say(text, rms[at], int(name[at]), int(count[at]))
    return out


def point_covariances(project: Project) -> Array:
    """Return the a posteriori covariances of all points, shape (n_points, 3, 3)."""
    return project.bundle.solution.cov_points * project.bundle.solution.sigma0_sq


def _precision(project: Project) -> Statements:
    number, cov = numbers(project), point_covariances(project)
    sigma = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    sigma[~project.bundle.network.free_points] = np.nan
    total = np.sqrt(np.sum(sigma**2, axis=1))
    path = (QUALITY, "Point Precision")
    heading = "Total standard deviation (RMS of X/Y/Z std)"
    out: Statements = {}
    for label, at in (("Minimum", np.nanargmin(total)), ("Maximum", np.nanargmax(total))):
        out[(*path, heading, label)] = say("{} (OP {})", total[at], int(number[at]))
    for k, axis in enumerate("XYZ"):
        at = np.nanargmax(sigma[:, k])
        label = f"Maximum {axis} standard deviation"
        out[(*path, label)] = say("{} (OP {})", sigma[at, k], int(number[at]))
    lower = np.array([correlations(own) for own in cov])
    for percent in (95, 99):
        label = f"Points with correlation above {percent}%"
        above = int(np.sum(np.abs(lower) > percent / 100))
        out[(*path, "Points with high correlations", label)] = say("{}", above)
    return out


# --- angles ----------------------------------------------------------------------------------


def angles(project: Project) -> Array:
    """Return for every point the angle of two of its rays that is nearest to 90 degrees, deg."""
    network = project.bundle.network
    points = network.image_points
    x_m, poses = project.bundle.state.x_m, project.bundle.T_m_c
    down = x_m[points.point_idx] - poses.r[points.image_idx]
    rays = down / np.linalg.norm(down, axis=1, keepdims=True)
    out = np.zeros(network.n_points)
    for point in range(network.n_points):
        own = rays[points.point_idx == point]
        out[point] = np.degrees(np.arccos(min(np.abs(own @ own.T).min(), 1.0)))
    return out


def _angles(project: Project) -> Statements:
    angle, number, kind = angles(project), numbers(project), kinds(project)
    surveyed = project.surveyed
    labels = {
        int(point): f", label {label}"
        for point, label in zip(surveyed.point, surveyed.labels, strict=True)
    }
    out: Statements = {}
    for name in ("CP", "CCP", "OP"):
        path = (QUALITY, "Point Angles", name)
        own = np.flatnonzero(kind == name)
        if len(own) == 0:
            out |= {(*path, label): say("-") for label in ("Minimum", "Maximum", "Average")}
            continue
        for label, at in (("Minimum", angle[own].argmin()), ("Maximum", angle[own].argmax())):
            point = own[at]
            text = f"{{}} degrees ({name} {{}}{labels.get(int(number[point]), '')})"
            out[(*path, label)] = say(text, angle[point], int(number[point]))
        out[(*path, "Average")] = say("{} degrees", float(angle[own].mean()))
    return {**out, **_smallest_angles(project, angle, number)}


def _smallest_angles(project: Project, angle: Array, number: Index) -> Statements:
    """Return the object points with the smallest angles, chosen as in the report.

    The report takes their photos from the same row of the table of *all* points. If control
    points come first there, these are the photos of another point; we do the same.
    """
    path = (QUALITY, "Point Angles", "OP", "Smallest angles (ID, angle [deg], vis in cameras)")
    points = project.bundle.network.image_points
    own = np.flatnonzero(kinds(project) == "OP")
    order = np.argsort(angle[own], kind="stable")
    limit = min(1.1 * angle[own][order[2]] + 0.1, 80.0)
    n = max(int(np.sum(angle[own] < limit)), 3)
    out: Statements = {}
    for row in order[:n]:
        photos = np.sort(points.image_idx[points.point_idx == row]) + 1
        text = "{} (" + " ".join(["{}"] * len(photos)) + ")"
        values = (float(angle[own[row]]), *map(int, photos))
        out[(*path, str(number[own[row]]))] = say(text, *values)
    return out
