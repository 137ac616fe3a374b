"""Statements of DBAT's report, from our adjustment: status, camera and orientation."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from scipy import stats

from acx4book.reference.dbat import files, printed
from acx4book.reference.dbat.blocks import Project
from acx4book.reference.dbat.comparison import Angle, Statements, say
from acx4book.reference.dbat.printed import Line
from acx4lib.expected import Array
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


def statements(project: Project) -> Statements:
    """Return our statements on status, camera and exterior orientation."""
    return {
        **_status(project),
        **_camera(project),
        **_exterior(project),
    }


# --- covariances -----------------------------------------------------------------------------


def interior(project: Project) -> tuple[Array, Array]:
    """Return DBAT's nine interior values and their a posteriori covariance."""
    adjusted = project.bundle
    columns = adjusted.network.layout.interior[0]
    padded = np.pad(adjusted.solution.cov, (0, 1))  # the column of a held parameter is -1
    cov = padded[np.ix_(columns, columns)]
    return files.interior_to_dbat(adjusted.cameras[0], cov * adjusted.solution.sigma0_sq)


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


def correlations(cov: Array) -> Array:
    """Return the correlations below the diagonal of a covariance; zero for a variance of zero."""
    sigma = np.sqrt(np.diag(cov))
    sigma = np.where(sigma > 0, sigma, np.inf)
    return np.asarray(np.tril(cov / sigma / sigma[:, None], -1))


def _high(cov: Array, names: tuple[str, ...]) -> dict[str, list[tuple[str, float]]]:
    """Return for every parameter the others with high correlations, and these in percent."""
    lower = correlations(cov)
    found: dict[str, list[tuple[str, float]]] = {}
    for i, j in np.argwhere(np.abs(lower) > HIGH):
        found.setdefault(names[i], []).append((names[j], 100 * lower[i, j]))
        found.setdefault(names[j], []).append((names[i], 100 * lower[i, j]))
    return found


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
    high_interior = bool(_high(interior(project)[1], files.INTERIOR_NAMES))
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
    for is_high, what in ((high_interior, "camera"), (high_exterior, "camera station")):
        if is_high:
            parameter = "parameter has" if what == "camera" else "parameters has"
            text = f"One or more of the {what} {parameter} a high correlation (see below)."
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


def lens_model(lines: Mapping[tuple[str, ...], Line]) -> str:
    """Return the lens model that a report names, as it stands there.

    Raises
    ------
    ValueError
        Where the library has no such lens.
    """
    named = [place[-1] for place in lines if place[:-1] == (LAST, "Lens distortion models")]
    found = BACKWARD.fullmatch(named[0]) if len(named) == 1 else None
    aspect = [float(line.numbers[0]) for place, line in lines.items() if place[-2:] == ASPECT]
    known = (*ALIKE, *(() if any(aspect) else WITHOUT_ASPECT))
    if found is None or found[1] not in known:
        msg = (
            f"lens distortion model {', '.join(named) or 'not named'}: expected a backward model, "
            f"{', '.join(ALIKE)}, or {WITHOUT_ASPECT[0]} where as is zero"
        )
        raise ValueError(msg)
    return named[0]


def _camera(project: Project) -> Statements:
    values, cov = interior(project)
    model = lens_model(printed.read(project.report))
    camera = (LAST, "Cameras", "Camera1 (simple)")
    names = " ".join(files.INTERIOR_NAMES)
    out: Statements = {
        (LAST, "Lens distortion models", model): say(""),
        (LAST, "Cameras", "Calibration"): say(f"yes ({names})" if project.free else "no"),
        (*camera, "Lens distortion model", model): say(""),
        (*camera, "sk - skew", "Value"): say("{}", 0.0),
    }
    high = _high(cov, files.INTERIOR_NAMES)
    for k, name in enumerate(files.INTERIOR_NAMES):
        heading, unit = HEADINGS[name]
        path = (*camera, heading)
        out[(*path, "Value")] = say("{}" + unit, values[k])
        if cov[k, k] > 0:
            out[(*path, "Deviation")] = say("{}" + unit, float(np.sqrt(cov[k, k])))
        _with_correlations(out, path, high.get(name, []))
    return {**out, **_significance(values, cov, camera), **_sensor(project, camera)}


def _significance(values: Array, cov: Array, camera: tuple[str, ...]) -> Statements:
    """Return the chi-square probabilities that a coefficient is not zero."""
    out: Statements = {}
    for name in ("K1", "K2", "K3", "as"):
        k = files.INTERIOR_NAMES.index(name)
        if cov[k, k] > 0:
            p = float(stats.chi2.cdf(values[k] ** 2 / cov[k, k], 1))
            out[(*camera, HEADINGS[name][0], "Significance")] = say("p={}", p)
            if name != "as":
                out[(*camera, HEADINGS[name][0], "Cumulative significance")] = say("p={}", p)
    both = [files.INTERIOR_NAMES.index(name) for name in ("P1", "P2")]
    if np.all(np.diag(cov)[both] > 0):
        tangential = values[both]
        statistic = tangential @ np.linalg.solve(cov[np.ix_(both, both)], tangential)
        p = float(stats.chi2.cdf(statistic, 2))
        out[(*camera, HEADINGS["P1"][0], "Significance")] = say("p={}", p)
    return out


def _sensor(project: Project, path: tuple[str, ...]) -> Statements:
    camera = project.bundle.cameras[0]
    size_mm = files.sensor_size_mm(camera)
    size_px = np.array([camera.width_px, camera.height_px])
    rated_mm = camera.pixel_mm * size_px
    diagonal_mm = float(np.hypot(*rated_mm))
    view = 2 * np.degrees(np.arctan(np.append(rated_mm, diagonal_mm) / 2 / camera.interior.f))
    distortion_mm = files.largest_distortion_mm(camera)
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
