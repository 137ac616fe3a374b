"""Rows of a results folder, made from the results of the stages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from acx4files.results.folder import COLUMNS, COMPONENTS, RELATIVE
from acx4lib.block import Block
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.network import Network
from acx4lib.bundle.observations import observed_interiors, observed_mountings
from acx4lib.bundle.rejections import Rejection
from acx4lib.calibration import trajectory_errors
from acx4lib.calibration.estimates import (
    Calibration,
    Parameter,
    is_determined,
    parameters,
    reported_covariance,
)
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import INTERIOR
from acx4lib.geometry.frames import Pose, opk_jacobian
from acx4lib.geometry.parameters import REPORTED
from acx4lib.georeferencing.validation import compare
from acx4lib.least_squares.covariance import propagate, sigmas


def unit_of(kind: str, component: int = 0) -> float:
    """Return the factor of a residual component in results: radians to degrees, otherwise 1."""
    return float(np.degrees(1.0)) if COMPONENTS[kind][component].endswith("_deg") else 1.0


# --- bundles ---------------------------------------------------------------------------------


def bundle_tables(
    stage: str, method: str, bundle: Bundle, calibration: Calibration
) -> dict[str, pd.DataFrame]:
    """Return every table of an adjusted bundle.

    Parameters
    ----------
    stage, method : str
    bundle : Bundle
    calibration : Calibration
        The cameras calibrated by the method.
    """
    block = bundle.network.block
    parameter_tables = calibration_tables(stage, method, calibration)
    if trajectory_errors.parameters(bundle):
        parameter_tables = _with_gnss(stage, method, bundle, calibration)
    return {
        **parameter_tables,
        "exterior_orientation": of_method(stage, method, exterior_orientations(bundle)),
        "residuals": _residual_table(stage, method, bundle),
        "rejected": rejected_table(
            stage, method, block, bundle.rejected, pose_names=block.trajectory.exposures
        ),
        "check_points": _check_table(stage, method, bundle),
    }


def calibration_tables(
    stage: str, method: str, calibration: Calibration
) -> dict[str, pd.DataFrame]:
    """Return the tables of the determined parameters and of their covariance."""
    keep = np.flatnonzero(is_determined(calibration))
    everything = parameters(calibration)
    listed = [everything[i] for i in keep]
    cov = reported_covariance(calibration)[np.ix_(keep, keep)]
    return parameter_tables(stage, method, listed, cov)


def _with_gnss(
    stage: str, method: str, bundle: Bundle, calibration: Calibration
) -> dict[str, pd.DataFrame]:
    """Return the parameter tables extended by the estimated errors of the trajectory."""
    determined = np.concatenate(
        [is_determined(calibration), trajectory_errors.is_determined(bundle)]
    )
    everything = [*parameters(calibration), *trajectory_errors.parameters(bundle)]
    keep = np.flatnonzero(determined)
    cov = trajectory_errors.reported_covariance(bundle)
    if max(calibration.enlarged) > 1 or calibration.cov_before is not None:
        n = calibration.n_columns
        cov[:n, :n] = reported_covariance(calibration)
    cov = cov[np.ix_(keep, keep)]
    return parameter_tables(stage, method, [everything[i] for i in keep], cov)


def parameter_tables(
    stage: str, method: str, listed: Sequence[Parameter], cov: Array
) -> dict[str, pd.DataFrame]:
    """Return the table of parameters and the table of their covariance."""
    names = [p.full_name for p in listed]
    return {
        "parameters": _parameter_table(stage, method, listed),
        "covariance": _covariance_table(stage, method, names, cov),
    }


def _parameter_table(stage: str, method: str, listed: Sequence[Parameter]) -> pd.DataFrame:
    rows = [
        (stage, method, p.camera, p.name, p.value, p.sigma, p.unit, p.sigma_before) for p in listed
    ]
    return _frame("parameters", rows)


def of_method(stage: str, method: str, frame: pd.DataFrame) -> pd.DataFrame:
    """Put the stage and the method of all rows before the columns of a table."""
    return pd.DataFrame({"stage": stage, "method": method, **dict(frame.items())})


def _frame(table: str, rows: Sequence[Sequence[object]]) -> pd.DataFrame:
    return pd.DataFrame(list(rows), columns=list(COLUMNS[table]))


def _covariance_table(stage: str, method: str, names: Sequence[str], cov: Array) -> pd.DataFrame:
    n = len(names)
    return pd.DataFrame(
        {
            "stage": stage,
            "method": method,
            "row": np.repeat(np.array(names, dtype=object), n),
            "column": np.tile(np.array(names, dtype=object), n),
            "value": cov.ravel(),
        }
    )


def exterior_orientations(bundle: Bundle) -> pd.DataFrame:
    """Return the exterior orientations of an adjusted bundle's images, with their sigma.

    Returns
    -------
    DataFrame
        A row for every image that its measurements orient: ``image``, projection centre
        ``east_m, north_m, height_m``, angles ``omega_deg, phi_deg, kappa_deg`` of eq. (6) against
        the grid's axes, and the sigma of each, a posteriori. A mounted camera's have the sigma
        and the correlations of body pose and mounting, eq. (14).
    """
    network = bundle.network
    cov = bundle.camera_pose_covariances * bundle.solution.sigma0_sq
    oriented = np.flatnonzero(bundle.oriented)
    names = [network.block.images.names[i] for i in oriented]
    return exterior_table(network.block, names, T_m_c=bundle.T_m_c[oriented], cov=cov[oriented])


def exterior_table(block: Block, names: Sequence[str], *, T_m_c: Pose, cov: Array) -> pd.DataFrame:
    """Return camera poses relative to the grid, with their standard deviations.

    Parameters
    ----------
    block : Block
    names : sequence of str
        Names of the images.
    T_m_c : Pose
    cov : ndarray, shape (n, 6, 6)
        Position in m, mapping frame; rotation about the camera's axes, radians.
    """
    enh, opk = block.frame.pose_to_grid(T_m_c)
    R_g_m = block.frame.grid_axes(T_m_c.r)
    to_opk = opk_jacobian(opk)
    sigma_r = sigmas(propagate(R_g_m, cov[:, :3, :3]))
    sigma_opk = np.degrees(sigmas(propagate(to_opk, cov[:, 3:, 3:])))
    frame = pd.DataFrame(
        np.column_stack([enh, np.degrees(opk), sigma_r, sigma_opk]),
        columns=list(COLUMNS["exterior_orientation"][3:]),
    )
    frame.insert(0, "image", list(names))
    return frame


def _residual_table(stage: str, method: str, bundle: Bundle) -> pd.DataFrame:
    """Return the residuals of all used observations, with their names as categories."""
    groups = [group for group in bundle.solution.groups if group.kind in COMPONENTS]
    used = [group.used for group in groups]
    places, points, components, units = [], [], [], []
    for group, mask in zip(groups, used, strict=True):
        rows, columns = np.nonzero(mask)
        (images, image_idx), (names, point_idx) = _observed_at(bundle.network, group.kind)
        places.append((images, image_idx[rows]))
        points.append((names, point_idx[rows]))
        components.append((COMPONENTS[group.kind], columns))
        units.append(np.full(len(rows), unit_of(group.kind)))
    unit = np.concatenate(units)
    values = {
        name: np.concatenate([getattr(g, name)[mask] for g, mask in zip(groups, used, strict=True)])
        for name in ("v", "sigma", "redundancy", "w")
    }
    return pd.DataFrame(
        {
            "stage": _named([_alike(len(unit), stage)]),
            "method": _named([_alike(len(unit), method)]),
            "kind": _named([_alike(len(u), g.kind) for g, u in zip(groups, units, strict=True)]),
            "image_or_exposure": _named(places),
            "point": _named(points),
            "component": _named(components),
            "v": unit * values["v"],
            "sigma": unit * values["sigma"],
            "redundancy": values["redundancy"],
            "w": values["w"],
        },
        copy=False,  # of arrays that nobody else has
    )


Named = tuple[Sequence[str], Index]
"""Names, and the index of every row's name."""


def _named(parts: Sequence[Named]) -> pd.Categorical:
    """Return a categorical column of text from the rows of several parts."""
    lists = {id(names): names for names, _ in parts}  # points stand in several parts
    first = dict(zip(lists, np.cumsum([0, *map(len, lists.values())]), strict=False))
    code = np.concatenate([first[id(names)] + idx for names, idx in parts])
    names = np.array([name for part in lists.values() for name in part], dtype=object)
    alike, known = pd.factorize(names)  # an exposure may have the name of an image
    return pd.Categorical.from_codes(alike[code], pd.Index(known))


def _observed_at(network: Network, kind: str) -> tuple[Named, Named]:
    """Return the image, exposure or camera, and the point, of every row of a group."""
    block = network.block
    if kind == "image_point":
        image_points = network.image_points
        return (block.images.names, image_points.image_idx), (block.points, image_points.point_idx)
    if kind == "control_point":
        point_idx = network.control.point_idx[~network.held_control]
        return _alike(len(point_idx)), (block.points, point_idx)
    if kind in ("lever_arm", "boresight"):
        known = observed_mountings(block.cameras, kind, network.layout.mount)
        return ([camera.name for camera in block.cameras], known), _alike(len(known))
    if kind == "interior":
        known = observed_interiors(block.cameras, network.layout.interior)
        return ([camera.name for camera in block.cameras], known), _alike(len(known))
    exposure = network.exposure_idx
    return (block.trajectory.exposures, exposure), _alike(len(exposure))


def _alike(n: int, name: str = "") -> Named:
    return (name,), np.zeros(n, dtype=np.intp)


def rejected_table(
    stage: str,
    method: str,
    block: Block,
    rejected: Sequence[Rejection],
    *,
    pose_names: Sequence[str],
) -> pd.DataFrame:
    """Return the table of the observations rejected as gross errors."""
    rows = []
    for r in rejected:
        image_or_exposure, point, quantity = "", "", "measurement"
        if r.kind == "image_point":
            image_or_exposure = block.images.names[block.image_points.image_idx[r.row]]
            point = block.points[block.image_points.point_idx[r.row]]
        elif r.kind == "control_point":
            point = block.points[block.control.point_idx[r.row]]
            quantity = (*COMPONENTS["control_point"], "position")[r.component]  # -1: position
        else:
            image_or_exposure = pose_names[r.row]
            quantity = "position" if r.kind == "gnss" else "attitude"
        reason = f"{quantity}: w = {r.statistic:.1f} exceeds {r.limit:.3g}"
        rows.append((stage, method, r.kind, image_or_exposure, point, r.statistic, reason))
    return _frame("rejected", rows)


def _check_table(stage: str, method: str, bundle: Bundle) -> pd.DataFrame:
    """Return the differences at check points that the bundle estimated as tie points."""
    network = bundle.network
    block = network.block
    n_images = np.bincount(network.image_points.point_idx, minlength=network.n_points)
    check = np.flatnonzero(n_images[block.check.point_idx] >= 2)
    idx = block.check.point_idx[check]
    d, sigma = compare(block, bundle.state.x_m[idx], bundle.solution.cov_points[idx], check)
    return point_table(stage, method, [block.points[i] for i in idx], n_images[idx], d, sigma)


def point_table(
    stage: str, method: str, names: Sequence[str], n_images: Index, d: Array, sigma: Array
) -> pd.DataFrame:
    """Return the differences at points and their sigma, east, north, height in m."""
    frame = pd.DataFrame(np.column_stack([d, sigma]), columns=list(COLUMNS["check_points"][4:]))
    frame.insert(0, "stage", stage)
    frame.insert(1, "method", method)
    frame.insert(2, "point", list(names))
    frame.insert(3, "n_images", n_images)
    return frame


# --- relative orientation --------------------------------------------------------------------


def orientation_tables(
    stage: str, method: str, orientation: RelativeOrientation
) -> dict[str, pd.DataFrame]:
    """Return the parameters of heads in the synthetic frame, and their joint covariance."""
    listed = _orientation_parameters(orientation)
    degrees = np.repeat([1.0, np.degrees(1.0)], 3)
    names, scale = joint_names([head.name for head in orientation.heads], degrees)
    cov = orientation.cov_joint * scale[:, None] * scale
    kept = np.flatnonzero((np.arange(len(cov)) < len(listed)) | (np.diag(cov) > 0))
    return {
        "parameters": _parameter_table(stage, method, listed),
        "covariance": _covariance_table(
            stage, method, [names[i] for i in kept], cov[np.ix_(kept, kept)]
        ),
    }


def _orientation_parameters(orientation: RelativeOrientation) -> list[Parameter]:
    """Return the positions (mm) and angles (degrees) of all heads as results report them."""
    values = np.hstack([orientation.xyz_mm, np.degrees(orientation.opk)])
    sigma = orientation.sigma * np.repeat([1.0, np.degrees(1.0)], 3)
    return [
        Parameter(
            camera=head.name,
            name=name,
            key=name,
            unit="mm" if j < 3 else "deg",
            value=float(values[k, j]),
            sigma=float(sigma[k, j]),
        )
        for k, head in enumerate(orientation.heads)
        for j, name in enumerate(RELATIVE)
    ]


def joint_names(heads: Sequence[str], angles: Array) -> tuple[list[str], Array]:
    """Return names in the order of `RelativeOrientation.cov_joint`, and factors to their units."""
    names = [f"{head}/{name}" for head in heads for name in RELATIVE]
    interior = [f"{head}/{REPORTED[key][0]}" for head in heads for key in INTERIOR]
    return names + interior, np.concatenate([np.tile(angles, len(heads)), np.ones(len(interior))])
