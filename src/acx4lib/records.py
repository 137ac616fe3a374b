"""Turns what the stages computed into the rows of a results folder, and a calibration back."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from acx4lib import results
from acx4lib._typing import Array, Index
from acx4lib.block import Block
from acx4lib.bundle import Bundle
from acx4lib.calibration import (
    REPORTED,
    Calibration,
    from_bundle,
    is_determined,
    not_determined,
    parameters,
    reported_covariance,
)
from acx4lib.camera import INTERIOR
from acx4lib.frames import Pose, opk_jacobian
from acx4lib.gross_errors import CRITICAL, Rejection
from acx4lib.mounting import Mounting, Mountings
from acx4lib.network import Network
from acx4lib.relative_orientation import RelativeOrientation
from acx4lib.validation import compare

COMPONENTS = {
    "image_point": ("col_px", "row_px"),
    "control_point": ("east_m", "north_m", "height_m"),
    "gnss": ("east_m", "north_m", "height_m"),
    "attitude": ("roll_deg", "pitch_deg", "heading_deg"),
}
"""Components of the residuals of every kind; attitudes turn about the body's x, y, z axes."""

SCALE_LIMIT = 0.01
"""Scale of control against trajectory beyond which something is wrong, not imprecise."""

RELATIVE = ("Xc_mm", "Yc_mm", "Zc_mm", "omega_deg", "phi_deg", "kappa_deg")


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """One method's results, ready to be written.

    Attributes
    ----------
    stage, method : str
    tables : dict of str to DataFrame
        By the names of `results.COLUMNS`.
    summary : dict
        Objects of summary.json.
    """

    stage: str
    method: str
    tables: dict[str, pd.DataFrame]
    summary: dict[str, dict[str, object]] = field(default_factory=dict)


def write(folder: str | Path, stage: str, records: Iterable[Record]) -> None:
    """Write a stage's records in place of what the folder has of this stage.

    Parameters
    ----------
    folder : path
    stage : str
        Old rows of these methods go, also where a method has no record any more.
    records : iterable of Record
    """
    records = list(records)
    names = {name for record in records for name in record.tables}
    merged = {
        name: pd.concat([r.tables[name] for r in records if name in r.tables], ignore_index=True)
        for name in sorted(names)
    }
    summary = {key: value for record in records for key, value in record.summary.items()}
    results.replace(folder, [stage], tables=merged, summary=summary)


# --- bundles ---------------------------------------------------------------------------------


def of_bundle(
    stage: str,
    method: str,
    bundle: Bundle,
    *,
    calibration: Calibration | None = None,
    summary_key: str | None = None,
) -> Record:
    """Return all rows of an adjusted bundle.

    Parameters
    ----------
    stage, method : str
    bundle : Bundle
    calibration : Calibration, optional
        What the method says of its cameras; by default what the bundle does.
    summary_key : str, optional
        By default ``stage/method``.
    """
    said = calibration or from_bundle(bundle)
    tables = calibration_tables(stage, method, said)
    tables["exterior_orientation"] = _exterior_table(stage, method, bundle)
    tables["residuals"] = _residual_table(stage, method, bundle)
    tables["rejected"] = rejected_table(
        stage, method, bundle.network.block, bundle.rejected, pose_names=_exposures(bundle)
    )
    tables["check_points"] = _check_table(stage, method, bundle)
    solution = bundle.solution
    key = summary_key or f"{stage}/{method}"
    unknown = [f"{key}: {line}" for line in not_determined(said)]
    entry: dict[str, object] = {
        "n_observations": solution.n_observations,
        "n_unknowns": solution.n_unknowns,
        "redundancy": solution.redundancy,
        "sigma0_squared": solution.sigma0_sq,
        "chi_square_p": solution.chi_square_p,
        "iterations": solution.iterations,
        "converged": True,
        "n_rejected": len(bundle.rejected),
        "n_left_out": sum(bundle.network.left_out.values()),
        "condition": solution.condition,
        "not_determined": unknown,
        # the two-step methods need more than a flight must give: their gaps end no run
        "left_out": unknown if method.startswith("two_step") else [],
        "notes": _notes(key, bundle),
    }
    return Record(
        stage=stage,
        method=method,
        tables=tables,
        summary={key: entry},
    )


def _notes(key: str, bundle: Bundle) -> list[str]:
    """Return what a user should know of an adjustment, in sentences."""
    notes = [f"{n} tie points {why} left out" for why, n in bundle.network.left_out.items()]
    scale = height_scale(bundle)
    if abs(scale - 1) > SCALE_LIMIT:
        notes.append(
            f"the images stand {100 * (scale - 1):+.1f} % higher above the control points than the "
            "trajectory says: the height system of control or trajectory, or the focal length, "
            "is wrong"
        )
    return [f"{key}: {note}" for note in notes]


def height_scale(bundle: Bundle) -> float:
    """Return the images' height above the control points, adjusted against the trajectory's.

    One where control or trajectory do not say it. The focal length that the bundle estimated is
    part of it: a wrong one moves free orientations, or is moved by observed ones.
    """
    network = bundle.network
    control = network.control.x_m[:, 2]
    images = np.flatnonzero(bundle.oriented)
    if len(control) == 0 or len(images) == 0:
        return 1.0
    declared = network.block.cameras[0].interior.f
    by_focal_length = bundle.state.interiors[0].f / declared
    ground = control.mean()
    observed = network.block.T_m_b_images.r[images, 2] - ground
    adjusted = bundle.T_m_c.r[images, 2] - ground
    scale = float(np.median(adjusted / observed))
    return scale if abs(scale - 1) > abs(by_focal_length - 1) else by_focal_length


def of_mounting(mounting: Mounting) -> Record:
    """Return all rows of one method of the mounting stage."""
    return of_bundle("mounting", mounting.method, mounting.bundle, calibration=mounting.calibration)


def of_mountings(mountings: Mountings) -> list[Record]:
    """Return the records of all methods of the mounting stage, failures included."""
    records = [of_mounting(mounting) for mounting in mountings.methods.values()]
    for method, reason in mountings.failures.items():
        if method == "single_step":
            key = f"mounting/{method}"
            records.append(of_failure("mounting", method, f"{key}: {reason}", summary_key=key))
        else:
            records.append(of_left_out("mounting", method, reason))
    return records


def of_left_out(stage: str, method: str, reason: str) -> Record:
    """Return the record of a method that was left out, with the reason."""
    entry: dict[str, object] = {"converged": False, "left_out": [f"{stage}/{method}: {reason}"]}
    return Record(stage=stage, method=method, tables={}, summary={f"{stage}/{method}": entry})


def of_failure(stage: str, method: str, reason: str, *, summary_key: str) -> Record:
    """Return the record of an adjustment that failed, with the reason."""
    entry: dict[str, object] = {"converged": False, "not_determined": [reason]}
    return Record(stage=stage, method=method, tables={}, summary={summary_key: entry})


def calibration_tables(
    stage: str, method: str, calibration: Calibration
) -> dict[str, pd.DataFrame]:
    """Return the parameters that are determined, and their covariance."""
    keep = np.flatnonzero(is_determined(calibration))
    listed = [parameters(calibration)[i] for i in keep]
    cov = reported_covariance(calibration)[np.ix_(keep, keep)]
    rows = [(stage, method, p.camera, p.name, p.value, p.sigma, p.unit) for p in listed]
    names = [f"{p.camera}/{p.name}" for p in listed]
    return {
        "parameters": _frame("parameters", rows),
        "covariance": _covariance_table(stage, method, names, cov),
    }


def _frame(table: str, rows: Sequence[Sequence[object]]) -> pd.DataFrame:
    return pd.DataFrame(list(rows), columns=list(results.COLUMNS[table]))


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


def _exposures(bundle: Bundle) -> tuple[str, ...]:
    return bundle.network.block.trajectory.exposures


def _exterior_table(stage: str, method: str, bundle: Bundle) -> pd.DataFrame:
    network = bundle.network
    cov = bundle.camera_pose_covariances * bundle.solution.sigma0_sq
    oriented = np.flatnonzero(bundle.oriented)
    names = [network.block.images.names[i] for i in oriented]
    return exterior_table(
        stage, method, network.block, names, T_m_c=bundle.T_m_c[oriented], cov=cov[oriented]
    )


def exterior_table(
    stage: str, method: str, block: Block, names: Sequence[str], *, T_m_c: Pose, cov: Array
) -> pd.DataFrame:
    """Return camera poses against the grid with their standard deviations.

    Parameters
    ----------
    stage, method : str
    block : Block
    names : sequence of str
        Of the images.
    T_m_c : Pose
    cov : ndarray, shape (n, 6, 6)
        Position in m, mapping frame; rotation about the camera's axes, radians.
    """
    enh, opk = block.frame.pose_to_grid(T_m_c)
    R_g_m = block.frame.grid_axes(T_m_c.r)
    to_opk = opk_jacobian(opk)
    cov_r = R_g_m @ cov[:, :3, :3] @ np.swapaxes(R_g_m, 1, 2)
    cov_opk = to_opk @ cov[:, 3:, 3:] @ np.swapaxes(to_opk, 1, 2)
    sigma_r = np.sqrt(np.diagonal(cov_r, axis1=1, axis2=2))
    sigma_opk = np.degrees(np.sqrt(np.diagonal(cov_opk, axis1=1, axis2=2)))
    frame = pd.DataFrame(
        np.column_stack([enh, np.degrees(opk), sigma_r, sigma_opk]),
        columns=list(results.COLUMNS["exterior_orientation"][3:]),
    )
    frame.insert(0, "stage", stage)
    frame.insert(1, "method", method)
    frame.insert(2, "image", list(names))
    return frame


def _residual_table(stage: str, method: str, bundle: Bundle) -> pd.DataFrame:
    network, parts = bundle.network, []
    for group in bundle.solution.groups:
        where, point = _observed_at(network, group.kind)
        used = group.used
        rows, components = np.nonzero(used)
        unit = np.degrees(1.0) if group.kind == "attitude" else 1.0
        parts.append(
            pd.DataFrame(
                {
                    "stage": stage,
                    "method": method,
                    "kind": group.kind,
                    "image_or_exposure": where[rows],
                    "point": point[rows],
                    "component": np.array(COMPONENTS[group.kind], dtype=object)[components],
                    "v": unit * group.v[used],
                    "sigma": unit * group.sigma[used],
                    "redundancy": group.redundancy[used],
                    "w": group.w[used],
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def _observed_at(network: Network, kind: str) -> tuple[Array, Array]:
    """Return the names of image or exposure, and of the point, of every row of a group."""
    points = np.array(network.block.points, dtype=object)
    if kind == "image_point":
        images = np.array(network.block.images.names, dtype=object)
        seen = network.image_points
        return images[seen.image_idx], points[seen.point_idx]
    if kind == "control_point":
        names = points[network.control.point_idx[~network.held_control]]
        return np.full(len(names), "", dtype=object), names
    poses = np.array(network.pose_names, dtype=object)
    return poses, np.full(len(poses), "", dtype=object)


def rejected_table(
    stage: str,
    method: str,
    block: Block,
    rejected: Sequence[Rejection],
    *,
    pose_names: Sequence[str],
) -> pd.DataFrame:
    """Return every observation that was taken out as a gross error."""
    rows = []
    for r in rejected:
        where, point, what = "", "", "measurement"
        if r.kind == "image_point":
            where = block.images.names[block.image_points.image_idx[r.row]]
            point = block.points[block.image_points.point_idx[r.row]]
        elif r.kind == "control_point":
            point = block.points[block.control.point_idx[r.row]]
            what = COMPONENTS["control_point"][r.component]
        else:
            where = pose_names[r.row]
            what = "position" if r.kind == "gnss" else "attitude"
        reason = f"{what}: w = {r.statistic:.1f} exceeds {CRITICAL:g}"
        rows.append((stage, method, r.kind, where, point, r.statistic, reason))
    return _frame("rejected", rows)


def _check_table(stage: str, method: str, bundle: Bundle) -> pd.DataFrame:
    """Return the differences at check points that the bundle estimated as tie points."""
    network = bundle.network
    block = network.block
    seen = np.bincount(network.image_points.point_idx, minlength=network.n_points)
    check = np.flatnonzero(seen[block.check.point_idx] >= 2)
    idx = block.check.point_idx[check]
    d, sigma = compare(block, bundle.state.x_m[idx], bundle.solution.cov_points[idx], check)
    return point_table(stage, method, [block.points[i] for i in idx], seen[idx], d, sigma)


def point_table(
    stage: str, method: str, names: Sequence[str], n_images: Index, d: Array, sigma: Array
) -> pd.DataFrame:
    """Return the differences at points and their sigma, east, north, height in m."""
    frame = pd.DataFrame(
        np.column_stack([d, sigma]), columns=list(results.COLUMNS["check_points"][4:])
    )
    frame.insert(0, "stage", stage)
    frame.insert(1, "method", method)
    frame.insert(2, "point", list(names))
    frame.insert(3, "n_images", n_images)
    return frame


# --- relative orientation --------------------------------------------------------------------


def of_relative_orientation(stage: str, method: str, orientation: RelativeOrientation) -> Record:
    """Return the rows of heads oriented in the synthetic frame."""
    degrees = np.array([1.0, 1.0, 1.0, *np.degrees(np.ones(3))])
    values = np.hstack([orientation.xyz_mm, np.degrees(orientation.opk)])
    sigma = orientation.sigma * degrees
    rows = [
        (stage, method, head.name, name, values[k, j], sigma[k, j], "mm" if j < 3 else "deg")
        for k, head in enumerate(orientation.heads)
        for j, name in enumerate(RELATIVE)
    ]
    names, scale = joint_names([head.name for head in orientation.heads], degrees)
    cov = orientation.cov_joint * scale[:, None] * scale
    kept = np.flatnonzero((np.arange(len(cov)) < len(rows)) | (np.diag(cov) > 0))
    return Record(
        stage=stage,
        method=method,
        tables={
            "parameters": _frame("parameters", rows),
            "covariance": _covariance_table(
                stage, method, [names[i] for i in kept], cov[np.ix_(kept, kept)]
            ),
        },
        summary={f"{stage}/{method}": {"n_exposures": orientation.n_exposures, "converged": True}},
    )


def joint_names(heads: Sequence[str], angles: Array) -> tuple[list[str], Array]:
    """Return the names in the order of `RelativeOrientation.cov_joint` and their unit factors."""
    names = [f"{head}/{name}" for head in heads for name in RELATIVE]
    interior = [f"{head}/{REPORTED[key][0]}" for head in heads for key in INTERIOR]
    return names + interior, np.concatenate([np.tile(angles, len(heads)), np.ones(len(interior))])
